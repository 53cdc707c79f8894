//! The law that every channel keeps, as a check for channels of your own.

use nalgebra::DVector;

use super::Channel;
use crate::model::{KinematicData, Layout, Links, State};

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
    #[error("`rows` predicts a reading that is {residual} from that of `extended`, in an equation; they must be equal")]
    Prediction {
        /// The largest of the numbers that `difference` writes for the two.
        residual: f64,
    },
    /// `subject` says that the reading is where the target is, and it is not.
    #[error(
        "`subject` says that the reading is the position of target {target}, but the target is {away_m} m away from it"
    )]
    Position {
        /// The target.
        target: usize,
        /// The distance between the two, metres.
        away_m: f64,
    },
    /// `subject` and `clearance` disagree on whether there is a view.
    #[error(
        "`has_view` of `subject` is {has_view}, but `clearance` says otherwise; it is true where `clearance` returns a number"
    )]
    View {
        /// What `subject` says.
        has_view: bool,
    },
    /// `add` does not undo `difference`.
    #[error(
        "equation {equation}: `add` went {wanted} from the prediction, `difference` finds {found}; (h ⊕ v) ⊖ h must be v"
    )]
    Sum {
        /// The equation, counted from 0.
        equation: usize,
        /// The number that `difference` writes.
        found: f64,
        /// The number that was added.
        wanted: f64,
    },
    /// `rows` wrote numbers other than zero where there is no prediction.
    #[error("there is no prediction, but `rows` has written rows; leave them zero")]
    Left,
    /// A row is not the derivative of the reading. Both numbers are those of ∂h/∂δ.
    #[error(
        "equation {equation}, coordinate {coordinate}: `rows` has written {found}, the central difference of `extended` is {wanted}; \
         rows are ∂h/∂δ in the units of the reading (of a norm y, y ∂y/∂δ), not divided by any noise"
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
/// How far a row may be off, beside the largest, or beside 1, if none is larger.
const TOLERANCE: f64 = 1e-5;
/// How far two readings that are equal may be apart, beside the largest number of a reading, or beside 1.
const SAME: f64 = 1e-8;

/// Checks that a channel keeps the law of channels at a state and `positions` (rad or m per joint): that its rows are the
/// derivative of its prediction, `∂h/∂δ` (of a [norm](super::Part::Norm) y, `y ∂y/∂δ`), in all coordinates of `layout`, that all its ways to predict agree, that ⊕ undoes ⊖, and
/// that it measures what it [says](Channel::subject). No noise is needed.
///
/// Numbers are compared in the reading's own units: differences of 1e-8 are rounding, and rows may be off by 1e-5, both beside the
/// largest number of the reading and of the rows, or beside 1, where those are smaller. Of a reading whose numbers are far below 1,
/// the law is therefore loose: take another unit for it.
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
/// let laser = Distance { target: 0, to: Point3::new(1.0, 1.0, 0.0) };
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
    let subject = channel.subject();
    let (d, m) = (subject.equations(), layout.dimension());
    let links = Links::of(state, positions);
    if channel.clearance(&links).is_some() != subject.has_view {
        return Err(ChannelFault::View { has_view: subject.has_view });
    }
    let (mut reading, mut rows) = (vec![0.0; d], vec![0.0; d * m]);
    let seen = channel.rows(KinematicData::new(state, layout).at(positions), &mut reading, &mut rows);
    let mut extended = vec![0.0; d];
    if channel.extended(&links, &mut extended) != seen {
        return Err(ChannelFault::Seen);
    }
    let mut strict = vec![0.0; d];
    if channel.predict(&links, &mut strict) {
        let is_partial = subject.least_points.is_some();
        let mut pairs = strict.iter().zip(&extended).enumerate();
        let differs = |(_, (predicted, extended)): &(usize, (&f64, &f64))| {
            predicted != extended && !(is_partial && predicted.is_nan())
        };
        if let Some((equation, (predicted, extended))) = pairs.find(differs) {
            return Err(ChannelFault::Continuation { equation, predicted: *predicted, extended: *extended });
        }
    }
    if !seen {
        return if rows.iter().all(|row| *row == 0.0) { Ok(()) } else { Err(ChannelFault::Left) };
    }
    let same = SAME * largest(&extended).max(1.0);
    let mut residual = vec![0.0; d];
    channel.difference(&reading, &extended, &mut residual);
    if largest(&residual) >= same {
        return Err(ChannelFault::Prediction { residual: largest(&residual) });
    }
    if let Some((target, position)) = subject.position(&extended) {
        let away_m = (links.target(target) - position.coords).norm();
        if away_m >= same {
            return Err(ChannelFault::Position { target, away_m });
        }
    }
    subject.divide_norms(&reading, &mut rows);
    check_sum(channel, &extended, same)?;
    check_rows(channel, state, layout, positions, &rows)
}

