//! What a newcomer sees first: the first story plays by itself to its end, beside three sentences; everything else
//! unfolds. It begins with one robot, and the others join when it has learned its arm.

use crate::{
    host::Command,
    panel::Panel,
    settings::Tab,
    stories::{STORIES, Spot},
    words::{listed, millimetres, movements},
};

/// The first movements are made at this pace, movements a second: slowly enough to follow each of them.
const WALK: f64 = 2.5;
/// Up to this movement.
const WALKED: u64 = 14;
/// The learner that is seen alone at first, and up to which movement.
const ALONE: (&str, u64) = ("global", 10);
/// The pace from then on, movements a second, so that the end of the first story comes within half a minute.
const RUN: f64 = 12.0;

/// What is to be seen, for who has not been here before.
const ROBOT: &str =
    "A robot moves its arm, sees a marker on its hand, and learns from that alone where its joints are.";
/// The same of the scene, while it shows one robot and when it shows all.
const ONE: &str = "In the scene, its true arm is grey, and the coloured one is where it believes its arm to be.";
const ALL: &str = "In the scene, grey is the true arm, and each colour is where one learner believes it to be. All have made \
                   the same number of movements.";

impl Panel {
    /// Shows a newcomer the first story and little else.
    pub(crate) fn begin_first_look(&mut self) {
        self.settings.brief = true;
        self.plays_first = !self.still;
        self.settings.seed = STORIES[0].seed;
        self.seed_text = STORIES[0].seed.to_string();
    }

    /// The sentences of the first look are about the first story alone.
    pub(crate) fn check_first_look(&mut self) {
        if self.settings.brief && self.settings.scenario != STORIES[0].scenario {
            (self.settings.brief, self.plays_first) = (false, false);
        }
    }

    /// Shows all that there is.
    pub fn unfold(&mut self) {
        self.plays_first = false;
        if std::mem::take(&mut self.settings.brief) {
            self.ask(Command::Known);
        }
    }

    /// Plays the first story as soon as its first step can be seen.
    pub(crate) fn play_first(&mut self) {
        let is_seen = self.shown >= self.history.latest() || self.no_scene.is_some();
        if self.plays_first && is_seen && self.history.latest() > 0 {
            self.plays_first = false;
            self.play();
            self.pace.by_itself = true;
        }
    }

    /// The pace of playing, movements a second.
    pub(crate) fn speed(&self) -> f64 {
        match self.pace.by_itself {
            true if self.history.latest() < WALKED => WALK,
            true => RUN,
            false => self.settings.speed,
        }
    }

    /// The learner that is shown alone, by its place: in the first look, until it has learned its arm.
    pub(crate) fn alone(&self) -> Option<usize> {
        let (name, until) = ALONE;
        let learners = &self.description()?.learners;
        let begins = self.settings.brief && learners.len() > 1 && self.history.latest() <= until;
        learners.iter().position(|learner| begins && learner.name == name)
    }

    /// Whether a learner is to be seen: all are, but for the beginning of the first look.
    pub(crate) fn is_seen(&self, learner: usize) -> bool {
        self.alone().is_none_or(|alone| alone == learner)
    }

    /// Has the scene show one learner or all.
    pub(crate) fn show_alone(&mut self) {
        let learner = self.alone().and_then(|place| Some(self.description()?.learners[place].name.clone()));
        if self.alone_shown != learner {
            self.alone_shown.clone_from(&learner);
            self.ask(Command::Alone { learner });
        }
    }

    /// The sentences that say what is to be seen.
    pub fn sentences(&self) -> [&'static str; 2] {
        [ROBOT, if self.alone().is_some() { ONE } else { ALL }]
    }

    /// How far off the learners are at the shown step, the best first.
    pub fn standing(&self) -> Option<String> {
        let learners = &self.description()?.learners;
        let error = |(index, name)| Some((self.history.row(self.cursor, index)?.error_m()?, name));
        let names = learners.iter().map(|learner| learner.name.as_str());
        let names = names.enumerate().filter(|(index, _)| self.is_seen(*index));
        let mut errors: Vec<(f64, &str)> = names.filter_map(error).collect();
        errors.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        if let (Some(_), [(error, _)]) = (self.alone(), &errors[..]) {
            let movements = movements(self.cursor);
            return Some(format!("After {movements} it mispredicts where the hand is by {}.", millimetres(*error)));
        }
        let errors: Vec<String> =
            errors.into_iter().map(|(error, name)| format!("{name} by {}", millimetres(error))).collect();
        let errors: Vec<&str> = errors.iter().map(String::as_str).collect();
        let movements = movements(self.cursor);
        (!errors.is_empty())
            .then(|| format!("After {movements} they mispredict where the hand is: {}.", listed(&errors)))
    }

    /// Shows what a learner chooses between, as it chooses.
    pub fn ask_why(&mut self, learner: &str) {
        if self.description().is_none_or(|description| description.learners.iter().all(|one| one.name != learner)) {
            return;
        }
        self.unfold();
        self.settings.learner = Some(learner.to_owned());
        self.settings.tab = Tab::Why;
        self.reveal = Some(Spot::Tabs);
        self.why.grows = !self.still;
        self.why.growing = Some(self.now).filter(|_| !self.still);
    }

    /// Tells why the first story ended as it did: the card about the choice of movements, with the choice.
    pub fn tell_why(&mut self) {
        let card = STORIES[self.story].cards.iter().position(|card| card.spot == Spot::Tabs);
        self.unfold();
        self.tour = card;
        self.settings.tab = Tab::Why;
    }
}
