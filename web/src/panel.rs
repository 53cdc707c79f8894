//! The panel's state.

use body_schema_scenario::ScenarioSummary;
use body_schema_wire::Description;

use crate::{
    game::Game,
    history::History,
    host::{Command, Mirror, Side},
    news::Told,
    robot::Robot,
    seeds::SeedRuns,
    settings::{HUMAN, Settings, Tab},
    stories::{STORIES, Spot, Spots},
    why::Why,
    wire::Session,
};

/// What the panel can do at the moment.
#[derive(Clone, Debug, PartialEq)]
pub enum Link {
    /// Nothing has come yet.
    Loading,
    /// The server cannot be reached, or refused to begin.
    Unreachable(String),
    /// A session is there and followed.
    Connected,
    /// The connection broke; it is tried again after so many seconds.
    Lost(f64),
    /// The session was deleted or had to make room.
    Expired,
    /// The session's engine failed.
    Failed(String),
}

/// The chart that is in sight unless the visitor chose another.
pub(crate) const PREDICTION: &str = "Prediction error";

/// How fast steps are made.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    /// When the last steps were asked for.
    pub(crate) asked_at: f64,
    /// Learners that had settled when playing began.
    pub(crate) settled: usize,
    /// The story was told already when playing began.
    pub(crate) told: bool,
    /// Play no further than this step.
    pub(crate) until: Option<u64>,
}

/// The panel.
pub struct Panel {
    /// What the visitor chose.
    pub settings: Settings,
    /// What there is to choose from.
    pub scenarios: Vec<ScenarioSummary>,
    /// What the visitor should know, newest last.
    pub notices: Vec<String>,
    /// Whether there is a session, and how it stands with it.
    pub link: Link,
    /// The session.
    pub session: Option<Session>,
    /// Its steps.
    pub history: History,
    /// The step that is shown, here and in the scene.
    pub cursor: u64,
    /// Whether steps are being made.
    pub playing: bool,
    /// Why the run has stopped.
    pub stopped: Option<String>,
    /// Why there is no scene.
    pub no_scene: Option<String>,
    /// How the last movement was chosen.
    pub why: Why,
    /// Other seeds, in the background, once they were asked for.
    pub seeds: Option<SeedRuns>,
    /// The card of the story that is open.
    pub tour: Option<usize>,
    /// The story that the cards tell, one of [`STORIES`].
    pub story: usize,
    /// The movements that the visitor chooses.
    pub game: Game,
    /// The robot of a session with one elsewhere.
    pub robot: Robot,
    /// The sessions with robots elsewhere, as they were when the page was opened.
    pub robots: Vec<Session>,
    /// Whether there is a server; without one, recorded runs are shown and nothing new is computed.
    pub server: bool,
    /// The seeds of the recorded runs, where there is no server.
    pub recorded_seeds: Vec<u64>,
    /// The chart that is always in sight, by its title.
    pub chart: &'static str,
    /// Whether the help is open.
    pub help: bool,
    /// The seed as it is being typed.
    pub seed_text: String,
    /// The answer to the last copying.
    pub copied: Option<String>,
    pub(crate) spots: Spots,
    /// What is marked in the legend of the scene.
    pub(crate) pointed: Option<&'static str>,
    /// The card that was drawn last, by its story and place.
    pub(crate) card_shown: Option<(usize, usize)>,
    /// What the card that has just been opened speaks of.
    pub(crate) reveal: Option<Spot>,
    /// How high the open card is.
    pub(crate) card_height: f32,
    /// The ending was brought into view.
    pub(crate) ending_seen: bool,
    /// The tab that was drawn last.
    pub(crate) tab_shown: Tab,
    /// The visitor touches the screen.
    pub(crate) touch: bool,
    /// Where the scene lies.
    pub(crate) scene: Side,
    /// By how much a swipe over what stays in place has moved what scrolls.
    pub(crate) swiped: f32,
    /// While it plays, seconds from one frame to the next where drawing is slow; 0 where it is not.
    pub drawn_every: f64,
    pub(crate) opening: bool,
    /// A request for steps is under way.
    pub(crate) busy: bool,
    /// The step whose report is awaited.
    pub(crate) awaited: Option<u64>,
    /// Steps up to this one are made at once, to restore a run.
    pub(crate) restoring: Option<u64>,
    /// The step to show once it is there.
    pub(crate) wanted: Option<u64>,
    pub(crate) shown: u64,
    pub(crate) sought: Option<u64>,
    pub(crate) pace: Pace,
    pub(crate) now: f64,
    pub(crate) said: (f64, Mirror),
    pub(crate) told: Told,
    pub(crate) address: (f64, String),
    commands: Vec<Command>,
}

