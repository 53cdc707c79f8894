//! What is worth saying of a learner in words: what its numbers rest on, and what they leave open.

use super::{Experiment, Metrics, Setting, World, gauge::Gauge, learner::Learner};
use body_schema_engine::{
    estimation::{Misfit, MisfitCause, NoiseReport, ReadingReport},
    kinematics::JointKind,
    sensing::InView,
};

/// Movements listed at most.
const LISTED: usize = 8;
/// A scale of the noise nearer to 1 than this is as promised.
const AS_PROMISED: f64 = 0.2;

impl Experiment {
    /// What is to be said of a learner in words, by its number; nothing of one that there is not.
    pub fn remarks(&self, learner: usize) -> Vec<String> {
        let outcome = self.latest.learners.get(learner);
        let said = outcome.zip(self.learners.get(learner));
        said.map(|(outcome, learner)| remarks(learner, &outcome.metrics, &self.setting, &self.world))
            .unwrap_or_default()
    }
}

/// All remarks on a learner.
fn remarks(learner: &Learner, metrics: &Metrics, setting: &Setting, world: &World) -> Vec<String> {
    let mut said = Vec::new();
    said.extend(undetermined(learner, setting, world));
    said.extend(learner.noise().iter().filter_map(noise));
    said.extend(joint_noise(learner));
    said.extend(metrics.model_error_m.filter(|error| *error > 0.0).map(model_error));
    said.extend(outliers(&learner.readings()));
    said.extend(learner.agent().misfit().map(misfit));
    let alarms = metrics.changes_noticed;
    if alarms > 0 && matches!(world, World::Measured { .. }) {
        said.push(format!(
            "{alarms} {}: what was measured no longer fitted what had been learned. A recorded body does not change, so nothing was \
             dropped; look for outliers, or for errors that the model cannot explain",
            if alarms == 1 { "alarm" } else { "alarms" }
        ));
    }
    said
}

fn undetermined(learner: &Learner, setting: &Setting, world: &World) -> Vec<String> {
    let belief = learner.belief();
    // Where the truth is known, it says what is in view.
    let (state, view) = match world.truth() {
        Some(truth) => (truth, InView::By(world.head())),
        None => (&belief.state, InView::Unknown),
    };
    let gauge = Gauge::new(state, &belief.layout, &belief.measurement_model, view, learner.limits());
    setting.called().undetermined(&belief.state, &belief.layout, &gauge.free(&belief.state), "any movement")
}

fn misfit(misfit: Misfit) -> String {
    let since = misfit.since;
    match misfit.cause {
        MisfitCause::ChangedBody => {
            format!(
                "the body may have changed: what was measured since movement {since} fits badly; more movements will tell"
            )
        }
        MisfitCause::Outliers => {
            format!(
                "since movement {since} more readings are outliers than are to be expected: look at sensor and target"
            )
        }
        MisfitCause::Unexplained => {
            format!(
                "what was measured since movement {since} is explained by nothing that is learned: the description does not hold"
            )
        }
    }
}

fn noise(noise: &NoiseReport) -> Option<String> {
    let NoiseReport { channel, scale, .. } = noise;
    ((scale - 1.0).abs() > AS_PROMISED)
        .then(|| format!("what channel {channel} measures scatters {scale:.2} times as much as its σ says"))
}

/// How far joints stand beside what they read, where that is learned: the largest of each kind.
fn joint_noise(learner: &Learner) -> Option<String> {
    let sigmas = learner.reading_sigmas();
    let joints = &learner.belief().state.joints;
    let largest = |kind: JointKind| {
        let of_kind = joints.iter().zip(&sigmas).filter(|(joint, _)| joint.kind() == kind);
        of_kind.map(|(_, sigma)| *sigma).reduce(f64::max)
    };
    let turning = largest(JointKind::Revolute).map(|sigma| format!("{:.2} deg", sigma.to_degrees()));
    let sliding = largest(JointKind::Prismatic).map(|sigma| format!("{:.2} mm", sigma * 1e3));
    let said: Vec<String> = turning.into_iter().chain(sliding).collect();
    (!said.is_empty())
        .then(|| format!("joints stand beside what they read by {} (standard deviation, learned)", said.join(" and ")))
}

fn model_error(error_m: f64) -> String {
    format!(
        "the hand is off by {:.2} mm (rms) that no parameter explains; they are part of the error that it expects",
        error_m * 1e3
    )
}

fn outliers(readings: &[ReadingReport]) -> Option<String> {
    let suspected: Vec<u64> =
        readings.iter().filter(|reading| reading.weight < 0.5).map(|reading| reading.movement).collect();
    if suspected.is_empty() {
        return None;
    }
    let listed: Vec<String> = suspected.iter().take(LISTED).map(u64::to_string).collect();
    let more = if suspected.len() > LISTED { ", …" } else { "" };
    Some(format!(
        "{} of {} readings are likelier outliers than not, after the movements {}{more}",
        suspected.len(),
        readings.len(),
        listed.join(", ")
    ))
}
