//! A first calibration file, from a URDF and the titles of a table.
//!
//! Columns are matched with the joints of the same names, and the other columns with what they measure. Everything that
//! had to be guessed is reported, in the file and to the caller.

mod carriers;
mod chain;
mod columns;
mod named;
mod pictures;
mod places;
#[cfg(test)]
mod tests;
mod titles;
mod written;

use std::fmt;

use body_schema_engine::kinematics::JointKind;
use body_schema_robot::{CouplingError, Urdf, UrdfError};
use body_schema_scenario::{Scenario, ScenarioError};
use body_schema_table::{Table, TableError};
use carriers::Carriers;
use chain::ChainSearch;
use columns::Measured;
pub use named::carried;
use places::Held;
pub use titles::{Taken, with_roles, with_units};
use written::{Sockets, written};

/// The two sources, under the names that the calibration file gives them, and their content.
#[derive(Clone, Copy, Debug)]
pub struct Sources<'a> {
    /// The name of the calibration.
    pub name: &'a str,
    /// The URDF's name in the calibration file.
    pub urdf_file: &'a str,
    /// The URDF.
    pub urdf: &'a str,
    /// The name of the file of its links' shapes in the calibration file, if there is one.
    pub shapes_file: Option<&'a str>,
    /// The table's name in the calibration file.
    pub table_file: &'a str,
    /// The table's text.
    pub table: &'a str,
    /// The link that stands still, if it is known.
    pub base: Option<&'a str>,
    /// The link that carries the targets, if it is known.
    pub tip: Option<&'a str>,
    /// Targets and cameras, by their names in the table's titles, and the links that carry them, as far as that is known.
    pub on: &'a [(String, String)],
    /// The side of square tags whose four corners are read, metres, if there are any.
    pub tag_side_m: Option<f64>,
    /// The known distance between the two sockets of every place, metres, if any.
    pub socket_distance_m: Option<f64>,
}

/// A new calibration file, with the guesses behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Begun {
    /// The file, TOML with comments.
    pub text: String,
    /// Everything that had to be guessed.
    pub guesses: Vec<Guess>,
    /// What each column was taken for.
    pub columns: Vec<Taken>,
}

/// Something that the two sources do not say. It reads as a sentence without a full stop, with the option that says otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guess {
    /// What was guessed and why, as a sentence without a full stop.
    pub said: String,
    /// The field of [`Sources`] that says otherwise, without its unit.
    pub field: Option<&'static str>,
    /// How the command `init` is told otherwise, as the end of that sentence.
    pub option: Option<String>,
}

impl Guess {
    fn new(said: impl Into<String>) -> Self {
        Self { said: said.into(), field: None, option: None }
    }

    fn or(self, field: &'static str, option: impl Into<String>) -> Self {
        Self { field: Some(field), option: Some(option.into()), ..self }
    }
}

impl fmt::Display for Guess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.said)?;
        self.option.iter().try_for_each(|option| write!(f, "; {option}"))
    }
}

/// Why a calibration file cannot be begun.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InitError {
    /// The description cannot be used.
    #[error("{file}, {source}")]
    Urdf {
        /// Its file.
        file: String,
        /// Why.
        source: UrdfError,
    },
    /// The table cannot be used.
    #[error("{file}: {source}")]
    Table {
        /// Its file.
        file: String,
        /// Why.
        source: TableError,
    },
    /// The description and the table do not fit.
    #[error("{what}; {hint}")]
    Misfit {
        /// What does not fit.
        what: String,
        /// What to do about it.
        hint: String,
    },
    /// A row of the table cannot be read.
    #[error("{what}; {hint}")]
    Row {
        /// What is wrong with it, with its line.
        what: String,
        /// What to do about it.
        hint: String,
        /// What the table's columns were taken for: other units may be what the rows are in.
        columns: Vec<Taken>,
    },
}

/// The name of a calibration of the table or description `file`: the letters, digits and other characters of its name that a name
/// may have.
pub fn name_of(file: &str) -> String {
    let last = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let stem = last.rsplit_once('.').map_or(last, |(stem, _)| if stem.is_empty() { last } else { stem });
    let name: String =
        stem.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect();
    let name = name.trim_start_matches(['.', '-']);
    if name.is_empty() { "robot".to_owned() } else { name.to_owned() }
}

/// Begins a calibration file.
///
/// # Errors
///
/// [`InitError::Urdf`] or [`InitError::Table`] if a file cannot be read; [`InitError::Misfit`] if no chain moves by joints
/// that have columns, several equally long ones do, or the other columns measure nothing; [`InitError::Row`] if a row cannot be read.
pub fn begin(sources: &Sources<'_>) -> Result<Begun, InitError> {
    begin_coupled(sources, &[])
}

