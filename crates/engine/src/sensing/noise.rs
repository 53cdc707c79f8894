//! Noise models: what readings are divided by. They are checked here and nowhere else, before a decomposition sees them.
//!
//! ```text
//! y = h ⊕ v,   v ~ N(0, Σ),   Σ = L Lᵀ        whitened: L⁻¹ (y ⊖ h) and L⁻¹ ∂h/∂δ
//! ```
//!
//! | model | Σ |
//! |---|---|
//! | [`NoiseModel::sigma`] | σ² I |
//! | [`NoiseModel::parts`] | σₚ² I for the equations of each [`Part`] p |
//! | [`NoiseModel::covariance`] | any that is symmetric and positive |
//!
//! An unknown scale is a factor for each kind of noise, which the smoother learns and [`MeasurementModel::scaled`](super::MeasurementModel::scaled) applies.
//!
//! *The check.* σ = 0 makes equations infinitely sharp, and a search among infinite numbers does not end. But a world without noise
//! has it, and is simulated. So a covariance is checked when its model is made, and every σ when a [`MeasurementModel`](super::MeasurementModel) is. The measurement model
//! keeps the answer for everyone who would learn by it ([`MeasurementModel::check_noise`](super::MeasurementModel::check_noise)).

use std::{ops::Range, sync::Arc};

use nalgebra::DMatrix;

use super::{Part, Subject, covariance::Shape};
use crate::{model::Whitening, numeric_range::is_positive};

/// The noise of a reading, v ~ N(0, L Lᵀ), in the reading's own units.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// σ of each kind of noise, at least one: of each part, or of all equations, where a covariance is full.
    sigmas: Vec<f64>,
    shape: Option<Arc<Shape>>,
}

/// A noise model that is none of a channel's readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnfitNoise {
    /// So many standard deviations are not one for each part.
    #[error(
        "there are {found} standard deviations for a reading of {parts} parts; give one for each part, or one for all"
    )]
    Parts {
        /// Standard deviations given.
        found: usize,
        /// Parts of a reading.
        parts: usize,
    },
    /// The covariance has another size than the reading.
    #[error("the covariance is {found} × {found}, and a reading has {equations} equations; both must be the same")]
    Covariance {
        /// Rows of the covariance.
        found: usize,
        /// Equations of a reading.
        equations: usize,
    },
    /// Points may be absent from a reading, and a full covariance is that of all of them.
    #[error(
        "points may be absent from a reading, and a full covariance is that of all of them; give standard deviations"
    )]
    Absent,
}

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

impl NoiseModel {
    /// Independent noise with one σ in all equations, each in its own unit.
    pub fn sigma(sigma: f64) -> Self {
        Self { sigmas: vec![sigma], shape: None }
    }

    /// Independent noise with a σ for each [`Part`] of a reading, in the part's unit.
    pub fn parts(sigmas: impl Into<Vec<f64>>) -> Self {
        Self { sigmas: sigmas.into(), shape: None }
    }

    /// Noise with a covariance Σ (d × d), in the units of the equations; `None` unless Σ is symmetric and positive, by more than
    /// rounding, and its standard deviations are numbers by which readings can be divided.
    pub fn covariance(covariance: &DMatrix<f64>) -> Option<Self> {
        let (sigma, shape) = Shape::of(covariance)?;
        Some(Self { sigmas: vec![sigma], shape: Some(Arc::new(shape)) })
    }

    /// This model for readings of a subject, with one σ for each kind of noise.
    pub(super) fn fitted(self, subject: &Subject) -> Result<Self, UnfitNoise> {
        let (found, parts) = (self.sigmas.len(), subject.parts.len());
        match &self.shape {
            Some(shape) if shape.equations() != subject.equations() => {
                return Err(UnfitNoise::Covariance { found: shape.equations(), equations: subject.equations() });
            }
            Some(_) if subject.least_points.is_some() => return Err(UnfitNoise::Absent),
            Some(_) => {}
            None if found == 1 => return Ok(self.in_all(parts)),
            None if found == parts && found > 0 => {}
            None => return Err(UnfitNoise::Parts { found, parts }),
        }
        Ok(self)
    }

    /// This model of one σ with the same in each of so many parts.
    pub(super) fn in_all(mut self, parts: usize) -> Self {
        self.sigmas.resize(parts.max(1), self.sigmas[0]);
        self
    }

    /// σ of each kind of noise.
    pub(super) fn sigmas(&self) -> &[f64] {
        &self.sigmas
    }

