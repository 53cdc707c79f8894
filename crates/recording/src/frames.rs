//! The motion from one step's posture to the next, for live viewers.

use super::{
    MOTION_PER_STEP,
    arm::{Arm, Drawing},
    learner::{ERRORS, LearnerEntities, MISSED},
    posture::{Posture, between},
    rerun::{LineStrips3D, Points3D},
    rows::Rows,
    scenery::{DESCRIBED, Scenery, TRUE_ARM},
    sight,
    uncertainty::carried,
};
use body_schema_wire::MovementReport;

impl LearnerEntities {
    /// Logs the motion from the last step to this one, as believed and as it was: only poses, because links are rigid while nothing is
    /// learned. The estimate is the one that chose the movement.
    pub(super) fn log_between(
        &self,
        rows: &mut Rows,
        next: u64,
        movement: Option<&MovementReport>,
        scenery: &Scenery<'_>,
    ) {
        let (Some(shown), Some(movement)) = (&self.shown, movement) else { return };
        let Some(step) = next.checked_sub(1).filter(|step| *step == shown.step && scenery.frames > 0) else { return };
        // What was seen after the last movement says nothing of this one.
        let nothing = Points3D::update_fields().with_positions([[0.0_f32; 3]; 0]);
        for marker in ["marker/predicted", "marker/measured"] {
            rows.after(step, 1, &self.entity(marker), &[&nothing]);
        }
        let no_line = LineStrips3D::update_fields().with_strips([[[0.0_f32; 3]; 0]; 0]);
        for line in ERRORS {
            rows.after(step, 1, &self.entity(line), &[&no_line]);
        }
        if shown.has_outlier {
            rows.after(step, 1, &self.entity("marker/outlier"), &[&no_line]);
        }
        if scenery.description.head.is_some() {
            for marker in MISSED {
                rows.after(step, 1, &self.entity(marker), &[&nothing]);
            }
        }
        self.clear_eyes(rows, step, 1);
        for frame in 1..=scenery.frames {
            let ticks = (frame * MOTION_PER_STEP / (scenery.frames + 1)).max(1);
            let configuration =
                between(&shown.configuration, &movement.configuration, frame as f64 / (scenery.frames + 1) as f64);
            let estimate = shown.estimate.as_ref().map(|arm| Posture::of(arm, &configuration));
            let truth = scenery.truth.map(|arm| Posture::of(arm, &configuration));
            if let Some(posture) = &estimate {
                let arm = Arm { frames: &shown.frames, posture, look: self.arm_look() };
                arm.log_between(rows, (step, ticks), &self.entity("arm/estimate"), scenery.drawing());
                for (clouds, entity) in [(&shown.points, "point_ellipsoids"), (&shown.allowed, "allowed_ellipsoids")] {
                    if let Some(clouds) = clouds.as_ref().filter(|clouds| !clouds.is_empty()) {
                        rows.after(step, ticks, &self.entity(entity), &[&carried(clouds, &posture.links)]);
                    }
                }
            }
            if let Some(arm) = &shown.described {
                let posture = Posture::of(arm, &configuration);
                let drawing = Drawing { links: None, ..scenery.drawing() };
                let arm = Arm { frames: &[], posture: &posture, look: DESCRIBED };
                arm.log_between(rows, (step, ticks), &self.entity("arm/described"), drawing);
            }
            if let Some(posture) = &truth {
                let arm = Arm { frames: scenery.true_frames, posture, look: TRUE_ARM };
                arm.log_between(rows, (step, ticks), &self.entity("arm/truth"), scenery.drawing());
                for (entity, points) in self.broken(posture, scenery) {
                    rows.after(step, ticks, &entity, &[&points]);
                }
            }
            if sight::is_drawn(scenery) {
                let arms = [scenery.truth.zip(truth.as_ref()), shown.estimate.as_ref().zip(estimate.as_ref())];
                sight::log(rows, (step, ticks), (&|path| self.entity(path), self.colour), arms, None, scenery);
            }
            if let Some(posture) = truth.as_ref().or(estimate.as_ref()) {
                self.log_trunk(rows, step, ticks, posture, scenery.stage);
            }
        }
    }
}
