//! The panel in words, for screen readers and scripts.

use body_schema_wire::{Description, LearnerDescription};

use crate::{
    colours,
    history::Row,
    host::{Caption, Captioned, Command, Errors, Mirror},
    panel::{Link, Panel},
    settings::ELLIPSOIDS,
};

/// The interval at which words are renewed, s: a screen reader must be able to finish a sentence.
const SAY_EVERY: f64 = 1.0;

impl Panel {
    /// The texts of the legend under the scene, and of the caption under a picture of it.
    pub fn caption(&self) -> Caption {
        let Some(description) = self.description() else { return Caption::default() };
        let title = self.title(description);
        let slots = colours::slots(description);
        let colour = |slot: usize| {
            let [red, green, blue, _] = colours::learner(slot).to_array();
            [red, green, blue]
        };
        let seen = description.learners.iter().zip(&slots).enumerate().filter(|(index, _)| self.is_seen(*index));
        let learners = seen.map(|(index, (learner, slot))| {
            let row = self.history.row(self.cursor, index).copied().unwrap_or_default();
            let errors = [
                row.orientation_deg.map(|error| format!("{error:.1}°")),
                row.location_m.map(|error| format!("{:.0} mm", error * 1e3)),
                row.prediction_m.filter(|_| row.location_m.is_none()).map(|error| format!("{:.0} mm", error * 1e3)),
                (row.error_m().filter(|_| row.prediction_m.is_none() && row.location_m.is_none()))
                    .map(|error| format!("{:.1} mm", error * 1e3)),
            ];
            let errors: Vec<String> = errors.into_iter().flatten().collect();
            Captioned { name: learner.name.clone(), errors: errors.join(", "), colour: colour(*slot) }
        });
        let size = ELLIPSOIDS.iter().find(|(name, _)| *name == self.settings.ellipsoids).map_or("", |(_, size)| size);
        // How large those of a robot elsewhere are was chosen by whoever opened its session.
        let size = if self.is_external() { String::new() } else { format!(" ({size})") };
        let ellipsoids = format!("where a learner thinks a joint may be{size}");
        let sees =
            if description.cameras.is_empty() { "where the hand was seen" } else { "from a camera to what it saw" };
        let (truth, seen) = (description.truth.is_some(), sees.to_owned());
        let suggested = self.is_external() && self.suggestion().is_some();
        let tried = self.human().filter(|_| self.may_move()).map(|human| colour(slots[human]));
        Caption { title, learners: learners.collect(), ellipsoids, truth, seen, suggested, tried }
    }

    /// The errors of every learner at the step that is shown.
    fn errors(&self) -> Vec<Errors> {
        let learners = self.description().map_or(&[][..], |description| &description.learners);
        let of = |(index, learner): (usize, &LearnerDescription)| {
            let row = self.history.row(self.cursor, index).copied().unwrap_or_default();
            let Row { orientation_deg, location_m, prediction_m, .. } = row;
            Errors { learner: learner.name.clone(), orientation_deg, location_m, prediction_m }
        };
        learners.iter().enumerate().map(of).collect()
    }

    fn title(&self, description: &Description) -> String {
        match self.is_external() {
            true => format!("{}, observation {}", description.scenario, self.cursor),
            false => {
                let Description { scenario, set, seed, .. } = description;
                let with = if set.is_empty() { String::new() } else { format!(" with {}", set.join(", ")) };
                format!("{scenario}{with}, seed {seed}, step {}", self.cursor)
            }
        }
    }

    pub(crate) fn phase(&self) -> &'static str {
        match self.link {
            Link::Lost(_) => "lost",
            Link::Expired => "expired",
            Link::Failed(_) | Link::Unreachable(_) => "failed",
            _ if self.opening || self.link == Link::Loading || self.restoring.is_some() => "loading",
            _ if self.playing => "playing",
            _ if self.stopped.is_some() => "stopped",
            _ => "ready",
        }
    }

    fn words(&self) -> String {
        let mut text = self.status();
        let Some(description) = self.description() else { return text };
        text += &format!(" {}.", self.title(description));
        for sentence in self.robot_words() {
            text += &format!(" {sentence}");
        }
        for (index, learner) in description.learners.iter().enumerate().filter(|(index, _)| self.is_seen(*index)) {
            let Some(row) = self.history.row(self.cursor, index) else { continue };
            text += &format!(" {}: {}", learner.name, self.verdict(index));
            if let Some(error) = row.orientation_deg {
                text += &format!(", orientation {error:.1} degrees");
            }
            if let Some(error) = row.location_m {
                text += &format!(", location {:.0} millimetres", error * 1e3);
            }
            if let Some(error) = row.prediction_m {
                text += &format!(", prediction {:.0} millimetres", error * 1e3);
            } else if let Some(error) = row.scatter_m {
                text += &format!(", scatter {:.1} millimetres", error * 1e3);
            } else if let Some(error) = row.expected_m {
                text += &format!(", expected error {:.2} millimetres", error * 1e3);
            }
            text.push('.');
        }
        for notice in &self.notices {
            text += &format!(" {notice}");
        }
        text
    }

    /// Sends the state to the page when it has changed: numbers at once, words once a second.
    pub(crate) fn mirror(&mut self, now: f64) {
        let (said_at, before) = &self.said;
        let mut mirror = Mirror {
            text: before.text.clone(),
            news: before.news.clone(),
            phase: self.phase().to_owned(),
            step: self.cursor,
            latest: self.history.latest(),
            session: self.session.as_ref().map(|session| session.id.clone()).unwrap_or_default(),
            scenario: self.description().map(|description| description.scenario.clone()).unwrap_or_default(),
            seed: self.description().map(|description| description.seed).unwrap_or_default(),
            stopped: self.stopped.clone(),
            errors: self.errors(),
            typing: before.typing,
            caption: self.caption(),
        };
        let mut said_at = *said_at;
        if now - said_at >= SAY_EVERY {
            mirror.text = self.words();
            said_at = now;
        }
        if let Some(news) = self.news() {
            mirror.news = news;
        }
        if mirror != self.said.1 {
            self.ask(Command::Say(Box::new(mirror.clone())));
        }
        self.said = (said_at, mirror);
    }

    /// Notes whether keys are text at the moment.
    pub(crate) fn set_typing(&mut self, typing: bool) {
        if self.said.1.typing != typing {
            self.said.1.typing = typing;
            self.ask(Command::Say(Box::new(self.said.1.clone())));
        }
    }
}
