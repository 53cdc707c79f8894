//! What can be asked about a robot of the visitor's own.

use std::collections::BTreeMap;

use body_schema_ask_tell::{Observation, Outcome};
use serde::Deserialize;
use serde_json::Value;

/// A request, with the files that it is about.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bench {
    /// The texts of files, by their names.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    /// What is asked: an [`Asked`].
    pub ask: Value,
    /// The id of the recording that the answer has, if it has one: viewers take recordings with one id for one.
    #[serde(default)]
    pub recording: String,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Asked {
    Examples {},
    Example {
        name: String,
    },
    /// What a description has, and a table's titles.
    Describe {
        urdf: String,
        table: Option<String>,
    },
    Begin(Begin),
    Plan(Plan),
    Read {
        file: String,
        text: String,
        folds: Option<usize>,
    },
    Calibrate(Calibrate),
    Observability(Observability),
    Watch(Watch),
    /// A session with a robot that somebody moves by hand, of a calibration file.
    Open {
        text: String,
    },
    /// The movement to make next.
    Suggest {
        session: String,
    },
    /// What was seen.
    Observe {
        session: String,
        observation: Observation,
    },
    /// The robot did not go there.
    Outcome {
        session: String,
        id: u64,
        state: Outcome,
        reason: Option<String>,
    },
    /// An observation is not to count, or is to count again.
    Count {
        session: String,
        observation: u64,
        counts: bool,
    },
    /// What was observed, as files to calibrate by.
    Results {
        session: String,
    },
}

/// Which files a calibration file is begun from, and what of the guesses is known better.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Begin {
    pub urdf: String,
    pub table: String,
    pub base: Option<String>,
    pub tip: Option<String>,
    /// The links that carry targets and cameras, by the names of these.
    #[serde(default)]
    pub on: BTreeMap<String, String>,
    /// The side of square tags whose four corners are read.
    pub tag_side_mm: Option<f64>,
    pub socket_distance_mm: Option<f64>,
    /// What columns hold, by their titles, where their titles do not say it: what a title would be that does; nothing for one to pass over.
    #[serde(default)]
    pub columns: BTreeMap<String, Option<String>>,
    /// What columns of angles are in whose titles say no unit: radians, or this.
    #[serde(default)]
    pub angles: Option<Angle>,
    /// The same of lengths: metres, or this.
    #[serde(default)]
    pub lengths: Option<Length>,
}

/// A unit of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Angle {
    /// Degrees.
    Deg,
}

impl Angle {
    /// Its word in titles.
    pub fn word(self) -> &'static str {
        "deg"
    }
}

/// A unit of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Length {
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Inches.
    In,
}

impl Length {
    /// Its word in titles.
    pub fn word(self) -> &'static str {
        match self {
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::In => "in",
        }
    }
}

/// Later rows that are held against a calibrated robot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Watch {
    pub file: String,
    pub text: String,
    /// The table of later rows; those that the calibration file holds out without it.
    pub later: Option<String>,
    pub false_alarms_per_year: Option<f64>,
    pub covariate: Option<String>,
}

/// A robot that is still to be measured.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub urdf: String,
    pub base: Option<String>,
    pub tip: Option<String>,
    pub sensor: Sensor,
}

/// What will be measured of the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    /// The position of a marker.
    Position,
    /// The position and the rotation of a body.
    Pose,
    /// A point in the picture of a camera that stands still.
    Camera,
    /// The distance of a point from a fixed point.
    Distance,
}

/// A calibration file to calibrate by; `folds` in place of what it holds out.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibrate {
    pub file: String,
    pub text: String,
    pub folds: Option<usize>,
    /// The program that the page is of, which the certificate names.
    pub software: Option<String>,
}

/// A calibration file of a robot that is still to be measured.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observability {
    pub file: String,
    pub text: String,
    pub postures: usize,
    pub accuracy_mm: Option<f64>,
}
