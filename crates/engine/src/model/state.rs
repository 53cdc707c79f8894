//! All parameters of a robot and of what watches it, and its forward kinematics.

use std::{borrow::Cow, sync::Arc};

use nalgebra::{Isometry3, Point3, Translation3, UnitVector3};

use super::{Distortion, Loads, Mass};
use crate::kinematics::{Correction, Joint, Tree, TreeError};

/// The state: everything that can be learned, from joints (base to hand) to what is placed on links or beside the robot.
///
/// Axes and places on links are written where they are at θ = 0, in the frame of the nominal base; `base` carries that
/// frame into the one of the measurements. Where all axes are free the two frames are taken to be one, and the base is
/// the identity.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// The pose of the robot's frame in the frame of the measurements.
    #[serde(with = "crate::as_numbers")]
    pub base: Isometry3<f64>,
    /// The joints in order, those nearer to the base first.
    pub joints: Vec<Joint>,
    /// Which joint carries which. In an arm each carries the next, which is stored as no parents at all.
    #[serde(rename = "parents", default)]
    pub tree: Tree,
    /// The correction of each joint's readings.
    pub corrections: Vec<Correction>,
    /// The loads on joints that give way; without it none gives way. Not stored with the rest: it belongs to the robot.
    #[serde(skip)]
    pub loads: Option<Arc<Loads>>,
    /// The targets that are measured; the first is the marker.
    pub targets: Vec<Target>,
    /// The devices that measure: cameras, anchors of cables.
    pub devices: Vec<Device>,
    /// Places beside the robot, in the frame of the measurements, metres.
    #[serde(with = "crate::as_numbers")]
    pub sockets: Vec<Point3<f64>>,
    /// The part of the robot whose place is asked for: usually the marker.
    pub hand: Hand,
    /// The part in whose frame that place is asked for, such as the camera of a robot that looks at its own hand; `None` for the
    /// frame of the measurements.
    #[serde(default)]
    pub seen_from: Option<Hand>,
}

/// A frame that parameters move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The frame of a link.
    Link(usize),
    /// The frame of a target.
    Target(usize),
    /// The frame of a device.
    Device(usize),
}

/// The hand: what predictions are about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Hand {
    /// The origin of a target.
    Target(usize),
    /// The origin of a device, such as a camera that the hand carries.
    Device(usize),
}

impl Hand {
    /// The hand's frame.
    pub fn frame(self) -> Frame {
        match self {
            Self::Target(target) => Frame::Target(target),
            Self::Device(device) => Frame::Device(device),
        }
    }
}

/// A target: something fixed to a link that can be measured.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Target {
    /// The link: 0 is the base, i what moves with the i-th joint.
    pub link: usize,
    /// Its place at θ = 0.
    pub place: Place,
}

/// A point or a rigid body.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Place {
    /// A point, metres.
    Point(#[serde(with = "crate::as_numbers")] Point3<f64>),
    /// A rigid body; its known points are written in its own frame.
    Pose(#[serde(with = "crate::as_numbers")] Isometry3<f64>),
}

impl Place {
    /// The point itself, or the body's origin, metres.
    pub fn origin(&self) -> Point3<f64> {
        match self {
            Self::Point(point) => *point,
            Self::Pose(pose) => Point3::from(pose.translation.vector),
        }
    }

    /// The target's own frame; a point's frame has no rotation.
    pub fn frame(&self) -> Isometry3<f64> {
        match self {
            Self::Point(point) => Translation3::from(point.coords).into(),
            Self::Pose(pose) => *pose,
        }
    }
}

/// A device that measures.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Device {
    /// The link that carries it; `None` for one that stands beside the robot, in the frame of the measurements.
    pub link: Option<usize>,
    /// Its frame, at θ = 0 if a link carries it.
    #[serde(with = "crate::as_numbers")]
    pub pose: Isometry3<f64>,
    /// Of a camera: focal lengths and principal point (fx, fy, cx, cy), pixels.
    pub intrinsics: Option<[f64; 4]>,
    /// Of a camera: the distortion of its lens; `None` for a pinhole.
    #[serde(default)]
    pub distortion: Option<Distortion>,
}

impl State {
    /// An arm with a marker on its last link, both in the frame of the measurements, metres.
    pub fn arm(joints: Vec<Joint>, marker: Point3<f64>) -> Self {
        let target = Target { link: joints.len(), place: Place::Point(marker) };
        Self {
            base: Isometry3::identity(),
            corrections: vec![Correction::default(); joints.len()],
            joints,
            tree: Tree::default(),
            loads: None,
            targets: vec![target],
            devices: Vec::new(),
            sockets: Vec::new(),
            hand: Hand::Target(0),
            seen_from: None,
        }
    }

