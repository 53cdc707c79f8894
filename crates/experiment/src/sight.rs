//! What a movement looked like in the world in which it was made. Learners are told none of this.

use body_schema_engine::model::Links;

use super::{
    Experiment,
    outcome::{MovementOutcome, predicted_pictures},
    setting::ChannelSetting,
    world::World,
};
use body_schema_engine::{
    estimation::Belief,
    sensing::{Gaze, Sensor, present},
};

/// A reading of the latest movement beside what the estimate after the update says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The channel, counted from 0.
    pub channel: usize,
    /// ‖L⁻¹ (y ⊖ h)‖/√d, the root mean square over its d equations in standard deviations of the sensor's noise: about 1
    /// where noise is all that is left. `None` for a miss.
    pub residual_sigmas: Option<f64>,
    /// The same of each part, NaN for one that was not seen; empty for a miss.
    pub parts_sigmas: Vec<f64>,
    /// The weight that a robust loss gives its equations; `None` for an estimator without one.
    pub weight: Option<f64>,
    /// The probability that it is an outlier; `None` for an estimator whose loss knows of none.
    pub outlier_probability: Option<f64>,
}

impl Reading {
    /// From this probability on a reading is called an outlier.
    pub const OUTLIER: f64 = 0.5;
}

/// The known points of a target in the picture of a camera that a link carries: u, v of each, pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The camera, by its index among the devices.
    pub camera: usize,
    /// The index of the target.
    pub target: usize,
    /// As measured; `None` for a miss.
    pub measured: Option<Vec<f64>>,
    /// As predicted before the measurement; `None` where the estimate has a point behind the camera.
    pub predicted: Option<Vec<f64>>,
    /// Without noise, whether in view or not; `None` behind the camera, and where no truth is known.
    pub truth: Option<Vec<f64>>,
}

/// What there is of a movement's readings in a world, beside what is believed after it: by the noise of the sensors themselves,
/// or where nobody knows that, by the noise that is believed.
fn readings(world: &World, belief: &Belief, movement: &MovementOutcome, channels: &[ChannelSetting]) -> Vec<Reading> {
    let MovementOutcome { configuration, observation, weighed, .. } = movement;
    let miss = |channel| Reading {
        channel,
        residual_sigmas: None,
        parts_sigmas: Vec::new(),
        weight: None,
        outlier_probability: None,
    };
    let mut readings: Vec<Reading> = (0..observation.readings.len()).map(miss).collect();
    let measurement_model = match world {
        World::Simulated { measurement_model, .. } => measurement_model,
        World::Measured { .. } | World::External => &belief.measurement_model,
    };
    let root_mean_square = |part: &[f64]| {
        let squares = part.iter().filter(|x| !x.is_nan()).map(|x| x * x);
        (squares.sum::<f64>() / present(part) as f64).sqrt()
    };
    measurement_model.residuals(Links::new(&belief.state).at(configuration), observation, |channel, whitened| {
        let parts = channels.get(channel).map_or(1, |channel| channel.parts.len()).max(1);
        let reading = &mut readings[channel];
        reading.residual_sigmas = Some(root_mean_square(whitened));
        reading.parts_sigmas = whitened.chunks(whitened.len().div_ceil(parts)).map(root_mean_square).collect();
    });
    for report in weighed {
        if let Some(reading) = readings.get_mut(report.channel) {
            (reading.weight, reading.outlier_probability) = (Some(report.weight), report.outlier_probability);
        }
    }
    readings
}

impl Experiment {
    /// The readings of a learner's latest movement, by the number of the learner; empty where it has made none in the latest step.
    pub fn readings(&self, learner: usize) -> Vec<Reading> {
        let movement = self.latest.learners.get(learner).and_then(|outcome| outcome.movement.as_ref());
        let of = |(movement, learner): (&MovementOutcome, &super::Learner)| {
            readings(&self.world, learner.belief(), movement, &self.setting.channels)
        };
        movement.zip(self.learners.get(learner)).map(of).unwrap_or_default()
    }

    /// The pictures of cameras on links after a learner's latest movement, by the number of the learner; empty where it has made none in
    /// the latest step.
    pub fn pictures(&self, learner: usize) -> Vec<Picture> {
        let movement = self.latest.learners.get(learner).and_then(|outcome| outcome.movement.as_ref());
        let Some((movement, learner)) = movement.zip(self.learners.get(learner)) else { return Vec::new() };
        let belief = learner.belief();
        let truth = self.world.truth();
        let true_pictures =
            truth.map(|truth| predicted_pictures(&belief.measurement_model, truth, &movement.configuration));
        let picture = |(channel, sensor): (usize, &Sensor)| {
            let (camera, target) = sensor.subject().sight()?;
            belief.state.devices.get(camera)?.link?;
            Some(Picture {
                camera,
                target,
                measured: movement.observation.readings.get(channel).cloned().flatten(),
                predicted: movement.predicted_pictures.get(channel).cloned().flatten(),
                truth: true_pictures.as_ref().and_then(|pictures| pictures.get(channel)).cloned().flatten(),
            })
        };
        belief.measurement_model.sensors().iter().enumerate().filter_map(picture).collect()
    }

    /// Where the head that watches looks after a movement there: at the true marker, as far as it can turn.
    pub fn gaze(&self, configuration: &[f64]) -> Option<Gaze> {
        let (head, truth) = (self.world.head()?, self.world.truth()?);
        Some(head.gaze_at(&truth.marker_at(configuration)))
    }
}
