//! What may change on a robot, and how each change moves its parameters.

use body_schema_engine::{
    elementary::ln,
    kinematics::{JointKind, rotation},
    model::{Block, Layout, Names, Quantity, State},
};
use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Something that may change. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Suspect {
    /// The zero of a joint's reading: one number, rad or m.
    Zero(usize),
    /// The link that a joint carries, bent or mounted anew with all behind it: six numbers, a shift (m) and a turn (rad) about that
    /// joint, in the robot's frame at θ = 0.
    Link(usize),
    /// The base, or what it is measured from (a tripod): six numbers.
    Base,
    /// A target on its link: three numbers, or six.
    Target(usize),
    /// A camera or another device: six numbers.
    Device(usize),
    /// A place beside the robot: three numbers.
    Socket(usize),
    /// Something that none of the others explains, such as a tool of another length, a lost homing or another unit: no numbers.
    Unlike,
}

/// Prior standard deviations of changes. They are no thresholds: a change of another size is found a little later.
const ZERO_RAD: f64 = 0.0175;
const ZERO_M: f64 = 0.003;
const SHIFT_M: f64 = 0.004;
const TURN_RAD: f64 = 0.00875;
/// The base turns about a point that may be metres away.
const BASE_SHIFT_M: f64 = 0.01;

/// The share of each kind among changes, before anything was seen; where a kind has no member its share goes to the others.
const ZEROS: f64 = 0.55;
const LINKS: f64 = 0.15;
const BASE: f64 = 0.1;
const TARGETS: f64 = 0.1;
const DEVICES: f64 = 0.05;
const SOCKETS: f64 = 0.05;
const UNLIKE: f64 = 0.05;

/// The step of the derivative of a link's motion, m and rad.
const STEP: f64 = 1e-4;

impl Suspect {
    /// The suspect as the subject of a sentence.
    pub fn name(self, names: &Names) -> String {
        let joint = |joint: usize| names.joints.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1));
        match self {
            Self::Zero(index) => format!("the zero of {}", joint(index)),
            Self::Link(index) => format!("the link behind {}", joint(index)),
            Self::Base => "the base, or what it is measured from,".to_owned(),
            Self::Target(index) => names.block(Block::Target(index)),
            Self::Device(index) => names.block(Block::Device(index)),
            Self::Socket(index) => names.block(Block::Socket(index)),
            Self::Unlike => "something else".to_owned(),
        }
    }

    /// The joint whose zero or link it is.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Zero(joint) | Self::Link(joint) => Some(joint),
            _ => None,
        }
    }
}

/// A suspect with its prior and with how it moves the parameters.
#[derive(Clone, Debug)]
pub(crate) struct Change {
    pub suspect: Suspect,
    /// K (m × k): the tangent coordinates of the layout of everything, by the change's own.
    pub moves: DMatrix<f64>,
    /// s: prior standard deviations of the change's coordinates.
    pub deviations: DVector<f64>,
    /// The unit of each coordinate.
    pub units: Vec<Quantity>,
    /// ln π: the prior probability that it is this that changes.
    pub log_prior: f64,
}

/// The layout of everything that may change, with what is learned.
pub(crate) fn everything(state: &State, learned: &Layout) -> Layout {
    let joints = (0..state.joints.len()).flat_map(|joint| [Block::Axis(joint), Block::Offset(joint)]);
    let places = (0..state.targets.len()).map(Block::Target).chain((0..state.devices.len()).map(Block::Device));
    let sockets = (0..state.sockets.len()).map(Block::Socket);
    let learned = learned.blocks().map(|(block, _)| block);
    Layout::new(state, learned.chain([Block::Base]).chain(joints).chain(places).chain(sockets))
}

/// All that may change, with the prior probabilities.
pub(crate) fn changes(state: &State, all: &Layout) -> Vec<Change> {
    let joints = state.joints.len();
    let carries = |joint: usize| (0..joints).any(|other| state.tree.moves(joint, state.tree.link_before(other)));
    let kinds: [(f64, Vec<Suspect>); 7] = [
        (ZEROS, (0..joints).map(Suspect::Zero).collect()),
        // What moves with a last joint is a target's place, or a device's.
        (LINKS, (0..joints).filter(|joint| carries(*joint)).map(Suspect::Link).collect()),
        (BASE, vec![Suspect::Base]),
        (TARGETS, (0..state.targets.len()).map(Suspect::Target).collect()),
        (DEVICES, (0..state.devices.len()).map(Suspect::Device).collect()),
        (SOCKETS, (0..state.sockets.len()).map(Suspect::Socket).collect()),
        (UNLIKE, vec![Suspect::Unlike]),
    ];
    let total: f64 = kinds.iter().filter(|(_, members)| !members.is_empty()).map(|(share, _)| share).sum();
    let of_kind = |(share, members): (f64, Vec<Suspect>)| {
        let each = share / total / members.len() as f64;
        members.into_iter().filter_map(move |suspect| change(state, all, suspect, each))
    };
    kinds.into_iter().flat_map(of_kind).collect()
}

