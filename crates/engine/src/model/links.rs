//! The links of a state at one posture after another: the pass along the tree in plain numbers, and forward kinematics by it.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Frame, Hand, Loads, State, Target};
use crate::kinematics::{Kernel, Motion, Plain, Turned, Twist, Walk, correction::LOADS};

/// The links of one state, computed at one posture after another.
#[derive(Clone, Debug)]
pub struct Links<'a> {
    state: &'a State,
    kernel: Kernel,
    /// The loads, where joints give way or their compliance is learned.
    loads: Option<&'a Loads>,
    /// The torques on each joint, N·m per kg; empty without loads.
    torques: Vec<[f64; LOADS]>,
    /// The readings of the present posture.
    positions: Vec<f64>,
    walk: Walk<Plain>,
}

impl<'a> Links<'a> {
    /// The links of a state, at no posture yet: call [`at`](Self::at) first.
    pub fn new(state: &'a State) -> Self {
        Self::with(state, state.bending(), |_| true, |_| false)
    }

    /// The links of a state at readings `positions`, rad or m, one per joint.
    pub fn of(state: &'a State, positions: &[f64]) -> Self {
        let mut links = Self::new(state);
        links.at(positions);
        links
    }

    /// The links that lead to some frames, at no posture yet. Nothing else may be asked for.
    pub(crate) fn towards(state: &'a State, frames: impl IntoIterator<Item = Frame> + Clone) -> Self {
        let leads = |joint: usize, frame| state.link_of(frame).is_some_and(|link| state.tree.moves(joint, link));
        let asked = |joint| frames.clone().into_iter().any(|frame| leads(joint, frame));
        Self::with(state, state.bending(), asked, |_| false)
    }

    /// The links of the joints that are `asked` for and of those that carry them, with the torques of these loads. `needs_sine` marks
    /// the joints whose readings need sine and cosine for more than their correction.
    pub(crate) fn with(
        state: &'a State,
        loads: Option<&'a Loads>,
        asked: impl Fn(usize) -> bool,
        needs_sine: impl Fn(usize) -> bool,
    ) -> Self {
        let joints = (&state.joints[..], &state.corrections[..]);
        let kernel = Kernel::new(&state.tree, &state.base, joints, asked, needs_sine);
        let walk = kernel.walk(Plain);
        Self { state, kernel, loads, torques: Vec::new(), positions: Vec::with_capacity(state.joints.len()), walk }
    }

