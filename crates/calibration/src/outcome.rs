//! The report of a calibration, as `report.json` holds it.

use serde::{Deserialize, Deserializer, Serialize};

use super::{ActivePoint, Coverage, Figures, SocketDistance, Trial, Unit, Verdict};

/// The whole report.
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
    /// The number of rows of the table.
    pub rows: usize,
    /// The number of rows that the calibrated model was learned from.
    pub training_rows: usize,
    /// How rows are held out, in words.
    pub held_out_by: String,
    /// The doubts about the table, the weightiest first.
    pub doubts: Vec<String>,
    /// The learned parameters.
    pub parameters: Parameters,
    /// Whether the result should be used.
    pub verdict: Verdict,
    /// The unit in which errors are compared; also that of `active` and `learning`, whatever their names say.
    pub unit: Unit,
    /// Errors on the rows that were learned from.
    pub training: Comparison,
    /// Errors on rows that were not; null where none are held out.
    pub held_out: Option<HeldOut>,
    /// The coverage of held-out readings by their stated intervals; null where too few are held out, and for sockets.
    pub coverage: Option<Coverage>,
    /// The factor of lengths by which what is stated of predictions, noise and uncertainty together, is to be widened so that it holds for
    /// 95 % of readings: from folds among the rows that were learned from, and 1 where these are enough or fewer than ten postures.
    #[serde(default = "super::coverage::unwidened")]
    pub widened: f64,
    /// With sockets: the distance between the two of every place that was not learned from; empty otherwise.
    pub sockets: Vec<SocketDistance>,
    /// With sockets: the standard deviation of a span of 1 m of the calibrated robot, millimetres, which a scatter does not
    /// show; null otherwise.
    pub span_1m_sd_mm: Option<f64>,
    /// The trials of extra corrections.
    pub extras: Vec<Trial>,
    /// The compliance of the joints in the extended model; null where that is not kept.
    pub compliance: Option<Compliance>,
    /// Rows that are likelier outliers than not.
    pub outliers: Vec<Outlier>,
    /// The noise that the residuals show.
    pub noise: Vec<Noise>,
    /// The learned standard deviation of each joint's readings, rad or m; empty if it was not learned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reading_sigmas: Vec<f64>,
    /// The pose of the base link in the frame of the measurements.
    pub base: Placement,
    /// The places of the targets.
    pub targets: Vec<Target>,
    /// The places of the cameras, on the links that carry them or, of those that stand, in the frame of the base: of the frame that looks
    /// along its z, with x to the right of the picture and y down.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<Target>,
    /// The learned correction of every joint.
    pub joints: Vec<Joint>,
    /// The learned focal lengths and centres of cameras, pixels: `fx`, `fy`, `cx`, `cy`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intrinsics: Vec<Coefficient>,
    /// The learned coefficients of lenses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distortion: Vec<Coefficient>,
    /// Pairs of parameters that the rows hardly tell apart: correlations above 0.9, the greatest first.
    pub correlations: Vec<Correlation>,
    /// The error to expect after more rows.
    pub more_rows: MoreRows,
    /// How rows were chosen; null if none were.
    pub selection: Option<Choice>,
    /// Held-out error by number of rows, chosen and in random order.
    pub active: Vec<ActivePoint>,
    /// Held-out error by number of rows, in random order alone, if no rows were chosen.
    pub learning: Vec<ActivePoint>,
    /// Every reading.
    pub residuals: Vec<Reading>,
}

/// A chain of a description.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Chain {
    /// The file, as the scenario names it.
    pub urdf: String,
    /// The link that stands still.
    pub base: String,
    /// The link that carries the targets; the first of several.
    pub tip: String,
    /// The other tip links, where joints branch.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tips: Vec<String>,
}

/// The learned parameters, and those that could not be determined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// The number of learned parameters.
    pub learned: usize,
    /// The number of directions among them that the rows determine.
    pub rank: usize,
    /// The directions that they do not determine, in words.
    pub undetermined: Vec<String>,
}

/// Errors before and after calibration. Before: the chain as described, with base, targets, cameras and sockets fitted
/// to the same rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Errors as described.
    pub before: Figures,
    /// Errors as calibrated.
    pub after: Figures,
}

