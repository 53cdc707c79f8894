//! A first calibration file, from a URDF and the titles of a table.
//!
//! What the two say is matched: columns that are called as joints are, and what the other columns measure. Everything that
//! had to be guessed is said, in the file and to whoever asked.

mod columns;
mod pictures;
mod written;

use crate::{
    model::urdf::{Chain, Urdf, UrdfError},
    table::{Columns, Table, TableError},
};
use columns::Measured;
use written::written;

/// Two files, as the calibration file is to name them, and what they hold.
#[derive(Clone, Copy, Debug)]
pub struct Sources<'a> {
    /// The name of the calibration.
    pub name: &'a str,
    /// How the calibration file names the URDF.
    pub urdf_file: &'a str,
    /// The URDF.
    pub urdf: &'a str,
    /// How it names the table.
    pub table_file: &'a str,
    /// The table.
    pub table: &'a str,
    /// The link that stands still, if it is known.
    pub base: Option<&'a str>,
    /// The link that carries the targets, if it is known.
    pub tip: Option<&'a str>,
}

/// A calibration file, and what was guessed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Begun {
    /// The file, TOML with comments.
    pub text: String,
    /// Every guess, as a sentence without a full stop.
    pub guesses: Vec<String>,
}

/// Why no file can be begun.
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
    /// The two do not fit.
    #[error("{what}; {mend}")]
    Misfit {
        /// What does not.
        what: String,
        /// How to mend it.
        mend: String,
    },
}

