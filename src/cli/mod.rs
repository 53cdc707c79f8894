//! Commands, their arguments, and the handling of their errors.

mod calibrate;
mod compare;
mod designs;
mod discover;
mod export;
mod init;
mod input;
mod limits;
mod logging;
mod merge;
mod meshes;
mod observability;
mod output;
mod paper;
mod part;
mod progress;
mod repair;
mod run;
mod scenarios;
mod seeds;
mod serve;
mod signals;
mod sweep;
mod until;
mod verify;
mod watch;

use std::{path::PathBuf, process::ExitCode, sync::LazyLock};

use anyhow::{Context, Result};
use body_schema::export::ExportError;
use body_schema_calibration::CalibrationError;
use body_schema_paper::PaperError;
use body_schema_recording::{Appearance, ENLARGED, rerun_version};
use body_schema_scenario::{LearnerSpec, PolicyKind, Replacement, Scenario, ScenarioError};
use clap::{Parser, Subcommand};

use input::{files_of, load_scenario};
use seeds::Seeds;

/// The commit that the program was built from, if that is known.
fn commit() -> Option<&'static str> {
    let commit = git_version::git_version!(args = ["--always", "--abbrev=9", "--exclude=*"], fallback = "");
    (!commit.is_empty()).then_some(commit)
}

/// The version with the commit that it was built from, where that is known, and the version of Rerun whose recordings it writes.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let commit = commit().map(|commit| format!("commit {commit}, ")).unwrap_or_default();
    format!("{} ({commit}Rerun {})", env!("CARGO_PKG_VERSION"), rerun_version())
});

/// The program that issues certificates.
fn software() -> String {
    format!("body-schema {}", VERSION.as_str())
}

/// Learn a robot's kinematic body schema from a few well-chosen movements, and watch it happen.
///
/// Without a command: `serve`.
#[derive(Debug, Parser)]
#[command(version = VERSION.as_str(), about, max_term_width = 100, subcommand_negates_reqs = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Open the explorer: a web page and its HTTP interface
    Serve(Box<serve::Arguments>),
    /// Run the learners of a scenario once, and keep what you want of it
    Run(run::Arguments),
    /// Run the learners of a scenario over many seeds, and compare them
    Compare(compare::Arguments),
    /// Put the parts of a comparison together (`compare --shard`): what one run gives
    Merge(merge::Arguments),
    /// Try a grid of values in a scenario, and rank them by a learner's own median
    Sweep(sweep::Arguments),
    /// Calibrate a robot by a table of measurements: a corrected URDF, and a report on data that it has not seen
    Calibrate(calibrate::Arguments),
    Verify(verify::Arguments),
    /// Watch a calibrated robot: tell which joint's zero or link has moved, by how much, since when
    #[command(long_about = watch::ABOUT)]
    Watch(watch::Arguments),
    /// Begin a calibration file from a URDF and a table, and say what was guessed
    Init(init::Arguments),
    /// Find a robot's description in a table alone: which column turns which part, or the movement that would tell
    #[command(long_about = discover::ABOUT)]
    Discover(discover::Arguments),
    /// Say before any measurement what can be determined, and how well by how many postures
    Observability(observability::Arguments),
    /// Rerun the paper's experiments, and set the outcome beside its figures and numbers
    Paper(paper::Arguments),
    /// Write the page with its engine to a folder that any static host serves
    Export(export::Arguments),
    /// Mend what a crash left of sessions that a server keeps, or of a recording
    #[command(long_about = repair::ABOUT)]
    Repair(repair::Arguments),
    /// List the built-in scenarios
    Scenarios(scenarios::ListArguments),
    /// Say whether a scenario file is valid, and if not, what to mend
    Check(scenarios::CheckArguments),
}

/// The choice of a scenario, and of its learners.
#[derive(Debug, clap::Args)]
struct ScenarioArguments {
    /// A built-in scenario (see `body-schema scenarios`) or the path of a scenario file
    #[arg(value_name = "SCENARIO")]
    scenario: String,
    /// A learner of the scenario, or estimator:policy, as in smoother:random; commas or repeating for several [default: the scenario's
    /// main ones]
    #[arg(long = "learner", value_name = "NAME", value_delimiter = ',')]
    learners: Vec<String>,
}

