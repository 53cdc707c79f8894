//! What is doubtful in a scenario's data, and in its prior.

use std::collections::BTreeSet;

use super::{HeldOutRule, Measurements, Scenario, ScenarioError, WorldSpec};
use crate::{
    doubts::{Evidence, Examination, Seen, Subject, examine, few_folds},
    model::PriorError,
    sensing::{Observation, Occasion},
};

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
        let subject = Subject {
            columns: &measurements.columns,
            joints: &robot.state.joints,
            limits: &limits,
            target: robot.state.marker(),
            learned: &(0..robot.state.joints.len()).map(|joint| robot.layout.is_learned(joint)).collect::<Vec<_>>(),
            unknowns: robot.layout.dimension(),
        };
        let listed = match &held_out.rule {
            HeldOutRule::Rows(rows) => rows.as_slice(),
            _ => &[],
        };
        let evidence = Evidence {
            lines: &measurements.lines,
            configurations: &measurements.configurations,
            targets: self.seen(measurements),
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

    /// Equations of all that was measured. The first row in a socket says where that is, and no more.
    fn equations(&self, measurements: &Measurements) -> usize {
        let channels = self.rig.channels();
        let always = |observation: &Observation| -> usize {
            let read = channels.iter().zip(&observation.readings).filter(|(_, reading)| reading.is_some());
            read.filter(|(channel, _)| channel.occasion() == Occasion::Always)
                .map(|(channel, _)| channel.equations())
                .sum()
        };
        let measured: usize = measurements.observations.iter().map(always).sum();
        let held: Vec<usize> = measurements.sockets.iter().copied().flatten().collect();
        let places: BTreeSet<usize> = held.iter().copied().collect();
        let beforehand = measurements.beforehand.iter().flat_map(|known| known.readings.iter().flatten());
        measured + 3 * (held.len() - places.len()) + beforehand.map(Vec::len).sum::<usize>()
    }

    /// Where targets on the last link were seen.
    fn seen(&self, measurements: &Measurements) -> Vec<Seen> {
        let state = &self.robot.state;
        let channels = self.rig.channels().iter().zip(&measurements.readings).enumerate();
        let seen = channels.filter_map(|(index, (channel, name))| {
            let position = |observation: &Observation| channel.position(observation.readings.get(index)?.as_ref()?);
            let (target, _) = measurements.observations.iter().find_map(position)?;
            let points = measurements.observations.iter().map(|observation| position(observation).map(|seen| seen.1));
            (state.targets[target].link == state.joints.len())
                .then(|| Seen { name: name.clone(), points: points.collect() })
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
