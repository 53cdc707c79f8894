//! `init`: a first calibration file from a URDF, or a table of Denavit–Hartenberg parameters, and a table.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use body_schema::robot::{Convention, Hulls, Urdf, urdf_of_dh};
use body_schema_calibration::{Begun, Sources, begin_coupled, name_of};
use body_schema_files as atomic;

use super::{
    BadInput,
    input::read_data,
    millimetres,
    output::{self, Outputs},
};

#[derive(Debug, clap::Args)]
#[command(
    override_usage = "body-schema init [OPTIONS] <URDF> <CSV>\n       body-schema init [OPTIONS] --dh <TABLE> <CSV>"
)]
pub struct Arguments {
    /// The robot's description; left out with `--dh`
    #[arg(value_name = "URDF", required_unless_present = "dh")]
    first: Option<PathBuf>,
    /// The table: a line of titles, then one line per posture
    #[arg(value_name = "CSV")]
    second: Option<PathBuf>,
    /// Make the description of the Denavit–Hartenberg parameters in TABLE, and write it as a URDF beside FILE. Titles: theta, d, a and
    /// alpha (with _deg and _mm at their ends for degrees and millimetres), and, where there are any, joint, type, lower and upper
    #[arg(long, value_name = "TABLE")]
    dh: Option<PathBuf>,
    /// These parameters are in Craig's convention, Rx(alpha) Tx(a) Rz(theta) Tz(d) in each row [default: that of Denavit and Hartenberg,
    /// Rz(theta) Tz(d) Tx(a) Rx(alpha)]
    #[arg(long, requires = "dh")]
    modified: bool,
    /// JOINT has no motor of its own and no column: a linkage holds it at a sum of other joints, as in `wrist=-(shoulder + elbow)`; repeat
    /// for several
    #[arg(long, value_name = "JOINT=SUM", value_parser = coupling)]
    coupled: Vec<(String, String)>,
    /// The link that stands still [default: the one that hangs on nothing]
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// The link that carries the targets [default: the end of the longest chain whose joints all have columns]
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// NAME, a target or a camera of the table's titles, is carried by LINK, as in `eye=head_camera`; repeat for several [default: the link of
    /// that name, of a camera also NAME_optical_frame, NAME_frame or NAME_link]
    #[arg(long, value_name = "NAME=LINK", value_parser = carrier)]
    on: Vec<(String, String)>,
    /// Four numbered points in a picture, as cam_tag_u1 to cam_tag_v4, are the corners of a square tag with sides of MM: from the top left
    /// one on, clockwise as one looks at it
    #[arg(long, value_name = "MM", value_parser = millimetres)]
    tag_side: Option<f64>,
    /// How far the two sockets of every place are apart, millimetres: it alone tells how large the robot is
    #[arg(long, value_name = "MM", value_parser = millimetres)]
    socket_distance: Option<f64>,
    /// Write to FILE, or to standard output for `-` [default: the table's name, with .toml]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Say what is guessed and which files would be written, and write none
    #[arg(long)]
    dry_run: bool,
}

fn coupling(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').map(|(joint, sum)| (joint.trim().to_owned(), sum.trim().to_owned()));
    let parts = parts.filter(|(joint, _)| !joint.is_empty());
    parts.ok_or_else(|| "write JOINT=SUM, as `wrist=-(shoulder + elbow)`".to_owned())
}

fn carrier(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').map(|(name, link)| (name.trim().to_owned(), link.trim().to_owned()));
    let parts = parts.filter(|(name, link)| !name.is_empty() && !link.is_empty());
    parts.ok_or_else(|| "write NAME=LINK, as `eye=head_camera`".to_owned())
}

/// What the description is, and where it stands or will stand.
struct Description {
    text: String,
    file: PathBuf,
    /// How it came about, if it is to be written.
    made: Option<String>,
}

impl Arguments {
    /// The path of the table of measurements.
    fn table(&self) -> Result<&Path> {
        match (&self.dh, &self.first, &self.second) {
            (None, _, Some(table)) | (Some(_), Some(table), None) => Ok(table),
            (None, _, None) | (Some(_), None, _) => {
                let what = "the table of measurements is missing; write: body-schema init URDF CSV, or --dh TABLE CSV";
                Err(BadInput(what.to_owned()).into())
            }
            (Some(dh), Some(first), Some(table)) => {
                let (first, dh, table) = (first.display(), dh.display(), table.display());
                let what = format!(
                    "{first} and {dh} both describe the robot; leave one out, as in: body-schema init --dh {dh} {table}"
                );
                Err(BadInput(what).into())
            }
        }
    }

