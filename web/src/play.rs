//! Playing: making steps, and moving among those that were made.

use body_schema_experiment::CONFIRMATION;

use crate::{
    history::Row,
    host::Command,
    panel::{Link, PREDICTION, Pace, Panel},
    settings::{MAX_SPEED, MIN_SPEED, StopWhen},
    view::in_address,
};

/// The speeds that keys select, steps a second.
pub const SPEEDS: [f64; 8] = [MIN_SPEED, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, MAX_SPEED];
/// The most steps that are made at once where drawing is slow.
const MOST_AT_ONCE: u64 = 25;
/// The number of steps that are made at once to restore a run.
const RESTORED_AT_ONCE: u64 = 50;
/// The number of movements before a change of the body at which a fast-forwarded run slows down again.
const BEFORE_CHANGE: u64 = 5;
/// How long playing waits for a step to be shown, s.
const SHOWN_WITHIN: f64 = 5.0;
/// What is said of a pace is no longer true where a movement is late by so much, s.
const LATE: f64 = 1.0;
/// The speed, steps/s, up to which the scene shows postures between steps, also for single steps; and the number of
/// these postures.
const SLOW: f64 = 4.0;
pub(crate) const FRAMES: u64 = 12;
/// The interval at which the address follows, s: browsers allow some hundred changes a minute.
const ADDRESS_EVERY: f64 = 1.0;

impl Panel {
    /// The last step of a run.
    pub fn run_to(&self) -> u64 {
        self.settings.run_to.or_else(|| self.scenario().map(|scenario| scenario.steps)).unwrap_or(1000)
    }

    /// How many steps can still be made; `None` without an end.
    pub fn remaining(&self) -> Option<u64> {
        let session = self.session.as_ref()?;
        Some((session.remaining? + session.step).saturating_sub(self.history.latest()))
    }

    /// Plays or pauses.
    pub fn toggle(&mut self) {
        self.plays_first = false;
        if self.playing { self.pause() } else { self.play() }
    }

    /// Stops making steps.
    pub fn pause(&mut self) {
        self.playing = false;
        (self.pace.until, self.pace.by_itself) = (None, false);
    }

    /// Plays up to a step, then pauses.
    pub fn play_to(&mut self, step: u64) {
        self.play();
        self.pace.until = Some(step);
        self.stop_if_due();
    }

    /// Plays until something stops it.
    pub fn play(&mut self) {
        // Who chooses the movements makes them one by one, and a robot elsewhere makes them itself.
        if !self.is_ready() || self.restoring.is_some() || self.human().is_some() || self.is_external() {
            return;
        }
        (self.stopped, self.wanted) = (None, None);
        self.cursor = self.history.latest();
        self.pace = Pace {
            asked_at: self.now - 1.0 / self.settings.speed,
            settled: self.settled().0,
            told: self.is_told(),
            until: None,
            by_itself: false,
        };
        self.playing = true;
        self.stop_if_due();
    }

    /// How many of the learners that judge themselves have settled, and how many there are.
    fn settled(&self) -> (usize, usize) {
        let learners = self.description().map_or(0, |description| description.learners.len());
        let rows = (0..learners).filter_map(|learner| self.history.row(self.history.latest(), learner));
        let judging: Vec<&Row> = rows.filter(|row| row.trace.is_some() && !row.failed).collect();
        (judging.iter().filter(|row| row.settled).count(), judging.len())
    }

    /// The goal of fast-forwarding, until which nothing new is to be seen: the last learner that has not learned the
    /// arm, or the change of the body.
    pub fn fast_forward(&self) -> Option<String> {
        /// The number of movements without news that is enough.
        const QUIET: u64 = 100;
        let due = self.playing && self.settings.stop == StopWhen::Told && !self.pace.told && self.pace.until.is_none();
        let description = self.description().filter(|description| due && description.truth.is_some())?;
        let latest = self.history.latest();
        let change = description.change_at;
        let begin = self.history.begin(latest);
        let news = (0..description.learners.len()).filter_map(|learner| self.history.converged_at(latest, learner));
        let is_quiet = latest >= news.max().unwrap_or(begin) + CONFIRMATION + QUIET;
        let waiting: Vec<&str> = (description.learners.iter().enumerate())
            .filter(|(index, _)| !self.history.is_over(*index))
            .map(|(_, learner)| learner.name.as_str())
            .collect();
        let only_one = waiting.len() == 1 && description.learners.len() > 1;
        match change.filter(|change| latest <= *change) {
            Some(change) if latest + BEFORE_CHANGE >= change => None,
            Some(change) if only_one || is_quiet || waiting.is_empty() => {
                Some(format!("to movement {change}, at which the body changes"))
            }
            None if only_one || is_quiet => Some(format!("waiting for {}", waiting.join(" and "))),
            _ => None,
        }
    }

