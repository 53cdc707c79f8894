//! All parameters of a robot and of what watches it, and its forward kinematics.

use std::{borrow::Cow, sync::Arc};

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3};

use super::{Block, Frame, Layout, Load, Loads};
use crate::{elementary::sin_cos, kinematics::Joint};

/// Everything that can be learned: joints from base to hand, and what is placed on links or beside the robot.
///
/// Axes, and places on links, are written where they are at θ = 0, in the frame of the nominal base; `base` carries that
/// into the frame of the measurements. Where axes are all free the two frames are taken to be one, and the base is known
/// to be the identity.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// Carries the robot's frame into that of the measurements.
    #[serde(with = "crate::as_numbers")]
    pub base: Isometry3<f64>,
    /// The joints in order, the one nearest the base first.
    pub joints: Vec<Joint>,
    /// By joint: what its readings are corrected by.
    pub corrections: Vec<Correction>,
    /// What joints that give way bear; without it none does. Not stored with the rest: it belongs to the robot.
    #[serde(skip)]
    pub loads: Option<Arc<Loads>>,
    /// What is looked at; the first is the marker.
    pub targets: Vec<Target>,
    /// What looks on: cameras, anchors of cables.
    pub devices: Vec<Device>,
    /// Places beside the robot, in the frame of the measurements, metres.
    #[serde(with = "crate::as_numbers")]
    pub sockets: Vec<Point3<f64>>,
    /// What the robot is asked to bring somewhere: the marker.
    pub hand: Hand,
}

/// What of a robot is its hand, so that predictions are of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Hand {
    /// The origin of a target.
    Target(usize),
    /// The origin of a device, as of a camera that the hand carries.
    Device(usize),
}

impl Hand {
    /// Its frame.
    pub fn frame(self) -> Frame {
        match self {
            Self::Target(target) => Frame::Target(target),
            Self::Device(device) => Frame::Device(device),
        }
    }

    /// Its block.
    pub fn block(self) -> Block {
        match self {
            Self::Target(target) => Block::Target(target),
            Self::Device(device) => Block::Device(device),
        }
    }
}

/// What makes a joint's position θ of its reading q:
/// `θ = offset + ratio q + sine sin q + cosine cos q + compliance·τ`, τ the torques of the [`Loads`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Correction {
    /// Rad or m.
    pub offset: f64,
    /// Without a unit.
    pub ratio: f64,
    /// Of an encoder that is mounted off its centre, rad.
    pub sine: f64,
    /// As `sine`.
    pub cosine: f64,
    /// By [`Load`], how much the joint gives way, rad per N·m of 1 kg.
    pub compliance: [f64; 2],
}

impl Default for Correction {
    fn default() -> Self {
        Self { offset: 0.0, ratio: 1.0, sine: 0.0, cosine: 0.0, compliance: [0.0; 2] }
    }
}

impl Correction {
    /// θ at a reading without load, rad or m.
    pub fn position(&self, reading: f64) -> f64 {
        let proportional = self.offset + self.ratio * reading;
        if self.sine == 0.0 && self.cosine == 0.0 {
            return proportional;
        }
        let (sin, cos) = sin_cos(reading);
        proportional + self.sine * sin + self.cosine * cos
    }

    /// What torques (by [`Load`], N·m per kg) add to that, rad.
    pub fn given_way(&self, torques: &[f64; 2]) -> f64 {
        self.compliance[0] * torques[0] + self.compliance[1] * torques[1]
    }

    /// ∂θ/∂q at a reading without load.
    pub fn slope(&self, reading: f64) -> f64 {
        let (sin, cos) = sin_cos(reading);
        self.ratio + self.sine * cos - self.cosine * sin
    }
}

/// The joints' positions at one posture.
#[derive(Clone, Debug)]
pub struct Thetas<'a> {
    corrections: &'a [Correction],
    readings: &'a [f64],
    /// Empty where no joint gives way.
    torques: Vec<[f64; 2]>,
}

impl Thetas<'_> {
    /// A joint's, rad or m.
    pub fn of(&self, joint: usize) -> f64 {
        let correction = &self.corrections[joint];
        let unloaded = correction.position(self.readings[joint]);
        self.torques.get(joint).map_or(unloaded, |torques| unloaded + correction.given_way(torques))
    }
}

