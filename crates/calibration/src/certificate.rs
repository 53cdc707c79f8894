//! What was found of a calibration, with what it takes to find it again: the rows by their hashes, the program, the command.
//!
//! # Confidence of the held-out error
//!
//! *By rows*: errors of held-out readings are drawn anew posture by posture, 2000 times with a fixed seed, and the interval holds 95 of 100 means
//! (the percentile bootstrap; Efron and Tibshirani 1993). It says how the error would be on other postures like these, for this model.
//! *By folds*: m̄ ± t s/√K, with the K means mₖ of the folds, s their standard deviation and t the 97.5 % point of Student's distribution with K − 1
//! degrees of freedom. It also has what comes of learning from other rows; folds share training rows, so that it is approximate.
//!
//! # Where predictions are good to what
//!
//! For each of [`DRAWN`] postures within the joint limits, e = √(tr(H P Hᵀ) + m²): H the Jacobian of the predicted target, P the covariance of what
//! was learned, m the model error. By place in the base's frame, distance from its z axis and height, e is the median of a cell.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{
    Calibration, Case, Chain, Coefficient, Coverage, Figures, Joint, Noise, Placement, Target, Unit, Verdict, case::Row,
};
use body_schema_engine::{elementary::hypot, model::Workspace};

/// The version of the form of certificates.
pub const CERTIFICATE: u32 = 1;
/// The number of postures by which the workspace is judged.
pub const DRAWN: usize = 2000;
/// The number of means that are drawn.
const MEANS: usize = 2000;
/// About the number of cells over the greater side of the workspace.
const CELLS: f64 = 24.0;

/// A certificate, as `certificate.json` holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// The version of its form, [`CERTIFICATE`].
    pub certificate: u32,
    /// When it was issued, seconds since 1970; null if nobody said what time it was.
    pub issued_at_s: Option<f64>,
    /// The program.
    pub software: String,
    /// The command that repeats it.
    pub command: String,
    /// The number of folds, where the command names it.
    pub folds: Option<usize>,
    /// The calibration's name.
    pub name: String,
    /// One line about it.
    pub title: String,
    /// The chain of the URDF; null where joints are given one by one.
    pub chain: Option<Chain>,
    /// The hash of the URDF's text, SHA-256; null without one.
    pub urdf_sha256: Option<String>,
    /// The measurements.
    pub data: Data,
    /// How rows were held out, in words.
    pub held_out_by: String,
    /// Whether the calibration should be used.
    pub verdict: Verdict,
    /// The doubts about the table.
    pub doubts: Vec<String>,
    /// The unit of errors.
    pub unit: Unit,
    /// Errors on rows that were not learned from; null where none were held out.
    pub held_out: Option<Errors>,
    /// Coverage of held-out readings by their stated intervals.
    pub coverage: Option<Coverage>,
    /// What the rows do not determine, in words.
    pub undetermined: Vec<String>,
    /// The noise that the residuals show.
    pub noise: Vec<Noise>,
    /// The number of rows that are likelier outliers than not; null where outliers were not looked for.
    pub outliers: Option<usize>,
    /// Where predictions are good to what; null without a covariance.
    pub workspace: Option<Reach>,
    /// The pose of the base link in the frame of the measurements.
    pub base: Placement,
    /// The places of the targets.
    pub targets: Vec<Target>,
    /// The places of cameras on links.
    pub cameras: Vec<Target>,
    /// The correction of every joint.
    pub joints: Vec<Joint>,
    /// The learned focal lengths and centres of cameras, pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intrinsics: Vec<Coefficient>,
    /// The learned coefficients of lenses.
    pub distortion: Vec<Coefficient>,
}

/// The measurements of a certificate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Data {
    /// The number of rows that the model was learned from.
    pub training_rows: usize,
    /// The hash of all rows' hashes, SHA-256.
    pub sha256: String,
    /// The hash of each row: the first 16 digits of the SHA-256 of its numbers as they were read, in rad and m.
    pub rows: Vec<String>,
}

/// Errors on rows that were not learned from, in the certificate's unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// As described, with base, targets, cameras and sockets fitted.
    pub described: Figures,
    /// As calibrated.
    pub calibrated: Figures,
    /// The median error as calibrated.
    pub median: f64,
    /// The error below which 95 of 100 are.
    pub p95: f64,
    /// The 95 % interval of the mean error, by rows.
    pub mean_by_rows: [f64; 2],
    /// The 95 % interval of the mean error, by folds; null with fewer than two.
    pub mean_by_folds: Option<[f64; 2]>,
}

