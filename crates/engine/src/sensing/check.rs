//! The law that every channel keeps, as a check for channels of your own.

use nalgebra::DVector;

use super::Channel;
use crate::model::{Layout, Pass, State};

/// A part of the law that a channel violates.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChannelFault {
    /// `rows` and `extended` disagree on whether there is a prediction.
    #[error(
        "`rows` and `extended` do not agree on whether there is a prediction; both return false where there is none"
    )]
    Seen,
    /// `predict` and `extended` give different predictions.
    #[error(
        "equation {equation}: `predict` gives {predicted}, `extended` {extended}; where there is a prediction they are equal"
    )]
    Continuation {
        /// The equation, counted from 0.
        equation: usize,
        /// The value that `predict` gives.
        predicted: f64,
        /// The value that `extended` gives.
        extended: f64,
    },
    /// `rows` and `extended` write different readings.
    #[error("`rows` predicts a reading that is {sigmas} standard deviations from that of `extended`")]
    Prediction {
        /// Their difference, in standard deviations.
        sigmas: f64,
    },
    /// `rows` wrote numbers other than zero where there is no prediction.
    #[error("there is no prediction, but `rows` has written rows; leave them zero")]
    Left,
    /// A row is not the derivative of the whitened reading.
    #[error(
        "equation {equation}, coordinate {coordinate}: `rows` has written {found}, the central difference of `extended` is {wanted}; \
         rows are L⁻¹ ∂h/∂δ, whitened"
    )]
    Row {
        /// The equation, counted from 0.
        equation: usize,
        /// The coordinate's place in the tangent vector.
        coordinate: usize,
        /// The value that `rows` wrote.
        found: f64,
        /// The value that central differences give.
        wanted: f64,
    },
}

/// Half the length of a central difference, metres or radians.
const STEP: f64 = 1e-6;
/// How far a row may be off, beside the largest.
const TOLERANCE: f64 = 1e-5;

/// Checks that a channel keeps the law of channels at a state and `positions` (rad or m per joint): that its whitened rows are
/// the derivative of its whitened prediction, `L⁻¹ ∂h/∂δ`, in all coordinates of `layout`, and that all its ways to predict
/// agree.
///
/// ```
/// use body_schema_engine::{
///     kinematics::{Joint, Line},
///     model::{Layout, State},
///     sensing::{Distance, check_channel},
/// };
/// use nalgebra::{Point3, Vector3};
///
/// let axis = |x| Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction: Vector3::z_axis() });
/// let state = State::arm(vec![axis(0.0), axis(0.3)], Point3::new(0.5, 0.0, 0.1));
/// let layout = Layout::of_arm(&state, &[true, true], true);
/// let laser = Distance { target: 0, to: Point3::new(1.0, 1.0, 0.0), sigma_m: 0.001 };
/// assert_eq!(check_channel(&laser, &state, &layout, &[0.4, -0.7]), Ok(()));
/// ```
///
/// # Errors
///
/// [`ChannelFault`] of the first part of the law that does not hold, with its equation and coordinate.
pub fn check_channel(
    channel: &dyn Channel,
    state: &State,
    layout: &Layout,
    positions: &[f64],
) -> Result<(), ChannelFault> {
    let (d, m) = (channel.equations(), layout.dimension());
    let (mut reading, mut rows) = (vec![0.0; d], vec![0.0; d * m]);
    let seen = channel.rows(Pass::new(state, layout).at(positions), &mut reading, &mut rows);
    let mut extended = vec![0.0; d];
    if channel.extended(state, positions, &mut extended) != seen {
        return Err(ChannelFault::Seen);
    }
    let mut strict = vec![0.0; d];
    if channel.predict(state, positions, &mut strict) {
        let mut pairs = strict.iter().zip(&extended).enumerate();
        if let Some((equation, (predicted, extended))) = pairs.find(|(_, (predicted, extended))| predicted != extended)
        {
            return Err(ChannelFault::Continuation { equation, predicted: *predicted, extended: *extended });
        }
    }
    if !seen {
        return if rows.iter().all(|row| *row == 0.0) { Ok(()) } else { Err(ChannelFault::Left) };
    }
    let mut apart = vec![0.0; d];
    channel.difference(&reading, &extended, &mut apart);
    let sigmas = apart.iter().fold(0.0, |most: f64, x| if x.is_finite() { most.max(x.abs()) } else { f64::INFINITY });
    if sigmas >= 1e-8 / channel.sigma() {
        return Err(ChannelFault::Prediction { sigmas });
    }
    let scale = rows.iter().fold(1.0 / channel.sigma(), |scale: f64, row| scale.max(row.abs()));
    for coordinate in 0..m {
        let moved = |sign: f64| {
            let mut delta = DVector::zeros(m);
            delta[coordinate] = sign * STEP;
            let mut reading = vec![0.0; d];
            channel.extended(&state.retract(layout, &delta), positions, &mut reading);
            reading
        };
        let mut slopes = vec![0.0; d];
        channel.difference(&moved(1.0), &moved(-1.0), &mut slopes);
        for (equation, slope) in slopes.iter().enumerate() {
            let (found, wanted) = (rows[equation * m + coordinate], slope / (2.0 * STEP));
            let is_off = (found - wanted).abs() >= TOLERANCE * scale;
            if is_off || !found.is_finite() {
                return Err(ChannelFault::Row { equation, coordinate, found, wanted });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{model::random::random_arm, sensing::Distance};

    /// A distance with a fault.
    #[derive(Clone, Copy, Debug)]
    struct Faulty(Distance, usize);

    impl Channel for Faulty {
        fn equations(&self) -> usize {
            1
        }

        fn sigma(&self) -> f64 {
            self.0.sigma_m
        }

        fn with_sigma(&self, sigma_m: f64) -> Arc<dyn Channel> {
            Arc::new(Self(Distance { sigma_m, ..self.0 }, self.1))
        }

        fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
            let seen = self.0.predict(state, positions, reading);
            reading[0] += if self.1 == 1 { 1e-3 } else { 0.0 };
            seen
        }

        fn extended(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
            self.0.predict(state, positions, reading) && self.1 != 2
        }

        fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
            let seen = self.0.rows(pass, reading, rows);
            match self.1 {
                3 => reading[0] += 1e-3,
                4 => rows[2] *= 1.001,
                5 => rows[0] = f64::NAN,
                // Not whitened.
                6 => rows.iter_mut().for_each(|row| *row *= self.0.sigma_m),
                _ => {}
            }
            seen
        }
    }

    #[test]
    fn every_fault_is_named() {
        let state = random_arm(&mut ChaCha8Rng::seed_from_u64(1001), 3);
        let layout = Layout::of_arm(&state, &[], true);
        let distance = Distance { target: 0, to: Point3::new(3.0, 1.0, -2.0), sigma_m: 0.01 };
        let found = |fault| check_channel(&Faulty(distance, fault), &state, &layout, &[0.3, -0.8, 1.1]);
        assert_eq!(found(0), Ok(()));
        assert!(matches!(found(1), Err(ChannelFault::Continuation { equation: 0, .. })));
        assert_eq!(found(2), Err(ChannelFault::Seen));
        assert!(matches!(found(3), Err(ChannelFault::Prediction { .. })));
        assert!(matches!(found(4), Err(ChannelFault::Row { equation: 0, coordinate: 2, .. })));
        assert!(matches!(found(5), Err(ChannelFault::Row { equation: 0, coordinate: 0, .. })));
        assert!(matches!(found(6), Err(ChannelFault::Row { .. })));
    }
}
