//! The visitor's choices.

use body_schema_scenario::ScenarioSummary;

/// The fastest playing, steps a second.
pub const MAX_SPEED: f64 = 100.0;
/// The slowest.
pub const MIN_SPEED: f64 = 0.5;
/// The furthest run.
pub const MAX_RUN: u64 = 100_000;
/// The furthest step that is played again to restore a run.
pub const MAX_RESTORED: u64 = 5_000;
/// The largest seed: the largest whole number that every part of a web page holds exactly.
pub const MAX_SEED: u64 = (1 << 53) - 1;

/// When a run stops before its last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopWhen {
    /// When every learner has learned the arm, as judged with hindsight and the truth, or has run away.
    Told,
    /// It does not.
    Never,
    /// When one learner says that it knows enough.
    First,
    /// When all say so.
    All,
}

impl StopWhen {
    /// All, in the order in which they are offered, with their names in the address and for people.
    pub const ALL: [(Self, &str, &str); 4] = [
        (Self::Told, "told", "when the story is told"),
        (Self::Never, "never", "only at the last step"),
        (Self::First, "first", "when one learner is sure of itself"),
        (Self::All, "all", "when all are sure of themselves"),
    ];
}

/// The tabs of the lower part of the panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tab {
    /// Errors over the steps.
    Charts,
    /// How the last movement was chosen.
    Why,
    /// Links, files, the command line.
    Share,
}

impl Tab {
    /// All, with their names in the address and for people.
    pub const ALL: [(Self, &str, &str); 3] =
        [(Self::Charts, "charts", "Charts"), (Self::Why, "why", "Why this posture?"), (Self::Share, "share", "Share")];
}

/// How large ellipsoids are drawn in the scene, with their names in the address and for people.
pub const ELLIPSOIDS: [(&str, &str); 3] = [("1-sigma", "1σ"), ("2-sigma", "2σ"), ("95-percent", "95 %")];

/// How many times as large differences of a real robot from its description may be drawn.
pub const ENLARGED: std::ops::RangeInclusive<u32> = 1..=50;

/// Everything that an address holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The scenario's name.
    pub scenario: String,
    /// What is to be other than in the scenario's file, as `KEY=VALUE`.
    pub set: Vec<String>,
    /// Seed of all random streams.
    pub seed: u64,
    /// The learners to compare; empty means those that the scenario runs by default.
    pub learners: Vec<String>,
    /// The step that is shown; `None` for the usual: the first, or the latest of a robot elsewhere.
    pub step: Option<u64>,
    /// Steps a second.
    pub speed: f64,
    /// The last step of a run; `None` for the scenario's.
    pub run_to: Option<u64>,
    /// When to stop before.
    pub stop: StopWhen,
    /// The tab that is shown.
    pub tab: Tab,
    /// The chart that stays in sight, by its title in the address; `None` for the usual one.
    pub chart: Option<String>,
    /// The learner whose choice is explained.
    pub learner: Option<String>,
    /// The joints of the slice.
    pub joints: Option<(usize, usize)>,
    /// How large ellipsoids are.
    pub ellipsoids: String,
    /// How many times as large the differences of a real robot from its description are drawn.
    pub enlarge: u32,
    /// The session, which only this server knows.
    pub session: Option<String>,
    /// It is one with a robot elsewhere, of which its address needs no more.
    pub robot: bool,
    /// The page stands in another one: transport and one chart only.
    pub embed: bool,
    /// The first look: transport, one chart and three sentences; everything else is folded away.
    pub brief: bool,
    /// Other seeds are run, for the bands behind the curves.
    pub bands: bool,
    /// The address asks for a game; taken by [`Settings::validate`], which makes it a choice of learners.
    pub play: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            scenario: "arm-6dof".to_owned(),
            set: Vec::new(),
            seed: 1,
            learners: Vec::new(),
            step: None,
            speed: 10.0,
            run_to: None,
            stop: StopWhen::Told,
            tab: Tab::Charts,
            chart: None,
            learner: None,
            joints: None,
            ellipsoids: ELLIPSOIDS[0].0.to_owned(),
            enlarge: 1,
            session: None,
            robot: false,
            embed: false,
            brief: false,
            bands: false,
            play: false,
        }
    }
}

impl Settings {
    /// The step at which a session that is made anew begins.
    pub fn first_step(&self) -> u64 {
        self.step.unwrap_or(1)
    }

    /// Holds the choice against what there is; what does not exist is replaced, with a notice.
    pub fn validate(&mut self, scenarios: &[ScenarioSummary]) -> Vec<String> {
        let mut notices = Vec::new();
        let Some(first) = scenarios.first() else { return notices };
        let scenario = scenarios.iter().find(|scenario| scenario.name == self.scenario).unwrap_or_else(|| {
            let asked = short(&self.scenario);
            notices.push(format!("There is no scenario “{asked}”; {} is shown instead.", first.name));
            first
        });
        scenario.name.clone_into(&mut self.scenario);
        if std::mem::take(&mut self.play) {
            self.learners = GAME.map(str::to_owned).to_vec();
            self.step = Some(0);
        }
        let offered = |name: &String| scenario.offered().any(|learner| learner.name == *name);
        for name in self.learners.iter().filter(|name| !offered(name)) {
            notices.push(format!("{} has no learner “{}”; it is left out.", scenario.name, short(name)));
        }
        self.learners.retain(offered);
        // In the scenario's order, so that one choice has one address.
        let place = |name: &String| scenario.offered().position(|learner| learner.name == *name);
        self.learners.sort_by_key(place);
        self.learners.dedup();
        if let Some((a, b)) = self.joints.filter(|(a, b)| (*a).max(*b) >= scenario.joints.len()) {
            let count = scenario.joints.len();
            notices.push(format!("{} has {count} joints, so there is no slice through {a} and {b}.", scenario.name));
            self.joints = None;
        }
        if let Some(name) = self.learner.take_if(|name| !offered(name)) {
            notices.push(format!("{} has no learner “{}” whose choice to explain.", scenario.name, short(&name)));
        }
        notices
    }
}

/// The learners of a game: the visitor, and whom to beat.
pub const GAME: [&str; 3] = ["active", "random", HUMAN];
/// The learner whose movements the visitor chooses.
pub const HUMAN: &str = "human";

/// As much of a text as a notice can hold.
pub(crate) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}
