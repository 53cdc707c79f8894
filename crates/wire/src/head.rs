//! The head that watches, as reports describe it.

use serde::{Deserialize, Serialize};

use super::{array, arrays};
use body_schema_engine::sensing::{Gaze, Head};

/// A camera head with pan and tilt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HeadDescription {
    /// Where it is, metres.
    pub position_m: [f64; 3],
    /// Unit look direction at rest.
    pub look: [f64; 3],
    /// Unit direction that is upright for the head at rest.
    pub up: [f64; 3],
    /// Limit of pan to either side, radians.
    pub pan_limit_rad: f64,
    /// Limit of tilt up and down, radians.
    pub tilt_limit_rad: f64,
    /// Half-angle of the cone that an eye sees, radians.
    pub lens_half_angle_rad: f64,
    /// Distance between two eyes, metres; null for one eye.
    pub eye_baseline_m: Option<f64>,
}

/// Where a head looks, after it has followed the marker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct GazeReport {
    /// Pan, positive to the left, radians.
    pub pan_rad: f64,
    /// Tilt, positive upwards, radians.
    pub tilt_rad: f64,
    /// Unit look direction.
    pub direction: [f64; 3],
    /// The eyes, metres: one, or the left one and the right one.
    pub eyes_m: Vec<[f64; 3]>,
}

impl HeadDescription {
    /// Of a head.
    pub fn of(head: &Head) -> Self {
        Self {
            position_m: array(&head.position.coords),
            look: array(&head.look),
            up: array(&head.axes().0),
            pan_limit_rad: head.pan_limit,
            tilt_limit_rad: head.tilt_limit,
            lens_half_angle_rad: head.lens_half_angle,
            eye_baseline_m: head.baseline,
        }
    }
}

impl GazeReport {
    /// Of a head and where it looks.
    pub fn of(head: &Head, gaze: &Gaze) -> Self {
        let eyes: Vec<_> = head.eyes(gaze).collect();
        let direction = array(&gaze.direction);
        Self { pan_rad: gaze.pan, tilt_rad: gaze.tilt, direction, eyes_m: arrays(&eyes) }
    }
}
