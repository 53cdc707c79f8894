//! The torques of gravity on joints that give way.
//!
//! Joint i turns by c τᵢ more than its reading says, τᵢ being the torque about it with which gravity pulls at a mass of 1 kg:
//!
//! ```text
//! τᵢ(q) = −g ∂h/∂qᵢ = −g (up × wᵢ)·(p − vᵢ)        N·m per kg
//! ```
//!
//! with h = up·p the height of the mass and (vᵢ, wᵢ) the axis, both of the *described* robot without load at the readings q, in
//! the frame of its base. So τ is a function of q alone, whatever is estimated. c is in rad per N·m of 1 kg: a load of m kg on a
//! joint of stiffness k (N·m/rad) makes c = m/k. A joint that slides bears nothing, and neither does one behind the mass.

use nalgebra::{DMatrix, Isometry3, Matrix3xX, Point3, UnitVector3, Vector3};

use crate::kinematics::{Correction, Joint, JointKind, Kernel, Plain, Tree, Turned, correction::LOADS};

/// g, m/s².
pub const GRAVITY: f64 = 9.81;

/// A load that pulls at the joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum Load {
    /// A mass at the hand's target.
    Target,
    /// A mass at the elbow.
    Elbow,
}

impl Load {
    /// All loads, in the order of [`Correction::compliance`](super::Correction).
    pub const ALL: [Self; LOADS] = [Self::Target, Self::Elbow];

    /// The load's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Target => "target",
            Self::Elbow => "elbow",
        }
    }
}

/// A mass of 1 kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// The link that carries it: 0 is the base, i what moves with the i-th joint.
    pub link: usize,
    /// Its position at θ = 0, in the frame of the base, metres.
    pub place: Point3<f64>,
}

/// An axis at a posture.
struct Placed {
    pivot: Vector3<f64>,
    w: Vector3<f64>,
}

/// The described robot, and the masses at which gravity pulls.
#[derive(Clone, Debug, PartialEq)]
pub struct Loads {
    /// The axes at θ = 0, in the frame of the base.
    pub joints: Vec<Joint>,
    /// Which joint carries which.
    pub tree: Tree,
    /// The upward direction, in the frame of the base.
    pub up: UnitVector3<f64>,
    /// The masses, by load.
    pub masses: [Mass; LOADS],
}

impl Loads {
    /// The loads of these joints, each of which the tree hangs on another: `hand`, and a mass at the written pivot of the revolute joint
    /// `elbow`; of the middle revolute joint (the earlier of two) of those that bear the hand if none is named.
    pub(super) fn new(
        (joints, tree): (Vec<Joint>, Tree),
        hand: Mass,
        up: UnitVector3<f64>,
        elbow: Option<usize>,
    ) -> Self {
        let bears = |joint: usize| tree.is_serial() || tree.moves(joint, hand.link);
        let elbow = elbow.or_else(|| middle(&joints, bears)).unwrap_or(0);
        let place = joints.get(elbow).and_then(Joint::line).map_or(Point3::origin(), |line| line.point);
        let masses = [hand, Mass { link: tree.link_before(elbow), place }];
        Self { joints, tree, up, masses }
    }

    /// The mass of a load.
    pub fn mass(&self, load: Load) -> &Mass {
        &self.masses[load as usize]
    }

    /// The joint at whose pivot the mass at the elbow is; `None` where no joint is there.
    pub fn elbow(&self) -> Option<usize> {
        let Mass { link, place } = self.mass(Load::Elbow);
        let mut near = (0..self.joints.len()).filter(|joint| self.tree.link_before(*joint) == *link);
        if self.tree.is_serial() {
            return near.next();
        }
        near.find(|joint| self.joints[*joint].line().is_some_and(|line| line.point == *place))
    }

    /// Whether a joint can bear a load.
    pub fn bears(&self, joint: usize, load: Load) -> bool {
        self.tree.moves(joint, self.mass(load).link) && self.joints[joint].kind() == JointKind::Revolute
    }

