//! Scenario files: what robot, what world, what learners.
//!
//! A scenario is TOML, read in two stages: `raw` says which keys there are, and `validate` turns them into a
//! [`Scenario`] whose values can be relied on. Every problem names the file, the line, the key and the mend. From a
//! scenario and a seed, [`assembly`] draws an experiment.
//!
//! The robot is written joint by joint, or is that of a URDF; the world is simulated, or a table of measurements. Where both are
//! files, whatever a scenario leaves out is taken from `measured.toml`, and from the table's titles.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod assembly;
mod builtin;
mod chain;
mod data;
mod edit;
mod error;
mod examine;
mod held_out;
mod learners;
mod misfit;
mod raw;
mod summary;
mod validate;

use std::{collections::BTreeMap, sync::Arc};

use nalgebra::{DVector, Point3, UnitVector3};

pub use builtin::{BUILTIN, Builtin, builtin};
pub use data::Measurements;
pub use edit::edited;
pub use error::{Problem, ScenarioError};
pub use held_out::{HeldOut, HeldOutRule};
pub use learners::{EstimatorKind, LearnerSpec, PolicyKind};
pub use summary::{ScenarioSummary, WorldKind};

use body_schema_engine::{
    estimation::{HypothesisSettings, StabilisingNoise},
    kinematics::JointBox,
    model::{Block, Layout, Loads, Names, Quantity, State},
    optimize::Settings,
    selection::{Constraints, CriterionUnits, Planning, Watch, Weights},
    sensing::{Equipment, Loss, Observation, Rig, Spacing},
};
use body_schema_experiment::{Body, Outliers, SocketDescription, Thresholds};
use body_schema_robot::{Chain, Urdf};

/// A validated scenario.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub title: String,
    /// Steps of a run unless told otherwise.
    pub steps: u64,
    /// The robot.
    pub robot: Robot,
    /// Where it moves.
    pub world: WorldSpec,
    /// What is measured, with the sensors' own noise; with what the filter assumes where measurements are replayed.
    pub rig: Arc<Rig>,
    /// Prior standard deviations.
    pub prior: Prior,
    /// Values of the recursive least squares.
    pub filter: Filter,
    /// Values of the unscented form; those of `filter` unless the file says otherwise.
    pub unscented: Filter,
    /// Values of the smoother.
    pub smoother: SmootherSpec,
    /// Rate η of the stochastic gradient; [`GRADIENT_RATE`](Self::GRADIENT_RATE) where the file has no learner by it and
    /// says nothing.
    pub gradient_rate: f64,
    /// How movements are chosen actively.
    pub selection: SelectionSpec,
    /// What movements are bound to, if to anything.
    pub constraints: Option<Constraints>,
    /// Thresholds of `converged_at`; [`THRESHOLDS`](Self::THRESHOLDS) where measurements are replayed and the file says
    /// nothing.
    pub thresholds: Thresholds,
    /// Expected prediction error below which a learner calls itself settled, metres.
    pub settled_below_m: f64,
    /// The learners it offers.
    pub learners: Vec<LearnerSpec>,
    /// The number of movements within which a learner promises to converge; what the convergence tests hold it to.
    pub promises: BTreeMap<String, u64>,
    /// The text it was read from.
    pub source: String,
    /// The files that it names, a robot's description among them, and their texts.
    pub data: Vec<(String, String)>,
}

impl Scenario {
    /// The rate η of a gradient that is composed, as in `gradient:random`, where the file has no `[gradient]`.
    pub const GRADIENT_RATE: f64 = 0.1;

    /// What recorded measurements would be judged by, were the truth known: 5° and 2 cm.
    pub const THRESHOLDS: Thresholds = Thresholds { orientation_deg: 5.0, location_m: 0.02 };

    /// The weights of the criterion.
    pub fn weights(&self) -> Weights {
        let layout = &self.robot.layout;
        Weights::new(self.selection.units, layout, &self.prior.standard_deviations(layout))
    }

    /// The text of a data file that this scenario has already read.
    pub fn data_file(&self, file: &str) -> Result<String, String> {
        let found = self.data.iter().find(|(name, _)| name == file).map(|(_, text)| text.clone());
        found.ok_or_else(|| "is not a data file of this scenario".to_owned())
    }
}

