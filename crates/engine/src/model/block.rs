//! The parameters that belong together.

use nalgebra::DVector;

use super::{Element, Hand, Load, Place, State};
use crate::kinematics::JointKind;

/// A group of parameters of a [`State`] that is learned or held as a whole. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum Block {
    /// The pose of the base in the frame of the measurements.
    Base,
    /// The axis of a joint.
    Axis(usize),
    /// The offset of a joint's reading, rad or m.
    Offset(usize),
    /// The factor of a joint's reading.
    Ratio(usize),
    /// The eccentricity of a joint's encoder: the coefficients of sine and cosine of its reading, rad.
    Eccentricity(usize),
    /// The compliance of a joint to a load, rad per N·m of 1 kg; see [`Loads`](super::Loads).
    Compliance(usize, Load),
    /// The place of a target on its link.
    Target(usize),
    /// The pose of a device.
    Device(usize),
    /// Focal lengths and principal point of a camera.
    Intrinsics(usize),
    /// One coefficient of the distortion of a camera's lens, by its place in OpenCV's order; see
    /// [`Distortion`](super::Distortion).
    Distortion(usize, usize),
    /// A place beside the robot at which a target can be held.
    Socket(usize),
}

/// What one tangent coordinate measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Metres.
    Length,
    /// Radians.
    Angle,
    /// A number without a unit.
    Ratio,
    /// Radians per N·m with which gravity pulls at 1 kg.
    Compliance,
    /// Pixels.
    Pixels,
}

impl Block {
    /// Whether `state` has such a block.
    pub fn is_in(&self, state: &State) -> bool {
        match *self {
            Self::Base => true,
            Self::Axis(joint) | Self::Offset(joint) | Self::Ratio(joint) | Self::Eccentricity(joint) => {
                joint < state.joints.len()
            }
            Self::Compliance(joint, load) => {
                joint < state.joints.len() && state.loads.as_ref().is_some_and(|loads| loads.bears(joint, load))
            }
            Self::Target(target) => target < state.targets.len(),
            Self::Device(device) => device < state.devices.len(),
            Self::Intrinsics(device) => state.devices.get(device).is_some_and(|device| device.intrinsics.is_some()),
            Self::Distortion(device, index) => {
                let distortion = state.devices.get(device).and_then(|device| device.distortion.as_ref());
                distortion.is_some_and(|distortion| index < distortion.coefficients().len())
            }
            Self::Socket(socket) => socket < state.sockets.len(),
        }
    }

    /// The block's value in a state that has it.
    pub fn of(&self, state: &State) -> Element {
        let numbers = |numbers: &[f64]| Element::Numbers(DVector::from_column_slice(numbers));
        match *self {
            Self::Base => Element::Pose(state.base),
            Self::Axis(joint) => Element::Axis(state.joints[joint]),
            Self::Offset(joint) => numbers(&[state.corrections[joint].offset]),
            Self::Ratio(joint) => numbers(&[state.corrections[joint].ratio]),
            Self::Eccentricity(joint) => numbers(&[state.corrections[joint].sine, state.corrections[joint].cosine]),
            Self::Compliance(joint, load) => numbers(&[state.corrections[joint].compliance[load as usize]]),
            Self::Target(target) => match &state.targets[target].place {
                Place::Point(point) => Element::Point(*point),
                Place::Pose(pose) => Element::Pose(*pose),
            },
            Self::Device(device) => Element::Pose(state.devices[device].pose),
            Self::Intrinsics(device) => numbers(&state.devices[device].intrinsics.unwrap_or_default()),
            Self::Distortion(device, index) => {
                let coefficients = state.devices[device].distortion.as_ref().map(|of| of.coefficients()[index]);
                numbers(&[coefficients.unwrap_or_default()])
            }
            Self::Socket(socket) => Element::Point(state.sockets[socket]),
        }
    }

    /// Gives the block another value of the same kind.
    pub fn put(&self, state: &mut State, element: Element) {
        match (*self, element) {
            (Self::Base, Element::Pose(pose)) => state.base = pose,
            (Self::Axis(joint), Element::Axis(axis)) => state.joints[joint] = axis,
            (Self::Offset(joint), Element::Numbers(numbers)) => state.corrections[joint].offset = numbers[0],
            (Self::Ratio(joint), Element::Numbers(numbers)) => state.corrections[joint].ratio = numbers[0],
            (Self::Eccentricity(joint), Element::Numbers(numbers)) => {
                (state.corrections[joint].sine, state.corrections[joint].cosine) = (numbers[0], numbers[1]);
            }
            (Self::Compliance(joint, load), Element::Numbers(numbers)) => {
                state.corrections[joint].compliance[load as usize] = numbers[0];
            }
            (Self::Target(target), Element::Point(point)) => state.targets[target].place = Place::Point(point),
            (Self::Target(target), Element::Pose(pose)) => state.targets[target].place = Place::Pose(pose),
            (Self::Device(device), Element::Pose(pose)) => state.devices[device].pose = pose,
            (Self::Intrinsics(device), Element::Numbers(n)) => {
                state.devices[device].intrinsics = Some([n[0], n[1], n[2], n[3]]);
            }
            (Self::Distortion(device, index), Element::Numbers(numbers)) => {
                let device = &mut state.devices[device];
                device.distortion = device.distortion.map(|of| of.with(index, numbers[0]));
            }
            (Self::Socket(socket), Element::Point(point)) => state.sockets[socket] = point,
            (block, element) => debug_assert!(false, "{block:?} is no {element:?}"),
        }
    }

    /// What each tangent coordinate of the block measures.
    pub fn quantities(&self, state: &State) -> Vec<Quantity> {
        use Quantity::{Angle, Compliance, Length, Pixels, Ratio};
        let turns = |joint: usize| state.joints[joint].kind() == JointKind::Revolute;
        match *self {
            Self::Axis(joint) if turns(joint) => vec![Length, Length, Angle, Angle],
            Self::Axis(_) => vec![Angle, Angle],
            Self::Offset(joint) => vec![if turns(joint) { Angle } else { Length }],
            Self::Ratio(_) | Self::Distortion(..) => vec![Ratio],
            Self::Eccentricity(joint) => vec![if turns(joint) { Angle } else { Length }; 2],
            Self::Compliance(..) => vec![Compliance],
            Self::Target(target) if matches!(state.targets[target].place, Place::Point(_)) => vec![Length; 3],
            Self::Socket(_) => vec![Length; 3],
            Self::Intrinsics(_) => vec![Pixels; 4],
            Self::Base | Self::Target(_) | Self::Device(_) => vec![Length, Length, Length, Angle, Angle, Angle],
        }
    }
}

impl Hand {
    /// The hand's block.
    pub fn block(self) -> Block {
        match self {
            Self::Target(target) => Block::Target(target),
            Self::Device(device) => Block::Device(device),
        }
    }
}
