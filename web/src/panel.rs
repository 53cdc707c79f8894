//! The panel's state.

use body_schema_scenario::ScenarioSummary;
use body_schema_wire::Description;

use crate::{
    game::Game,
    history::History,
    host::{Command, Mirror, Side},
    seeds::SeedRuns,
    settings::{HUMAN, Settings, Tab},
    stories::{STORIES, Spot, Spots},
    why::Why,
    wire::{Session, Standing},
};

/// The state of the connection.
#[derive(Clone, Debug, PartialEq)]
pub enum Link {
    /// Nothing has been received yet.
    Loading,
    /// The server cannot be reached, or refused to begin.
    Unreachable(String),
    /// There is a session, and it is followed.
    Connected,
    /// The connection broke, and is tried again after this many seconds.
    Lost(f64),
    /// The session was deleted or had to make room.
    Expired,
    /// The session's engine failed.
    Failed(String),
}

/// The title of the chart that is shown unless the visitor chose another.
pub(crate) const PREDICTION: &str = "Prediction error";

/// The pace of making steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    /// When steps were last asked for.
    pub(crate) asked_at: f64,
    /// The number of learners that had settled when playing began.
    pub(crate) settled: usize,
    /// Whether the story was over already when playing began.
    pub(crate) told: bool,
    /// The step at which playing stops.
    pub(crate) until: Option<u64>,
    /// Whether it plays by itself to a newcomer, slowly at first.
    pub(crate) by_itself: bool,
}

/// The state when news was last read out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Told {
    pub(crate) session: String,
    pub(crate) phase: &'static str,
    pub(crate) step: u64,
    pub(crate) notices: Vec<String>,
    /// For each learner, whether its end was read out.
    pub(crate) ended: Vec<bool>,
}

/// The robot of a session with one elsewhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Robot {
    /// The snapshot of the session, once that was received.
    pub standing: Option<Standing>,
    /// Whether a request is not answered yet.
    pub(crate) asking: bool,
}

/// The panel.
pub struct Panel {
    /// The visitor's choices.
    pub settings: Settings,
    /// The available scenarios.
    pub scenarios: Vec<ScenarioSummary>,
    /// Notices for the visitor, newest last.
    pub notices: Vec<String>,
    /// The state of the connection to a session.
    pub link: Link,
    /// The session.
    pub session: Option<Session>,
    /// Its steps.
    pub history: History,
    /// The step that is shown, here and in the scene.
    pub cursor: u64,
    /// Whether steps are being made.
    pub playing: bool,
    /// Why the run has stopped, if it has.
    pub stopped: Option<String>,
    /// Why there is no scene, if there is none.
    pub no_scene: Option<String>,
    /// How the last movement was chosen.
    pub why: Why,
    /// The runs of other seeds in the background, once they were asked for.
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
    /// Whether there is a server; without one the page computes by itself, and robots' sessions can only be watched.
    pub server: bool,
    /// The chart that is always in sight, by its title.
    pub chart: &'static str,
    /// Whether the visitor wants nothing to move by itself.
    pub still: bool,
    /// Whether the first story is to play by itself as soon as the scene shows it.
    pub(crate) plays_first: bool,
    /// The knob that is being turned, by its place in the scenario's, and its value so far.
    pub(crate) turning: Option<(usize, f64)>,
    /// The joint that the visitor would break.
    pub(crate) breaks: Option<String>,
    /// Whether to run other seeds as soon as the run is restored.
    pub(crate) wants_bands: bool,
    /// Whether to play as soon as the run is restored.
    pub(crate) plays_on: bool,
    /// Whether the help is open.
    pub help: bool,
    /// The seed as it is being typed.
    pub seed_text: String,
    /// The answer to the last copying.
    pub copied: Option<String>,
    pub(crate) spots: Spots,
    /// The mark that is highlighted in the legend of the scene.
    pub(crate) pointed: Option<&'static str>,
    /// The learner that the scene shows alone.
    pub(crate) alone_shown: Option<String>,
    /// The card that was drawn last, by its story and place.
    pub(crate) card_shown: Option<(usize, usize)>,
    /// What the card that has just been opened refers to.
    pub(crate) reveal: Option<Spot>,
    /// The height of the open card.
    pub(crate) card_height: f32,
    /// Whether the ending was brought into view.
    pub(crate) ending_seen: bool,
    /// The tab that was drawn last.
    pub(crate) tab_shown: Tab,
    /// Whether the visitor touches the screen.
    pub(crate) touch: bool,
    /// The side on which the scene is.
    pub(crate) scene: Side,
    /// How far a swipe over fixed parts has moved the scrolling part.
    pub(crate) swiped: f32,
    /// The seconds between frames while it plays, where drawing is slow; 0 where it is not.
    pub drawn_every: f64,
    pub(crate) opening: bool,
    /// Whether a request for steps is under way.
    pub(crate) busy: bool,
    /// The step whose report is awaited.
    pub(crate) awaited: Option<u64>,
    /// The step up to which steps are made at once, to restore a run.
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
            chart: PREDICTION,
            still: false,
            plays_first: false,
            turning: None,
            breaks: None,
            wants_bands: false,
            plays_on: false,
            help: false,
            seed_text: "1".to_owned(),
            copied: None,
            spots: Spots::default(),
            pointed: None,
            alone_shown: None,
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

    /// Takes the commands for the page, in order.
    pub fn take_commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.commands)
    }

    /// Whether there are commands for the page.
    pub(crate) fn has_commands(&self) -> bool {
        !self.commands.is_empty()
    }

    /// Adds a notice for the visitor, once.
    pub(crate) fn notice(&mut self, text: String) {
        const MOST: usize = 6;
        if !self.notices.contains(&text) {
            self.notices.push(text);
        }
        let surplus = self.notices.len().saturating_sub(MOST);
        self.notices.drain(..surplus);
    }

    /// The description of the session's experiment.
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

    /// Whether the panel works between its frames, and is drawn less often than it works.
    pub fn draws_sparingly(&self) -> bool {
        self.playing && self.drawn_every > 0.0
    }

    /// Whether steps can be made.
    pub fn is_ready(&self) -> bool {
        self.link == Link::Connected && self.session.is_some() && !self.opening && !self.history.is_empty()
    }

    /// The share of a run that has been restored, 0 to 1.
    pub fn restored(&self) -> Option<f32> {
        let target = self.restoring?;
        Some(self.history.latest() as f32 / target.max(1) as f32)
    }
}
