//! `watch`: later sightings, held against the calibrated robot.

mod follow;
mod listen;
mod tell;
mod words;

use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Result;
use body_schema_calibration::Case;
use body_schema_sightings::{
    LeftOut, Outcome, Question, Reader, Row, Settled, SightingsError, Standing, in_order, refuse_followers, split,
};

use super::{
    BadInput, files_of, load_scenario,
    output::{self, Outputs},
    signals::Interruption,
};
use tell::Teller;
use words::{conclude, introduce, warn};

/// The long help.
pub const ABOUT: &str = "Watch a calibrated robot: tell which joint's zero or link has moved, by how much, since when\n\n\
The robot is calibrated by the rows that FILE learns from. Then the rows of --table come in the order of their times, or those that FILE \
holds out. An alarm names the joint, the size with its deviation, since when, and three movements that would tell best.\n\n\
Exit code: 0 if the robot is as it was calibrated, 1 if a change stands at the end, 2 for any error.";

/// The most sightings a year.
const MOST_PER_YEAR: f64 = 1e9;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The path of a calibration file (what `calibrate` takes), of a session as it was saved, or a built-in scenario with measured data
    #[arg(value_name = "FILE")]
    file: String,
    /// A table of later rows, with the columns of the one that is learned from [default: the rows that FILE holds out]
    #[arg(long, value_name = "CSV")]
    table: Option<PathBuf>,
    /// Go on: rows that are appended to the table are taken as they come
    #[arg(long)]
    follow: bool,
    /// How many false alarms a year are allowed, at most, on average
    #[arg(long, value_name = "RATE", default_value_t = 0.5, value_parser = positive)]
    false_alarms_per_year: f64,
    /// Sightings a year, where rows have no time [default: 52, and told so]
    #[arg(long, value_name = "RATE", value_parser = positive)]
    per_year: Option<f64>,
    /// The column of the time: seconds, or as 2026-06-01T08:30:00Z [default: `time`, `timestamp`, `date` or the like, if there is one]
    #[arg(long, value_name = "COLUMN")]
    time: Option<String>,
    /// A column with which zeros may drift, such as a temperature or a load: its drift is learned and told, and is no alarm
    #[arg(long, value_name = "COLUMN")]
    covariate: Option<String>,
    /// The change of the covariate over which a zero may well drift by 0.2 degrees
    #[arg(long, value_name = "UNITS", default_value_t = 10.0, value_parser = positive)]
    covariate_span: f64,
    /// The share of the noise's variance that sightings at one posture have in common, where it is known [default: an alarm needs the
    /// evidence both with none and with 0.8]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    shared: Option<f64>,
    /// Add alarms and recoveries to FILE, one JSON object a line; what it holds already is not told anew
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Send alarms and recoveries to this address by HTTP POST, as JSON (`http://` only: put a relay before https)
    #[arg(long, value_name = "URL", value_parser = webhook)]
    webhook: Option<String>,
    /// With --follow: show a page (/watch), answer GET /metrics (Prometheus) and GET /status, and take POST /sightings, at this address
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// Write the calibrated description with what has moved to FILE, at the end if a change stands that is the robot's
    #[arg(long, value_name = "URDF")]
    mend: Option<PathBuf>,
    /// Write everything as JSON to FILE at the end, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| *number > 0.0 && *number <= MOST_PER_YEAR);
    number.ok_or_else(|| format!("a number above 0 is needed, at most {MOST_PER_YEAR:.0}"))
}

fn share(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (0.0..1.0).contains(number));
    number.ok_or_else(|| "a number from 0 to below 1 is needed".to_owned())
}

fn webhook(text: &str) -> Result<String, String> {
    match text.parse::<reqwest::Url>() {
        Ok(url) if url.scheme() == "http" => Ok(text.to_owned()),
        Ok(url) if url.scheme() == "https" => {
            Err("https is not spoken here; name a relay on this machine by http://, which passes it on".to_owned())
        }
        _ => Err("an address as http://127.0.0.1:8080/alarms is needed".to_owned()),
    }
}