    /// A robot whose joints branch, with a marker on one of its links, both in the frame of the measurements, metres. `parents` has
    /// for each joint the one that carries it, `None` for a joint on the base.
    ///
    /// # Errors
    ///
    /// [`TreeError`] if there is not one parent for each joint, a parent does not come before its child, or there is no such link.
    pub fn branching(
        joints: Vec<Joint>,
        parents: Vec<Option<usize>>,
        (link, marker): (usize, Point3<f64>),
    ) -> Result<Self, TreeError> {
        let count = joints.len();
        if parents.len() != count {
            return Err(TreeError::Count { joints: count, parents: parents.len() });
        }
        if link > count {
            return Err(TreeError::Link { link, joints: count });
        }
        let mut state = Self { tree: Tree::new(parents)?, ..Self::arm(joints, marker) };
        state.targets[0].link = link;
        Ok(state)
    }

    /// The marker at θ = 0 in the robot's frame, p₀, metres.
    pub fn marker(&self) -> Point3<f64> {
        match self.hand {
            Hand::Target(target) => self.targets.get(target).map_or(Point3::origin(), |target| target.place.origin()),
            Hand::Device(device) => Point3::from(self.devices[device].pose.translation.vector),
        }
    }

    /// This robot with its marker at another place, metres.
    pub fn with_marker(mut self, marker: Point3<f64>) -> Self {
        match self.hand {
            Hand::Device(device) => self.devices[device].pose.translation = marker.coords.into(),
            Hand::Target(target) => {
                if let Some(target) = self.targets.get_mut(target) {
                    target.place = match &target.place {
                        Place::Point(_) => Place::Point(marker),
                        Place::Pose(pose) => Place::Pose(Isometry3::from_parts(marker.coords.into(), pose.rotation)),
                    };
                }
            }
        }
        self
    }

    /// The link that carries the hand; the base for a device beside the robot.
    pub fn hand_link(&self) -> usize {
        self.link_of(self.hand.frame()).unwrap_or(0)
    }

    /// The link that carries a frame; `None` if it stands beside the robot or does not exist.
    pub fn link_of(&self, frame: Frame) -> Option<usize> {
        match frame {
            Frame::Link(link) => Some(link),
            Frame::Target(target) => Some(self.targets.get(target)?.link),
            Frame::Device(device) => self.devices.get(device)?.link,
        }
    }

    /// The loads of this robot as described: a mass at its hand, and one at the written pivot of the revolute joint `elbow`; of the
    /// middle revolute joint (the earlier of two) of those that bear the hand if none is named. `up` is upwards in the frame of its base.
    pub fn loads_under(&self, up: UnitVector3<f64>, elbow: Option<usize>) -> Loads {
        let hand = Mass { link: self.hand_link(), place: self.marker() };
        Loads::new((self.joints.clone(), self.tree.clone()), hand, up, elbow)
    }

    /// The loads, if any joint gives way to them.
    pub fn bending(&self) -> Option<&Loads> {
        let loads = self.loads.as_deref()?;
        let gives_way = |correction: &Correction| correction.compliance.iter().any(|by| *by != 0.0);
        self.corrections.iter().any(gives_way).then_some(loads)
    }

    /// This robot with its axes and places in the frame of the measurements, so that the base is the identity.
    pub fn measured(&self) -> Cow<'_, Self> {
        if self.base == Isometry3::identity() {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Self { base: Isometry3::identity(), ..self.carried(&self.base, |_| true) })
    }

    /// This robot with everything on some links moved by `motion` in its own frame, at θ = 0.
    pub fn carried(&self, motion: &Isometry3<f64>, is_moved: impl Fn(usize) -> bool) -> Self {
        let mut state = self.clone();
        for (index, joint) in
            state.joints.iter_mut().enumerate().filter(|(index, _)| is_moved(self.tree.link_before(*index)))
        {
            *joint = self.joints[index].transformed(motion);
        }
        for target in state.targets.iter_mut().filter(|target| is_moved(target.link)) {
            target.place = match &target.place {
                Place::Point(point) => Place::Point(motion * point),
                Place::Pose(pose) => Place::Pose(motion * pose),
            };
        }
        for device in state.devices.iter_mut().filter(|device| device.link.is_some_and(&is_moved)) {
            device.pose = motion * device.pose;
        }
        state
    }

    /// This robot with the point of every axis slid to where it is nearest to the axis point of `reference`: the
    /// kinematics are unchanged, and drawings are comparable.
    pub fn slid_towards(&self, reference: &Self) -> Self {
        let mut state = self.clone();
        state.slide_towards(reference);
        state
    }

    /// Slides the points of this robot's axes in place, as [`slid_towards`](Self::slid_towards) does.
    pub(crate) fn slide_towards(&mut self, reference: &Self) {
        for (joint, reference) in self.joints.iter_mut().zip(&reference.joints) {
            if let (Joint::Revolute(line), Some(other)) = (joint, reference.line()) {
                *line = line.slid_towards(&other.point);
            }
        }
    }
}
