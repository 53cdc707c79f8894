//! The check of noise models: the one place that looks at every entry of every noise model before a decomposition does. σ = 0
//! makes equations infinitely sharp, and a search among infinite numbers does not end.

use nalgebra::Matrix3;

use super::{Channel, Rig};
use crate::magnitude::is_positive;

/// A standard deviation that readings cannot be divided by.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the noise of channel {channel} (counted from 0) is {sigma} {unit}, not a number from 1e-18 to 1e12")]
pub struct UnusableNoise {
    /// The channel.
    pub channel: usize,
    /// Its equation, counted from 0.
    pub equation: usize,
    /// σ, the deviation itself.
    pub sigma: f64,
    /// Its unit: m, rad or px.
    pub unit: &'static str,
}

/// How small σ of one coordinate may be beside the largest, and along any direction beside those of the coordinates: below, rounding
/// decides on it.
const THINNEST: f64 = 1e-6;

impl Rig {
    /// Checks that every σ is a number above 0 by which readings can be divided.
    ///
    /// # Errors
    ///
    /// [`UnusableNoise`] with the first σ that is not.
    pub fn check_noise(&self) -> Result<(), UnusableNoise> {
        for (channel, sensor) in self.channels().iter().enumerate() {
            check(channel, sensor.as_ref(), is_positive)?;
        }
        Ok(())
    }
}

/// Whether a channel has noise in every equation or in none, as in a noise-free world: noise in half of them would
/// leave the other half infinitely sharp.
pub(super) fn is_all_or_nothing(sensor: &dyn Channel) -> bool {
    check(0, sensor, is_positive).is_ok() || check(0, sensor, |sigma| sigma == 0.0).is_ok()
}

fn check(channel: usize, sensor: &dyn Channel, holds: impl Fn(f64) -> bool) -> Result<(), UnusableNoise> {
    // By σ also where no equation tells of it.
    let of_equations = (0..sensor.equations()).map(|equation| (equation, sensor.nominal(equation)));
    let all = of_equations.chain([(0, (sensor.sigma(), sensor.nominal(0).1))]);
    match all.into_iter().find(|(_, (sigma, _))| !holds(*sigma)) {
        Some((equation, (sigma, unit))) => Err(UnusableNoise { channel, equation, sigma, unit }),
        None => Ok(()),
    }
}

/// L, lower triangular, of a covariance Σ = L Lᵀ; `None` unless Σ is symmetric and positive, by more than rounding, and its standard
/// deviations are numbers by which readings can be divided.
pub(super) fn root(covariance: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let deviations = covariance.diagonal().map(f64::sqrt);
    // Of what is no number the largest says nothing.
    if !covariance.iter().all(|x| x.is_finite())
        || !deviations.iter().all(|sigma| is_positive(*sigma))
        || deviations.min() < THINNEST * deviations.max()
    {
        return None;
    }
    let scaled = covariance.component_div(&(deviations * deviations.transpose()));
    let is_symmetric = (scaled - scaled.transpose()).amax() <= 1e-9;
    let root = scaled.cholesky().filter(|_| is_symmetric)?.l();
    let is_thick = root.diagonal().iter().all(|x| *x >= THINNEST);
    is_thick.then(|| Matrix3::from_diagonal(&deviations) * root)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{Belief, EstimationError, Estimator, HypothesisSettings, Rls, Smoother, UnscentedRls},
        model::{
            Layout, Prior,
            random::{all_blocks, random_state},
        },
        sensing::{Loss, Observation, Pose, Position, Refused, examples},
    };

    const BAD: [f64; 9] = [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, 1e-30, 1e300];

    /// Of every channel, whatever its noise is made: told, and refused by everyone who would learn by it.
    #[test]
    fn no_noise_that_is_none_comes_as_far_as_an_estimate() {
        let mut rng = ChaCha8Rng::seed_from_u64(1001);
        let state = random_state(&mut rng, 3);
        let layout = Arc::new(Layout::new(&state, all_blocks(&state)));
        let m = layout.dimension();
        for sensor in examples(&mut rng, &state) {
            assert!(Rig::new(vec![sensor.clone()]).check_noise().is_ok());
            for (noise, bad) in (0..sensor.noises()).flat_map(|noise| BAD.map(|bad| (noise, bad))) {
                let mut factors = vec![1.0; sensor.noises()];
                factors[noise] = bad;
                let rig = Arc::new(Rig::new(vec![sensor.scaled(&factors)]));
                let told = rig.check_noise().expect_err("noise that is none");
                assert_eq!(told.channel, 0, "{told}");
                let observation = Observation::of(vec![0.1; sensor.equations()]);
                let belief = || Belief::new(state.clone(), layout.clone(), rig.clone());
                let prior = Prior::around(state.clone(), &layout, DMatrix::identity(m, m) * 1e-4).expect("a prior");
                let settings = HypothesisSettings { kept: 2, spawned: 2 };
                let smoother = Smoother::new(prior, layout.clone(), rig.clone(), settings, rng.clone());
                let covariance = DMatrix::identity(m, m);
                let estimators: [Box<dyn Estimator>; 3] = [
                    Box::new(Rls::new(belief(), covariance.clone(), None)),
                    Box::new(UnscentedRls::new(belief(), covariance, None)),
                    Box::new(smoother.with_loss(Loss::MIXTURE).with_unknown_noise(vec![true; sensor.noises()])),
                ];
                for mut estimator in estimators {
                    let found = estimator.update(&[0.1, 0.2, 0.3], &observation);
                    let is_told = matches!(found, Err(EstimationError::Refused(Refused::Noise(_))));
                    assert!(is_told, "{sensor:?} {noise} {bad}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn a_covariance_is_positive_or_none() {
        let sound = Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-6, 1e-12));
        let l = root(&sound).expect("positive");
        assert!((l * l.transpose() - sound).amax() < 1e-18);
        for (place, bad) in (0..9).flat_map(|place| BAD.map(|bad| (place, bad))) {
            let mut covariance = sound;
            covariance[place] = bad;
            // Beside the diagonal nothing, and next to nothing, is no correlation.
            let is_same = place % 4 != 0 && bad.abs() < 1e-20;
            assert_eq!(root(&covariance).is_some(), is_same, "{place} {bad}");
            assert_eq!(Position::with_covariance(0, &covariance).is_some(), is_same);
        }
        let flat = Matrix3::from_fn(|row, column| if row == column { 1.0 } else { 1.0 - 1e-15 });
        assert_eq!((root(&flat), root(&-sound)), (None, None));
    }

    /// A pose has two kinds of noise, or none: and what is taken for noise where there is none has both.
    #[test]
    fn half_a_noise_is_none() {
        let pose = |sigma_m, sigma_rad| Pose { target: 1, sigma_m, sigma_rad };
        assert!(is_all_or_nothing(&pose(0.01, 0.02)) && is_all_or_nothing(&pose(0.0, 0.0)));
        assert!(!is_all_or_nothing(&pose(0.01, 0.0)) && !is_all_or_nothing(&pose(0.0, 0.02)));
        let assumed = Rig::new(vec![Arc::new(pose(0.0, 0.0))]).assuming(0.003);
        assert!(assumed.check_noise().is_ok(), "{assumed:?}");
    }
}