/// Something fixed to a link.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Target {
    /// The link: 0 is the base, i what moves with the i-th joint.
    pub link: usize,
    /// Where it is at θ = 0.
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
    /// The point, or the body's origin, metres.
    pub fn origin(&self) -> Point3<f64> {
        match self {
            Self::Point(point) => *point,
            Self::Pose(pose) => Point3::from(pose.translation.vector),
        }
    }

    /// Its own frame; that of a point is not turned.
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
}

impl State {
    /// An arm with a marker on its last link, both in the frame of the measurements, metres.
    pub fn arm(joints: Vec<Joint>, marker: Point3<f64>) -> Self {
        let target = Target { link: joints.len(), place: Place::Point(marker) };
        Self {
            base: Isometry3::identity(),
            corrections: vec![Correction::default(); joints.len()],
            joints,
            loads: None,
            targets: vec![target],
            devices: Vec::new(),
            sockets: Vec::new(),
            hand: Hand::Target(0),
        }
    }

    /// Where a target is at readings `positions` (rad or m, one per joint), in the frame of the measurements, metres.
    pub fn target_at(&self, target: usize, positions: &[f64]) -> Point3<f64> {
        debug_assert_eq!(positions.len(), self.joints.len());
        let Target { link, place } = &self.targets[target];
        let thetas = self.thetas(positions);
        let moved =
            (0..*link).rev().fold(place.origin(), |point, index| self.joints[index].carry(thetas.of(index), &point));
        self.base * moved
    }

    /// Where a frame is at readings `positions` (rad or m, one per joint), in the frame of the measurements.
    pub fn frame_at(&self, frame: Frame, positions: &[f64]) -> Isometry3<f64> {
        let thetas = self.thetas(positions);
        let behind = |link: usize, place: Isometry3<f64>| {
            let moved = (0..link).rev().fold(place, |place, index| self.joints[index].exp(thetas.of(index)) * place);
            self.base * moved
        };
        match frame {
            Frame::Link(link) => behind(link, Isometry3::identity()),
            Frame::Target(target) => behind(self.targets[target].link, self.targets[target].place.frame()),
            Frame::Device(device) => {
                let device = &self.devices[device];
                device.link.map_or(device.pose, |link| behind(link, device.pose))
            }
        }
    }

    /// The marker, which is on the hand: `p = base e^{ξ₁θ₁} … e^{ξₙθₙ} p₀`.
    pub fn marker_at(&self, positions: &[f64]) -> Point3<f64> {
        match self.hand {
            Hand::Target(target) => self.target_at(target, positions),
            Hand::Device(_) => Point3::from(self.frame_at(self.hand.frame(), positions).translation.vector),
        }
    }

    /// The marker at θ = 0 in the robot's frame, p₀, metres.
    pub fn marker(&self) -> Point3<f64> {
        match self.hand {
            Hand::Target(target) => self.targets.get(target).map_or(Point3::origin(), |target| target.place.origin()),
            Hand::Device(device) => Point3::from(self.devices[device].pose.translation.vector),
        }
    }

    /// The same with the marker at another place, metres.
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

    /// The link that carries the hand; that of a device beside the robot is the base.
    pub fn hand_link(&self) -> usize {
        match self.hand {
            Hand::Target(target) => self.targets.get(target).map_or(0, |target| target.link),
            Hand::Device(device) => self.devices[device].link.unwrap_or(0),
        }
    }

    /// The joints' positions at readings `positions`, rad or m.
    pub fn thetas<'a>(&'a self, positions: &'a [f64]) -> Thetas<'a> {
        let torques = self.bending().map_or_else(Vec::new, |loads| loads.torques(positions));
        Thetas { corrections: &self.corrections, readings: positions, torques }
    }

    /// The loads, where a joint gives way to them.
    pub fn bending(&self) -> Option<&Loads> {
        let loads = self.loads.as_deref()?;
        let gives_way = |correction: &Correction| correction.compliance != [0.0; Load::ALL.len()];
        self.corrections.iter().any(gives_way).then_some(loads)
    }

    /// What the joints do to each link, `base e^{ξ₁θ₁} … e^{ξᵢθᵢ}` for i = 0 … n: the i-th carries what is fixed to
    /// link i from where it is at θ = 0 into the frame of the measurements.
    pub fn links(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let thetas = self.thetas(positions);
        let mut links = Vec::with_capacity(self.joints.len() + 1);
        links.push(self.base);
        for (index, joint) in self.joints.iter().enumerate() {
            links.push(links[index] * joint.exp(thetas.of(index)));
        }
        links
    }

