//! The effects of events on the panel's state.

use body_schema_scenario::{ScenarioSummary, WorldKind};
use body_schema_wire::StepReport;

use crate::{
    history::History,
    host::{Command, Event, Live},
    panel::{Link, PREDICTION, Pace, Panel, Robot},
    seeds::SeedRuns,
    settings::{HUMAN, MAX_RESTORED, Settings, short},
    view::of_address,
    why::Why,
    wire::{Problem, Session},
};

impl Panel {
    /// Handles an event.
    pub fn receive(&mut self, event: Event) {
        match event {
            Event::Begin { query, known, server, fresh, still } => {
                (self.server, self.still) = (server, still);
                self.begin(&query, known, fresh);
            }
            Event::Layout { scene } => self.scene = scene,
            Event::Navigated { query } => self.navigate(&query),
            Event::Play => self.play(),
            Event::Pause => self.pause(),
            Event::Forward => self.forward(),
            Event::Choose { scenario, seed } => self.choose(scenario, seed),
            Event::Scenarios { scenarios } => self.take_scenarios(scenarios),
            Event::Robots { sessions } => self.robots = sessions,
            Event::Told => self.robot.asking = false,
            Event::Session { session: Some(session) } => self.adopt(*session),
            Event::Session { session: None } => self.without_session(),
            Event::Refused { asked, problem } => self.refused(&asked, &problem),
            Event::Connected => self.link = Link::Connected,
            Event::Live { message: Live::Step(report) } => self.take(&report),
            Event::Live { message: Live::Description(_) } => {}
            Event::Live { message: Live::Status(standing) } => self.take_standing(*standing),
            Event::Stepped { session, step } => {
                if self.session.as_ref().is_some_and(|current| current.id == session) {
                    self.stepped(step);
                }
            }
            Event::Lost { seconds } => {
                self.link = Link::Lost(seconds);
                self.busy = false;
            }
            Event::Ended { failure, unseen } => self.ended(failure, unseen),
            Event::Shown { step } => self.shown = step,
            Event::Scrubbed { step } => self.scrub(step),
            Event::Picked { learner } => self.ask_why(&learner),
            Event::NoScene { reason } => self.no_scene = Some(reason),
            Event::Selection { learner, selection } => {
                self.why.answered(&learner, selection.map(|answer| *answer), self.now);
            }
            Event::Evaluation { evaluation } => self.why.appraised(*evaluation),
            Event::Configured { learner, evaluation } => self.take_evaluation(&learner, *evaluation),
            Event::Surveyed { session, gains } => {
                if self.session.as_ref().is_some_and(|current| current.id == session) {
                    self.game.mapped(&gains);
                }
            }
            Event::Seeds { seed, reports, done } => self.take_seed(seed, &reports, done),
            Event::Copied { done, note } => {
                let usual = if done { "Copied." } else { "The browser does not allow copying." };
                self.copied = Some(note.unwrap_or_else(|| usual.to_owned()));
            }
        }
    }

    fn begin(&mut self, query: &str, known: bool, fresh: bool) {
        let (settings, notices) = Settings::parse(query);
        self.wants_bands = settings.bands;
        self.settings = settings;
        self.seed_text = self.settings.seed.to_string();
        notices.into_iter().for_each(|notice| self.notice(notice));
        self.take_chart();
        if fresh && !known && !self.settings.embed {
            self.begin_first_look();
        } else {
            // The cards begin at the start of a run, which is not what a link to a later step shows, nor a game.
            let Settings { embed, brief, play, step, .. } = &self.settings;
            let offered = !(known || *embed || *brief || *play) && step.is_none();
            self.tour = Some(0).filter(|_| offered);
        }
        self.ask(Command::Scenarios);
        self.ask(Command::Robots);
    }

    /// Handles that there is no session with the address's id.
    fn without_session(&mut self) {
        if self.session.is_some() {
            self.stay("That session is gone: it was deleted, or the server was started anew without it.".to_owned());
            self.ask(Command::Robots);
            return;
        }
        self.notice(match self.settings.robot {
            true => "This server has no session of that address: it was deleted, or another server has it.".to_owned(),
            false => "The session of this address is gone; its run is computed again.".to_owned(),
        });
        self.open(self.settings.first_step());
    }

    /// Stays with the shown session, since there is no other.
    fn stay(&mut self, why: String) {
        (self.opening, self.restoring, self.wanted) = (false, None, None);
        self.settings.robot = self.is_external();
        self.settings.session = self.session.as_ref().map(|session| session.id.clone());
        self.notice(why);
    }