impl Default for Panel {
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            scenarios: Vec::new(),
            notices: Vec::new(),
            link: Link::Loading,
            session: None,
            history: History::default(),
            cursor: 0,
            playing: false,
            stopped: None,
            no_scene: None,
            why: Why::default(),
            seeds: None,
            tour: None,
            story: 0,
            game: Game::default(),
            robot: Robot::default(),
            robots: Vec::new(),
            server: true,
            recorded_seeds: Vec::new(),
            chart: PREDICTION,
            help: false,
            seed_text: "1".to_owned(),
            copied: None,
            spots: Spots::default(),
            pointed: None,
            card_shown: None,
            reveal: None,
            card_height: 0.0,
            ending_seen: false,
            tab_shown: Tab::Charts,
            touch: false,
            scene: Side::default(),
            swiped: 0.0,
            drawn_every: 0.0,
            opening: false,
            busy: false,
            awaited: None,
            restoring: None,
            wanted: None,
            shown: 0,
            sought: None,
            pace: Pace::default(),
            now: 0.0,
            said: (f64::NEG_INFINITY, Mirror::default()),
            told: Told::default(),
            address: (f64::NEG_INFINITY, String::new()),
            commands: Vec::new(),
        }
    }
}

impl Panel {
    /// Asks the page to do something.
    pub(crate) fn ask(&mut self, command: Command) {
        self.commands.push(command);
    }

    /// What the page is to do, in order.
    pub fn take_commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.commands)
    }

    /// Whether there is anything for the page to do.
    pub(crate) fn has_commands(&self) -> bool {
        !self.commands.is_empty()
    }

    /// Tells the visitor something, once.
    pub(crate) fn notice(&mut self, text: String) {
        const MOST: usize = 6;
        if !self.notices.contains(&text) {
            self.notices.push(text);
        }
        let surplus = self.notices.len().saturating_sub(MOST);
        self.notices.drain(..surplus);
    }

    /// What the session runs.
    pub fn description(&self) -> Option<&Description> {
        self.session.as_ref().map(|session| &session.description)
    }

    /// The chosen scenario.
    pub fn scenario(&self) -> Option<&ScenarioSummary> {
        self.scenarios.iter().find(|scenario| scenario.name == self.settings.scenario)
    }

    /// The place of the learner whose movements the visitor chooses.
    pub fn human(&self) -> Option<usize> {
        self.description()?.learners.iter().position(|learner| learner.policy == HUMAN)
    }

    /// The story of the chosen scenario, if there is one.
    pub(crate) fn story_of_scenario(&self) -> Option<usize> {
        STORIES.iter().position(|story| story.scenario == self.settings.scenario)
    }

    /// Whether it goes on between its frames, and is drawn less often than it does something.
    pub fn draws_sparingly(&self) -> bool {
        self.playing && self.drawn_every > 0.0
    }

    /// Whether steps can be made.
    pub fn is_ready(&self) -> bool {
        self.link == Link::Connected && self.session.is_some() && !self.opening && !self.history.is_empty()
    }

    /// How far a run is being restored, 0 to 1.
    pub fn restored(&self) -> Option<f32> {
        let target = self.restoring?;
        Some(self.history.latest() as f32 / target.max(1) as f32)
    }
}
