//! Errors that the targets of one link share.
//!
//! Where noise is learned it is mostly the model's error, of gears and links that bend, and that moves all targets of a link alike: k of
//! them in one posture tell of a parameter what one does. So the mean of their residuals, which would have a k-th of their variance if they were independent,
//! says by how much too small the covariance is that takes them to be:
//!
//! ```text
//! f² = (Σᵢ kᵢ ‖r̄ᵢ‖² + ν f₀²) / (Σᵢ (3 − kᵢ tr(H̄ᵢ P H̄ᵢᵀ)) + ν),    f₀² = 1 + (k − 1)(1 − 1/s²),    ν = 3
//! ```
//!
//! over the postures i, with r̄ᵢ and H̄ᵢ the means of the whitened residuals and rows of the kᵢ targets that were seen, and s the noise
//! found in nominal σ: what is beyond the nominal is taken to be shared while there are hardly more equations than parameters. P is
//! multiplied by f², where that is above 1 (the design effect of clusters; Kish, *Survey Sampling*, 1965, 5.4).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Vector3};

use super::Smoother;
use crate::{model::State, sensing::Observation};

/// ν.
const PRIOR_EQUATIONS: f64 = 3.0;

impl Smoother {
    /// f² at a state whose covariance is P; 1 where no link has several targets with learned noise.
    pub(super) fn shared_errors(&self, state: &State, covariance: &DMatrix<f64>) -> f64 {
        let groups = self.alike();
        if groups.is_empty() {
            return 1.0;
        }
        let layout = &self.belief.layout;
        let (mut squares, mut equations, mut expected, mut count) = (0.0, 0.0, 0.0, 0.0);
        for group in &groups {
            for seen in
                self.posterior.measurements.iter().filter_map(|seen| self.posterior.without_outliers(state, seen))
            {
                let readings = seen.observation.readings.iter().enumerate();
                let alone = readings.map(|(channel, it)| it.clone().filter(|_| group.contains(&channel))).collect();
                let alone = Observation { readings: alone };
                let found = self.belief.measurement_model.equations_of(state, layout, &seen.positions, &alone);
                let k = found.residual.len() / 3;
                if k < 2 || !found.residual.len().is_multiple_of(3) {
                    continue;
                }
                let share = 1.0 / k as f64;
                let (mut residual, mut rows) = (Vector3::zeros(), DMatrix::zeros(layout.dimension(), 3));
                for target in 0..k {
                    residual += found.residual.fixed_rows::<3>(3 * target) * share;
                    rows += found.rows.columns(3 * target, 3) * share;
                }
                squares += k as f64 * residual.norm_squared();
                equations += 3.0 - k as f64 * (covariance * &rows).dot(&rows);
            }
            let scales = self.nominal.noises().iter().zip(&self.posterior.scales);
            let scales = scales.filter(|(noise, _)| group.contains(&noise.channel)).map(|(_, scale)| scale.powi(2));
            let (sum, number) = scales.fold((0.0, 0.0), |(sum, number), square| (sum + square, number + 1.0));
            let beyond = (1.0 - number / f64::max(sum, number)).max(0.0);
            expected += 1.0 + (group.len() as f64 - 1.0) * beyond;
            count += 1.0;
        }
        let square = (squares + PRIOR_EQUATIONS * expected / count) / (equations.max(0.0) + PRIOR_EQUATIONS);
        if square.is_finite() { square.max(1.0) } else { 1.0 }
    }

