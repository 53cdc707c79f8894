//! Scenario files: what robot, what world, what learners.
//!
//! A scenario is TOML, read in two stages: `raw` says which keys there are, and `validate` turns them into a [`Scenario`] whose
//! values can be relied on. Every problem names the file, the line, the key, and what to do. From a scenario and a seed,
//! [`assembly`] draws an experiment.
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
mod kinds;
mod knobs;
mod learners;
mod misfit;
mod raw;
mod resection;
mod summary;
mod validate;

use std::{collections::BTreeMap, sync::Arc};

use nalgebra::{DVector, Point3, UnitVector3};

pub use builtin::{BUILTIN, Builtin, builtin, ships};
pub use data::Measurements;
pub use edit::{Replacement, edited};
pub use error::{Problem, ScenarioError};
pub use held_out::{HeldOut, HeldOutRule};
pub use kinds::{EstimatorKind, PolicyKind};
pub use knobs::{Knob, KnobKey};
pub use learners::LearnerSpec;
pub use summary::ScenarioSummary;

use body_schema_engine::{
    estimation::{HypothesisSettings, StabilisingNoise},
    kinematics::JointBox,
    model::{Block, Layout, Links, Loads, Names, Quantity, State},
    optimize::Settings,
    selection::{Constraints, CriterionUnits, Hull, Outline, Planning, Watch, Weights},
    sensing::{Baseline, Channel as _, Equipment, Loss, MeasurementModel, Observation},
};
use body_schema_experiment::{Body, Outliers, Thresholds, socket_label};
use body_schema_robot::{Chain, Urdf};

/// A validated scenario.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub title: String,
    /// The steps of a run, unless stated otherwise.
    pub steps: u64,
    /// The robot.
    pub robot: Robot,
    /// The world in which the robot moves.
    pub world: WorldSpec,
    /// The measurement model, with the sensors' own noise; with the noise that the filter assumes where measurements
    /// are replayed.
    pub measurement_model: Arc<MeasurementModel>,
    /// Prior standard deviations.
    pub prior: Prior,
    /// Values of the recursive least squares.
    pub filter: Filter,
    /// Values of the unscented form; those of `filter` unless the file says otherwise.
    pub unscented: Filter,
    /// Values of the smoother.
    pub smoother: SmootherSpec,
    /// Rate η of the stochastic gradient; [`GRADIENT_RATE`](Self::GRADIENT_RATE) where the file has no learner that uses
    /// it and states none.
    pub gradient_rate: f64,
    /// The settings of active selection.
    pub selection: SelectionSpec,
    /// The constraints on movements, if there are any.
    pub constraints: Option<Constraints>,
    /// Thresholds of `converged_at`; [`THRESHOLDS`](Self::THRESHOLDS) where measurements are replayed and the file
    /// states none.
    pub thresholds: Thresholds,
    /// Expected prediction error below which a learner calls itself settled, metres.
    pub settled_below_m: f64,
    /// The learners that it offers.
    pub learners: Vec<LearnerSpec>,
    /// The number of movements within which each learner promises to converge; the convergence tests check it.
    pub promises: BTreeMap<String, u64>,
    /// What was replaced in the file, as [`Replacement`]s are written; empty for the scenario as it is.
    pub replaced: Vec<String>,
    /// The text it was read from.
    pub source: String,
    /// The files that it names, a robot's description among them, and their texts.
    pub data: Vec<(String, String)>,
}

impl Scenario {
    /// The rate η of a composed gradient learner, such as `gradient:random`, where the file has no `[gradient]`.
    pub const GRADIENT_RATE: f64 = 0.1;

    /// The default thresholds for recorded measurements: 5° and 2 cm. They are reported only; without a truth nothing
    /// is judged by them.
    pub const THRESHOLDS: Thresholds = Thresholds { orientation_deg: 5.0, location_m: 0.02 };

    /// The weights of the criterion.
    pub fn weights(&self) -> Weights {
        let layout = &self.robot.layout;
        Weights::new(self.selection.units, layout, &self.prior.standard_deviations(layout))
    }

    /// The text of a data file that this scenario has already read.
    ///
    /// # Errors
    ///
    /// A clause that continues the file's name, if this scenario has not read such a file.
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
    /// Its shape in drawings.
    pub body: Option<Body>,
    /// The prior knowledge of learned targets and cameras.
    pub known: Vec<(Block, Known)>,
    /// The targets and cameras that its sensors can name.
    pub equipment: Equipment,
    /// The sockets in which targets are held, in the order of the state's.
    pub sockets: Vec<SocketSpec>,
    /// The held-out sockets.
    pub held_out_sockets: Vec<SocketSpec>,
    /// The known distances between sockets.
    pub spacings: Vec<SpacingSpec>,
    /// The known places of cameras in the frames of others.
    pub baselines: Vec<BaselineSpec>,
    /// Whether predictions are judged after the rigid motion that fits best.
    pub up_to_motion: bool,
    /// The direction of gravity, and the joint of the elbow.
    pub gravity: Gravity,
    /// The description that the joints come from, if they are not written in the scenario.
    pub described: Option<Arc<Described>>,
    /// What its links are made of, as far as the description or a file beside it says.
    pub shapes: Vec<Hull>,
}

