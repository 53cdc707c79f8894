//! `calibrate`: from a robot's description and a table to a corrected description and a report.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::SystemTime,
};

use anyhow::{Context, Result};
use body_schema_calibration as calibration;
use body_schema_calibration::{
    Calibration, Case, Certificate, Figures, File, Issue, Options, Outlier, Progress, Report, Unit,
};
use body_schema_diagnostics::{Line, listed};
use body_schema_files::AtomicFolder;
use body_schema_recording as recording;
use body_schema_recording::CalibrationLook;
use body_schema_report as report;
use clap::builder::RangedU64ValueParser;

use super::{
    BadInput, files_of, load_scenario, meshes,
    output::{self, Failures, Outputs},
    progress::Bars,
    scenarios::told,
    software,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The path of a calibration file (`body-schema init` writes one), or a built-in scenario with measured data
    #[arg(value_name = "FILE")]
    file: String,
    /// Hold every row out once, in K folds, whatever the file holds out: fold f holds out rows f, f + K, …; rows of
    /// one posture stay together. 0: learn from all rows and judge nothing, in a small part of the time
    #[arg(long, value_name = "K", value_parser = RangedU64ValueParser::<usize>::new().range(0..=MOST_ROWS))]
    folds: Option<usize>,
    /// Also choose the N most informative training rows one by one, and set them beside 20 random orders
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(0..=MOST_ROWS))]
    active: Option<usize>,
    /// Write the files to DIR [default: NAME-calibration; with `--json -` none]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also write certificate.html and certificate.json: what was found, with what it takes to find it again by `body-schema verify`
    #[arg(long)]
    certificate: bool,
    /// Draw the robot in calibration.rrd with errors K times as large [default: 10, or less where errors are large]
    #[arg(long, value_name = "K", value_parser = super::enlarged)]
    enlarge: Option<f64>,
    /// Write the report as JSON to FILE as well, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The most rows of a table.
const MOST_ROWS: u64 = body_schema_table::MOST_ROWS as u64;

/// One bar for each stage.
impl Progress for Bars {
    fn stage(&self, what: &str, steps: u64) {
        self.begin(steps, what);
    }

    fn tick(&self) {
        self.advance();
    }
}

impl Arguments {
    /// What a certificate says of its making.
    fn issue(&self) -> Issue {
        let file =
            Path::new(&self.file).file_name().map_or(self.file.clone(), |name| name.to_string_lossy().into_owned());
        let at_s =
            SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok().map(|since| since.as_secs_f64().floor());
        Issue { software: software(), file, folds: self.folds, at_s }
    }
}

pub fn calibrate(arguments: &Arguments) -> Result<()> {
    let scenario = load_scenario(&arguments.file)?;
    scenario.check_prior()?;
    let case = Case::new(&scenario)?;
    told(&scenario);
    let to_stdout = arguments.json.as_deref().is_some_and(output::is_stdout);
    let folder = match &arguments.out {
        Some(folder) => Some(folder.clone()),
        None if to_stdout => None,
        None => Some(PathBuf::from(format!("{}-calibration", scenario.name))),
    };
    if arguments.certificate && folder.is_none() {
        let what =
            "a certificate is a page and its JSON, and no folder is written with `--json -`; name one with --out";
        return Err(BadInput(what.to_owned()).into());
    }
    // Before anybody waits for what cannot be written.
    folder.as_deref().map_or(Ok(()), refuse_other)?;
    let outputs = Outputs::default().file("--json", arguments.json.as_deref());
    outputs.folder("--out", folder.as_deref()).check(&files_of(&arguments.file, &scenario))?;
    let bars = Bars::default();
    let options = Options { folds: arguments.folds, active: arguments.active };
    let found = calibration::calibrate(&case, &options, &bars);
    bars.end();
    let found = found?;
    let (mut written, mut failures) = (Vec::new(), Failures::default());
    if let Some(folder) = &folder {
        let look =
            CalibrationLook { appearance: meshes::appearance(&arguments.file, &scenario), enlarged: arguments.enlarge };
        let issue = arguments.certificate.then(|| arguments.issue());
        // What no URDF can hold is told after what is wrong with it.
        let files = found.files(&case).map_err(anyhow::Error::from);
        match files.and_then(|files| write(folder, files, (&found, &case), (&look, issue.as_ref()))) {
            Ok(told) => written = told,
            Err(error) => failures.keep(Err(error)),
        }
    }
    if let Some(path) = &arguments.json {
        match output::write_json(path, &found.report) {
            Ok(()) => written.push(path.clone()),
            Err(error) => failures.keep(Err(error)),
        }
    }
    if !to_stdout {
        summarise(&found.report)?;
        for path in written {
            output::say(format!("wrote {}", path.display()))?;
        }
    }
    failures.end()
}

