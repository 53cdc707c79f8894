//! `observability`: what can be determined before any measurement, and with how many postures.

use std::path::PathBuf;

use anyhow::{Context, Result};
use body_schema_wire::{ExpectedError, IndexTable, ObservabilityReport};

use super::{
    input::{files_of, load_robot},
    output::{self, Failures, Outputs},
    progress,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The path of a scenario or calibration file, with a table or without, or a built-in scenario; recorded rows do not count
    #[arg(value_name = "FILE")]
    file: String,
    /// Number of postures to look at
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..=1000))]
    postures: u16,
    /// The error of predictions that is wanted, millimetres [default: the file's `[settled]`]
    #[arg(long, value_name = "MM", value_parser = super::millimetres)]
    accuracy: Option<f64>,
    /// Write the outcome as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub fn observability(arguments: &Arguments) -> Result<()> {
    let scenario = load_robot(&arguments.file)?;
    scenario.check_prior()?;
    Outputs::default().file("--json", arguments.json.as_deref()).check(&files_of(&arguments.file, &scenario))?;
    let wanted_m = arguments.accuracy.map_or(scenario.settled_below_m, |mm| mm * 1e-3);
    let (prospect, postures) = (scenario.prospect()?, usize::from(arguments.postures));
    let bar = progress::bar(prospect.steps(postures) as u64, "postures");
    let found = prospect.observability(postures, wanted_m, &|| bar.inc(1));
    bar.finish_and_clear();
    let found = found.with_context(|| format!("cannot choose postures for scenario `{}`", scenario.name))?;
    let names = scenario.robot.called();
    let report = ObservabilityReport::of(&found, &prospect, &names, &scenario.name, &scenario.title);
    let mut failures = Failures::default();
    if let Some(path) = &arguments.json {
        failures.keep(output::write_json(path, &report));
        if output::is_stdout(path) {
            return failures.end();
        }
    }
    summarise(&report)?;
    failures.end()
}

fn summarise(found: &ObservabilityReport) -> Result<()> {
    let parameters = &found.parameters;
    output::say(format!(
        "{}: {} parameters to learn, and measurements can determine {} directions among them",
        found.scenario, parameters.learned, parameters.rank
    ))?;
    for said in parameters.undetermined.iter().chain(found.weak.iter().map(|weak| &weak.said)) {
        output::say(said)?;
    }
    output::say(format!("best postures are chosen by {}\n", found.criterion))?;
    let errors = told(&found.errors).map(|point| {
        let mm = |value: f64| format!("{value:.3}");
        [point.postures.to_string(), mm(point.best_mm), mm(point.random_median_mm)]
    });
    output::say(output::table(["postures", "expected error, best (mm)", "random (mm)"], errors))?;
    output::say(format!("{}\n", found.accuracy.said))?;
    let number = found.postures;
    let after = [format!("best {number}"), format!("random {number}")];
    output::say(output::table(["index", &after[0], &after[1]], indices(&found.indices)))?;
    output::say("")?;
    let deviations = found.deviations.iter().map(|deviation| {
        let value = |value: f64| format!("{value:.4}");
        let name = format!("{} ({})", deviation.parameter, deviation.unit);
        [name, value(deviation.prior), value(deviation.best), value(deviation.random_median)]
    });
    output::say(output::table(["standard deviation of", "before", &after[0], &after[1]], deviations))
}

/// The points that are printed, few enough to read: 1, 2, 3, 5, 8, 12, 20, 30, 50, … and the last.
fn told(errors: &[ExpectedError]) -> impl Iterator<Item = &ExpectedError> {
    let mut next = 1;
    errors.iter().filter(move |point| {
        let is_told = point.postures >= next || point.postures == errors.len();
        if is_told {
            next = (point.postures * 8).div_ceil(5).max(point.postures + 1);
        }
        is_told
    })
}

fn indices(table: &IndexTable) -> [[String; 3]; 5] {
    let IndexTable { best, random_median: random } = table;
    let line = |name: &str, best: f64, random: f64| [name.to_owned(), format!("{best:.4}"), format!("{random:.4}")];
    [
        line("O1, the mean of all σ, by √n", best.o1, random.o1),
        line("O2, least by greatest σ", best.o2, random.o2),
        line("O3, least σ", best.o3, random.o3),
        line("O4, noise amplification", best.o4, random.o4),
        line("O5, 1/Σ 1/σ", best.o5, random.o5),
    ]
}
