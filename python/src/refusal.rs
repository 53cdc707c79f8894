//! Refusals, as exceptions of the package.

use body_schema_ask_tell::{Fault, Refusal, ReplayError, ResultsError, SetupError};
use body_schema_scenario::ScenarioError;
use pyo3::prelude::*;

/// A failure: the exception to raise, and its message.
pub struct Failure {
    kind: &'static str,
    message: String,
    fault: Option<Fault>,
}

impl Failure {
    pub fn new(kind: &'static str, message: impl ToString) -> Self {
        Self { kind, message: message.to_string(), fault: None }
    }

    /// This failure, with the name of the file.
    pub fn of_file(self, path: &str) -> Self {
        let fault = self.fault.map(|fault| Fault { what: format!("{path}: {}", fault.what), ..fault });
        Self { message: format!("{path}: {}", self.message), fault, ..self }
    }

    fn field(message: impl ToString, fault: Fault) -> Self {
        Self { kind: "FieldError", message: message.to_string(), fault: Some(fault) }
    }
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::field(&fault, fault.clone())
    }
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        let kind = match &refusal {
            Refusal::Field(fault) => return fault.clone().into(),
            Refusal::UnknownSuggestion { .. } | Refusal::UnknownObservation { .. } => "NotFoundError",
            Refusal::NotPending { .. } | Refusal::Stale => "ConflictError",
            Refusal::Full { .. } | Refusal::Selection(_) | Refusal::Ended(_) | Refusal::GivenUp => "EngineError",
        };
        Self::new(kind, refusal)
    }
}

impl From<SetupError> for Failure {
    fn from(error: SetupError) -> Self {
        match &error {
            SetupError::Invalid(faults) => match faults.first() {
                Some(fault) => Self::field(&error, fault.clone()),
                None => Self::new("EngineError", error),
            },
            SetupError::Agent(why) => {
                let hint = SetupError::AGENT_HINT.to_owned();
                let fault = Fault { field: "agent".to_owned(), what: why.to_string(), hint };
                Self::field(&error, fault)
            }
        }
    }
}

impl From<ReplayError> for Failure {
    fn from(error: ReplayError) -> Self {
        match error {
            ReplayError::Setup(error) => error.into(),
            error => Self::new("EngineError", error),
        }
    }
}

impl From<ResultsError> for Failure {
    fn from(error: ResultsError) -> Self {
        Self::new("EngineError", error)
    }
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        let (field, hint) = match &error {
            ScenarioError::UnknownScenario { .. } => ("scenario", "name a built-in scenario or a file"),
            ScenarioError::UnknownLearner { .. }
            | ScenarioError::Misfit { .. }
            | ScenarioError::RepeatedLearner(_)
            | ScenarioError::NoLearner => ("learners", "name learners of the scenario"),
            ScenarioError::Invalid { problems, .. } => match problems.first() {
                Some(problem) => {
                    let (field, what, hint) = (problem.key.clone(), problem.what.clone(), problem.hint.clone());
                    return Self::field(&error, Fault { field, what, hint });
                }
                None => return Self::new("EngineError", error),
            },
            _ => return Self::new("EngineError", error),
        };
        let fault = Fault { field: field.to_owned(), what: error.to_string(), hint: hint.to_owned() };
        Self::field(&error, fault)
    }
}

impl From<Failure> for PyErr {
    fn from(Failure { kind, message, fault }: Failure) -> Self {
        Python::attach(|py| {
            let raised = py.import("body_schema._errors").and_then(|errors| {
                let class = errors.getattr(kind)?;
                match fault {
                    Some(Fault { field, what, hint }) => class.call1((message, field, what, hint)),
                    None => class.call1((message,)),
                }
            });
            raised.map_or_else(|error| error, PyErr::from_value)
        })
    }
}
