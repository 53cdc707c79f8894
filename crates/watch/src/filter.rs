//! A Gaussian filter over what is common to all sightings, in blocks.

use std::{borrow::Cow, f64::consts::PI};

use body_schema_engine::elementary::{exp, ln, ln_1p};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::body::Linear;

/// ε: the share of sightings that are wild; and once something has changed that no suspect explains.
pub(crate) const WILD: f64 = 0.05;
pub(crate) const UNLIKE: f64 = 0.9;
/// The deviations of wild sightings as multiples of those of others: each has a quarter of ε.
const SPREADS: [f64; 4] = [5.0, 25.0, 125.0, 3125.0];
/// The weight below which a sighting changes nothing.
const NOTHING: f64 = 1e-3;

/// What a part of a filter's state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// δ: how far the estimate is off.
    Body,
    /// The drift with the covariate.
    Drift,
    /// A change, by its number among the body's.
    Change(usize),
    /// The error that all sightings at one posture share, by the posture's number.
    Shared(usize),
}

/// Mean and covariance of all parts.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    parts: Vec<(Part, usize)>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// A sighting as the filters hear it.
pub(crate) struct Heard<'a> {
    pub linear: &'a Linear,
    /// The posture's number, where sightings at it share an error.
    pub posture: Option<usize>,
    /// The variance of the noise that is not shared: 1, or less where a part of it is.
    pub noise: f64,
}

/// What a filter predicts of a sighting.
pub(crate) struct Predicted {
    /// e (d).
    pub innovation: DVector<f64>,
    /// The Cholesky factor of S.
    factor: Cholesky<f64, Dyn>,
    /// P Hᵀ.
    gain: DMatrix<f64>,
    /// eᵀ S⁻¹ e.
    pub nis: f64,
    /// ln det S.
    log_determinant: f64,
}

impl Predicted {
    /// ln N(e; 0, S).
    pub fn log_normal(&self) -> f64 {
        self.log_spread(1.0)
    }

    /// ln N(e; 0, κ² S).
    fn log_spread(&self, spread: f64) -> f64 {
        let d = self.innovation.len() as f64;
        -0.5 * (d * ln(2.0 * PI * spread * spread) + self.log_determinant + self.nis / (spread * spread))
    }

    /// ln q: the density of a wild sighting.
    pub fn log_wild(&self) -> f64 {
        let terms = SPREADS.map(|spread| self.log_spread(spread) - ln(SPREADS.len() as f64));
        log_sum(terms)
    }
}

/// ln f = ln ((1 − ε) N + ε q), and the probability that the sighting is not wild.
pub(crate) fn robust(log_normal: f64, log_wild: f64, share: f64) -> (f64, f64) {
    let (normal, wild) = (log_normal + ln_1p(-share), log_wild + ln(share));
    let both = log_sum([normal, wild]);
    (both, exp(normal - both))
}

/// ln Σ exp.
pub(crate) fn log_sum(terms: impl IntoIterator<Item = f64>) -> f64 {
    let terms: Vec<f64> = terms.into_iter().collect();
    let most = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return most;
    }
    most + ln(terms.iter().map(|term| exp(term - most)).sum())
}

impl Filter {
    /// A filter of δ ~ N(0, P).
    pub fn new(covariance: &DMatrix<f64>) -> Self {
        let m = covariance.nrows();
        Self { parts: vec![(Part::Body, m)], mean: DVector::zeros(m), covariance: covariance.clone() }
    }

    /// Adds a part with prior variances, independent of all else.
    pub fn add(&mut self, part: Part, variances: &DVector<f64>) {
        let (old, k) = (self.mean.len(), variances.len());
        self.parts.push((part, k));
        self.mean.resize_vertically_mut(old + k, 0.0);
        self.covariance.resize_mut(old + k, old + k, 0.0);
        (0..k).for_each(|i| self.covariance[(old + i, old + i)] = variances[i]);
    }

    /// Adds variances to those of a part, if it is there: it may have changed since.
    pub fn widen(&mut self, part: Part, variances: &DVector<f64>) {
        let Some(range) = self.range(part) else { return };
        range.zip(variances.iter()).for_each(|(k, variance)| self.covariance[(k, k)] += variance);
    }

    /// Forgets a part, if it is there: what is known of the rest stays.
    pub fn drop(&mut self, part: Part) {
        let Some(range) = self.range(part) else { return };
        let keep: Vec<usize> = (0..self.mean.len()).filter(|k| !range.contains(k)).collect();
        self.mean = self.mean.select_rows(&keep);
        self.covariance = self.covariance.select_rows(&keep).select_columns(&keep);
        self.parts.retain(|(other, _)| *other != part);
    }

