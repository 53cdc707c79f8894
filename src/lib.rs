//! Learn a robot's kinematic body schema from a few well-chosen movements, and watch it happen.
//!
//! A robot moves its joints to angles θ, and a camera or tracker reports where a marker on its hand is. From such pairs this crate
//! estimates where every joint axis is, with its uncertainty, and chooses the next movement so that it teaches most. The source is
//!
//! > R. Martinez-Cantin, M. Lopes, L. Montesano: *Body Schema Acquisition through Active Learning*, ICRA 2010.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use body_schema::scenario::builtin;
//!
//! // Two learners in front of the same simulated arm: one chooses its movements, one draws them.
//! let learners = ["active".to_owned(), "random".to_owned()];
//! let mut experiment = builtin("arm-6dof")?.experiment(1, Some(&learners[..]))?;
//! let before = experiment.latest().learners[0].metrics.prediction_m;
//! for _ in 0..40 {
//!     experiment.step()?;
//! }
//! let after = experiment.latest().learners[0].metrics.prediction_m;
//! assert!(after < before.map(|metres| metres / 4.0));
//! # Ok(())
//! # }
//! ```
//!
//! Without scenarios: [`estimation::Rls`] learns from movements that somebody made, [`selection::Active`] chooses the next one, and
//! [`ask_tell::Session`] does both for a robot elsewhere.
//!
//! # Map
//!
//! This package is the program: the command line, the [server], the [export] of its page. It is made of the following crates, named here as
//! the program names them; each uses only those above it.
//!
//! | crate | module here | what it holds |
//! |---|---|---|
//! | `body-schema-engine` | [`kinematics`], [`model`], [`sensing`], [`estimation`], [`optimize`], [`selection`], [`design`] | what a robot is and what can be measured of it, and how both are learned and chosen |
//! | `body-schema-robot` | [`robot`] | descriptions of robots: URDF read and written |
//! | `body-schema-table` | [`table`] | tables of measurements in CSV, read as they stream by |
//! | `body-schema-diagnostics` | [`diagnostics`] | what is doubtful in such a table, with the evidence |
//! | `body-schema-discover` | [`discover`] | which column turns which part, from readings and measured places alone |
//! | `body-schema-experiment` | [`experiment`] | agents that propose and absorb, a world, a judge; what came of every step |
//! | `body-schema-wire` | [`wire`] | the reports that everything outside reads, made of that once they are wanted |
//! | `body-schema-scenario` | [`scenario`] | scenario files, strictly read, and the experiments that are drawn from them |
//! | `body-schema-calibration` | [`calibration`] | a robot calibrated by a table: fits, folds, figures, corrected descriptions |
//! | `body-schema-watch` | [`watch`] | sequential evidence that a calibrated robot has changed |
//! | `body-schema-ask-tell` | [`ask_tell`] | sessions with a robot elsewhere, which is asked to move and reports what it saw |
//! | `body-schema-palette` | | the colours that learners have everywhere |
//! | `body-schema-chart` | | panels of curves for print, as SVG and PNG |
//! | `body-schema-report` | [`report`] | reports of a calibration for readers: text, HTML, plots |
//! | `body-schema-sightings` | [`sightings`] | later sightings of a calibrated robot: read, held against it, told |
//! | `body-schema-files` | [`files`] | files and folders that get their names only once they are whole |
//! | `body-schema-recording` | [`recording`] | runs and calibrations as Rerun recordings and CSV files |
//! | `body-schema-backend` | [`backend`] | what a page asks of experiments, answered without a server |
//! | `body-schema-paper` | [`paper`] | the paper's experiments beside its numbers, drawn as charts |
//!
//! Those before `body-schema-palette` do no input or output, and build for `wasm32-unknown-unknown`. Notation, frames and units are told in
//! the crate `body-schema-engine`.

pub mod export;
pub mod page;

pub mod server;

pub use body_schema_ask_tell as ask_tell;
pub use body_schema_backend as backend;
pub use body_schema_calibration as calibration;
pub use body_schema_diagnostics as diagnostics;
pub use body_schema_discover as discover;
pub use body_schema_engine::{
    Instructions, design, elementary, estimation, kinematics, model, numeric_range, optimize, parallel, selection,
    sensing, suggest, use_at_most,
};
pub use body_schema_files as files;
pub use body_schema_paper as paper;
pub use body_schema_recording as recording;
pub use body_schema_report as report;
pub use body_schema_robot as robot;
pub use body_schema_scenario as scenario;
pub use body_schema_sightings as sightings;
pub use body_schema_table as table;
pub use body_schema_watch as watch;
pub use body_schema_wire as wire;

/// Several learners in one world, step by step; and what is [told](wire) of them, as it was always named beside them.
pub mod experiment {
    pub use body_schema_experiment::*;
    #[doc(no_inline)]
    pub use body_schema_wire::{
        AppraisalReport, BoxReport, ChannelReading, Choice, ChosenReport, Comparison, Curve, Description,
        IterationReport, JointDescription, JointReport, LearnerComparison, LearnerDescription, LearnerReport,
        LearnerResult, ModelReport, MovementReport, Quantiles, RunResult, RunSummary, SeedRun, StepReport, Summary,
        Trace,
    };
}

/// The code in the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
