//! The paper's experiments as data.

/// One experiment to rerun.
#[derive(Clone, Copy, Debug)]
pub struct PaperExperiment {
    /// Its name on the command line and in files.
    pub id: &'static str,
    /// Where the paper shows it.
    pub figure: &'static str,
    /// What is run.
    pub title: &'static str,
    /// The built-in scenario that it runs.
    pub scenario: &'static str,
    /// The learners compared.
    pub learners: &'static [&'static str],
    /// How it is run.
    pub kind: Kind,
    /// What the paper claims.
    pub claim: &'static str,
}

/// How an experiment is run.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// Learners side by side over all seeds.
    Comparison {
        /// Movements of every run.
        steps: u64,
        /// Movements with `--quick`.
        quick_steps: u64,
    },
    /// A comparison at each of several values of one key of the scenario.
    Sweep {
        /// The key, as `selection.epsilon`.
        key: &'static str,
        /// Its name on an axis, with its unit.
        label: &'static str,
        /// Its values.
        values: &'static [f64],
        /// Movements of every run.
        steps: u64,
        /// Movements with `--quick`.
        quick_steps: u64,
    },
    /// How long one choice takes: one run of the first seed, alone on one core.
    Timing {
        /// How many choices.
        steps: u64,
    },
    /// DIRECT on the criterion of one choice of the first seed.
    Selection {
        /// Which choice, counted from 1.
        step: u64,
    },
}

impl Kind {
    /// Movements of every run.
    pub fn steps(self, quick: bool) -> u64 {
        match self {
            Self::Comparison { quick_steps, .. } | Self::Sweep { quick_steps, .. } if quick => quick_steps,
            Self::Comparison { steps, .. } | Self::Sweep { steps, .. } | Self::Timing { steps } => steps,
            Self::Selection { step } => step,
        }
    }

    /// How many comparisons it takes.
    pub fn trials(self) -> u64 {
        match self {
            Self::Sweep { values, .. } => values.len() as u64,
            _ => 1,
        }
    }

    /// Whether only the first seed is run.
    pub fn is_single_run(self) -> bool {
        matches!(self, Self::Timing { .. } | Self::Selection { .. })
    }
}

/// The paper's learners.
const THREE: &[&str] = &["active", "random", "gradient"];