    /// The torque of every load about every joint at readings (rad or m), N·m per kg.
    pub fn torques(&self, readings: &[f64]) -> Vec<[f64; 2]> {
        let (axes, places) = self.posture(readings);
        let torque = |joint: usize, Placed { pivot, w }: &Placed| {
            let across = self.up.cross(w) * -GRAVITY;
            Load::ALL.map(
                |load| {
                    if self.bears(joint, load) { across.dot(&(places[load as usize] - pivot)) } else { 0.0 }
                },
            )
        };
        axes.iter().enumerate().map(|(joint, axis)| torque(joint, axis)).collect()
    }

    /// ∂τᵢ/∂qⱼ of a load (n × n): the curvature of the potential energy, up·(wₐ × ∂p/∂q_b) with a the joint nearer to the base.
    pub fn slopes(&self, load: Load, readings: &[f64]) -> DMatrix<f64> {
        let (axes, places) = self.posture(readings);
        let (p, count) = (places[load as usize], self.joints.len());
        let turns = |joint: usize| self.joints[joint].kind() == JointKind::Revolute;
        let mut moved = Matrix3xX::zeros(count);
        for (joint, Placed { pivot, w }) in axes.iter().enumerate() {
            moved.set_column(joint, &if turns(joint) { w.cross(&(p - pivot)) } else { *w });
        }
        DMatrix::from_fn(count, count, |i, j| {
            let (near, far) = (i.min(j), i.max(j));
            let moves = self.bears(i, load) && self.tree.moves(j, self.mass(load).link) && turns(near);
            if moves { -GRAVITY * self.up.dot(&axes[near].w.cross(&moved.column(far))) } else { 0.0 }
        })
    }

    /// The axes and the masses at readings.
    fn posture(&self, readings: &[f64]) -> (Vec<Placed>, [Vector3<f64>; LOADS]) {
        let described = vec![Correction::default(); self.joints.len()];
        let kernel = Kernel::new(&self.tree, &Isometry3::identity(), (&self.joints, &described), |_| true, |_| false);
        let mut walk = kernel.walk(Plain);
        for joint in 0..self.joints.len() {
            walk.step(&kernel, readings.get(joint).copied().unwrap_or_default(), None);
        }
        let placed = |joint: usize| {
            let Turned { pivot, axis: w, .. } = walk.passed.at(joint);
            Placed { pivot, w }
        };
        let mass = |Mass { link, place }: &Mass| walk.place_on(*link, &kernel.fixed(*link, place)).0;
        ((0..self.joints.len()).map(placed).collect(), self.masses.each_ref().map(mass))
    }
}

