//! What the joints' own readings are off by.

use std::sync::Arc;

use toml::Spanned;

use super::{Check, Robot, raw};
use crate::{
    kinematics::JointKind,
    magnitude::{is_not_negative, is_usable},
    sensing::{JointNoise, Occasion, Rig},
};

/// The word for what is learned.
const UNKNOWN: &str = "unknown";
/// Equations of a reading by which the joints' errors are told from the sensor's noise: more than a point in space.
const TELLING: usize = 4;

/// What a scenario says of the joints' readings.
pub(super) struct Readings {
    /// What is stated.
    pub noise: Option<Arc<JointNoise>>,
    /// Whether the smoother learns how far they are off.
    pub unknown: bool,
}

impl Check<'_> {
    /// What `[robot]` and `[smoother]` say of the joints' readings. Where they say nothing, joints of a simulated robot are exact;
    /// those of any other are learned by the smoother where a sensor reads more than a point, and are taken to be exact where
    /// none does: from points alone play is hardly told from noise.
    pub(super) fn readings(&mut self, raw: &raw::Scenario, robot: &Robot, rig: Option<&Rig>) -> Readings {
        let given = [
            ("robot.reading_sigma_deg", &raw.robot.reading_sigma_deg, JointKind::Revolute),
            ("robot.reading_sigma_m", &raw.robot.reading_sigma_m, JointKind::Prismatic),
        ];
        let kinds: Vec<JointKind> = robot.state.joints.iter().map(|joint| joint.kind()).collect();
        let is_told = raw.measurements.is_some() || self.is_outside;
        let (mut sigmas, mut is_unknown, mut is_stated) = (vec![0.0; kinds.len()], false, false);
        for (key, value, kind) in given {
            let Some(value) = value else { continue };
            let joints: Vec<usize> = (0..kinds.len()).filter(|joint| kinds[*joint] == kind).collect();
            let unit = if kind == JointKind::Revolute { std::f64::consts::PI / 180.0 } else { 1.0 };
            match value.get_ref() {
                raw::Deviations::Word(word) if word == UNKNOWN && is_told => is_unknown = true,
                raw::Deviations::Word(word) if word == UNKNOWN => {
                    let mend = "write how far they are off, and reading_sigma = \"unknown\" in [smoother] if it is to be learned";
                    self.problem(value.span(), key, "the joints of a simulated robot must be off by something", mend);
                }
                raw::Deviations::Word(word) => {
                    let mend = "write a number, one for each of these joints, or \"unknown\"";
                    self.problem(value.span(), key, format!("{word:?} is none of these"), mend);
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
            let mend = "state both, or leave both to be learned";
            self.problem(span, *key, "one kind of joint is stated and the other is to be learned", mend);
        }
        let told = raw.smoother.as_ref().and_then(|given| given.reading_sigma);
        let is_telling = rig.is_some_and(|rig| {
            let mut channels = rig.channels().iter();
            channels.any(|it| it.occasion() == Occasion::Always && it.equations() >= TELLING)
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
