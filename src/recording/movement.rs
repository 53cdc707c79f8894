//! What a step did: the arm where it moved, and the marker as predicted and as seen.

use rerun::{Color, LineStrips3D, Points3D, Radius};

use super::{
    colours::{TRUTH_COLOR, tint},
    model::{links, single},
};
use crate::experiment::MovementReport;

/// The colour of a measurement; no learner's, and it shows on dark and on light ground.
const MEASURED: [u8; 3] = [0xE6, 0xB4, 0x22];

/// The colour of a marker that was not seen.
const MISSED: [u8; 3] = [0xD6, 0x3B, 0x3B];

/// The entities of a movement, all of them at each step: what a step does not have is empty, not the last step's.
pub(super) struct Movement {
    pub(super) links: LineStrips3D,
    pub(super) truth: Option<LineStrips3D>,
    pub(super) predicted: Points3D,
    pub(super) measured: Points3D,
    /// The true marker after a miss.
    pub(super) missed: Points3D,
}

impl Movement {
    /// Of a report; `None` for a learner that has stopped.
    pub(super) fn of(report: Option<&MovementReport>, has_truth: bool, colour: [u8; 3]) -> Self {
        let Some(report) = report else {
            let nothing = || LineStrips3D::new([[[0.0_f32; 3]; 0]; 0]);
            let nowhere = || Points3D::new([[0.0_f32; 3]; 0]);
            return Self {
                links: nothing(),
                truth: has_truth.then(nothing),
                predicted: nowhere(),
                measured: nowhere(),
                missed: nowhere(),
            };
        };
        let truth = report.true_skeleton_m.as_deref();
        let unseen = truth.filter(|_| report.measured_marker_m.is_none()).and_then(|points| points.last().copied());
        Self {
            links: links(&report.estimated_skeleton_m, tint(colour, 0.5), 1.0),
            truth: truth.map(|points| links(points, tint(TRUTH_COLOR, 0.4), 1.0)),
            predicted: points(Some(report.predicted_marker_m), tint(colour, 0.5), 4.0, "predicted"),
            measured: points(report.measured_marker_m, MEASURED, 4.0, "measured"),
            missed: points(unseen, MISSED, 4.0, "missed"),
        }
    }
}

fn points(marker_m: Option<[f64; 3]>, colour: [u8; 3], size: f32, label: &str) -> Points3D {
    Points3D::new(marker_m.map(single))
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_ui_points(size)])
        .with_labels([label])
        .with_show_labels(false)
}
