//! Where movements are made and what comes of them is measured.
//!
//! The world holds the truth. No module of `estimation` or `selection` can name this type.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::streams::Stream;
use body_schema_engine::{
    kinematics::JointBox,
    model::{Manifold, State},
    normal::StandardNormal,
    selection::Movement,
    sensing::{Head, MeasurementModel, Observation, Refused},
};

/// A simulated arm, a recorded data set, or a robot elsewhere.
#[derive(Clone, Debug)]
pub enum World {
    /// A robot that is known here and nowhere else, seen through noisy channels.
    Simulated {
        /// The true state.
        truth: Box<State>,
        /// The channels, with their true noise.
        measurement_model: Arc<MeasurementModel>,
        /// The joint limits.
        limits: JointBox,
        /// The head that watches; without one every marker is seen.
        head: Option<Head>,
        /// How the body will change.
        change: Option<Box<Change>>,
        /// Readings that have nothing to do with the robot.
        outliers: Option<Outliers>,
    },
    /// Recorded observations by row; no truth is known.
    Measured {
        /// What was observed at every row of the data set.
        observations: Vec<Observation>,
    },
    /// A robot that moves by itself, and of which one is [told](super::Experiment::tell).
    External,
}

/// Readings of a tracker that show anything but the marker: each with a chance of its own, uniform in a cube about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers {
    /// The chance of a reading to be one.
    pub fraction: f64,
    /// The edge of the cube, metres.
    pub box_m: f64,
}

/// What chance decides about one movement, the same for every learner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Draw {
    /// Standard normal numbers, one per equation.
    pub noise: Vec<f64>,
    /// By channel four numbers uniform in 0..1: whether the reading is an outlier, and where it lies.
    pub outliers: Vec<[f64; 4]>,
    /// Standard normal numbers, one per joint: by what its reading is off.
    pub joints: Vec<f64>,
}

/// A change of the body.
#[derive(Clone, Debug)]
pub struct Change {
    /// The number of movements after which it happens: the next movement is the first of the changed body.
    pub step: u64,
    /// The true state from then on.
    pub truth: State,
}

/// Why a world has nothing to show.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// The data set has no such row.
    #[error("the recorded data have no row {row} (counted from 0); they have {rows}")]
    NoSuchRow {
        /// The row asked for.
        row: usize,
        /// How many there are.
        rows: usize,
    },
    /// A movement that is no row of the data set.
    #[error("recorded data hold what was measured at their own rows, not at other configurations")]
    NotRecorded,
    /// Nobody here can move the robot.
    #[error("the robot is elsewhere and moves by itself; tell what was observed after it has moved")]
    External,
    /// Nothing can be held where it was to be held.
    #[error("no posture near the proposed one brings a target into socket {socket} (counted from 0)")]
    OutOfReach {
        /// The socket.
        socket: usize,
    },
    /// What was measured is no measurement.
    #[error("what the world shows is no measurement: {0}")]
    NoMeasurement(#[from] Refused),
}

/// What chance decides in one world: the k-th movement of every learner sees the k-th draw, whether its marker was seen or not.
#[derive(Clone, Debug)]
pub struct NoiseSequence {
    noise: ChaCha8Rng,
    outliers: ChaCha8Rng,
    joints: ChaCha8Rng,
}

impl NoiseSequence {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        let [noise, outliers, joints] =
            [Stream::Noise, Stream::Outliers, Stream::JointNoise].map(|stream| stream.rng(seed));
        Self { noise, outliers, joints }
    }

    /// The draw of the next movement in a world.
    pub fn draw(&mut self, world: &World) -> Draw {
        let World::Simulated { measurement_model, outliers, .. } = world else { return Draw::default() };
        let noise = (0..measurement_model.equations()).map(|_| self.noise.sample(StandardNormal)).collect();
        let channels = outliers.map_or(0, |_| measurement_model.sensors().len());
        let outliers = (0..channels).map(|_| self.outliers.random()).collect();
        let joints = measurement_model.joint_noise().map_or(0, |noise| noise.sigmas().len());
        Draw { noise, outliers, joints: (0..joints).map(|_| self.joints.sample(StandardNormal)).collect() }
    }
}