impl Robot {
    /// The sockets by their numbers: those that are learned, then those that are held out.
    pub fn all_sockets(&self) -> impl Iterator<Item = &SocketSpec> {
        self.sockets.iter().chain(&self.held_out_sockets)
    }

    /// The names of everything that can be learned.
    pub fn called(&self) -> Names {
        Names {
            joints: self.names.clone(),
            targets: self.equipment.targets.iter().map(|target| target.name.clone()).collect(),
            cameras: self.equipment.cameras.iter().map(|camera| camera.name.clone()).collect(),
            sockets: self.all_sockets().map(SocketSpec::label).collect(),
        }
    }

    /// What a robot that somebody owns is bound to where its file says nothing of its links: they are held apart as they are shaped, or
    /// as capsules of a usual thickness where nothing says how, unless that excludes everything. Those that are nearer where it starts, with a target in a socket or in one of
    /// the `known` postures are not: it has been there.
    pub(crate) fn held_apart(&self, given: Option<Constraints>, known: &[Vec<f64>]) -> Option<Constraints> {
        /// The usual thickness, as a share of the robot's length.
        const THICKNESS: f64 = 0.08;
        /// What shapes are held apart by, as a share of it: a description may be off by as much.
        const MARGIN: f64 = 0.01;
        if given.as_ref().is_some_and(|given| given.clearance.is_some() || given.allowed.is_some()) {
            return given;
        }
        let outline = || Outline::new(&self.state, &self.names, &self.equipment);
        let unbound = || Constraints::new(self.names.clone(), self.limits.clone(), outline());
        let mut held = given.clone().unwrap_or_else(unbound);
        let start = held.start.clone();
        let been = start.iter().chain(self.sockets.iter().map(|socket| &socket.posture)).chain(known);
        let (length, been) = (held.length(), been.map(Vec::as_slice));
        match &self.shapes[..] {
            [] => held.hold_apart(THICKNESS * length, been),
            shapes => held.hold_shapes_apart(shapes.to_vec(), MARGIN * length, THICKNESS * length, been),
        }
        let holds = held.clearance.as_ref().is_some_and(|clearance| clearance.pairs() > 0);
        if holds && held.some(start.as_deref()).is_ok() { Some(held) } else { given }
    }

    /// The loads on the joints of such a robot, described as `described`.
    pub fn loads(&self, described: &State) -> Arc<Loads> {
        Arc::new(described.loads_under(self.gravity.up, self.gravity.elbow))
    }
}

/// The direction of gravity, and the joint of the elbow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gravity {
    /// The upward direction, in the frame of the base.
    pub up: UnitVector3<f64>,
    /// The joint at whose origin the elbow is; the middle one that turns if none is named.
    pub elbow: Option<usize>,
}

/// A robot's description, and the chain that the scenario uses.
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
    /// Its name, among the sockets of one place.
    pub name: String,
    /// The place where it stands, if sockets are grouped by place.
    pub place: Option<String>,
    /// The target.
    pub target: usize,
    /// Its true position, frame of the measurements, metres.
    pub at: Point3<f64>,
    /// A posture that holds the target there; for sockets that are learned from the first movement, a posture that every
    /// learner is given.
    pub posture: Vec<f64>,
    /// Whether its position is guessed. Otherwise it is taken to be where the guessed robot has the target in `posture`.
    pub is_guessed: bool,
    /// The noise at the target from play and from the joints, metres per coordinate.
    pub sigma_m: f64,
}

impl SocketSpec {
    /// Its place and its name, as one label.
    pub fn label(&self) -> String {
        socket_label(self.place.as_deref(), &self.name)
    }
}

/// A known distance between two sockets, such as that of a tool measured once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacingSpec {
    /// The indices of the two sockets.
    pub sockets: [usize; 2],
    /// The standard deviation of the distance, metres.
    pub sigma_m: f64,
}

impl Robot {
    /// Where cameras are in the frames of others, as it is described: six numbers each (metres, radians).
    pub(crate) fn known_baselines(&self) -> impl Iterator<Item = Vec<f64>> {
        let anywhere = vec![0.0; self.state.joints.len()];
        self.baselines.iter().map(move |spec| {
            let mut reading = vec![0.0; 6];
            spec.between.predict(Links::new(&self.state).at(&anywhere), &mut reading);
            reading
        })
    }
}

/// A known place of a camera in the frame of another on the same link, such as that of a stereo pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineSpec {
    /// Which camera is in the frame of which.
    pub between: Baseline,
    /// The standard deviation of its position, metres per coordinate.
    pub sigma_m: f64,
    /// That of its rotation, radians about each axis.
    pub sigma_rad: f64,
}

