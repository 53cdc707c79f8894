//! The distance between two targets: `y = ‖p(θ) − q(θ)‖ + v`, one equation. A bar of known length between two hands.

use super::{Channel, Part, Subject};
use crate::model::{Hand, KinematicData, Links};

/// The distance between the origins of two targets, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// The index of the target.
    pub target: usize,
    /// The index of the other.
    pub to: usize,
}

impl Channel for Separation {
    fn subject(&self) -> Subject {
        let seen_from = Some(Hand::Target(self.to));
        Subject { target: Some(self.target), seen_from, parts: vec![Part::Norm], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        reading[0] = (links.target(self.target) - links.target(self.to)).norm();
        reading[0] > 0.0
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let away = data.target(self.target) - data.target(self.to);
        reading[0] = away.norm();
        // Of two targets at one place every direction leads away.
        if reading[0] <= 0.0 {
            return false;
        }
        for (target, sign) in [(self.target, 1.0), (self.to, -1.0)] {
            data.point_columns(target, |coordinate, column| rows[coordinate] += sign * away.dot(&column));
        }
        true
    }
}
