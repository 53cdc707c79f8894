//! The status of a session.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{Enough, Session};
use body_schema_experiment::Reading;

/// The status of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Status {
    /// The number of events.
    pub revision: u64,
    /// The number of observations received, excluded ones included.
    pub observations: u64,
    /// The excluded observations, by number.
    pub excluded: Vec<u64>,
    /// The number of counting observations that saw nothing.
    pub not_seen: u64,
    /// The counting observations that are likelier outliers than not under the present belief, by number.
    pub outliers: Vec<u64>,
    /// The number of pending suggestions of all clients.
    pub pending: u64,
    /// The expected mean error of predictions over the workspace now, millimetres; null without a covariance.
    pub expected_error_mm: Option<f64>,
    /// Whether that is after the rigid motion that fits best: nothing tells where the whole stands, and its place is a convention.
    #[serde(default)]
    pub up_to_motion: bool,
    /// The part of it that no parameter explains, millimetres; null where the noise is known.
    pub model_error_mm: Option<f64>,
    /// The wanted accuracy, millimetres.
    pub wanted_mm: f64,
    /// Present once no more observations are needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enough: Option<Enough>,
    /// The estimated number of further movements until then, if they teach as those so far did: the error other than the model's falls
    /// with the root of their number. Null before there are half as many again as could determine the robot, and where the model's own
    /// error is more than is wanted, so that no number will do.
    pub movements_left: Option<u64>,
    /// The number of times that the body seemed to have changed.
    pub changes_noticed: u64,
    /// Why nothing is learned any more; null as long as something is.
    pub failure: Option<String>,
}

impl Session {
    /// The present status.
    pub fn status(&self) -> Status {
        let learner = &self.latest().learners[0];
        let metrics = &learner.metrics;
        let readings = self.experiment().agent().map_or_else(Vec::new, |agent| agent.readings());
        let suspected =
            readings.iter().filter(|reading| reading.outlier_probability.is_some_and(|p| p > Reading::OUTLIER));
        let numbers = suspected.filter_map(|reading| {
            let index = usize::try_from(reading.movement.checked_sub(1)?).ok()?;
            self.ledger().counted.get(index).copied()
        });
        Status {
            revision: self.events().len() as u64,
            observations: self.ledger().told.len() as u64,
            excluded: self.ledger().excluded().into_iter().collect(),
            not_seen: metrics.misses,
            outliers: numbers.collect::<BTreeSet<u64>>().into_iter().collect(),
            pending: self.ledger().pending().count() as u64,
            expected_error_mm: metrics.expected_prediction_m.map(|metres| metres * 1e3),
            up_to_motion: self.scenario().robot.up_to_motion,
            model_error_mm: metrics.model_error_m.map(|metres| metres * 1e3),
            wanted_mm: self.scenario().settled_below_m * 1e3,
            enough: self.enough(),
            movements_left: self.movements_left(),
            changes_noticed: metrics.changes_noticed,
            failure: learner.failure.clone(),
        }
    }

    /// What was reached, once no more observations are needed.
    pub fn enough(&self) -> Option<Enough> {
        let metrics = &self.latest().learners[0].metrics;
        let expected = metrics.expected_prediction_m.filter(|_| metrics.settled)?;
        Some(Enough {
            expected_error_mm: expected * 1e3,
            wanted_mm: self.scenario().settled_below_m * 1e3,
            observations: metrics.movements,
        })
    }

    fn movements_left(&self) -> Option<u64> {
        if self.enough().is_some() {
            return Some(0);
        }
        let metrics = &self.latest().learners[0].metrics;
        let seen = metrics.movements - metrics.misses;
        let (wanted, floor) = (self.scenario().settled_below_m, metrics.model_error_m.unwrap_or(0.0));
        let spare = wanted * wanted - floor * floor;
        let is_determined = 2 * seen >= 3 * self.experiment().setting().movements_by_counting as u64;
        let expected = metrics.expected_prediction_m.filter(|_| is_determined && spare > 0.0)?;
        let needed = seen as f64 * (expected * expected - floor * floor).max(0.0) / spare;
        Some(((needed - seen as f64).ceil() as u64).max(1))
    }
}
