//! One fit: a layout and the rows that it is learned from.

use std::sync::{Arc, PoisonError};

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};

use super::{CalibrationError, Case};
use body_schema_engine::{
    estimation::{Belief, Estimator, HypothesisSettings, NoiseFit, ReadingReport, Smoother},
    model::{Block, ChainPrior, Layout, Prior, Scales, State, best_motion},
    most,
    sensing::{Loss, Noise, Occasion},
};
use body_schema_experiment::Stream;
use body_schema_scenario::Known;

/// The fit of some rows.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The state, with its covariance.
    pub belief: Belief,
    /// The report on every reading: `movement` counts the rows that it was learned from, from 1.
    pub readings: Vec<ReadingReport>,
    /// The quality of the fit, by kind of noise.
    pub noise: Vec<NoiseFit>,
    /// The learned standard deviation of each joint's readings, rad or m; empty if it was not learned.
    pub reading_sigmas: Vec<f64>,
    /// The rows that it was learned from.
    pub rows: Vec<usize>,
    /// The factors by which errors along the chain were found to be larger than the prior states, where the robot is
    /// described.
    pub scales: Option<Scales>,
}

impl Fit {
    /// The learned state.
    pub fn state(&self) -> &State {
        &self.belief.state
    }

    /// For each row that it was learned from, the probability that one of its readings is an outlier; empty where
    /// outliers are not looked for.
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

    /// The rows that are likelier outliers than not, with that probability.
    pub fn suspected(&self) -> Vec<(usize, f64)> {
        self.outliers().into_iter().filter(|(_, probability)| *probability > 0.5).collect()
    }
}

/// The seed of the search; fits of one table differ only in rows and layout.
const SEED: u64 = 1;

