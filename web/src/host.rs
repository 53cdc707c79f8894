//! What passes between the panel and the page that holds it.
//!
//! The panel keeps no connection and reads no clock: the page tells it what happened ([`Event`]) and does what it asks
//! ([`Command`]). So everything that it does can be tested without a browser.

use std::collections::BTreeMap;

use body_schema_ask_tell::Outcome;
use body_schema_scenario::ScenarioSummary;
use body_schema_wire::{AppraisalReport, Choice, StepReport};
use serde::{Deserialize, Serialize};

use crate::wire::{Problem, Session, Standing};

/// What happened.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "is", rename_all = "snake_case")]
pub enum Event {
    /// The page was opened at this address.
    Begin {
        /// The address's query.
        query: String,
        /// The visitor has been here before, so that the tour need not be offered.
        known: bool,
        /// Whether a server is there; without one the page shows recorded runs.
        #[serde(default = "usual")]
        server: bool,
        /// The seeds of the recorded runs, where there is no server.
        #[serde(default)]
        seeds: Vec<u64>,
    },
    /// Where the scene is.
    Layout {
        /// Seen from the panel.
        scene: Side,
    },
    /// The visitor went back or forth to this address.
    Navigated {
        /// The address's query.
        query: String,
    },
    /// The scenarios there are.
    Scenarios {
        /// All of them.
        scenarios: Vec<ScenarioSummary>,
    },
    /// The sessions with robots elsewhere.
    Robots {
        /// Oldest first.
        sessions: Vec<Session>,
    },
    /// What was asked for or said about a robot's movements is done; how the session stands since comes by itself.
    Told,
    /// The session that was asked for is there; null if there is none of that id.
    Session {
        /// The session.
        session: Option<Box<Session>>,
    },
    /// A request was refused.
    Refused {
        /// What was asked, a [`Command`]'s name.
        asked: String,
        /// Why.
        problem: Problem,
    },
    /// The connection stands.
    Connected,
    /// A message of the session's WebSocket.
    Live {
        /// A description or a report.
        message: Live,
    },
    /// The request for steps is over.
    Stepped {
        /// The session that was stepped.
        session: String,
        /// The step that it is at.
        step: u64,
    },
    /// The connection broke; it is tried again.
    Lost {
        /// After so many seconds.
        seconds: f64,
    },
    /// The session has ended.
    Ended {
        /// Why its engine failed, if it did.
        failure: Option<String>,
        /// It went while there was no connection: the server was started anew.
        unseen: bool,
    },
    /// The scene shows this step.
    Shown {
        /// The step.
        step: u64,
    },
    /// The visitor moved the scene's time to this step.
    Scrubbed {
        /// The step.
        step: u64,
    },
    /// The scene cannot be drawn.
    NoScene {
        /// Why.
        reason: String,
    },
    /// How a movement was chosen; null if it was not chosen by a search.
    Selection {
        /// The learner asked for.
        learner: String,
        /// The answer.
        selection: Option<Box<Choice>>,
    },
    /// What another posture would have taught.
    Evaluation {
        /// The answer.
        evaluation: Box<AppraisalReport>,
    },
    /// What the next movement of a learner whose movements the visitor chooses would teach.
    Configured {
        /// The learner.
        learner: String,
        /// The answer.
        evaluation: Box<AppraisalReport>,
    },
    /// A part of a run in the background.
    Seeds {
        /// Its seed.
        seed: u64,
        /// Its next reports; a request for steps answers with those it made, so that the first is of step 1.
        reports: Vec<StepReport>,
        /// Whether this seed is done.
        done: bool,
    },
    /// Something was copied, or could not be.
    Copied {
        /// Whether it was.
        done: bool,
        /// What there is to say about it, if it is not the usual.
        #[serde(default)]
        note: Option<String>,
    },
}

/// Where something lies, seen from the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Beside it, on the left.
    Left,
    /// Beside it, on the right.
    #[default]
    Right,
    /// Above it.
    Above,
}

fn usual() -> bool {
    true
}

/// A message of the session's WebSocket.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", content = "data", rename_all = "lowercase")]
pub enum Live {
    /// The first; the session's resource has said it already.
    Description(serde::de::IgnoredAny),
    /// A step.
    Step(Box<StepReport>),
    /// With a robot elsewhere: how it stands.
    Status(Box<Standing>),
}