    /// Shows what an earlier address showed: a step of this run, or another run.
    fn navigate(&mut self, query: &str) {
        let what = |settings: &Settings| {
            let Settings { robot, session, scenario, set, seed, learners, .. } = settings.clone();
            if robot { (session, None) } else { (None, Some((scenario, set, seed, learners))) }
        };
        let before = what(&self.settings);
        let (mut settings, mut notices) = Settings::parse(query);
        notices.extend(settings.validate(&self.scenarios));
        // The session of that address may be gone, and the one that is shown needs no other.
        if !settings.robot {
            settings.session = self.settings.session.take();
        }
        self.wants_bands = settings.bands;
        self.settings = settings;
        self.take_chart();
        self.seed_text = self.settings.seed.to_string();
        notices.into_iter().for_each(|notice| self.notice(notice));
        if self.is_ready() && what(&self.settings) == before {
            let usual = if self.settings.robot { self.history.latest() } else { self.settings.first_step() };
            self.scrub(self.settings.step.unwrap_or(usual));
        } else if let Some(session) = self.settings.session.clone().filter(|_| self.settings.robot) {
            self.find(session);
        } else {
            self.open(self.settings.first_step());
        }
    }

    /// Shows the chart that the address names.
    fn take_chart(&mut self) {
        let Some(name) = self.settings.chart.take() else { return };
        match of_address(&name) {
            Some(title) => self.chart = title,
            None => self.notice(format!("There is no chart “{}”; the usual one is shown.", short(&name))),
        }
    }

    fn take_scenarios(&mut self, scenarios: Vec<ScenarioSummary>) {
        self.scenarios = scenarios;
        let notices = self.settings.validate(&self.scenarios);
        notices.into_iter().for_each(|notice| self.notice(notice));
        self.choose_usual_learners();
        match self.story_of_scenario() {
            Some(story) => self.story = story,
            // The cards speak of another scenario.
            None => self.tour = None,
        }
        self.check_first_look();
        match self.settings.session.clone() {
            Some(session) => self.find(session),
            None => self.open(self.settings.first_step()),
        }
    }

    /// Shows an existing session.
    pub(crate) fn find(&mut self, session: String) {
        self.pause();
        self.restoring = None;
        self.wanted = Some(self.settings.first_step());
        self.opening = true;
        self.ask(Command::Find { session });
    }

    /// Opens another run; what is not named stays, but for the learners of another scenario.
    fn choose(&mut self, scenario: Option<String>, seed: Option<u64>) {
        self.settings.seed = seed.unwrap_or(self.settings.seed);
        self.seed_text = self.settings.seed.to_string();
        match scenario.filter(|scenario| *scenario != self.settings.scenario) {
            Some(scenario) => self.choose_scenario(&scenario),
            None => self.open(1),
        }
    }

    /// Chooses the learners that are most instructive side by side, unless the visitor chose some.
    pub(crate) fn choose_usual_learners(&mut self) {
        if self.settings.learners.is_empty()
            && let Some(scenario) = self.scenario()
        {
            self.settings.learners = scenario.explorer.clone();
        }
    }

    /// Leaves the session and opens that of the settings, at this step.
    pub(crate) fn open(&mut self, step: u64) {
        self.pause();
        (self.opening, self.turning, self.plays_on) = (true, None, false);
        // Movements that the visitor chose cannot be computed again.
        let is_game = self.settings.learners.iter().any(|name| name == HUMAN);
        let step = if is_game { 0 } else { step };
        self.restoring = (step > 0).then(|| step.min(MAX_RESTORED));
        self.wanted = self.restoring;
        let Settings { scenario, set, seed, learners, ellipsoids, enlarge, .. } = self.settings.clone();
        let learners = Some(learners).filter(|learners| !learners.is_empty());
        self.ask(Command::Open { scenario, seed, learners, ellipsoids, set, enlarge });
    }

