//! Absorbing many movements at once.
//!
//! A calibration has all rows before the search begins. What explains them together is searched once, and depends on no
//! order; one by one, every row would cost a search of its own. Among many rows the modes are searched with a sample of
//! them, spread evenly, and then followed to where all rows are explained.

use super::{EstimationError, Measurement, NoiseFit, Smoother, THOROUGH};
use crate::{
    elementary::ln,
    model::State,
    sensing::{Loss, Observation},
};

/// The number of movements by which modes are searched.
const SEARCHED: usize = 200;
/// The most rounds in which scales of noise are learned in turn with the modes.
const ROUNDS: usize = 12;
/// The change of a scale below which it has converged.
const FOUND: f64 = 1e-3;

impl Smoother {
    /// Absorbs movements to `positions` (rad or m) with what was observed after them, all at once. Modes are searched from
    /// `starts` beside those there are, and from as many draws as after one movement.
    ///
    /// # Errors
    ///
    /// [`EstimationError::Refused`] if a movement does not fit, [`EstimationError::Diverged`] if no mode is found; the
    /// belief then stays as it was.
    pub fn absorb_all(
        &mut self,
        movements: &[(&[f64], &Observation)],
        starts: &[State],
    ) -> Result<(), EstimationError> {
        for (positions, observation) in movements {
            self.belief.accepts(positions, observation)?;
        }
        // All or nothing: a search that finds nothing leaves no trace.
        let mut revised = self.clone();
        revised.take_in(movements, starts)?;
        *self = revised;
        Ok(())
    }

    fn take_in(&mut self, movements: &[(&[f64], &Observation)], starts: &[State]) -> Result<(), EstimationError> {
        let first = self.movements + 1;
        let measurement = |(index, (positions, observation)): (usize, &(&[f64], &Observation))| Measurement {
            positions: positions.to_vec(),
            observation: (*observation).clone(),
            movement: first + index as u64,
        };
        let seen = movements.iter().enumerate().filter(|(_, (_, observation))| !observation.is_miss());
        let all: Vec<Measurement> = seen.map(measurement).collect();
        self.movements += movements.len() as u64;
        let known = self.posterior.measurements.len();
        self.posterior.measurements.extend(spread(&all, SEARCHED).cloned());
        self.search(starts);
        if all.len() > SEARCHED {
            self.posterior.measurements.truncate(known);
            self.posterior.measurements.extend(all);
            let layout = self.belief.layout.clone();
            self.hypotheses.follow(&self.posterior, &layout);
            self.hypotheses.condense(self.settings.kept, &layout);
            self.settle_noise();
        }
        self.learn_scales();
        if self.hypotheses.modes.is_empty() {
            return Err(EstimationError::Diverged(self.hypotheses.why()));
        }
        self.publish();
        Ok(())
    }

    fn search(&mut self, starts: &[State]) {
        let layout = self.belief.layout.clone();
        let guess = [self.posterior.prior.guess().clone()];
        let given: Vec<&State> = if starts.is_empty() { guess.iter().collect() } else { starts.iter().collect() };
        let starts = self.begin_noise_from(&given);
        let found = starts.iter().map(|start| self.posterior.mode_from_afar(start, &layout, THOROUGH));
        let found: Vec<_> = found.collect();
        self.hypotheses.lost = found.iter().find_map(|mode| mode.as_ref().err().copied());
        self.hypotheses.modes = found.into_iter().flatten().collect();
        self.hypotheses.spawn(self.settings.spawned, &self.posterior, &layout, &mut self.rng);
        self.hypotheses.condense(self.settings.kept, &layout);
        self.settle_noise();
        if self.doubt_noise(&given) {
            self.hypotheses.spawn(self.settings.spawned, &self.posterior, &layout, &mut self.rng);
            self.hypotheses.condense(self.settings.kept, &layout);
            self.settle_noise();
        }
    }

    /// Begins the scales of noise: searches by least squares with the nominal noise, and takes the scales from the
    /// residuals there. No reading counts as an outlier before the scatter of normal ones is known, and the parameters'
    /// share of the residuals is no noise.
    fn begin_noise_from(&mut self, starts: &[&State]) -> Vec<State> {
        if !self.learns_noise() {
            return starts.iter().map(|start| (*start).clone()).collect();
        }
        let layout = self.belief.layout.clone();
        let loss = std::mem::replace(&mut self.posterior.loss, Loss::None);
        let modes = starts.iter().filter_map(|start| self.posterior.mode(start, &layout, THOROUGH).ok());
        self.hypotheses.modes = modes.collect();
        self.hypotheses.condense(self.settings.kept, &layout);
        self.learn_noise();
        self.posterior.loss = loss;
        self.hypotheses.modes.iter().map(|mode| mode.state.clone()).collect()
    }

    fn settle_noise(&mut self) {
        if !self.learns_noise() {
            return;
        }
        for _ in 0..ROUNDS {
            let before = self.posterior.scales.clone();
            self.learn_noise();
            let change = before.iter().zip(&self.posterior.scales).map(|(a, b)| ln(a / b).abs()).fold(0.0, f64::max);
            if change < FOUND {
                return;
            }
        }
    }

