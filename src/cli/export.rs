//! `export`: the page without a server.

use std::{collections::BTreeSet, path::PathBuf};

use anyhow::{Context, Result};
use body_schema::{
    export::{Export, Plan, Written},
    server::{Store, Stored},
};
use body_schema_ask_tell::Session;
use body_schema_scenario::Scenario;
use uuid::Uuid;

use super::{
    BadInput, Seeds, files_of, load_scenario, no_person,
    output::{self, Outputs},
    progress, serve,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Built-in scenarios (see `body-schema scenarios`) or paths of scenario files, whose runs are recorded [default: none: the page computes every built-in scenario itself]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
    /// A session with a robot elsewhere, by the id under which a server keeps it; repeat for several
    #[arg(long = "session", value_name = "ID")]
    sessions: Vec<Uuid>,
    /// Where the server keeps it [default: the platform's folder for data of programs]
    #[arg(long, value_name = "DIR", requires = "sessions")]
    data_dir: Option<PathBuf>,
    /// The folder to write; an earlier export in it is replaced
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A learner, or estimator:policy, as in smoother:random; commas or repeating for several [default: those that the explorer compares]
    #[arg(long = "learner", value_name = "NAME", value_delimiter = ',')]
    learners: Vec<String>,
    /// Seeds to record: numbers and ranges with both ends, as 1,4 or 1..5
    #[arg(long = "seed", value_name = "SEEDS", value_delimiter = ',', default_value = "1", value_parser = Seeds::named)]
    seeds: Vec<Seeds>,
    /// Movements of every run, at most 1000 [default: 100, after the change where the body changes]
    #[arg(long, value_name = "N", value_parser = super::steps)]
    steps: Option<u64>,
    /// Write into a folder that holds other files
    #[arg(long)]
    force: bool,
    /// Where the folder will be served, as https://example.org/demo/: previews of links to it then have a picture
    #[arg(long, value_name = "URL", value_parser = address)]
    address: Option<String>,
    /// Take the page's panel from DIR, which `cargo run -p body-schema-bundle -- DIR` built
    #[arg(long, value_name = "DIR", hide = true)]
    panel_dir: Option<PathBuf>,
}

/// The address of a folder: with a slash at its end.
fn address(text: &str) -> Result<String, String> {
    let host = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    if host.is_none_or(|host| host.is_empty() || host.starts_with('/')) || text.contains(['?', '#', ' ', '"']) {
        return Err("write the address of the folder, as https://example.org/demo/".to_owned());
    }
    Ok(format!("{}/", text.trim_end_matches('/')))
}

pub fn export(arguments: &Arguments) -> Result<()> {
    let scenarios = arguments.scenarios.iter().map(|name| load_scenario(name)).collect::<Result<Vec<Scenario>>>()?;
    let sessions = sessions(arguments)?;
    if scenarios.is_empty() && sessions.is_empty() && (arguments.steps.is_some() || !arguments.learners.is_empty()) {
        let what = "--steps and --learner are of recorded runs; name their scenarios, or leave both out: the page then computes what its \
                    visitors ask for";
        return Err(BadInput(what.to_owned()).into());
    }
    let seeds: BTreeSet<u64> = arguments.seeds.iter().flat_map(Seeds::iter).collect();
    let learners = (!arguments.learners.is_empty()).then_some(arguments.learners.as_slice());
    for scenario in &scenarios {
        no_person(&scenario.chosen(learners)?)?;
    }
    let told = sessions.iter().map(|session| Ok(Plan::told(session, arguments.steps)?));
    let plans = scenarios.iter().map(|scenario| Ok(Plan::new(scenario, learners, arguments.steps)?)).chain(told);
    let plans = plans.collect::<Result<Vec<_>>>()?;
    let names: BTreeSet<&str> = plans.iter().map(|plan| plan.scenario.name.as_str()).collect();
    if names.len() < plans.len() {
        return Err(BadInput("a scenario is named twice, or two have one name; name each once".to_owned()).into());
    }
    let named = arguments.scenarios.iter().zip(&scenarios);
    let mut inputs: Vec<PathBuf> = named.flat_map(|(name, scenario)| files_of(name, scenario)).collect();
    inputs.extend(data_dir(arguments)?.into_iter().chain(arguments.panel_dir.clone()));
    Outputs::default().folder("--out", Some(&arguments.out)).check(&inputs)?;
    let export = Export {
        plans,
        seeds: seeds.into_iter().collect(),
        address: arguments.address.clone(),
        panel_dir: arguments.panel_dir.clone(),
    };
    let bar = progress::bar(export.steps(), "recording");
    let Written { files, bytes } = export.write(&arguments.out, arguments.force, &|| bar.inc(1))?;
    bar.finish_and_clear();
    let out = arguments.out.display();
    output::say(format!("wrote {files} files, {:.1} MB, to {out}", bytes as f64 / 1e6))?;
    output::say(format!("any static host serves it; here: python3 -m http.server -d {out}"))
}

/// The folder of stored sessions, if any are exported.
fn data_dir(arguments: &Arguments) -> Result<Option<PathBuf>> {
    let folder = || arguments.data_dir.clone().map_or_else(serve::usual_data_dir, Ok);
    (!arguments.sessions.is_empty()).then(folder).transpose()
}

/// The requested stored sessions.
fn sessions(arguments: &Arguments) -> Result<Vec<Session>> {
    let Some(folder) = data_dir(arguments)? else { return Ok(Vec::new()) };
    let mend = || format!("no sessions can be read in {}; name the server's folder with --data-dir", folder.display());
    let store = Store::read(&folder).with_context(mend)?;
    let session = |id: &Uuid| {
        let stored = store.load(*id).with_context(mend)?;
        let unknown =
            || BadInput(format!("there is no session {id} in {}; GET /v1/sessions lists them", folder.display()));
        let Stored { setup, events, .. } = stored.ok_or_else(unknown)?;
        Session::replay(setup, events).with_context(|| format!("session {id} cannot be taken up"))
    };
    arguments.sessions.iter().map(session).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_that_of_a_folder() {
        for text in ["https://example.org/demo", "https://example.org/demo/"] {
            assert_eq!(address(text).as_deref(), Ok("https://example.org/demo/"));
        }
        for text in ["", "example.org", "ftp://example.org", "https://", "https:///a", "https://a/?b", "https://a b"] {
            assert!(address(text).is_err(), "{text}");
        }
    }
}
