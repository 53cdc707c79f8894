//! `init`: a first calibration file from a URDF and a table.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use body_schema_calibration::{Sources, begin, name_of};
use body_schema_files as atomic;

use super::{
    BadInput,
    input::read_data,
    millimetres,
    output::{self, Outputs},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The robot's description
    #[arg(value_name = "URDF")]
    urdf: PathBuf,
    /// The table: a line of titles, then one line per posture
    #[arg(value_name = "CSV")]
    csv: PathBuf,
    /// The link that stands still [default: the one that hangs on nothing]
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// The link that carries the targets [default: the end of the longest chain whose joints all have columns]
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// How far the two sockets of every place are apart, millimetres: it alone tells how large the robot is
    #[arg(long, value_name = "MM", value_parser = millimetres)]
    socket_distance: Option<f64>,
    /// Write to FILE, or to standard output for `-` [default: the table's name, with .toml]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn init(arguments: &Arguments) -> Result<()> {
    let read = |what: &str, path: &Path| {
        read_data(path).map_err(|error| BadInput(format!("the {what} {} {error}", path.display())))
    };
    let (urdf, table) = (read("URDF", &arguments.urdf)?, read("table", &arguments.csv)?);
    let out = arguments.out.clone().unwrap_or_else(|| arguments.csv.with_extension("toml"));
    let to_stdout = output::is_stdout(&out);
    Outputs::default().file("--out", Some(&out)).check(&[arguments.urdf.clone(), arguments.csv.clone()])?;
    if !to_stdout && out.exists() {
        return Err(BadInput(format!(
            "{} is there already; remove it, or name another file with --out",
            out.display()
        ))
        .into());
    }
    let stem = if to_stdout { &arguments.csv } else { &out };
    let begun = begin(&Sources {
        name: &name_of(&stem.to_string_lossy()),
        urdf_file: &beside(&arguments.urdf, &out),
        urdf: &urdf,
        table_file: &beside(&arguments.csv, &out),
        table: &table,
        base: arguments.base.as_deref(),
        tip: arguments.tip.as_deref(),
        socket_distance_m: arguments.socket_distance.map(|mm| mm / 1e3),
    });
    let begun = begun.map_err(|error| BadInput(error.to_string()))?;
    if to_stdout {
        return output::say(begun.text.trim_end());
    }
    let written = atomic::write(&out, begun.text.as_bytes()).with_context(|| format!("cannot write {}", out.display()));
    for guess in &begun.guesses {
        output::say(guess)?;
    }
    written?;
    output::say(format!("wrote {}; look it over, then: body-schema calibrate {}", out.display(), out.display()))
}

/// The path of a file as seen from another's folder: its name if it lies there, otherwise its whole path.
fn beside(file: &Path, other: &Path) -> String {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
        folder.canonicalize().unwrap_or(folder)
    };
    let (here, there) = (folder(file), folder(other));
    let name = file.file_name().map(PathBuf::from).unwrap_or_default();
    let path = here.strip_prefix(&there).map_or_else(|_| here.join(&name), |below| below.join(&name));
    path.to_string_lossy().into_owned()
}
