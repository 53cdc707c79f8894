//! Asking why a movement was chosen, and what another would have taught.

use crate::{host::Command, panel::Panel, settings::Tab};

/// The least time between requests for the search while steps are made, s.
const ASK_EVERY: f64 = 0.5;

impl Panel {
    /// The learner whose choice is explained.
    pub fn explained(&self) -> Option<&str> {
        let learners = &self.description()?.learners;
        let chosen = self.settings.learner.as_ref().and_then(|name| learners.iter().find(|one| one.name == *name));
        let active = || learners.iter().find(|one| one.policy.starts_with("active"));
        Some(&chosen.or_else(active)?.name)
    }

    /// Asks how the latest movement was chosen, if that is shown and not known yet.
    pub(crate) fn explain(&mut self, now: f64) {
        let latest = self.history.latest();
        if self.settings.tab != Tab::Why || !self.is_ready() || self.why.waiting || self.restoring.is_some() {
            return;
        }
        let (Some(learner), Some(session)) = (self.explained().map(str::to_owned), &self.session) else { return };
        let wanted = (learner.clone(), latest);
        if self.why.asked.as_ref() == Some(&wanted) || (self.playing && now - self.why.asked_at < ASK_EVERY) {
            return;
        }
        let session = session.id.clone();
        (self.why.asked, self.why.asked_at, self.why.waiting) = (Some(wanted), now, true);
        self.ask(Command::Select { session, learner });
    }

    /// Shows the best of the centres that the search has tried until an iteration, beside the arm.
    pub(crate) fn show_best(&mut self, iteration: usize) {
        let best = self.why.search.as_ref().and_then(|search| search.best(iteration));
        // One after the other: of those that come meanwhile only the last is worth showing.
        let Some(best) = best.filter(|best| !self.why.evaluating && self.why.proposed.as_ref() != Some(best)) else {
            return;
        };
        let slowly = self.why.slowly;
        self.propose(best);
        (self.why.of_search, self.why.slowly) = (true, slowly);
    }

    /// Asks what a posture of the visitor's would have taught.
    pub fn propose(&mut self, configuration: Vec<f64>) {
        let (Some(session), Some(search)) = (&self.session, &self.why.search) else { return };
        let (session, learner) = (session.id.clone(), search.choice().learner.clone());
        self.why.proposed = Some(configuration.clone());
        (self.why.evaluating, self.why.of_search, self.why.slowly) = (true, false, false);
        self.ask(Command::Evaluate { session, learner, configuration });
    }
}
