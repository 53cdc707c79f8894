//! From where targets and their points can be seen.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitVector3, Vector3};

/// The cone of directions from which a target can be seen: within an angle of the direction that it faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    /// The direction, in the target's frame.
    pub direction: UnitVector3<f64>,
    /// The angle, radians.
    pub within: f64,
}

/// A target whose points are seen one by one, such as a board of markers, of which a part is in the picture or hidden.
#[derive(Clone, Debug, PartialEq)]
pub struct PartlySeen {
    /// The least number of points of a reading, at least 1; with fewer there is none.
    pub least_points: usize,
    /// The directions from which each point can be seen; empty if from everywhere.
    pub facing: Arc<[Facing]>,
}

impl Facing {
    /// How far the camera is inside the cone, radians, of a target placed in the camera's frame, with the way to the camera.
    pub(super) fn clearance(&self, place: &Isometry3<f64>, towards_camera: &Vector3<f64>) -> f64 {
        self.within - (place.rotation * self.direction.into_inner()).angle(towards_camera)
    }
}
