//! What is doubtful in a scenario's data, and in its prior.

use nalgebra::Vector3;

use super::{Known, Measurements, Scenario, ScenarioError, WorldSpec};
use crate::{
    doubts::{Base, Evidence, Examination, Seen, Subject, examine},
    model::{Block, PriorError},
    sensing::Observation,
};

/// How far a target may be from where the file has it, and a base of which the file says no more than that, for all that is known before any row is looked at, metres.
const TARGET_M: f64 = 0.3;

impl Scenario {
    /// Examines recorded measurements; `None` where the world is simulated.
    pub fn examine(&self) -> Option<Examination> {
        let WorldSpec::Measured { measurements, .. } = &self.world else { return None };
        let robot = &self.robot;
        let limits = match &robot.described {
            Some(described) => described.chain.moving().map(|segment| segment.limits).collect(),
            None => robot.limits.joints().iter().copied().map(Some).collect::<Vec<_>>(),
        };
        let held_in: Option<Vec<usize>> = measurements.sockets.iter().copied().collect();
        let subject = Subject {
            columns: &measurements.columns,
            joints: &robot.state.joints,
            limits: &limits,
            target: robot.state.marker(),
            target_sd_m: TARGET_M,
            unknowns: robot.layout.dimension(),
            sigma_m: self.smoother.sigma,
            direction_rad: self.prior.direction_rad,
            point_m: self.prior.point_m,
            base: self.base_said(),
        };
        let evidence = Evidence {
            lines: &measurements.lines,
            configurations: &measurements.configurations,
            targets: self.seen(measurements),
            sockets: held_in.filter(|sockets| !sockets.is_empty()),
            repeated: &measurements.repeated,
        };
        Some(examine(&subject, &evidence))
    }

    /// Where the base is said to be, and how well.
    fn base_said(&self) -> Option<Base> {
        let at = self.robot.state.base;
        match (self.robot.layout.block(Block::Base), self.prior.of(Block::Base)) {
            (None, _) => Some(Base { at, sd_m: Known::EXACTLY, sd_rad: Known::EXACTLY }),
            (_, Some(Known::Within { length_m, angle_rad, .. })) if length_m < TARGET_M => {
                Some(Base { at, sd_m: length_m, sd_rad: angle_rad })
            }
            _ => None,
        }
    }

    /// Where targets on the last link were seen.
    fn seen(&self, measurements: &Measurements) -> Vec<Seen> {
        let state = &self.robot.state;
        let channels = self.rig.channels().iter().zip(&measurements.readings).enumerate();
        let seen = channels.filter_map(|(index, (channel, name))| {
            let position = |observation: &Observation| channel.position(observation.readings.get(index)?.as_ref()?);
            let (target, _) = measurements.observations.iter().find_map(position)?;
            let points = measurements.observations.iter().map(|observation| position(observation).map(|seen| seen.1));
            // A pose: its rotation follows as a rotation vector.
            let is_pose = channel.equations() == 6;
            let turn = |observation: &Observation| {
                let turn =
                    observation.readings.get(index).and_then(Option::as_ref).and_then(|reading| reading.get(3..6));
                turn.map_or_else(Vector3::zeros, Vector3::from_column_slice)
            };
            let turns = measurements.observations.iter().filter(|_| is_pose).map(turn).collect();
            let arm_m = is_pose
                .then(|| channel.nominal(0).0 / channel.nominal(3).0)
                .filter(|arm| arm.is_finite() && *arm > 0.0);
            (state.targets[target].link == state.joints.len()).then(|| Seen {
                name: name.clone(),
                points: points.collect(),
                turns,
                arm_m,
            })
        });
        seen.collect()
    }

    /// Whether learners can begin from the prior, without building any: the standard deviations may be so small or so
    /// large that their squares are none.
    pub fn check_prior(&self) -> Result<(), ScenarioError> {
        let deviations = self.prior.standard_deviations(&self.robot.layout);
        if deviations.iter().all(|sd| (sd * sd).is_normal() && (sd * sd).recip().is_normal()) {
            return Ok(());
        }
        let source = PriorError::NotPositive(deviations.len());
        Err(ScenarioError::Prior { scenario: self.name.clone(), source })
    }
}