/// Where predictions are good to what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// The side of a cell, metres.
    pub cell_m: f64,
    /// The cells that some posture reaches.
    pub cells: Vec<Cell>,
    /// Where the rows had the target: distance from the base's axis and height, metres.
    pub rows_m: Vec<[f64; 2]>,
    /// The median of the expected error over all postures within limits, millimetres.
    pub median_mm: f64,
    /// What 95 of 100 postures are below, millimetres.
    pub p95_mm: f64,
    /// The greatest, millimetres.
    pub greatest_mm: f64,
    /// The accuracy that is wanted, millimetres.
    pub wanted_mm: f64,
    /// The share of postures that have it.
    pub share_within: f64,
}

/// A cell of the workspace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The distance of its middle from the base's axis, metres.
    pub distance_m: f64,
    /// Its height in the base's frame, metres.
    pub height_m: f64,
    /// The median of the expected error there, millimetres.
    pub error_mm: f64,
    /// The number of postures that brought the target there.
    pub postures: usize,
}

/// What the caller knows of a certificate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Issue {
    /// The program.
    pub software: String,
    /// The name of the calibration file, or of a built-in scenario.
    pub file: String,
    /// The number of folds that were asked for, if any was.
    pub folds: Option<usize>,
    /// Seconds since 1970.
    pub at_s: Option<f64>,
}

impl Issue {
    /// The command that repeats it.
    fn command(&self) -> String {
        let folds = self.folds.map_or_else(String::new, |folds| format!(" --folds {folds}"));
        format!("body-schema calibrate {}{folds} --certificate", self.file)
    }
}

/// Where two certificates differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The field, as `joints[2].shift_mm[0]`.
    pub field: String,
    /// Its value in the certificate; null where it has none.
    pub certified: Value,
    /// What was found; null where nothing was.
    pub found: Value,
}

impl Certificate {
    /// The certificate of a calibration.
    pub fn of(calibration: &Calibration, case: &Case<'_>, issue: &Issue) -> Self {
        let report = calibration.report.clone();
        let rows = hashes(case);
        Self {
            certificate: CERTIFICATE,
            issued_at_s: issue.at_s,
            software: issue.software.clone(),
            command: issue.command(),
            folds: issue.folds,
            name: report.scenario,
            title: report.title,
            chain: report.chain,
            urdf_sha256: case.described.map(|described| hex(&Sha256::digest(described.urdf.text()), 64)),
            data: Data { training_rows: report.training_rows, sha256: hex(&Sha256::digest(rows.join("\n")), 64), rows },
            held_out_by: report.held_out_by,
            verdict: report.verdict,
            doubts: report.doubts,
            unit: report.unit,
            held_out: errors(calibration, case),
            coverage: report.coverage,
            undetermined: report.parameters.undetermined,
            noise: report.noise,
            outliers: (!calibration.fit.readings.is_empty()).then_some(report.outliers.len()),
            workspace: reach(calibration, case),
            base: report.base,
            targets: report.targets,
            cameras: report.cameras,
            joints: report.joints,
            intrinsics: report.intrinsics,
            distortion: report.distortion,
        }
    }

    /// Where this certificate differs from what was `found`, but for time, program and command. Numbers that both programs computed agree to
    /// the last bit if they are the same program, and else to a millionth; sentences are compared if they are the same program.
    pub fn differences(&self, found: &Self) -> Vec<Difference> {
        let exact = self.software == found.software;
        let value = |certificate: &Self| serde_json::to_value(certificate).unwrap_or_default();
        let (mut one, mut other) = (value(self), value(found));
        for certificate in [&mut one, &mut other].into_iter().filter_map(Value::as_object_mut) {
            ["issued_at_s", "software", "command"].iter().for_each(|key| drop(certificate.remove(*key)));
            if !exact {
                // Another version has other words, with rounded numbers in them.
                ["doubts", "undetermined", "held_out_by"].iter().for_each(|key| drop(certificate.remove(*key)));
                certificate.get_mut("verdict").and_then(Value::as_object_mut).map(|verdict| verdict.remove("because"));
            }
        }
        let mut differences = Vec::new();
        compare(String::new(), &one, &other, exact, &mut differences);
        differences
    }
    /// What is written in a certificate, as JSON, and is none of it.
    pub fn foreign(&self, written: &Value) -> Vec<Difference> {
        let mut differences = Vec::new();
        compare(String::new(), written, &serde_json::to_value(self).unwrap_or_default(), true, &mut differences);
        differences
    }
}

