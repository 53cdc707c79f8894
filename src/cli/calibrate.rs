//! `calibrate`: a robot's description and a table in, a corrected description and a report out.

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
};

use anyhow::{Context, Result};
use body_schema::{
    calibration::{self, Calibration, Case, Figures, File, Options, Progress, Report, Unit, report},
    recording,
};
use indicatif::ProgressBar;

use super::{BadInput, load_scenario, output, progress};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The path of a calibration file (`body-schema init` writes one), or a built-in scenario with measured data
    #[arg(value_name = "FILE")]
    file: String,
    /// Hold every row out once, in K folds, whatever the file holds out: fold f holds out rows f, f + K, …; rows of
    /// one posture stay together
    #[arg(long, value_name = "K")]
    folds: Option<usize>,
    /// Also choose the N most informative training rows one by one, and set them beside 20 random orders
    #[arg(long, value_name = "N")]
    active: Option<usize>,
    /// Write the files to DIR [default: NAME-calibration; with `--json -` none]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the report as JSON to FILE as well, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// One bar for each stage.
#[derive(Default)]
struct Bars(Mutex<Option<ProgressBar>>);

impl Bars {
    fn bar(&self) -> std::sync::MutexGuard<'_, Option<ProgressBar>> {
        // A bar is only a bar: one left by a thread that panicked still is.
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn finish(&self) {
        if let Some(bar) = self.bar().take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Bars {
    fn stage(&self, what: &str, steps: u64) {
        self.finish();
        *self.bar() = Some(progress::bar(steps, what));
    }

    fn tick(&self) {
        if let Some(bar) = &*self.bar() {
            bar.inc(1);
        }
    }
}

pub fn calibrate(arguments: &Arguments) -> Result<()> {
    let scenario = load_scenario(&arguments.file)?;
    scenario.check_prior()?;
    let case = Case::new(&scenario)?;
    let doubts = scenario.examine().map(|examination| examination.doubts).unwrap_or_default();
    for doubt in &doubts {
        eprintln!("warning: {doubt}");
    }
    let to_stdout = arguments.json.as_deref().is_some_and(output::is_stdout);
    let folder = match &arguments.out {
        Some(folder) => Some(folder.clone()),
        None if to_stdout => None,
        None => Some(PathBuf::from(format!("{}-calibration", scenario.name))),
    };
    // Before anybody waits for what cannot be written.
    folder.as_deref().map_or(Ok(()), refuse_other)?;
    let bars = Bars::default();
    let options = Options { folds: arguments.folds, active: arguments.active };
    let found = calibration::calibrate(&case, &options, &bars);
    bars.finish();
    let found = found?;
    let mut written = Vec::new();
    if let Some(folder) = &folder {
        written = write(folder, &found, &case)?;
    }
    if let Some(path) = &arguments.json {
        output::write_json(path, &found.report)?;
    }
    if to_stdout {
        return Ok(());
    }
    summarise(&found.report)?;
    for path in written.iter().chain(&arguments.json) {
        output::say(format!("wrote {}", path.display()))?;
    }
    Ok(())
}

/// Writes all files into a folder, and tells those that lie in it. They are written aside, and the folder of an earlier calibration is
/// exchanged for them, so that nothing of it is left, and nothing is lost where writing fails.
fn write(folder: &Path, found: &Calibration, case: &Case<'_>) -> Result<Vec<PathBuf>> {
    refuse_other(folder)?;
    let name = folder
        .file_name()
        .with_context(|| format!("{} is no name for a folder; name one with --out", folder.display()))?;
    let beside = |end: &str| {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{end}-{}", std::process::id()));
        folder.with_file_name(hidden)
    };
    let (aside, before) = (beside("new"), beside("old"));
    let written = write_into(&aside, found, case).and_then(|told| {
        let exchange = || -> std::io::Result<()> {
            let is_there = folder.exists();
            if is_there {
                std::fs::rename(folder, &before)?;
            }
            if let Err(error) = std::fs::rename(&aside, folder) {
                if is_there {
                    std::fs::rename(&before, folder)?;
                }
                return Err(error);
            }
            if is_there { std::fs::remove_dir_all(&before) } else { Ok(()) }
        };
        exchange().with_context(|| {
            format!("cannot write {}; name a folder that may be written to with --out", folder.display())
        })?;
        Ok(told.into_iter().map(|file| folder.join(file)).collect())
    });
    if written.is_err() {
        // What was written aside is of no use; that it cannot be removed is no reason to say something else.
        let _ = std::fs::remove_dir_all(&aside);
    }
    written
}

/// Whether a name is that of a file that a calibration writes.
fn is_ours(name: &str) -> bool {
    const OURS: [&str; 7] = [
        "calibrated.urdf",
        "kinematics.yaml",
        "readings.yaml",
        "report.json",
        "report.md",
        "report.html",
        "calibration.rrd",
    ];
    OURS.contains(&name) || name == "folds" || name.ends_with(".svg")
}

/// Refuses a folder that holds what no calibration wrote.
fn refuse_other(folder: &Path) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return match folder.exists() {
            true => Err(BadInput(format!("{} is no folder; name another with --out", folder.display())).into()),
            false => Ok(()),
        };
    };
    let names = entries.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    match names.into_iter().find(|name| !is_ours(name)) {
        Some(other) => Err(BadInput(format!(
            "{} holds `{other}`, which no calibration wrote: it would be lost; name another folder with --out",
            folder.display()
        ))
        .into()),
        None => Ok(()),
    }
}