    /// The state.
    pub fn state(&self) -> &'a State {
        self.state
    }

    /// The readings of the present posture, rad or m, one per joint.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Moves to readings `positions`, rad or m, one per joint.
    pub fn at(&mut self, positions: &[f64]) -> &mut Self {
        debug_assert_eq!(positions.len(), self.state.joints.len());
        if let Some(loads) = self.loads {
            self.torques = loads.torques(positions);
        }
        self.positions.clear();
        self.positions.extend_from_slice(positions);
        self.walk.restart();
        for (joint, reading) in positions.iter().enumerate() {
            let given = self.torques.get(joint).map(|torques| self.state.corrections[joint].given(torques));
            self.walk.step(&self.kernel, *reading, given);
        }
        self
    }

    /// A joint's axes and pivot.
    #[inline]
    pub(crate) fn joint(&self, joint: usize) -> Turned<Plain> {
        self.walk.passed.at(joint)
    }

    /// The twist by which a joint moves what it carries, per unit of its position.
    pub fn twist(&self, joint: usize) -> Twist {
        self.joint(joint).twist(self.state.joints[joint].kind())
    }

    /// The torques on a joint, N·m per kg.
    pub fn torques(&self, joint: usize) -> [f64; LOADS] {
        self.torques.get(joint).copied().unwrap_or_default()
    }

    /// The position of a joint, rad or m.
    pub fn position(&self, joint: usize) -> f64 {
        self.state.corrections[joint].loaded(self.positions[joint], &self.torques(joint))
    }

    /// The motion of a link: from θ = 0 in the robot's frame into the frame of the measurements.
    pub fn link(&self, link: usize) -> Motion {
        let (translation, rotation) = self.walk.place_on(link, &self.kernel.fixed(link, &Point3::origin()));
        Motion { rotation, translation }
    }

    /// The position of a target, metres.
    #[inline]
    pub fn target(&self, target: usize) -> Vector3<f64> {
        let Target { link, place } = &self.state.targets[target];
        self.walk.place_on(*link, &self.kernel.fixed(*link, &place.origin())).0
    }

    /// The pose of a frame.
    pub fn pose(&self, frame: Frame) -> Isometry3<f64> {
        match frame {
            Frame::Link(link) => self.link(link).pose(),
            Frame::Target(target) => {
                let Target { link, place } = &self.state.targets[target];
                self.link(*link).pose() * place.frame()
            }
            Frame::Device(device) => {
                let device = &self.state.devices[device];
                device.link.map_or(device.pose, |link| self.link(link).pose() * device.pose)
            }
        }
    }

    /// The pose of a frame as seen from another.
    pub fn relative(&self, frame: Frame, seen_from: Frame) -> Isometry3<f64> {
        self.pose(seen_from).inverse() * self.pose(frame)
    }

    /// The position of the hand, metres.
    pub fn marker(&self) -> Point3<f64> {
        match self.state.hand {
            Hand::Target(target) => self.target(target).into(),
            Hand::Device(_) => self.pose(self.state.hand.frame()).translation.vector.into(),
        }
    }

    /// What predictions are about: the hand's place in the frame that it is asked for in, metres.
    pub fn predicted(&self) -> Point3<f64> {
        self.state.seen_from.map_or_else(
            || self.marker(),
            |observer| self.relative(self.state.hand.frame(), observer.frame()).translation.vector.into(),
        )
    }
}

impl State {
    /// Where a target is at readings `positions` (rad or m, one per joint), in the frame of the measurements, metres.
    pub fn target_at(&self, target: usize, positions: &[f64]) -> Point3<f64> {
        Links::towards(self, [Frame::Target(target)]).at(positions).target(target).into()
    }

    /// Where a frame is at readings `positions` (rad or m, one per joint), in the frame of the measurements.
    pub fn frame_at(&self, frame: Frame, positions: &[f64]) -> Isometry3<f64> {
        Links::towards(self, [frame]).at(positions).pose(frame)
    }

    /// The marker, which is on the hand: `p = base e^{ξ₁θ₁} … e^{ξₙθₙ} p₀`.
    pub fn marker_at(&self, positions: &[f64]) -> Point3<f64> {
        Links::towards(self, [self.hand.frame()]).at(positions).marker()
    }

    /// What predictions are about: the hand's place in the frame that it is asked for in ([`seen_from`](Self::seen_from)), metres.
    pub fn predicted_at(&self, positions: &[f64]) -> Point3<f64> {
        Links::of(self, positions).predicted()
    }

    /// The motion of each link, `base e^{ξθ} …` along the path to it: the i-th carries what is fixed to link i (0 is the base)
    /// from where it is at θ = 0 into the frame of the measurements.
    pub fn links(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let links = Links::of(self, positions);
        (0..=self.joints.len()).map(|link| links.link(link).pose()).collect()
    }

    /// The skeleton at θ: the pivot of every revolute joint in order, then the marker, metres.
    ///
    /// A line has no distinguished point, so this is a drawing of the arm, not a property of its kinematics.
    pub fn skeleton(&self, positions: &[f64]) -> Vec<Point3<f64>> {
        let links = Links::of(self, positions);
        let turning = (0..self.joints.len()).filter(|joint| self.joints[*joint].line().is_some());
        let pivots = turning.map(|joint| Point3::from(links.joint(joint).pivot));
        pivots.chain([links.marker()]).collect()
    }
}
