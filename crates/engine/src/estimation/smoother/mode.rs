//! The search for the posterior's modes.

use fearless_simd::Level;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt};

use super::{
    factor::Factor,
    normal::{Buffers, Normal},
    posterior::Posterior,
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
    /// −∂E/∂δ at the minimum, the negative gradient, which is next to nothing.
    #[serde(with = "crate::as_numbers")]
    pub negative_gradient: DVector<f64>,
    factor: Factor,
    /// −E − ½ ln det Λ: the logarithm of its share of the evidence, up to a constant that all modes share.
    pub log_evidence: f64,
    /// Its share of the evidence, once that is computed.
    pub weight: f64,
}

/// Why a search found no mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum NoMode {
    /// The equations are singular, or there are none: some direction is left open, or an entry is not finite.
    Singular,
    /// The search left the range of numbers.
    Diverged,
    /// The cost would have been too high even at the end of the search.
    Hopeless,
    /// The search led to a mode that is known.
    Known,
    /// The search began outside the chart of marginalised measurements.
    OutsideChart,
}

impl NoMode {
    /// Why there is no mode, for a message.
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

/// The stopping criteria of a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoppingCriteria<'a> {
    /// The most steps, accepted or not.
    pub steps: usize,
    /// The search has converged when a step promises to lower the cost by less than this.
    pub tolerance: f64,
    /// The search finds nothing new when the next step leads to one of these modes.
    pub known: &'a [Mode],
    /// The search is given up when the cost would stay above this even if a [few](FEW) more steps, or as many as are left, each
    /// lowered it by as much as the next one promises.
    pub hopeless: f64,
}

/// The number of steps for which the next step's promise is trusted: steps that lead down to where the measurements are
/// explained promise a large part of what is to be gained, and those along a valley that does not explain them hardly anything.
const FEW: usize = 3;

/// The widths of the loss through which a search goes that begins far from its end, from least squares to the loss
/// itself.
const WIDTHS: [f64; 2] = [10.0, 3.0];
/// The number of steps at each of these widths.
const STEPS_AT_WIDTH: usize = 8;

/// The largest step: a turn of this many radians or a shift of this many metres; a third of it for numbers without a
/// unit, and three hundred times it for pixels.
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

/// How often a search goes on from where it was taken along what no measurement tells.
const CENTRED: usize = 3;

impl Posterior {
    /// The local minimum that Levenberg–Marquardt reaches from `start`, and the Gaussian there.
    ///
    /// Steps solve `(Λ + λ diag Λ) δ = −∇cost`; λ follows the ratio of found to predicted descent (Nielsen's rule).
    pub fn mode(&self, start: &State, layout: &Layout, effort: StoppingCriteria<'_>) -> Result<Mode, NoMode> {
        let (mut state, mut normal) = self.descend(self.loss.into(), start, layout, effort)?;
        let symmetries = self.symmetries(&state, layout);
        for _ in 0..if symmetries.is_empty() { 0 } else { CENTRED } {
            let before = normal.cost;
            (state, normal) =
                self.descend(self.loss.into(), &self.centred(state, &symmetries, layout), layout, effort)?;
            if before - normal.cost < effort.tolerance {
                break;
            }
        }
        Mode::at(self.level, state, normal)
    }

    /// The local minimum reached from a start that may be far from it: a robust loss narrows on the way.
    pub fn mode_from_afar(&self, start: &State, layout: &Layout, effort: StoppingCriteria<'_>) -> Result<Mode, NoMode> {
        if !self.loss.is_robust() {
            return self.mode(start, layout, effort);
        }
        let tolerance = effort.tolerance * 1e2;
        let coarse = StoppingCriteria { steps: STEPS_AT_WIDTH, tolerance, hopeless: f64::INFINITY, known: &[] };
        let first = StoppingCriteria { steps: effort.steps, ..coarse };
        let (mut state, _) = self.descend(self.least_squares(start), start, layout, first)?;
        for width in WIDTHS {
            state = self.descend(Graduated { loss: self.loss, width }, &state, layout, coarse)?.0;
        }
        self.mode(&state, layout, effort)
    }

