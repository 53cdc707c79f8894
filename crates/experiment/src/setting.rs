//! What stays the same from step to step.

use nalgebra::Point3;

use super::convergence::Thresholds;
use body_schema_engine::{
    kinematics::JointKind,
    model::{Names, State},
    selection::CriterionUnits,
    sensing::{Equipment, Head, MeasurementModel, Part, Sensor},
};

/// What stays the same from step to step.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the scenario.
    pub scenario: String,
    /// What is other than in the scenario's file, as `KEY=VALUE`.
    pub replaced: Vec<String>,
    /// One line about the scenario.
    pub title: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// Version of body-schema.
    pub version: String,
    /// The joints, base first.
    pub joints: Vec<JointSetting>,
    /// Number of learned parameters in tangent coordinates.
    pub parameters: usize,
    /// Movements after which there are as many independent equations as can be determined: a yardstick, not a bound.
    pub movements_by_counting: usize,
    /// The learners, in the order of every outcome.
    pub learners: Vec<LearnerSetting>,
    /// The units of the criterion, and of the trace that it makes small.
    pub units: CriterionUnits,
    /// By what convergence is judged.
    pub thresholds: Thresholds,
    /// How many movements there are at most (a recorded data set ends); `None` without an end.
    pub movements_available: Option<usize>,
    /// The true arm at the start; `None` where no truth is known.
    pub truth: Option<State>,
    /// The number of movements after which the body changes; `None` if it does not. `truth` is the one before.
    pub change_at: Option<u64>,
    /// The head that watches; `None` if the marker is always seen.
    pub head: Option<Head>,
    /// What is read after every movement.
    pub channels: Vec<ChannelSetting>,
    /// What can be looked at, the marker first, and what looks.
    pub equipment: Equipment,
    /// Whether the place of the robot's base in the frame of the measurements is learned.
    pub base_learned: bool,
    /// The sockets in which a target is held; those that learners may use first, in the order of their numbers.
    pub sockets: Vec<SocketSetting>,
    /// What the robot is drawn as; `None` for one that is drawn as its own joints and links.
    pub body: Option<Body>,
}

/// What a robot is drawn as, around the arm that is learned. It has no bearing on anything that is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// A human figure of the arm's proportions, whose right arm it is.
    Humanoid,
}

/// A joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSetting {
    /// Its name.
    pub name: String,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Whether its axis is learned, or known and held fixed.
    pub learned: bool,
    /// Its limits, rad (revolute) or m (prismatic).
    pub limits: [f64; 2],
}

/// A learner of the comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LearnerSetting {
    /// Its name in the scenario.
    pub name: String,
    /// Its estimator: `rls`, `gradient`, `smoother`, …
    pub estimator: String,
    /// Its policy: `active`, `active-planned`, `random`, …
    pub policy: String,
    /// Whether stabilising noise, added to its covariance step by step, keeps that larger than its data allow.
    pub stabilised: bool,
    /// Whether its loss knows of outliers, and tells for each reading how likely it is one.
    pub robust: bool,
}

/// A socket.
#[derive(Clone, Debug, PartialEq)]
pub struct SocketSetting {
    /// Its name, among those of one place.
    pub name: String,
    /// The place where it stands, with others; `None` if there is but one place.
    pub place: Option<String>,
    /// Where it truly is, metres; `None` where no truth is known.
    pub at: Option<Point3<f64>>,
    /// Whether it is held out: nobody learns from it, and the scatter of the predicted target there is judged.
    pub held_out: bool,
}

/// What is read after every movement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelSetting {
    /// What it is called.
    pub name: String,
    /// Its equations.
    pub equations: usize,
    /// The parts of a reading, equal in equations: the points of a target in a picture, the position and the rotation of a pose.
    /// One part is the whole.
    pub parts: Vec<String>,
    /// The camera, by its number; `None` for what is read without one.
    pub camera: Option<usize>,
    /// What the camera sees, by the number of the target; `None` without a camera.
    pub target: Option<usize>,
}

impl Setting {
    /// What everything that can be learned is called.
    pub fn called(&self) -> Names {
        Names {
            joints: self.joints.iter().map(|joint| joint.name.clone()).collect(),
            targets: self.equipment.targets.iter().map(|target| target.name.clone()).collect(),
            cameras: self.equipment.cameras.iter().map(|camera| camera.name.clone()).collect(),
            sockets: self.sockets.iter().map(SocketSetting::label).collect(),
        }
    }
}

impl SocketSetting {
    /// Its place and its name.
    pub fn label(&self) -> String {
        socket_label(self.place.as_deref(), &self.name)
    }
}

/// What a socket is called: its place, if it has one, and its name.
pub fn socket_label(place: Option<&str>, name: &str) -> String {
    place.map_or_else(|| name.to_owned(), |place| format!("{place}/{name}"))
}

/// The channels of a measurement model, with the names of what they see.
pub fn channels(measurement_model: &MeasurementModel, equipment: &Equipment) -> Vec<ChannelSetting> {
    let describe = |(index, sensor): (usize, &Sensor)| {
        let target = |target: usize| equipment.targets.get(target).map_or("marker", |target| target.name.as_str());
        let (sight, is_pose) = (sensor.subject().sight(), sensor.subject().is_pose());
        let subject = sensor.subject();
        let observer = subject.seen_from.and_then(|observer| equipment.name(observer)).zip(subject.target);
        let name = match (sight, observer, subject.point()) {
            (Some((camera, seen)), ..) => {
                let camera = equipment.cameras.get(camera).map_or("camera", |camera| camera.name.as_str());
                format!("{} seen by {camera}", target(seen))
            }
            (None, Some((observer, seen)), _) => {
                let between = if subject.parts == [Part::Norm] { "from" } else { "in" };
                format!("{} {between} {observer}", target(seen))
            }
            (None, None, Some(measured)) => target(measured).to_owned(),
            (None, None, None) if is_pose => "pose".to_owned(),
            (None, None, None) => format!("reading {}", index + 1),
        };
        let points = sight.and_then(|(_, seen)| Some(equipment.targets.get(seen)?.points.len()));
        let parts = match (points, is_pose) {
            (Some(points), _) => (1..=points).map(|point| format!("point {point}")).collect(),
            (None, true) => ["position", "rotation"].map(str::to_owned).into(),
            _ => vec![name.clone()],
        };
        let (camera, target) = sight.unzip();
        ChannelSetting { name, equations: sensor.equations(), parts, camera, target }
    };
    measurement_model.sensors().iter().enumerate().map(describe).collect()
}
