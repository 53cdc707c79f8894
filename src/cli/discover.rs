//! `discover`: a robot's description from a table alone, and the movement that would tell most about it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use body_schema_discover::{
    Answer, Asked, Data, Discovery, ReadTable, Reason, Sources, answer, calibration, discover as search, joint_name,
    next, read, urdf,
};
use body_schema_files::AtomicFolder;
use serde::Serialize;

use super::{
    BadInput,
    input::read_data,
    output::{self, Failures, Outputs},
};

/// What `--help` says at length.
pub const ABOUT: &str = "\
Find a robot's description in a table alone: which column turns or slides which part, in which order, about which axes

The table has a line of titles, then one line per posture. Titles that end with x, y and z are measured places, with rx, ry, rz, roll, pitch,
yaw or a quaternion beside them poses; all other columns may drive joints, copy each other, or have nothing to do with the robot. The end of a title is
its unit (_deg, _mm); without one numbers are radians or metres.";

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The table; with --next it may hold nothing but its titles
    #[arg(value_name = "TABLE")]
    table: PathBuf,
    /// How far the columns that can be commanded may go, in the units of their titles (none: radians, metres), as `a_deg=-90..90,b_mm=0..300`;
    /// columns not listed are not asked to move
    #[arg(long, value_name = "COLUMN=LOW..HIGH", value_delimiter = ',', value_parser = limit, allow_hyphen_values = true)]
    limits: Vec<(String, f64, f64)>,
    /// Say which movement tells most, given the rows so far, instead of what was found
    #[arg(long, requires = "limits")]
    next: bool,
    /// Write discovered.urdf, discovered.toml and a copy of the table to DIR
    #[arg(long, value_name = "DIR", conflicts_with = "next")]
    out: Option<PathBuf>,
    /// Write the outcome as JSON to FILE, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A movement that is asked for.
#[derive(Debug, Serialize)]
struct Movement {
    /// The number of rows that it was chosen by.
    rows: usize,
    /// Why, as a sentence.
    why: String,
    /// Whether the structure is beyond doubt already.
    sure: bool,
    /// Where the columns are to go, in the units of their titles.
    positions: serde_json::Map<String, serde_json::Value>,
    /// The same in degrees and millimetres, where the kind of the joint is known.
    shown: Vec<String>,
}

/// Parses `COLUMN=LOW..HIGH`.
fn limit(text: &str) -> Result<(String, f64, f64), String> {
    let parsed = text.rsplit_once('=').and_then(|(name, range)| {
        let (low, high) = range.split_once("..")?;
        Some((name.trim().to_owned(), low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?))
    });
    let is_sound = |(_, low, high): &(String, f64, f64)| low.is_finite() && high.is_finite() && low < high;
    parsed
        .filter(is_sound)
        .ok_or_else(|| "write COLUMN=LOW..HIGH, the lower number first, as elbow_deg=-90..90".to_owned())
}

pub fn discover(arguments: &Arguments) -> Result<()> {
    let shown = arguments.table.display();
    let bad = |what: String| BadInput(format!("the table {shown} {what}"));
    let text = read_data(&arguments.table).map_err(bad)?;
    let table = read(&text).map_err(|error| bad(format!("{}; {}", error.what, error.hint)))?;
    let limits = limits(arguments, &table.data)?;
    Outputs::default()
        .file("--json", arguments.json.as_deref())
        .folder("--out", arguments.out.as_deref())
        .check(std::slice::from_ref(&arguments.table))?;
    let to_stdout = arguments.json.as_deref().is_some_and(output::is_stdout);
    for remark in &table.remarks {
        output::tell(format_args!("warning: {remark}"));
    }
    let found = search(&table.data);
    if arguments.next {
        return ask(arguments, &table.data, &limits, found.ok().as_ref());
    }
    let found = found.map_err(|error| BadInput(format!("the table {shown} shows no robot: {error}")))?;
    let told = answer(&table.data, &found);
    let mut failures = Failures::default();
    let mut written = Vec::new();
    if let Some(folder) = &arguments.out {
        match write(folder, &table, &found, &told, &text) {
            Ok(files) => written = files,
            Err(error) => failures.keep(Err(error)),
        }
    }
    if let Some(path) = &arguments.json {
        failures.keep(output::write_json(path, &told));
    }
    if !to_stdout {
        summarise(&told)?;
        for path in &written {
            output::say(format!("wrote {}", path.display()))?;
        }
        if let Some(folder) = arguments.out.as_ref().filter(|_| !written.is_empty()) {
            output::say(format!("then: body-schema calibrate {}", folder.join("discovered.toml").display()))?;
        }
    }
    failures.end()
}

/// The limits by column, rad or m.
fn limits(arguments: &Arguments, data: &Data) -> Result<Vec<Option<(f64, f64)>>> {
    let mut limits = vec![None; data.columns.len()];
    for (name, low, high) in &arguments.limits {
        let is_named = |column: &usize| data.columns[*column].title == *name || joint_name(data, *column) == *name;
        let Some(column) = (0..data.columns.len()).find(is_named) else {
            let titles: Vec<&str> = data.columns.iter().map(|column| column.title.as_str()).collect();
            return Err(BadInput(format!(
                "--limits names `{name}`, which is no column that may drive a joint; those are {}",
                titles.join(", ")
            ))
            .into());
        };
        let factor = data.columns[column].factor;
        if limits[column].replace((low * factor, high * factor)).is_some() {
            return Err(BadInput(format!("--limits names `{name}` twice; leave one of the two")).into());
        }
    }
    Ok(limits)
}