/// Checks that (h ⊕ v) ⊖ h = v, of one small v.
fn check_sum(channel: &dyn Channel, h: &[f64], same: f64) -> Result<(), ChannelFault> {
    let v: Vec<f64> = (1..=h.len()).map(|k| if k % 2 == 0 { -0.01 } else { 0.01 } / k as f64).collect();
    let (mut y, mut found) = (h.to_vec(), vec![0.0; h.len()]);
    channel.add(&mut y, &v);
    channel.difference(&y, h, &mut found);
    let mut pairs = found.into_iter().zip(v).enumerate();
    let wrong = pairs.find(|(_, (found, wanted))| !found.is_finite() || (found - wanted).abs() >= same);
    wrong.map_or(Ok(()), |(equation, (found, wanted))| Err(ChannelFault::Sum { equation, found, wanted }))
}

/// Checks rows by central differences.
fn check_rows(
    channel: &dyn Channel,
    state: &State,
    layout: &Layout,
    positions: &[f64],
    rows: &[f64],
) -> Result<(), ChannelFault> {
    let m = layout.dimension();
    let d = rows.len() / m.max(1);
    let scale = rows.iter().fold(1.0, |scale: f64, row| scale.max(row.abs()));
    for coordinate in 0..m {
        let moved = |sign: f64| {
            let mut delta = DVector::zeros(m);
            delta[coordinate] = sign * STEP;
            let mut reading = vec![0.0; d];
            channel.extended(Links::new(&state.retract(layout, &delta)).at(positions), &mut reading);
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

/// The largest of the numbers, without their signs; infinite, if one is none.
fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, x| if x.is_finite() { most.max(x.abs()) } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::random::random_arm,
        sensing::{Distance, Part, Subject},
    };

    /// A distance with a fault.
    #[derive(Clone, Copy, Debug)]
    struct Faulty(Distance, usize);

    impl Channel for Faulty {
        fn subject(&self) -> Subject {
            let subject = self.0.subject();
            if self.1 == 7 { Subject { parts: vec![Part::Position], ..subject } } else { subject }
        }

        fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
            let seen = self.0.predict(links, reading);
            reading[0] += if self.1 == 1 { 1e-3 } else { 0.0 };
            seen
        }

        fn extended(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
            self.0.predict(links, reading) && self.1 != 2
        }

        fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
            let seen = self.0.rows(data, reading, rows);
            match self.1 {
                3 => reading[0] += 1e-3,
                4 => rows[2] *= 1.001,
                5 => rows[0] = f64::NAN,
                // Whitened.
                6 => rows.iter_mut().for_each(|row| *row /= 0.01),
                _ => {}
            }
            seen
        }

        fn add(&self, reading: &mut [f64], v: &[f64]) {
            reading[0] += if self.1 == 8 { -v[0] } else { v[0] };
        }

        fn clearance(&self, _: &Links<'_>) -> Option<f64> {
            (self.1 == 9).then_some(0.1)
        }
    }

    #[test]
    fn every_fault_is_named() {
        let state = random_arm(&mut ChaCha8Rng::seed_from_u64(1001), 3);
        let layout = Layout::of_arm(&state, &[], true);
        let distance = Distance { target: 0, to: Point3::new(3.0, 1.0, -2.0) };
        let found = |fault| check_channel(&Faulty(distance, fault), &state, &layout, &[0.3, -0.8, 1.1]);
        assert_eq!(found(0), Ok(()));
        assert!(matches!(found(1), Err(ChannelFault::Continuation { equation: 0, .. })));
        assert_eq!(found(2), Err(ChannelFault::Seen));
        assert!(matches!(found(3), Err(ChannelFault::Prediction { .. })));
        assert!(matches!(found(4), Err(ChannelFault::Row { equation: 0, coordinate: 2, .. })));
        assert!(matches!(found(5), Err(ChannelFault::Row { equation: 0, coordinate: 0, .. })));
        assert!(matches!(found(6), Err(ChannelFault::Row { .. })));
        assert!(matches!(found(7), Err(ChannelFault::Position { target: 0, .. })));
        assert!(matches!(found(8), Err(ChannelFault::Sum { equation: 0, .. })));
        assert_eq!(found(9), Err(ChannelFault::View { has_view: false }));
    }
}
