//! The messages between the panel and the page that holds it.
//!
//! The panel keeps no connection and reads no clock: the page reports events to it ([`Event`]) and carries out its
//! commands ([`Command`]), so that everything it does can be tested without a browser.

use std::collections::BTreeMap;

use body_schema_ask_tell::Outcome;
use body_schema_scenario::ScenarioSummary;
use body_schema_wire::{AppraisalReport, Choice, StepReport};
use serde::{Deserialize, Serialize};

use crate::wire::{Problem, Session, Standing};

/// An event that the page reports.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "is", rename_all = "snake_case")]
pub enum Event {
    /// The page was opened at this address.
    Begin {
        /// The address's query.
        query: String,
        /// Whether the visitor has been here before, so that the tour need not be offered.
        known: bool,
        /// Whether there is a server; without one the page computes by itself.
        #[serde(default = "usual")]
        server: bool,
        /// Whether the address as it was opened names nothing, so that what is shown is the page's choice.
        #[serde(default)]
        fresh: bool,
        /// Whether the visitor wants nothing to move by itself.
        #[serde(default)]
        still: bool,
    },
    /// The place of the scene.
    Layout {
        /// The side on which it is, seen from the panel.
        scene: Side,
    },
    /// The visitor went back or forth to this address.
    Navigated {
        /// The address's query.
        query: String,
    },
    /// The page that holds this one wants it to play.
    Play,
    /// That page wants it to pause.
    Pause,
    /// That page wants one more step.
    Forward,
    /// That page wants another run.
    Choose {
        /// The scenario's name, if it is to be another.
        scenario: Option<String>,
        /// The seed, if it is to be another.
        seed: Option<u64>,
    },
    /// The available scenarios.
    Scenarios {
        /// All of them.
        scenarios: Vec<ScenarioSummary>,
    },
    /// The sessions with robots elsewhere.
    Robots {
        /// Oldest first.
        sessions: Vec<Session>,
    },
    /// A request about a robot's movements is done; the session's new status comes by itself.
    Told,
    /// The requested session; null if there is none with that id.
    Session {
        /// The session.
        session: Option<Box<Session>>,
    },
    /// A request was refused.
    Refused {
        /// The name of the [`Command`] that was refused.
        asked: String,
        /// Why.
        problem: Problem,
    },
    /// The connection is open.
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
        /// The step that the session is at.
        step: u64,
    },
    /// The connection broke, and is tried again.
    Lost {
        /// The seconds until then.
        seconds: f64,
    },
    /// The session has ended.
    Ended {
        /// Why its engine failed, if it did.
        failure: Option<String>,
        /// Whether it ended while there was no connection: the server was started anew.
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
    /// The visitor clicked on a learner's arm in the scene.
    Picked {
        /// The learner.
        learner: String,
    },
    /// The scene cannot be drawn.
    NoScene {
        /// The reason.
        reason: String,
    },
    /// How a movement was chosen; null if it was not chosen by a search.
    Selection {
        /// The learner that was asked about.
        learner: String,
        /// The answer.
        selection: Option<Box<Choice>>,
    },
    /// What another posture would have taught.
    Evaluation {
        /// The answer.
        evaluation: Box<AppraisalReport>,
    },
    /// What the next movement would teach a learner whose movements the visitor chooses.
    Configured {
        /// The learner.
        learner: String,
        /// The answer.
        evaluation: Box<AppraisalReport>,
    },
    /// What each of many postures would teach.
    Surveyed {
        /// The session.
        session: String,
        /// Their gains in the order asked; none if they could not be had.
        gains: Vec<f64>,
    },
    /// A part of a run in the background.
    Seeds {
        /// Its seed.
        seed: u64,
        /// Its next reports; a request for steps is answered with those it made, so that the first is of step 1.
        reports: Vec<StepReport>,
        /// Whether this seed is done.
        done: bool,
    },
    /// Something was copied, or could not be.
    Copied {
        /// Whether copying succeeded.
        done: bool,
        /// A note on it, if it is not the usual one.
        #[serde(default)]
        note: Option<String>,
    },
}

/// The side on which something is, seen from the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// On the left.
    Left,
    /// On the right.
    #[default]
    Right,
    /// Above.
    Above,
}

fn usual() -> bool {
    true
}

/// A message of the session's WebSocket.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", content = "data", rename_all = "lowercase")]
pub enum Live {
    /// The description, which comes first; the session's resource has it already.
    Description(serde::de::IgnoredAny),
    /// A step.
    Step(Box<StepReport>),
    /// The status of a session with a robot elsewhere.
    Status(Box<Standing>),
}

