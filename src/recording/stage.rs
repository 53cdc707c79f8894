//! Where everything stands in a view, and from where it is looked at.

use nalgebra::{Point3, Vector3};

use super::{Shape, body::Figure};

/// The direction in which the camera is, as seen from the middle of the learners, by its angles from straight ahead of
/// the robots and above the ground, radians: in a wide view and in a tall one. Robots stand in a row across the wide
/// one's direction; the tall one looks along the row from above, so that they stand one above the other.
const WIDE: [f64; 2] = [-0.95, 0.2];
const TALL: [f64; 2] = [-0.35, 0.5];
/// From one learner to the next, in lengths of the arm.
const SPACING: f64 = 1.75;
/// The viewer's vertical field of view, radians.
const FIELD_OF_VIEW: f64 = 0.96;
/// Width of a view in heights, as it may be at least.
const ASPECTS: [f64; 2] = [1.4, 0.62];

/// The figures of all learners, side by side.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) figure: Figure,
    learners: usize,
}

impl Stage {
    pub(super) fn new(figure: Figure, learners: usize) -> Self {
        Self { figure, learners }
    }

    /// Where the frame of a learner's measurements stands, metres: the row is centred, the first one on the left.
    pub(super) fn place(&self, learner: usize) -> Vector3<f64> {
        let (sin, cos) = WIDE[0].sin_cos();
        let right = Vector3::new(-sin, cos, 0.0);
        right * (SPACING * self.figure.reach_m * (learner as f64 - 0.5 * (self.learners.max(1) - 1) as f64))
    }

    /// The point that the camera looks at, and where it stands, metres.
    pub(super) fn camera(&self, shape: Shape) -> [Point3<f64>; 2] {
        let reach = self.figure.reach_m;
        let row = SPACING * self.learners.saturating_sub(1) as f64;
        // Around the row the arms need some room to either side, and names above.
        let ([azimuth, elevation], aspect, width, height) = match shape {
            Shape::Wide => (WIDE, ASPECTS[0], row + 1.9, 1.75),
            Shape::Tall => {
                let turn: f64 = TALL[0] - WIDE[0];
                (TALL, ASPECTS[1], row * turn.cos() + 1.5, row * turn.sin() * TALL[1].sin() + 1.9)
            }
        };
        let distance = reach * f64::max(width / aspect, height) / (2.0 * (0.5 * FIELD_OF_VIEW).tan()) + 0.3 * reach;
        let ([sin, cos], [up, along]) = ([azimuth.sin(), azimuth.cos()], [elevation.sin(), elevation.cos()]);
        let aside = Vector3::new(-sin, cos, 0.0);
        let target = self.figure.shoulder + (aside * 0.15 - Vector3::z() * 0.14) * reach;
        [target, target + Vector3::new(along * cos, along * sin, up) * distance]
    }

    /// Where the key to the colours stands: on the ground, before the middle.
    pub(super) fn key(&self) -> Point3<f64> {
        let Figure { shoulder, reach_m, ground_m, .. } = self.figure;
        let (sin, cos) = WIDE[0].sin_cos();
        Point3::new(shoulder.x, shoulder.y, shoulder.z.min(ground_m + 0.45 * reach_m))
            + Vector3::new(cos, sin, 0.0) * (0.6 * reach_m)
    }
}
