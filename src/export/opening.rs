//! What a page opens with, where its address does not say.

use super::ExportError;
use body_schema_scenario::Scenario;

/// The furthest run and the greatest seed that a page takes.
const MOST_STEPS: u64 = 100_000;
const MOST_SEED: u64 = (1 << 53) - 1;

/// What is opened; what is absent is the page's own choice.
#[derive(Clone, Copy, Debug, Default)]
pub struct Opening<'a> {
    /// The scenario.
    pub scenario: Option<&'a Scenario>,
    /// A session with a robot elsewhere, by its id, in place of a scenario.
    pub session: Option<&'a str>,
    /// The seed.
    pub seed: Option<u64>,
    /// The learners' names, of that scenario; none for those that the page compares.
    pub learners: &'a [String],
    /// The step up to which the page plays.
    pub steps: Option<u64>,
}

impl Opening<'_> {
    /// Checks that a page can open with this.
    ///
    /// # Errors
    ///
    /// [`ExportError::Scenario`] if the scenario has no such learners, [`ExportError::Steps`] if it cannot be played so far,
    /// [`ExportError::Seed`] of a seed that no browser reads.
    pub fn check(&self) -> Result<(), ExportError> {
        if let Some(seed) = self.seed.filter(|seed| *seed > MOST_SEED) {
            return Err(ExportError::Seed { seed, most: MOST_SEED });
        }
        let Some(scenario) = self.scenario else { return Ok(()) };
        let learners = Some(self.learners).filter(|learners| !learners.is_empty());
        let available = scenario.experiment(self.seed.unwrap_or(1), learners)?.remaining().map(|left| left as u64);
        let most = available.unwrap_or(MOST_STEPS).min(MOST_STEPS);
        match self.steps {
            Some(steps) if steps > most || steps == 0 => {
                Err(ExportError::Steps { scenario: scenario.name.clone(), steps, most })
            }
            _ => Ok(()),
        }
    }

    /// The query of the address of the page as it opens.
    pub(super) fn query(&self) -> String {
        // Names are of letters, digits and what needs no escape.
        let parts = [
            self.scenario.map(|scenario| format!("scenario={}", scenario.name)),
            self.session.map(|id| format!("session={id}")),
            self.seed.map(|seed| format!("seed={seed}")),
            Some(self.learners.join(",")).filter(|names| !names.is_empty()).map(|names| format!("learners={names}")),
            self.steps.map(|steps| format!("to={steps}")),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join("&")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use body_schema_scenario::builtin;

    #[test]
    fn what_is_named_stands_in_the_address_and_what_is_not_is_left_to_the_page() {
        assert_eq!(Opening::default().query(), "");
        let (scenario, learners) = (builtin("arm-6dof").expect("built in"), ["active", "smoother:random"]);
        let learners = learners.map(str::to_owned);
        let opening =
            Opening { scenario: Some(&scenario), session: None, seed: Some(7), learners: &learners, steps: Some(60) };
        assert!(opening.check().is_ok());
        assert_eq!(opening.query(), "scenario=arm-6dof&seed=7&learners=active,smoother:random&to=60");
        assert_eq!(Opening { session: Some("3f2a"), ..Opening::default() }.query(), "session=3f2a");
        assert!(matches!(Opening { steps: Some(0), ..opening }.check(), Err(ExportError::Steps { .. })));
        assert!(matches!(Opening { seed: Some(u64::MAX), ..opening }.check(), Err(ExportError::Seed { .. })));
        assert!(Opening { learners: &["clever".to_owned()], ..opening }.check().is_err());
    }
}