    fn adopt(&mut self, session: Session) {
        let description = &session.description;
        self.settings.robot = session.world == WorldKind::External;
        if self.settings.robot {
            // What the explorer last showed stays chosen, to go back to.
            self.wanted = self.settings.step;
            self.tour = None;
        } else {
            self.settings.scenario.clone_from(&description.scenario);
            self.settings.set.clone_from(&description.set);
            self.settings.seed = description.seed;
            self.seed_text = description.seed.to_string();
            self.settings.learners = description.learners.iter().map(|learner| learner.name.clone()).collect();
        }
        self.settings.session = Some(session.id.clone());
        self.robot = Robot::default();
        self.history = History::new(description);
        self.why = Why::default();
        self.pace = Pace::default();
        self.chart = if description.truth.is_some() { self.chart } else { PREDICTION };
        (self.cursor, self.shown, self.sought, self.awaited) = (0, 0, None, None);
        (self.opening, self.busy, self.stopped) = (false, false, None);
        self.link = Link::Loading;
        if self.restoring.is_none() {
            self.wanted = self.wanted.map(|wanted| wanted.min(session.step));
        }
        self.session = Some(session);
        self.begin_game();
    }

    fn refused(&mut self, asked: &str, problem: &Problem) {
        let sentence = problem.sentence();
        match asked {
            "scenarios" => self.link = Link::Unreachable(sentence),
            "open" => {
                self.opening = false;
                // The server has the last word on what an address may ask for.
                match problem.field.as_deref() {
                    Some(field) if self.session.is_none() => self.fall_back(field, &sentence),
                    _ if self.session.is_none() => self.link = Link::Unreachable(sentence),
                    _ => self.stay(format!("No new session: {sentence}.")),
                }
            }
            "find" if self.session.is_some() => self.stay(format!("That session cannot be shown: {sentence}.")),
            "find" => {
                self.opening = false;
                self.link = Link::Unreachable(sentence);
            }
            "step" => {
                // Somebody else has stepped this session: their steps are on their way.
                if let (409, Some(step)) = (problem.status, problem.step) {
                    self.stepped(step);
                } else {
                    self.busy = false;
                    self.pause();
                    self.restoring = None;
                    if problem.status != 0 {
                        self.notice(format!("No step: {sentence}."));
                    }
                }
            }
            "configure" => self.game_refused(&sentence),
            "select" => self.why.refused(problem),
            "evaluate" => {
                self.why.evaluating = false;
                self.notice(format!("This posture cannot be judged: {sentence}."));
            }
            "seeds" => {
                self.seeds.iter_mut().for_each(SeedRuns::cancel);
                self.notice(format!("The other seeds stopped: {sentence}."));
            }
            _ => {
                self.robot.asking = false;
                self.notice(sentence);
            }
        }
    }

    fn fall_back(&mut self, field: &str, sentence: &str) {
        let usual = Settings::default();
        let (seed, scenario) = (self.settings.seed, self.settings.scenario.clone());
        self.settings.learners.clear();
        let set = std::mem::take(&mut self.settings.set);
        if !matches!(field, "learners" | "set") {
            self.settings.seed = usual.seed;
        }
        self.notice(format!("The server does not take this address: {sentence}. Defaults are used instead."));
        let is_new =
            seed != self.settings.seed || field == "learners" || !set.is_empty() || scenario != self.settings.scenario;
        if is_new { self.open(1) } else { self.link = Link::Unreachable(sentence.to_owned()) }
    }

    /// Notes that the session is at this step. Its reports may still be on their way, and until then nothing is asked
    /// for.
    fn stepped(&mut self, step: u64) {
        self.awaited = Some(step).filter(|step| *step > self.history.latest());
        self.busy = self.awaited.is_some();
    }

    fn take(&mut self, report: &StepReport) {
        let following = self.cursor == self.history.latest();
        if !self.history.take(report) {
            return;
        }
        if self.awaited.is_some_and(|step| step <= self.history.latest()) {
            (self.awaited, self.busy) = (None, false);
        }
        match self.wanted {
            // What comes after it on the way to the session's latest step does not move it.
            Some(wanted) if self.history.latest() >= wanted => {
                self.cursor = wanted;
                let made = self.session.as_ref().map_or(0, |session| session.step);
                self.wanted = Some(wanted).filter(|_| self.history.latest() < made);
            }
            _ if following => self.cursor = self.history.latest(),
            _ => {}
        }
    }

    fn ended(&mut self, failure: Option<String>, unseen: bool) {
        self.busy = false;
        match failure {
            Some(failure) => {
                self.pause();
                self.link = Link::Failed(failure);
            }
            None if unseen && !self.settings.robot => {
                let (latest, cursor) = (self.history.latest(), self.cursor);
                self.notice(format!("The server was started anew; the run is computed again up to step {latest}."));
                self.open(latest);
                self.wanted = self.wanted.map(|_| cursor);
            }
            None => {
                self.pause();
                self.link = Link::Expired;
            }
        }
    }
}
