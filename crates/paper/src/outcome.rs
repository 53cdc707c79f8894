//! The outcome of an experiment, from which all tables and figures are made.

use serde::{Deserialize, Serialize};

use body_schema_engine::{optimize::HullPoint, selection::Partition};
use body_schema_wire::{Comparison, LearnerComparison};

/// The outcome of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// One comparison, or one for each value of a key.
    Trials(Vec<Trial>),
    /// The time of choosing.
    Timing(Timing),
    /// The searches of DIRECT, in both variants.
    Searches(Vec<Searched>),
}

/// One comparison over all seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The value of the swept key; null outside sweeps.
    pub value: Option<f64>,
    /// The learners, their curves thinned.
    pub comparison: Comparison,
    /// The joints that are learned.
    pub joints: Vec<LearnedJoint>,
}

/// A joint that is learned.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LearnedJoint {
    /// Its name.
    pub name: String,
    /// Its place in the chain, and in [`Curve::joints`](body_schema_wire::Curve::joints).
    pub index: usize,
}

/// The time it takes to choose one movement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Median, milliseconds.
    pub median_ms: f64,
    /// 95th percentile, milliseconds.
    pub p95_ms: f64,
    /// Evaluations of the criterion for one choice, median.
    pub evaluations: usize,
    /// The number of choices that were timed.
    pub choices: usize,
}

/// One search by DIRECT.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Searched {
    /// `direct` or `direct-l`.
    pub variant: String,
    /// The rectangles.
    pub partition: Partition,
    /// The size of each, as the variant measures it.
    pub sizes: Vec<f64>,
    /// The lower right convex hull.
    pub hull: Vec<HullPoint>,
    /// Names and limits (rad) of the joints, one per side.
    pub joints: Vec<(String, [f64; 2])>,
}

impl Outcome {
    /// The comparisons; none for other outcomes.
    pub fn trials(&self) -> &[Trial] {
        match self {
            Self::Trials(trials) => trials,
            _ => &[],
        }
    }

    /// A learner of the first comparison.
    pub fn learner(&self, name: &str) -> Option<&LearnerComparison> {
        self.trials().first()?.comparison.learners.iter().find(|learner| learner.name == name)
    }

    /// The learned joints; none for outcomes other than comparisons.
    pub fn joints(&self) -> &[LearnedJoint] {
        self.trials().first().map_or(&[], |trial| &trial.joints)
    }
}

/// Whether curves keep the point after `movements`: all at first, then every fiftieth part of the way.
pub fn is_kept(movements: u64, last: u64) -> bool {
    const DENSE: u64 = 50;
    if movements <= DENSE || movements == last || movements.is_multiple_of(100) {
        return true;
    }
    let place = |movements: u64| ((movements as f64 / DENSE as f64).ln() / 1.02_f64.ln()).floor();
    place(movements) > place(movements - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_curves_keep_both_ends_and_stay_even_on_a_log_axis() {
        let kept: Vec<u64> = (0..=2000).filter(|movements| is_kept(*movements, 2000)).collect();
        assert_eq!((kept[0], kept[kept.len() - 1]), (0, 2000));
        assert!((150..300).contains(&kept.len()), "{}", kept.len());
        assert!(kept.windows(2).all(|pair| pair[1] - pair[0] <= 1 + pair[0] / 40));
    }
}
