//! The room of an arm: the space in which it may be seen over all of its postures.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{body::Figure, posture::Posture};
use body_schema_engine::model::State;
use body_schema_wire::Description;

/// The number of postures, uniform in the joint limits, that define the room; equal for every run.
const POSTURES: usize = 200;
/// The share of them that must be entirely in view.
const IN_SIGHT: f64 = 0.97;
/// The usual positions of an arm, from its shoulder, in lengths of the arm. x is ahead, y to the left, z up.
const MOSTLY: [[f64; 3]; 7] = [
    [0.8, -0.1, 0.2],
    [0.5, -0.55, 0.7],
    [0.5, -0.55, -0.4],
    [0.3, 0.5, -0.6],
    [0.0, -0.7, 0.0],
    [0.0, -0.3, -0.75],
    [0.0, 0.55, -0.6],
];

/// The points that must be in view of one learner, from its shoulder, metres.
#[derive(Clone, Debug)]
pub(super) struct Room {
    /// The points that are always there.
    always: Vec<Vector3<f64>>,
    /// The points of each posture.
    postures: Vec<Vec<Vector3<f64>>>,
}

impl Room {
    /// The room of an arm in its figure, with the cameras and targets that stand beside it.
    pub(super) fn of(arm: &State, figure: &Figure, description: &Description) -> Self {
        let mut room = Self::around(figure);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut draw = || -> Vec<f64> {
            let limits = description.joints.iter().map(|joint| joint.limits);
            limits.map(|[lower, upper]| lower + (upper - lower) * rng.random::<f64>()).collect()
        };
        let ground = figure.ground_m - figure.shoulder.z;
        let from_shoulder = |point: Point3<f64>| above(point - figure.shoulder, ground);
        if arm.joints.len() == description.joints.len() {
            let posture = |configuration: Vec<f64>| {
                Posture::of(arm, &configuration).points().into_iter().map(from_shoulder).collect()
            };
            room.postures = (0..POSTURES).map(|_| posture(draw())).collect();
        }
        let cameras = arm.devices.iter().filter(|device| device.link.is_none());
        room.always.extend(cameras.map(|camera| from_shoulder(camera.pose.translation.vector.into())));
        // The first target is the marker once more.
        let boards = arm.targets.iter().skip(1).zip(&description.targets).filter(|(target, _)| target.link == 0);
        let points = boards
            .flat_map(|(board, known)| known.points_m.iter().map(|point| board.place.frame() * Point3::from(*point)));
        room.always.extend(points.map(from_shoulder));
        room
    }

    /// This room for a hand that may be farther out than it is believed to be.
    pub(super) fn with_hand(mut self, beyond_m: f64) -> Self {
        for posture in &mut self.postures {
            let hand = posture.last().copied().filter(|hand| hand.norm() > 0.0);
            posture.extend(hand.map(|hand| hand + beyond_m * hand.normalize()));
        }
        self
    }

    /// The room of a figure whose arm takes only these postures, given by the points on its axes and its marker.
    pub(super) fn of_postures(figure: &Figure, postures: Vec<Vec<Point3<f64>>>) -> Self {
        let from_shoulder = |posture: Vec<Point3<f64>>| posture.iter().map(|point| point - figure.shoulder).collect();
        let name = figure.name - figure.shoulder;
        Self { always: vec![name], postures: postures.into_iter().map(from_shoulder).collect() }
    }

    /// The room of a figure whose arm is in the usual positions.
    pub(super) fn around(figure: &Figure) -> Self {
        let ground = figure.ground_m - figure.shoulder.z;
        let mostly = MOSTLY.iter().map(|offset| above(Vector3::from(*offset) * figure.reach_m, ground));
        Self { always: mostly.chain([figure.name - figure.shoulder]).collect(), postures: Vec::new() }
    }

    /// The most that `need` requires over the room, except for the most demanding postures.
    pub(super) fn needs(&self, need: impl Fn(&Vector3<f64>) -> f64) -> f64 {
        let most = |points: &[Vector3<f64>]| points.iter().map(&need).fold(f64::NEG_INFINITY, f64::max);
        let mut postures: Vec<f64> = self.postures.iter().map(|points| most(points)).collect();
        postures.sort_by(f64::total_cmp);
        let usual = postures.get((IN_SIGHT * postures.len() as f64) as usize).copied();
        most(&self.always).max(usual.unwrap_or(f64::NEG_INFINITY))
    }
}

/// A point, or where it is on the ground if it is below.
fn above(point: Vector3<f64>, ground: f64) -> Vector3<f64> {
    Vector3::new(point.x, point.y, point.z.max(ground))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_that_may_be_farther_out_has_room() {
        let postures = vec![vec![Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, 0.0, 2.0)]];
        let room = Room { postures, ..Room::around(&Figure { reach_m: 1.0, ..Figure::default() }) };
        assert_eq!(room.with_hand(0.5).needs(|point| point.z), 2.5);
    }

    #[test]
    fn few_postures_may_go_out_of_sight() {
        let figure = Figure { reach_m: 1.0, ..Figure::default() };
        let postures = (0..100).map(|index| vec![Vector3::new(f64::from(index), 0.0, 0.0)]).collect();
        let room = Room { postures, ..Room::around(&figure) };
        assert_eq!(room.needs(|point| point.x), 97.0);
        assert_eq!(room.needs(|point| -point.y), 0.7, "what is mostly there counts always");
    }
}