    /// The skeleton at θ: the pivot of every revolute joint in order, then the marker, metres.
    ///
    /// A line has no distinguished point, so this is a drawing of the arm, not a property of its kinematics.
    pub fn skeleton(&self, positions: &[f64]) -> Vec<Point3<f64>> {
        let links = self.links(positions);
        let mut points: Vec<_> = self
            .joints
            .iter()
            .zip(&links)
            .filter_map(|(joint, link)| joint.line().map(|line| link * line.point))
            .collect();
        points.push(self.marker_at(positions));
        points
    }

    /// The same robot with its axes and places in the frame of the measurements, so that the base is the identity.
    pub fn measured(&self) -> Cow<'_, Self> {
        if self.base == Isometry3::identity() {
            return Cow::Borrowed(self);
        }
        let mut state = self.clone();
        state.base = Isometry3::identity();
        state.joints.iter_mut().for_each(|joint| *joint = joint.transformed(&self.base));
        for target in &mut state.targets {
            target.place = match &target.place {
                Place::Point(point) => Place::Point(self.base * point),
                Place::Pose(pose) => Place::Pose(self.base * pose),
            };
        }
        state.devices.iter_mut().filter(|device| device.link.is_some()).for_each(|device| {
            device.pose = self.base * device.pose;
        });
        Cow::Owned(state)
    }

    /// The same robot with the point of every axis slid to where it is nearest to the axis point of `reference`: the
    /// same kinematics, drawn comparably.
    pub fn slid_towards(&self, reference: &Self) -> Self {
        let mut state = self.clone();
        state.slide_towards(reference);
        state
    }

    /// The same in place.
    pub(crate) fn slide_towards(&mut self, reference: &Self) {
        for (joint, reference) in self.joints.iter_mut().zip(&reference.joints) {
            if let (Joint::Revolute(line), Some(other)) = (joint, reference.line()) {
                *line = line.slid(line.direction.dot(&(other.point - line.point)));
            }
        }
    }

    /// The state at tangent coordinates δ (see [`Layout`]) in the chart at `self`; what is not learned stays.
    pub fn retract(&self, layout: &Layout, delta: &DVector<f64>) -> Self {
        let mut state = self.clone();
        for (block, range) in layout.blocks() {
            let moved = block.of(self).retract(&delta.rows(range.start, range.len()));
            block.put(&mut state, moved);
        }
        state
    }

    /// The tangent coordinates of `other` in the chart at `self`, the inverse of [`retract`](Self::retract); `None`
    /// where a block of `other` lies outside the chart (directions of lines 90 deg or more apart).
    pub fn local(&self, layout: &Layout, other: &Self) -> Option<DVector<f64>> {
        let mut delta = DVector::zeros(layout.dimension());
        for (block, range) in layout.blocks() {
            delta.rows_mut(range.start, range.len()).copy_from(&block.of(self).local(&block.of(other))?);
        }
        Some(delta)
    }

    /// The derivative J (m × m, block diagonal) of the change of chart from `self` to `self.retract(δ)`, at δ.
    pub fn transport(&self, layout: &Layout, delta: &DVector<f64>) -> DMatrix<f64> {
        let mut transport = DMatrix::zeros(layout.dimension(), layout.dimension());
        for (block, range) in layout.blocks() {
            let (start, length) = (range.start, range.len());
            let of_block = block.of(self).transport(&delta.rows(start, length));
            transport.view_mut((start, start), (length, length)).copy_from(&of_block);
        }
        transport
    }

    /// The derivative (m × m, block diagonal) of the change of chart from `self` to `there`, by the coordinates at `there`:
    /// of `self.local(there.retract(ε))` at ε = 0, whatever pivots the axes of `there` are written with. `None` outside the
    /// chart.
    pub fn change_of_chart(&self, layout: &Layout, there: &Self) -> Option<DMatrix<f64>> {
        let mut change = DMatrix::zeros(layout.dimension(), layout.dimension());
        for (block, range) in layout.blocks() {
            let of_block = block.of(self).change_of_chart(&block.of(there))?;
            change.view_mut((range.start, range.start), (range.len(), range.len())).copy_from(&of_block);
        }
        Some(change)
    }
}
