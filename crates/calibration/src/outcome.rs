//! What a calibration finds, as `report.json` says it.

use serde::{Deserialize, Serialize};

use super::{ActivePoint, Coverage, Figures, SocketDistance, Trial, Unit, Verdict};

/// Everything that a report says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The scenario's name.
    pub scenario: String,
    /// One line about it.
    pub title: String,
    /// The version of this program.
    pub version: String,
    /// The chain of the URDF that is calibrated; null where joints are given one by one.
    pub chain: Option<Chain>,
    /// Rows of the table.
    pub rows: usize,
    /// Rows that the calibrated model was learned from.
    pub training_rows: usize,
    /// How rows are held out, in words.
    pub held_out_by: String,
    /// What is doubtful in the table, the weightiest first.
    pub doubts: Vec<String>,
    /// What was learned.
    pub parameters: Parameters,
    /// Whether what was learned is to be used.
    pub verdict: Verdict,
    /// The unit in which errors are compared; also that of `active` and `learning`, whatever their names say.
    pub unit: Unit,
    /// Errors on the rows that were learned from.
    pub training: Comparison,
    /// Errors on rows that were not; null where none are held out.
    pub held_out: Option<HeldOut>,
    /// What share of the held-out readings lies within what is stated for them; null where too few are held out, and of sockets.
    pub coverage: Option<Coverage>,
    /// With sockets: how far the two of every place are apart that nothing was learned from; empty otherwise.
    pub sockets: Vec<SocketDistance>,
    /// With sockets: the standard deviation of a span of 1 m of the calibrated robot, the scale that a scatter is blind to,
    /// millimetres; null otherwise.
    pub span_1m_sd_mm: Option<f64>,
    /// What adding to the axes changes.
    pub extras: Vec<Trial>,
    /// How joints give way to their loads in the fuller model; null where that is not kept.
    pub compliance: Option<Compliance>,
    /// Rows that are likelier outliers than not.
    pub outliers: Vec<Outlier>,
    /// What the residuals say of the sensors' noise.
    pub noise: Vec<Noise>,
    /// How far joints stand beside what they read, where that was learned: one standard deviation for each, rad or m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reading_sigmas: Vec<f64>,
    /// Where the base link is in the frame of the measurements.
    pub base: Placement,
    /// Where the targets are.
    pub targets: Vec<Target>,
    /// What was learned of every joint.
    pub joints: Vec<Joint>,
    /// Pairs of parameters that the rows hardly tell apart: correlations above 0.9, the greatest first.
    pub correlations: Vec<Correlation>,
    /// What more rows would bring.
    pub more_rows: MoreRows,
    /// By what chosen rows were chosen; null if none were.
    pub selection: Option<Choice>,
    /// Held-out error by number of rows, chosen and in random order.
    pub active: Vec<ActivePoint>,
    /// The same in random order alone, where no rows were chosen.
    pub learning: Vec<ActivePoint>,
    /// Every reading.
    pub residuals: Vec<Reading>,
}

/// Which links of which description.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Chain {
    /// The file, as the scenario names it.
    pub urdf: String,
    /// The link that stands still.
    pub base: String,
    /// The link that carries the targets.
    pub tip: String,
}

/// What was learned, and what could not be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// How many.
    pub learned: usize,
    /// Directions among them that the rows determine.
    pub rank: usize,
    /// What they do not, in words.
    pub undetermined: Vec<String>,
}

/// The chain as described, with base, targets, cameras and sockets fitted to the same rows; and the calibrated one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// As described.
    pub before: Figures,
    /// Calibrated.
    pub after: Figures,
}

/// The same on rows that nothing was learned from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// As described.
    pub before: Figures,
    /// Calibrated: what `calibrated.urdf`, with folds those in `folds/`, predict.
    pub after: Figures,
    /// With what was added to the axes; the same as `after` where nothing was.
    pub full_model: Figures,
    /// Fold by fold; empty without folds.
    pub folds: Vec<Fold>,
}

/// One fold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fold {
    /// Counted from 0; its URDF lies in `folds/` under this number.
    pub fold: usize,
    /// The rows that it holds out, counted from 1.
    pub rows: Vec<usize>,
    /// As described.
    pub before: Figures,
    /// Calibrated.
    pub after: Figures,
    /// With what was added.
    pub full_model: Figures,
    /// Where its base link is.
    pub base: Placement,
    /// Where its targets are.
    pub targets: Vec<Target>,
}

/// How joints give way to gravity: by so much for every N·m with which it pulls at 1 kg, at the target or at the elbow, of the robot
/// as it is described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compliance {
    /// Away from the ground, in the base link's frame.
    pub up: [f64; 3],
    /// The joint at whose origin the elbow is.
    pub elbow: String,
    /// By joint and load.
    pub terms: Vec<GivesWay>,
}

/// How a joint gives way to a load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GivesWay {
    /// Its name.
    pub joint: String,
    /// `target` or `elbow`.
    pub load: String,
    /// Degrees per N·m of 1 kg; above 0 where it gives way downwards.
    pub deg_per_nm: f64,
    /// Its standard deviation.
    pub sd_deg_per_nm: f64,
    /// By how much it gives way in the posture of its greatest load among the rows, degrees.
    pub greatest_deg: f64,
}