/// The robot of a scenario. In a simulated world this is the truth; in a measured one the nominal description.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Joint names, base first.
    pub names: Vec<String>,
    /// Its parameters.
    pub state: State,
    /// Which of them are learned.
    pub layout: Layout,
    /// Joint limits.
    pub limits: JointBox,
    /// What it is drawn as.
    pub body: Option<Body>,
    /// How well targets and cameras that are learned are known.
    pub known: Vec<(Block, Known)>,
    /// What its sensors can name.
    pub equipment: Equipment,
    /// The sockets in which targets are held, in the order of the state's.
    pub sockets: Vec<SocketSpec>,
    /// Those that nobody learns from.
    pub held_out_sockets: Vec<SocketSpec>,
    /// What is known of distances between sockets.
    pub spacings: Vec<Spacing>,
    /// Whether predictions are judged after the rigid motion that fits best.
    pub up_to_motion: bool,
    /// How its load pulls at its joints.
    pub gravity: Gravity,
    /// The description that the joints are from, if they are not written in the scenario.
    pub described: Option<Arc<Described>>,
}

impl Robot {
    /// What everything that can be learned is called.
    pub fn called(&self) -> Names {
        Names {
            joints: self.names.clone(),
            targets: self.equipment.targets.iter().map(|target| target.name.clone()).collect(),
            cameras: self.equipment.cameras.iter().map(|camera| camera.name.clone()).collect(),
            sockets: self.sockets.iter().chain(&self.held_out_sockets).map(SocketSpec::label).collect(),
        }
    }

    /// What the joints of such a robot bear, as `described`.
    pub fn loads(&self, described: &State) -> Arc<Loads> {
        Arc::new(Loads::new(described, self.gravity.up, self.gravity.elbow))
    }
}

/// What is known of how a robot's load pulls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gravity {
    /// Away from the ground, in the frame of the base.
    pub up: UnitVector3<f64>,
    /// The joint at whose origin the elbow is; the middle one that turns if none is named.
    pub elbow: Option<usize>,
}

/// A robot's description, and what of it the scenario is about.
#[derive(Clone, Debug)]
pub struct Described {
    /// The file, as the scenario names it.
    pub file: String,
    /// The description with its text.
    pub urdf: Urdf,
    /// The chain from the base to the tip.
    pub chain: Chain,
}

/// A place beside the robot in which a target is held.
#[derive(Clone, Debug, PartialEq)]
pub struct SocketSpec {
    /// Its name, among those of one place.
    pub name: String,
    /// The place where it stands, with others.
    pub place: Option<String>,
    /// The target.
    pub target: usize,
    /// Where it truly is, frame of the measurements, metres.
    pub at: Point3<f64>,
    /// A posture that holds the target there; of sockets that are learned from the first movement, which everybody is told.
    pub posture: Vec<f64>,
    /// Whether there is a guess of where it is. Otherwise it is taken to be where the guessed robot has the target in `posture`.
    pub is_guessed: bool,
    /// What play and the noise of the joints amount to at the target, metres per coordinate.
    pub sigma_m: f64,
}

impl SocketSpec {
    /// Its place and its name.
    pub fn label(&self) -> String {
        let (name, place) = (self.name.clone(), self.place.clone());
        SocketDescription { name, place, at_m: None, held_out: false }.label()
    }
}

/// The world of a scenario.
#[derive(Clone, Debug)]
pub enum WorldSpec {
    /// The robot is the truth; the initial estimate is drawn around it.
    Simulated {
        /// How wrong the initial estimate is.
        initial_error: InitialError,
        /// The head that watches, if the marker is not always seen.
        watch: Option<Watch>,
        /// How the body changes during a run, if it does.
        change: Option<Box<ChangeSpec>>,
        /// Readings that have nothing to do with the robot, if there are any.
        outliers: Option<Outliers>,
    },
    /// A recorded data set is replayed; the initial estimate is the nominal robot, wherever it may stand.
    Measured {
        /// The rows.
        measurements: Measurements,
        /// Which of them are held out.
        held_out: HeldOut,
    },
    /// A robot elsewhere, which is told where to move and tells what was observed; the initial estimate is its description,
    /// wherever it may stand.
    Outside {
        /// What is known to be seen, where sensors see some postures only.
        watch: Option<Watch>,
        /// What is known before any movement, as the distance between two sockets.
        beforehand: Option<Observation>,
    },
}

/// A change of the body.
#[derive(Clone, Debug)]
pub struct ChangeSpec {
    /// The number of movements after which it happens.
    pub step: u64,
    /// The true state from then on.
    pub truth: State,
}

