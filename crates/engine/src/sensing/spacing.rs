//! The distance between two sockets: `y = ‖s − s′‖ + v`, one equation, which is known before any movement. Where
//! nothing else measures a length, it alone tells how large the robot is.

use super::{Channel, Occasion, Part, Subject};
use crate::model::{Block, KinematicData, Links};

/// The distance between two sockets, metres, such as that of a tool measured once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The indices of the two sockets.
    pub sockets: [usize; 2],
}

impl Spacing {
    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> super::Sensor {
        use rand::RngExt;
        super::Sensor::even(Self { sockets: [0, state.sockets.len() - 1] }, rng.random_range(0.001..0.1))
    }
}

impl Channel for Spacing {
    fn subject(&self) -> Subject {
        Subject { occasion: Occasion::Beforehand, parts: vec![Part::Norm], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let [one, other] = self.sockets.map(|socket| links.state().sockets[socket]);
        reading[0] = (one - other).norm();
        reading[0] > 0.0
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let [one, other] = self.sockets.map(|socket| data.state().sockets[socket]);
        let apart = one - other;
        reading[0] = apart.norm();
        // Of two sockets at one place every direction leads away.
        if reading[0] <= 0.0 {
            return false;
        }
        for (socket, sign) in self.sockets.into_iter().zip([1.0, -1.0]) {
            let place = data.layout().block(Block::Socket(socket));
            place.into_iter().flatten().zip(&apart).for_each(|(coordinate, apart)| rows[coordinate] = sign * apart);
        }
        true
    }
}