/// A row that is likelier an outlier than not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// Counted from 1.
    pub row: usize,
    /// The file, where rows are from more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The line of the file.
    pub line: usize,
    /// The probability.
    pub probability: f64,
}

/// One kind of noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// What is measured.
    pub sensor: String,
    /// Its unit: m, rad or px.
    pub unit: String,
    /// Nominal standard deviation.
    pub sigma: f64,
    /// Squared residuals in nominal standard deviations, outliers not counted.
    pub chi2: f64,
    /// Their degrees of freedom: equations less what parameters account for.
    pub degrees: f64,
    /// The standard deviation that explains them.
    pub explaining_sigma: Option<f64>,
}

/// A frame in another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Its origin, metres.
    pub xyz_m: [f64; 3],
    /// Roll, pitch and yaw, radians: Rz(yaw) Ry(pitch) Rx(roll).
    pub rpy_rad: [f64; 3],
    /// Standard deviations of the origin, metres; null where it was not learned.
    pub xyz_sd_m: Option<[f64; 3]>,
    /// Standard deviations of the rotation about x, y, z, radians.
    pub rotation_sd_rad: Option<[f64; 3]>,
}

/// A target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Its name.
    pub name: String,
    /// The link in whose frame it is; without a URDF the joint behind which it is, in the base's frame at θ = 0.
    pub link: String,
    /// Its place there.
    pub xyz_m: [f64; 3],
    /// Roll, pitch and yaw, radians; null for a point.
    pub rpy_rad: Option<[f64; 3]>,
    /// Standard deviations of its place along the axes of the base link's frame, metres; null where it was not learned.
    pub xyz_sd_m: Option<[f64; 3]>,
}

/// How a joint was corrected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// `revolute` or `prismatic`.
    pub kind: String,
    /// Whether its axis was learned.
    pub learned: bool,
    /// How far its axis was shifted across itself, in the base link's frame at θ = 0, millimetres; zero for a prismatic joint.
    pub shift_mm: [f64; 3],
    /// Standard deviations of that.
    pub shift_sd_mm: [f64; 3],
    /// By what its axis was turned, a rotation vector in the same frame, degrees.
    pub turn_deg: [f64; 3],
    /// Standard deviations of that.
    pub turn_sd_deg: [f64; 3],
    /// What is added to its reading, degrees or millimetres; null where it was not learned.
    pub offset: Option<Correction>,
}

/// A number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// Degrees or millimetres.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// Two parameters that the rows hardly tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// One.
    pub first: String,
    /// The other.
    pub second: String,
    /// Between −1 and 1.
    pub correlation: f64,
}

/// What more rows of the same kind would bring: e² = m² + p²(N) after N rows instead of n, where p falls as far as the rows tell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoreRows {
    /// n, the rows that there are.
    pub rows: usize,
    /// e, the error of a prediction where the robot is asked about (held-out rows, else the table's postures, with sockets places anywhere
    /// in reach), by the model itself and by what held-out rows say of it, millimetres.
    pub expected_mm: Option<f64>,
    /// p, what of it more rows make smaller, millimetres.
    pub from_parameters_mm: Option<f64>,
    /// m, what no parameter explains, millimetres.
    pub model_error_mm: f64,
    /// What of p no number of rows like these makes smaller, millimetres.
    #[serde(default)]
    pub untold_mm: f64,
    /// The error of held-out rows without their own noise, root mean square, millimetres; null where no length was held out.
    #[serde(default)]
    pub held_out_mm: Option<f64>,
    /// The accuracy that the scenario wants, millimetres.
    pub wanted_mm: f64,
    /// Rows in all that reach it; null where no number does.
    pub rows_needed: Option<u64>,
    /// The same if m were noise of the sensor; null where repeats tell, or where it makes no difference.
    #[serde(default)]
    pub rows_needed_if_noise: Option<u64>,
    /// The same in words.
    pub said: String,
}

/// How rows were chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The criterion: A, D, E or I.
    pub criterion: String,
    /// Where it began.
    pub start: String,
    /// The rows in their order, counted from 1.
    pub rows: Vec<usize>,
}

/// One reading beside its prediction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The row, counted from 1.
    pub row: usize,
    /// The file, where rows are from more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The line of the file.
    pub line: usize,
    /// What was measured.
    pub sensor: String,
    /// Whether the model that predicts it had not learned from this row.
    pub held_out: bool,
    /// The fold that held it out.
    pub fold: Option<usize>,
    /// Its place among the rows that were chosen, counted from 1.
    pub chosen: Option<usize>,
    /// What was predicted, in the sensor's own numbers: metres, a rotation vector in radians, pixels.
    pub predicted: Vec<f64>,
    /// What was measured.
    pub measured: Vec<f64>,
    /// How far they are apart, millimetres.
    pub residual_mm: Option<f64>,
    /// Degrees.
    pub residual_deg: Option<f64>,
    /// Pixels.
    pub residual_px: Option<f64>,
    /// The probability that the row is an outlier, by the model learned from it; null where none learned from it.
    pub outlier_probability: Option<f64>,
}
