//! Where everything stands in a view, and from where it is looked at.

use nalgebra::{Point3, Vector3};

use super::body::Figure;

/// The direction in which the camera is, as seen from the middle of the learners, by its angles from straight ahead of
/// the robots and above the ground, radians: in a wide view and in a tall one. Robots stand in a row across the wide
/// one's direction; the tall one looks along the row from above, so that they stand one above the other.
const WIDE: [f64; 2] = [-0.95, 0.2];
const TALL: [f64; 2] = [-0.35, 0.5];
/// Narrower views than this, in widths per height, are tall.
const TALL_BELOW: f64 = 0.8;
/// From one learner to the next, in lengths of the arm.
const SPACING: f64 = 1.55;
/// The viewer's vertical field of view, radians.
const FIELD_OF_VIEW: f64 = 0.96;
/// What of it is left free at each edge, as a part of its half: labels need some pixels.
const MARGIN: f64 = 0.06;
/// What the view takes in of each learner, from its shoulder, in lengths of the arm: where the arm mostly is. x is ahead,
/// y to the left, z up.
const TAKEN_IN: [[f64; 3]; 7] = [
    [0.8, -0.1, 0.2],
    [0.6, -0.6, 0.4],
    [0.6, -0.6, -0.4],
    [0.3, 0.5, -0.6],
    [0.0, -0.7, 0.0],
    [0.0, -0.3, -0.75],
    [0.0, 0.55, -0.6],
];

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

    /// The point that the camera looks at, and where it stands, metres: as near as it can be for a view of this shape
    /// (its width in heights).
    pub(super) fn camera(&self, aspect: f64) -> [Point3<f64>; 2] {
        let [azimuth, elevation] = if aspect < TALL_BELOW { TALL } else { WIDE };
        let ([sin, cos], [rise, along]) = ([azimuth.sin(), azimuth.cos()], [elevation.sin(), elevation.cos()]);
        let back = Vector3::new(along * cos, along * sin, rise);
        let right = Vector3::new(-sin, cos, 0.0);
        let up = back.cross(&right);
        let half_height = (0.5 * FIELD_OF_VIEW).tan() * (1.0 - MARGIN);
        let Figure { shoulder, reach_m, name, .. } = self.figure;
        let around = TAKEN_IN.map(|offset| shoulder + Vector3::from(offset) * reach_m);
        let points: Vec<Vector3<f64>> = (0..self.learners.max(1))
            .flat_map(|learner| around.into_iter().chain([name]).map(move |point| (learner, point)))
            .map(|(learner, point)| point - shoulder + self.place(learner))
            .collect();
        // A point is in sight if it is at most `half` times as far aside as it is before the camera. Towards either side
        // one point needs the camera farthest away; between the two the camera looks straight ahead.
        let fit = |axis: &Vector3<f64>, half: f64| {
            let ends = |side: f64| {
                let needs = points.iter().map(|point| side * point.dot(axis) + half * point.dot(&back));
                needs.fold(f64::NEG_INFINITY, f64::max)
            };
            let (one, other) = (ends(1.0), ends(-1.0));
            (0.5 * (one - other), 0.5 * (one + other) / half)
        };
        let ((aside, by_width), (above, by_height)) = (fit(&right, half_height * aspect), fit(&up, half_height));
        let target = shoulder + right * aside + up * above;
        [target, target + back * f64::max(by_width, by_height)]
    }

    /// Where the key to the colours stands: on the ground, before the middle.
    pub(super) fn key(&self) -> Point3<f64> {
        let Figure { shoulder, reach_m, ground_m, .. } = self.figure;
        let (sin, cos) = WIDE[0].sin_cos();
        Point3::new(shoulder.x, shoulder.y, shoulder.z.min(ground_m + 0.45 * reach_m))
            + Vector3::new(cos, sin, 0.0) * (0.6 * reach_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_has_every_learner_in_sight_and_no_room_to_spare() {
        let figure = Figure { reach_m: 0.7, shoulder: Point3::new(0.1, -0.2, 1.3), ..Figure::default() };
        let figure = Figure { name: figure.shoulder + Vector3::z(), ..figure };
        for (learners, aspect) in [(1, 1.4), (2, 1.4), (3, 1.0), (4, 0.9), (2, 0.5)] {
            let stage = Stage::new(figure.clone(), learners);
            let [target, eye] = stage.camera(aspect);
            let ahead = (target - eye).normalize();
            let right = ahead.cross(&Vector3::z()).normalize();
            let half = (0.5 * FIELD_OF_VIEW).tan();
            let mut most: f64 = 0.0;
            for learner in 0..learners {
                for offset in TAKEN_IN
                    .map(|offset| figure.shoulder + Vector3::from(offset) * figure.reach_m)
                    .into_iter()
                    .chain([figure.name])
                {
                    let way = offset + stage.place(learner) - eye;
                    let depth = way.dot(&ahead);
                    let aside = (way.dot(&right) / (depth * half * aspect)).abs();
                    let above = (way.dot(&right.cross(&ahead)) / (depth * half)).abs();
                    assert!(depth > 0.0 && aside < 1.0 && above < 1.0, "{learners} in {aspect}: {aside}, {above}");
                    most = most.max(aside).max(above);
                }
            }
            assert!(most > 0.9 * (1.0 - MARGIN), "{learners} in {aspect}: {most}");
        }
    }
}