pub fn watch(arguments: &Arguments) -> Result<ExitCode> {
    // 1 says that a change stands: whatever goes wrong is 2.
    run(arguments).map_err(|error| match super::exit_code(&error) {
        1 => BadInput(super::told(&error)).into(),
        _ => error,
    })
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    if arguments.follow && arguments.table.is_none() && arguments.listen.is_none() {
        return Err(BadInput("--follow needs the table that rows are appended to: --table CSV".to_owned()).into());
    }
    if arguments.listen.is_some() && !arguments.follow {
        return Err(
            BadInput("--listen needs --follow: without it the command ends after the last row".to_owned()).into()
        );
    }
    let interruption = Interruption::watch()?;
    let scenario = load_scenario(&arguments.file)?;
    scenario.check_prior()?;
    let case = Case::new(&scenario)?;
    let inputs: Vec<PathBuf> =
        files_of(&arguments.file, &scenario).into_iter().chain(arguments.table.clone()).collect();
    // A log that is there is read and added to; one that is not is made.
    let (log, new_log) = match arguments.log.as_deref() {
        Some(log) if log.exists() => (Some(log.to_owned()), None),
        log => (None, log),
    };
    let mend = arguments.mend.as_deref();
    let outputs =
        Outputs::default().file("--log", new_log).file("--mend", mend).file("--json", arguments.json.as_deref());
    outputs.check(&inputs.iter().cloned().chain(log).collect::<Vec<_>>())?;
    let to_stdout = arguments.json.as_deref().is_some_and(output::is_stdout);
    refuse_followers(&case)?;
    if mend.is_some() && scenario.robot.described.is_none() {
        return Err(BadInput("--mend needs a robot that is described by a URDF".to_owned()).into());
    }
    let split = split(&case, arguments.table.is_none() && !arguments.follow);
    let (learned, held_out) = split.map_err(|error| match error {
        SightingsError::Refused(why) => BadInput(format!("{why} with --table CSV")).into(),
        other => anyhow::Error::from(other),
    })?;
    let reader = Reader::new(&case, arguments.time.clone(), arguments.covariate.clone())?;
    // What cannot be read is told before anybody waits.
    let mut tail = arguments.table.as_deref().map(|path| follow::Tail::open(path, arguments.follow)).transpose()?;
    let (mut rows, left_out) = match &mut tail {
        Some(tail) => tail.read(&reader, arguments.follow)?,
        None => (reader.held_out(&case, &held_out)?, Vec::new()),
    };
    in_order(&mut rows);
    let has_lines = arguments.table.is_some() || !arguments.follow;
    let mut teller = Teller::new(arguments.log.as_deref(), arguments.webhook.clone(), to_stdout, has_lines, &inputs)?;
    let question = Question {
        false_alarms_per_year: arguments.false_alarms_per_year,
        per_year: arguments.per_year,
        shared: arguments.shared,
        covariate_span: arguments.covariate_span,
        goes_on: arguments.follow,
    };
    let bar = super::progress::bar(1, "calibrating");
    let mut state = question.begin(&case, &reader, &learned, &rows)?;
    bar.finish_and_clear();
    let told = Settled { learned_rows: learned.len(), false_alarms_per_year: arguments.false_alarms_per_year };
    if !to_stdout {
        introduce(arguments, &state, &told, &rows)?;
    }
    for it in left_out {
        leave_out(&mut state, it);
    }
    for row in rows {
        if interruption.signal().is_some() {
            break;
        }
        take(&mut state, row, &mut teller)?;
    }
    if arguments.follow && interruption.signal().is_none() {
        let shown = !to_stdout;
        follow::follow(arguments.listen, &reader, tail, &mut state, &mut teller, &told, &interruption, shown)?;
    }
    teller.end();
    if state.watch.sightings() == 0 && !arguments.follow && interruption.signal().is_none() {
        let why = state.left_out.first().map_or_else(String::new, |it| format!(": line {}: {}", it.line, it.why));
        return Err(BadInput(format!("no row says anything of this robot, so that nothing is known of it{why}")).into());
    }
    if let Some(path) = &arguments.json {
        output::write_json(path, &told.report(&state, true))?;
    }
    if !to_stdout {
        conclude(&state)?;
    }
    if let Some(path) = mend {
        let said = write_mended(path, &case, &state)?;
        if to_stdout {
            output::tell(said);
        } else {
            output::say(said)?;
        }
    }
    Ok(if state.watch.is_changed() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Writes the description with what has moved, if that is a part of it, and gives what became of it.
fn write_mended(path: &Path, case: &Case<'_>, state: &Standing) -> Result<String> {
    let Some(mended) = state.watch.mended() else {
        let why = if state.watch.is_changed() { "what has changed has no numbers" } else { "nothing has changed" };
        return Ok(format!("{} is not written: {why}", shown(path)));
    };
    let as_calibrated = case.urdf_of(&state.watch.body().state)?;
    let mended = case.urdf_with(&mended.state, &mended.links)?;
    let Some(mended) = mended.filter(|mended| Some(mended) != as_calibrated.as_ref()) else {
        return Ok(format!("{} is not written: what has moved is no part of the robot's description", shown(path)));
    };
    output::write(path, &mended)?;
    Ok(format!(
        "wrote {}: the calibrated description with what has moved; what a zero has moved by is in it, to be added to no reading as well",
        shown(path)
    ))
}

/// Takes a row, and tells what comes of it.
fn take(state: &mut Standing, row: Row, teller: &mut Teller) -> Result<Outcome> {
    let (line, repeated) = (row.line, state.clock.repeated);
    if row.time_s.is_none() && std::mem::take(&mut state.assumes_a_week) {
        let rate = 1.0 / state.clock.step;
        output::tell(format_args!(
            "warning: line {line} has no time: {rate:.0} sightings a year are assumed; say how many with --per-year, or name a column with \
             --time (told once)"
        ));
    }
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let outcome = state.take(row, now.map_or(f64::INFINITY, |now| now.as_secs_f64()));
    if repeated == 0 && state.clock.repeated > 0 {
        output::tell(format_args!(
            "warning: the time in line {line} is not later than that of a row before it; such rows share a usual gap between sightings, and \
             when a change began is known less well (told once)"
        ));
    }
    match &outcome {
        Outcome::Heard(_, Some(told)) => teller.tell(told)?,
        Outcome::Heard(_, None) => {}
        Outcome::LeftOut(it) => warn(&state.left_out, it),
    }
    Ok(outcome)
}

fn leave_out(state: &mut Standing, it: LeftOut) {
    state.left_out.push(it.clone());
    warn(&state.left_out, &it);
}

/// The path as it is shown.
fn shown(path: &Path) -> String {
    path.display().to_string()
}