    /// The parts.
    pub fn parts(&self) -> impl Iterator<Item = Part> + '_ {
        self.parts.iter().map(|(part, _)| *part)
    }

    /// Mean and covariance of a part.
    pub fn of(&self, part: Part) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let range = self.range(part)?;
        let (from, k) = (range.start, range.len());
        Some((self.mean.rows(from, k).into_owned(), self.covariance.view((from, from), (k, k)).into_owned()))
    }

    /// Gives the last coordinates this covariance, independent of all before.
    pub fn set_last(&mut self, covariance: &DMatrix<f64>) {
        let (k, n) = (covariance.nrows(), self.mean.len());
        self.covariance.view_mut((n - k, n - k), (k, k)).copy_from(covariance);
    }

    /// S of a sighting.
    pub fn spread(&self, heard: &Heard<'_>) -> DMatrix<f64> {
        self.spread_of(heard, &self.rows(heard)).1
    }

    /// P Hᵀ and S.
    fn spread_of(&self, heard: &Heard<'_>, rows: &[(usize, Cow<'_, DMatrix<f64>>)]) -> (DMatrix<f64>, DMatrix<f64>) {
        let d = heard.linear.residual.len();
        let mut gain = DMatrix::zeros(self.mean.len(), d);
        for (from, h) in rows {
            gain += self.covariance.columns(*from, h.nrows()) * h.as_ref();
        }
        let mut s = DMatrix::identity(d, d) * heard.noise;
        for (from, h) in rows {
            s += h.tr_mul(&gain.rows(*from, h.nrows()));
        }
        let s = (&s + s.transpose()) * 0.5;
        (gain, s)
    }

    fn range(&self, part: Part) -> Option<std::ops::Range<usize>> {
        let mut from = 0;
        for (other, k) in &self.parts {
            if *other == part {
                return Some(from..from + k);
            }
            from += k;
        }
        None
    }

    /// The rows of the parts that a sighting has to do with: where they begin, and Hᵀ there.
    fn rows<'a>(&self, heard: &Heard<'a>) -> Vec<(usize, Cow<'a, DMatrix<f64>>)> {
        use Cow::{Borrowed, Owned};
        let d = heard.linear.residual.len();
        let mut from = 0;
        let mut rows = Vec::with_capacity(self.parts.len());
        for (part, k) in &self.parts {
            match *part {
                Part::Body => rows.push((from, Borrowed(&heard.linear.body))),
                Part::Drift if heard.linear.drift.nrows() == *k => rows.push((from, Borrowed(&heard.linear.drift))),
                Part::Change(change) if *k > 0 => rows.push((from, Borrowed(&heard.linear.changes[change]))),
                Part::Shared(posture) if heard.posture == Some(posture) && *k == d => {
                    rows.push((from, Owned(DMatrix::identity(d, d))));
                }
                Part::Drift | Part::Change(_) | Part::Shared(_) => {}
            }
            from += k;
        }
        rows
    }

    /// What is predicted of a sighting; `None` where S is no covariance, which rounding alone can do.
    pub fn predict(&self, heard: &Heard<'_>) -> Option<Predicted> {
        let rows = self.rows(heard);
        let mut innovation = heard.linear.residual.clone();
        for (from, h) in &rows {
            innovation -= h.tr_mul(&self.mean.rows(*from, h.nrows()));
        }
        let (gain, s) = self.spread_of(heard, &rows);
        let factor = Cholesky::new(s)?;
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|x| ln(*x)).sum::<f64>();
        let nis = innovation.dot(&factor.solve(&innovation));
        Some(Predicted { innovation, factor, gain, nis, log_determinant })
    }

    /// Learns from a sighting that is not wild with this probability: its noise is divided by it.
    pub fn update(&mut self, heard: &Heard<'_>, predicted: &Predicted, weight: f64) {
        if weight < NOTHING || weight.is_nan() {
            return;
        }
        let (gain, factor) = (&predicted.gain, &predicted.factor);
        let weighed = (weight < 1.0 - 1e-9)
            .then(|| {
                let l = factor.l();
                let mut s = &l * l.transpose();
                (0..s.nrows()).for_each(|k| s[(k, k)] += heard.noise * (1.0 / weight - 1.0));
                Cholesky::new(s)
            })
            .flatten();
        let factor = weighed.as_ref().unwrap_or(factor);
        self.mean += gain * factor.solve(&predicted.innovation);
        // P − (P Hᵀ L⁻ᵀ)(P Hᵀ L⁻ᵀ)ᵀ, symmetric to the last bit.
        let mut root = gain.transpose();
        factor.l_dirty().solve_lower_triangular_mut(&mut root);
        let (n, d) = (self.mean.len(), root.nrows());
        for column in 0..n {
            for row in column..n {
                let mut sum = 0.0;
                for k in 0..d {
                    sum += root[(k, row)] * root[(k, column)];
                }
                self.covariance[(row, column)] -= sum;
                self.covariance[(column, row)] = self.covariance[(row, column)];
            }
        }
    }
}
