//! Joints that aim a camera: a robot that keeps what it sees in the middle of the picture.
//!
//! With u the direction from the camera to the target, or to the middle of several, in the camera's frame, and z the direction in which it looks, the servo joints
//! are where
//!
//! ```text
//! r = a (u_x, u_y)/√(u_x² + u_y²) = 0,     a the angle between u and z
//! ```
//!
//! or as near to it as their limits allow, found by damped Gauss–Newton steps from the middle of their ranges. So they follow from the
//! other joints and from the state of the robot: the true one in a simulated world, the believed one where a movement is chosen.

use nalgebra::{Matrix2, Point3, Vector2, Vector3};

use crate::{
    elementary::{atan2, hypot},
    kinematics::JointBox,
    model::{Frame, Links, State},
};

/// The joints that aim a camera at a target, or at the middle of several.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// The joints, and their limits (rad or m).
    joints: Vec<(usize, (f64, f64))>,
    /// The camera, by its index among the devices.
    camera: usize,
    /// The indices of the targets, one at least.
    targets: Vec<usize>,
}

/// Why joints cannot aim a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnfitServo {
    /// No joint is named, or no target.
    #[error("no joint aims the camera, or at nothing")]
    None,
    /// A joint does not move the camera.
    #[error("joint {0} (counted from 0) does not move the camera")]
    Camera(usize),
    /// A joint moves a target as well.
    #[error("joint {0} (counted from 0) moves a target as well")]
    Target(usize),
}

/// Steps at most, and below which length (rad or m) they have come to an end.
const STEPS: usize = 40;
const SMALL: f64 = 1e-12;
/// The damping, as a share of the greatest row.
const DAMPING: f64 = 1e-9;
/// How far a joint goes in one step, rad or m.
const LONGEST: f64 = 0.7;

impl Servo {
    /// The `joints` within their `limits`, of a robot like `state`: they move the camera and none of the `targets`.
    ///
    /// # Errors
    ///
    /// [`UnfitServo`] with the first joint that does not fit.
    pub fn new(
        state: &State,
        limits: &JointBox,
        joints: &[usize],
        camera: usize,
        targets: &[usize],
    ) -> Result<Self, UnfitServo> {
        let moves = |joint: usize, frame: Frame| state.link_of(frame).is_some_and(|link| state.tree.moves(joint, link));
        for &joint in joints {
            if !moves(joint, Frame::Device(camera)) {
                return Err(UnfitServo::Camera(joint));
            }
            if targets.iter().any(|target| moves(joint, Frame::Target(*target))) {
                return Err(UnfitServo::Target(joint));
            }
        }
        if joints.is_empty() || targets.is_empty() {
            return Err(UnfitServo::None);
        }
        let joints = joints.iter().map(|joint| (*joint, (limits.lower(*joint), limits.upper(*joint)))).collect();
        Ok(Self { joints, camera, targets: targets.to_vec() })
    }