    fn stop_if_due(&mut self) {
        let latest = self.history.latest();
        let (settled, judging) = self.settled();
        let newly = settled > self.pace.settled;
        let told = self.settings.stop == StopWhen::Told && !self.pace.told && self.is_told();
        let reason = if self.pace.until.is_some_and(|until| latest >= until) {
            format!("Paused after movement {latest}.")
        } else if self.remaining() == Some(0) {
            "The end of the recorded data: every movement has been used.".to_owned()
        } else if latest >= self.run_to() {
            format!("Stopped at step {latest}, the last of this run. Raise “Run to” to go on.")
        } else if told && self.all_have_learned() {
            format!("The end, after movement {latest}: all have learned the arm. Play goes on.")
        } else if told {
            format!("The end, after movement {latest}: no more will learn the arm. Play goes on.")
        } else if newly && settled == judging && matches!(self.settings.stop, StopWhen::First | StopWhen::All) {
            format!("Stopped at step {latest}: every learner that judges itself is sure of itself. Play goes on.")
        } else if newly && self.settings.stop == StopWhen::First {
            let name = self.newly_settled().unwrap_or_default();
            format!("Stopped at step {latest}: {name} is sure of itself. Play goes on.")
        } else {
            return;
        };
        self.pause();
        self.stopped = Some(reason);
    }

    fn all_have_learned(&self) -> bool {
        let learners = self.description().map_or(0, |description| description.learners.len());
        (0..learners).all(|learner| self.history.converged_at(self.history.latest(), learner).is_some())
    }

    fn newly_settled(&self) -> Option<String> {
        let latest = self.history.latest();
        let learners = &self.description()?.learners;
        let settled = |step: u64, index| self.history.row(step, index).is_some_and(|row| row.settled);
        let found = learners.iter().enumerate().filter(|(index, _)| settled(latest, *index));
        found
            .min_by_key(|(index, _)| (0..latest).rev().take_while(|step| settled(*step, *index)).count())
            .map(|(_, learner)| learner.name.clone())
    }

    /// Moves one step forward: to the next one that was made, or makes a new one.
    pub fn forward(&mut self) {
        self.plays_first = false;
        self.pause();
        if self.cursor < self.history.latest() { self.cursor += 1 } else { self.make_step() }
    }

    /// Moves one step back among those that were made.
    pub fn back(&mut self) {
        self.plays_first = false;
        self.pause();
        self.cursor = self.cursor.saturating_sub(1);
    }

    /// Shows a step that was made.
    pub fn scrub(&mut self, step: u64) {
        let step = step.min(self.history.latest());
        self.wanted = None;
        if step != self.cursor {
            self.pause();
            self.cursor = step;
        }
        self.sought = Some(step);
    }

    /// Makes a new step.
    pub fn make_step(&mut self) {
        self.plays_first = false;
        self.pause();
        self.stopped = None;
        if self.is_external() {
            return;
        }
        if self.remaining() == Some(0) {
            self.stop_if_due();
        } else if self.human().is_some() {
            self.make_movement();
        } else if self.is_ready() && !self.busy && self.restoring.is_none() {
            self.cursor = self.history.latest();
            self.request(1, FRAMES);
        }
    }

    /// Asks for `count` steps, with `frames` postures shown on the way to each.
    pub(crate) fn request(&mut self, count: u64, frames: u64) {
        let Some(session) = &self.session else { return };
        let command =
            Command::Step { session: session.id.clone(), count, expected_step: self.history.latest(), frames };
        self.busy = true;
        self.pace.asked_at = self.now;
        self.ask(command);
    }

    /// Opens the session again from its start.
    pub fn reset(&mut self) {
        if self.is_external() {
            return;
        }
        let asked = self.settings.session.clone().filter(|_| self.settings.robot && self.session.is_none());
        if let Some(session) = asked.filter(|_| !self.scenarios.is_empty() && !self.opening) {
            self.link = Link::Loading;
            self.find(session);
        } else if self.scenarios.is_empty() {
            self.link = Link::Loading;
            self.ask(Command::Scenarios);
        } else if !self.opening {
            self.open(1);
        }
    }

    /// Plays faster or slower.
    pub fn change_speed(&mut self, faster: bool) {
        let speed = self.settings.speed;
        let next = if faster {
            SPEEDS.iter().find(|other| **other > speed)
        } else {
            SPEEDS.iter().rev().find(|other| **other < speed)
        };
        self.settings.speed = next.copied().unwrap_or(speed);
    }

