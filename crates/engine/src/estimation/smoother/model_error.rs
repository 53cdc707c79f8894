//! The model error: what no parameter explains.
//!
//! Where the noise is not known, its nominal σ is what the sensor's maker promises. Residuals beyond that are no noise but errors of
//! the model: encoders off their centres, links that bend. They do not average away over movements as noise does, so they are counted
//! as a floor under every prediction,
//!
//! ```text
//! e² = Σₙ dₙ eₙ² / Σₙ dₙ,    eₙ² = 3 dₙ (sₙ² − 1 − 3 √(2/νₙ))₊ / tr(TₙᵀTₙ)
//! ```
//!
//! over the kinds of noise n, with sₙ the scale found, νₙ the equations to spare (three deviations of what chance alone does to sₙ² are
//! not counted), dₙ equations a reading, and Tₙ the whitened Jacobian of a reading by a shift of the robot: how many metres at the hand
//! make one σ.

use super::Smoother;
use crate::{
    model::{Block, KinematicData, Layout},
    sensing::{Noise, present},
};

/// The deviations of sₙ² that are attributed to chance.
const CHANCE: f64 = 3.0;
/// The number of latest movements at which metres are compared with σ.
const LOOKED_AT: usize = 8;

impl Smoother {
    /// e, metres; 0 where the noise is known, and while there are fewer equations than parameters, so that the model error cannot be told
    /// yet.
    pub(super) fn model_error_m(&self) -> f64 {
        let excess: Vec<f64> = (self.posterior.scales.iter().zip(&self.degrees_of_freedom).zip(&self.unknown))
            .map(|((scale, degrees_of_freedom), unknown)| {
                let by_chance = 1.0 + CHANCE * (2.0 / degrees_of_freedom).sqrt();
                if *unknown && *degrees_of_freedom > 0.0 { (scale * scale - by_chance).max(0.0) } else { 0.0 }
            })
            .collect();
        let (state, layout) = (&self.belief.state, &self.belief.layout);
        if excess.iter().all(|excess| *excess == 0.0)
            || self.posterior.equations(state, layout) < layout.dimension() as f64
        {
            return 0.0;
        }
        let (squares, equations) = self.shifts();
        let (mut sum, mut count) = (0.0, 0.0);
        for ((excess, square), d) in excess.iter().zip(&squares).zip(&equations) {
            // Rotations alone do not tell how far the hand is off.
            if *square > 0.0 {
                sum += 3.0 * d * d * excess / square;
                count += d;
            }
        }
        if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
    }

    /// tr(TᵀT) by kind of noise, as the mean over the latest readings, and d.
    fn shifts(&self) -> (Vec<f64>, Vec<f64>) {
        let state = &self.belief.state;
        let layout = Layout::new(state, [Block::Base]);
        let m = layout.dimension();
        let noises = self.nominal.noises();
        let (mut squares, mut counts) = (vec![0.0; noises.len()], vec![0.0_f64; noises.len()]);
        let mut equations = vec![0.0; noises.len()];
        let mut data = KinematicData::new(state, &layout);
        for seen in self.posterior.measurements.iter().rev().take(LOOKED_AT) {
            let d = seen.observation.numbers();
            let (mut rows, mut residual) = (vec![0.0; m * d], vec![0.0; d]);
            self.nominal.linearise_by_sensors(data.at(&seen.positions), &seen.observation, &mut rows, &mut residual);
            let mut at = 0;
            for (channel, reading) in seen.observation.readings.iter().enumerate() {
                let Some(reading) = reading else { continue };
                if residual[at..at + reading.len()].iter().any(|x| x.is_nan()) {
                    // There is no prediction of it.
                    at += reading.len();
                    continue;
                }
                for (index, noise) in noises.iter().enumerate().filter(|(_, noise)| noise.channel == channel) {
                    let place = at + noise.part.start..at + noise.part.end;
                    // The first three coordinates of a base are its shift.
                    squares[index] +=
                        place.map(|row| rows[row * m..row * m + 3].iter().map(|x| x * x).sum::<f64>()).sum::<f64>();
                    counts[index] += 1.0;
                    equations[index] += present(&reading[noise.part.clone()]) as f64;
                }
                at += reading.len();
            }
        }
        squares.iter_mut().zip(&counts).for_each(|(square, count)| *square /= count.max(1.0));
        let mean = |((equations, count), noise): ((f64, &f64), &Noise)| {
            if *count > 0.0 { equations / count } else { noise.part.len() as f64 }
        };
        (squares, equations.into_iter().zip(&counts).zip(noises).map(mean).collect())
    }
}
