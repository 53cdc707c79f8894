//! The learners of a scenario: those that its file names, and any estimator with any policy.

use super::{Scenario, ScenarioError};
use crate::experiment::LearnerDescription;

/// A learner that a scenario offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LearnerSpec {
    /// Its name.
    pub name: String,
    /// Its estimator.
    pub estimator: EstimatorKind,
    /// Its policy.
    pub policy: PolicyKind,
    /// Whether its filter adds the scenario's stabilising noise.
    pub stabilising: bool,
    /// Whether it runs when no learner is named.
    pub by_default: bool,
}

impl LearnerSpec {
    pub(super) fn description(&self) -> LearnerDescription {
        LearnerDescription {
            name: self.name.clone(),
            estimator: self.estimator.name().to_owned(),
            policy: self.policy.name().to_owned(),
        }
    }
}

/// The estimators that a scenario can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorKind {
    /// Recursive least squares.
    Rls,
    /// Recursive least squares by the unscented transform.
    Unscented,
    /// Recursive least squares in the paper's six numbers per joint: a comparison, which shows no covariance.
    RlsSixNumbers,
    /// Stochastic gradient.
    Gradient,
    /// Maximum a posteriori over all measurements, with several hypotheses.
    Smoother,
}

impl EstimatorKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Rls, Self::Unscented, Self::RlsSixNumbers, Self::Gradient, Self::Smoother];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rls => "rls",
            Self::Unscented => "unscented",
            Self::RlsSixNumbers => "rls-six-numbers",
            Self::Gradient => "gradient",
            Self::Smoother => "smoother",
        }
    }

    pub(super) fn keeps_covariance(self) -> bool {
        matches!(self, Self::Rls | Self::Unscented | Self::Smoother)
    }
}

/// The policies that a scenario can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PolicyKind {
    /// Minimises the A-criterion; where a head watches, weighed by the chance of being seen.
    Active,
    /// The same, but where a head watches with blind faith in the predicted marker: a comparison.
    ActiveNaive,
    /// Plans the movements that are still needed together; what `active` is for a smoother.
    ActivePlanned,
    /// As `active`, but by original DIRECT, whatever the scenario's variant.
    ActiveDirect,
    /// As `active`, but the best of as many random configurations: the floor of every search.
    ActiveRandomSearch,
    /// As `active`, but by Bayesian optimisation with as many evaluations.
    ActiveBayesian,
    /// As `active`, but with the expectation of (7) by Monte Carlo over the posterior.
    ActiveMonteCarlo,
    /// Draws uniformly.
    Random,
}

impl PolicyKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Active,
        Self::ActiveNaive,
        Self::ActivePlanned,
        Self::ActiveDirect,
        Self::ActiveRandomSearch,
        Self::ActiveBayesian,
        Self::ActiveMonteCarlo,
        Self::Random,
    ];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::ActiveNaive => "active-naive",
            Self::ActivePlanned => "active-planned",
            Self::ActiveDirect => "active-direct",
            Self::ActiveRandomSearch => "active-random-search",
            Self::ActiveBayesian => "active-bayesian",
            Self::ActiveMonteCarlo => "active-monte-carlo",
            Self::Random => "random",
        }
    }
}

/// Stands between estimator and policy in the name of a composed learner.
const SEPARATOR: char = ':';

impl Scenario {
    /// The learners of these names, in this order; without names those that run by default.
    ///
    /// A name is one of the scenario's, or an estimator and a policy, as in `smoother:random`: with the settings of the
    /// scenario, and the stabilising noise if it has any.
    pub fn chosen(&self, names: Option<&[String]>) -> Result<Vec<LearnerSpec>, ScenarioError> {
        let Some(names) = names else {
            return Ok(self.learners.iter().filter(|spec| spec.by_default).cloned().collect());
        };
        if names.is_empty() {
            return Err(ScenarioError::NoLearner);
        }
        let mut chosen: Vec<LearnerSpec> = Vec::new();
        for name in names {
            let spec = match self.learners.iter().find(|spec| spec.name == *name) {
                Some(spec) => spec.clone(),
                None => self.compose(name)?,
            };
            if chosen.contains(&spec) {
                return Err(ScenarioError::RepeatedLearner(name.clone()));
            }
            chosen.push(spec);
        }
        Ok(chosen)
    }

