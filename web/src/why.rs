//! Why this posture: what was asked about the last movement, and what the server answered.

use body_schema_wire::{AppraisalReport, Choice};

use crate::{search::Search, wire::Problem};

/// The knowledge of the last search.
#[derive(Clone, Debug, Default)]
pub struct Why {
    /// The search.
    pub search: Option<Search>,
    /// Why there is none.
    pub reason: Option<String>,
    /// The iteration that is shown; `None` for the last.
    pub iteration: Option<usize>,
    /// Whether each new search is shown from its first iteration on.
    pub(crate) grows: bool,
    /// When the search that is shown began to grow.
    pub(crate) growing: Option<f64>,
    /// Whether it grows slowly, to be read along, and the best posture of what is shown is shown beside the arm.
    pub(crate) slowly: bool,
    /// What the visitor's posture would have taught.
    pub appraisal: Option<AppraisalReport>,
    /// The posture is being judged.
    pub evaluating: bool,
    /// The posture that was asked for.
    pub proposed: Option<Vec<f64>>,
    /// Whether that is the best of the search so far, and not the visitor's.
    pub of_search: bool,
    /// Learner and step that were asked for.
    pub(crate) asked: Option<(String, u64)>,
    pub(crate) asked_at: f64,
    pub(crate) waiting: bool,
}

impl Why {
    pub(crate) fn answered(&mut self, learner: &str, choice: Option<Choice>, now: f64) {
        self.waiting = false;
        let Some(search) = choice.and_then(Search::of) else {
            self.search = None;
            self.reason = Some(format!("The last movement of {learner} was not chosen by DIRECT."));
            return;
        };
        let of = |search: &Search| (search.choice().step, search.choice().learner.clone());
        if self.search.as_ref().is_none_or(|old| of(old) != of(&search)) {
            (self.appraisal, self.proposed, self.evaluating) = (None, None, false);
            (self.growing, self.slowly) = (self.grows.then_some(now), false);
        }
        self.reason = None;
        self.iteration = self.iteration.filter(|iteration| *iteration < search.last());
        self.search = Some(search);
    }

    /// The iteration to show at `now` while the search grows; `None` where it does not.
    pub(crate) fn grown(&mut self, now: f64, last: usize) -> Option<usize> {
        /// How long it takes, s; slowly, each iteration, and all of them at most.
        const GROWTH: f64 = 1.5;
        const EACH: f64 = 1.5;
        const MOST: f64 = 30.0;
        let takes = if self.slowly { (EACH * last as f64).min(MOST) } else { GROWTH };
        let share = (now - self.growing?) / takes.max(f64::MIN_POSITIVE);
        if share >= 1.0 {
            (self.growing, self.iteration) = (None, None);
            return None;
        }
        Some((share.max(0.0) * last as f64) as usize)
    }

    pub(crate) fn refused(&mut self, problem: &Problem) {
        self.waiting = false;
        self.search = None;
        self.reason = Some(format!("{}.", problem.sentence()));
    }

    pub(crate) fn appraised(&mut self, appraisal: AppraisalReport) {
        // An answer to an older question is of no use.
        if self.proposed.as_deref() == Some(&appraisal.configuration) {
            self.evaluating = false;
            self.appraisal = Some(appraisal);
        }
    }
}
