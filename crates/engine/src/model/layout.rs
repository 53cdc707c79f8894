//! Which parameters are learned, and where each stands in the tangent vector.

use std::ops::Range;

use super::{Block, Quantity, State};
use crate::kinematics::Term;

/// The order of the learned parameters in the tangent vector δ and in every covariance.
///
/// Blocks stand in the order of [`Block`]: base, axes, corrections of readings, targets, devices, intrinsics, distortions, sockets;
/// within a kind by index. A revolute joint's axis takes four places, first two for its point (metres, ⟂ w), then two
/// for its direction (radians); a prismatic joint's two, for its direction; a point three (metres), a pose six.
///
/// The paper writes six numbers per joint. A line has four degrees of freedom, so the other two move nothing that can
/// be measured: no data shrink their covariance, and ellipsoids and traces that contain them mislead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    entries: Vec<(Block, Range<usize>)>,
    /// The place of each joint's axis.
    axes: Vec<Option<Range<usize>>>,
    quantities: Vec<Quantity>,
    /// The block that places the hand, which is the marker's.
    hand: Block,
}

impl Layout {
    /// The layout of the blocks of `state` that `learned` names; those that the state does not have are left out.
    pub fn new(state: &State, learned: impl IntoIterator<Item = Block>) -> Self {
        let mut blocks: Vec<Block> = learned.into_iter().filter(|block| block.is_in(state)).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let mut layout = Self {
            entries: Vec::new(),
            axes: vec![None; state.joints.len()],
            quantities: Vec::new(),
            hand: state.hand.block(),
        };
        for block in blocks {
            let start = layout.quantities.len();
            layout.quantities.extend(block.quantities(state));
            let range = start..layout.quantities.len();
            if let Block::Axis(joint) = block {
                layout.axes[joint] = Some(range.clone());
            }
            layout.entries.push((block, range));
        }
        layout
    }

    /// The axes of joints marked in `learned` (those beyond its end count as learned), and the marker if `learn_marker`.
    pub fn of_arm(state: &State, learned: &[bool], learn_marker: bool) -> Self {
        let is_learned = |joint: &usize| learned.get(*joint).copied().unwrap_or(true);
        let axes = (0..state.joints.len()).filter(is_learned).map(Block::Axis);
        Self::new(state, axes.chain(learn_marker.then_some(Block::Target(0))))
    }

    /// The learned corrections of each joint: the places of their coordinates, and what they multiply.
    pub(crate) fn corrections(&self) -> Vec<Vec<(usize, Term)>> {
        let mut corrections = vec![Vec::new(); self.joints()];
        for (block, range) in self.blocks() {
            let (joint, terms) = match block {
                Block::Offset(joint) => (joint, [Some(Term::Offset), None]),
                Block::Ratio(joint) => (joint, [Some(Term::Ratio), None]),
                Block::Eccentricity(joint) => (joint, [Some(Term::Sine), Some(Term::Cosine)]),
                Block::Compliance(joint, load) => (joint, [Some(Term::Torque(load as usize)), None]),
                _ => continue,
            };
            corrections[joint].extend(range.zip(terms.into_iter().flatten()));
        }
        corrections
    }

    /// Whether any joint's compliance is learned.
    pub(crate) fn has_compliance(&self) -> bool {
        self.entries.iter().any(|(block, _)| matches!(block, Block::Compliance(..)))
    }

    /// Number of learned parameters, m.
    pub fn dimension(&self) -> usize {
        self.quantities.len()
    }

    /// Number of joints of the robot, learned or not.
    pub fn joints(&self) -> usize {
        self.axes.len()
    }

    /// The learned blocks in order, and where each stands.
    pub fn blocks(&self) -> impl Iterator<Item = (Block, Range<usize>)> + '_ {
        self.entries.iter().cloned()
    }

    /// The place of a block, if it is learned.
    pub fn block(&self, block: Block) -> Option<Range<usize>> {
        self.entries.iter().find(|(known, _)| *known == block).map(|(_, range)| range.clone())
    }

    /// Whether the axis of joint `index` is learned.
    pub fn is_learned(&self, index: usize) -> bool {
        self.axes.get(index).is_some_and(Option::is_some)
    }

    /// The place of joint `index`'s point, two coordinates; for learned revolute joints only.
    pub fn point(&self, index: usize) -> Option<Range<usize>> {
        let range = self.axes.get(index)?.as_ref()?;
        (range.len() == 4).then(|| range.start..range.start + 2)
    }

    /// The place of joint `index`'s direction, two coordinates; for learned joints only.
    pub fn direction(&self, index: usize) -> Option<Range<usize>> {
        let range = self.axes.get(index)?.as_ref()?;
        Some(range.end - 2..range.end)
    }

    /// The place of the marker on the hand, three coordinates of its origin, if it is learned.
    pub fn marker(&self) -> Option<Range<usize>> {
        self.block(self.hand).map(|range| range.start..range.start + 3)
    }

    /// What each tangent coordinate measures, in order.
    pub fn quantities(&self) -> &[Quantity] {
        &self.quantities
    }
}
