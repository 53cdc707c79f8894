//! The posterior: prior and all measurements so far, as a cost on states.
//!
//! ```text
//! E(x) = prior(x) + Σᵢ ρ(‖yᵢ − h(x, θᵢ)‖² / s²) + ½ (δ − δ̂)ᵀ Λ (δ − δ̂)
//! ```
//!
//! with whitened residuals, ρ the [loss](Loss) of a reading (½ of its argument, for least squares) and s the scale of its
//! noise, as a multiple of the nominal one. The last term stands for measurements whose linearisation has
//! marginalised: Λ = Σ w HᵀH / s² collects them in the chart at the state where they were linearised, δ are the coordinates of x
//! there. It is kept by kind of noise and in nominal σ, so that a scale that is learned later still applies.

use std::{ops::Range, sync::Arc};

use fearless_simd::Level;
use nalgebra::{DMatrix, DVector};

use super::{
    gram::add_row_squares,
    joint_scale::Joints,
    marginalised::{Marginalised, Quadratic},
    normal::{Buffers, Normal},
};
use crate::{
    estimation::ReadingReport,
    model::{KinematicData, Layout, Links, Points, Prior, State, Whitening, rank},
    sensing::{Graduated, Loss, MeasurementModel, Observation, present},
    simd::level,
};

/// A movement and its observation.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Measurement {
    pub positions: Vec<f64>,
    pub observation: Observation,
    /// Its number among all movements, from 1.
    pub movement: u64,
}

impl AsRef<[f64]> for Measurement {
    fn as_ref(&self) -> &[f64] {
        &self.positions
    }
}

/// The posterior: prior, likelihood and measurements.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub prior: Prior,
    pub pins: State,
    pub measurement_model: Arc<MeasurementModel>,
    /// The points that are measured, if nothing else is.
    targets: Option<Vec<(usize, Whitening)>>,
    /// The instructions that this processor has.
    pub level: Level,
    pub loss: Loss,
    /// s, by kind of noise: 1 where it is known.
    pub scales: Vec<f64>,
    /// Observations of the equipment from before any movement. They belong to the prior, so that they never settle and no change
    /// of the body drops them.
    pub known: Vec<Measurement>,
    /// The noise of the joints' readings, where they are not exact.
    pub joints: Option<Joints>,
    pub measurements: Vec<Measurement>,
    pub marginalised: Option<Marginalised>,
}

/// The fit of some measurements for one kind of noise, from which its scale is learned.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    /// Σ w ‖r‖² in nominal σ.
    pub squared: f64,
    /// Σ w d.
    pub equations: f64,
}

/// Measurements whose rows are stacked at a time: memory does not grow with their number.
pub(super) const STACKED: usize = 1024;

/// ‖r‖² of the numbers that are not absent.
fn norm_squared(x: &[f64]) -> f64 {
    x.iter().filter(|x| !x.is_nan()).map(|x| x * x).sum()
}

impl Posterior {
    pub fn new(prior: Prior, measurement_model: Arc<MeasurementModel>) -> Self {
        let scales = vec![1.0; measurement_model.noises().len()];
        let targets = measurement_model.points();
        let joints = measurement_model.joint_noise().map(|noise| Joints::new(noise.as_ref().clone()));
        Self {
            joints,
            pins: prior.pins(),
            prior,
            measurement_model,
            targets,
            level: level(),
            loss: Loss::None,
            scales,
            known: Vec::new(),
            measurements: Vec::new(),
            marginalised: None,
        }
    }

    /// This posterior with another prior and these measurements only.
    pub fn anew(&self, prior: Prior, measurements: Vec<Measurement>) -> Self {
        let (loss, scales, known, joints) = (self.loss, self.scales.clone(), self.known.clone(), self.joints.clone());
        Self { loss, scales, known, joints, measurements, ..Self::new(prior, self.measurement_model.clone()) }
    }

    /// The reports on every reading at `state`, except for marginalised readings and what is known beforehand.
    pub fn readings(&self, state: &State) -> impl Iterator<Item = ReadingReport> {
        self.readings_of(&self.measurements, state)
    }

