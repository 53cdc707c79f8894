//! Which parameters of a chain are learned, and where each stands in the tangent vector.

use std::ops::Range;

use super::{Joint, JointKind};

/// The order of a chain's learned parameters in the tangent vector δ and in every covariance.
///
/// Joints come in the order of the chain, known ones left out; then the marker, if it is learned. A revolute joint
/// takes four places, first two for its point (metres, ⟂ w), then two for its direction (radians); a prismatic joint
/// takes two, for its direction; the marker takes three (metres).
///
/// The paper writes six numbers per joint. A line has four degrees of freedom, so the other two move nothing that can
/// be measured: no data shrink their covariance, and ellipsoids and traces that contain them mislead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TangentLayout {
    slots: Vec<Option<Slot>>,
    marker: Option<usize>,
    dimension: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Slot {
    start: usize,
    kind: JointKind,
}

/// What one tangent coordinate measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Shift of an axis point ⟂ w, metres.
    Point,
    /// Turn of an axis direction, radians.
    Direction,
    /// Shift of the marker on the hand, metres.
    Marker,
}

impl TangentLayout {
    /// The layout of `joints`, of which those marked in `learned` are estimated, and the marker if `learn_marker`.
    /// Joints beyond the end of `learned` count as learned.
    pub fn new(joints: &[Joint], learned: &[bool], learn_marker: bool) -> Self {
        let mut dimension = 0;
        let mut take = |count: usize| {
            dimension += count;
            dimension - count
        };
        let slots = joints
            .iter()
            .enumerate()
            .map(|(index, joint)| {
                let is_learned = learned.get(index).copied().unwrap_or(true);
                is_learned.then(|| Slot { start: take(joint.degrees_of_freedom()), kind: joint.kind() })
            })
            .collect();
        let marker = learn_marker.then(|| take(3));
        Self { slots, marker, dimension }
    }

    /// Number of learned parameters, m.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of joints of the chain, learned or not.
    pub fn joints(&self) -> usize {
        self.slots.len()
    }

    /// Whether joint `index` is learned.
    pub fn is_learned(&self, index: usize) -> bool {
        self.slots.get(index).is_some_and(Option::is_some)
    }

    /// Where the point of joint `index` stands (a learned revolute joint only): two coordinates.
    pub fn point(&self, index: usize) -> Option<Range<usize>> {
        match (*self.slots.get(index)?)? {
            Slot { start, kind: JointKind::Revolute } => Some(start..start + 2),
            Slot { kind: JointKind::Prismatic, .. } => None,
        }
    }

    /// Where the direction of joint `index` stands (a learned joint only): two coordinates.
    pub fn direction(&self, index: usize) -> Option<Range<usize>> {
        let slot = (*self.slots.get(index)?)?;
        let start = match slot.kind {
            JointKind::Revolute => slot.start + 2,
            JointKind::Prismatic => slot.start,
        };
        Some(start..start + 2)
    }

    /// Where the marker stands, if it is learned: three coordinates.
    pub fn marker(&self) -> Option<Range<usize>> {
        self.marker.map(|start| start..start + 3)
    }

    /// What each tangent coordinate measures, in order.
    pub fn quantities(&self) -> Vec<Quantity> {
        let mut quantities = vec![Quantity::Marker; self.dimension];
        for index in 0..self.joints() {
            for (range, quantity) in
                [(self.point(index), Quantity::Point), (self.direction(index), Quantity::Direction)]
            {
                quantities[range.unwrap_or(0..0)].fill(quantity);
            }
        }
        quantities
    }
}