/// The hash of each row of a table, in its order.
pub fn hashes(case: &Case<'_>) -> Vec<String> {
    case.rows.iter().map(hash).collect()
}

fn hash(row: &Row) -> String {
    let mut digest = Sha256::new();
    // Absent points are one kind of NaN, and there is one 0.
    let mut number = |x: f64| digest.update(if x.is_nan() { f64::NAN } else { x + 0.0 }.to_le_bytes());
    number(row.positions.len() as f64);
    row.positions.iter().for_each(|x| number(*x));
    for reading in &row.observation.readings {
        number(reading.as_ref().map_or(-1.0, |reading| reading.len() as f64));
        reading.iter().flatten().for_each(|x| number(*x));
    }
    number(row.socket.map_or(-1.0, |socket| socket as f64));
    hex(&digest.finalize(), 16)
}

fn hex(bytes: &[u8], digits: usize) -> String {
    let mut text: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    text.truncate(digits);
    text
}

/// Errors on held-out rows; `None` where none predict.
fn errors(calibration: &Calibration, case: &Case<'_>) -> Option<Errors> {
    let report = &calibration.report;
    let held_out = report.held_out.as_ref()?;
    let counted = calibration.held_out.iter();
    let mut by_posture: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for residual in counted {
        let error = report.unit.of(&residual.norms);
        error.into_iter().for_each(|error| by_posture.entry(case.postures[residual.row]).or_default().push(error));
    }
    let mut all: Vec<f64> = by_posture.values().flatten().copied().collect();
    all.sort_by(f64::total_cmp);
    let means: Vec<f64> = held_out.folds.iter().filter_map(|fold| fold.after.told(report.unit)[0]).collect();
    Some(Errors {
        described: held_out.before,
        calibrated: held_out.after,
        median: quantile(&all, 0.5)?,
        p95: quantile(&all, 0.95)?,
        mean_by_rows: by_rows(&by_posture.into_values().collect::<Vec<_>>()),
        mean_by_folds: by_folds(&means),
    })
}

/// A quantile of sorted numbers, linear between them.
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let at = share * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    Some(below + (above - below) * at.fract())
}