/// Writes all files into a folder, and returns those directly in it. They are written in a hidden folder, which then replaces that of
/// an earlier calibration: nothing of the old one is left, and nothing is lost where writing fails.
fn write(
    folder: &Path,
    files: Vec<File>,
    calibrated: (&Calibration, &Case<'_>),
    how: (&CalibrationLook, Option<&Issue>),
) -> Result<Vec<PathBuf>> {
    refuse_other(folder)?;
    let cannot = || {
        let folder = folder.display();
        format!(
            "cannot write {folder}; what was there before is as it was; name a folder that may be written to with --out"
        )
    };
    let aside = AtomicFolder::beside(folder).with_context(cannot)?;
    let told = write_into(aside.path(), files, calibrated, how).with_context(cannot)?;
    aside.replace(folder).with_context(cannot)?;
    Ok(told.into_iter().map(|file| folder.join(file)).collect())
}

/// Whether a calibration writes a file of this name.
fn is_ours(name: &str) -> bool {
    const OURS: [&str; 9] = [
        "calibrated.urdf",
        "kinematics.yaml",
        "readings.yaml",
        "report.json",
        "report.md",
        "report.html",
        "calibration.rrd",
        "certificate.html",
        "certificate.json",
    ];
    OURS.contains(&name) || name == "folds" || name.ends_with(".svg")
}

/// Refuses a folder with files that no calibration wrote.
fn refuse_other(folder: &Path) -> Result<()> {
    if folder.file_name().is_none() {
        return Err(BadInput(format!("{} is no name of a folder; name one with --out", folder.display())).into());
    }
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

/// Writes all files below a folder, and returns the names of those directly in it.
fn write_into(
    folder: &Path,
    files: Vec<File>,
    (found, case): (&Calibration, &Case<'_>),
    (look, issue): (&CalibrationLook, Option<&Issue>),
) -> Result<Vec<String>> {
    let mut told = Vec::new();
    let certificate = issue.map(|issue| report::certificate_files(&Certificate::of(found, case, issue)));
    let files = files.into_iter().chain(report::files(found, case)).chain(certificate.into_iter().flatten());
    for File { path, text } in files {
        let place = folder.join(&path);
        std::fs::create_dir_all(place.parent().unwrap_or(folder))?;
        std::fs::write(&place, text).context(path.clone())?;
        if !path.contains('/') && !path.ends_with(".svg") {
            told.push(path);
        }
    }
    let markdown = report::markdown(found, case);
    recording::calibration(&folder.join("calibration.rrd"), found, case, &markdown, look)?;
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
        rows.push(line("held out, nominal", &held_out.before, unit));
        rows.push(line("held out, calibrated", &held_out.after, unit));
        if held_out.full_model != held_out.after {
            rows.push(line("held out, extended model", &held_out.full_model, unit));
        }
    }
    rows.push(line("learned from, nominal", &report.training.before, unit));
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
        let line = |it: &Outlier| Line { file: it.file.as_deref().map(Arc::from), number: it.line };
        let lines: Vec<Line> = report.outliers.iter().map(line).collect();
        output::say(format!("{} rows are likelier outliers than not: {}", lines.len(), listed(&lines)))?;
    }
    output::say(&report.more_rows.said)
}

fn line(name: &str, figures: &Figures, unit: Unit) -> [String; 6] {
    let [mean, rms, max] = figures.told(unit).map(|value| output::number(value, 2));
    let deg = output::number(figures.mean_deg, 3);
    [name.to_owned(), figures.readings.to_string(), mean, rms, max, deg]
}