/// The world of a scenario.
#[derive(Clone, Debug)]
pub enum WorldSpec {
    /// The robot is the truth; the initial estimate is drawn around it.
    Simulated {
        /// The error of the initial estimate.
        initial_error: InitialError,
        /// The head that watches, if the marker is not always seen.
        watch: Option<Watch>,
        /// The change of the body during a run, if there is one.
        change: Option<Box<ChangeSpec>>,
        /// The outliers among readings, if there are any.
        outliers: Option<Outliers>,
    },
    /// A recorded data set is replayed; the initial estimate is the nominal robot, wherever it may stand.
    Measured {
        /// The rows.
        measurements: Measurements,
        /// The rule by which rows are held out.
        held_out: HeldOut,
    },
    /// A robot elsewhere, which is asked to move and reports what was observed; the initial estimate is its description,
    /// wherever it may stand.
    External {
        /// A posture known to be seen, where sensors see some postures only.
        watch: Option<Watch>,
        /// Observations from before any movement, such as the distance between two sockets.
        beforehand: Option<Observation>,
    },
}

/// The kind of world in which movements are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum WorldKind {
    /// A simulated arm whose truth is known to the judges.
    Simulated,
    /// A recorded data set without a known truth.
    Measured,
    /// A robot elsewhere, which is asked to move and reports what was observed.
    #[serde(rename = "outside")]
    External,
}

impl WorldSpec {
    /// The kind of this world.
    pub fn kind(&self) -> WorldKind {
        match self {
            Self::Simulated { .. } => WorldKind::Simulated,
            Self::Measured { .. } => WorldKind::Measured,
            Self::External { .. } => WorldKind::External,
        }
    }
}

/// A change of the body.
#[derive(Clone, Debug)]
pub struct ChangeSpec {
    /// The number of movements after which it happens.
    pub step: u64,
    /// The true state from then on.
    pub truth: State,
}

/// The distribution of the initial estimate's error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialError {
    /// Whether it is uniform up to the size, or exactly the size with random signs.
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
    /// No guess: directions uniform on the sphere, points uniform within plus and minus the size around the origin. The
    /// truth does not enter.
    Anywhere,
}

/// The prior knowledge of a block other than an axis: the error of the initial estimate, and the prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Known {
    /// Uniform up to these sizes per coordinate, which are also the prior's standard deviations.
    Within {
        /// The size for lengths, metres.
        length_m: f64,
        /// The size for angles, radians.
        angle_rad: f64,
        /// The size for pixels and plain numbers.
        other: f64,
    },
    /// Anywhere within so many metres of the origin, with any rotation.
    Anywhere {
        /// The bound, metres.
        within_m: f64,
    },
}

impl Known {
    /// The standard deviation of what is taken to be known exactly: in metres, radians or as a number.
    pub(crate) const EXACTLY: f64 = 1e-6;
}

/// Prior standard deviations in tangent coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// The standard deviation of a direction, radians.
    pub direction_rad: f64,
    /// The standard deviation of a point, metres.
    pub point_m: f64,
    /// The standard deviation of the marker, metres.
    pub marker_m: f64,
    /// The standard deviation of the zeros of a described robot's joints that turn, radians.
    pub zero_rad: f64,
    /// The standard deviation of the zeros of joints that slide, metres.
    pub zero_m: f64,
    /// The standard deviation of a joint's compliance, rad per N·m with which gravity pulls at 1 kg.
    pub compliance_rad_per_nm: f64,
    /// The knowledge of other learned blocks.
    pub known: BTreeMap<Block, Known>,
}

impl Prior {
    /// The prior knowledge of a block that is neither an axis nor the marker of the robot.
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
    /// The share of the predicted spread that an update of `rls` takes for noise; 0 in the paper.
    pub underweighting: f64,
}

impl Filter {
    /// σ of the first channel as the filter assumes it; those of other channels change in proportion.
    pub fn sigma(&self) -> f64 {
        self.variance.sqrt()
    }
}

/// Values of the smoother.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmootherSpec {
    /// σ of the first channel as the smoother assumes it: the sensor's own unless the file says otherwise.
    pub sigma: f64,
    /// The number of hypotheses that are kept and searched.
    pub hypotheses: HypothesisSettings,
    /// The cost of a reading, as a function of its distance from the prediction.
    pub loss: Loss,
    /// Whether the size of the noise is unknown, so that the sensors' σ are only units.
    pub noise_unknown: bool,
    /// Whether the noise of the joints' readings is unknown, so that it is learned.
    pub joints_unknown: bool,
}

/// The settings of active selection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionSpec {
    /// DIRECT's variant, ε and budget.
    pub search: Settings,
    /// The units of the criterion.
    pub units: CriterionUnits,
    /// The settings of planning ahead, for learners that plan.
    pub planning: Planning,
}