fn by_rows(postures: &[Vec<f64>]) -> [f64; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut means: Vec<f64> = (0..MEANS)
        .map(|_| {
            let drawn = (0..postures.len()).map(|_| &postures[rng.random_range(0..postures.len())]);
            let (sum, count) = drawn.flatten().fold((0.0, 0.0), |(sum, count), error| (sum + error, count + 1.0));
            sum / count
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| quantile(&means, share).unwrap_or_default())
}

fn by_folds(means: &[f64]) -> Option<[f64; 2]> {
    let (count, freedom) = (means.len() as f64, means.len().checked_sub(1).filter(|freedom| *freedom > 0)?);
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / freedom as f64;
    let reach = student(freedom) * (variance / count).sqrt();
    Some([(mean - reach).max(0.0), mean + reach])
}

/// The 97.5 % point of Student's distribution (Cornish and Fisher beyond ten degrees of freedom).
fn student(freedom: usize) -> f64 {
    const FEW: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
    const NORMAL: f64 = 1.959_964;
    let n = freedom as f64;
    let (third, fifth) = (NORMAL.powi(3), NORMAL.powi(5));
    let many = || NORMAL + (third + NORMAL) / (4.0 * n) + (5.0 * fifth + 16.0 * third + 3.0 * NORMAL) / (96.0 * n * n);
    FEW.get(freedom.wrapping_sub(1)).copied().unwrap_or_else(many)
}

/// Where predictions are good to what.
fn reach(calibration: &Calibration, case: &Case<'_>) -> Option<Reach> {
    let belief = &calibration.fit.belief;
    let covariance = belief.covariance.as_ref()?;
    let robot = &case.scenario.robot;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let workspace = Workspace {
        configurations: (0..DRAWN).map(|_| case.draw(&mut rng)).collect(),
        up_to_motion: robot.up_to_motion || case.meets_itself(),
        places: Vec::new(),
    };
    let jacobian = workspace.jacobian(&belief.state, &belief.layout);
    let spread = &jacobian * covariance;
    let model_m = calibration.report.more_rows.model_error_mm / 1e3;
    let of = |index: usize| {
        let square: f64 = (3 * index..3 * index + 3).map(|row| spread.row(row).dot(&jacobian.row(row))).sum();
        1e3 * (square.max(0.0) + model_m * model_m).sqrt()
    };
    let errors: Vec<f64> = (0..DRAWN).map(of).collect();
    // Distance from the axis of the base, and height over it.
    let base = belief.state.base.inverse();
    let place = |theta: &Vec<f64>| {
        let point = base * belief.state.predicted_at(theta);
        [hypot(point.x, point.y), point.z]
    };
    let places: Vec<[f64; 2]> = workspace.configurations.iter().map(place).collect();
    let span = |k: usize| {
        let all = || places.iter().map(|place| place[k]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    };
    let cell_m = round_up(span(0).max(span(1)) / CELLS);
    let mut cells: BTreeMap<[i64; 2], Vec<f64>> = BTreeMap::new();
    for (place, error) in places.iter().zip(&errors) {
        cells.entry(place.map(|x| (x / cell_m).floor() as i64)).or_default().push(*error);
    }
    let middle = |index: i64| (index as f64 + 0.5) * cell_m;
    let cells = cells.into_iter().map(|([distance, height], mut errors)| {
        errors.sort_by(f64::total_cmp);
        let error_mm = quantile(&errors, 0.5).unwrap_or_default();
        Cell { distance_m: middle(distance), height_m: middle(height), error_mm, postures: errors.len() }
    });
    let wanted_mm = calibration.report.more_rows.wanted_mm;
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let rows = case.rows.iter().filter(|row| !row.observation.is_miss());
    Some(Reach {
        cell_m,
        cells: cells.collect(),
        rows_m: rows.map(|row| place(&row.positions)).collect(),
        median_mm: quantile(&sorted, 0.5)?,
        p95_mm: quantile(&sorted, 0.95)?,
        greatest_mm: quantile(&sorted, 1.0)?,
        wanted_mm,
        share_within: errors.iter().filter(|error| **error <= wanted_mm).count() as f64 / DRAWN as f64,
    })
}

/// The next of 1, 2, 5, 10, … times a power of ten, metres.
fn round_up(x: f64) -> f64 {
    let steps = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
    steps.into_iter().find(|step| *step >= x).unwrap_or_else(|| x.max(10.0))
}

/// Adds where two values differ, field by field.
fn compare(field: String, one: &Value, other: &Value, exact: bool, differences: &mut Vec<Difference>) {
    const NEARLY: f64 = 1e-6;
    let is_near = |a: f64, b: f64| a == b || (!exact && (a - b).abs() <= NEARLY * a.abs().max(b.abs()).max(NEARLY));
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            let added = other.keys().filter(|key| !one.contains_key(*key));
            for key in one.keys().chain(added) {
                let field = if field.is_empty() { key.clone() } else { format!("{field}.{key}") };
                let value = |of: &serde_json::Map<String, Value>| of.get(key).cloned().unwrap_or_default();
                compare(field, &value(one), &value(other), exact, differences);
            }
        }
        (Value::Array(one), Value::Array(other)) => {
            for index in 0..one.len().max(other.len()) {
                let value = |of: &Vec<Value>| of.get(index).cloned().unwrap_or_default();
                compare(format!("{field}[{index}]"), &value(one), &value(other), exact, differences);
            }
        }
        (Value::Number(one), Value::Number(other))
            if one.as_f64().zip(other.as_f64()).is_some_and(|(one, other)| is_near(one, other)) => {}
        _ if one == other => {}
        _ => differences.push(Difference { field, certified: one.clone(), found: other.clone() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, Silent, calibrate};
    use body_schema_scenario::builtin;

    fn certified(name: &str) -> Certificate {
        let scenario = builtin(name).expect("built in");
        let case = Case::new(&scenario).expect("measured");
        let found = calibrate(&case, &Options { folds: Some(5), active: None }, &Silent).expect("calibrated");
        Certificate::of(&found, &case, &Issue { software: "this".to_owned(), ..Issue::default() })
    }

    #[test]
    fn points_of_student_are_those_of_tables() {
        for (freedom, point) in [(1, 12.706), (4, 2.776), (10, 2.228), (15, 2.131), (30, 2.042), (120, 1.980)] {
            assert!((student(freedom) - point).abs() < 2e-3, "{freedom}: {}", student(freedom));
        }
    }

    /// Of errors with a known mean the intervals hold it as often as they say.
    #[test]
    fn intervals_hold_the_mean() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut rows, mut folds) = (0, 0);
        const TRIALS: usize = 300;
        for _ in 0..TRIALS {
            // Exponential: mean 1.
            let errors: Vec<f64> =
                (0..50).map(|_| -body_schema_engine::elementary::ln(rng.random_range(1e-12..1.0))).collect();
            let holds = |[low, high]: [f64; 2]| usize::from((low..=high).contains(&1.0));
            rows += holds(by_rows(&errors.iter().map(|error| vec![*error]).collect::<Vec<_>>()));
            let means: Vec<f64> = errors.chunks(10).map(|fold| fold.iter().sum::<f64>() / 10.0).collect();
            folds += holds(by_folds(&means).expect("five folds"));
        }
        // The percentile bootstrap of 50 skewed numbers holds it a little less often.
        for (holds, least) in [(rows, 0.88), (folds, 0.88)] {
            let share = holds as f64 / TRIALS as f64;
            assert!((least..=0.99).contains(&share), "{share}");
        }
    }

    #[test]
    fn a_certificate_says_what_the_report_says_and_differs_where_it_was_changed() {
        let certificate = certified("tiago-mocap");
        let errors = certificate.held_out.as_ref().expect("folds");
        let mean = errors.calibrated.mean_mm.expect("lengths");
        let folds = errors.mean_by_folds.expect("folds");
        assert!(errors.mean_by_rows[0] < mean && mean < errors.mean_by_rows[1], "{errors:?}");
        assert!(folds[0] < mean && mean < folds[1], "{errors:?}");
        assert!(errors.median < errors.p95 && errors.p95 <= errors.calibrated.max_mm.expect("lengths"));
        let reach = certificate.workspace.as_ref().expect("a covariance");
        assert_eq!(reach.cells.iter().map(|cell| cell.postures).sum::<usize>(), DRAWN);
        assert!(reach.median_mm <= reach.p95_mm && reach.p95_mm <= reach.greatest_mm);

        let text = serde_json::to_string_pretty(&certificate).expect("JSON");
        let back: Certificate = serde_json::from_str(&text).expect("a certificate");
        assert_eq!(back.differences(&certificate), []);
        let mut changed = certificate.clone();
        changed.joints[2].shift_mm[1] += 0.01;
        changed.command = "another".to_owned();
        let fields: Vec<String> = changed.differences(&certificate).into_iter().map(|it| it.field).collect();
        assert_eq!(fields, ["joints[2].shift_mm[1]"]);
        // The last bit counts for the same program alone.
        let mut changed = certificate.clone();
        changed.base.xyz_m[0] *= 1.0 + 1e-12;
        assert_eq!(changed.differences(&certificate).len(), 1);
        changed.software = "other".to_owned();
        assert_eq!(changed.differences(&certificate), []);
        let mut changed = certificate.clone();
        changed.undetermined.push("more".to_owned());
        assert_eq!(
            changed.differences(&certificate)[0].field,
            format!("undetermined[{}]", certificate.undetermined.len())
        );
    }

    #[test]
    fn rows_have_hashes_of_their_own() {
        let scenario = builtin("ur10-camera").expect("built in");
        let mut case = Case::new(&scenario).expect("measured");
        let before = hashes(&case);
        let distinct: std::collections::BTreeSet<&String> = before.iter().collect();
        assert_eq!(distinct.len(), before.len());
        case.rows[4].positions[1] += 1e-12;
        let after = hashes(&case);
        let changed: Vec<usize> = (0..before.len()).filter(|row| before[*row] != after[*row]).collect();
        assert_eq!(changed, [4]);
    }
}
