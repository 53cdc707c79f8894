//! The stage: the places of everything in a view, and the camera.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    body::Figure,
    rerun::{Color, LineStrips3D, Radius},
    room::Room,
    solid::single,
    uncertainty::Cloud,
};

/// The direction in which the camera is, as seen from the middle of the learners, by its angles from straight ahead of
/// the robots and above the ground, radians: in a wide view and in a tall one. Robots stand in a row across the wide
/// one's direction; the tall one looks along the row from above, so that they stand one above the other.
const WIDE: [f64; 2] = [-0.95, 0.2];
const TALL: [f64; 2] = [-0.35, 0.5];
/// The aspect, in widths per height, below which a view is tall.
pub(super) const TALL_BELOW: f64 = 0.8;
/// The least and the greatest distance from one learner to the next, in lengths of the arm.
const SPACING: [f64; 2] = [1.3, 3.0];
/// The viewer's vertical field of view, radians.
const FIELD_OF_VIEW: f64 = 0.96;
/// The free part of the field of view at the edges, as a part of its half: at either side for half a label, above for its
/// height, below for the page's legend.
const SIDES: f64 = 0.12;
const ABOVE: f64 = 0.06;
const BELOW: f64 = 0.25;
/// The distance between lines of the ground, and how far they go beyond the row, in lengths of the arm.
const GROUND: [f64; 2] = [0.5, 3.0];
/// The entities of the lines of the ground, for light and for dark views.
pub(super) const GROUNDS: [&str; 2] = ["ground/light", "ground/dark"];

/// The figures of all learners, side by side.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) figure: Figure,
    room: Room,
    learners: usize,
    /// The distance from one learner to the next, metres.
    spacing_m: f64,
}

impl Stage {
    pub(super) fn new(figure: Figure, room: Room, learners: usize) -> Self {
        Self { spacing_m: SPACING[0] * figure.reach_m, figure, room, learners }
    }

    /// Moves the learners at least so far apart, unless that is out of proportion to their arms.
    pub(super) fn with_spacing(self, least_m: f64) -> Self {
        let [least, greatest] = SPACING.map(|lengths| lengths * self.figure.reach_m);
        Self { spacing_m: (1.05 * least_m).clamp(least, greatest), ..self }
    }

    /// The direction from one learner to the next.
    pub(super) fn way() -> Vector3<f64> {
        let (sin, cos) = WIDE[0].sin_cos();
        Vector3::new(-sin, cos, 0.0)
    }

    /// The place of the frame of a learner's measurements, metres: the row is centred, the first one on the left.
    pub(super) fn place(&self, learner: usize) -> Vector3<f64> {
        Self::way() * (self.spacing_m * (learner as f64 - 0.5 * (self.learners.max(1) - 1) as f64))
    }

    /// How far it is from a point beside a learner to the cell of the next, metres; infinite for a learner alone.
    fn room_m(&self, point: &Point3<f64>) -> f64 {
        if self.learners < 2 {
            return f64::INFINITY;
        }
        0.5 * self.spacing_m - (point - self.figure.shoulder).dot(&Self::way()).abs()
    }

    /// Whether a point is in the cell of the learner that it belongs to, rather than in a neighbour's.
    pub(super) fn is_near(&self, point: &Point3<f64>) -> bool {
        self.room_m(point) >= 0.0
    }

    /// Whether the clouds of a learner stay in its cell. `moved` is the motion of its base since it was placed.
    pub(super) fn holds(&self, clouds: &[Cloud], links: &[Isometry3<f64>], moved: &Isometry3<f64>) -> bool {
        let way = moved.rotation * Self::way();
        clouds.iter().all(|cloud| {
            let (centre, reach_m) = cloud.reach(links, &way);
            reach_m <= self.room_m(&(moved.inverse() * centre))
        })
    }

