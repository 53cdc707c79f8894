//! The cost of the data and their normal equations where only points are measured: as many measurements at a time as a
//! register holds.

use fearless_simd::dispatch;
use nalgebra::{DMatrix, DVector};

use super::{
    gram::add_squares,
    normal::{Buffers, emptied, kept},
    posterior::{Measurement, Posterior},
};
use crate::{
    model::Points,
    sensing::Graduated,
    simd::{GROUP, groups},
};

/// The number of measurements whose rows are computed together: few enough for the caches.
const TOGETHER: usize = 32;

impl Posterior {
    /// Adds Σ w HᵀH/s² and Σ w Hᵀr/s² of all readings, and returns their cost.
    pub(super) fn add_points(
        &self,
        loss: Graduated,
        points: &Points,
        (information, negative_gradient): (&mut DMatrix<f64>, &mut DVector<f64>),
        buffers: &mut Buffers,
    ) -> f64 {
        let (m, d) = (information.nrows(), points.equations());
        let mut cost = 0.0;
        for measurements in self.measurements.chunks(TOGETHER) {
            let padded = d * GROUP * groups(measurements.len());
            let rows = kept(&mut buffers.rows, m * padded);
            let readings = kept(&mut buffers.readings, d * measurements.len());
            dispatch!(self.level, simd => points.rows(simd, measurements, readings, rows));
            let weighed = (emptied(&mut buffers.factors, padded), emptied(&mut buffers.residuals, padded));
            cost += self.weigh_points(loss, measurements, readings, weighed);
            let factors = buffers.factors.chunks_exact(d * GROUP);
            for (rows, factors) in rows.chunks_exact_mut(m * d * GROUP).zip(factors) {
                if factors.iter().any(|factor| *factor != 1.0) {
                    for column in rows.chunks_exact_mut(d * GROUP) {
                        column.iter_mut().zip(factors).for_each(|(x, factor)| *x *= factor);
                    }
                }
            }
            add_squares(self.level, (rows, &buffers.residuals), d * GROUP, information, negative_gradient);
        }
        if !cost.is_finite() {
            // What is no number now would still be there where the next step writes nothing.
            buffers.rows.clear();
        }
        cost
    }

    /// Writes √w/s and √w (y − h)/s of all equations of some measurements, zero where there is no reading, and returns their
    /// cost.
    fn weigh_points(
        &self,
        loss: Graduated,
        measurements: &[Measurement],
        readings: &[f64],
        (factors, residuals): (&mut [f64], &mut [f64]),
    ) -> f64 {
        let d = readings.len() / measurements.len();
        let mut cost = 0.0;
        for (index, (seen, predicted)) in measurements.iter().zip(readings.chunks_exact(d)).enumerate() {
            self.measurement_model.residuals_of(predicted, &seen.observation, |channel, whitened| {
                let squared = self.squared(channel, whitened);
                cost += loss.cost(squared, whitened.len());
                let root = loss.weight(squared, whitened.len()).sqrt();
                for (noise, part) in self.noises(channel) {
                    for row in part {
                        let equation = whitened.len() * channel + row;
                        let place = (index / GROUP * d + equation) * GROUP + index % GROUP;
                        factors[place] = root / self.scales[noise];
                        residuals[place] = factors[place] * whitened[row];
                    }
                }
            });
        }
        cost
    }
}