/// Errors before and after calibration, on rows that were not learned from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Errors as described.
    pub before: Figures,
    /// Errors as calibrated: predictions by `calibrated.urdf`, with folds by those in `folds/`.
    pub after: Figures,
    /// Errors of the extended model; equal to `after` where nothing was added.
    pub full_model: Figures,
    /// The folds; empty without folds.
    pub folds: Vec<Fold>,
}

/// One fold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fold {
    /// Its number, counted from 0; its URDF lies in `folds/` under this number.
    pub fold: usize,
    /// The rows that it holds out, counted from 1.
    pub rows: Vec<usize>,
    /// Errors as described.
    pub before: Figures,
    /// Errors as calibrated.
    pub after: Figures,
    /// Errors of the extended model.
    pub full_model: Figures,
    /// The pose of its base link.
    pub base: Placement,
    /// The places of its targets.
    pub targets: Vec<Target>,
}

/// The compliance of joints to gravity, per N·m with which it pulls at 1 kg, at the target or at the elbow, of the robot as
/// described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compliance {
    /// The upward direction, in the base link's frame.
    pub up: [f64; 3],
    /// The joint at whose origin the elbow is.
    pub elbow: String,
    /// The compliance by joint and load.
    pub terms: Vec<JointCompliance>,
}

/// The compliance of a joint to a load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointCompliance {
    /// Its name.
    pub joint: String,
    /// `target` or `elbow`.
    pub load: String,
    /// Degrees per N·m of 1 kg; above 0 where it gives way downwards.
    pub deg_per_nm: f64,
    /// Its standard deviation.
    pub sd_deg_per_nm: f64,
    /// The angle by which it gives way in the posture of its greatest load among the rows, degrees.
    pub greatest_deg: f64,
}

/// A row that is likelier an outlier than not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// The row, counted from 1.
    pub row: usize,
    /// The file, where rows come from more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The line of the file.
    pub line: usize,
    /// The probability that the row is an outlier.
    pub probability: f64,
}

/// One kind of noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// The source of the readings.
    pub sensor: String,
    /// Its unit: m, rad or px.
    pub unit: String,
    /// Nominal standard deviation.
    pub sigma: f64,
    /// Squared residuals in nominal standard deviations, outliers not counted.
    pub chi2: f64,
    /// Their degrees of freedom: equations less those that parameters absorb.
    pub degrees: f64,
    /// The standard deviation that explains them.
    pub explaining_sigma: Option<f64>,
    /// How many times larger variances are than independent equations would make them, since several targets of one link err together;
    /// so many equations count as one.
    #[serde(default = "super::coverage::unwidened", skip_serializing_if = "is_one")]
    pub shared: f64,
}

fn is_one(number: &f64) -> bool {
    *number == 1.0
}

/// The pose of a frame in another.
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
    /// The link in whose frame it is given; without a URDF the joint behind which it is, in the base's frame at θ = 0.
    pub link: String,
    /// Its place there.
    pub xyz_m: [f64; 3],
    /// Roll, pitch and yaw, radians; null for a point.
    pub rpy_rad: Option<[f64; 3]>,
    /// Standard deviations of its place along the axes of the base link's frame, metres; null where it was not learned.
    pub xyz_sd_m: Option<[f64; 3]>,
}

/// The correction of a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// `revolute` or `prismatic`.
    pub kind: String,
    /// Whether its axis was learned.
    pub learned: bool,
    /// The shift of its axis across itself, in the base link's frame at θ = 0, millimetres; zero for a prismatic joint.
    pub shift_mm: [f64; 3],
    /// Standard deviations of the shift, millimetres.
    pub shift_sd_mm: [f64; 3],
    /// The turn of its axis, a rotation vector in the base link's frame at θ = 0, degrees.
    pub turn_deg: [f64; 3],
    /// Standard deviations of the turn, degrees.
    pub turn_sd_deg: [f64; 3],
    /// The offset added to its reading, degrees or millimetres; null where it was not learned.
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