/// Other values than those of the scenario's file.
#[derive(Debug, clap::Args)]
struct Replacements {
    /// A key of the scenario file and the value that it is to have, as `sensor.sigma_m=0.002`; repeat for several. Parts of the key are
    /// separated by dots, and a table in a list is named: `robot.joint.elbow.learned=false`
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<Replacement>,
}

impl ScenarioArguments {
    /// The scenario and the names of the learners, checked against each other.
    fn load(&self) -> Result<(Scenario, Option<&[String]>)> {
        self.load_with(&[])
    }

    /// The same with other values.
    fn load_with(&self, set: &[Replacement]) -> Result<(Scenario, Option<&[String]>)> {
        let scenario = load_scenario(&self.scenario)?;
        let scenario = if set.is_empty() { scenario } else { scenario.with(set)? };
        let learners = (!self.learners.is_empty()).then_some(self.learners.as_slice());
        let chosen = scenario.chosen(learners)?;
        no_person(&chosen)?;
        Ok((scenario, learners))
    }

    /// How it looks.
    fn appearance(&self, scenario: &Scenario) -> Appearance {
        meshes::appearance(&self.scenario, scenario)
    }

    /// The files that it was read from.
    fn files(&self, scenario: &Scenario) -> Vec<PathBuf> {
        files_of(&self.scenario, scenario)
    }
}

/// What was replaced in a scenario, behind its name.
fn replaced(set: &[String]) -> String {
    if set.is_empty() { String::new() } else { format!(" with {}", set.join(", ")) }
}

/// The most movements: nobody waits for more.
const MOST_STEPS: u64 = 1_000_000_000;

/// Parses a number of movements.
fn steps(text: &str) -> Result<u64, String> {
    let steps = text.parse().ok().filter(|steps| *steps <= MOST_STEPS);
    steps.ok_or_else(|| format!("write a number of movements from 0 to {MOST_STEPS}"))
}

/// Parses how many times as large something is drawn.
fn enlarged(text: &str) -> Result<f64, String> {
    let times = text.parse().ok().filter(|times| ENLARGED.contains(times));
    times.ok_or_else(|| format!("write a number from {} to {}", ENLARGED.start(), ENLARGED.end()))
}

/// Parses a length that is plausible for robots.
fn millimetres(text: &str) -> Result<f64, String> {
    const MOST: f64 = 1e6;
    let mm = text.parse::<f64>().ok().filter(|mm| *mm > 0.0 && *mm <= MOST);
    mm.ok_or_else(|| format!("a number of millimetres above 0 is needed, at most {MOST}, as 50"))
}

/// Refuses learners for which a person chooses, which is impossible on the command line.
fn no_person(learners: &[LearnerSpec]) -> Result<()> {
    let Some(LearnerSpec { name, .. }) = learners.iter().find(|spec| spec.policy == PolicyKind::Human) else {
        return Ok(());
    };
    Err(BadInput(format!(
        "a person chooses every movement of `{name}`, and here nobody can; open the explorer with `body-schema serve`, or \
         set its movements over HTTP (POST /v1/sessions/{{id}}/learners/{name}/configuration)"
    ))
    .into())
}

/// Carries out a command.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    // These bring what is under way to a good end.
    if !matches!(arguments.command, None | Some(Command::Serve(_) | Command::Run(_) | Command::Watch(_))) {
        signals::end_at_once()?;
    }
    match arguments.command {
        None => serve::serve(&serve::Arguments::default()),
        Some(Command::Serve(arguments)) => serve::serve(&arguments),
        Some(Command::Run(arguments)) => run::run(&arguments),
        Some(Command::Compare(arguments)) => compare::compare(&arguments),
        Some(Command::Merge(arguments)) => merge::merge(&arguments),
        Some(Command::Sweep(arguments)) => sweep::sweep(&arguments),
        Some(Command::Calibrate(arguments)) => calibrate::calibrate(&arguments),
        Some(Command::Verify(arguments)) => verify::verify(&arguments),
        Some(Command::Watch(arguments)) => return watch::watch(&arguments),
        Some(Command::Init(arguments)) => init::init(&arguments),
        Some(Command::Discover(arguments)) => discover::discover(&arguments),
        Some(Command::Observability(arguments)) => observability::observability(&arguments),
        Some(Command::Paper(arguments)) => paper::paper(&arguments),
        Some(Command::Export(arguments)) => export::export(&arguments),
        Some(Command::Repair(arguments)) => repair::repair(&arguments),
        Some(Command::Scenarios(arguments)) => scenarios::list(&arguments),
        Some(Command::Check(arguments)) => scenarios::check(&arguments),
    }?;
    Ok(ExitCode::SUCCESS)
}