    /// The joints.
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().map(|(joint, _)| *joint)
    }

    /// Box `limits` with the servo joints in the middle of their ranges: what is left to choose.
    pub fn without(&self, limits: &JointBox) -> JointBox {
        let mut joints = limits.joints().to_vec();
        self.joints.iter().for_each(|(joint, within)| joints[*joint] = [middle(*within); 2].into());
        JointBox::new(joints).unwrap_or_else(|_| limits.clone())
    }

    /// The posture `positions` (rad or m per joint) with the servo joints as they aim, of a robot that is as `state` says.
    pub fn aimed(&self, state: &State, positions: &[f64]) -> Vec<f64> {
        let mut posture = positions.to_vec();
        self.joints.iter().for_each(|(joint, within)| posture[*joint] = middle(*within));
        self.aim(state, posture, SMALL)
    }

    /// The same from servo joints that aim there already, or nearly so, until no joint moves by more than `tolerance` (rad or m).
    pub fn aim(&self, state: &State, mut posture: Vec<f64>, tolerance: f64) -> Vec<f64> {
        // The servo joints do not move the targets.
        let mut links = Links::towards(state, self.targets.iter().map(|target| Frame::Target(*target)));
        links.at(&posture);
        let places = self.targets.iter().map(|target| links.target(*target));
        let target = Point3::from(places.sum::<Vector3<f64>>() / self.targets.len() as f64);
        let mut links = Links::towards(state, [Frame::Device(self.camera)]);
        let mut rows = vec![Row { by: Vector2::zeros(), step: 0.0 }; self.joints.len()];
        // Where limits leave much of r, Gauss–Newton's steps are too short or too long.
        let (mut best, mut share) = ((f64::INFINITY, posture.clone()), 1.0);
        for _ in 0..STEPS {
            let Some(residual) = self.linearise(&mut links, &target, &posture, &mut rows) else { break };
            let off = residual.norm();
            if off < best.0 {
                share = if off > 0.5 * best.0 { 2.0 * share } else { 1.0 };
                best = (off, posture.clone());
                self.solve(&residual, &posture, &mut rows);
            } else {
                share *= 0.25;
            }
            let mut longest: f64 = 0.0;
            for ((joint, (lower, upper)), row) in self.joints.iter().zip(&rows) {
                let from = best.1[*joint];
                posture[*joint] = (from + (share * row.step).clamp(-LONGEST, LONGEST)).clamp(*lower, *upper);
                longest = longest.max((posture[*joint] - from).abs());
            }
            if longest < tolerance {
                // What is left after so short a whole step goes with its square.
                return if share == 1.0 { posture } else { best.1 };
            }
        }
        best.1
    }

    /// Writes the step of each servo joint: δ = −Jᵀ (J Jᵀ + λ I)⁻¹ r over those that are not stopped by a limit.
    fn solve(&self, residual: &Vector2<f64>, posture: &[f64], rows: &mut [Row]) {
        let is_outward = |index: usize, step: f64| {
            let (joint, (lower, upper)) = self.joints[index];
            (posture[joint] <= lower && step < 0.0) || (posture[joint] >= upper && step > 0.0)
        };
        // At a limit that the slope of ‖r‖² leads beyond.
        let mut stopped: Vec<bool> =
            rows.iter().enumerate().map(|(index, row)| is_outward(index, -row.by.dot(residual))).collect();
        loop {
            let free = || rows.iter().zip(&stopped).filter(|(_, stopped)| !**stopped).map(|(row, _)| row.by);
            let squares: Matrix2<f64> = free().map(|by| by * by.transpose()).sum();
            let damped = squares + Matrix2::identity() * (DAMPING * squares.trace() + f64::MIN_POSITIVE);
            let towards = damped.try_inverse().map_or(Vector2::zeros(), |inverse| inverse * residual);
            for (row, stopped) in rows.iter_mut().zip(&stopped) {
                row.step = if *stopped { 0.0 } else { -row.by.dot(&towards) };
            }
            match (0..rows.len()).find(|index| is_outward(*index, rows[*index].step)) {
                Some(index) => stopped[index] = true,
                None => return,
            }
        }
    }

    /// Writes the derivative of r by each servo joint, and returns r; `None` where it is no number.
    fn linearise(
        &self,
        links: &mut Links<'_>,
        target: &Point3<f64>,
        posture: &[f64],
        rows: &mut [Row],
    ) -> Option<Vector2<f64>> {
        let camera = Frame::Device(self.camera);
        let eye = links.at(posture).pose(camera);
        let into_eye = eye.rotation.inverse();
        let away = into_eye * (target - Point3::from(eye.translation.vector));
        let distance = away.norm();
        let u = away / distance;
        if !u.iter().all(|x| x.is_finite()) {
            return None;
        }
        let across = hypot(u.x, u.y);
        let angle = atan2(across, u.z);
        // On the axis of the picture any direction across will do, and behind the camera it must be one.
        let radial = if across > 1e-12 { Vector2::new(u.x, u.y) / across } else { Vector2::x() };
        let tangential = Vector2::new(-radial.y, radial.x);
        for (joint, row) in self.joints().zip(rows) {
            // By how the eye moves: as what is at the target would, if the eye carried it.
            let by_eye = links.twist(joint).at(&target.coords);
            let moved = into_eye * -by_eye / distance;
            let turn = moved - u * u.dot(&moved);
            let turned = Vector2::new(turn.x, turn.y);
            let along = if across > 1e-6 { -turn.z / across } else { radial.dot(&turned) };
            let around = if across > 1e-6 { angle / across } else { 1.0 } * tangential.dot(&turned);
            row.by = radial * along + tangential * around;
        }
        Some(radial * angle)
    }
}

/// What a servo joint does in a step.
#[derive(Clone, Debug)]
struct Row {
    /// The derivative of r by its position.
    by: Vector2<f64>,
    /// How far it goes, rad or m.
    step: f64,
}