/// How the error of the initial estimate is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialError {
    /// Uniform up to the size, or exactly the size with random signs.
    pub draw: ErrorDraw,
    /// Size of each of the three Euler angles that turn an axis, radians.
    pub angle_rad: f64,
    /// Size of the shift of a point along each coordinate, metres.
    pub point_m: f64,
    /// Size of the shift of the marker along each coordinate, metres; 0 if it is known.
    pub marker_m: f64,
}

/// The distribution of the initial error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorDraw {
    /// Uniform between minus and plus the size.
    UpTo,
    /// Minus or plus the size, with equal chance.
    Exactly,
    /// No guess at all: directions uniform on the sphere, points uniform within plus and minus the size around the
    /// origin. Nothing in it comes from the truth.
    Anywhere,
}

/// How well a block other than an axis is known before any measurement: how wrong the initial estimate is, and what the prior
/// says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Known {
    /// Uniform up to these sizes per coordinate, which are also the prior's standard deviations.
    Within {
        /// Of lengths, metres.
        length_m: f64,
        /// Of angles, radians.
        angle_rad: f64,
        /// Of pixels and of plain numbers.
        other: f64,
    },
    /// Nothing but that it is within so many metres of the origin, turned in any way.
    Anywhere {
        /// The bound, metres.
        within_m: f64,
    },
}

impl Known {
    /// How well what is said to be known, or held, is known: in metres, radians or as a number.
    pub(crate) const EXACTLY: f64 = 1e-6;
}

/// Prior standard deviations in tangent coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Of a direction, radians.
    pub direction_rad: f64,
    /// Of a point, metres.
    pub point_m: f64,
    /// Of the marker, metres.
    pub marker_m: f64,
    /// Of the zeros of the readings of a described robot's joints: of those that turn, radians.
    pub zero_rad: f64,
    /// Of those that slide, metres.
    pub zero_m: f64,
    /// Of how much a joint gives way, rad per N·m with which gravity pulls at 1 kg.
    pub compliance_rad_per_nm: f64,
    /// Of other blocks, where they are learned.
    pub known: BTreeMap<Block, Known>,
}

impl Prior {
    /// What is known of a block that is neither an axis nor the marker of the robot.
    pub fn of(&self, block: Block) -> Option<Known> {
        self.known.get(&block).copied()
    }

    /// The standard deviation of every tangent coordinate.
    pub fn standard_deviations(&self, layout: &Layout) -> DVector<f64> {
        let mut deviations = DVector::zeros(layout.dimension());
        for (block, range) in layout.blocks() {
            for k in range {
                deviations[k] = match (self.of(block), layout.quantities()[k]) {
                    (Some(Known::Anywhere { within_m }), Quantity::Length) => within_m / 3_f64.sqrt(),
                    (Some(Known::Anywhere { .. }), _) => std::f64::consts::PI / 3_f64.sqrt(),
                    (Some(Known::Within { length_m, .. }), Quantity::Length) => length_m,
                    (Some(Known::Within { angle_rad, .. }), Quantity::Angle) => angle_rad,
                    (Some(Known::Within { other, .. }), _) => other,
                    (None, quantity) => match (block, quantity) {
                        (Block::Axis(_), Quantity::Length) => self.point_m,
                        (_, Quantity::Length) => self.marker_m,
                        (_, Quantity::Compliance) => self.compliance_rad_per_nm,
                        _ => self.direction_rad,
                    },
                };
            }
        }
        deviations
    }
}

/// Values of the recursive least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// r of the R = r I that the filter assumes for the first channel, in the square of its unit.
    pub variance: f64,
    /// The stabilising noise of (5), if any.
    pub stabilising: Option<StabilisingNoise>,
}

impl Filter {
    /// σ of the first channel as the filter assumes it; the other channels' in proportion.
    pub fn sigma(&self) -> f64 {
        self.variance.sqrt()
    }
}

/// Values of the smoother.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmootherSpec {
    /// σ of the first channel as it assumes it: the sensor's own unless the file says otherwise.
    pub sigma: f64,
    /// How many hypotheses it keeps and searches.
    pub hypotheses: HypothesisSettings,
    /// What a reading costs that is far from its prediction.
    pub loss: Loss,
    /// Whether it is not told how much noise there is, so that the sensors' σ are units alone.
    pub noise_unknown: bool,
    /// Whether it is not told how far the joints' readings are off, and learns it.
    pub joints_unknown: bool,
}

/// How movements are chosen actively.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionSpec {
    /// DIRECT's variant, ε and budget.
    pub search: Settings,
    /// The units of the criterion.
    pub units: CriterionUnits,
    /// How movements are planned ahead, by learners that plan.
    pub planning: Planning,
}