    /// What else can be compared here: every estimator with every policy that fits it, but for what the scenario names.
    pub fn compositions(&self) -> Vec<LearnerSpec> {
        let pairs =
            EstimatorKind::ALL.into_iter().flat_map(|estimator| PolicyKind::ALL.map(|policy| (estimator, policy)));
        let named = |(estimator, policy): &(EstimatorKind, PolicyKind)| {
            self.learners
                .iter()
                .any(|spec| (spec.estimator, spec.policy, spec.stabilising) == (*estimator, *policy, true))
        };
        pairs
            .filter(|pair| !named(pair))
            .filter_map(|(estimator, policy)| {
                self.compose(&format!("{}{SEPARATOR}{}", estimator.name(), policy.name())).ok()
            })
            .collect()
    }

    fn compose(&self, name: &str) -> Result<LearnerSpec, ScenarioError> {
        let unknown = || ScenarioError::UnknownLearner {
            scenario: self.name.clone(),
            name: name.to_owned(),
            known: self.learners.iter().map(|spec| spec.name.clone()).collect(),
        };
        let (estimator, policy) = name.split_once(SEPARATOR).ok_or_else(unknown)?;
        let estimator = EstimatorKind::ALL.into_iter().find(|kind| kind.name() == estimator).ok_or_else(unknown)?;
        let policy = PolicyKind::ALL.into_iter().find(|kind| kind.name() == policy).ok_or_else(unknown)?;
        if let Some((_, what)) = misfit(estimator, policy, self.robot.layout.marker().is_some()) {
            return Err(ScenarioError::Misfit { name: name.to_owned(), what });
        }
        Ok(LearnerSpec { name: name.to_owned(), estimator, policy, stabilising: true, by_default: false })
    }
}

/// What of a learner is at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Estimator,
    Policy,
}

/// Why an estimator cannot learn by a policy, or not this arm.
pub(super) fn misfit(estimator: EstimatorKind, policy: PolicyKind, learns_marker: bool) -> Option<(Fault, String)> {
    if policy != PolicyKind::Random && !estimator.keeps_covariance() {
        return Some((Fault::Policy, format!("`{}` keeps no covariance to choose by", estimator.name())));
    }
    if estimator == EstimatorKind::RlsSixNumbers && learns_marker {
        return Some((Fault::Estimator, "six numbers per joint leave no place for a learned marker".to_owned()));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{BUILTIN, builtin};

    #[test]
    fn any_estimator_learns_by_any_policy_that_fits() {
        for known in BUILTIN {
            let scenario = builtin(known.name).unwrap();
            let offered = scenario.compositions();
            assert!(offered.iter().all(|spec| scenario.learners.iter().all(|other| other.name != spec.name)));
            // A fast one of each estimator makes steps.
            let names: Vec<String> = (offered.iter())
                .filter(|spec| matches!(spec.policy, PolicyKind::Active | PolicyKind::Random))
                .map(|spec| spec.name.clone())
                .collect();
            if known.name == "arm-20dof" || names.is_empty() {
                continue;
            }
            let mut experiment = scenario.experiment(3, Some(&names)).unwrap();
            for _ in 0..2 {
                experiment.step().unwrap();
            }
            for (learner, name) in experiment.latest().learners.iter().zip(&names) {
                assert_eq!((&learner.name, &learner.failure), (name, &None), "{}", known.name);
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let scenario = builtin("arm-6dof").unwrap();
        let chosen = |name: &str| scenario.chosen(Some(&[name.to_owned()]));
        assert!(matches!(chosen("gradient:active"), Err(ScenarioError::Misfit { .. })));
        for name in ["rls", "rls:", ":random", "rls:rls", "rls:random:random", "RLS:random", ""] {
            assert!(matches!(chosen(name), Err(ScenarioError::UnknownLearner { .. })), "{name}");
        }
        assert_eq!(chosen("smoother:random").unwrap()[0].estimator, EstimatorKind::Smoother);
    }
}
