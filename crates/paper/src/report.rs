//! `paper.json`: what the paper said beside what we measured.

use serde::{Deserialize, Serialize};

/// The whole comparison with the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of body-schema.
    pub version: String,
    /// Whether this is the short form, with few seeds and short runs: it checks that everything works, and finds
    /// nothing.
    pub quick: bool,
    /// The seeds, first and last.
    pub seeds: [u64; 2],
    /// The figures.
    pub figures: Vec<FigureEntry>,
    /// Every number and remark of the paper.
    pub rows: Vec<Row>,
}

/// A figure that was drawn.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FigureEntry {
    /// Its name; the files are `{id}.svg` and `{id}.png`.
    pub id: String,
    /// Its title.
    pub title: String,
    /// What it shows.
    pub caption: String,
}

/// One number or remark of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its identifier.
    pub id: String,
    /// Where the paper says it.
    pub figure: String,
    /// What it is about.
    pub what: String,
    /// What the paper says.
    pub paper: String,
    /// The paper's number, in `unit`; null for a remark.
    pub paper_value: Option<f64>,
    /// Our number, in `unit`; null if there is none, for example if the median run does not converge.
    pub ours: Option<f64>,
    /// What we measured, in words.
    pub ours_text: String,
    /// Unit of both numbers; empty where there is none.
    pub unit: String,
    /// Whether we agree; null if it was not measured.
    pub agrees: Option<Agreement>,
    /// The reason for the verdict, or why it was not measured.
    pub why: String,
    /// The experiment behind it; null if there is none yet.
    pub experiment: Option<String>,
    /// The scenario it ran in.
    pub scenario: Option<String>,
    /// The seeds, as the command takes them.
    pub seeds: Option<String>,
    /// The number of runs of each learner.
    pub runs: Option<u64>,
    /// The command that repeats the measurement.
    pub command: Option<String>,
}

/// Whether our measurement confirms the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Agreement {
    /// It confirms the paper.
    Yes,
    /// It confirms the paper in part.
    Partly,
    /// It contradicts the paper.
    No,
}

impl Agreement {
    /// The name in JSON and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::Partly => "partly",
            Self::No => "no",
        }
    }

    /// `Yes` if both hold, `Partly` if one does.
    pub fn of_two(first: bool, second: bool) -> Self {
        match (first, second) {
            (true, true) => Self::Yes,
            (false, false) => Self::No,
            _ => Self::Partly,
        }
    }
}
