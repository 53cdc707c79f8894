//! The motion from one step's posture to the next, for live viewers.

use nalgebra::Isometry3;

use super::{
    MOTION_PER_STEP,
    arm::{Arm, Drawing},
    learner::{DESCRIBED, ERRORS, LearnerEntities, MISSED, Scenery, TRUE_ARM},
    posture::{Posture, between},
    rerun::{LineStrips3D, Points3D},
    rows::Rows,
    sight,
    uncertainty::{Cloud, carried},
};
use body_schema_engine::model::State;

/// What a step left visible.
pub(super) struct Shown {
    pub(super) step: u64,
    pub(super) configuration: Vec<f64>,
    /// `None` where the estimate is not finite.
    pub(super) estimate: Option<State>,
    /// The robot as described, if it is drawn.
    pub(super) described: Option<State>,
    /// The frames of the estimate's links at θ = 0.
    pub(super) frames: Vec<Isometry3<f64>>,
    pub(super) points: Option<Vec<Cloud>>,
    pub(super) allowed: Option<Vec<Cloud>>,
    /// Whether a reading is marked as an outlier.
    pub(super) has_outlier: bool,
}

impl Shown {
    /// Logs the postures between this step and the next, whose configuration is `to`: only poses, because links are
    /// rigid while nothing is learned. The estimate is the one that chose the movement.
    pub(super) fn log_way(
        &self,
        rows: &mut Rows,
        next: u64,
        to: &[f64],
        scenery: &Scenery<'_>,
        learner: &LearnerEntities,
    ) {
        let Some(step) = next.checked_sub(1).filter(|step| *step == self.step && scenery.frames > 0) else { return };
        // What was seen after the last movement says nothing of this one.
        let nothing = Points3D::update_fields().with_positions([[0.0_f32; 3]; 0]);
        for marker in ["marker/predicted", "marker/measured"] {
            rows.after(step, 1, &learner.entity(marker), &[&nothing]);
        }
        let no_line = LineStrips3D::update_fields().with_strips([[[0.0_f32; 3]; 0]; 0]);
        for line in ERRORS {
            rows.after(step, 1, &learner.entity(line), &[&no_line]);
        }
        if self.has_outlier {
            rows.after(step, 1, &learner.entity("marker/outlier"), &[&no_line]);
        }
        if scenery.description.head.is_some() {
            for marker in MISSED {
                rows.after(step, 1, &learner.entity(marker), &[&nothing]);
            }
        }
        learner.clear_eyes(rows, step, 1);
        for frame in 1..=scenery.frames {
            let ticks = (frame * MOTION_PER_STEP / (scenery.frames + 1)).max(1);
            let configuration = between(&self.configuration, to, frame as f64 / (scenery.frames + 1) as f64);
            let estimate = self.estimate.as_ref().map(|arm| Posture::of(arm, &configuration));
            let truth = scenery.truth.map(|arm| Posture::of(arm, &configuration));
            if let Some(posture) = &estimate {
                let arm = Arm { frames: &self.frames, posture, look: learner.arm_look() };
                arm.log_between(rows, (step, ticks), &learner.entity("arm/estimate"), scenery.drawing());
                for (clouds, entity) in [(&self.points, "point_ellipsoids"), (&self.allowed, "allowed_ellipsoids")] {
                    if let Some(clouds) = clouds.as_ref().filter(|clouds| !clouds.is_empty()) {
                        rows.after(step, ticks, &learner.entity(entity), &[&carried(clouds, &posture.links)]);
                    }
                }
            }
            if let Some(arm) = &self.described {
                let posture = Posture::of(arm, &configuration);
                let drawing = Drawing { links: None, ..scenery.drawing() };
                let arm = Arm { frames: &[], posture: &posture, look: DESCRIBED };
                arm.log_between(rows, (step, ticks), &learner.entity("arm/described"), drawing);
            }
            if let Some(posture) = &truth {
                let arm = Arm { frames: scenery.true_frames, posture, look: TRUE_ARM };
                arm.log_between(rows, (step, ticks), &learner.entity("arm/truth"), scenery.drawing());
                for (entity, points) in learner.broken(posture, scenery) {
                    rows.after(step, ticks, &entity, &[&points]);
                }
            }
            if sight::is_drawn(scenery) {
                let arms = [scenery.truth.zip(truth.as_ref()), self.estimate.as_ref().zip(estimate.as_ref())];
                sight::log(rows, (step, ticks), learner, arms, None, scenery);
            }
            if let Some(posture) = truth.as_ref().or(estimate.as_ref()) {
                learner.log_trunk(rows, step, ticks, posture, scenery.stage);
            }
        }
    }
}
