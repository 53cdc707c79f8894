//! A target held in a socket: `0 = p(θ) − s + v`, three equations. A printed ball that is put back into its cup again and again
//! calibrates an arm of which nothing is measured but its joints. The noise is what play, and the noise of the joints, amount to at
//! the target.

use nalgebra::Vector3;

use super::{Channel, Occasion, Part, Subject};
use crate::model::{Block, KinematicData, Links};

/// The contact of a target with its socket, as far as play and the joints' readings allow. A reading is the target's position
/// relative to the socket, metres: 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Socket {
    /// The index of the target.
    pub target: usize,
    /// s, the index of the socket.
    pub socket: usize,
}

impl Socket {
    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> super::Sensor {
        use rand::RngExt;
        let target = rng.random_range(0..state.targets.len());
        let socket = rng.random_range(0..state.sockets.len());
        super::Sensor::even(Self { target, socket }, rng.random_range(0.001..0.1))
    }
}

impl Channel for Socket {
    fn subject(&self) -> Subject {
        let occasion = Occasion::Held { socket: self.socket, target: self.target };
        Subject { target: Some(self.target), occasion, parts: vec![Part::Lengths(3)], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        let away = links.target(self.target) - links.state().sockets[self.socket].coords;
        reading.copy_from_slice(away.as_slice());
        true
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let m = rows.len() / 3;
        let mut put = |coordinate: usize, column: Vector3<f64>| {
            (0..3).for_each(|k| rows[k * m + coordinate] = column[k]);
        };
        let target = data.point_columns(self.target, &mut put);
        if let Some(place) = data.layout().block(Block::Socket(self.socket)) {
            place.enumerate().for_each(|(k, coordinate)| put(coordinate, -Vector3::ith(k, 1.0)));
        }
        reading.copy_from_slice((target - data.state().sockets[self.socket].coords).as_slice());
        true
    }
}