/// The number of threads.
#[derive(Debug, clap::Args)]
struct Threads {
    /// Number of threads, 512 at most [default: one per core]; only times depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    threads: Option<u16>,
}

impl Threads {
    /// Runs `work` on these threads, or on the common pool.
    fn run<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        match self.threads {
            None => work(),
            Some(count) => rayon::ThreadPoolBuilder::new()
                .num_threads(count.into())
                .build()
                .with_context(|| format!("cannot start {count} threads"))?
                .install(work),
        }
    }
}

/// An error in what the user gave, which the user can correct.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct BadInput(String);

/// Whether the error lies in the request rather than in carrying it out.
fn is_bad_input(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.is::<BadInput>()
            || cause.downcast_ref::<ExportError>().is_some_and(ExportError::is_bad_input)
            || cause.downcast_ref::<CalibrationError>().is_some_and(CalibrationError::is_bad_input)
            || cause.downcast_ref::<PaperError>().is_some_and(PaperError::is_bad_input)
            || cause.downcast_ref::<ScenarioError>().is_some_and(|error| !matches!(error, ScenarioError::Experiment(_)))
    })
}

/// The exit code: 2 if the error lies in the request, the shell's code after a signal, otherwise 1.
pub fn exit_code(error: &anyhow::Error) -> u8 {
    match error.downcast_ref::<signals::Interrupted>() {
        Some(interrupted) => interrupted.signal.exit_code(),
        None if is_bad_input(error) => 2,
        None => 1,
    }
}

/// The error with its causes. Many of our errors name their cause in the middle of their text, before the hint; a cause
/// that is already there is not repeated.
pub fn told(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |told, cause| match told.as_str() {
        "" => cause,
        _ if told.contains(&cause) => told,
        _ => format!("{told}: {cause}"),
    })
}

/// Whether the reader of our output went away, as `head` does, which is no failure.
pub fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
    })
}

/// The number of steps to run: as requested, or else the scenario's; at most the number of recorded movements.
fn steps_of(scenario: &Scenario, asked: Option<u64>) -> Result<u64> {
    let steps = asked.unwrap_or(scenario.steps);
    let available = scenario.experiment(1, None).context("the scenario cannot start")?.remaining();
    match available {
        Some(available) if steps > available as u64 => Err(BadInput(format!(
            "scenario `{}` replays recorded data with {available} movements, {steps} were asked; use --steps {available} or fewer",
            scenario.name
        ))
        .into()),
        _ => Ok(steps),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_of_all_commands_go_together() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }

    /// Numbers are multiplied, and room is made for them.
    #[test]
    fn every_number_has_an_end() {
        use clap::{CommandFactory, Parser};
        const GREAT: &str = "18446744073709551615";
        for command in Arguments::command().get_subcommands() {
            for option in command.get_arguments() {
                let name = option.get_value_names().and_then(|names| names.first()).map_or("", |name| name.as_str());
                if !["N", "K", "MIB", "KIB", "S", "MM"].contains(&name) {
                    continue;
                }
                let option = format!("--{}", option.get_long().expect("an option"));
                let error = Arguments::try_parse_from(["body-schema", command.get_name(), &option, GREAT]);
                let error = error.map_err(|error| error.to_string()).expect_err(&option);
                assert!(error.contains(&option) && error.contains(GREAT), "{}: {error}", command.get_name());
            }
        }
    }

    #[test]
    fn a_cause_is_told_once() {
        let cause = || std::io::Error::from(std::io::ErrorKind::NotFound);
        let named = PaperError::Write { path: "a".into(), source: cause() };
        let text = told(&anyhow::Error::new(named).context("cannot run"));
        assert_eq!(
            text,
            "cannot run: cannot write a: entity not found; name a folder that may be written to with --out"
        );
        assert_eq!(told(&anyhow::Error::new(cause()).context("cannot write b")), "cannot write b: entity not found");
    }
}