    /// The point that the camera looks at, and the camera's place, metres: as near as possible for a view of this shape
    /// (its width in heights) that shows this learner alone, or all.
    pub(super) fn camera(&self, aspect: f64, alone: Option<usize>) -> [Point3<f64>; 2] {
        let [azimuth, elevation] = if aspect < TALL_BELOW { TALL } else { WIDE };
        let ([sin, cos], [rise, along]) = ([azimuth.sin(), azimuth.cos()], [elevation.sin(), elevation.cos()]);
        let back = Vector3::new(along * cos, along * sin, rise);
        let right = Vector3::new(-sin, cos, 0.0);
        let up = back.cross(&right);
        let half = (0.5 * FIELD_OF_VIEW).tan();
        let across = [half * aspect * (1.0 - SIDES); 2];
        let upright = [half * (1.0 - BELOW), half * (1.0 - ABOVE)];
        let Figure { shoulder, .. } = self.figure;
        let shown = alone.map_or(0..self.learners.max(1), |learner| learner..learner + 1);
        let places: Vec<Vector3<f64>> = shown.map(|learner| self.place(learner)).collect();
        // A point is in sight if it is at most `half` times as far aside as it is before the camera. Towards either side one
        // point needs the camera farthest away: so far, and beyond that in the middle of what both leave free.
        let needs = |axis: &Vector3<f64>, side: f64, half: f64| {
            let need = |point: Vector3<f64>| side * point.dot(axis) + half * point.dot(&back);
            places.iter().map(|place| self.room.needs(|point| need(point + place))).fold(f64::NEG_INFINITY, f64::max)
        };
        let ends = |axis: &Vector3<f64>, [low, high]: [f64; 2]| [needs(axis, -1.0, low), needs(axis, 1.0, high)];
        let (wide, tall) = (ends(&right, across), ends(&up, upright));
        let distance = |[low, high]: [f64; 2], halves: [f64; 2]| (low + high) / (halves[0] + halves[1]);
        let distance = f64::max(distance(wide, across), distance(tall, upright));
        let middle = |[low, high]: [f64; 2], halves: [f64; 2]| 0.5 * (high - low + (halves[0] - halves[1]) * distance);
        let target = shoulder + right * middle(wide, across) + up * middle(tall, upright);
        [target, target + back * distance]
    }

    /// The lines of the ground, in a circle about the row.
    pub(super) fn ground(&self, colour: [u8; 3]) -> LineStrips3D {
        let Figure { shoulder, reach_m, ground_m, .. } = self.figure;
        let [spacing, beyond] = GROUND.map(|lengths| lengths * reach_m);
        let radius = self.place(0).norm() + beyond;
        let count = (radius / spacing) as i32;
        let strips = (-count..=count).flat_map(|line| {
            let aside = f64::from(line) * spacing;
            let half = (radius * radius - aside * aside).max(0.0).sqrt();
            let point = |x: f64, y: f64| single([shoulder.x + x, shoulder.y + y, ground_m]);
            [[point(aside, -half), point(aside, half)], [point(-half, aside), point(half, aside)]]
        });
        LineStrips3D::new(strips).with_colors([Color::from(colour)]).with_radii([Radius::new_ui_points(1.0)])
    }

    /// The place of the key to the colours: before the middle, on the ground where that is near the arm.
    pub(super) fn key(&self) -> Point3<f64> {
        let Figure { shoulder, reach_m, ground_m, .. } = self.figure;
        let (sin, cos) = WIDE[0].sin_cos();
        let height_m = (shoulder.z - ground_m - 0.55 * reach_m).clamp(0.0, 0.45 * reach_m);
        let ahead_m = if height_m > 0.0 { 0.6 } else { 1.3 } * reach_m;
        Point3::new(shoulder.x, shoulder.y, ground_m + height_m) + Vector3::new(cos, sin, 0.0) * ahead_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_has_every_learner_in_sight_and_no_room_to_spare() {
        let figure = Figure { reach_m: 0.7, shoulder: Point3::new(0.1, -0.2, 1.3), ..Figure::default() };
        let figure = Figure { name: figure.shoulder + Vector3::z(), ..figure };
        let views = [(1, 1.4, None), (2, 1.4, None), (3, 1.0, None), (4, 0.9, None), (2, 0.5, None)];
        for (learners, aspect, alone) in views.into_iter().chain([(3, 1.4, Some(2)), (3, 0.5, Some(0))]) {
            let room = Room::around(&figure);
            let stage = Stage::new(figure.clone(), room.clone(), learners);
            let [target, eye] = stage.camera(aspect, alone);
            let ahead = (target - eye).normalize();
            let right = ahead.cross(&Vector3::z()).normalize();
            let half = (0.5 * FIELD_OF_VIEW).tan();
            // How far what is in sight reaches towards an edge, as a part of the way to it.
            let reaches = |axis: Vector3<f64>, half: f64| {
                let of = |learner: usize| {
                    room.needs(|point| {
                        let way = figure.shoulder + point + stage.place(learner) - eye;
                        assert!(way.dot(&ahead) > 0.0, "before the camera");
                        way.dot(&axis) / (way.dot(&ahead) * half)
                    })
                };
                let shown = alone.map_or(0..learners, |learner| learner..learner + 1);
                shown.map(of).fold(0.0, f64::max)
            };
            let up = right.cross(&ahead);
            let parts = [
                reaches(right, half * aspect) / (1.0 - SIDES),
                reaches(-right, half * aspect) / (1.0 - SIDES),
                reaches(up, half) / (1.0 - ABOVE),
                reaches(-up, half) / (1.0 - BELOW),
            ];
            let most = parts.into_iter().fold(0.0, f64::max);
            assert!(most < 1.0 + 1e-9, "{learners} in {aspect}: {parts:?}");
            assert!(most > 0.9, "{learners} in {aspect}: {most}");
        }
    }
}
