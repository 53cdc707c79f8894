//! The scenarios that a page can open: the built-in ones, and some beside them.

use std::borrow::Cow;

use body_schema_scenario::{BUILTIN, Scenario, ScenarioError, ScenarioSummary, builtin};

use crate::{Kind, Problem, ScenarioList, ScenarioResource};

/// The built-in scenarios, and those of one's own, which take the place of built-in ones of the same name.
#[derive(Clone, Default)]
pub struct Scenarios {
    own: Vec<Scenario>,
}

impl Scenarios {
    /// Adds a scenario, in place of another of its name.
    pub fn add(&mut self, scenario: Scenario) {
        self.own.retain(|own| own.name != scenario.name);
        self.own.push(scenario);
    }

    /// The scenario of a name.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::UnknownScenario`] where there is none of that name.
    pub fn find(&self, name: &str) -> Result<Cow<'_, Scenario>, ScenarioError> {
        match self.own(name) {
            Some(own) => Ok(Cow::Borrowed(own)),
            None => builtin(name).map(Cow::Owned),
        }
    }

    fn own(&self, name: &str) -> Option<&Scenario> {
        self.own.iter().find(|own| own.name == name)
    }

    /// All of them in brief, those of one's own first, then the built-in ones, simplest first.
    ///
    /// # Errors
    ///
    /// [`Kind::EngineFailed`] where one of them is not valid.
    pub fn list(&self) -> Result<ScenarioList, Problem> {
        let summary = |name: &str| -> Result<ScenarioSummary, Problem> { Ok(builtin(name)?.summary()) };
        let known = BUILTIN.iter().filter(|known| self.own(known.name).is_none());
        let own = self.own.iter().map(|own| Ok(own.summary()));
        let scenarios = own.chain(known.map(|known| summary(known.name))).collect::<Result<_, Problem>>()?;
        Ok(ScenarioList { scenarios })
    }

    /// One of them with its source.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownScenario`] where there is none of that name.
    pub fn resource(&self, name: &str) -> Result<ScenarioResource, Problem> {
        let scenario = self.find(name).map_err(|error| match error {
            ScenarioError::UnknownScenario { .. } => {
                Problem::new(Kind::UnknownScenario, error.to_string()).field("name")
            }
            error => error.into(),
        })?;
        Ok(ScenarioResource { summary: scenario.summary(), source: scenario.source.clone() })
    }
}
