//! `repair`: repairs what a crash left.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use body_schema::server::{Finding, Held, State};
use body_schema_recording::{examine, restore};

use super::{
    BadInput,
    output::{self, Outputs},
};

/// The text of `--help`.
pub const ABOUT: &str = "\
Mend what a crash left of sessions that a server keeps, or of a recording

Looks at a data directory of `serve`, or at a recording, and mends what is damaged. Of everything that it changes it first puts a copy \
aside, named in what it tells.

Sessions with robots elsewhere: the database is checked, and if need be written anew from what can be read; a session's events are \
kept up to the first that is damaged. Recordings (.rrd) that lack their end are written anew up to their last whole message, with a \
footer, so that viewers open them.

Exit code 0 if everything is whole afterwards, 1 if something is not (with --check: if something has to be mended), 2 if there is \
nothing to look at.";

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A data directory of `serve`, whose server has ended, or a recording
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// Write the mended recording to FILE, which must not be there yet, and leave PATH as it is
    #[arg(long, value_name = "FILE", conflicts_with = "check")]
    out: Option<PathBuf>,
    /// Only look, and change nothing
    #[arg(long)]
    check: bool,
}

pub fn repair(arguments: &Arguments) -> Result<()> {
    let Arguments { path, out, check } = arguments;
    Outputs::default().file("--out", out.as_deref()).check(std::slice::from_ref(path))?;
    if let Some(out) = out.as_ref().filter(|out| out.symlink_metadata().is_ok()) {
        let out = out.display();
        return Err(BadInput(format!("{out} is there already; remove it, or name another file with --out")).into());
    }
    let findings = match fs::metadata(path) {
        Err(error) => return Err(BadInput(format!("cannot look at {}: {error}", path.display())).into()),
        Ok(metadata) if metadata.is_dir() && out.is_some() => {
            return Err(BadInput("--out is for a recording; of a folder copies are put aside".to_owned()).into());
        }
        Ok(metadata) if metadata.is_dir() => folder(path, *check)?,
        Ok(_) => vec![recording(path, out.as_deref(), *check)?],
    };
    let row = |Finding { name, state, detail }: &Finding| [name.clone(), word(*state).to_owned(), detail.clone()];
    let mut table = output::table(["what", "state", "detail"], findings.iter().map(row));
    for column in table.column_iter_mut() {
        column.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    output::say(table)?;
    let amiss = findings.iter().filter(|finding| matches!(finding.state, State::Damaged | State::Lost)).count();
    if amiss > 0 {
        bail!("{amiss} of {} are not whole", findings.len());
    }
    Ok(())
}

fn word(state: State) -> &'static str {
    match state {
        State::Whole => "whole",
        State::Damaged => "damaged",
        State::Mended => "mended",
        State::Lost => "lost",
    }
}

/// All sessions and recordings of a folder.
fn folder(path: &Path, check: bool) -> Result<Vec<Finding>> {
    // While it is held no server writes to the recordings either.
    let held = Held::take(path)?;
    let mut recordings: Vec<PathBuf> = fs::read_dir(path)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
        .with_context(|| format!("cannot list {}", path.display()))?;
    recordings.retain(|file| file.extension() == Some(OsStr::new("rrd")));
    recordings.sort();
    let recordings: Vec<Finding> = recordings.iter().map(|file| recording(file, None, check)).collect::<Result<_>>()?;
    let mut findings = held.repair(check)?;
    findings.extend(recordings);
    match findings.is_empty() {
        true => Err(BadInput(format!("there are no sessions and no recordings in {}", path.display())).into()),
        false => Ok(findings),
    }
}

/// Repairs a recording, in its place unless `out` names another file.
fn recording(path: &Path, out: Option<&Path>, check: bool) -> Result<Finding> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let condition = match examine(path) {
        Ok(condition) => condition,
        Err(error) => return Ok(Finding::new(name, State::Lost, format!("{error}; it is left as it is"))),
    };
    let messages = condition.messages;
    let fault = condition.damage.unwrap_or_else(|| "it lacks its end".to_owned());
    if condition.is_complete {
        return Ok(Finding::new(name, State::Whole, format!("{messages} messages")));
    }
    if check {
        let detail = format!("{fault}; the {messages} whole messages before that can be kept");
        return Ok(Finding::new(name, State::Damaged, detail));
    }
    if let Some(out) = out {
        restore(path, out)?;
        let detail = format!("{fault}; {} has the {messages} whole messages before that", out.display());
        return Ok(Finding::new(name, State::Mended, detail));
    }
    let beside = |end: &str| path.with_file_name(format!("{name}.{end}"));
    let names = (1..).map(|number: u32| beside(&format!("before-repair-{number}")));
    let aside = names.into_iter().find(|name| !name.exists()).unwrap_or_else(|| beside("before-repair"));
    let part = beside("part");
    // One that an earlier attempt left.
    drop(fs::remove_file(&part));
    restore(path, &part)?;
    let moved = fs::rename(path, &aside).and_then(|()| {
        // What cannot take its place leaves it to what was there.
        fs::rename(&part, path).or_else(|error| fs::rename(&aside, path).and(Err(error)))
    });
    moved.with_context(|| format!("cannot put {} in its place", part.display()))?;
    let detail =
        format!("{fault}; it has the {messages} whole messages before that, and is {} as it was", aside.display());
    Ok(Finding::new(name, State::Mended, detail))
}