impl Case<'_> {
    /// Fits the parameters of `layout` to `rows`, searching from a state `near` the solution; without one the search goes
    /// wherever the prior allows.
    ///
    /// A fit that takes most rows for outliers has explained nothing: of few rows all may be taken for that, and what is learned stays where
    /// it was guessed. Then the rows are fitted by least squares first, and from there again; what explains more rows counts, and least
    /// squares where neither explains any.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Prior`] if the prior is not positive definite, [`CalibrationError::Estimation`] if the search does
    /// not end at a minimum.
    pub fn fit(&self, layout: &Layout, rows: &[usize], near: Option<&State>) -> Result<Fit, CalibrationError> {
        let fit = self.fitted(layout, rows, near, None, self.loss)?;
        let is_plausible = |fit: &Fit| 2 * fit.suspected().len() <= rows.len();
        if is_plausible(&fit) {
            return Ok(fit);
        }
        let squares = self.fitted(layout, rows, near, None, Loss::None)?;
        let again = self.fitted(layout, rows, near, Some(squares.state()), self.loss)?;
        // Most rows may truly be wrong, where some are explained.
        let explained = |fit: &Fit| rows.len() - fit.suspected().len();
        let best = if explained(&again) > explained(&fit) { again } else { fit };
        Ok(if explained(&best) > 0 { best } else { squares })
    }

    /// Fits by a loss, from `start` if there is one.
    fn fitted(
        &self,
        layout: &Layout,
        rows: &[usize],
        near: Option<&State>,
        start: Option<&State>,
        loss: Loss,
    ) -> Result<Fit, CalibrationError> {
        let mut smoother = self.smoother(layout, near)?.with_loss(loss);
        let movements: Vec<_> = rows.iter().map(|row| &self.rows[*row]).collect();
        let movements: Vec<_> = movements.iter().map(|row| (row.positions.as_slice(), &row.observation)).collect();
        let starts = match start.or(near) {
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
            reading_sigmas: smoother.reading_sigmas(),
            rows: rows.to_vec(),
            scales: smoother.scales().cloned(),
        })
    }

    /// Fits base, targets, cameras and sockets to `rows`, with the chain as described. Its joints bear the loads of the target at
    /// its fitted place, and fits near this one use the same loads.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Prior`] if the prior is not positive definite, [`CalibrationError::Estimation`] if the search does not
    /// end at a minimum.
    pub fn nominal(&self, rows: &[usize]) -> Result<Fit, CalibrationError> {
        let mut fit = self.fit(&self.placing(), rows, None)?;
        fit.belief.state.loads = Some(self.scenario.robot.loads(fit.state()));
        Ok(fit)
    }

    fn smoother(&self, layout: &Layout, near: Option<&State>) -> Result<Smoother, CalibrationError> {
        let chain = self.chain(layout);
        let covariance = match &chain {
            Some(chain) => chain.covariance(&chain.stated()),
            None => DMatrix::from_diagonal(&self.deviations(layout).map(|sd| sd * sd)),
        };
        let within = |block: Block| match self.scenario.prior.of(block) {
            Some(Known::Anywhere { within_m }) => Some(within_m),
            _ => None,
        };
        let mut guess = self.guess().clone();
        if let Some(near) = near {
            guess.loads.clone_from(&near.loads);
        }
        let prior = Prior::new(guess, layout, covariance, within)?;
        let given = self.scenario.smoother.hypotheses;
        let settings = HypothesisSettings { spawned: if near.is_none() { given.spawned } else { 0 }, ..given };
        // What is known of the equipment is known as well as the file says: there is one reading of it.
        let is_unknown = |noise: &Noise| {
            self.scenario.smoother.noise_unknown
                && self.measurement_model.sensors()[noise.channel].subject().occasion != Occasion::Beforehand
        };
        let unknown = self.measurement_model.noises().iter().map(is_unknown).collect();
        let rng = Stream::Hypotheses.rng(SEED);
        let smoother = Smoother::new(prior, Arc::new(layout.clone()), self.measurement_model.clone(), settings, rng)
            .with_unknown_noise(unknown)
            .with_unknown_joint_noise(self.scenario.smoother.joints_unknown)
            .never_forgetting();
        let smoother = match chain {
            Some(chain) => smoother.with_chain(chain),
            None => smoother,
        };
        Ok(match self.known {
            Some(known) => smoother.with_prior_observation(known.clone()),
            None => smoother,
        })
    }

    /// The prior's standard deviations, as stated.
    pub(super) fn deviations(&self, layout: &Layout) -> DVector<f64> {
        self.chain(layout).map_or_else(|| self.scenario.prior.standard_deviations(layout), |chain| chain.deviations())
    }

    /// The prior along the chain of a described robot, shared by all fits of a layout.
    pub(super) fn chain(&self, layout: &Layout) -> Option<Arc<ChainPrior>> {
        let mut known = self.chains.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, chain)) = known.iter().find(|(of, _)| of == layout) {
            return chain.clone();
        }
        let chain = self.scenario.chain_prior(self.guess(), layout).map(Arc::new);
        known.push((layout.clone(), chain.clone()));
        chain
    }

    /// The guess with its base moved by the best rigid motion to the targets seen in `rows`, and with sockets at the mean
    /// of the targets that they held.
    fn placed(&self, rows: &[usize]) -> State {
        let mut state = self.guess().clone();
        let (mut predicted, mut seen) = (Vec::new(), Vec::new());
        for row in rows.iter().map(|row| &self.rows[*row]) {
            for (sensor, reading) in self.measurement_model.sensors().iter().zip(&row.observation.readings) {
                if let Some((target, place)) = reading.as_ref().and_then(|reading| sensor.subject().position(reading)) {
                    predicted.push(state.target_at(target, &row.positions));
                    seen.push(place);
                }
            }
        }
        if self.placing().block(Block::Base).is_some() && predicted.len() > 2 {
            state.base = motion_of_most(&predicted, &seen) * state.base;
        }
        for (channel, sensor) in self.measurement_model.sensors().iter().enumerate() {
            let Occasion::Held { socket, target } = sensor.subject().occasion else { continue };
            let held =
                rows.iter().map(|row| &self.rows[*row]).filter(|row| row.observation.readings[channel].is_some());
            if let Some(mean) = mean(held.map(|row| state.target_at(target, &row.positions))) {
                state.sockets[socket] = mean;
            }
        }
        state
    }
}

/// A place is left out where it is so many times as far off as the middle one, in so many rounds at most.
const FAR: f64 = 5.0;
const ROUNDS: usize = 10;

/// The rigid motion that fits most of the places best, whatever the others say.
fn motion_of_most(from: &[Point3<f64>], to: &[Point3<f64>]) -> Isometry3<f64> {
    let fit = |rows: &[usize]| {
        let (from, to): (Vec<_>, Vec<_>) = rows.iter().map(|row| (from[*row], to[*row])).unzip();
        best_motion(&from, &to)
    };
    let away = |motion: &Isometry3<f64>, row: usize| (motion * from[row] - to[row]).norm();
    most::fitted(from.len(), (FAR, from.len().saturating_sub(3), ROUNDS), fit, away)
}

/// The mean of points; `None` without points.
pub fn mean(points: impl Iterator<Item = Point3<f64>>) -> Option<Point3<f64>> {
    let (sum, count) = points.fold((Vector3::zeros(), 0.0), |(sum, count), point| (sum + point.coords, count + 1.0));
    (count > 0.0).then(|| Point3::from(sum / count))
}
