//! What a belief predicts of many candidate movements at once.
//!
//! The whitened transposed Jacobians of B candidates, d equations each, stack into one m × dB matrix, and one product with
//! P serves them all. What is left per candidate are d × d matrices; for three equations, as of a marker, their size is
//! known when this is compiled.

use nalgebra::{Cholesky, Const, DMatrix, DefaultAllocator, Dim, Dyn, Matrix3, OMatrix, Point3, allocator::Allocator};

use super::views::Views;
use crate::{
    model::{Layout, Pass, State},
    sensing::Rig,
};

/// Predictions of a chunk of candidates under one hypothesis.
pub(super) struct Predictions {
    /// Equations of a movement, d.
    d: usize,
    /// Predicted readings, d per candidate; NaN where a channel has none.
    readings: Vec<f64>,
    /// Hᵀ, whitened (m × dB).
    rows: DMatrix<f64>,
    /// Gᵀ = P Hᵀ (m × dB).
    gains: DMatrix<f64>,
    /// H P Hᵀ of each candidate, d × d.
    spreads: Vec<f64>,
    /// Chance of each candidate to be seen.
    chances: Vec<f64>,
}

impl Predictions {
    /// Of `candidates` (joint positions, rad or m) for a belief in `state` with `covariance`, seen as `views` tells; without
    /// them for certain, until [`seen`](Self::seen) says otherwise.
    pub fn new<C: AsRef<[f64]>>(
        state: &State,
        layout: &Layout,
        rig: &Rig,
        covariance: &DMatrix<f64>,
        candidates: &[C],
        views: Option<&Views>,
    ) -> Self {
        let (m, d) = (layout.dimension(), rig.equations());
        let mut rows = DMatrix::zeros(m, d * candidates.len());
        let mut readings = vec![0.0; d * candidates.len()];
        let mut chances = vec![1.0; candidates.len()];
        let mut pass = Pass::new(state, layout);
        for (index, candidate) in candidates.iter().enumerate() {
            pass.at(candidate.as_ref());
            let place = index * d..(index + 1) * d;
            let columns = &mut rows.as_mut_slice()[place.start * m..place.end * m];
            rig.rows(&pass, &mut readings[place], columns);
            if let Some(views) = views {
                chances[index] = views.weigh(rig, candidate.as_ref(), columns);
            }
        }
        let gains = covariance * &rows;
        let spreads = if d == 3 {
            products(Const::<3>, &rows, &gains, candidates.len())
        } else {
            products(Dyn(d), &rows, &gains, candidates.len())
        };
        Self { d, readings, rows, gains, spreads, chances }
    }

    /// The same with a chance of being seen for each candidate, from the predicted marker and its covariance (m, m²),
    /// which is that of the belief, or by another `doubt` than its P.
    pub fn seen(
        &mut self,
        rig: &Rig,
        doubt: Option<&DMatrix<f64>>,
        chance: impl Fn(usize, &Point3<f64>, &Matrix3<f64>) -> f64,
    ) {
        let Some(place) = rig.marker_place() else { return };
        let (d, count) = (self.d, self.chances.len());
        let other = doubt.map(|doubt| {
            let gains = doubt * &self.rows;
            products(Dyn(d), &self.rows, &gains, count)
        });
        let spreads = other.as_ref().unwrap_or(&self.spreads);
        for index in 0..count {
            let spread = &spreads[index * d * d..(index + 1) * d * d];
            let Some(spread) = rig.marker_spread(|row, column| spread[column * d + row]) else { return };
            let at = index * d + place.start;
            let marker = Point3::from_slice(&self.readings[at..at + 3]);
            self.chances[index] = chance(index, &marker, &spread);
        }
    }

    /// The same with every chance multiplied by a factor.
    pub fn discount(&mut self, factor: impl Fn(usize) -> f64) {
        self.chances.iter_mut().enumerate().for_each(|(index, chance)| *chance *= factor(index));
    }

    /// How many candidates.
    pub fn len(&self) -> usize {
        self.chances.len()
    }

    /// p(θ) of a candidate.
    pub fn chance(&self, index: usize) -> f64 {
        self.chances[index]
    }

    /// The predicted readings of a candidate, d numbers.
    pub fn reading(&self, index: usize) -> &[f64] {
        &self.readings[index * self.d..(index + 1) * self.d]
    }

    /// H P Hᵀ of a candidate, d × d numbers.
    pub fn spread(&self, index: usize) -> &[f64] {
        &self.spreads[index * self.d * self.d..(index + 1) * self.d * self.d]
    }