/// The same of a robot some joints of which no motor turns by itself: each with the sum of others that it follows, see [`Urdf::couple`].
///
/// # Errors
///
/// Those of [`begin`], and [`InitError::Misfit`] if a joint cannot follow its sum.
pub fn begin_coupled(sources: &Sources<'_>, coupled: &[(String, String)]) -> Result<Begun, InitError> {
    let of_urdf = |source| InitError::Urdf { file: sources.urdf_file.to_owned(), source };
    let of_table = |source| InitError::Table { file: sources.table_file.to_owned(), source };
    let mut urdf = Urdf::parse(sources.urdf).map_err(of_urdf)?;
    for (joint, sum) in coupled {
        let misfit = |CouplingError { what, hint }| InitError::Misfit { what, hint };
        urdf.couple(joint, sum).map_err(misfit)?;
    }
    let table = Table::open(sources.table.as_bytes()).map_err(of_table)?;
    let titles = table.titles().clone();
    let mut guesses = Vec::new();
    if let Some(error) = titles.separated() {
        return Err(of_table(error));
    }
    let search = ChainSearch { sources, urdf: &urdf, titles: titles.all() };
    let mut named = named::measured(&urdf, titles.all(), sources.on);
    sources.tag_side_m.into_iter().for_each(|side_m| named.join(side_m));
    let mut carriers = Carriers::found(sources, &urdf, &named)?;
    let chain = match carriers.is_empty() {
        true => search.chain(&mut guesses)?,
        false => carriers.joints(&search, &named, &mut guesses)?,
    };
    let joints: Vec<String> = chain.readings.iter().map(|reading| reading.name.clone()).collect();
    guesses.push(Guess::new(format!("joints: {}, by the titles of columns", joints.join(", "))));
    let kinds: Vec<(String, JointKind)> =
        chain.readings.iter().map(|reading| (reading.name.clone(), reading.kind)).collect();
    let of_joints = kinds.iter().filter_map(|(name, kind)| columns::of_joint(titles.all(), name, *kind));
    let of_joints: Vec<String> = of_joints.cloned().collect();
    // Of a robot that branches nothing is passed over in silence, and what is measured is not what another joint reads.
    let known = named::known(&urdf, sources.on);
    let mut measured = if carriers.is_empty() { columns::measured(titles.all(), &of_joints, &known) } else { named };
    if carriers.is_empty() {
        sources.tag_side_m.into_iter().for_each(|side_m| measured.join(side_m));
    }
    let fours = measured.fours();
    let columns = Taken::all(titles.all(), &kinds, &measured);
    let Measured { sensors, sockets, others } = measured;
    if sensors.is_empty() && sockets.is_none() {
        return Err(InitError::Misfit {
            what: format!(
                "nothing is measured in {}: of its columns, {}, those beside the joints' are {}",
                sources.table_file,
                titles.all().join(", "),
                listed(&others)
            ),
            hint:
                "title what was measured x, y, z (with the target's name before it, as in hand_x), cam_hand_u and cam_hand_v, \
                 hand_distance, or place and socket"
                    .to_owned(),
        });
    }
    for sensor in &sensors {
        titles.reading_titled(sensor.layout(), &sensor.columns).map_err(of_table)?;
    }
    let mut held = None;
    if let Some((place, socket)) = &sockets {
        guesses.push(Guess::new(format!(
            "sockets: a target is held in one, which the columns `{place}` and `{socket}` tell"
        )));
        held = Some(Held::read(table, [place, socket]).map_err(of_table)?);
    }
    for sensor in &sensors {
        guesses.push(Guess::new(format!(
            "`{}`: a {}, from the columns {}",
            sensor.name,
            match (sensor.channel, sensor.side_m) {
                ("pixels", Some(_)) => "square tag in a picture",
                ("pixels", None) => "point in a picture",
                (channel, _) => channel,
            },
            sensor.columns.join(", ")
        )));
    }
    for (group, camera) in fours {
        guesses.push(Guess::new(format!(
            "`{group}` in the picture of `{camera}`: four points of which nothing is known; if they are the corners of a square tag, its size \
             tells much"
        )).or("tag_side", "begin anew with --tag-side MM"));
    }
    let pictures = pictures::sizes(&sensors, sources.table).map_err(of_table)?;
    for (camera, [width, height]) in &pictures {
        guesses.push(Guess::new(format!(
            "camera `{camera}`: a picture of {width} × {height}, as its points lie in it; its focal lengths the table does not say: write \
             them before you calibrate; where it is, is found"
        )));
    }
    for sensor in sensors.iter().filter(|sensor| sensor.channel == "distance") {
        guesses.push(Guess::new(format!(
            "`{}`: the fixed point of its distance is taken for the origin in which the base is found; write `to_m` where there are \
             several such points, or other sensors",
            sensor.name
        )));
    }
    if !others.is_empty() {
        guesses.push(Guess::new(format!("passed over: {}", others.join(", "))));
    }
    let write = |trained: Option<&str>, distance_m: Option<f64>, guesses: &[Guess]| {
        let sockets = sockets.as_ref().map(|columns| Sockets { columns, trained, distance_m });
        written(sources, (&chain, &carriers, coupled), (&sensors, &pictures), sockets.as_ref(), guesses)
    };
    let read = |text: &str| {
        let open = |file: &str| Ok(if file == sources.table_file { sources.table } else { sources.urdf }.to_owned());
        Scenario::parse("init.toml", text, &open)
    };
    let mut trained = None;
    if let Some(held) = &held {
        let scenario = |place: Option<&str>, distance_m: Option<f64>| read(&write(place, distance_m, &[])).ok();
        trained = held.choose(sources.socket_distance_m, &scenario, &mut guesses);
    } else {
        guesses.push(Guess::new("held out: every row once, in five folds"));
    }
    let text = write(trained.as_deref(), sources.socket_distance_m, &guesses);
    // A row that cannot be read is told now, not when the file is used; what else the file lacks, the guesses say.
    if let Err(ScenarioError::Invalid { problems, .. }) = read(&text)
        && let Some(problem) = problems.into_iter().find(|problem| problem.key == "measurements.file")
    {
        return Err(InitError::Row { what: problem.what, hint: problem.hint, columns });
    }
    Ok(Begun { text, guesses, columns })
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
