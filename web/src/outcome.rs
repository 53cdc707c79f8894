//! How each learner of a run ended, and which of them did better.

use crate::history::{History, Verdict};

/// A learner is near the best where its error is at most so many times the least error that any learner ends with.
const NEAR: f64 = 1.1;

/// The outcome of a learner at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Accurate from this movement on; after a change of the body movements are counted from the change.
    After(u64),
    /// Its estimate diverged.
    Diverged,
    /// Not accurate within this many movements.
    NotWithin(u64),
    /// The error where there is no truth to judge by: over measurements held out, metres.
    HeldOut {
        /// At the end.
        last: f64,
        /// The movement from which it stayed within a tenth of the best error at the end; `None` if it did not.
        near: Option<u64>,
    },
}

impl Outcome {
    /// The rank: movements first, then the error at the end. The smaller, the better.
    pub fn rank(self) -> (f64, f64) {
        match self {
            Self::After(movements) => (movements as f64, 0.0),
            Self::HeldOut { last, near } => (near.map_or(f64::MAX, |movements| movements as f64), last),
            Self::NotWithin(_) => (f64::MAX, 0.0),
            Self::Diverged => (f64::INFINITY, 0.0),
        }
    }

    /// Whether this is the better of two.
    pub fn is_better_than(self, other: Self) -> bool {
        self.rank() < other.rank()
    }
}

impl History {
    /// How each learner stands at the latest step, by its place in the description.
    pub fn outcomes(&self, learners: usize) -> Vec<Outcome> {
        let errors: Vec<Vec<[f64; 2]>> = (0..learners).map(|learner| self.errors(learner)).collect();
        let last = |learner: usize| errors[learner].last().map_or(f64::INFINITY, |[_, error]| *error);
        let best = (0..learners).map(last).fold(f64::INFINITY, f64::min);
        let near = |learner: usize| {
            let within = errors[learner].iter().rev().take_while(|[_, error]| *error <= NEAR * best);
            within.last().map(|[step, _]| *step as u64)
        };
        let latest = self.latest();
        let begin = self.begin(latest);
        let outcome = |learner: usize| match self.verdict(latest, learner) {
            Verdict::Diverged => Outcome::Diverged,
            Verdict::Converged(first) => Outcome::After(first - begin),
            Verdict::Learning | Verdict::Settled | Verdict::Waiting => {
                Outcome::HeldOut { last: last(learner), near: near(learner) }
            }
            Verdict::Outside | Verdict::Within(..) => Outcome::NotWithin(latest - begin),
        };
        (0..learners).map(outcome).collect()
    }
}
