//! `scenarios` and `check`.

use std::path::PathBuf;

use anyhow::Result;
use body_schema_diagnostics::{Diagnostic, Examination};
use body_schema_scenario::{BUILTIN, Scenario, ScenarioSummary, builtin};

use super::{
    BadInput, load_scenario,
    output::{self, Outputs},
};

#[derive(Debug, clap::Args)]
pub struct ListArguments {
    /// Write the list as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    /// The path of a scenario file, or a built-in name
    #[arg(value_name = "FILE")]
    file: String,
    /// Fail where something in the data is doubtful
    #[arg(long)]
    strict: bool,
}

pub fn list(arguments: &ListArguments) -> Result<()> {
    Outputs::default().file("--json", arguments.json.as_deref()).check(&[])?;
    let scenarios: Vec<ScenarioSummary> =
        BUILTIN.iter().map(|found| Ok(builtin(found.name)?.summary())).collect::<Result<_>>()?;
    if let Some(path) = &arguments.json {
        return output::write_json(path, &scenarios);
    }
    let rows = scenarios.into_iter().map(|scenario| {
        let learners: Vec<String> = scenario.learners.into_iter().map(|learner| learner.name).collect();
        [
            scenario.name,
            scenario.joints.len().to_string(),
            scenario.parameters.to_string(),
            learners.join(" "),
            scenario.title,
        ]
    });
    let mut table = output::table(["scenario", "joints", "parameters", "learners", "about"], rows);
    for column in table.column_iter_mut().skip(3) {
        column.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    output::say(table)
}

/// The diagnostics about a scenario's data, which are told.
pub fn told(scenario: &Scenario) -> Vec<Diagnostic> {
    let Examination { diagnostics, unjudged, .. } = scenario.examine().unwrap_or_default();
    for diagnostic in &diagnostics {
        output::tell(format_args!("warning: {diagnostic}"));
    }
    if let Some(why) = unjudged {
        output::tell(format_args!(
            "note: units, signs, zeros and order of the joints' columns could not be checked: {why}"
        ));
    }
    diagnostics
}

pub fn check(arguments: &CheckArguments) -> Result<()> {
    let scenario = load_scenario(&arguments.file)?;
    scenario.check_prior()?;
    let summary = scenario.summary();
    output::say(format!(
        "{}: valid scenario `{}`: {} joints, {} parameters to learn, learners {}",
        arguments.file,
        summary.name,
        summary.joints.len(),
        summary.parameters,
        summary.learners.iter().map(|learner| learner.name.as_str()).collect::<Vec<_>>().join(", ")
    ))?;
    let diagnostics = told(&scenario);
    match diagnostics.len() {
        0 => Ok(()),
        _ if !arguments.strict => Ok(()),
        1 => Err(BadInput(format!("{}: there is 1 doubt about the data, told above", arguments.file)).into()),
        count => {
            Err(BadInput(format!("{}: there are {count} doubts about the data, told above", arguments.file)).into())
        }
    }
}