impl World {
    /// The true state, where one is known.
    pub fn truth(&self) -> Option<&State> {
        match self {
            Self::Simulated { truth, .. } => Some(truth),
            Self::Measured { .. } | Self::External => None,
        }
    }

    /// The change of the body that is still to come.
    pub fn change(&self) -> Option<&Change> {
        match self {
            Self::Simulated { change, .. } => change.as_deref(),
            Self::Measured { .. } | Self::External => None,
        }
    }

    /// The head that watches.
    pub fn head(&self) -> Option<&Head> {
        match self {
            Self::Simulated { head, .. } => head.as_ref(),
            Self::Measured { .. } | Self::External => None,
        }
    }

    /// The world with the body changed, if that is due after so many movements.
    pub(super) fn changed_after(&self, movements: u64) -> Option<Self> {
        let Self::Simulated { measurement_model, limits, head, change: Some(change), outliers, .. } = self else {
            return None;
        };
        (change.step <= movements).then(|| Self::Simulated {
            truth: Box::new(change.truth.clone()),
            measurement_model: measurement_model.clone(),
            limits: limits.clone(),
            head: *head,
            change: None,
            outliers: *outliers,
        })
    }

    /// Whether the draw makes an outlier of a channel's reading.
    pub fn is_outlier(&self, draw: &Draw, channel: usize) -> bool {
        let Self::Simulated { outliers: Some(outliers), .. } = self else { return false };
        draw.outliers.get(channel).is_some_and(|[chance, ..]| *chance < outliers.fraction)
    }

    /// What the joints' readings are off by, rad or m: where they read θ, the robot stands at θ and this. Empty where they are
    /// exact.
    fn errors(&self, draw: &Draw) -> Vec<f64> {
        let Self::Simulated { measurement_model, .. } = self else { return Vec::new() };
        let noise = measurement_model.joint_noise().into_iter().flat_map(|noise| noise.sigmas());
        noise.zip(&draw.joints).map(|(sigma, v)| sigma * v).collect()
    }

    /// A movement as it is carried out, under a draw of chance: joints that aim a camera aim it as the robot truly is, and what is to be
    /// held in a socket is pushed into it. The joints then
    /// read the nearest posture in which the target is there, but for what play and their noise, which are σ at the target, make
    /// of it.
    ///
    /// # Errors
    ///
    /// [`WorldError::OutOfReach`] if no posture brings a target into the socket; [`WorldError`] of the observation's check if the
    /// movement does not fit the robot.
    pub fn execute(&self, movement: &Movement, draw: &Draw) -> Result<Movement, WorldError> {
        if let (Self::Simulated { truth, measurement_model, .. }, None) = (self, movement.socket)
            && measurement_model.servo().is_some()
        {
            Observation::missed(measurement_model.sensors().len()).check(
                measurement_model,
                truth.joints.len(),
                &movement.configuration,
            )?;
            let configuration = measurement_model.aimed(truth, &movement.configuration).into_owned();
            return Ok(Movement { configuration, ..movement.clone() });
        }
        let (Self::Simulated { truth, measurement_model, limits, .. }, Some(socket)) = (self, movement.socket) else {
            return Ok(movement.clone());
        };
        let out_of_reach = || WorldError::OutOfReach { socket };
        let (channel, target) = measurement_model.holds(socket).ok_or_else(out_of_reach)?;
        Observation::missed(measurement_model.sensors().len()).check(
            measurement_model,
            truth.joints.len(),
            &movement.configuration,
        )?;
        let mut place = truth.sockets[socket];
        measurement_model.sensors()[channel]
            .disturb(place.coords.as_mut_slice(), measurement_model.part(channel, &draw.noise));
        let nearest = Manifold::new(truth, target, place, limits).nearest(&movement.configuration);
        let mut configuration = nearest.ok_or_else(out_of_reach)?;
        // The robot stands there; what it reads is off.
        configuration.iter_mut().zip(self.errors(draw)).for_each(|(reading, error)| *reading -= error);
        Ok(Movement { configuration, ..movement.clone() })
    }

