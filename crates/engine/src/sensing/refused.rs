//! Observations as readings of a measurement model, and why one is refused.

use nalgebra::Point3;

use super::{MeasurementModel, Observation, UnusableNoise, present};
use crate::numeric_range::is_usable;

/// Why an observation was refused. Nothing was changed by it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The number of positions is not the number of joints.
    #[error("{found} joint positions were given; this robot has {wanted} joints")]
    Joints {
        /// Positions given.
        found: usize,
        /// Joints.
        wanted: usize,
    },
    /// A joint position that is no finite number.
    #[error("the position of joint {joint} (counted from 0) is {value}, not a number from -1e12 to 1e12")]
    Position {
        /// The joint.
        joint: usize,
        /// The number given.
        value: f64,
    },
    /// The number of readings is not the number of channels.
    #[error("{found} readings were given; there are {wanted} channels (write none where a channel saw nothing)")]
    Channels {
        /// Readings given.
        found: usize,
        /// Channels.
        wanted: usize,
    },
    /// A reading of the wrong length.
    #[error("the reading of channel {channel} (counted from 0) has {found} numbers instead of {wanted}")]
    Length {
        /// The channel.
        channel: usize,
        /// Numbers given.
        found: usize,
        /// Numbers of its readings.
        wanted: usize,
    },
    /// A channel's noise cannot be divided by.
    #[error("nothing can be learned from these sensors: {0}")]
    Noise(#[from] UnusableNoise),
    /// A reading is so far from its prediction that the distance is not finite.
    #[error("the readings are too far from their prediction to compute with; check their units")]
    Absurd,
    /// A reading with too few points.
    #[error(
        "the reading of channel {channel} (counted from 0) has {found} points; with fewer than {wanted} there is none"
    )]
    Points {
        /// The channel.
        channel: usize,
        /// Points that are present.
        found: usize,
        /// The least number of points.
        wanted: usize,
    },
    /// A point of which one number is there and one is absent.
    #[error(
        "in the reading of channel {channel} (counted from 0) half of point {point} (counted from 0) is absent; give both numbers or none"
    )]
    HalfPoint {
        /// The channel.
        channel: usize,
        /// The point.
        point: usize,
    },
    /// A reading that is no finite number.
    #[error("the reading of channel {channel} (counted from 0) is {value}, not a number from -1e12 to 1e12")]
    Reading {
        /// The channel.
        channel: usize,
        /// The number given.
        value: f64,
    },
}

impl Observation {
    /// The measured position of the marker, where a channel of `measurement_model` measured it, metres.
    pub fn marker(&self, measurement_model: &MeasurementModel) -> Option<Point3<f64>> {
        let reading = self.readings.get(measurement_model.marker_channel()?)?.as_ref()?;
        Some(Point3::new(*reading.first()?, *reading.get(1)?, *reading.get(2)?))
    }

    /// The measured position of a target, metres, from the first channel of `measurement_model` whose reading gives it.
    pub fn position(&self, measurement_model: &MeasurementModel, target: usize) -> Option<Point3<f64>> {
        let mut positions = measurement_model
            .sensors()
            .iter()
            .zip(&self.readings)
            .filter_map(|(sensor, reading)| sensor.subject().position(reading.as_ref()?));
        positions.find_map(|(of, position)| (of == target).then_some(position))
    }

    /// Checks that `measurement_model` can give this observation after a movement of so many `joints` to `positions` (rad or m).
    ///
    /// # Errors
    ///
    /// [`Refused::Joints`], [`Refused::Channels`] or [`Refused::Length`] if a count does not fit; [`Refused::Position`]
    /// or [`Refused::Reading`] if a number is not finite or too large to compute with; [`Refused::HalfPoint`] or [`Refused::Points`] if
    /// the points of a target that is partly seen are not whole or too few.
    pub fn check(&self, measurement_model: &MeasurementModel, joints: usize, positions: &[f64]) -> Result<(), Refused> {
        if positions.len() != joints {
            return Err(Refused::Joints { found: positions.len(), wanted: joints });
        }
        if let Some((joint, value)) = positions.iter().enumerate().find(|(_, value)| !is_usable(**value)) {
            return Err(Refused::Position { joint, value: *value });
        }
        let wanted = measurement_model.sensors().len();
        if self.readings.len() != wanted {
            return Err(Refused::Channels { found: self.readings.len(), wanted });
        }
        for (channel, (sensor, reading)) in measurement_model.sensors().iter().zip(&self.readings).enumerate() {
            let Some(reading) = reading else { continue };
            if reading.len() != sensor.equations() {
                return Err(Refused::Length { channel, found: reading.len(), wanted: sensor.equations() });
            }
            let least = sensor.subject().least_points;
            let is_absent = |value: &f64| least.is_some() && value.is_nan();
            if let Some(value) = reading.iter().find(|value| !is_usable(**value) && !is_absent(value)) {
                return Err(Refused::Reading { channel, value: *value });
            }
            let Some(wanted) = least else { continue };
            if let Some(point) = reading.chunks(2).position(|point| present(point) == 1) {
                return Err(Refused::HalfPoint { channel, point });
            }
            let found = present(reading) / 2;
            if found < wanted {
                return Err(Refused::Points { channel, found, wanted });
            }
        }
        Ok(())
    }
}
