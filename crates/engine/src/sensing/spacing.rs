//! The distance between two sockets: `y = ‖s − s′‖ + v`, `v ~ N(0, σ²)`, one equation, which is known before any movement. Where
//! nothing else measures a length, it alone tells how large the robot is.

use std::sync::Arc;

use super::{Channel, Occasion};
use crate::model::{Block, Pass, State};

/// The distance between two sockets, metres, such as that of a tool measured once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The indices of the two sockets.
    pub sockets: [usize; 2],
    /// Standard deviation of the known distance, metres.
    pub sigma_m: f64,
}

impl Spacing {
    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Self {
        use rand::RngExt;
        Self { sockets: [0, state.sockets.len() - 1], sigma_m: rng.random_range(0.001..0.1) }
    }
}

impl Channel for Spacing {
    fn equations(&self) -> usize {
        1
    }

    fn sigma(&self) -> f64 {
        self.sigma_m
    }

    fn with_sigma(&self, sigma_m: f64) -> Arc<dyn Channel> {
        Arc::new(Self { sigma_m, ..*self })
    }

    fn predict(&self, state: &State, _: &[f64], reading: &mut [f64]) -> bool {
        let [one, other] = self.sockets.map(|socket| state.sockets[socket]);
        reading[0] = (one - other).norm();
        reading[0] > 0.0
    }

    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let [one, other] = self.sockets.map(|socket| pass.state().sockets[socket]);
        let apart = one - other;
        reading[0] = apart.norm();
        // Of two sockets at one place every direction leads away.
        if reading[0] <= 0.0 {
            return false;
        }
        let slope = apart / (reading[0] * self.sigma_m);
        for (socket, sign) in self.sockets.into_iter().zip([1.0, -1.0]) {
            let place = pass.layout().block(Block::Socket(socket));
            place.into_iter().flatten().zip(&slope).for_each(|(coordinate, slope)| rows[coordinate] = sign * slope);
        }
        true
    }

    fn occasion(&self) -> Occasion {
        Occasion::Beforehand
    }
}