/// What the page is to do.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Command {
    /// Ask for the scenarios.
    Scenarios,
    /// Ask for the sessions with robots elsewhere.
    Robots,
    /// Have the next movement of a robot elsewhere suggested.
    Suggest {
        /// The session.
        session: String,
    },
    /// Say that a suggestion is not carried out.
    EndSuggestion {
        /// The session.
        session: String,
        /// The suggestion's id.
        suggestion: u64,
        /// What becomes of it.
        state: Outcome,
    },
    /// Say that a suggestion was carried out and nothing was seen.
    NotSeen {
        /// The session.
        session: String,
        /// The suggestion's id.
        suggestion: u64,
        /// Where the joints are, by name.
        configuration: BTreeMap<String, f64>,
    },
    /// Look for a session.
    Find {
        /// Its id.
        session: String,
    },
    /// Open a session, follow it, and end the one before.
    Open {
        /// The scenario's name.
        scenario: String,
        /// The seed.
        seed: u64,
        /// The learners; null for all.
        learners: Option<Vec<String>>,
        /// How large ellipsoids are drawn.
        ellipsoids: String,
    },
    /// Make steps.
    Step {
        /// Where.
        session: String,
        /// How many.
        count: u64,
        /// The step that the session must be at.
        expected_step: u64,
        /// Postures to show on the way to each new one.
        frames: u64,
    },
    /// Show this step in the scene.
    Seek {
        /// The step.
        step: u64,
    },
    /// Ask how a movement was chosen.
    Select {
        /// The session.
        session: String,
        /// The learner.
        learner: String,
    },
    /// Ask what a posture would have taught.
    Evaluate {
        /// The session.
        session: String,
        /// The learner.
        learner: String,
        /// Rad or m per joint.
        configuration: Vec<f64>,
    },
    /// Set the next movement of a learner whose movements the visitor chooses.
    Configure {
        /// The session.
        session: String,
        /// The learner.
        learner: String,
        /// Rad or m per joint.
        configuration: Vec<f64>,
    },
    /// Point at the line of the scene's legend with this mark, and at no other.
    Point {
        /// The mark's name; null for none.
        at: Option<&'static str>,
    },
    /// Put a picture of the scene on the clipboard.
    Picture,
    /// Show the scene as it was at first.
    RestoreView,
    /// Run other seeds in the background.
    Seeds {
        /// The scenario's name.
        scenario: String,
        /// The learners.
        learners: Vec<String>,
        /// The seeds.
        seeds: Vec<u64>,
        /// Steps of each.
        steps: u64,
    },
    /// Of this seed nothing more is needed.
    EnoughSeed {
        /// The seed.
        seed: u64,
    },
    /// Stop running other seeds.
    CancelSeeds,
    /// Make this the address.
    Address {
        /// The query.
        query: String,
    },
    /// Put the page's address, or a text, on the clipboard.
    Copy {
        /// The text; for the address, its query with the question mark.
        text: String,
    },
    /// Offer a file.
    Download {
        /// Where it is.
        path: String,
        /// Its name.
        name: String,
    },
    /// Remember that the visitor knows the tour.
    Known,
    /// Tell assistive technology; scripts read the rest.
    Say(Box<Mirror>),
}

/// The panel's state in words and numbers, for those who do not see it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Mirror {
    /// All of it in sentences.
    pub text: String,
    /// What has just happened, to be read out.
    pub news: String,
    /// What the panel is about: `loading`, `ready`, `playing`, `stopped`, `lost`, `expired`, `failed`.
    pub phase: String,
    /// The step that is shown.
    pub step: u64,
    /// The latest step made.
    pub latest: u64,
    /// The session.
    pub session: String,
    /// Whether the visitor is typing, so that keys are text.
    pub typing: bool,
    /// What is shown in the scene.
    pub caption: Caption,
}

/// What the legend over the scene says, and what stands under a picture of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Caption {
    /// Scenario, seed and step.
    pub title: String,
    /// Every learner of the session.
    pub learners: Vec<Captioned>,
    /// What the translucent ellipsoids are.
    pub ellipsoids: String,
    /// Whether there is a true arm to be seen.
    pub truth: bool,
    /// What is drawn of the measurements.
    pub seen: String,
    /// Whether the movement that is suggested next can be seen.
    pub suggested: bool,
}

/// A learner, as a caption names it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Captioned {
    /// Its name.
    pub name: String,
    /// Its errors at the step that is shown, with their units.
    pub errors: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
}
