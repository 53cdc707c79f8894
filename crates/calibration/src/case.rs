//! The calibration case: a described robot, and its measurements.

use std::{
    f64::consts::PI,
    sync::{Arc, Mutex},
};

use body_schema_diagnostics::Line;
use body_schema_engine::{
    model::{Block, ChainPrior, Layout, Names, State},
    sensing::{Loss, MeasurementModel, Observation, Occasion},
};
use body_schema_robot::Reading;
use body_schema_scenario::{Described, HeldOutRule, Scenario, WorldSpec};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{CalibrationError, Extra, Split};

/// A row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its line in the file.
    pub line: Line,
    /// Joint positions, rad or m.
    pub positions: Vec<f64>,
    /// The observation.
    pub observation: Observation,
    /// The socket in which a target was held: its number among the robot's, held-out ones after the others.
    pub socket: Option<usize>,
}

/// A described robot, with the measurements to calibrate it by.
#[derive(Clone, Debug)]
pub struct Case<'a> {
    /// The scenario of the calibration file.
    pub scenario: &'a Scenario,
    /// The robot as described, with its loads.
    guess: State,
    /// The rows, in the order of the table.
    pub rows: Vec<Row>,
    /// The [posture](fn@body_schema_diagnostics::postures) of each row.
    pub(super) postures: Vec<usize>,
    /// The names of everything that can be learned.
    pub names: Names,
    /// The URDF, where the robot comes from one.
    pub described: Option<&'a Described>,
    /// Observations from before any row, such as the distance between two sockets.
    pub(super) known: Option<&'a Observation>,
    pub(super) measurement_model: Arc<MeasurementModel>,
    pub(super) loss: Loss,
    /// The prior of the chain by layout, shared by all fits.
    pub(super) chains: Chains,
}

/// The prior of a chain, by layout.
type Chains = Arc<Mutex<Vec<(Layout, Option<Arc<ChainPrior>>)>>>;

/// The seed under which rows are held out, where the scenario draws them by one.
const SEED: u64 = 1;

impl<'a> Case<'a> {
    /// The case of a scenario that replays a table.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Simulated`] if it simulates its world.
    pub fn new(scenario: &'a Scenario) -> Result<Self, CalibrationError> {
        let WorldSpec::Measured { measurements, held_out } = &scenario.world else {
            return Err(CalibrationError::Simulated { scenario: scenario.name.clone() });
        };
        let row = |index: usize| Row {
            line: Line { file: measurements.files.get(index).cloned(), number: measurements.lines[index] },
            positions: measurements.configurations[index].clone(),
            observation: measurements.observations[index].clone(),
            socket: measurements.sockets.get(index).copied().flatten(),
        };
        let mut guess = scenario.robot.state.clone();
        guess.loads = Some(scenario.robot.loads(&guess));
        Ok(Self {
            scenario,
            guess,
            rows: (0..measurements.rows()).map(row).collect(),
            postures: held_out.postures.clone(),
            names: scenario.robot.called(),
            described: scenario.robot.described.as_deref(),
            known: measurements.beforehand.as_ref(),
            measurement_model: Arc::new(scenario.smoother_measurement_model(scenario.smoother.sigma)),
            chains: Chains::default(),
            loss: if scenario.smoother.loss == Loss::None { Loss::MIXTURE } else { scenario.smoother.loss },
        })
    }

    /// The robot as described.
    pub fn guess(&self) -> &State {
        &self.guess
    }

    /// The sensors with their nominal noise.
    pub fn measurement_model(&self) -> &MeasurementModel {
        &self.measurement_model
    }

    /// The layout of what a URDF can hold, and of base, targets, cameras and sockets: no ratios, no eccentricity and no
    /// compliance.
    pub fn writable(&self) -> Layout {
        let holds = |block: &Block| !matches!(block, Block::Ratio(_) | Block::Eccentricity(_) | Block::Compliance(..));
        self.layout(|block| holds(&block))
    }