    fn description(&self, out: &Path, to_stdout: bool) -> Result<Description> {
        let (dh, first) = (self.dh.as_ref(), self.first.clone().unwrap_or_default());
        let Some(dh) = dh else { return Ok(Description { text: read("URDF", &first)?, file: first, made: None }) };
        let convention = if self.modified { Convention::Modified } else { Convention::Standard };
        let name = name_of(&dh.to_string_lossy());
        let text = urdf_of_dh(&name, &read("table of parameters", dh)?, convention)
            .map_err(|error| BadInput(format!("{}, {error}", dh.display())))?;
        let beside = if to_stdout { dh.as_path() } else { out };
        let file = beside.with_file_name(format!("{name}.urdf"));
        let said = match convention {
            Convention::Standard => {
                "the convention is that of Denavit and Hartenberg, Rz(theta) Tz(d) Tx(a) Rx(alpha) in each row; --modified for Craig's"
            }
            Convention::Modified => "the convention is Craig's, Rx(alpha) Tx(a) Rz(theta) Tz(d) in each row",
        };
        Ok(Description { text, file, made: Some(said.to_owned()) })
    }
}

fn read(what: &str, path: &Path) -> Result<String> {
    Ok(read_data(path).map_err(|error| BadInput(format!("the {what} {} {error}", path.display())))?)
}

pub fn init(arguments: &Arguments) -> Result<()> {
    let csv = arguments.table()?;
    let out = arguments.out.clone().unwrap_or_else(|| csv.with_extension("toml"));
    let to_stdout = output::is_stdout(&out);
    let Description { text: urdf, file, made } = arguments.description(&out, to_stdout)?;
    let table = read("table", csv)?;
    let inputs: Vec<PathBuf> = [Some(csv), arguments.dh.as_deref(), made.is_none().then_some(&file)]
        .into_iter()
        .flatten()
        .map(PathBuf::from)
        .collect();
    let (shapes, without_shape) = shapes(&file, &urdf);
    let shapes = shapes.filter(|_| !to_stdout);
    let shapes_path = shapes.is_some().then(|| out.with_extension("shapes.json"));
    let outputs = Outputs::default().file("--out", Some(&out));
    let written_too = made.is_some().then_some(file.as_path());
    outputs.file("the URDF", written_too).file("the shapes", shapes_path.as_deref()).check(&inputs)?;
    let others = written_too.into_iter().chain(shapes_path.as_deref());
    for path in others.chain((!to_stdout).then_some(out.as_path())) {
        if path.exists() && !arguments.dry_run {
            return Err(BadInput(format!(
                "{} is there already; remove it, or name another file with --out",
                path.display()
            ))
            .into());
        }
    }
    let stem = if to_stdout { csv } else { &out };
    let begun = begin_coupled(
        &Sources {
            name: &name_of(&stem.to_string_lossy()),
            urdf_file: &beside(&file, &out),
            urdf: &urdf,
            shapes_file: shapes_path.as_deref().map(|path| beside(path, &out)).as_deref(),
            table_file: &beside(csv, &out),
            table: &table,
            base: arguments.base.as_deref(),
            tip: arguments.tip.as_deref(),
            on: &arguments.on,
            tag_side_m: arguments.tag_side.map(|mm| mm / 1e3),
            socket_distance_m: arguments.socket_distance.map(|mm| mm / 1e3),
        },
        &arguments.coupled,
    );
    let Begun { text, guesses, .. } = begun.map_err(|error| BadInput(error.to_string()))?;
    let wrote = if arguments.dry_run { "would write" } else { "wrote" };
    let write = |path: &Path, text: &str| {
        if arguments.dry_run {
            return Ok(());
        }
        atomic::write(path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))
    };
    if made.is_some() {
        write(&file, &urdf)?;
    }
    if to_stdout {
        return output::say(text.trim_end());
    }
    if let Some((path, hulls)) = shapes_path.as_ref().zip(shapes) {
        write(path, &hulls.to_string())?;
        output::say(format!("{wrote} {}: the shapes of links by the meshes of {}", path.display(), file.display()))?;
    }
    if let Some(first) = without_shape.first() {
        let count = without_shape.len();
        let which = if count == 1 { first.clone() } else { format!("{first} and {} more", count - 1) };
        output::say(format!(
            "{which} cannot be read as STL or OBJ: their links are taken for capsules where a posture is chosen"
        ))?;
    }
    let written = write(&out, &text);
    if let Some(said) = made {
        output::say(format!("{wrote} {}: {said}", file.display()))?;
    }
    for guess in &guesses {
        output::say(guess)?;
    }
    written?;
    let is_taken = if out.exists() { " if it were not there already" } else { "" };
    let out = out.display();
    match arguments.dry_run {
        true => output::say(format!("{wrote} {out}{is_taken}; --out - shows it")),
        false => output::say(format!("{wrote} {out}; look it over, then: body-schema calibrate {out}")),
    }
}

/// The shapes of links whose meshes are beside the description, if any is, and the meshes that are not.
fn shapes(description: &Path, urdf: &str) -> (Option<Hulls>, BTreeSet<String>) {
    // What is wrong with a description is told where it is read.
    let Ok(urdf) = Urdf::parse(urdf) else { return Default::default() };
    Hulls::of_meshes(&urdf, |file| body_schema_files::mesh(description, file).ok())
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
