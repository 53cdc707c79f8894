//! What is doubtful in a scenario's data, and in its prior.

use super::{Scenario, ScenarioError, WorldSpec};
use crate::{
    doubts::{Evidence, Examination, Seen, Subject, examine},
    model::PriorError,
};

impl Scenario {
    /// Examines recorded measurements; `None` where the world is simulated.
    pub fn examine(&self) -> Option<Examination> {
        let WorldSpec::Measured { measurements, .. } = &self.world else { return None };
        let robot = &self.robot;
        let limits: Vec<_> = robot.limits.joints().iter().copied().map(Some).collect();
        let subject = Subject {
            columns: &measurements.columns,
            joints: &robot.state.joints,
            limits: &limits,
            target: robot.state.marker(),
            unknowns: robot.layout.dimension(),
        };
        let points = measurements.markers_m.iter().copied().map(Some).collect();
        let evidence = Evidence {
            lines: &measurements.lines,
            configurations: &measurements.configurations,
            targets: vec![Seen { name: measurements.marker.clone(), points }],
            sockets: None,
            repeated: &measurements.repeated,
        };
        Some(examine(&subject, &evidence))
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