/// Writes all files below a folder, and tells the names of those that lie in it.
fn write_into(folder: &Path, found: &Calibration, case: &Case<'_>) -> Result<Vec<String>> {
    let mut told = Vec::new();
    for File { path, text } in found.files(case)?.into_iter().chain(report::files(found, case)) {
        let place = folder.join(&path);
        let parent = place.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).with_context(|| {
            format!("cannot create {}; name a folder that may be written to with --out", parent.display())
        })?;
        std::fs::write(&place, text).with_context(|| {
            format!("cannot write {}; name a folder that may be written to with --out", place.display())
        })?;
        if !path.contains('/') && !path.ends_with(".svg") {
            told.push(path);
        }
    }
    let markdown = report::markdown(found, case);
    recording::calibration(&folder.join("calibration.rrd"), found, case, &markdown)?;
    told.push("calibration.rrd".to_owned());
    Ok(told)
}

fn summarise(report: &Report) -> Result<()> {
    output::say(report.verdict.said(if report.chain.is_some() { "calibrated.urdf" } else { "these axes" }))?;
    if report.joints.iter().any(|joint| joint.offset.is_some()) {
        output::say("the learned offsets are in calibrated.urdf already: add them to no reading of the robot as well")?;
    }
    output::say(format!(
        "{}: {} rows, {} learned from; held out: {}",
        report.scenario, report.rows, report.training_rows, report.held_out_by
    ))?;
    let (unit, mut rows) = (report.unit, Vec::new());
    if let Some(held_out) = &report.held_out {
        rows.push(line("held out, as described", &held_out.before, unit));
        rows.push(line("held out, calibrated", &held_out.after, unit));
        if held_out.full_model != held_out.after {
            rows.push(line("held out, fuller model", &held_out.full_model, unit));
        }
    }
    rows.push(line("learned from, as described", &report.training.before, unit));
    rows.push(line("learned from, calibrated", &report.training.after, unit));
    let [mean, rms, max] = ["mean", "rms", "max"].map(|name| format!("{name} ({unit})"));
    output::say(output::table(["errors", "readings", &mean, &rms, &max, "mean (deg)"], rows))?;
    if let Some(sd_mm) = report.span_1m_sd_mm {
        output::say(format!("a span of 1 m is right to ± {sd_mm:.2} mm; how far a ball scatters does not tell"))?;
    }
    for said in &report.parameters.undetermined {
        output::say(said)?;
    }
    if !report.outliers.is_empty() {
        let lines: Vec<String> = report.outliers.iter().take(8).map(|outlier| outlier.line.to_string()).collect();
        let more = if report.outliers.len() > lines.len() { ", …" } else { "" };
        output::say(format!(
            "{} rows are likelier outliers than not: lines {}{more}",
            report.outliers.len(),
            lines.join(", ")
        ))?;
    }
    output::say(&report.more_rows.said)
}

fn line(name: &str, figures: &Figures, unit: Unit) -> [String; 6] {
    let [mean, rms, max] = figures.told(unit).map(|value| output::number(value, 2));
    let deg = output::number(figures.mean_deg, 3);
    [name.to_owned(), figures.readings.to_string(), mean, rms, max, deg]
}