/// The middle one of the revolute joints that bear the hand, the earlier of two.
fn middle(joints: &[Joint], bears: impl Fn(usize) -> bool) -> Option<usize> {
    let is_turning = |joint: &usize| bears(*joint) && joints[*joint].kind() == JointKind::Revolute;
    let turning: Vec<usize> = (0..joints.len()).filter(is_turning).collect();
    turning.get(turning.len().checked_sub(1)? / 2).copied()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        kinematics::Line,
        model::{State, random::random_state},
    };

    fn revolute(point: [f64; 3], direction: Vector3<f64>) -> Joint {
        Joint::Revolute(Line { point: point.into(), direction: UnitVector3::new_normalize(direction) })
    }

    /// A shoulder that turns about the vertical, then pitches; an elbow 0.4 m out, the hand 0.7 m out.
    fn arm() -> State {
        let joints = vec![
            revolute([0.0, 0.0, 0.3], Vector3::z()),
            revolute([0.0, 0.0, 0.3], Vector3::y()),
            revolute([0.4, 0.0, 0.3], Vector3::y()),
            revolute([0.6, 0.0, 0.3], Vector3::x()),
            revolute([0.7, 0.0, 0.3], Vector3::y()),
        ];
        State::arm(joints, Point3::new(0.7, 0.0, 0.3))
    }

    /// An arm held out level bears its masses times their reach, and gives way downwards; about the vertical nothing pulls.
    #[test]
    fn a_level_arm_bears_mass_times_reach() {
        let loads = arm().loads_under(Vector3::z_axis(), None);
        let torques = loads.torques(&[0.7, 0.0, 0.0, 0.0, 0.0]);
        let expected = [[0.0, 0.0], [7.0, 4.0], [3.0, 0.0], [0.0, 0.0], [0.0, 0.0]];
        for (found, expected) in torques.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected * GRAVITY / 10.0).abs() < 1e-12, "{torques:?}");
        }
        // To turn about +y is to lower what is in front.
        let mut state = arm();
        state.loads = Some(loads.into());
        state.corrections[1].compliance = [0.01, 0.0];
        assert!(state.marker_at(&[0.0; 5]).z < 0.3 - 0.04);
        // Held upright it bears nothing.
        let upright = state.marker_at(&[0.0, -std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0]);
        assert!((upright - Point3::new(0.0, 0.0, 1.0)).norm() < 1e-12);
    }

    /// The torque is what the potential energy falls by, and its slopes are its differences.
    #[test]
    fn torques_are_the_descent_of_the_potential_energy() {
        for seed in 0..20 {
            let state = random_state(&mut ChaCha8Rng::seed_from_u64(seed), 6);
            let loads = state.loads.as_deref().expect("loads");
            let described = State { tree: loads.tree.clone(), ..State::arm(loads.joints.clone(), Point3::origin()) };
            let readings = [0.3, -0.4, 0.5, 0.1, -0.7, 0.2];
            let moved = |joint: usize, step: f64| {
                let mut moved = readings;
                moved[joint] += step;
                moved
            };
            for load in Load::ALL {
                let mass = loads.mass(load);
                let height =
                    |readings: &[f64]| loads.up.dot(&(described.links(readings)[mass.link] * mass.place).coords);
                for j in 0..6 {
                    let fall = -GRAVITY * (height(&moved(j, 1e-5)) - height(&moved(j, -1e-5))) / 2e-5;
                    let expected = if loads.bears(j, load) { fall } else { 0.0 };
                    assert!((loads.torques(&readings)[j][load as usize] - expected).abs() < 1e-7);
                    for i in 0..6 {
                        let torque = |step: f64| loads.torques(&moved(j, step))[i][load as usize];
                        let difference = (torque(1e-5) - torque(-1e-5)) / 2e-5;
                        assert!((loads.slopes(load, &readings)[(i, j)] - difference).abs() < 1e-6);
                    }
                }
            }
        }
    }

    #[test]
    fn the_elbow_is_the_middle_joint_that_turns() {
        let turning = revolute([0.0; 3], Vector3::x());
        let sliding = Joint::Prismatic(Vector3::z_axis());
        let kinds = |kinds: &str| -> Vec<Joint> {
            kinds.chars().map(|kind| if kind == 'r' { turning } else { sliding }).collect()
        };
        for (joints, elbow) in
            [("rrrrrr", Some(2)), ("rrrrrrr", Some(3)), ("prrr", Some(2)), ("r", Some(0)), ("pp", None)]
        {
            assert_eq!(middle(&kinds(joints), |_| true), elbow, "{joints}");
        }
    }

    /// The joints of a neck, which come between those of the arm, bear neither load; nor does the elbow's mass hang on them.
    #[test]
    fn the_elbow_of_a_tree_is_on_the_way_to_the_hand() {
        let at = |x: f64| revolute([x, 0.0, 0.0], Vector3::y());
        // Joints 1 and 2 are a neck.
        let joints = vec![at(0.0), at(-1.0), at(-2.0), at(0.3), at(0.5)];
        let parents = vec![None, Some(0), Some(1), Some(0), Some(3)];
        let state = State::branching(joints, parents, (5, Point3::new(0.7, 0.0, 0.0))).expect("a tree");
        let loads = state.loads_under(Vector3::z_axis(), None);
        assert_eq!((loads.mass(Load::Elbow).link, loads.mass(Load::Elbow).place.x), (1, 0.3));
        let torques = loads.torques(&[0.0; 5]);
        let expected = [[0.7, 0.3], [0.0, 0.0], [0.0, 0.0], [0.4, 0.0], [0.2, 0.0]];
        for (found, expected) in torques.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected * GRAVITY).abs() < 1e-12, "{torques:?}");
        }
        assert_eq!(loads.elbow(), Some(3));
    }
}
