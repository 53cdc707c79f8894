//! What all learners of a run are drawn with.

use nalgebra::Isometry3;

use super::{arm::Drawing, links::Links, posture::ArmLook, stage::Stage};
use body_schema_engine::model::State;
use body_schema_wire::Description;

/// The true arm: grey.
pub(super) const TRUE_ARM: ArmLook =
    ArmLook { links: [0x84, 0x88, 0x90, 255], pins: [0x5C, 0x60, 0x68, 255], girth: 1.0 };
/// The robot as described, beside one whose differences from it are enlarged: grey and slim.
pub(super) const DESCRIBED: ArmLook = ArmLook { girth: 0.5, ..TRUE_ARM };

/// The scenery that all learners share.
pub(super) struct Scenery<'a> {
    pub(super) description: &'a Description,
    pub(super) stage: &'a Stage,
    /// The true arm, where it is known.
    pub(super) truth: Option<&'a State>,
    /// The frames of its links at θ = 0.
    pub(super) true_frames: &'a [Isometry3<f64>],
    /// The shapes of the robot's links, if it has any.
    pub(super) links: Option<&'a Links>,
    /// The joint that has broken.
    pub(super) broken: Option<usize>,
    /// Length of the arrows at θ = 0.
    pub(super) arrow_m: f64,
    /// The number of postures drawn between two steps.
    pub(super) frames: u64,
    /// Whether the robot branches.
    pub(super) branches: bool,
}

impl Scenery<'_> {
    /// What arms are drawn with.
    pub(super) fn drawing(&self) -> Drawing<'_> {
        Drawing { links: self.links, reach_m: self.stage.figure.reach_m }
    }
}
