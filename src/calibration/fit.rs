//! One fit: a layout and the rows that it is learned from.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector3};

use super::{CalibrationError, Case, figures::mean};
use crate::{
    estimation::{Belief, Estimator, HypothesisSettings, NoiseFit, ReadingReport, Smoother},
    experiment::Stream,
    model::{Block, Layout, Prior, State, best_motion},
    scenario::Known,
    sensing::{Noise, Occasion},
};

/// What explains some rows.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The state, with its covariance.
    pub belief: Belief,
    /// What is made of every reading: `movement` counts the rows that it was learned from, from 1.
    pub readings: Vec<ReadingReport>,
    /// How well they are fitted, by kind of noise.
    pub noise: Vec<NoiseFit>,
    /// The rows that it was learned from.
    pub rows: Vec<usize>,
}

impl Fit {
    /// What was learned.
    pub fn state(&self) -> &State {
        &self.belief.state
    }

    /// By row that it was learned from: the probability that one of its readings is an outlier; empty where outliers are
    /// not looked for.
    pub fn outliers(&self) -> Vec<(usize, f64)> {
        if self.readings.is_empty() {
            return Vec::new();
        }
        let mut by_row: Vec<(usize, f64)> = self.rows.iter().map(|row| (*row, 0.0)).collect();
        for reading in &self.readings {
            let index = usize::try_from(reading.movement).ok().and_then(|movement| movement.checked_sub(1));
            if let (Some((_, most)), Some(probability)) =
                (index.and_then(|index| by_row.get_mut(index)), reading.outlier_probability)
            {
                *most = most.max(probability);
            }
        }
        by_row
    }
}

/// Random numbers of the search; fits of one table differ by nothing else than rows and layout.
const SEED: u64 = 1;

