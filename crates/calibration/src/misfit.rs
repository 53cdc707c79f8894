//! The doubt that a calibrated description explains its rows at all.

use super::{Case, Figures, Fit, Noise};
use body_schema_diagnostics::{Diagnostic, DiagnosticKind};
use body_schema_engine::kinematics::JointKind;

/// The multiple of the stated σ beyond which residuals are no noise of that sensor.
const NO_NOISE: f64 = 10.0;
/// The multiple of the held-out error beyond which residuals are no error that calibration leaves, and the degrees of
/// freedom needed to say so.
const NO_ERROR: f64 = 60.0;
const ENOUGH: f64 = 60.0;
/// The share of rows beyond which rows cannot all be outliers.
const NO_OUTLIERS: f64 = 0.3;
/// How far beside its reading no joint stands, one standard deviation: radians, and metres.
const NO_PLAY_RAD: f64 = 0.07;
const NO_PLAY_M: f64 = 0.02;

/// The doubt that the calibrated description explains the readings at all.
pub fn misfit(noise: &[Noise], held_out: Option<&Figures>, outliers: usize, rows: usize) -> Option<Diagnostic> {
    let times = |noise: &Noise| noise.explaining_sigma.map_or(0.0, |sigma| sigma / noise.sigma);
    let worst = noise.iter().max_by(|a, b| times(a).total_cmp(&times(b))).filter(|noise| times(noise) > NO_NOISE);
    let evidence = match worst {
        Some(worst) => {
            format!(
                "calibrated, it leaves {:.0} times as much of `{}` as the σ that is stated",
                times(worst),
                worst.sensor
            )
        }
        None if outliers as f64 > NO_OUTLIERS * rows as f64 => {
            format!("calibrated, it takes {outliers} of {rows} rows for outliers")
        }
        None => {
            let rms = |unit: &str| {
                held_out.and_then(|it| if unit == "px" { it.rms_px } else { it.rms_mm.map(|mm| mm / 1e3) })
            };
            let off = |noise: &Noise| rms(&noise.unit).map_or(0.0, |rms| rms / noise.sigma);
            let is_off = |noise: &&Noise| noise.degrees > ENOUGH && matches!(noise.unit.as_str(), "m" | "px");
            let worst = noise.iter().filter(is_off).find(|noise| off(noise) > NO_ERROR)?;
            format!(
                "calibrated, it misses rows of `{}` that it has not seen by {:.0} times the σ that is stated",
                worst.sensor,
                off(worst)
            )
        }
    };
    Some(not_fitting(evidence))
}

fn not_fitting(evidence: String) -> Diagnostic {
    Diagnostic {
        kind: DiagnosticKind::Misfit,
        column: None,
        lines: Vec::new(),
        what: "the description does not fit these rows".to_owned(),
        evidence,
        hint: "is this the robot, is its target on the link that is named and as large as is said, and is σ what it should be?"
            .to_owned(),
    }
}

impl Case<'_> {
    /// The doubt that joints stand where they read, where how far beside is learned: what no gear's play explains, the robot is not.
    pub fn readings_misfit(&self, fit: &Fit) -> Option<Diagnostic> {
        if !self.scenario.smoother.joints_unknown {
            return None;
        }
        let joints = fit.state().joints.iter().zip(&fit.reading_sigmas).zip(&self.names.joints);
        let times = joints.map(|((joint, sigma), name)| {
            let (most, unit) = match joint.kind() {
                JointKind::Revolute => (NO_PLAY_RAD, format!("{:.1} deg", sigma.to_degrees())),
                JointKind::Prismatic => (NO_PLAY_M, format!("{:.0} mm", sigma * 1e3)),
            };
            (sigma / most, unit, name)
        });
        let (times, off, name) = times.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (times > 1.0).then(|| {
            not_fitting(format!(
                "calibrated, joints would stand {off} beside what `{name}` reads, at every row another way"
            ))
        })
    }
}