    /// The layout of base, targets, cameras and sockets, with the chain as described.
    pub fn placing(&self) -> Layout {
        let is_of_chain = |block: &Block| matches!(block, Block::Axis(_) | Block::Offset(_));
        let learned = self.writable();
        let places = learned.blocks().map(|(block, _)| block).filter(|block| !is_of_chain(block));
        Layout::new(self.guess(), places)
    }

    /// The layout of what a URDF can hold and of `extras`, for a robot with the loads of `near`.
    pub fn extended(&self, extras: &[Extra], near: &State) -> Layout {
        let learned = self.writable();
        let blocks: Vec<Block> = learned.blocks().map(|(block, _)| block).collect();
        Layout::new(
            self.guess(),
            blocks.into_iter().chain(extras.iter().flat_map(|extra| extra.blocks(self, extras, near))),
        )
    }

    fn layout(&self, wanted: impl Fn(Block) -> bool) -> Layout {
        let learned = self.scenario.robot.layout.blocks().map(|(block, _)| block);
        Layout::new(self.guess(), learned.filter(|block| wanted(*block)))
    }

    /// The training rows and held-out rows, by the scenario's rule, or in `folds`: fold f holds out postures f, f + K, …, each
    /// with all its rows. There are no more folds than postures.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Folds`] if there are fewer rows than folds, or fewer than two folds; [`CalibrationError::OnePosture`]
    /// if all rows repeat each other.
    pub fn splits(&self, folds: Option<usize>) -> Result<Vec<Split>, CalibrationError> {
        let Some(folds) = folds else {
            let WorldSpec::Measured { held_out, .. } = &self.scenario.world else { return Ok(Vec::new()) };
            let splits = match held_out.rule {
                HeldOutRule::Folds(_) => held_out.folds(),
                _ => vec![held_out.split(SEED)],
            };
            return Ok(splits.into_iter().map(|(training, held_out)| Split { training, held_out }).collect());
        };
        // Of sockets that the file holds out there is nothing to learn.
        let rows: Vec<usize> = (0..self.rows.len()).filter(|row| !self.rows[*row].observation.is_miss()).collect();
        if folds == 0 {
            return Ok(vec![Split { training: rows, held_out: Vec::new() }]);
        }
        if folds < 2 || folds > rows.len() {
            return Err(CalibrationError::Folds { folds, rows: rows.len() });
        }
        if Split::numbered(&rows, &self.postures).1 < 2 {
            return Err(CalibrationError::OnePosture { rows: rows.len() });
        }
        Ok(Split::folds(&rows, folds, &self.postures))
    }

    /// Whether the only measurement is that targets are where they were before.
    pub fn meets_itself(&self) -> bool {
        self.measurement_model.sensors().iter().all(|sensor| sensor.subject().occasion != Occasion::Always)
    }

    /// The target that a row held in a socket, and the socket.
    pub(super) fn held(&self, row: &Row) -> Option<(usize, usize)> {
        let number = row.socket?;
        self.scenario.robot.all_sockets().nth(number).map(|socket| (number, socket.target))
    }

    /// A posture within the limits; of a robot some joints of which follow others, one that these can take.
    pub(super) fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        /// The most draws for one posture in which no follower leaves its limits.
        const TRIES: usize = 100;
        let limits = &self.scenario.robot.limits;
        let chain = self.described.map(|described| &described.chain);
        let Some(chain) = chain.filter(|chain| chain.readings.len() < chain.moving().count()) else {
            return limits.draw(rng);
        };
        let range = |reading: &Reading| {
            let own = chain.moving().position(|segment| segment.name == reading.name);
            let known = reading.limits.filter(|(lower, upper)| (upper - lower).is_finite());
            own.and_then(|joint| limits.joints().get(joint).copied()).or(known).unwrap_or((-PI, PI))
        };
        let mut within = |range: &(f64, f64)| rng.random_range(range.0..=range.1);
        let ranges: Vec<(f64, f64)> = chain.readings.iter().map(range).collect();
        let mut draw = || chain.positions(&ranges.iter().map(&mut within).collect::<Vec<_>>());
        let mut posture = draw();
        for _ in 1..TRIES {
            if limits.contains(&posture) {
                break;
            }
            posture = draw();
        }
        posture
    }
}