/// The middle of a joint's range.
fn middle((lower, upper): (f64, f64)) -> f64 {
    lower + 0.5 * (upper - lower)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        kinematics::{Joint, Line, Tree},
        model::{Device, random::random_arm},
    };

    /// A neck of pan and tilt beside an arm of four joints that carries the target; the camera is a little off the neck's axes.
    fn eyes(seed: u64) -> (State, JointBox, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut state = random_arm(&mut rng, 6);
        let mut off = |size: f64| Vector3::from_fn(|_, _| size * rng.random_range(-1.0..1.0));
        let line = |direction: Vector3<f64>, point: Vector3<f64>| {
            Joint::Revolute(Line { point: point.into(), direction: nalgebra::UnitVector3::new_normalize(direction) })
        };
        let above = Vector3::new(0.0, 0.0, 0.5);
        state.joints[0] = line(Vector3::z() + off(0.1), above + off(0.05));
        state.joints[1] = line(Vector3::y() + off(0.1), above + off(0.05));
        state.tree = Tree::new(vec![None, Some(0), None, Some(2), Some(3), Some(4)]).expect("a tree");
        state.targets[0].link = 6;
        // It looks along x.
        let forward = UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0);
        let pose = Isometry3::from_parts((above + off(0.05)).into(), forward * UnitQuaternion::new(off(0.1)));
        state.devices =
            vec![Device { link: Some(2), pose, intrinsics: Some([500.0, 500.0, 320.0, 240.0]), distortion: None }];
        let limits = vec![(-2.5, 2.5), (-1.4, 1.4), (-1.5, 1.5), (-1.5, 1.5), (-1.5, 1.5), (-1.5, 1.5)];
        (state, JointBox::new(limits).expect("limits"), rng)
    }

    /// What is aimed at is in the middle, and where limits forbid that no turn of the neck by a degree brings it nearer by a twentieth of
    /// that.
    #[test]
    fn the_target_comes_to_the_middle() {
        let mut reached = 0;
        for seed in 1001..1101 {
            let (state, limits, mut rng) = eyes(seed);
            let servo = Servo::new(&state, &limits, &[0, 1], 0, &[0]).expect("it fits");
            let theta = limits.draw(&mut rng);
            let aimed = servo.aimed(&state, &theta);
            assert!(limits.contains(&aimed) && aimed[2..] == theta[2..]);
            assert_eq!(servo.aimed(&state, &aimed), aimed, "where the neck was does not matter");
            let off = |posture: &[f64]| {
                let away = state.relative(Frame::Target(0), Frame::Device(0), posture).translation.vector;
                hypot(away.x, away.y).atan2(away.z)
            };
            let is_inside =
                (0..2).all(|joint| limits.lower(joint) < aimed[joint] && aimed[joint] < limits.upper(joint));
            if is_inside {
                assert!(off(&aimed) < 1e-9, "{seed}: {}", off(&aimed));
                reached += 1;
                continue;
            }
            for (joint, by) in [(0, 0.02), (0, -0.02), (1, 0.02), (1, -0.02)] {
                let mut turned = aimed.clone();
                turned[joint] = (turned[joint] + by).clamp(limits.lower(joint), limits.upper(joint));
                assert!(off(&turned) > off(&aimed) - 1e-3, "{seed}: {joint}");
            }
        }
        assert!(reached > 50, "{reached}");
    }

    /// With two targets their middle is before the camera, and from a state that is a little off one gets there too.
    #[test]
    fn the_middle_of_two_targets_is_aimed_at() {
        let mut reached = 0;
        for seed in 1001..1051 {
            let (mut state, limits, mut rng) = eyes(seed);
            let mut other = state.targets[0].clone();
            other.link = 4;
            state.targets.push(other);
            let servo = Servo::new(&state, &limits, &[0, 1], 0, &[0, 1]).expect("it fits");
            let aimed = servo.aimed(&state, &limits.draw(&mut rng));
            if !(0..2).all(|joint| limits.lower(joint) < aimed[joint] && aimed[joint] < limits.upper(joint)) {
                continue;
            }
            reached += 1;
            let place =
                |target: usize| state.relative(Frame::Target(target), Frame::Device(0), &aimed).translation.vector;
            let middle = 0.5 * (place(0) + place(1));
            assert!(hypot(middle.x, middle.y) < 1e-9 * middle.z, "{seed}: {middle}");
            let mut near = aimed.clone();
            near[0] += 0.05;
            near[1] -= 0.05;
            let coarse = servo.aim(&state, near, 1e-2);
            assert!((0..2).all(|joint| (coarse[joint] - aimed[joint]).abs() < 1e-3), "{seed}: {coarse:?} {aimed:?}");
        }
        assert!(reached > 20, "{reached}");
    }

    #[test]
    fn only_what_moves_the_camera_alone_aims_it() {
        let (state, limits, _) = eyes(1);
        assert_eq!(Servo::new(&state, &limits, &[], 0, &[0]), Err(UnfitServo::None));
        assert_eq!(Servo::new(&state, &limits, &[0], 0, &[]), Err(UnfitServo::None));
        assert_eq!(Servo::new(&state, &limits, &[0, 3], 0, &[0]), Err(UnfitServo::Camera(3)));
        let mut both = state.clone();
        both.targets[0].link = 2;
        assert_eq!(Servo::new(&both, &limits, &[0], 0, &[0]), Err(UnfitServo::Target(0)));
        let servo = Servo::new(&state, &limits, &[0, 1], 0, &[0]).expect("it fits");
        let left = servo.without(&limits);
        assert_eq!((left.joints()[0], left.joints()[1], left.joints()[2]), ((0.0, 0.0), (0.0, 0.0), (-1.5, 1.5)));
    }
}
