//! What a belief predicts of many candidate movements at once.
//!
//! The whitened Jacobians of a [group](GROUP) of candidates, d equations each, are kept by tangent coordinate, each equation of all
//! candidates side by side, and multiplied by P together. What is left per candidate are d × d matrices (see
//! [`innovation`](super::innovation)).

use std::sync::Arc;

use fearless_simd::{Level, dispatch};
use nalgebra::{Cholesky, DMatrix, Matrix3, Point3};

use super::{
    bhattacharyya::{bhattacharyya, share},
    innovation::{place, products, traces},
    views::Views,
};
use crate::{
    elementary::ln,
    model::{KinematicData, Layout, Points, State},
    sensing::{JointNoise, MeasurementModel},
    simd::{Aligned, GROUP, Run, groups, runs, times},
};

/// Predictions of a chunk of candidates under one hypothesis.
pub(super) struct Predictions {
    level: Level,
    /// Equations of a candidate, d.
    equations: usize,
    /// Tangent coordinates, m.
    dimension: usize,
    /// Predicted readings, d per candidate; NaN where a channel has none.
    readings: Vec<f64>,
    /// H, whitened: m × d rows of lanes for each group.
    rows: Aligned,
    /// G = H P, likewise.
    gains: Aligned,
    /// H P Hᵀ of each candidate.
    spreads: Aligned,
    /// J of each candidate, by which its rows are whitened beside the sensors' noise, where joints' readings are off.
    joints: Option<(Arc<JointNoise>, Vec<Vec<f64>>)>,
    /// Chance of each candidate to be seen.
    chances: Vec<f64>,
    /// By how much each equation counts, d per candidate; empty where all count.
    factors: Vec<f64>,
}

impl Predictions {
    /// Of `candidates` (joint positions, rad or m) for a belief in `state` with `covariance`, seen as `views` tells; without
    /// them for certain, until [`seen`](Self::seen) says otherwise.
    pub fn new(
        level: Level,
        (state, layout, measurement_model): (&State, &Layout, &MeasurementModel),
        covariance: &DMatrix<f64>,
        candidates: &[&[f64]],
        views: Option<&Views>,
    ) -> Self {
        let (m, d) = (layout.dimension(), measurement_model.equations());
        let mut rows = Aligned::zeros(groups(candidates.len()) * m * d * GROUP);
        let mut readings = vec![0.0; d * candidates.len()];
        let mut chances = vec![1.0; candidates.len()];
        let mut factors = vec![1.0; if views.is_some() { d * candidates.len() } else { 0 }];
        let mut data = KinematicData::new(state, layout);
        let mut columns = vec![0.0; d * m];
        let mut joints =
            measurement_model.joint_noise().map(|noise| (noise.clone(), Vec::with_capacity(candidates.len())));
        for (index, candidate) in candidates.iter().enumerate() {
            columns.fill(0.0);
            data.at(candidate);
            let unseen = measurement_model.unseen(data.links());
            measurement_model.rows_apart(&unseen, &data, &mut readings[index * d..(index + 1) * d], &mut columns);
            if let Some((noise, all)) = &mut joints {
                // What may stay unseen counts less before the rest is whitened by it.
                let mut by_joints = measurement_model.joint_rows(noise, &unseen, state, candidate);
                all.push(by_joints.clone());
                if let Some(views) = views {
                    let factors = &mut factors[index * d..(index + 1) * d];
                    chances[index] = views.weigh(
                        measurement_model,
                        candidate,
                        covariance,
                        &mut [&mut columns, &mut by_joints],
                        factors,
                    );
                }
                noise.whiten(&by_joints, &mut columns, &mut []);
            } else if let Some(views) = views {
                let factors = &mut factors[index * d..(index + 1) * d];
                chances[index] = views.weigh(measurement_model, candidate, covariance, &mut [&mut columns], factors);
            }
            let rows = &mut rows[index / GROUP * m * d * GROUP..];
            for (equation, columns) in columns.chunks_exact(m.max(1)).enumerate() {
                let row = rows.iter_mut().skip(equation * GROUP + index % GROUP).step_by(d * GROUP);
                row.zip(columns).for_each(|(row, x)| *row = *x);
            }
        }
        Self { joints, factors, ..Self::from_rows(level, [m, d], covariance, (readings, rows), chances) }
    }

    /// The same where nothing but `points` is measured, which are seen for certain.
    pub fn of_points(level: Level, points: &Points, covariance: &DMatrix<f64>, candidates: &[&[f64]]) -> Self {
        let [m, d] = [covariance.nrows(), points.equations()];
        let mut rows = Aligned::zeros(groups(candidates.len()) * m * d * GROUP);
        let mut readings = vec![0.0; d * candidates.len()];
        for Run { level, groups, .. } in runs(level, candidates.len()) {
            let few = groups.start * GROUP..candidates.len().min(groups.end * GROUP);
            let readings = &mut readings[few.start * d..few.end * d];
            let rows = &mut rows[groups.start * m * d * GROUP..groups.end * m * d * GROUP];
            dispatch!(level, simd => points.rows(simd, &candidates[few], readings, rows));
        }
        Self::from_rows(level, [m, d], covariance, (readings, rows), vec![1.0; candidates.len()])
    }

    fn from_rows(
        level: Level,
        [dimension, equations]: [usize; 2],
        covariance: &DMatrix<f64>,
        (readings, rows): (Vec<f64>, Aligned),
        chances: Vec<f64>,
    ) -> Self {
        let candidates = chances.len();
        let gains = times(level, [equations, candidates], &rows, covariance.as_slice());
        let spreads = products(level, [dimension, equations, candidates], &rows, &gains, None);
        Self { level, equations, dimension, readings, rows, gains, spreads, joints: None, chances, factors: Vec::new() }
    }