/// A learned number of a camera's intrinsics, or of the distortion of its lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    /// The camera.
    pub camera: String,
    /// The number, as OpenCV names it: `fx`, `cy`, `k1`, `p1`, …
    pub name: String,
    /// Its value, px of intrinsics, without a unit of a distortion.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// Two parameters that the rows hardly tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// The first parameter.
    pub first: String,
    /// The second parameter.
    pub second: String,
    /// The correlation, between −1 and 1.
    pub correlation: f64,
}

/// The error to expect after more rows of the same kind: e² = m² + p²(N) after N rows instead of n, where p falls as far as the
/// rows tell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoreRows {
    /// n, the number of rows.
    pub rows: usize,
    /// e, the error of a prediction where the robot is asked about (held-out rows, otherwise the table's postures, with sockets places
    /// anywhere in reach), by the model itself and by held-out rows, millimetres.
    pub expected_mm: Option<f64>,
    /// p, the part of it that more rows make smaller, millimetres.
    pub from_parameters_mm: Option<f64>,
    /// m, the model error, which no parameter explains, millimetres.
    pub model_error_mm: f64,
    /// The part of p that no number of rows like these makes smaller, millimetres.
    #[serde(default)]
    pub untold_mm: f64,
    /// The error of held-out rows without their own noise, root mean square, millimetres; null where no length was held out.
    #[serde(default)]
    pub held_out_mm: Option<f64>,
    /// The accuracy that the scenario wants, millimetres.
    pub wanted_mm: f64,
    /// The total number of rows that reach it; null if no number does.
    pub rows_needed: Option<u64>,
    /// The total number of rows that reach it if m is noise of the sensor; null where repeats decide that, or where it
    /// makes no difference.
    #[serde(default)]
    pub rows_needed_if_noise: Option<u64>,
    /// A sentence on these figures.
    pub said: String,
}

/// The choice of rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The criterion: A, D, E or I.
    pub criterion: String,
    /// Its start.
    pub start: String,
    /// The chosen rows in their order, counted from 1.
    pub rows: Vec<usize>,
}

/// A reading with its prediction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The row, counted from 1.
    pub row: usize,
    /// The file, where rows come from more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The line of the file.
    pub line: usize,
    /// The source of the reading.
    pub sensor: String,
    /// Whether the row was held out of the model that predicts it.
    pub held_out: bool,
    /// The fold that held it out.
    pub fold: Option<usize>,
    /// Its place among the chosen rows, counted from 1.
    pub chosen: Option<usize>,
    /// The prediction, in the sensor's own numbers: metres, a rotation vector in radians, pixels.
    pub predicted: Vec<f64>,
    /// The measurement, in the sensor's own numbers; NaN, in JSON null, for points that are not seen.
    #[serde(deserialize_with = "or_absent")]
    pub measured: Vec<f64>,
    /// The residual, millimetres.
    pub residual_mm: Option<f64>,
    /// The residual, degrees.
    pub residual_deg: Option<f64>,
    /// The residual, pixels.
    pub residual_px: Option<f64>,
    /// The probability that the row is an outlier, by the model learned from it; null where none learned from it.
    pub outlier_probability: Option<f64>,
}

/// Reads numbers of which some are null: these are NaN.
fn or_absent<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let numbers = Vec::<Option<f64>>::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|x| x.unwrap_or(f64::NAN)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reading comes back from JSON, absent points as null.
    #[test]
    fn absent_points_are_null() {
        let reading = Reading {
            row: 1,
            file: None,
            line: 2,
            sensor: "eye".to_owned(),
            held_out: true,
            fold: None,
            chosen: None,
            predicted: vec![3.0, 4.0, 5.0, 6.0],
            measured: vec![3.5, 4.5, f64::NAN, f64::NAN],
            residual_mm: None,
            residual_deg: None,
            residual_px: Some(0.7),
            outlier_probability: None,
        };
        let text = serde_json::to_string(&reading).expect("JSON");
        assert!(text.contains("\"measured\":[3.5,4.5,null,null]"), "{text}");
        let back: Reading = serde_json::from_str(&text).expect("a reading");
        assert!(back.measured[..2] == [3.5, 4.5] && back.measured[2..].iter().all(|x| x.is_nan()));
    }
}