    /// The channels of positions whose noise is learned, by the link that carries their targets, where there are several.
    fn alike(&self) -> Vec<Vec<usize>> {
        let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        if self.posterior.joints.is_some() {
            return Vec::new();
        }
        for (noise, unknown) in self.nominal.noises().iter().zip(&self.unknown) {
            let point = self.nominal.sensors()[noise.channel].subject().point();
            if let Some(target) = point.filter(|_| *unknown) {
                groups.entry(self.belief.state.targets[target].link).or_default().push(noise.channel);
            }
        }
        groups.into_values().filter(|channels| channels.len() > 1).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::{
        estimation::{Estimator, HypothesisSettings},
        model::{Block, Layout, Place, Prior, jacobian, random::random_arm},
        sensing::{Loss, MeasurementModel, Position, Sensor},
    };

    const SIGMA: f64 = 1e-3;
    const JOINTS: usize = 5;
    const TARGETS: usize = 3;

    /// f², and the share of the coordinates of predictions within ± 1.96 of their deviations, of three targets on one hand. In each of 12
    /// postures all err by the same `shared` and each by its `own`, in nominal σ.
    fn learned(seed: u64, [shared, own]: [f64; 2]) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut guess = random_arm(&mut rng, JOINTS);
        guess.targets = vec![guess.targets[0].clone(); TARGETS];
        for target in &mut guess.targets[1..] {
            let off = Vector3::from_fn(|_, _| rng.random_range(-0.05..0.05));
            target.place = Place::Point(target.place.origin() + off);
        }
        let blocks = (0..JOINTS).map(Block::Axis).chain([Block::Base]).chain((0..TARGETS).map(Block::Target));
        let layout = Layout::new(&guess, blocks);
        let m = layout.dimension();
        let prior = Prior::around(guess, &layout, DMatrix::from_diagonal_element(m, m, 1e-4)).expect("a prior");
        let truth = prior.draw(&layout, &mut rng);
        let measurement_model =
            MeasurementModel::new((0..TARGETS).map(|target| Sensor::even(Position { target }, SIGMA)).collect());
        let posture = |rng: &mut ChaCha8Rng| (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect::<Vec<f64>>();
        let observe = |_| {
            let theta = posture(&mut rng);
            let common: [f64; 3] = std::array::from_fn(|_| shared * rng.sample::<f64, _>(StandardNormal));
            let v: Vec<f64> =
                (0..3 * TARGETS).map(|i| common[i % 3] + own * rng.sample::<f64, _>(StandardNormal)).collect();
            (theta.clone(), measurement_model.observe(&truth, &theta, &v))
        };
        let seen: Vec<(Vec<f64>, Observation)> = (0..12).map(observe).collect();
        let settings = HypothesisSettings { kept: 2, spawned: 2 };
        let mut smoother =
            Smoother::new(prior, Arc::new(layout.clone()), Arc::new(measurement_model), settings, rng.clone())
                .with_loss(Loss::MIXTURE)
                .with_unknown_noise(vec![true; TARGETS]);
        let rows: Vec<(&[f64], &Observation)> = seen.iter().map(|(theta, it)| (theta.as_slice(), it)).collect();
        smoother.absorb_all(&rows, &[]).expect("absorbed");
        let belief = smoother.belief();
        let covariance = belief.covariance.as_ref().expect("one");
        let (mut within, mut count) = (0.0, 0.0);
        for _ in 0..40 {
            let theta = posture(&mut rng);
            let (found, h) = jacobian(&belief.state, &layout, &theta);
            let (off, spread) = (found - truth.marker_at(&theta), &h * covariance * h.transpose());
            for k in 0..3 {
                within += f64::from(u8::from(off[k].abs() <= 1.96 * spread[(k, k)].sqrt()));
                count += 1.0;
            }
        }
        (smoother.shared, within / count)
    }

    fn over_seeds(noise: [f64; 2]) -> (f64, f64) {
        let (mut factor, mut within) = (0.0, 0.0);
        let seeds = 1001..1061;
        let count = seeds.clone().count() as f64;
        for (of, share) in seeds.map(|seed| learned(seed, noise)) {
            factor += of / count;
            within += share / count;
        }
        (factor, within)
    }

    /// What errs together is not counted as often as there are targets.
    #[test]
    fn targets_that_err_together_tell_what_one_does() {
        let (factor, within) = over_seeds([3.0, 1.0]);
        assert!(factor > 1.8 && (0.88..=0.98).contains(&within), "{factor:.3} {within:.3}");
    }

    /// What errs independently counts as often as there are targets.
    #[test]
    fn independent_targets_tell_more() {
        let (factor, within) = over_seeds([0.0, 3.0]);
        assert!(factor < 1.5 && (0.90..=0.98).contains(&within), "{factor:.3} {within:.3}");
    }
}
