//! The observation of a movement.

use nalgebra::Point3;

/// The readings of one movement, one entry per channel of its [`MeasurementModel`](super::MeasurementModel); `None` where the channel had none. In the picture of a target that
/// is partly seen both numbers of an absent point are NaN.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Observation {
    /// The readings in the order of the measurement model's channels, each in its channel's own units.
    pub readings: Vec<Option<Vec<f64>>>,
}

impl Observation {
    /// An observation with one reading, of the only channel.
    pub fn of(reading: impl Into<Vec<f64>>) -> Self {
        Self { readings: vec![Some(reading.into())] }
    }

    /// A position of the marker seen by the only channel, metres.
    pub fn seen(position: Point3<f64>) -> Self {
        Self::of(position.coords.as_slice())
    }

    /// An observation without a reading from any of `channels`. The movement counts all the same.
    pub fn missed(channels: usize) -> Self {
        Self { readings: vec![None; channels] }
    }

    /// Whether no channel had a reading.
    pub fn is_miss(&self) -> bool {
        self.readings.iter().all(Option::is_none)
    }

    /// The number of its equations: of the numbers that are not absent.
    pub fn equations(&self) -> usize {
        self.readings.iter().flatten().map(|reading| present(reading)).sum()
    }

    /// The number of its numbers, absent ones included.
    pub fn numbers(&self) -> usize {
        self.readings.iter().flatten().map(Vec::len).sum()
    }
}

/// The number of numbers of a reading that are present: an absent one is NaN.
pub fn present(reading: &[f64]) -> usize {
    reading.iter().filter(|x| !x.is_nan()).count()
}