/// All of them, in the order of the paper.
pub const EXPERIMENTS: &[PaperExperiment] = &[
    PaperExperiment {
        id: "fig-3",
        figure: "Fig. 3",
        title: "DIRECT chooses a movement",
        scenario: "arm-6dof",
        learners: &["active"],
        kind: Kind::Selection { step: 1 },
        claim: "potentially optimal rectangles lie on the lower right convex hull of size and value",
    },
    PaperExperiment {
        id: "fig-4",
        figure: "Fig. 4",
        title: "simulated arm, 6 joints",
        scenario: "arm-6dof",
        learners: THREE,
        kind: Kind::Comparison { steps: 1000, quick_steps: 400 },
        claim: "prediction improves fast for all; active is better and faster in the parameters",
    },
    PaperExperiment {
        id: "fig-5",
        figure: "Fig. 5",
        title: "simulated torso and arm, 12 joints",
        scenario: "arm-12dof",
        learners: THREE,
        kind: Kind::Comparison { steps: 1000, quick_steps: 400 },
        claim: "the gradient is very slow, random needs far more than active, the wrist is hardest",
    },
    PaperExperiment {
        id: "selection-time",
        figure: "Fig. 5",
        title: "time to choose one movement, 12 joints, one core",
        scenario: "arm-12dof",
        learners: &["active"],
        kind: Kind::Timing { steps: 200 },
        claim: "0.3 s to choose one configuration",
    },
    PaperExperiment {
        id: "head-fov",
        figure: "Figs. 6, 7",
        title: "4 joints seen by the head, as on the real robot",
        scenario: "head-fov",
        learners: THREE,
        kind: Kind::Comparison { steps: 2000, quick_steps: 400 },
        claim: "active in under 80 observations, random about 600, the gradient not after 2000",
    },
    PaperExperiment {
        id: "head-fov-excursion",
        figure: "Figs. 6, 7",
        title: "4 joints seen by the head, each moving over 40 deg",
        scenario: "head-fov-excursion",
        learners: THREE,
        kind: Kind::Comparison { steps: 2000, quick_steps: 400 },
        claim: "the same with the real robot's excursion of 40 deg per joint",
    },
    PaperExperiment {
        id: "head-fov-doubled-error",
        figure: "text",
        title: "4 joints seen by the head, initial error of exactly the doubled size",
        scenario: "head-fov-doubled-error",
        learners: THREE,
        kind: Kind::Comparison { steps: 2000, quick_steps: 600 },
        claim: "active 250, random 1400",
    },
    PaperExperiment {
        id: "head-fov-doubled-error-up-to",
        figure: "text",
        title: "4 joints seen by the head, initial error of up to the doubled size",
        scenario: "head-fov-doubled-error-up-to",
        learners: THREE,
        kind: Kind::Comparison { steps: 2000, quick_steps: 600 },
        claim: "active 250, random 1400",
    },
    PaperExperiment {
        id: "arm-6dof-doubled-error",
        figure: "text",
        title: "simulated arm, 6 joints, doubled initial error",
        scenario: "arm-6dof-doubled-error",
        learners: THREE,
        kind: Kind::Comparison { steps: 2000, quick_steps: 600 },
        claim: "random is sometimes trapped in local minima",
    },
    PaperExperiment {
        id: "selectors",
        figure: "text",
        title: "other selectors and six numbers per joint, 6 joints, 100 evaluations",
        scenario: "arm-6dof-selectors",
        learners: &[
            "active",
            "active-direct",
            "active-bayesian",
            "active-random-search",
            "active-monte-carlo",
            "random",
            "random-six-numbers",
        ],
        kind: Kind::Comparison { steps: 300, quick_steps: 40 },
        claim: "Bayesian optimisation and Monte Carlo are not worth their cost",
    },
    PaperExperiment {
        id: "epsilon",
        figure: "text",
        title: "DIRECT's ε",
        scenario: "arm-6dof",
        learners: &["active"],
        kind: Kind::Sweep {
            key: "selection.epsilon",
            label: "DIRECT's ε",
            values: &[0.0, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1],
            steps: 400,
            quick_steps: 250,
        },
        claim: "any reasonable ε will do",
    },
    PaperExperiment {
        id: "learning-rates",
        figure: "text",
        title: "the gradient's learning rate",
        scenario: "arm-6dof",
        learners: &["gradient"],
        kind: Kind::Sweep {
            key: "gradient.rate",
            label: "learning rate η",
            values: &[0.01, 0.03, 0.1, 0.3, 0.5],
            steps: 1000,
            quick_steps: 400,
        },
        claim: "several learning rates were tried",
    },
    PaperExperiment {
        id: "stabilising-noise",
        figure: "text",
        title: "the variance of the stabilising noise",
        scenario: "arm-6dof",
        learners: &["random"],
        kind: Kind::Sweep {
            key: "filter.stabilising_noise.variance",
            label: "variance σn² (m² or rad² per movement)",
            values: &[3e-5, 3e-4, 3e-3, 3e-2, 3e-1],
            steps: 1000,
            quick_steps: 400,
        },
        claim: "stabilising noise limits the final accuracy",
    },
    PaperExperiment {
        id: "body-change",
        figure: "text",
        title: "the body changes while it is learned",
        scenario: "body-change",
        learners: &["active", "random", "gradient", "rigid"],
        kind: Kind::Comparison { steps: 1000, quick_steps: 500 },
        claim: "stabilising noise gives some adaptability",
    },
];

/// The experiment of that name.
pub fn experiment(id: &str) -> Option<&'static PaperExperiment> {
    EXPERIMENTS.iter().find(|experiment| experiment.id == id)
}