    /// The same with a chance of being seen for each candidate, from the predicted marker and its covariance (m, m²),
    /// which is that of the belief, or by another `doubt` than its P.
    pub fn seen(
        &mut self,
        measurement_model: &MeasurementModel,
        doubt: Option<&DMatrix<f64>>,
        chance: impl Fn(usize, &Point3<f64>, &Matrix3<f64>) -> f64,
    ) {
        let (Some(marker), d) = (measurement_model.marker_place(), self.equations) else { return };
        let other = doubt.map(|doubt| {
            let gains = times(self.level, [d, self.len()], &self.rows, doubt.as_slice());
            products(self.level, [self.dimension, d, self.len()], &self.rows, &gains, None)
        });
        let spreads = other.as_ref().unwrap_or(&self.spreads);
        for index in 0..self.chances.len() {
            let of_rows = |row: usize, column: usize| spreads[place(d, row, column, index)];
            let spread = match self.unwhitened(index, of_rows) {
                Some(whole) => measurement_model.marker_spread(|row, column| whole[(row, column)]),
                None => measurement_model.marker_spread(of_rows),
            };
            let Some(spread) = spread else { return };
            let at = index * d + marker.start;
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
        &self.readings[index * self.equations..(index + 1) * self.equations]
    }

    /// By how much an equation of a candidate counts.
    fn factor(&self, index: usize, equation: usize) -> f64 {
        self.factors.get(index * self.equations + equation).copied().unwrap_or(1.0)
    }

    /// H P Hᵀ of a candidate, by row and column.
    pub fn spread(&self, index: usize) -> impl Fn(usize, usize) -> f64 {
        move |row, column| self.spreads[place(self.equations, row, column, index)]
    }

    /// L (H P Hᵀ + I) Lᵀ − I = H P Hᵀ + J Σ Jᵀ of a candidate whitened by the sensors' noise alone, from that of its rows; `None`
    /// where joints' readings are exact, and it is the same.
    fn unwhitened(&self, index: usize, spread: impl Fn(usize, usize) -> f64) -> Option<DMatrix<f64>> {
        let (noise, by_joints) = self.joints.as_ref()?;
        let factor = noise.factor(&by_joints[index]);
        let one = DMatrix::identity(self.equations, self.equations);
        let whitened = DMatrix::from_fn(self.equations, self.equations, spread) + &one;
        Some(&factor * whitened * factor.transpose() - one)
    }

    /// Gᵀ of a candidate (m × d), and S = H P Hᵀ + I.
    pub fn gain_and_innovation(&self, index: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let [m, d] = [self.dimension, self.equations];
        let at = |row: usize, k: usize| ((index / GROUP * m + k) * d + row) * GROUP + index % GROUP;
        let gain = DMatrix::from_fn(m, d, |k, row| self.gains[at(row, k)]);
        (gain, self.innovation(index))
    }

    fn innovation(&self, index: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.equations, self.equations, self.spread(index))
            + DMatrix::identity(self.equations, self.equations)
    }

    /// tr(S⁻¹ G W Gᵀ) of every candidate, W diagonal; NaN where S is not positive.
    pub fn traces(&self, weights: &[f64]) -> Vec<f64> {
        self.traces_of(&self.gains, Some(weights))
    }

    /// tr(S⁻¹ G M Gᵀ) of every candidate, M symmetric; NaN where S is not positive.
    pub fn traces_by(&self, metric: &DMatrix<f64>) -> Vec<f64> {
        self.traces_of(&times(self.level, [self.equations, self.len()], &self.gains, metric.as_slice()), None)
    }

    fn traces_of(&self, gains: &[f64], weights: Option<&[f64]>) -> Vec<f64> {
        let sizes = [self.dimension, self.equations, self.len()];
        let leverages = products(self.level, sizes, &self.gains, gains, weights);
        let mut traces = traces(self.level, self.equations, &self.spreads, &leverages);
        // Without any equation there is nothing to be gained.
        traces.resize(self.len(), 0.0);
        traces
    }

    /// ½ ln det S of every candidate, the information that it brings, nats; NaN where S is not positive.
    pub fn information(&self) -> Vec<f64> {
        let of = |s: DMatrix<f64>| {
            Cholesky::new(s).map_or(f64::NAN, |s| s.l_dirty().diagonal().iter().map(|x| ln(*x)).sum())
        };
        (0..self.len()).map(|index| of(self.innovation(index))).collect()
    }
}

/// 1 − e^{−B} of two hypotheses that predict a candidate, with B the Bhattacharyya distance of their readings.
pub(super) fn told_apart(measurement_model: &MeasurementModel, a: &Predictions, b: &Predictions, index: usize) -> f64 {
    let (in_a, in_b) = (a.spread(index), b.spread(index));
    let counts = |equation: usize| 0.5 * (a.factor(index, equation) + b.factor(index, equation));
    if let (Some(in_a), Some(in_b)) = (a.unwhitened(index, &in_a), b.unwhitened(index, &in_b)) {
        // Each was whitened by its own L: they are compared as the sensors see them.
        let mean = (in_a + in_b) * 0.5;
        let distance = bhattacharyya(
            measurement_model,
            [a.reading(index), b.reading(index)],
            counts,
            |row, column| mean[(row, column)],
            |it, _| it,
        );
        return distance.map_or(0.0, share);
    }
    let mean = |row: usize, column: usize| 0.5 * (in_a(row, column) + in_b(row, column));
    let distance =
        bhattacharyya(measurement_model, [a.reading(index), b.reading(index)], counts, mean, |distance, _| distance);
    distance.map_or(0.0, share)
}
