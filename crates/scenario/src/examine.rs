//! Diagnostics of a scenario's data, and the check of its prior.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::{HeldOutRule, Known, Measurements, Scenario, ScenarioError, WorldSpec};
use body_schema_diagnostics::{Base, Evidence, Examination, Seen, Subject, examine, few_folds};
use body_schema_engine::{
    model::{Block, PriorError},
    sensing::{Observation, Occasion, present},
};

/// The assumed deviation, metres, of a target from where the file has it before any row is looked at; also of a base of which the file says
/// no more.
const TARGET_M: f64 = 0.3;

impl Scenario {
    /// Examines recorded measurements; `None` where the world is simulated.
    pub fn examine(&self) -> Option<Examination> {
        let WorldSpec::Measured { measurements, held_out } = &self.world else { return None };
        let robot = &self.robot;
        let limits = match &robot.described {
            Some(described) => described.chain.moving().map(|segment| segment.limits).collect(),
            None => robot.limits.joints().iter().copied().map(Some).collect::<Vec<_>>(),
        };
        let held_in: Option<Vec<usize>> = measurements.sockets.iter().copied().collect();
        let (tree, link) = (&robot.state.tree, self.examined(measurements));
        let mut carriers: Vec<usize> = tree.path(link).collect();
        carriers.reverse();
        let subject = Subject {
            columns: &measurements.columns,
            joints: &robot.state.joints,
            carriers: (!tree.is_serial()).then_some(carriers.as_slice()),
            limits: &limits,
            target: robot.state.marker(),
            target_sd_m: TARGET_M,
            learned: &(0..robot.state.joints.len()).map(|joint| robot.layout.is_learned(joint)).collect::<Vec<_>>(),
            unknowns: robot.layout.dimension(),
            sigma_m: self.smoother.sigma,
            direction_rad: self.prior.direction_rad,
            point_m: self.prior.point_m,
            base: self.base_said(),
        };
        let listed = match &held_out.rule {
            HeldOutRule::Rows(rows) => rows.as_slice(),
            _ => &[],
        };
        let evidence = Evidence {
            lines: &measurements.lines,
            files: &measurements.files,
            configurations: &measurements.configurations,
            targets: self.seen(measurements, link),
            sockets: held_in.filter(|sockets| !sockets.is_empty()),
            equations: Some(self.equations(measurements)),
            held_out: listed,
            repeated: &measurements.repeated,
        };
        let mut found = examine(&subject, &evidence);
        if let HeldOutRule::Folds(folds) = held_out.rule {
            found.doubts.extend(few_folds(folds, held_out.count_postures(), held_out.rows));
        }
        Some(found)
    }

    /// The number of equations of all measurements. The first row in a socket only places the socket, and adds none.
    fn equations(&self, measurements: &Measurements) -> usize {
        let sensors = self.rig.sensors();
        let always = |observation: &Observation| -> usize {
            let always = sensors.iter().map(|sensor| sensor.subject().occasion == Occasion::Always);
            let read = always.zip(&observation.readings).filter(|(always, _)| *always);
            read.filter_map(|(_, reading)| reading.as_deref()).map(present).sum()
        };
        let measured: usize = measurements.observations.iter().map(always).sum();
        let held: Vec<usize> = measurements.sockets.iter().copied().flatten().collect();
        let places: BTreeSet<usize> = held.iter().copied().collect();
        let beforehand = measurements.beforehand.iter().flat_map(|known| known.readings.iter().flatten());
        measured + 3 * (held.len() - places.len()) + beforehand.map(Vec::len).sum::<usize>()
    }

    /// The stated pose of the base, and its deviations.
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

    /// The link on which targets are examined: the last; where joints branch that of the first target whose position is measured or
    /// that is held in a socket.
    fn examined(&self, measurements: &Measurements) -> usize {
        let (state, sensors) = (&self.robot.state, self.rig.sensors());
        let seen_by = |channel: usize| {
            let readings = measurements.observations.iter().filter_map(|it| it.readings.get(channel)?.as_ref());
            Some(readings.filter_map(|reading| sensors[channel].subject().position(reading)).next()?.0)
        };
        let held = self.robot.sockets.iter().chain(&self.robot.held_out_sockets).map(|socket| socket.target);
        let mut targets = (0..sensors.len()).filter_map(seen_by).chain(held);
        match targets.next() {
            Some(target) if !state.tree.is_serial() => state.targets[target].link,
            _ => state.joints.len(),
        }
    }

    /// The measured positions of targets on a link.
    fn seen(&self, measurements: &Measurements, link: usize) -> Vec<Seen> {
        let state = &self.robot.state;
        let sensors = self.rig.sensors().iter().zip(&measurements.readings).enumerate();
        let seen = sensors.filter_map(|(index, (sensor, name))| {
            let position =
                |observation: &Observation| sensor.subject().position(observation.readings.get(index)?.as_ref()?);
            let (target, _) = measurements.observations.iter().find_map(position)?;
            let points = measurements.observations.iter().map(|observation| position(observation).map(|seen| seen.1));
            // A pose: its rotation follows as a rotation vector.
            let is_pose = sensor.subject().is_pose();
            let turn = |observation: &Observation| {
                let turn =
                    observation.readings.get(index).and_then(Option::as_ref).and_then(|reading| reading.get(3..6));
                turn.map_or_else(Vector3::zeros, Vector3::from_column_slice)
            };
            let turns = measurements.observations.iter().filter(|_| is_pose).map(turn).collect();
            let arm_m =
                is_pose.then(|| sensor.nominal(0).0 / sensor.nominal(3).0).filter(|arm| arm.is_finite() && *arm > 0.0);
            (state.targets[target].link == link).then(|| Seen {
                name: name.clone(),
                points: points.collect(),
                turns,
                arm_m,
            })
        });
        seen.collect()
    }

    /// Checks, without building any learner, that learners can begin from the prior.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Prior`] if the square of a standard deviation, or its reciprocal, underflows or overflows.
    pub fn check_prior(&self) -> Result<(), ScenarioError> {
        let deviations = self.prior.standard_deviations(&self.robot.layout);
        if deviations.iter().all(|sd| (sd * sd).is_normal() && (sd * sd).recip().is_normal()) {
            return Ok(());
        }
        let source = PriorError::NotPositive(deviations.len());
        Err(ScenarioError::Prior { scenario: self.name.clone(), source })
    }
}