    /// How well the readings are fitted at the estimate, by kind of noise.
    pub fn fits(&self) -> Vec<NoiseFit> {
        let layout = &self.belief.layout;
        let Some(mode) = self.hypotheses.modes.first() else { return Vec::new() };
        let Some(absorbed) = self.posterior.absorbed(mode, layout) else { return Vec::new() };
        let fits = self.posterior.fit(&mode.state, layout).into_iter().zip(absorbed).zip(&self.posterior.scales);
        let of = |(((fit, absorbed), scale), noise): (((super::posterior::Fit, f64), &f64), &crate::sensing::Noise)| {
            let (squared, equations) = (fit.squared, fit.equations);
            NoiseFit {
                channel: noise.channel,
                first: noise.part.start,
                squared,
                equations,
                absorbed,
                scale: *scale,
                shared: self.shared,
            }
        };
        fits.zip(self.nominal.noises()).map(of).collect()
    }
}

/// At most `most` items of a list, spread evenly over it.
fn spread<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> {
    let count = all.len().min(most);
    (0..count).map(move |index| &all[index * all.len() / count])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, Isometry3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{Estimator, HypothesisSettings},
        model::{Block, Layout, Prior, random::random_arm},
        sensing::{Loss, MeasurementModel},
    };

    const SIGMA: f64 = 1e-3;

    /// An arm whose base stands somewhere, readings of it with a tenth of gross errors, and a smoother that is told a tenth
    /// of the noise.
    fn case(seed: u64, rows: usize) -> (State, Vec<(Vec<f64>, Observation)>, Smoother) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let guess = random_arm(&mut rng, 4);
        let layout = Layout::new(&guess, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        let mut truth = guess.clone();
        truth.base = Isometry3::new(Vector3::new(0.4, -0.2, 0.3), Vector3::new(0.2, 0.9, -0.5));
        let measurement_model = MeasurementModel::tracker(SIGMA);
        let observe = |index: usize| {
            let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
            let gross = if index % 10 == 3 { 100.0 } else { 1.0 };
            let v: Vec<f64> = (0..3).map(|_| gross * rng.sample::<f64, _>(rand_distr::StandardNormal)).collect();
            let observation = measurement_model.observe(&truth, &theta, &v);
            (theta, observation)
        };
        let seen = (0..rows).map(observe).collect();
        let deviations = layout.quantities().len();
        let mut covariance = DMatrix::from_diagonal_element(deviations, deviations, 1e-4);
        covariance.view_mut((0, 0), (6, 6)).fill_diagonal(1.0);
        let prior = Prior::around(guess, &layout, covariance).expect("a prior");
        let settings = HypothesisSettings { kept: 8, spawned: 8 };
        let smoother =
            Smoother::new(prior, Arc::new(layout), Arc::new(measurement_model.assuming(SIGMA / 10.0)), settings, rng)
                .with_loss(Loss::MIXTURE)
                .with_unknown_noise(vec![true])
                .never_forgetting();
        (truth, seen, smoother)
    }

    fn borrowed(seen: &[(Vec<f64>, Observation)]) -> Vec<(&[f64], &Observation)> {
        seen.iter().map(|(theta, observation)| (theta.as_slice(), observation)).collect()
    }

    /// The base is found from far away, the noise for what it is, and gross errors are told by name.
    #[test]
    fn rows_at_once_find_base_noise_and_outliers() {
        for (seed, rows) in [(1, 60), (2, 60), (3, 450)] {
            let (truth, seen, mut smoother) = case(seed, rows);
            smoother.absorb_all(&borrowed(&seen), &[]).expect("absorbed");
            let state = &smoother.belief().state;
            for (theta, _) in &seen {
                assert!((state.marker_at(theta) - truth.marker_at(theta)).norm() < 4.0 * SIGMA, "seed {seed}");
            }
            let scale = smoother.noise()[0].scale;
            assert!((8.0..12.5).contains(&scale), "seed {seed}: {scale}");
            let outliers =
                smoother.readings().iter().filter(|reading| reading.weight < 0.5).map(|it| it.movement).collect();
            let planted: Vec<u64> = (1..=rows as u64).filter(|movement| movement % 10 == 4).collect();
            let missed = |list: &Vec<u64>| list.iter().filter(|movement| !planted.contains(movement)).count();
            assert!(missed(&outliers) <= rows / 100, "seed {seed}: {outliers:?}");
            assert!(outliers.len() * 10 >= planted.len() * 9, "seed {seed}: {outliers:?}");
            let fit = &smoother.fits()[0];
            let degrees_of_freedom = fit.equations - fit.absorbed;
            assert!(((fit.squared / degrees_of_freedom).sqrt() / fit.scale - 1.0).abs() < 0.05, "seed {seed}: {fit:?}");
        }
    }

    /// What does not fit is refused, and nothing is changed.
    #[test]
    fn a_row_that_does_not_fit_leaves_no_trace() {
        let (_, mut seen, mut smoother) = case(4, 20);
        seen[7].0.pop();
        let before = smoother.belief().state.clone();
        assert!(smoother.absorb_all(&borrowed(&seen), &[]).is_err());
        assert_eq!(smoother.belief().state, before);
    }
}
