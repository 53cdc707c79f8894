//! How a session stands.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{Enough, Session};
use body_schema_experiment::Reading;

/// How a session stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Status {
    /// How many events there are.
    pub revision: u64,
    /// Observations told, the excluded ones among them.
    pub observations: u64,
    /// Those that are excluded, by number.
    pub excluded: Vec<u64>,
    /// Of those that count, how many saw nothing.
    pub not_seen: u64,
    /// Of those that count, which rather are outliers than not, as is believed now, by number.
    pub outliers: Vec<u64>,
    /// Pending suggestions of all clients.
    pub pending: u64,
    /// The mean error of predictions over the workspace that is expected now, millimetres; null without a covariance.
    pub expected_error_mm: Option<f64>,
    /// What of it no parameter explains, millimetres; null where the noise is known.
    pub model_error_mm: Option<f64>,
    /// What is wanted, millimetres.
    pub wanted_mm: f64,
    /// There once no more are needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enough: Option<Enough>,
    /// About how many more movements there are until then, if they teach as those so far did: the error that is not the model's
    /// falls with the root of their number. Null before there are half as many again as could determine the robot, and where the model's
    /// own error is more than is wanted, so that no number will do.
    pub movements_left: Option<u64>,
    /// How often the body seemed to have changed.
    pub changes_noticed: u64,
    /// Why nothing is learned any more; null as long as something is.
    pub failure: Option<String>,
}

impl Session {
    /// How it stands.
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
            model_error_mm: metrics.model_error_m.map(|metres| metres * 1e3),
            wanted_mm: self.scenario().settled_below_m * 1e3,
            enough: self.enough(),
            movements_left: self.movements_left(),
            changes_noticed: metrics.changes_noticed,
            failure: learner.failure.clone(),
        }
    }

    /// There once no more observations are needed.
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