    /// The reports at `state` on the measurements from this movement on.
    pub fn readings_after(&self, movement: u64, state: &State) -> impl Iterator<Item = ReadingReport> {
        let latest = self.measurements.iter().rev().take_while(|seen| seen.movement >= movement).count();
        self.readings_of(&self.measurements[self.measurements.len() - latest..], state)
    }

    /// The reports at `state` on what is known beforehand.
    pub fn known_readings(&self, state: &State) -> impl Iterator<Item = ReadingReport> {
        self.readings_of(&self.known, state)
    }

    fn readings_of(&self, measurements: &[Measurement], state: &State) -> impl Iterator<Item = ReadingReport> {
        let mut links = Links::new(state);
        let of = move |seen: &Measurement| {
            let mut reports = Vec::new();
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                let (squared, d) = (self.squared(channel, whitened), present(whitened));
                reports.push(ReadingReport {
                    movement: seen.movement,
                    channel,
                    equations: d,
                    residual_sigmas: squared.sqrt(),
                    weight: self.loss.weight(squared, d),
                    outlier_probability: self.loss.outlier(squared, d),
                });
            });
            reports
        };
        measurements.iter().flat_map(of)
    }

    /// What is known beforehand, and the measurements that were not marginalised.
    pub fn all(&self) -> impl Iterator<Item = &Measurement> {
        self.known.iter().chain(&self.measurements)
    }

    /// Passes the weight of every reading of a measurement at `state` to `each`.
    pub fn weights(&self, state: &State, seen: &Measurement, mut each: impl FnMut(f64)) {
        self.residuals(Links::new(state).at(&seen.positions), seen, |channel, whitened| {
            each(self.loss.weight(self.squared(channel, whitened), present(whitened)));
        });
    }

    /// The measurements in which no two readings err together: what is known beforehand, and all if joints are exact.
    fn independent(&self) -> impl Iterator<Item = &Measurement> {
        self.known.iter().chain(self.measurements.iter().filter(|_| self.joints.is_none()))
    }

    /// The number of measurements so far.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        self.measurements.len() + self.marginalised.as_ref().map_or(0, |marginalised| marginalised.count)
    }

    /// The number of their equations, those of outliers at `state` not counted.
    pub fn equations(&self, state: &State, layout: &Layout) -> f64 {
        if !self.loss.is_robust() {
            return self.equations_by_noise().iter().sum();
        }
        self.fit(state, layout).iter().map(|fit| fit.equations).sum()
    }

    /// The number of equations of all readings by kind of noise, outliers included; marginalised outliers are not.
    pub fn equations_by_noise(&self) -> Vec<f64> {
        let mut equations = vec![0.0; self.scales.len()];
        for seen in self.all() {
            for (channel, reading) in seen.observation.readings.iter().enumerate() {
                let Some(reading) = reading else { continue };
                self.noises(channel).for_each(|(noise, part)| equations[noise] += present(&reading[part]) as f64);
            }
        }
        if let Some(marginalised) = &self.marginalised {
            equations.iter_mut().zip(&marginalised.noises).for_each(|(all, of)| *all += of.equations);
        }
        equations
    }

    /// The number of independent equations of remaining measurements, outliers at `state` not counted; marginalised equations all count
    /// as independent.
    pub fn rank(&self, state: &State, layout: &Layout) -> usize {
        let m = layout.dimension();
        let normal: Vec<Measurement> = if self.loss.is_robust() {
            self.all().filter_map(|seen| self.without_outliers(state, seen)).collect()
        } else {
            self.all().cloned().collect()
        };
        let mut rows = DMatrix::zeros(m, normal.iter().map(|seen| seen.observation.numbers()).sum());
        let mut data = KinematicData::new(state, layout);
        let mut at = 0;
        for seen in &normal {
            let d = seen.observation.numbers();
            let mut residual = vec![0.0; d];
            let place = &mut rows.as_mut_slice()[at * m..(at + d) * m];
            self.measurement_model.linearise(data.at(&seen.positions), &seen.observation, place, &mut residual);
            at += d;
        }
        rank(&rows.transpose()) + self.marginalised.as_ref().map_or(0, |marginalised| marginalised.equations() as usize)
    }

    /// A measurement without the readings that are likelier outliers than not; `None` if that leaves none.
    pub fn without_outliers(&self, state: &State, seen: &Measurement) -> Option<Measurement> {
        let mut normal = seen.clone();
        self.residuals(Links::new(state).at(&seen.positions), seen, |channel, whitened| {
            if self.loss.weight(self.squared(channel, whitened), present(whitened)) < 0.5 {
                normal.observation.readings[channel] = None;
            }
        });
        (!normal.observation.is_miss()).then_some(normal)
    }

    /// The kinds of noise of a channel, with their numbers among all.
    pub fn noises(&self, channel: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
        let all = self.measurement_model.noises().iter().enumerate();
        all.filter(move |(_, noise)| noise.channel == channel).map(|(index, noise)| (index, noise.part.clone()))
    }

    /// The points measured at `state`, if nothing else is measured.
    fn points(&self, state: &State, layout: &Layout) -> Option<Points> {
        Points::new(state, layout, self.targets.as_ref()?)
    }

    /// ‖r‖² of a reading, in assumed σ.
    pub fn squared(&self, channel: usize, whitened: &[f64]) -> f64 {
        self.noises(channel).map(|(noise, part)| norm_squared(&whitened[part]) / self.scales[noise].powi(2)).sum()
    }

    /// E(x), reading by reading; infinite where x is too far from where marginalised measurements were linearised. Axes are written
    /// with their points nearest to the pins.
    #[cfg(test)]
    pub fn cost(&self, state: &State, layout: &Layout) -> f64 {
        let (loss, mut cost) = (Graduated::from(self.loss), self.prior.cost(state, None));
        if let Some(joints) = &self.joints {
            cost += self.stacked_jointly((&joints.noise, loss), state, layout, &self.measurements, None).2;
        }
        let mut links = Links::new(state);
        for seen in self.independent() {
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                cost += loss.cost(self.squared(channel, whitened), present(whitened));
            });
        }
        let Some(marginalised) = &self.marginalised else { return cost };
        marginalised.state.local(layout, state).map_or(f64::INFINITY, |delta| {
            let of = marginalised.noises.iter().zip(&self.scales);
            cost + marginalised.excess + of.map(|(of, scale)| of.misfit_at(&delta) / (scale * scale)).sum::<f64>()
        })
    }

    /// The fit of the data at `state` by kind of noise: where the noise is as assumed, `squared` is χ² distributed with
    /// `equations` degrees of freedom.
    pub fn fit(&self, state: &State, layout: &Layout) -> Vec<Fit> {
        let mut fits = match &self.joints {
            None => vec![Fit::default(); self.scales.len()],
            Some(joints) => self.joint_fit(&joints.noise, state),
        };
        let mut links = Links::new(state);
        for seen in self.independent() {
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                let weight = self.loss.weight(self.squared(channel, whitened), present(whitened));
                for (noise, part) in self.noises(channel) {
                    let whitened = &whitened[part];
                    fits[noise].squared += weight * norm_squared(whitened);
                    fits[noise].equations += weight * present(whitened) as f64;
                }
            });
        }
        if let Some(marginalised) = &self.marginalised {
            let delta = marginalised.state.local(layout, state);
            for (fit, of) in fits.iter_mut().zip(&marginalised.noises) {
                fit.squared += delta.as_ref().map_or(f64::INFINITY, |delta| 2.0 * of.misfit_at(delta));
                fit.equations += of.equations;
            }
        }
        fits
    }

    /// The part of the cost at `state` that is due to normal readings: twice it is χ² distributed at the truth.
    #[cfg(test)]
    pub fn misfit(&self, state: &State, layout: &Layout) -> f64 {
        self.fit(state, layout).iter().zip(&self.scales).map(|(fit, scale)| 0.5 * fit.squared / (scale * scale)).sum()
    }

    /// The normal equations at `state`, linearised there; `None` outside the chart of marginalised measurements.
    #[cfg(test)]
    pub fn normal(&self, state: &State, layout: &Layout) -> Option<Normal> {
        let mut normal = self.normal_by(self.loss.into(), state, layout, &mut Buffers::default())?;
        normal.information.fill_upper_triangle_with_lower_triangle();
        Some(normal)
    }

    /// The normal equations at `state` by another loss; the information's upper triangle is meaningless.
    pub fn normal_by(&self, loss: Graduated, state: &State, layout: &Layout, buffers: &mut Buffers) -> Option<Normal> {
        let (mut information, mut negative_gradient) = buffers.derivatives(layout.dimension());
        let mut cost = 0.0;
        if !self.known.is_empty() {
            let (stacked, residuals, errors) = self.stacked(loss, state, layout, &self.known);
            add_row_squares(level(), stacked.as_slice(), &mut information);
            negative_gradient += stacked * residuals;
            cost += errors;
        }
        if let Some(points) = self.points(state, layout) {
            cost += self.add_points(loss, &points, (&mut information, &mut negative_gradient), buffers);
        } else if let Some(joints) = &self.joints {
            let by_joints = buffers.joints.take().unwrap_or_else(|| self.joint_rows(state));
            for (measurements, by_joints) in self.measurements.chunks(STACKED).zip(by_joints.chunks(STACKED)) {
                let (stacked, residuals, errors) =
                    self.stacked_jointly((&joints.noise, loss), state, layout, measurements, Some(by_joints));
                add_row_squares(level(), stacked.as_slice(), &mut information);
                negative_gradient += stacked * residuals;
                cost += errors;
            }
            buffers.joints = Some(by_joints);
        } else {
            for measurements in self.measurements.chunks(STACKED) {
                let (stacked, residuals, errors) = self.stacked(loss, state, layout, measurements);
                add_row_squares(level(), stacked.as_slice(), &mut information);
                negative_gradient += stacked * residuals;
                cost += errors;
            }
        }
        cost += self.prior.cost(state, Some((&mut information, &mut negative_gradient)));
        if let Some(marginalised) = &self.marginalised {
            let (noises, excess) = marginalised.carried(state, layout)?;
            cost += excess;
            for (of, scale) in noises.into_iter().zip(&self.scales) {
                let precision = (scale * scale).recip();
                information += of.information * precision;
                negative_gradient += of.vector * precision;
                cost += of.misfit * precision;
            }
        }
        Some(Normal { cost, information, negative_gradient })
    }

    /// √w Hᵀ/s (m × d) and √w (y − h)/s of one measurement.
    pub fn weighed(&self, state: &State, layout: &Layout, seen: &Measurement) -> (DMatrix<f64>, DVector<f64>) {
        let (rows, residuals, _) = self.stacked(self.loss.into(), state, layout, std::slice::from_ref(seen));
        (rows, residuals)
    }

    /// √w Hᵀ/s and √w (y − h)/s of some measurements, side by side, and their cost.
    fn stacked(
        &self,
        loss: Graduated,
        state: &State,
        layout: &Layout,
        measurements: &[Measurement],
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        if let Some(joints) = &self.joints {
            return self.stacked_jointly((&joints.noise, loss), state, layout, measurements, None);
        }
        let m = layout.dimension();
        let equations = measurements.iter().map(|seen| seen.observation.numbers()).sum();
        let mut stacked = DMatrix::zeros(m, equations);
        let mut residuals = DVector::zeros(equations);
        let mut data = KinematicData::new(state, layout);
        let (mut at, mut cost) = (0, 0.0);
        for seen in measurements {
            data.at(&seen.positions);
            let d = seen.observation.numbers();
            let rows = &mut stacked.as_mut_slice()[at * m..(at + d) * m];
            let residual = &mut residuals.as_mut_slice()[at..at + d];
            let is_whole = self.measurement_model.linearise(&data, &seen.observation, rows, residual) == d;
            cost += self.weigh(loss, &seen.observation, m, rows, residual, is_whole);
            at += d;
        }
        (stacked, residuals, cost)
    }

    /// Weighs the rows and residuals of an observation, reading by reading, and returns their cost: zero where there is no
    /// prediction, which can be if not all of it `is_whole`.
    fn weigh(
        &self,
        loss: Graduated,
        observation: &Observation,
        m: usize,
        rows: &mut [f64],
        residual: &mut [f64],
        is_whole: bool,
    ) -> f64 {
        let (mut at, mut cost) = (0, 0.0);
        for (channel, reading) in observation.readings.iter().enumerate() {
            let Some(reading) = reading else { continue };
            let place = at..at + reading.len();
            if !is_whole && residual[place.clone()].iter().any(|x| x.is_nan()) {
                rows[place.start * m..place.end * m].fill(0.0);
                residual[place.clone()].fill(0.0);
                at = place.end;
                continue;
            }
            let squared = self.squared(channel, &residual[at..at + reading.len()]);
            let equations = present(reading);
            cost += loss.cost(squared, equations);
            let root = loss.weight(squared, equations).sqrt();
            for (noise, part) in self.noises(channel) {
                let factor = root / self.scales[noise];
                if factor != 1.0 {
                    let place = at + part.start..at + part.end;
                    rows[place.start * m..place.end * m].iter_mut().for_each(|x| *x *= factor);
                    residual[place].iter_mut().for_each(|x| *x *= factor);
                }
            }
            at += reading.len();
        }
        cost
    }

    /// Σ w HᵀH and related sums of some measurements, by kind of noise and in nominal σ, and their cost beyond ½ Σ w
    /// ‖r‖².
    pub fn quadratics(&self, state: &State, layout: &Layout, measurements: &[Measurement]) -> (Vec<Quadratic>, f64) {
        let (rows, residuals, cost) = self.stacked(self.loss.into(), state, layout, measurements);
        let mut of_noise = vec![Vec::new(); self.scales.len()];
        let mut at = 0;
        for seen in measurements {
            for (channel, reading) in seen.observation.readings.iter().enumerate() {
                let Some(reading) = reading else { continue };
                self.noises(channel).for_each(|(noise, part)| of_noise[noise].extend(at + part.start..at + part.end));
                at += reading.len();
            }
        }
        let of = |(columns, scale): (&Vec<usize>, &f64)| {
            let (rows, residuals) = (rows.select_columns(columns), residuals.select_rows(columns));
            let square = scale * scale;
            Quadratic {
                information: &rows * rows.transpose() * square,
                misfit: 0.5 * residuals.norm_squared() * square,
                vector: rows * residuals * square,
                equations: 0.0,
            }
        };
        let mut quadratics: Vec<Quadratic> = of_noise.iter().zip(&self.scales).map(of).collect();
        let mut links = Links::new(state);
        for seen in measurements {
            self.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                let weight = self.loss.weight(self.squared(channel, whitened), present(whitened));
                self.noises(channel)
                    .for_each(|(noise, part)| quadratics[noise].equations += weight * present(&whitened[part]) as f64);
            });
        }
        let explained: f64 = quadratics.iter().zip(&self.scales).map(|(of, scale)| of.misfit / (scale * scale)).sum();
        (quadratics, cost - explained)
    }

    /// Moves the oldest `count` measurements into the quadratic, linearised at `state`, with the weights that they have there.
    pub fn marginalise(&mut self, count: usize, state: &State, layout: &Layout) {
        let old: Vec<Measurement> = self.measurements.drain(..count.min(self.measurements.len())).collect();
        let (mut noises, mut excess) = self.quadratics(state, layout, &old);
        let mut total = old.len();
        // What cannot be carried over is kept by nobody: the chart ends 90 deg away, where nothing settles.
        if let Some(before) = self.marginalised.take()
            && let Some((carried, more)) = before.carried(state, layout)
        {
            for (into, of) in noises.iter_mut().zip(carried) {
                into.add(of);
            }
            excess += more;
            total += before.count;
        }
        self.marginalised = Some(Marginalised { state: state.clone(), noises, excess, count: total });
    }
}