    /// What is seen after `movement`, under a draw of chance.
    ///
    /// # Errors
    ///
    /// [`WorldError::NotRecorded`] or [`WorldError::NoSuchRow`] if the data set does not have this movement,
    /// [`WorldError::External`] if the robot is elsewhere; the refusal of the observation's check if the movement does
    /// not fit the robot.
    pub fn observe(&self, movement: &Movement, draw: &Draw) -> Result<Observation, WorldError> {
        match self {
            Self::Simulated { truth, measurement_model, head, outliers, .. } => {
                let theta = &movement.configuration;
                Observation::missed(measurement_model.sensors().len()).check(
                    measurement_model,
                    truth.joints.len(),
                    theta,
                )?;
                let mut stands = theta.clone();
                stands.iter_mut().zip(self.errors(draw)).for_each(|(position, error)| *position += error);
                let mut observation =
                    measurement_model.observe_watched(head.as_ref(), movement.socket, truth, &stands, &draw.noise);
                for (channel, reading) in observation.readings.iter_mut().enumerate() {
                    if let (Some(reading), Some(outliers), true) = (reading, outliers, self.is_outlier(draw, channel)) {
                        let place = &draw.outliers[channel][1..];
                        let present = reading.iter_mut().zip(place).filter(|(x, _)| !x.is_nan());
                        present.for_each(|(x, u)| *x = outliers.box_m * (u - 0.5));
                    }
                }
                observation.check(measurement_model, truth.joints.len(), theta)?;
                Ok(observation)
            }
            Self::Measured { observations } => {
                let (row, rows) = (movement.row.ok_or(WorldError::NotRecorded)?, observations.len());
                observations.get(row).cloned().ok_or(WorldError::NoSuchRow { row, rows })
            }
            Self::External => Err(WorldError::External),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use body_schema_engine::{
        model::random::random_arm,
        sensing::{JointNoise, Sensor, Socket},
    };

    #[test]
    fn an_unknown_row_is_no_miss() {
        let world = World::Measured { observations: vec![Observation::of([1.0, 2.0, 3.0])] };
        let at = |row| world.observe(&Movement { row, ..Movement::to(vec![0.0]) }, &Draw::default());
        assert_eq!(at(Some(0)), Ok(Observation::of([1.0, 2.0, 3.0])));
        assert_eq!(at(Some(1)), Err(WorldError::NoSuchRow { row: 1, rows: 1 }));
        assert_eq!(at(None), Err(WorldError::NotRecorded));
    }

    /// What is held in a socket is where the socket is, but for the noise, at the posture nearest to the one proposed.
    #[test]
    fn what_is_held_is_pushed_into_its_socket() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut truth = random_arm(&mut rng, 6);
        let limits = JointBox::new(vec![(-1.5, 1.5); 6]).expect("limits");
        let inside = vec![0.2; 6];
        truth.sockets = vec![nalgebra::Point3::origin(), truth.marker_at(&inside)];
        let socket = |socket| Sensor::even(Socket { target: 0, socket }, 2e-4);
        let measurement_model = Arc::new(MeasurementModel::new(vec![socket(0), socket(1)]));
        let (robot, wanted) = (truth.clone(), truth.sockets[1]);
        let world = World::Simulated {
            truth: Box::new(truth),
            measurement_model,
            limits: limits.clone(),
            head: None,
            change: None,
            outliers: None,
        };
        let proposed = Movement { socket: Some(1), ..Movement::to(vec![0.21, 0.19, 0.2, 0.22, 0.18, 0.2]) };
        for noise in [0.0, 1.0] {
            let draw = Draw { noise: vec![noise; 6], ..Draw::default() };
            let made = world.execute(&proposed, &draw).expect("in reach");
            let away = robot.marker_at(&made.configuration) - wanted;
            assert!((away - nalgebra::Vector3::repeat(2e-4 * noise)).norm() < 1e-9, "{away}");
            let observation = world.observe(&made, &draw).expect("held");
            assert_eq!(observation.readings, [None, Some(vec![0.0; 3])]);
            if noise == 0.0 {
                let nearest = Manifold::new(&robot, 0, wanted, &limits).nearest(&proposed.configuration);
                assert_eq!(Some(made.configuration), nearest);
            }
        }
        let elsewhere = Movement { socket: Some(2), ..proposed.clone() };
        assert_eq!(world.execute(&elsewhere, &Draw::default()), Err(WorldError::OutOfReach { socket: 2 }));
        let free = Movement { socket: None, ..proposed };
        assert_eq!(world.execute(&free, &Draw::default()), Ok(free.clone()), "nothing is held");
    }

    /// Joints that are off are shown where they stand and told where they read, and no other draw of chance changes.
    #[test]
    fn joints_stand_beside_what_they_read() {
        let truth = random_arm(&mut ChaCha8Rng::seed_from_u64(4), 3);
        let limits = JointBox::new(vec![(-1.0, 1.0); 3]).expect("limits");
        let world = |noise: Option<Vec<f64>>| {
            let noise = noise.and_then(|sigmas| JointNoise::new(&truth, sigmas)).map(Arc::new);
            let measurement_model = Arc::new(MeasurementModel::tracker(1e-9).with_joint_noise(noise));
            let (truth, limits) = (Box::new(truth.clone()), limits.clone());
            World::Simulated { truth, measurement_model, limits, head: None, change: None, outliers: None }
        };
        let (exact, off) = (world(None), world(Some(vec![0.02, 0.0, 0.1])));
        let (mut of_exact, mut of_off) = (NoiseSequence::new(7), NoiseSequence::new(7));
        let mut squares = [0.0; 3];
        for _ in 0..400 {
            let (draw, with) = (of_exact.draw(&exact), of_off.draw(&off));
            assert_eq!((&draw.noise, &draw.outliers, draw.joints.len()), (&with.noise, &with.outliers, 0));
            let movement = Movement::to(vec![0.3, -0.2, 0.5]);
            let stands = [0.3 + 0.02 * with.joints[0], -0.2, 0.5 + 0.1 * with.joints[2]];
            assert_eq!(off.execute(&movement, &with), Ok(movement.clone()), "it reads what was wanted");
            let seen = off.observe(&movement, &with).expect("seen").readings[0].clone().expect("seen");
            let place = truth.marker_at(&stands);
            assert!(place.coords.iter().zip(&seen).all(|(a, b)| (a - b).abs() < 1e-7));
            squares.iter_mut().zip(&with.joints).for_each(|(sum, v)| *sum += v * v / 400.0);
        }
        assert!(squares.iter().all(|square| (0.75..1.3).contains(square)), "{squares:?}");
    }

    #[test]
    fn a_body_beyond_all_numbers_shows_nothing() {
        let mut truth = random_arm(&mut ChaCha8Rng::seed_from_u64(1), 2);
        truth = truth.with_marker(nalgebra::Point3::new(f64::INFINITY, 0.0, 0.0));
        let (truth, measurement_model) = (Box::new(truth), Arc::new(MeasurementModel::tracker(0.1)));
        let limits = JointBox::new(vec![(-1.0, 1.0); 2]).expect("limits");
        let world = World::Simulated { truth, measurement_model, limits, head: None, change: None, outliers: None };
        let draw = Draw { noise: vec![0.0; 3], ..Draw::default() };
        let shown = world.observe(&Movement::to(vec![0.1; 2]), &draw);
        assert!(matches!(shown, Err(WorldError::NoMeasurement(_))), "{shown:?}");
    }
}