    /// This posterior without one to three of the measurements.
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
        effort: StoppingCriteria<'_>,
    ) -> Result<Mode, NoMode> {
        // By least squares what is still no outlier may cost much.
        let patient = StoppingCriteria { hopeless: effort.hopeless * 10.0 + 1e3, known: &[], ..effort };
        let (state, _) = others.descend(others.least_squares(start), start, layout, patient)?;
        self.mode(&state, layout, effort)
    }

    /// Descends from `start`, bounded by the steps of the effort whatever the numbers, and returns where that ends with the equations
    /// there.
    fn descend(
        &self,
        loss: Graduated,
        start: &State,
        layout: &Layout,
        effort: StoppingCriteria<'_>,
    ) -> Result<(State, Normal), NoMode> {
        let mut state = start.slid_towards(&self.pins);
        let (mut buffers, mut kept) = (Buffers::default(), None);
        let mut normal = self.normal_by(loss, &state, layout, &mut buffers).ok_or(NoMode::OutsideChart)?;
        let (mut lambda, mut growth) = (1e-3, 2.0);
        for step in 0..effort.steps {
            let factor = match kept.take() {
                None => Factor::new(self.level, &normal.information, lambda),
                Some(before) => Factor::anew(before, &normal.information, lambda),
            };
            let factor = factor.ok_or(NoMode::Singular)?;
            let mut delta = kept.insert(factor).solve(&normal.negative_gradient);
            // With D = diag Λ, Λ δ = −∇cost − λ D δ; of a shortened step δ/l accordingly.
            let slope = delta.dot(&normal.negative_gradient);
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
            // Hardly any step is refused, so that what it costs is not asked beforehand. Outside the chart of marginalised measurements
            // none is taken.
            let found = self.normal_by(loss, &next, layout, &mut buffers);
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
                buffers.put_back(if is_better { std::mem::replace(&mut normal, found) } else { found });
            }
            if is_better && self.joints.is_some() {
                // Readings are whitened by where it stands now.
                buffers.joints = None;
                let found = self.normal_by(loss, &state, layout, &mut buffers).ok_or(NoMode::OutsideChart)?;
                buffers.put_back(std::mem::replace(&mut normal, found));
            }
            if lambda > 1e12 {
                break;
            }
        }
        Ok((state, normal))
    }
}

/// The squared distance from a mode, in standard deviations, at which a step leads to it, if it promises the mode's cost
/// to within this.
const REACHED: f64 = 0.1;

impl Mode {
    /// Whether a step to `state`, where `cost` is promised, leads to this mode.
    fn is_reached(&self, layout: &Layout, state: &State, cost: f64) -> bool {
        (cost - self.cost).abs() < REACHED && self.distance(layout, state).is_some_and(|squared| squared < REACHED)
    }

    /// The squared distance of `state` from this mode, in standard deviations; `None` outside its chart.
    pub fn distance(&self, layout: &Layout, state: &State) -> Option<f64> {
        let delta = self.state.local(layout, state)?;
        Some(delta.dot(&(&self.information * &delta)))
    }

    /// The Gaussian at the end of a search with these equations, if they are positive definite.
    pub fn at(level: Level, state: State, normal: Normal) -> Result<Self, NoMode> {
        let Normal { cost, mut information, negative_gradient } = normal;
        information.fill_upper_triangle_with_lower_triangle();
        let factor = Factor::new(level, &information, 0.0).ok_or(NoMode::Singular)?;
        let log_evidence = -cost - 0.5 * factor.log_determinant();
        if !log_evidence.is_finite() {
            return Err(NoMode::Diverged);
        }
        Ok(Self { state, cost, information, negative_gradient, factor, log_evidence, weight: 0.0 })
    }

    /// P, the inverse of the information.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }
}
