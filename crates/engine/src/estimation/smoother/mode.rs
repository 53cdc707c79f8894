//! The search for the posterior's modes.

use fearless_simd::Level;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt};

use super::{
    factor::Factor,
    points::Buffers,
    posterior::{Normal, Posterior},
};
use crate::{
    model::{GRAVITY, Layout, Quantity, State},
    sensing::Graduated,
};

/// A local minimum of the posterior's cost, found by Levenberg–Marquardt, and the Gaussian there (Laplace).
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Mode {
    pub state: State,
    pub cost: f64,
    #[serde(with = "crate::as_numbers")]
    pub information: DMatrix<f64>,
    /// −∂E/∂δ there, which is next to nothing.
    #[serde(with = "crate::as_numbers")]
    pub descent: DVector<f64>,
    factor: Factor,
    /// −E − ½ ln det Λ: the logarithm of its share of the evidence, but for what all modes have in common.
    pub log_evidence: f64,
    /// Its share of the evidence, once that is told.
    pub weight: f64,
}

/// Why a search found no mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum NoMode {
    /// The equations are singular, or no equations at all: some direction is left open, or a number is none.
    Singular,
    /// The search left the range of numbers.
    Diverged,
    /// It would have cost too much even where it was bound for.
    Hopeless,
    /// It led to a mode that is known.
    Known,
    /// It began where measurements that have settled say nothing.
    OutsideChart,
}

impl NoMode {
    /// What is to be said where there is no other mode either.
    pub fn why(self) -> &'static str {
        match self {
            Self::Singular => "no hypothesis explains the measurements: their equations are singular",
            Self::Diverged => "no hypothesis explains the measurements: the search for one left the range of numbers",
            Self::Hopeless => "no hypothesis explains the measurements: every one costs too much",
            Self::Known => "no hypothesis explains the measurements but those that were given up",
            Self::OutsideChart => {
                "no hypothesis explains the measurements: the latest are too far from those that were compressed"
            }
        }
    }
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort<'a> {
    /// Steps at most, accepted or not.
    pub steps: usize,
    /// It has converged when a step promises to lower the cost by less than this.
    pub tolerance: f64,
    /// It finds nothing new when the next step leads to one of these.
    pub known: &'a [Mode],
    /// It is given up when the cost would stay above this even if a [few](FEW) steps more, or as many as are left, lowered it by as
    /// much as the next one promises.
    pub hopeless: f64,
}

/// Steps that lead down to where the measurements are explained promise a large part of what is to be gained, and those along a
/// valley that does not explain them hardly anything.
const FEW: usize = 3;

/// The widths of a loss through which a search goes that begins far from its end, from least squares to the loss itself.
const WIDTHS: [f64; 2] = [10.0, 3.0];
/// Steps at each of these.
const STEPS_AT_WIDTH: usize = 8;

/// The largest step: a turn of so many radians, a shift of as many metres; of numbers without a unit a third of that, and
/// of pixels three hundred times as many.
const LONGEST_STEP: f64 = 0.7;

/// The length of a step, in multiples of the longest of every quantity.
fn length(delta: &DVector<f64>, layout: &Layout) -> f64 {
    let longest = |quantity: &Quantity| match quantity {
        Quantity::Length | Quantity::Angle => LONGEST_STEP,
        Quantity::Ratio => LONGEST_STEP / 3.0,
        // At arm's length.
        Quantity::Compliance => LONGEST_STEP / GRAVITY,
        Quantity::Pixels => LONGEST_STEP * 300.0,
    };
    delta.iter().zip(layout.quantities()).map(|(x, quantity)| x.abs() / longest(quantity)).fold(0.0, f64::max)
}

impl Posterior {
    /// The local minimum that Levenberg–Marquardt reaches from `start`, and the Gaussian there.
    ///
    /// Steps solve `(Λ + λ diag Λ) δ = descent`; λ follows the ratio of found to predicted descent (Nielsen's rule).
    pub fn mode(&self, start: &State, layout: &Layout, effort: Effort<'_>) -> Result<Mode, NoMode> {
        let (state, normal) = self.descend(self.loss.into(), start, layout, effort)?;
        Mode::at(self.level, state, normal)
    }

    /// The same from a start that may be far from where the search ends: a robust loss narrows on the way.
    pub fn mode_from_afar(&self, start: &State, layout: &Layout, effort: Effort<'_>) -> Result<Mode, NoMode> {
        if !self.loss.is_robust() {
            return self.mode(start, layout, effort);
        }
        let tolerance = effort.tolerance * 1e2;
        let coarse = Effort { steps: STEPS_AT_WIDTH, tolerance, hopeless: f64::INFINITY, known: &[] };
        let first = Effort { steps: effort.steps, ..coarse };
        let (mut state, _) = self.descend(self.least_squares(start), start, layout, first)?;
        for width in WIDTHS {
            state = self.descend(Graduated { loss: self.loss, width }, &state, layout, coarse)?.0;
        }
        self.mode(&state, layout, effort)
    }

    /// The same posterior without one to three of the measurements.
    pub fn suspecting(&self, rng: &mut impl Rng) -> Self {
        let mut others = self.clone();
        for _ in 0..rng.random_range(1..=3).min(others.measurements.len()) {
            others.measurements.swap_remove(rng.random_range(0..others.measurements.len()));
        }
        others
    }

