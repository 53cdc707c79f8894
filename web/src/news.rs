//! The news that is read out when something happens. Only a few events are: to those who hear the panel, silence is as
//! important as words.

use crate::{history::Verdict, panel::Panel};

impl Panel {
    /// The news since the last call.
    pub(crate) fn news(&mut self) -> Option<String> {
        let phase = self.phase();
        let session = self.session.as_ref().map(|session| session.id.clone()).unwrap_or_default();
        let opened = session != self.told.session && matches!(phase, "ready" | "stopped" | "playing");
        let changed = phase != self.told.phase;
        let mut news: Vec<String> = Vec::new();
        let fresh = self.notices.iter().filter(|notice| !self.told.notices.contains(notice));
        news.extend(fresh.cloned());
        if opened {
            news.extend(self.opened());
            self.told.ended = self.endings();
        }
        match phase {
            _ if !changed => {}
            "stopped" | "lost" | "expired" | "failed" => news.push(self.status()),
            "playing" => news.push("Playing.".to_owned()),
            "ready" if self.told.phase == "playing" => news.push(format!("Paused at step {}.", self.cursor)),
            _ => {}
        }
        if phase == "ready" && !changed && !opened && self.cursor != self.told.step {
            news.push(format!("Step {}.", self.cursor));
        }
        // While the run is computed again, everything happens at once and has happened before.
        if !opened && phase != "loading" && session == self.told.session {
            let ended = self.endings();
            for (learner, _) in
                ended.iter().zip(&self.told.ended).enumerate().filter(|(_, (now, then))| **now && !**then)
            {
                news.extend(self.end_of(learner));
            }
            self.told.ended = ended;
        }
        self.told.notices.clone_from(&self.notices);
        (self.told.phase, self.told.step) = (phase, self.cursor);
        if opened {
            self.told.session = session;
        }
        (!news.is_empty()).then(|| news.join(" "))
    }

    fn opened(&self) -> Option<String> {
        let description = self.description()?;
        let names: Vec<&str> = description.learners.iter().map(|learner| learner.name.as_str()).collect();
        let (scenario, seed) = (&description.scenario, description.seed);
        Some(format!("Opened {scenario}, seed {seed}, comparing {}, at step {}.", names.join(", "), self.cursor))
    }

    /// For each learner, whether it has learned the arm, has settled or has diverged by the latest step.
    fn endings(&self) -> Vec<bool> {
        let (latest, learners) = (self.history.latest(), self.description().map_or(0, |one| one.learners.len()));
        let ended = |learner| {
            let verdict = self.history.verdict(latest, learner);
            matches!(verdict, Verdict::Converged(_) | Verdict::Settled | Verdict::Diverged)
        };
        (0..learners).map(ended).collect()
    }

    fn end_of(&self, learner: usize) -> Option<String> {
        let name = &self.description()?.learners.get(learner)?.name;
        Some(match self.history.verdict(self.history.latest(), learner) {
            Verdict::Converged(step) => format!("{name} has learned the arm by movement {step}."),
            Verdict::Settled => format!("{name} is sure of itself."),
            _ => format!("{name} ran away."),
        })
    }
}
