//! The game: the visitor's movements against those of the learners that choose by themselves.

use body_schema_wire::AppraisalReport;

use crate::{
    game::{Due, Game, ROUNDS},
    host::Command,
    panel::Panel,
    play::FRAMES,
    settings::{GAME, HUMAN},
};

/// The result of a game.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// In words.
    pub verdict: String,
    /// Prediction errors, metres, by place in the description, the best first.
    pub errors: Vec<(usize, f64)>,
}

impl Panel {
    /// Whether a game can be played on the chosen scenario.
    pub fn can_play(&self) -> bool {
        let offers =
            |scenario: &body_schema_scenario::ScenarioSummary| scenario.offered().any(|learner| learner.name == HUMAN);
        self.scenario().is_some_and(offers)
    }

    /// Opens a game on what is shown, on the same seed.
    pub fn begin_contest(&mut self) {
        self.settings.learners = GAME.map(str::to_owned).to_vec();
        let notices = self.settings.validate(&self.scenarios);
        notices.into_iter().for_each(|notice| self.notice(notice));
        self.tour = None;
        self.open(0);
    }

    /// Ends the game, and opens the usual learners on the same seed.
    pub fn end_contest(&mut self) {
        self.settings.learners.clear();
        self.choose_usual_learners();
        self.open(1);
    }

    pub(crate) fn begin_game(&mut self) {
        let Some(session) = self.session.as_ref() else { return };
        let middles = session.description.joints.iter().map(|joint| (joint.limits[0] + joint.limits[1]) / 2.0);
        self.game = Game::new(middles.collect(), session.step, self.now);
    }

    /// Sets another posture for the next movement.
    pub fn pose(&mut self, values: Vec<f64>) {
        self.game.set(values, self.now);
    }

    /// Whether the visitor may move now.
    pub fn may_move(&self) -> bool {
        self.human().is_some() && self.is_ready() && !self.busy && self.history.latest() < ROUNDS
    }

    /// Makes the movement that the sliders show, as soon as the server knows it.
    pub fn make_movement(&mut self) {
        self.game.wanted = self.may_move();
    }

    /// Advances the game to `now`, and returns the seconds until it should be called again.
    pub(crate) fn play_game(&mut self, now: f64) -> Option<f64> {
        let human = self.human().filter(|_| self.is_ready())?;
        let latest = self.history.latest();
        if latest > self.game.made {
            self.game.moved(latest, now);
        }
        if latest >= ROUNDS {
            return None;
        }
        if self.game.wanted && self.game.is_known() && !self.busy {
            self.cursor = latest;
            self.game.wanted = false;
            self.request(1, FRAMES);
            return None;
        }
        match self.game.due(now) {
            Due::Ask if !self.busy => {
                let session = self.session.as_ref()?.id.clone();
                let learner = self.description()?.learners[human].name.clone();
                let configuration = self.game.ask();
                self.ask(Command::Configure { session, learner, configuration });
                None
            }
            Due::Later(wait) => Some(wait),
            _ => {
                self.ask_map(human);
                None
            }
        }
    }

    /// Asks what the postures of the slice would teach, once what the chosen one teaches is known.
    fn ask_map(&mut self, human: usize) {
        if self.busy || self.game.wanted || !self.game.map_is_due() {
            return;
        }
        let Some(session) = &self.session else { return };
        let limits: Vec<[f64; 2]> = session.description.joints.iter().map(|joint| joint.limits).collect();
        let (id, learner) = (session.id.clone(), session.description.learners[human].name.clone());
        let configurations = self.game.ask_map(&limits);
        self.ask(Command::Survey { session: id, learner, configurations });
    }

    pub(crate) fn take_evaluation(&mut self, learner: &str, evaluation: AppraisalReport) {
        if self.human().is_some_and(|human| self.description().is_some_and(|one| one.learners[human].name == learner)) {
            self.game.answered(evaluation);
        }
    }

    pub(crate) fn game_refused(&mut self, sentence: &str) {
        self.game.refused();
        self.notice(format!("This posture cannot be taken: {sentence}."));
    }

    pub(crate) fn game_status(&self) -> String {
        let made = self.history.latest();
        if made >= ROUNDS {
            return format!("All {ROUNDS} movements are made.");
        }
        format!("Movement {} of {ROUNDS}: choose a posture, then make the movement.", made + 1)
    }

    /// The result of the game, once it has ended.
    pub fn score(&self) -> Option<Score> {
        let human = self.human()?;
        let learners = &self.description()?.learners;
        let error = |learner: usize| Some((learner, self.history.row(ROUNDS, learner)?.prediction_m?));
        let mut errors: Vec<(usize, f64)> = (0..learners.len()).filter_map(error).collect();
        let (_, mine) = *errors.iter().find(|(learner, _)| *learner == human)?;
        let named = |beaten: bool| {
            let others = errors.iter().filter(|(learner, error)| *learner != human && (*error > mine) == beaten);
            let names: Vec<&str> = others.map(|(learner, _)| learners[*learner].name.as_str()).collect();
            names.join(" and ")
        };
        let verdict = match (named(true), named(false)) {
            (beaten, better) if better.is_empty() => format!("You beat {beaten}."),
            (beaten, better) if beaten.is_empty() => format!("This time {better} did better than you."),
            (beaten, better) => format!("You beat {beaten}, but not {better}."),
        };
        errors.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        Some(Score { verdict, errors })
    }
}
