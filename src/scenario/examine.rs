//! What is doubtful in a scenario's data, and in its prior.

use super::{Measurements, Scenario, ScenarioError, WorldSpec};
use crate::{
    doubts::{Evidence, Examination, Seen, Subject, examine},
    model::PriorError,
    sensing::Observation,
};

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
            unknowns: robot.layout.dimension(),
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
