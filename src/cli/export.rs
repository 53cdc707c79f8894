//! `export`: the page without a server.

use std::{collections::BTreeSet, path::PathBuf};

use anyhow::{Context, Result};
use body_schema::{
    export::{Export, Opening, Written},
    server::{Store, Stored},
};
use body_schema_ask_tell::Session;
use body_schema_scenario::Scenario;
use uuid::Uuid;

use super::{
    BadInput, files_of, load_scenario,
    output::{self, Outputs},
    serve,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scenario that the page opens with: a built-in one (see `body-schema scenarios`) or the path of a file; further files are added to its menu [default: the page's own]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
    /// A session with a robot elsewhere to show, by the id under which a server keeps it; repeat for several
    #[arg(long = "session", value_name = "ID")]
    sessions: Vec<Uuid>,
    /// Where the server keeps it [default: the platform's folder for data of programs]
    #[arg(long, value_name = "DIR", requires = "sessions")]
    data_dir: Option<PathBuf>,
    /// The folder to write; an earlier export in it is replaced
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A learner that the page opens with, or estimator:policy, as in smoother:random; commas or repeating for several [default: those that the explorer compares]
    #[arg(long = "learner", value_name = "NAME", value_delimiter = ',', requires = "scenarios")]
    learners: Vec<String>,
    /// The seed that the page opens with; its visitors choose any other
    #[arg(long, value_name = "SEED", value_parser = seed)]
    seed: Option<u64>,
    /// The movement up to which the page plays [default: the scenario's own]
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

/// One seed.
fn seed(text: &str) -> Result<u64, String> {
    let several = text.contains([',']) || text.contains("..");
    let hint = if several {
        "name the one that the page opens with: its visitors choose any other"
    } else {
        "write one, as 4711"
    };
    text.parse().map_err(|_| format!("`{text}` is no seed; {hint}"))
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
    let ids: Vec<String> = arguments.sessions.iter().map(Uuid::to_string).collect();
    let names: BTreeSet<&str> = scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
    if names.len() < scenarios.len() || ids.iter().collect::<BTreeSet<_>>().len() < ids.len() {
        let what = "a scenario or session is named twice, or two scenarios have one name; name each once";
        return Err(BadInput(what.to_owned()).into());
    }
    let opening = Opening {
        scenario: scenarios.first(),
        session: ids.first().filter(|_| scenarios.is_empty()).map(String::as_str),
        seed: arguments.seed,
        learners: &arguments.learners,
        steps: arguments.steps,
    };
    opening.check()?;
    let named =
        || arguments.scenarios.iter().zip(&scenarios).map(|(name, scenario)| (files_of(name, scenario), scenario));
    let mut inputs: Vec<PathBuf> = named().flat_map(|(files, _)| files).collect();
    inputs.extend(data_dir(arguments)?.into_iter().chain(arguments.panel_dir.clone()));
    Outputs::default().folder("--out", Some(&arguments.out)).check(&inputs)?;
    let export = Export {
        // Those that are built in are there already.
        scenarios: named().filter(|(files, _)| !files.is_empty()).map(|(_, scenario)| scenario).collect(),
        sessions: ids.iter().cloned().zip(&sessions).collect(),
        opening,
        address: arguments.address.clone(),
        panel_dir: arguments.panel_dir.clone(),
        commit: super::commit(),
    };
    let Written { files, bytes } = export.write(&arguments.out, arguments.force)?;
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
    let hint = || format!("no sessions can be read in {}; name the server's folder with --data-dir", folder.display());
    let store = Store::read(&folder).with_context(hint)?;
    let session = |id: &Uuid| {
        let stored = store.load(*id).with_context(hint)?;
        let unknown =
            || BadInput(format!("there is no session {id} in {}; GET /v1/sessions lists them", folder.display()));
        let Stored { setup, events, .. } = stored.ok_or_else(unknown)?;
        let session = Session::replay(setup, events).with_context(|| format!("session {id} cannot be taken up"))?;
        match session.latest().step {
            0 => Err(BadInput(format!("session {id} has no observation yet; report one first")).into()),
            _ => Ok(session),
        }
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