    /// The equations of each kind of noise: of each part, or all of them, where a covariance is full.
    pub(super) fn kinds(&self, subject: &Subject) -> Vec<Range<usize>> {
        if self.shape.is_some() || subject.parts.is_empty() {
            return std::iter::once(0..subject.equations()).collect();
        }
        subject.places().map(|(_, place)| place).collect()
    }

    /// This model with another σ of its first kind, and its others in proportion.
    pub(super) fn with_sigma(&self, sigma: f64) -> Self {
        let first = self.sigmas[0];
        let of = |(kind, other): (usize, &f64)| match (kind, first > 0.0, *other == 0.0) {
            (0, ..) => sigma,
            (_, true, _) => other * (sigma / first),
            // Where there is no noise, what is taken for some is the same number in every unit.
            (_, false, true) => sigma,
            (_, false, false) => *other,
        };
        Self { sigmas: self.sigmas.iter().enumerate().map(of).collect(), shape: self.shape.clone() }
    }

    /// This model with each kind of noise multiplied by its factor.
    pub(super) fn scaled(&self, factors: &[f64]) -> Self {
        let factors = factors.iter().copied().chain(std::iter::repeat(1.0));
        Self {
            sigmas: self.sigmas.iter().zip(factors).map(|(sigma, factor)| sigma * factor).collect(),
            shape: self.shape.clone(),
        }
    }

    /// Whether there is noise in every equation or in none, as in a noise-free world: noise in half of them would leave the
    /// other half infinitely sharp.
    pub(super) fn is_all_or_nothing(&self) -> bool {
        self.sigmas.iter().all(|sigma| is_positive(*sigma)) || self.sigmas.iter().all(|sigma| *sigma == 0.0)
    }

    /// Replaces a channel's rows (d columns of m numbers) by L⁻¹ ∂h/∂δ, given the predicted reading.
    #[inline]
    pub(super) fn whiten_rows(&self, subject: &Subject, reading: &[f64], rows: &mut [f64]) {
        if self.shape.is_some() {
            subject.divide_norms(reading, rows);
        }
        let divisor =
            |start: usize, sigma: f64, part: &Part| if *part == Part::Norm { reading[start] * sigma } else { sigma };
        self.divide(&subject.parts, rows, Part::is_weighed, divisor);
    }

    /// Replaces a residual (d numbers) by L⁻¹ times it.
    #[inline]
    pub(super) fn whiten(&self, parts: &[Part], residual: &mut [f64]) {
        self.divide(parts, residual, |part| part.is_weighed() && parts.len() == 1, |_, sigma, _| sigma);
    }

    /// Divides d columns of m numbers; `divisor` is that of a part, by its first equation and its σ.
    #[inline]
    fn divide(
        &self,
        parts: &[Part],
        numbers: &mut [f64],
        is_weighed: impl Fn(&Part) -> bool,
        divisor: impl Fn(usize, f64, &Part) -> f64,
    ) {
        if let Some(shape) = &self.shape {
            let weight = self.sigmas[0].recip();
            shape.divide(numbers);
            numbers.iter_mut().for_each(|x| *x *= weight);
            return;
        }
        let equations = parts.iter().map(|part| part.equations()).sum::<usize>();
        let (m, mut start) = (numbers.len() / equations.max(1), 0);
        for (part, sigma) in parts.iter().zip(&self.sigmas) {
            let end = start + part.equations();
            let own = &mut numbers[start * m..end * m];
            let divisor = divisor(start, *sigma, part);
            if is_weighed(part) {
                let weight = divisor.recip();
                own.iter_mut().for_each(|x| *x *= weight);
            } else {
                own.iter_mut().for_each(|x| *x /= divisor);
            }
            start = end;
        }
    }

    /// L v, of standard normal v (d numbers).
    pub(super) fn coloured(&self, parts: &[Part], v: &[f64]) -> Vec<f64> {
        if let Some(shape) = &self.shape {
            let mut noise: Vec<f64> = v.iter().map(|v| v * self.sigmas[0]).collect();
            shape.multiply(&mut noise);
            return noise;
        }
        let sigmas =
            parts.iter().zip(&self.sigmas).flat_map(|(part, sigma)| std::iter::repeat_n(sigma, part.equations()));
        v.iter().zip(sigmas).map(|(v, sigma)| v * sigma).collect()
    }

    /// L⁻¹ of a point's three coordinates.
    pub(super) fn whitening(&self) -> Whitening {
        let weight = self.sigmas[0].recip();
        match &self.shape {
            None => Whitening::Even(weight),
            Some(shape) => Whitening::Full(shape.inverse_of_point() * weight),
        }
    }
}