    /// The local minimum reached from where `others`, some of the measurements, are explained by least squares.
    pub fn mode_through(
        &self,
        others: &Self,
        start: &State,
        layout: &Layout,
        effort: Effort<'_>,
    ) -> Result<Mode, NoMode> {
        // By least squares what is still no outlier may cost much.
        let patient = Effort { hopeless: effort.hopeless * 10.0 + 1e3, known: &[], ..effort };
        let (state, _) = others.descend(others.least_squares(start), start, layout, patient)?;
        self.mode(&state, layout, effort)
    }

    /// Where steps end that lead down from `start`, and the equations there: bounded by the steps of the effort, whatever the numbers.
    fn descend(
        &self,
        loss: Graduated,
        start: &State,
        layout: &Layout,
        effort: Effort<'_>,
    ) -> Result<(State, Normal), NoMode> {
        let mut state = start.slid_towards(&self.pins);
        let (mut room, mut kept) = (Buffers::default(), None);
        let mut normal = self.normal_by(loss, &state, layout, &mut room).ok_or(NoMode::OutsideChart)?;
        let (mut lambda, mut growth) = (1e-3, 2.0);
        for step in 0..effort.steps {
            let factor = match kept.take() {
                None => Factor::new(self.level, &normal.information, lambda),
                Some(before) => Factor::anew(before, &normal.information, lambda),
            };
            let factor = factor.ok_or(NoMode::Singular)?;
            let mut delta = kept.insert(factor).solve(&normal.descent);
            // With D = diag Λ, Λ δ = descent − λ D δ; of a shortened step δ/l accordingly.
            let slope = delta.dot(&normal.descent);
            let damped = delta.iter().zip(normal.information.diagonal().iter()).map(|(x, d)| d * x * x).sum::<f64>();
            let length = length(&delta, layout).max(1.0);
            let predicted = slope / length - 0.5 * (slope - lambda * damped) / (length * length);
            if length > 1.0 {
                delta /= length;
            }
            let left = (effort.steps - step).min(FEW) as f64;
            let is_hopeless = normal.cost.is_finite() && normal.cost - left * predicted > effort.hopeless;
            if is_hopeless {
                return Err(NoMode::Hopeless);
            }
            if !predicted.is_finite() {
                return Err(NoMode::Diverged);
            }
            if predicted < effort.tolerance {
                break;
            }
            let mut next = state.retract(layout, &delta);
            next.slide_towards(&self.pins);
            if effort.known.iter().any(|mode| mode.is_reached(layout, &next, normal.cost - predicted)) {
                return Err(NoMode::Known);
            }
            // Hardly any step is refused, so that what it costs is not asked beforehand. Outside the chart of settled measurements
            // none is taken.
            let found = self.normal_by(loss, &next, layout, &mut room);
            let ratio = found.as_ref().map_or(f64::NEG_INFINITY, |found| (normal.cost - found.cost) / predicted);
            let is_better = ratio > 0.0;
            if is_better {
                state = next;
                lambda = (lambda * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0)).max(1e-9);
                growth = 2.0;
            } else {
                lambda *= growth;
                growth *= 2.0;
            }
            if let Some(found) = found {
                room.put_back(if is_better { std::mem::replace(&mut normal, found) } else { found });
            }
            if is_better && self.joints.is_some() {
                // Readings are whitened by where it stands now.
                room.joints = None;
                let found = self.normal_by(loss, &state, layout, &mut room).ok_or(NoMode::OutsideChart)?;
                room.put_back(std::mem::replace(&mut normal, found));
            }
            if lambda > 1e12 {
                break;
            }
        }
        Ok((state, normal))
    }
}

/// A step that leads so near to a mode (squared, in standard deviations), and promises its cost but for this, leads to it.
const REACHED: f64 = 0.1;

impl Mode {
    /// Whether a step to `state`, where `cost` is promised, leads to this mode.
    fn is_reached(&self, layout: &Layout, state: &State, cost: f64) -> bool {
        (cost - self.cost).abs() < REACHED && self.distance(layout, state).is_some_and(|squared| squared < REACHED)
    }

    /// How far `state` is from it, squared, in standard deviations; `None` outside its chart.
    pub fn distance(&self, layout: &Layout, state: &State) -> Option<f64> {
        let delta = self.state.local(layout, state)?;
        Some(delta.dot(&(&self.information * &delta)))
    }

    /// The Gaussian where a search has ended with these equations, unless they are not positive.
    pub fn at(level: Level, state: State, normal: Normal) -> Result<Self, NoMode> {
        let Normal { cost, mut information, descent } = normal;
        information.fill_upper_triangle_with_lower_triangle();
        let factor = Factor::new(level, &information, 0.0).ok_or(NoMode::Singular)?;
        let log_evidence = -cost - 0.5 * factor.log_determinant();
        if !log_evidence.is_finite() {
            return Err(NoMode::Diverged);
        }
        Ok(Self { state, cost, information, descent, factor, log_evidence, weight: 0.0 })
    }

    /// P, the inverse of the information.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }
}