impl Case<'_> {
    /// What explains `rows`, as far as `layout` can, from a start near which it is to be found; without one it is searched for
    /// wherever the prior allows.
    ///
    /// Targets on one hand miss together where the chain before them does. Three of them are then not three times the
    /// evidence: the noise is taken to be as much larger as the [design effect](Self::design_effect) of a row says.
    pub fn fit(&self, layout: &Layout, rows: &[usize], near: Option<&State>) -> Result<Fit, CalibrationError> {
        let fit = self.fit_with(layout, rows, near, None)?;
        let Some(effect) = self.design_effect(&fit) else { return Ok(fit) };
        let mut together = self.fit_with(layout, rows, Some(fit.state()), Some((&fit, effect)))?;
        together.noise = fit.noise;
        together.belief.model_error_m = fit.belief.model_error_m;
        Ok(together)
    }

    fn fit_with(
        &self,
        layout: &Layout,
        rows: &[usize],
        near: Option<&State>,
        effect: Option<(&Fit, f64)>,
    ) -> Result<Fit, CalibrationError> {
        let mut smoother = self.smoother(layout, near.is_none(), effect)?;
        let movements: Vec<_> = rows.iter().map(|row| &self.rows[*row]).collect();
        let movements: Vec<_> = movements.iter().map(|row| (row.positions.as_slice(), &row.observation)).collect();
        let starts = match near {
            Some(state) => vec![state.clone()],
            None => vec![self.guess().clone(), self.placed(rows)],
        };
        if !movements.is_empty() {
            smoother.absorb_all(&movements, &starts)?;
        }
        Ok(Fit {
            belief: smoother.belief().clone(),
            readings: smoother.readings(),
            noise: smoother.fits(),
            rows: rows.to_vec(),
        })
    }

    /// By how much the variance of the sum of a row's residuals exceeds that of independent ones (Kish 1965),
    ///
    /// ```text
    /// Σ ‖Σⱼ rᵢⱼ‖² / Σ Σⱼ ‖rᵢⱼ‖²      rᵢⱼ the whitened residual of target j in row i
    /// ```
    ///
    /// `None` where rows have one reading, readings are of several kinds, or they miss independently.
    fn design_effect(&self, fit: &Fit) -> Option<f64> {
        let (mut of_sums, mut sum_of, mut most) = (0.0, 0.0, 0);
        for row in fit.rows.iter().map(|row| &self.rows[*row]) {
            let (mut sum, mut count) = (Vector3::zeros(), 0);
            let mut is_alike = true;
            fit.belief.rig.residuals(fit.state(), &row.positions, &row.observation, |channel, whitened| {
                if self.rig.channels()[channel].target().is_none() || whitened.len() != 3 {
                    is_alike = false;
                    return;
                }
                let residual = Vector3::from_column_slice(whitened);
                sum += residual;
                sum_of += residual.norm_squared();
                count += 1;
            });
            if !is_alike {
                return None;
            }
            of_sums += sum.norm_squared();
            most = most.max(count);
        }
        let effect = of_sums / sum_of;
        (self.scenario.smoother.noise_unknown && most > 1 && effect > 1.0).then_some(effect)
    }

    /// The chain as described with base, targets, cameras and sockets where `rows` put them.
    pub fn nominal(&self, rows: &[usize]) -> Result<Fit, CalibrationError> {
        self.fit(&self.placing(), rows, None)
    }

    fn smoother(
        &self,
        layout: &Layout,
        searches: bool,
        effect: Option<(&Fit, f64)>,
    ) -> Result<Smoother, CalibrationError> {
        let deviations = self.deviations(layout);
        let covariance = DMatrix::from_diagonal(&deviations.map(|sd| sd * sd));
        let within = |block: Block| match self.scenario.prior.of(block) {
            Some(Known::Anywhere { within_m }) => Some(within_m),
            _ => None,
        };
        let prior = Prior::new(self.guess().clone(), layout, covariance, within)?;
        let given = self.scenario.smoother.hypotheses;
        let settings = HypothesisSettings { spawned: if searches { given.spawned } else { 0 }, ..given };
        // What is known of the equipment is known as well as the file says: there is one reading of it.
        let is_unknown = |noise: &Noise| {
            self.scenario.smoother.noise_unknown
                && self.rig.channels()[noise.channel].occasion() != Occasion::Beforehand
        };
        let unknown = self.rig.noises().iter().map(|noise| effect.is_none() && is_unknown(noise)).collect();
        let rig = match effect {
            None => self.rig.clone(),
            Some((fit, effect)) => {
                let scales: Vec<f64> = fit.noise.iter().map(|noise| noise.scale * effect.sqrt()).collect();
                Arc::new(self.rig.scaled(&scales))
            }
        };
        let rng = Stream::Hypotheses.rng(SEED);
        let smoother = Smoother::new(prior, Arc::new(layout.clone()), rig, settings, rng)
            .with_loss(self.loss)
            .with_unknown_noise(unknown)
            .never_forgetting();
        Ok(match self.known {
            Some(known) => smoother.knowing(known.clone()),
            None => smoother,
        })
    }

    /// The prior's standard deviations.
    pub(super) fn deviations(&self, layout: &Layout) -> DVector<f64> {
        self.scenario.prior.standard_deviations(layout)
    }

    /// The guess with its base where the rigid motion that fits best puts it, by the targets that were seen in `rows`, and
    /// with sockets where they held their targets in the mean.
    fn placed(&self, rows: &[usize]) -> State {
        let mut state = self.guess().clone();
        let (mut predicted, mut seen) = (Vec::new(), Vec::new());
        for row in rows.iter().map(|row| &self.rows[*row]) {
            for (channel, reading) in self.rig.channels().iter().zip(&row.observation.readings) {
                if let Some((target, place)) = reading.as_ref().and_then(|reading| channel.position(reading)) {
                    predicted.push(state.target_at(target, &row.positions));
                    seen.push(place);
                }
            }
        }
        if self.placing().block(Block::Base).is_some() && predicted.len() > 2 {
            state.base = best_motion(&predicted, &seen) * state.base;
        }
        for (channel, sensor) in self.rig.channels().iter().enumerate() {
            let Occasion::Held { socket, target } = sensor.occasion() else { continue };
            let held =
                rows.iter().map(|row| &self.rows[*row]).filter(|row| row.observation.readings[channel].is_some());
            if let Some(mean) = mean(held.map(|row| state.target_at(target, &row.positions))) {
                state.sockets[socket] = mean;
            }
        }
        state
    }
}