impl Part {
    /// Whether its rows are multiplied by 1/σ, as the criterion does in registers, or divided by σ. The two differ by rounding
    /// alone; but a run can be repeated to the bit, and so each part keeps to one of them. A residual is multiplied where a reading
    /// is one such part.
    fn is_weighed(&self) -> bool {
        matches!(self, Self::Position | Self::Rotation | Self::Picture(_))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::{Belief, EstimationError, Estimator, HypothesisSettings, Rls, Smoother, UnscentedRls},
        model::{
            Layout, Prior,
            random::{all_blocks, random_state},
        },
        sensing::{Loss, MeasurementModel, Observation, Pose, Position, Refused, Sensor, examples},
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
            assert!(MeasurementModel::new(vec![sensor.clone()]).check_noise().is_ok());
            let noises = sensor.kinds().len();
            for (noise, bad) in (0..noises).flat_map(|noise| BAD.map(|bad| (noise, bad))) {
                let mut factors = vec![1.0; noises];
                factors[noise] = bad;
                let measurement_model = Arc::new(MeasurementModel::new(vec![sensor.scaled(&factors)]));
                let told = measurement_model.check_noise().expect_err("noise that is none");
                assert_eq!(told.channel, 0, "{told}");
                let observation = Observation::of(vec![0.1; sensor.equations()]);
                let belief = || Belief::new(state.clone(), layout.clone(), measurement_model.clone());
                let prior = Prior::around(state.clone(), &layout, DMatrix::identity(m, m) * 1e-4).expect("a prior");
                let settings = HypothesisSettings { kept: 2, spawned: 2 };
                let smoother = Smoother::new(prior, layout.clone(), measurement_model.clone(), settings, rng.clone());
                let covariance = DMatrix::identity(m, m);
                let estimators: [Box<dyn Estimator>; 3] = [
                    Box::new(Rls::new(belief(), covariance.clone(), None)),
                    Box::new(UnscentedRls::new(belief(), covariance, None)),
                    Box::new(smoother.with_loss(Loss::MIXTURE).with_unknown_noise(vec![true; noises])),
                ];
                for mut estimator in estimators {
                    let found = estimator.update(&[0.1, 0.2, 0.3], &observation);
                    let is_told = matches!(found, Err(EstimationError::Refused(Refused::Noise(_))));
                    assert!(is_told, "{sensor:?} {noise} {bad}: {found:?}");
                }
            }
        }
    }

    /// A pose has two kinds of noise, or none: and what is taken for noise where there is none has both.
    #[test]
    fn half_a_noise_is_none() {
        let is_whole = |sigmas: [f64; 2]| NoiseModel::parts(sigmas).is_all_or_nothing();
        assert!(is_whole([0.01, 0.02]) && is_whole([0.0, 0.0]));
        assert!(!is_whole([0.01, 0.0]) && !is_whole([0.0, 0.02]));
        let exact = MeasurementModel::new(vec![Sensor::even(Pose { target: 1 }, 0.0)]);
        let told = exact.check_noise().expect_err("no noise");
        assert_eq!((told.equation, told.sigma, told.unit), (0, 0.0, "m"));
        let half = Sensor::new(Pose { target: 1 }, NoiseModel::parts([0.01, 0.0])).expect("two parts");
        let told = MeasurementModel::new(vec![half]).check_noise().expect_err("half a noise");
        assert_eq!((told.equation, told.sigma, told.unit), (3, 0.0, "rad"));
        let assumed = exact.assuming(0.003);
        assert!(assumed.check_noise().is_ok(), "{assumed:?}");
    }

    /// Noise of another size than the readings is refused by name.
    #[test]
    fn noise_fits_its_readings() {
        let pose = |noise| Sensor::new(Pose { target: 1 }, noise).map(|sensor| sensor.kinds());
        assert_eq!(pose(NoiseModel::sigma(0.1)), Ok(vec![0..3, 3..6]));
        assert_eq!(pose(NoiseModel::parts([0.1; 3])), Err(UnfitNoise::Parts { found: 3, parts: 2 }));
        assert_eq!(pose(NoiseModel::parts([])), Err(UnfitNoise::Parts { found: 0, parts: 2 }));
        let covariance = |d| NoiseModel::covariance(&DMatrix::identity(d, d)).expect("positive");
        assert_eq!(pose(covariance(6)), Ok(std::iter::once(0..6).collect()));
        assert_eq!(pose(covariance(3)), Err(UnfitNoise::Covariance { found: 3, equations: 6 }));
        let sensor = Sensor::new(Position { target: 0 }, covariance(3)).expect("three equations");
        assert_eq!(sensor.point().expect("a point").1, Whitening::Full(Matrix3::identity()));
    }
}