/// A command to the page.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Command {
    /// Ask for the scenarios.
    Scenarios,
    /// Ask for the sessions with robots elsewhere.
    Robots,
    /// Leave for the page on which a visitor's own robot is calibrated.
    YourRobot,
    /// Ask for a suggestion of the next movement of a robot elsewhere.
    Suggest {
        /// The session.
        session: String,
    },
    /// Report that a suggestion is not carried out.
    EndSuggestion {
        /// The session.
        session: String,
        /// The suggestion's id.
        suggestion: u64,
        /// Its outcome.
        state: Outcome,
    },
    /// Report that a suggestion was carried out and nothing was seen.
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
        /// The size of the drawn ellipsoids.
        ellipsoids: String,
        /// What is to be other than in the scenario's file.
        set: Vec<String>,
        /// How many times as large differences of a real robot from its description are drawn.
        enlarge: u32,
    },
    /// Make steps.
    Step {
        /// The session.
        session: String,
        /// The number of steps.
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
    /// Ask what each of many postures would teach.
    Survey {
        /// The session.
        session: String,
        /// The learner.
        learner: String,
        /// Rad or m per joint, posture by posture.
        configurations: Vec<Vec<f64>>,
    },
    /// Show one learner alone in the scene.
    Alone {
        /// Its name; null for all.
        learner: Option<String>,
    },
    /// Highlight the line of the scene's legend with this mark, and no other.
    Point {
        /// The mark's name; null for none.
        at: Option<&'static str>,
    },
    /// Put a picture of the scene on the clipboard.
    Picture,
    /// Restore the first view of the scene.
    RestoreView,
    /// Run other seeds in the background.
    Seeds {
        /// The scenario's name.
        scenario: String,
        /// What is to be other than in the scenario's file.
        set: Vec<String>,
        /// The learners.
        learners: Vec<String>,
        /// The seeds.
        seeds: Vec<u64>,
        /// Steps of each.
        steps: u64,
    },
    /// Note that a seed has been run far enough.
    EnoughSeed {
        /// The seed.
        seed: u64,
    },
    /// Stop running other seeds.
    CancelSeeds,
    /// Set the page's address.
    Address {
        /// The query.
        query: String,
    },
    /// Put the page's address, or a text, on the clipboard.
    Copy {
        /// The text; for the address, its query with the question mark.
        text: String,
    },
    /// Offer a file for download.
    Download {
        /// Its path.
        path: String,
        /// Its name.
        name: String,
    },
    /// Remember that the visitor knows the tour.
    Known,
    /// Pass the state in words to assistive technology; scripts read the rest.
    Say(Box<Mirror>),
}

/// The panel's state in words and numbers, for visitors who do not see it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Mirror {
    /// The whole state in sentences.
    pub text: String,
    /// News to be read out.
    pub news: String,
    /// The panel's phase: `loading`, `ready`, `playing`, `stopped`, `lost`, `expired`, `failed`.
    pub phase: String,
    /// The step that is shown.
    pub step: u64,
    /// The latest step made.
    pub latest: u64,
    /// The session.
    pub session: String,
    /// The scenario.
    pub scenario: String,
    /// The seed.
    pub seed: u64,
    /// Why the run has stopped by itself, if it has.
    pub stopped: Option<String>,
    /// The errors of every learner at the step that is shown.
    pub errors: Vec<Errors>,
    /// Whether the visitor is typing, so that keys are text.
    pub typing: bool,
    /// The caption of the scene.
    pub caption: Caption,
}

/// The errors of a learner, as far as there is a truth or held-out data to judge by.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// The learner.
    pub learner: String,
    /// Mean error of the angles between axes, degrees.
    pub orientation_deg: Option<f64>,
    /// Mean distance to the true axis points, metres.
    pub location_m: Option<f64>,
    /// Mean distance of the predicted marker, metres.
    pub prediction_m: Option<f64>,
}

/// The texts of the legend under the scene, and of the caption under a picture of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Caption {
    /// Scenario, seed and step.
    pub title: String,
    /// Every learner of the session.
    pub learners: Vec<Captioned>,
    /// What the translucent ellipsoids are.
    pub ellipsoids: String,
    /// Whether a true arm is shown.
    pub truth: bool,
    /// What is drawn of the measurements, in words.
    pub seen: String,
    /// Whether the next suggested movement is shown.
    pub suggested: bool,
    /// The colour of the posture that the visitor tries out, if one is shown.
    pub tried: Option<[u8; 3]>,
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