/// One change; `None` where its motion leaves the chart, which a step of a tenth of a millimetre never does.
fn change(state: &State, all: &Layout, suspect: Suspect, prior: f64) -> Option<Change> {
    let block = match suspect {
        Suspect::Zero(joint) => Block::Offset(joint),
        Suspect::Base => Block::Base,
        Suspect::Target(target) => Block::Target(target),
        Suspect::Device(device) => Block::Device(device),
        Suspect::Socket(socket) => Block::Socket(socket),
        Suspect::Link(joint) => return link(state, all, joint, prior),
        Suspect::Unlike => {
            let (moves, deviations) = (DMatrix::zeros(all.dimension(), 0), DVector::zeros(0));
            return Some(Change { suspect, moves, deviations, units: Vec::new(), log_prior: ln(prior) });
        }
    };
    let range = all.block(block)?;
    let units: Vec<Quantity> = all.quantities()[range.clone()].to_vec();
    let deviation = |unit: &Quantity| match (suspect, unit) {
        (Suspect::Zero(joint), _) if state.joints[joint].kind() == JointKind::Revolute => ZERO_RAD,
        (Suspect::Zero(_), _) => ZERO_M,
        (Suspect::Base, Quantity::Length) => BASE_SHIFT_M,
        (_, Quantity::Length) => SHIFT_M,
        _ => TURN_RAD,
    };
    let deviations = DVector::from_iterator(units.len(), units.iter().map(deviation));
    let moves = DMatrix::from_fn(all.dimension(), range.len(), |row, k| f64::from(u8::from(row == range.start + k)));
    Some(Change { suspect, moves, deviations, units, log_prior: ln(prior) })
}

fn link(state: &State, all: &Layout, joint: usize, prior: f64) -> Option<Change> {
    let behind = |link: usize| state.tree.moves(joint, link);
    let moved = |k: usize, step: f64| {
        let motion = rigid(state, joint, &DVector::from_fn(6, |row, _| if row == k { step } else { 0.0 }));
        state.local(all, &state.carried(&motion, behind))
    };
    let mut moves = DMatrix::zeros(all.dimension(), 6);
    for k in 0..6 {
        moves.set_column(k, &((moved(k, STEP)? - moved(k, -STEP)?) / (2.0 * STEP)));
    }
    let units = [[Quantity::Length; 3], [Quantity::Angle; 3]].concat();
    let deviations = DVector::from_fn(6, |k, _| if k < 3 { SHIFT_M } else { TURN_RAD });
    let suspect = Suspect::Link(joint);
    Some(Change { suspect, moves, deviations, units, log_prior: ln(prior) })
}

/// The motion of all that is behind a joint, in the robot's frame at θ = 0, by the six numbers of [`Suspect::Link`].
pub(crate) fn rigid(state: &State, joint: usize, twist: &DVector<f64>) -> Isometry3<f64> {
    let pivot = pivot(state, joint);
    let turn = rotation::exp(&UnitQuaternion::identity(), &Vector3::new(twist[3], twist[4], twist[5]));
    let about = Translation3::from(pivot.coords) * turn * Translation3::from(-pivot.coords);
    Translation3::new(twist[0], twist[1], twist[2]) * about
}

/// A point of the joint: on its axis, or on the next axis behind a joint that slides, or at a target behind it.
fn pivot(state: &State, joint: usize) -> Point3<f64> {
    let behind = |link: usize| state.tree.moves(joint, link);
    let own = state.joints[joint].line();
    let next = || {
        let joints = state.joints.iter().enumerate();
        joints.filter(|(other, _)| behind(state.tree.link_before(*other))).find_map(|(_, other)| other.line())
    };
    let target = || state.targets.iter().find(|target| behind(target.link)).map(|target| target.place.origin());
    own.or_else(next).map(|line| line.point).or_else(target).unwrap_or_else(Point3::origin)
}
