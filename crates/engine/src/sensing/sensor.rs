//! A channel with its noise.

use std::{ops::Range, sync::Arc};

use super::{Channel, NoiseModel, Subject, UnfitNoise, UnusableNoise};
use crate::{
    model::{KinematicData, Whitening},
    numeric_range::is_positive,
};

/// A channel and the noise of its readings. What it hands out is whitened by L⁻¹, where the covariance of the noise is L Lᵀ:
/// behind it R = I.
#[derive(Clone, Debug)]
pub struct Sensor {
    channel: Arc<dyn Channel>,
    /// What the channel says that its readings are about.
    subject: Arc<Subject>,
    equations: usize,
    noise: NoiseModel,
}

impl Sensor {
    /// A channel whose readings have this noise.
    ///
    /// # Errors
    ///
    /// [`UnfitNoise`] if the noise is that of readings of other sizes. Whether its numbers are usable is checked when a
    /// [`MeasurementModel`](super::MeasurementModel) is made.
    pub fn new(channel: impl Channel + 'static, noise: NoiseModel) -> Result<Self, UnfitNoise> {
        let subject = channel.subject();
        let noise = noise.fitted(&subject)?;
        Ok(Self::of(channel, subject, noise))
    }

    /// A channel with noise of one σ in all equations, each in its own unit.
    pub fn even(channel: impl Channel + 'static, sigma: f64) -> Self {
        let subject = channel.subject();
        let noise = NoiseModel::sigma(sigma).in_all(subject.parts.len());
        Self::of(channel, subject, noise)
    }

    fn of(channel: impl Channel + 'static, subject: Subject, noise: NoiseModel) -> Self {
        Self { channel: Arc::new(channel), equations: subject.equations(), subject: Arc::new(subject), noise }
    }

    /// This sensor with another noise.
    ///
    /// # Errors
    ///
    /// [`UnfitNoise`] as [`new`](Self::new).
    pub fn with_noise(&self, noise: NoiseModel) -> Result<Self, UnfitNoise> {
        Ok(Self { noise: noise.fitted(&self.subject)?, ..self.clone() })
    }

    /// What is measured.
    pub fn channel(&self) -> &Arc<dyn Channel> {
        &self.channel
    }

    /// What a reading is about.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// d, the number of equations of a reading: as many as it has numbers.
    pub fn equations(&self) -> usize {
        self.equations
    }

    /// σ of the first kind of noise, in its unit; √(tr Σ/d) of a full covariance.
    pub fn sigma(&self) -> f64 {
        self.noise.sigmas()[0]
    }

    /// σ of the noise of an equation, and its unit.
    pub fn nominal(&self, equation: usize) -> (f64, &'static str) {
        let mut kinds = self.kinds().into_iter().zip(self.sigmas());
        let sigma = kinds.find(|(kind, _)| kind.contains(&equation)).map_or(self.sigma(), |(_, sigma)| *sigma);
        let part = self.subject.places().find(|(_, place)| place.contains(&equation)).map(|(part, _)| part);
        (sigma, part.or(self.subject.parts.last()).map_or("", |part| part.unit()))
    }

    /// σ of each kind of noise.
    pub(super) fn sigmas(&self) -> &[f64] {
        self.noise.sigmas()
    }

    /// The equations of each kind of noise, whose scales can be learned one by one.
    pub fn kinds(&self) -> Vec<Range<usize>> {
        self.noise.kinds(&self.subject)
    }

    /// This sensor with another σ, and its other noises in proportion.
    #[must_use]
    pub fn with_sigma(&self, sigma: f64) -> Self {
        Self { noise: self.noise.with_sigma(sigma), ..self.clone() }
    }

    /// This sensor with each kind of noise multiplied by its factor.
    #[must_use]
    pub fn scaled(&self, factors: &[f64]) -> Self {
        Self { noise: self.noise.scaled(factors), ..self.clone() }
    }

    /// Writes L⁻¹ (y ⊖ h), the whitened residual between two readings (d numbers).
    #[inline]
    pub fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]) {
        self.channel.difference(y, h, whitened);
        self.noise.whiten(&self.subject.parts, whitened);
    }

    /// Writes the [extended](Channel::extended) prediction and L⁻¹ ∂h/∂δ, transposed, as [`Channel::rows`] does; false where
    /// there is none, and the rows then stay zero.
    #[inline]
    pub fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let is_predicted = self.channel.rows(data, reading, rows);
        if is_predicted {
            self.noise.whiten_rows(&self.subject, reading, rows);
        }
        is_predicted
    }

    /// Adds noise to a noise-free `reading`: y = h ⊕ L v, with v standard normal (d numbers).
    pub fn disturb(&self, reading: &mut [f64], v: &[f64]) {
        self.channel.add(reading, &self.noise.coloured(&self.subject.parts, v));
    }

    /// The target and L⁻¹ of the noise, if a reading is the three coordinates of the target's origin in the frame of the
    /// measurements; `None` for any other reading.
    pub fn point(&self) -> Option<(usize, Whitening)> {
        Some((self.subject.point()?, self.noise.whitening()))
    }
}

/// The first σ by which readings cannot be divided.
pub(super) fn unusable(sensors: &[Sensor]) -> Option<UnusableNoise> {
    sensors.iter().enumerate().find_map(|(channel, sensor)| {
        let (kind, sigma) = sensor.kinds().into_iter().zip(sensor.sigmas()).find(|(_, sigma)| !is_positive(**sigma))?;
        let (equation, unit) = (kind.start, sensor.nominal(kind.start).1);
        Some(UnusableNoise { channel, equation, sigma: *sigma, unit })
    })
}