    /// Whether a movement has been asked for that should have come: the engine is on its way, or busy.
    pub(crate) fn is_late(&self) -> bool {
        self.busy && self.now >= self.late_at()
    }

    /// When a movement that was asked for last is late, on the clock of the panel.
    fn late_at(&self) -> f64 {
        self.pace.asked_at + 1.0 / self.speed() + LATE
    }

    /// Advances the panel to `now`, and returns the seconds after which it must be called again, if nothing happens
    /// before.
    pub fn tick(&mut self, now: f64) -> Option<f64> {
        self.now = now;
        let mut again = None;
        if self.is_ready() && !self.busy && self.restoring.is_none() {
            self.play_first();
            self.restore_bands();
        }
        if self.is_ready() && !self.busy {
            if let Some(target) = self.restoring {
                let latest = self.history.latest();
                if latest < target && self.remaining() != Some(0) {
                    self.request((target - latest).min(RESTORED_AT_ONCE).min(self.remaining().unwrap_or(u64::MAX)), 0);
                } else {
                    self.restoring = None;
                    if let Some(wanted) = self.wanted.take() {
                        self.cursor = wanted.min(latest);
                    }
                    if std::mem::take(&mut self.plays_on) {
                        self.play();
                    }
                }
            } else if self.playing {
                self.stop_if_due();
                again = self.keep_playing();
            }
        }
        if self.playing && self.busy {
            again = Some(self.late_at() - now).filter(|wait| *wait > 0.0);
        }
        again = [again, self.play_game(now)].into_iter().flatten().reduce(f64::min);
        self.explain(now);
        self.point_at_scene();
        self.show_alone();
        // The scene follows once, whatever moved the cursor how often.
        if self.is_ready() && self.sought != Some(self.cursor) {
            self.sought = Some(self.cursor);
            self.ask(Command::Seek { step: self.cursor });
        }
        self.mirror(now);
        let waits = self.follow_address(now);
        [again, waits].into_iter().flatten().reduce(f64::min)
    }

    fn keep_playing(&mut self) -> Option<f64> {
        if !self.playing {
            return None;
        }
        let elapsed = self.now - self.pace.asked_at;
        let fast = self.fast_forward().is_some();
        let speed = if fast { MAX_SPEED } else { self.speed() };
        // A run goes no faster than it can be drawn; where there is no scene, or a slow one, it does not wait for ever.
        let drawn = self.no_scene.is_some() || self.shown >= self.history.latest() || elapsed > SHOWN_WITHIN;
        let due = (elapsed * speed + 1e-6) as u64;
        if !drawn {
            return Some(SHOWN_WITHIN - elapsed);
        }
        if due == 0 {
            return Some(1.0 / speed - elapsed);
        }
        let latest = self.history.latest();
        let change = self.description().and_then(|description| description.change_at);
        let ahead = change.filter(|change| fast && latest <= *change);
        let before_change = ahead.map_or(u64::MAX, |change| change.saturating_sub(latest + BEFORE_CHANGE).max(1));
        let until = self.pace.until.map_or(u64::MAX, |until| until.saturating_sub(self.history.latest()));
        let left = self.run_to().saturating_sub(self.history.latest()).min(self.remaining().unwrap_or(u64::MAX));
        let frames = if speed <= SLOW { FRAMES } else { 0 };
        self.request(due.clamp(1, MOST_AT_ONCE).min(left.max(1)).min(until.max(1)).min(before_change), frames);
        // The part of a step that is due already counts for the next, or every step would come a little late.
        self.pace.asked_at -= elapsed - due as f64 / speed;
        None
    }

    fn follow_address(&mut self, now: f64) -> Option<f64> {
        self.settings.chart = Some(in_address(self.chart)).filter(|_| self.chart != PREDICTION);
        self.settings.bands = self.wants_bands || self.has_bands();
        // Until there is a session, the address is what it is made from.
        if self.session.is_none() || self.opening || self.wanted.is_some() || self.history.is_empty() {
            return None;
        }
        // Who watches a robot as it moves wants to see its latest step next time too.
        let is_latest = self.settings.robot && self.cursor == self.history.latest();
        self.settings.step = Some(self.cursor).filter(|_| !is_latest);
        let query = self.settings.query();
        if self.address.1 == query {
            return None;
        }
        let wait = self.address.0 + ADDRESS_EVERY - now;
        if wait > 0.0 {
            return Some(wait);
        }
        self.address = (now, query.clone());
        self.ask(Command::Address { query });
        None
    }
}
