//! What is to be calibrated, and by what.

use std::sync::Arc;

use nalgebra::Point3;
use rand::seq::SliceRandom;

use crate::{
    experiment::Stream,
    model::{
        Block, Layout, State,
        urdf::{Chain, Urdf},
    },
    scenario::{Scenario, WorldSpec},
    sensing::{Loss, Observation, Rig},
};

use super::{CalibrationError, Extra, Names, Split};

/// A row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The line of the file, counted from 1.
    pub line: usize,
    /// Joint positions, rad or m.
    pub positions: Vec<f64>,
    /// What was measured.
    pub observation: Observation,
}

/// A robot's description and its chain.
#[derive(Clone, Debug)]
pub struct Description {
    /// The file.
    pub urdf: Urdf,
    /// The chain that is calibrated.
    pub chain: Chain,
}

/// A robot as it is described, and what was measured of it.
#[derive(Clone, Debug)]
pub struct Case<'a> {
    pub(super) scenario: &'a Scenario,
    /// The rows, in the order of the table.
    pub rows: Vec<Row>,
    /// What everything is called.
    pub names: Names,
    /// The URDF, where the robot comes from one.
    pub description: Option<Description>,
    pub(super) rig: Arc<Rig>,
    pub(super) loss: Loss,
}

/// Rows held out under this seed, where the scenario draws them by one.
const SEED: u64 = 1;

impl<'a> Case<'a> {
    /// The case of a scenario that replays a table.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Simulated`] where it simulates its world.
    pub fn new(scenario: &'a Scenario) -> Result<Self, CalibrationError> {
        let WorldSpec::Measured { measurements, .. } = &scenario.world else {
            return Err(CalibrationError::Simulated { scenario: scenario.name.clone() });
        };
        let seen = measurements.configurations.iter().zip(&measurements.markers_m).zip(&measurements.lines);
        let row = |((positions, marker), line): ((&Vec<f64>, &Point3<f64>), &usize)| Row {
            line: *line,
            positions: positions.clone(),
            observation: Observation::seen(*marker),
        };
        Ok(Self {
            scenario,
            rows: seen.map(row).collect(),
            names: Names::new(&scenario.robot),
            description: None,
            rig: Arc::new(scenario.rig.assuming(scenario.smoother.sigma)),
            loss: if scenario.smoother.loss == Loss::None { Loss::MIXTURE } else { scenario.smoother.loss },
        })
    }

    /// The robot as it is described.
    pub fn guess(&self) -> &State {
        &self.scenario.robot.state
    }

    /// The sensors with their nominal noise.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// What a URDF can hold, and where base, targets, cameras and sockets are: no ratios and no eccentricity.
    pub fn writable(&self) -> Layout {
        let holds = |block: &Block| !matches!(block, Block::Ratio(_) | Block::Eccentricity(_));
        self.layout(|block| holds(&block))
    }

    /// Where base, targets, cameras and sockets are, with the chain as described.
    pub fn placing(&self) -> Layout {
        use Block::{Axis, Eccentricity, Offset, Ratio};
        self.layout(|block| !matches!(block, Axis(_) | Offset(_) | Ratio(_) | Eccentricity(_)))
    }

    /// What a URDF can hold, and more.
    pub fn extended(&self, extras: &[Extra]) -> Layout {
        let learned = self.writable();
        let blocks: Vec<Block> = learned.blocks().map(|(block, _)| block).collect();
        Layout::new(self.guess(), blocks.into_iter().chain(extras.iter().flat_map(|extra| extra.blocks(self))))
    }

    /// What the scenario holds out itself.
    fn split(&self) -> Split {
        let WorldSpec::Measured { held_out, .. } = &self.scenario.world else { return Split::default() };
        let mut rows: Vec<usize> = (0..self.rows.len()).collect();
        rows.shuffle(&mut Stream::HeldOut.rng(SEED));
        let (held_out, training) = rows.split_at_mut(*held_out);
        held_out.sort_unstable();
        training.sort_unstable();
        Split { training: training.to_vec(), held_out: held_out.to_vec() }
    }

    fn layout(&self, wanted: impl Fn(Block) -> bool) -> Layout {
        let learned = self.scenario.robot.layout.blocks().map(|(block, _)| block);
        Layout::new(self.guess(), learned.filter(|block| wanted(*block)))
    }

    /// Rows to learn from and rows to judge by, as the scenario says, or by `folds`: fold f holds out rows f, f + K, …
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Folds`] where there are fewer rows than folds, or fewer than two folds.
    pub fn splits(&self, folds: Option<usize>) -> Result<Vec<Split>, CalibrationError> {
        let count = self.rows.len();
        let Some(folds) = folds else {
            return Ok(vec![self.split()]);
        };
        if folds < 2 || folds > count {
            return Err(CalibrationError::Folds { folds, rows: count });
        }
        Ok(Split::folds(&(0..count).collect::<Vec<_>>(), folds))
    }
}
