//! What one part of a robot sees of another: a target in the frame of a camera or of a second target.
//!
//! With T = O⁻¹ X, O the pose of the observer and X that of the target in one and the same frame, a reading is the translation of T, and
//! its rotation vector where the pose is measured:
//!
//! ```text
//! y = t + v,     or   y = (t, ω) ⊕ v,     T = (exp([ω]×), t)
//! ```
//!
//! Its rows are the difference of the two frames' twists. A stereo camera or a tracker that is carried, the relative pose of two links,
//! and two parts that touch (a position of 0, 0, 0) are such readings.

use super::{Channel, Equipment, KeyError, Keys, Part, Pose, Subject};
use crate::model::{Frame, Hand, KinematicData, Links};

/// A target's position, or position and rotation, in the frame of a device or of another target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative {
    /// The index of the target.
    pub target: usize,
    /// The part in whose frame it is measured.
    pub seen_from: Hand,
    /// Whether its rotation is measured, too.
    pub has_rotation: bool,
}

impl Relative {
    /// What these keys say, if they name an observer.
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment, has_rotation: bool) -> Result<Option<Self>, KeyError> {
        let Some(seen_from) = keys.seen_from(equipment)? else { return Ok(None) };
        let target = keys.target(equipment)?.0;
        if seen_from == Hand::Target(target) {
            let what = "a target is always at the same place in its own frame";
            return Err(KeyError::new("in", what, "name another target, or a camera"));
        }
        Ok(Some(Self { target, seen_from, has_rotation }))
    }

    fn frames(&self) -> (Frame, Frame) {
        (Frame::Target(self.target), self.seen_from.frame())
    }

    /// Some target in the frame of another part.
    #[cfg(test)]
    pub(super) fn any(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State, has_rotation: bool) -> Self {
        use rand::RngExt;
        let is_body =
            |target: &usize| !has_rotation || matches!(state.targets[*target].place, crate::model::Place::Pose(_));
        let targets: Vec<usize> = (0..state.targets.len()).filter(is_body).collect();
        let target = targets[rng.random_range(0..targets.len())];
        let others = (0..state.targets.len()).filter(|other| *other != target).map(Hand::Target);
        let observers: Vec<Hand> = others.chain((0..state.devices.len()).map(Hand::Device)).collect();
        Self { target, seen_from: observers[rng.random_range(0..observers.len())], has_rotation }
    }
}

/// Writes T = O⁻¹ X of two frames, its translation and what the reading has room for of its rotation, and the rows of these.
pub(super) fn between(data: &KinematicData<'_>, (of, observer): (Frame, Frame), reading: &mut [f64], rows: &mut [f64]) {
    Pose::write(&(data.pose(observer).inverse() * data.pose(of)), reading);
    let twists = data.relative_twists(of, observer);
    for (row, columns) in rows.chunks_exact_mut(twists.ncols().max(1)).enumerate() {
        columns.iter_mut().zip(twists.row(row).iter()).for_each(|(to, x)| *to = *x);
    }
}

impl Channel for Relative {
    fn subject(&self) -> Subject {
        let parts = if self.has_rotation { vec![Part::Position, Part::Rotation] } else { vec![Part::Position] };
        Subject { target: Some(self.target), seen_from: Some(self.seen_from), parts, ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let (target, observer) = self.frames();
        Pose::write(&links.relative(target, observer), reading);
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        between(data, self.frames(), reading, rows);
        true
    }

    fn difference(&self, y: &[f64], h: &[f64], residual: &mut [f64]) {
        Pose::residual(y, h, residual);
    }

    fn add(&self, reading: &mut [f64], v: &[f64]) {
        Pose::add_to(reading, v);
    }
}