/// Begins a calibration file.
///
/// # Errors
///
/// [`InitError`] where a file cannot be read, no chain moves by joints that the table has columns for, or its other columns
/// measure nothing.
pub fn begin(sources: &Sources<'_>) -> Result<Begun, InitError> {
    let of_urdf = |source| InitError::Urdf { file: sources.urdf_file.to_owned(), source };
    let of_table = |source| InitError::Table { file: sources.table_file.to_owned(), source };
    let urdf = Urdf::parse(sources.urdf).map_err(of_urdf)?;
    let table = Table::open(sources.table.as_bytes()).map_err(of_table)?;
    let titles = table.titles().clone();
    let mut guesses = Vec::new();
    let base = match sources.base {
        Some(base) => base.to_owned(),
        None => {
            let root = urdf.root().unwrap_or_default().to_owned();
            guesses.push(format!("base: `{root}`, the link that hangs on nothing; --base names another"));
            root
        }
    };
    let chain = match sources.tip {
        Some(tip) => urdf.chain(&base, tip).map_err(of_urdf)?,
        None => tip(&urdf, &base, titles.all(), &mut guesses)?,
    };
    let missing: Vec<&str> = chain
        .readings
        .iter()
        .map(|reading| reading.name.as_str())
        .filter(|name| !columns::has_joint(titles.all(), name))
        .collect();
    if !missing.is_empty() {
        return Err(InitError::Misfit {
            what: format!("{} has no column for {}; its columns are {}", sources.table_file, missing.join(", "), titles.all().join(", ")),
            mend: "title a column with each joint's name (`_deg` and `_mm` at its end say the unit), or name another --tip".to_owned(),
        });
    }
    let joints: Vec<String> = chain.readings.iter().map(|reading| reading.name.clone()).collect();
    guesses.push(format!("joints: {}, by the titles of columns", joints.join(", ")));
    let Measured { sensors, sockets, others } = columns::measured(titles.all(), &joints);
    if sensors.is_empty() && sockets.is_none() {
        return Err(InitError::Misfit {
            what: format!(
                "nothing is measured in {}: its columns beside the joints are {}",
                sources.table_file,
                listed(&others)
            ),
            mend:
                "title what was measured x, y, z (with the target's name before it, as in hand_x), cam_hand_u and cam_hand_v, \
                 hand_distance, or place and socket"
                    .to_owned(),
        });
    }
    for sensor in &sensors {
        titles.reading_titled(sensor.layout(), &sensor.columns).map_err(of_table)?;
    }
    let mut trained = None;
    if let Some((place, socket)) = &sockets {
        guesses.push(format!("sockets: a target is held in one, which the columns `{place}` and `{socket}` tell"));
        let index = titles.label(place).map_err(of_table)?;
        let rows = table.rows(Columns { labels: vec![index], ..Columns::default() });
        let mut places: Vec<String> = Vec::new();
        for row in rows {
            let label = row.map_err(of_table)?.labels.swap_remove(0);
            if !places.contains(&label) {
                places.push(label);
            }
        }
        if places.len() > 1 {
            trained = places.into_iter().next();
        }
    }
    for sensor in &sensors {
        guesses.push(format!(
            "`{}`: a {}, from the columns {}",
            sensor.name,
            if sensor.channel == "pixels" { "point in a picture" } else { sensor.channel },
            sensor.columns.join(", ")
        ));
    }
    let pictures = pictures::sizes(&sensors, sources.table).map_err(of_table)?;
    for (camera, [width, height]) in &pictures {
        guesses.push(format!(
            "camera `{camera}`: a picture of {width} × {height}, as its points lie in it; its focal lengths and where it stands the \
             table does not say: write them before you calibrate"
        ));
    }
    for sensor in sensors.iter().filter(|sensor| sensor.channel == "distance") {
        guesses.push(format!(
            "`{}`: the fixed point of its distance is taken for the origin in which the base is found; write `to_m` where there are \
             several such points, or other sensors",
            sensor.name
        ));
    }
    if !others.is_empty() {
        guesses.push(format!("passed over: {}", others.join(", ")));
    }
    guesses.push(match (&trained, sockets.is_some()) {
        (Some(place), _) => format!("held out: all places but `{place}`"),
        (None, true) => "held out: every row once, in five folds, as there is one place alone".to_owned(),
        (None, false) => "held out: every row once, in five folds".to_owned(),
    });
    let text = written(sources, &chain, (&sensors, &pictures), sockets.as_ref(), trained.as_deref(), &guesses);
    Ok(Begun { text, guesses })
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The chain with the most joints of which all have columns; of those that move by the same the one whose tip nothing hangs
/// on, if it is the only one, else the link behind the last joint.
fn tip(urdf: &Urdf, base: &str, titles: &[String], guesses: &mut Vec<String>) -> Result<Chain, InitError> {
    let chains = urdf.links().iter().filter_map(|link| urdf.chain(base, link).ok());
    let fits = |chain: &Chain| chain.readings.iter().all(|reading| columns::has_joint(titles, &reading.name));
    let fitting: Vec<Chain> = chains.filter(fits).collect();
    let most = fitting.iter().map(|chain| chain.readings.len()).max().unwrap_or(0);
    let mut best: Vec<&Chain> = fitting.iter().filter(|chain| chain.readings.len() == most).collect();
    best.sort_by_key(|chain| chain.segments.len());
    let leaves: Vec<&str> = urdf.leaves().collect();
    let at_end: Vec<&&Chain> = best.iter().filter(|chain| leaves.contains(&chain.tip())).collect();
    let (chosen, why) = match (at_end.as_slice(), best.first()) {
        ([only], _) => (**only, "the end of the longest chain whose joints all have columns"),
        (_, Some(first)) => (*first, "behind the last joint that has a column; several links hang on it"),
        (_, None) => {
            let mut joints: Vec<String> = Vec::new();
            for chain in leaves.iter().filter_map(|leaf| urdf.chain(base, leaf).ok()) {
                let new = chain.readings.into_iter().map(|reading| reading.name).filter(|name| !joints.contains(name));
                joints.extend(new.collect::<Vec<_>>());
            }
            return Err(InitError::Misfit {
                what: format!("no chain from `{base}` moves by joints that the table has columns for"),
                mend: format!("title columns with the joints' names: {}", joints.join(", ")),
            });
        }
    };
    guesses.push(format!("tip: `{}`, {why}; --tip names another", chosen.tip()));
    Ok(chosen.clone())
}