fn ask(arguments: &Arguments, data: &Data, limits: &[Option<(f64, f64)>], found: Option<&Discovery>) -> Result<()> {
    let Asked { positions, reason } = next(data, limits, found);
    let told = found.map(|found| answer(data, found));
    let why = match reason {
        Reason::Home => "the posture from which columns move alone".to_owned(),
        Reason::Alone(column) => format!("`{}` alone, to see what it moves", data.columns[column].title),
        Reason::Diagnostic => "the structures in doubt differ most here".to_owned(),
        Reason::Accuracy => "predictions become most accurate by it".to_owned(),
    };
    let commanded: Vec<usize> = (0..limits.len()).filter(|column| limits[*column].is_some()).collect();
    let number = |column: usize| {
        let value = positions[column] / data.columns[column].factor;
        (value * 1e6).round() / 1e6
    };
    let titled = |column: &usize| (data.columns[*column].title.clone(), number(*column).into());
    let movement = Movement {
        rows: data.rows.len(),
        sure: told.is_some_and(|told| told.sure),
        positions: commanded.iter().map(titled).collect(),
        shown: commanded
            .iter()
            .map(|column| {
                let (title, value) = (&data.columns[*column].title, positions[*column]);
                match data.columns[*column].kind {
                    Some(body_schema_engine::kinematics::JointKind::Prismatic) => {
                        format!("{title} to {:.1} mm", 1e3 * value)
                    }
                    Some(_) => format!("{title} to {:.2} deg", value.to_degrees()),
                    None => format!("{title} to {value:.4} ({:.2} deg or {:.1} mm)", value.to_degrees(), 1e3 * value),
                }
            })
            .collect(),
        why,
    };
    if let Some(path) = &arguments.json {
        output::write_json(path, &movement)?;
        if output::is_stdout(path) {
            return Ok(());
        }
    }
    output::say(format!("move, for {}:", movement.why))?;
    movement.shown.iter().try_for_each(|line| output::say(format!("  {line}")))
}

fn summarise(told: &Answer) -> Result<()> {
    let turn = told.noise_deg.map_or(String::new(), |deg| format!(" and {deg:.2} deg"));
    let verdict = match (told.explains, told.sure) {
        (false, _) => {
            "these rows are not explained; what follows is the best that was tried, and not to be believed".to_owned()
        }
        (true, true) => format!(
            "the structure is beyond doubt ({:.1} % or more of what was tried)",
            (100.0 * told.probability).floor()
        ),
        (true, false) => format!("the structure is in doubt ({:.1} % of what was tried)", 100.0 * told.probability),
    };
    output::say(format!("{} rows, {} joints: {verdict}", told.rows, told.joints.len()))?;
    output::say(format!(
        "noise {:.2} mm{turn}; {:.2} mm on rows that are held out; predictions on such postures are expected to be off by {:.2} mm\n",
        told.noise_mm, told.held_out_mm, told.expected_error_mm
    ))?;
    for joint in &told.joints {
        let column =
            told.columns.iter().find(|column| joint.drives.first().is_some_and(|drive| drive.0 == column.title));
        let sd = joint.point_sd_mm.map_or(String::new(), |mm| format!(", {mm:.1} mm"));
        if let Some(column) = column {
            output::say(format!("{}; ± {:.2} deg{sd}", column.message, joint.direction_sd_deg))?;
        }
    }
    for column in told.columns.iter().filter(|column| !["turns", "slides"].contains(&column.role)) {
        output::say(&column.message)?;
    }
    for target in &told.targets {
        let name = if target.name.is_empty() { "the target" } else { &target.name };
        match &target.carrier {
            Some(joint) => output::say(format!("{name} is carried by `{joint}`"))?,
            None => output::say(format!("{name} is moved by nothing"))?,
        }
    }
    if !told.doubts.is_empty() {
        output::say("\nin doubt:")?;
        told.doubts.iter().try_for_each(|doubt| output::say(format!("  {doubt}")))?;
    }
    if !told.alternatives.is_empty() {
        output::say("\nother structures:")?;
        for other in &told.alternatives {
            output::say(format!("  {:.1} %: {}", 100.0 * other.probability, other.chain))?;
        }
    }
    Ok(())
}

/// The files that are written.
const FILES: [&str; 3] = ["discovered.urdf", "discovered.toml", "discovered.csv"];

fn write(folder: &Path, table: &ReadTable, found: &Discovery, told: &Answer, text: &str) -> Result<Vec<PathBuf>> {
    if told.joints.is_empty() {
        return Err(BadInput("no joint was found: there is no robot to write".to_owned()).into());
    }
    // A folder with anything else in it is somebody's.
    if let Ok(entries) = std::fs::read_dir(folder) {
        let foreign =
            entries.flatten().map(|entry| entry.file_name()).find(|name| !FILES.iter().any(|file| *name == *file));
        if let Some(name) = foreign {
            return Err(BadInput(format!(
                "{} holds {}, which `discover` did not write; name another folder with --out",
                folder.display(),
                name.to_string_lossy()
            ))
            .into());
        }
    }
    let cannot = || format!("cannot write {}; what was there before is as it was", folder.display());
    let sources = Sources {
        name: "discovered",
        urdf_file: FILES[0],
        table_file: FILES[2],
        measured: &table.measured,
        sigma_m: found.fit.noise.place_m,
        sigma_deg: found.fit.noise.turn_rad.to_degrees(),
    };
    let contents = [
        urdf(&table.data, &found.fit.robot, "discovered"),
        calibration(&table.data, &found.fit.robot, &sources),
        text.to_owned(),
    ];
    let aside = AtomicFolder::beside(folder).with_context(cannot)?;
    for (name, content) in FILES.iter().zip(contents) {
        std::fs::write(aside.path().join(name), content).with_context(cannot)?;
    }
    aside.replace(folder).with_context(cannot)?;
    Ok(FILES.iter().map(|name| folder.join(name)).collect())
}
