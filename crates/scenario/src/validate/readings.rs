//! The noise of the joints' own readings.

use std::sync::Arc;

use toml::Spanned;

use super::{Check, Robot, raw};
use body_schema_engine::{
    kinematics::JointKind,
    numeric_range::{is_not_negative, is_usable},
    sensing::{JointNoise, MeasurementModel, Occasion},
};

/// The word for noise that is learned.
const UNKNOWN: &str = "unknown";
/// The least equations of a reading that tell the joints' errors from the sensor's noise: more than a point in space.
const TELLING: usize = 4;

/// The settings of the joints' readings.
pub(super) struct Readings {
    /// The stated noise.
    pub noise: Option<Arc<JointNoise>>,
    /// Whether the smoother learns the noise.
    pub unknown: bool,
}

impl Check<'_> {
    /// The settings of the joints' readings in `[robot]` and `[smoother]`. By default, joints of a simulated robot are exact. For
    /// any other robot the smoother learns their noise where a camera sees two points or more in one picture, or where a robot
    /// elsewhere reports poses. Otherwise, with points alone, from which play can hardly be told from noise, and in tables of poses,
    /// joints are taken to be exact.
    pub(super) fn readings(
        &mut self,
        raw: &raw::Scenario,
        robot: &Robot,
        measurement_model: Option<&MeasurementModel>,
    ) -> Readings {
        let given = [
            ("robot.reading_sigma_deg", &raw.robot.reading_sigma_deg, JointKind::Revolute),
            ("robot.reading_sigma_m", &raw.robot.reading_sigma_m, JointKind::Prismatic),
        ];
        let kinds: Vec<JointKind> = robot.state.joints.iter().map(|joint| joint.kind()).collect();
        let is_told = raw.measurements.is_some() || self.is_external;
        let (mut sigmas, mut is_unknown, mut is_stated) = (vec![0.0; kinds.len()], false, false);
        for (key, value, kind) in given {
            let Some(value) = value else { continue };
            let joints: Vec<usize> = (0..kinds.len()).filter(|joint| kinds[*joint] == kind).collect();
            let unit = if kind == JointKind::Revolute { std::f64::consts::PI / 180.0 } else { 1.0 };
            match value.get_ref() {
                raw::Deviations::Word(word) if word == UNKNOWN && is_told => is_unknown = true,
                raw::Deviations::Word(word) if word == UNKNOWN => {
                    let hint = "write how far they are off, and reading_sigma = \"unknown\" in [smoother] if it is to be learned";
                    self.problem(value.span(), key, "the joints of a simulated robot must be off by something", hint);
                }
                raw::Deviations::Word(word) => {
                    let hint = "write a number, one for each of these joints, or \"unknown\"";
                    self.problem(value.span(), key, format!("{word:?} is none of these"), hint);
                }
                raw::Deviations::One(sigma) => {
                    is_stated = true;
                    self.deviations(key, value, &[*sigma]);
                    joints.iter().for_each(|joint| sigmas[*joint] = sigma * unit);
                }
                raw::Deviations::Each(each) => {
                    is_stated = true;
                    self.deviations(key, value, each);
                    if each.len() != joints.len() {
                        let what = format!("{} numbers for {} joints of this kind", each.len(), joints.len());
                        self.problem(value.span(), key, what, "write one number, or one for each of them");
                    }
                    joints.iter().zip(each).for_each(|(joint, sigma)| sigmas[*joint] = sigma * unit);
                }
            }
        }
        if is_unknown && is_stated {
            let (key, value, _) = &given[1];
            let span = value.as_ref().map_or(0..0, Spanned::span);
            let hint = "state both, or leave both to be learned";
            self.problem(span, *key, "one kind of joint is stated and the other is to be learned", hint);
        }
        let told = raw.smoother.as_ref().and_then(|given| given.reading_sigma);
        let is_telling = measurement_model.is_some_and(|measurement_model| {
            let mut sensors = measurement_model.sensors().iter();
            sensors.any(|it| {
                let is_usual = self.is_external || it.subject().sight().is_some();
                it.subject().occasion == Occasion::Always && it.equations() >= TELLING && is_usual
            })
        });
        let usual = is_unknown || (is_told && !is_stated && is_telling);
        let unknown = told.map_or(usual, |told| told == raw::NoiseKnowledge::Unknown);
        Readings { noise: JointNoise::new(&robot.state, sigmas).map(Arc::new), unknown }
    }

    fn deviations(&mut self, key: &str, value: &Spanned<raw::Deviations>, sigmas: &[f64]) {
        if let Some(sigma) = sigmas.iter().find(|sigma| !is_usable(**sigma) || !is_not_negative(**sigma)) {
            self.problem(value.span(), key, format!("{sigma} is out of range"), "write numbers that are 0 or more");
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Scenario, builtin};

    fn parsed(from: &str, to: &str) -> Result<Scenario, String> {
        let known = builtin("hobby-arm-webcam").expect("built in");
        assert!(known.source.contains(from));
        let text = known.source.replacen(from, to, 1);
        Scenario::parse("play.toml", &text, &|_| Err("no data".to_owned())).map_err(|error| error.to_string())
    }

    #[test]
    fn readings_are_stated_for_all_joints_or_for_each() {
        let given = "reading_sigma_deg = 1.0";
        let sigmas = |to: &str| {
            let noise = parsed(given, to)?.measurement_model.joint_noise().cloned();
            Ok::<_, String>(
                noise.map(|noise| noise.sigmas().iter().map(|sigma| sigma.to_degrees()).collect::<Vec<_>>()),
            )
        };
        let near = |found: Option<Vec<f64>>, wanted: [f64; 5]| {
            found.is_some_and(|found| found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12))
        };
        assert!(near(sigmas(given).expect("valid"), [1.0; 5]));
        let each = [0.5, 1.0, 0.0, 2.0, 3.0];
        assert!(near(sigmas(&format!("reading_sigma_deg = {each:?}")).expect("valid"), each));
        assert_eq!(sigmas("reading_sigma_deg = 0.0"), Ok(None), "as if they were exact");
        assert_eq!(sigmas("elbow = \"elbow\""), Ok(None), "they are unless it is said");
        for (to, message) in [
            ("reading_sigma_deg = -1.0", "0 or more"),
            ("reading_sigma_deg = nan", "0 or more"),
            ("reading_sigma_deg = [1.0, 2.0]", "2 numbers for 5 joints"),
            ("reading_sigma_deg = \"unknown\"", "[smoother]"),
            ("reading_sigma_deg = \"much\"", "is none of these"),
            ("reading_sigma_deg = true", "expected a number"),
            ("reading_sigma_m = [0.001]", "1 numbers for 0 joints"),
        ] {
            let found = sigmas(to).expect_err(to);
            assert!(found.contains(message) && found.contains("reading_sigma"), "{to}: {found}");
        }
    }

    #[test]
    fn the_smoother_is_told_or_learns() {
        let given = "reading_sigma = \"unknown\"";
        assert!(parsed(given, given).expect("valid").smoother.joints_unknown);
        assert!(!parsed(given, "reading_sigma = \"known\"").expect("valid").smoother.joints_unknown);
        assert!(!parsed(given, "").expect("valid").smoother.joints_unknown);
        // Of tables of points and poses it learns it where it is asked to.
        for (name, learns) in [("tiago-mocap", false), ("ur10-camera", false), ("panda-sockets", false)] {
            let recorded = builtin(name).expect("built in");
            assert_eq!(recorded.smoother.joints_unknown, learns, "{name}");
            assert!(recorded.measurement_model.joint_noise().is_none(), "{name}");
            for (key, learns) in [("\"unknown\"", true), ("0.0", false), ("0.3", false)] {
                let text = recorded.source.replacen("[robot]", &format!("[robot]\nreading_sigma_deg = {key}"), 1);
                let given = Scenario::parse("given.toml", &text, &|file| recorded.data_file(file)).expect("valid");
                assert_eq!(given.smoother.joints_unknown, learns, "{name} {key}");
                assert_eq!(given.measurement_model.joint_noise().is_some(), key == "0.3", "{name} {key}");
            }
        }
    }
}