    /// Gᵀ of a candidate (m × d), and S = H P Hᵀ + I.
    pub fn gain_and_innovation(&self, index: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let s = DMatrix::from_column_slice(self.d, self.d, self.spread(index)) + DMatrix::identity(self.d, self.d);
        (self.gains.columns(index * self.d, self.d).into_owned(), s)
    }

    /// tr(S⁻¹ G M Gᵀ) of every candidate, given M Gᵀ; NaN where S is not positive.
    pub fn traces(&self, weighted: impl FnOnce(&DMatrix<f64>) -> DMatrix<f64>) -> Vec<f64> {
        let weighted = weighted(&self.gains);
        let (d, count) = (self.d, self.len());
        if d == 3 {
            traces(Const::<3>, &self.spreads, &products(Const::<3>, &self.gains, &weighted, count))
        } else {
            traces(Dyn(d), &self.spreads, &products(Dyn(d), &self.gains, &weighted, count))
        }
    }

    /// ½ ln det S of every candidate, the information that it brings, nats; NaN where S is not positive.
    pub fn information(&self) -> Vec<f64> {
        let of = |spread: &[f64]| {
            let s = DMatrix::from_column_slice(self.d, self.d, spread) + DMatrix::identity(self.d, self.d);
            Cholesky::new(s).map_or(f64::NAN, |s| s.l_dirty().diagonal().iter().map(|x| x.ln()).sum())
        };
        (0..self.len()).map(|index| of(self.spread(index))).collect()
    }
}

/// Aᵀ B of each candidate's d columns (m each), symmetric, one after the other.
fn products<D: Dim>(d: D, a: &DMatrix<f64>, b: &DMatrix<f64>, count: usize) -> Vec<f64> {
    let (m, d) = (a.nrows(), d.value());
    let (a, b) = (a.as_slice(), b.as_slice());
    let mut found = vec![0.0; d * d * count];
    for index in 0..count {
        let place = &mut found[index * d * d..(index + 1) * d * d];
        for column in 0..d {
            let b = &b[(index * d + column) * m..(index * d + column + 1) * m];
            for row in 0..=column {
                let a = &a[(index * d + row) * m..(index * d + row + 1) * m];
                let value = dot(a, b);
                place[column * d + row] = value;
                place[row * d + column] = value;
            }
        }
    }
    found
}

/// Four sums at a time, which the compiler turns into vector instructions.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (fours_a, rest_a) = a.as_chunks::<4>();
    let (fours_b, rest_b) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in fours_a.iter().zip(fours_b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// tr(S⁻¹ L) of every candidate, S = spread + I.
fn traces<D: Dim>(d: D, spreads: &[f64], leverages: &[f64]) -> Vec<f64>
where
    DefaultAllocator: Allocator<D, D>,
{
    let size = d.value() * d.value();
    let one = OMatrix::<f64, D, D>::identity_generic(d, d);
    let of = |(spread, leverage): (&[f64], &[f64])| {
        let s = OMatrix::<f64, D, D>::from_column_slice_generic(d, d, spread) + &one;
        let leverage = OMatrix::<f64, D, D>::from_column_slice_generic(d, d, leverage);
        Cholesky::new(s).map_or(f64::NAN, |s| s.solve(&leverage).trace())
    };
    spreads.chunks_exact(size.max(1)).zip(leverages.chunks_exact(size.max(1))).map(of).collect()
}

/// 1 − e^{−B} of two hypotheses that predict a candidate, with B the Bhattacharyya distance of their readings.
pub(super) fn told_apart(rig: &Rig, a: &Predictions, b: &Predictions, index: usize) -> f64 {
    let d = a.d;
    let mut difference = [0.0; 3];
    if d == 3 {
        rig.difference(a.reading(index), b.reading(index), &mut difference);
        let mean = (Matrix3::from_column_slice(a.spread(index)) + Matrix3::from_column_slice(b.spread(index))) * 0.5;
        let difference = nalgebra::Vector3::from(difference);
        let s = (mean + Matrix3::identity()).cholesky();
        return s.map_or(0.0, |s| -(-0.125 * difference.dot(&s.solve(&difference))).exp_m1());
    }
    let mut difference = nalgebra::DVector::zeros(d);
    rig.difference(a.reading(index), b.reading(index), difference.as_mut_slice());
    let of = |spread: &[f64]| DMatrix::from_column_slice(d, d, spread);
    let s = (of(a.spread(index)) + of(b.spread(index))) * 0.5 + DMatrix::identity(d, d);
    Cholesky::new(s).map_or(0.0, |s| -(-0.125 * difference.dot(&s.solve(&difference))).exp_m1())
}
