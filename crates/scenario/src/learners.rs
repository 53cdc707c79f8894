//! The learners of a scenario: those that its file names, and any estimator with any policy.

use super::{
    EstimatorKind, PolicyKind, Scenario, ScenarioError,
    error::suggest,
    misfit::{Misfit, Setting, misfit},
};
use body_schema_engine::sensing::Loss;
use body_schema_experiment::LearnerSetting;

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
    /// Whether its smoother takes the scenario's loss; otherwise least squares.
    pub robust: bool,
    /// Whether it takes the axes from the description, and learns the rest.
    pub holds_axes: bool,
    /// Whether it runs when no learner is named.
    pub by_default: bool,
}

impl LearnerSpec {
    /// A pair of estimator and policy that no file names, with all the settings of the scenario.
    fn composed(name: &str, estimator: EstimatorKind, policy: PolicyKind) -> Self {
        Self {
            name: name.to_owned(),
            estimator,
            policy,
            stabilising: true,
            robust: true,
            holds_axes: false,
            by_default: false,
        }
    }
}

/// The separator between estimator and policy in the name of a composed learner.
const SEPARATOR: char = ':';

/// The learner for which a person chooses, unless another estimator is named.
pub(super) const HUMAN: &str = "human";

impl Scenario {
    /// The learners of these names, in this order; without names those that run by default.
    ///
    /// A name is one of the scenario's, or an estimator and a policy, as in `smoother:random`: with the settings of the
    /// scenario, and the stabilising noise if it has any. `human` is `rls:human`.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::NoLearner`] if the list is empty, [`ScenarioError::RepeatedLearner`] if a learner is in it
    /// twice, [`ScenarioError::UnknownLearner`] or [`ScenarioError::Misfit`] if a name is none or its policy does not
    /// fit.
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

    /// The other learners that can be compared here: every estimator with every policy that fits it, except those that
    /// the scenario names.
    pub fn compositions(&self) -> Vec<LearnerSpec> {
        let pairs =
            EstimatorKind::ALL.into_iter().flat_map(|estimator| PolicyKind::ALL.map(|policy| (estimator, policy)));
        let named = |(estimator, policy): &(EstimatorKind, PolicyKind)| {
            let composed = LearnerSpec::composed("", *estimator, *policy);
            self.learners
                .iter()
                .any(|spec| LearnerSpec { name: String::new(), by_default: false, ..spec.clone() } == composed)
        };
        pairs
            .filter(|pair| !named(pair))
            .filter_map(|(estimator, policy)| self.compose(&composed(estimator, policy)).ok())
            .collect()
    }

    /// A learner as experiments know it.
    pub(crate) fn learner_setting(&self, spec: &LearnerSpec) -> LearnerSetting {
        let noise = match spec.estimator {
            EstimatorKind::Rls => self.filter.stabilising,
            EstimatorKind::Unscented => self.unscented.stabilising,
            // They show no covariance, or add nothing to it.
            EstimatorKind::OverparameterisedRls | EstimatorKind::Smoother | EstimatorKind::Gradient => None,
        };
        let robust = spec.estimator == EstimatorKind::Smoother
            && spec.robust
            && matches!(self.smoother.loss, Loss::Mixture { .. });
        LearnerSetting {
            name: spec.name.clone(),
            estimator: spec.estimator.name().to_owned(),
            policy: spec.policy.name().to_owned(),
            stabilised: spec.stabilising && noise.is_some(),
            robust,
        }
    }

    fn compose(&self, name: &str) -> Result<LearnerSpec, ScenarioError> {
        let unknown = || ScenarioError::UnknownLearner {
            scenario: self.name.clone(),
            name: name.to_owned(),
            suggested: self.similar_learner(name),
            known: self.learners.iter().map(|spec| spec.name.clone()).collect(),
        };
        let pair = if name == HUMAN { "rls:human" } else { name };
        let (estimator, policy) = pair.split_once(SEPARATOR).ok_or_else(unknown)?;
        let estimator = EstimatorKind::ALL.into_iter().find(|kind| kind.name() == estimator).ok_or_else(unknown)?;
        let policy = PolicyKind::ALL.into_iter().find(|kind| kind.name() == policy).ok_or_else(unknown)?;
        match misfit(estimator, policy, self.setting()) {
            None => Ok(LearnerSpec::composed(name, estimator, policy)),
            Some(Misfit { what, .. }) => {
                Err(ScenarioError::Misfit { name: name.to_owned(), what, fitting: self.fitting(estimator, policy) })
            }
        }
    }

    fn setting(&self) -> Setting {
        Setting::of(&self.robot, Some(&self.measurement_model), self.world.kind())
    }

    /// The name of the nearest pair that fits.
    fn fitting(&self, mut estimator: EstimatorKind, mut policy: PolicyKind) -> String {
        while let Some(misfit) = misfit(estimator, policy, self.setting()) {
            (estimator, policy) = misfit.instead;
        }
        composed(estimator, policy)
    }

    /// The learner that was probably meant by an unknown name: one of the scenario's, or two halves.
    fn similar_learner(&self, name: &str) -> Option<String> {
        let Some((estimator, policy)) = name.split_once(SEPARATOR) else {
            return suggest(name, self.learners.iter().map(|spec| spec.name.as_str())).map(str::to_owned);
        };
        let estimator = suggest(estimator, EstimatorKind::ALL.map(EstimatorKind::name))?;
        let policy = suggest(policy, PolicyKind::ALL.map(PolicyKind::name))?;
        let estimator = EstimatorKind::ALL.into_iter().find(|kind| kind.name() == estimator)?;
        let policy = PolicyKind::ALL.into_iter().find(|kind| kind.name() == policy)?;
        Some(self.fitting(estimator, policy))
    }
}

fn composed(estimator: EstimatorKind, policy: PolicyKind) -> String {
    if (estimator, policy) == (EstimatorKind::Rls, PolicyKind::Human) {
        return HUMAN.to_owned();
    }
    format!("{}{SEPARATOR}{}", estimator.name(), policy.name())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BUILTIN, WorldSpec, builtin};

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

    #[test]
    fn over_recorded_rows_there_is_nothing_to_search() {
        let (simulated, measured) = (builtin("arm-6dof").unwrap(), builtin("tiago-mocap").unwrap());
        let chosen = |scenario: &Scenario, name: &str| scenario.chosen(Some(&[name.to_owned()]));
        for search in ["direct", "random-search", "bayesian", "monte-carlo", "naive"] {
            let name = format!("rls:active-{search}");
            chosen(&simulated, &name).unwrap();
            let message = chosen(&measured, &name).unwrap_err().to_string();
            assert!(message.contains("every row is tried") && message.ends_with("write `rls:active`"), "{message}");
            assert!(measured.compositions().iter().all(|spec| !spec.name.ends_with(search)), "{search} is offered");
        }
        for name in ["rls:active", "smoother:active", "smoother:active-planned", "unscented:random"] {
            chosen(&measured, name).unwrap();
        }
        // What is suggested fits in every respect.
        let message = chosen(&measured, "rls-six-numbers:active-direct").unwrap_err().to_string();
        assert!(message.ends_with("write `rls:random`"), "{message}");
    }

    #[test]
    fn a_person_is_offered_where_a_robot_can_be_moved_and_never_by_default() {
        for known in BUILTIN {
            let scenario = builtin(known.name).unwrap();
            let is_simulated = matches!(scenario.world, WorldSpec::Simulated { .. });
            let offered: Vec<String> = scenario.compositions().into_iter().map(|spec| spec.name).collect();
            for name in ["human", "smoother:human"] {
                assert_eq!(offered.iter().any(|known| known == name), is_simulated, "{name} in {}", known.name);
                assert_eq!(scenario.chosen(Some(&[name.to_owned()])).is_ok(), is_simulated);
            }
            let by_default = scenario.chosen(None).unwrap();
            assert!(by_default.iter().all(|spec| spec.policy != PolicyKind::Human));
        }
        let human = &builtin("arm-6dof").unwrap().chosen(Some(&["human".to_owned()])).unwrap()[0];
        assert_eq!(
            (human.name.as_str(), human.estimator, human.policy),
            ("human", EstimatorKind::Rls, PolicyKind::Human)
        );
    }

    #[test]
    fn a_misspelt_name_gets_a_suggestion() {
        let scenario = builtin("arm-6dof").unwrap();
        for (name, meant) in [
            ("actve", "active"),
            ("gobal", "global"),
            ("smother:random", "smoother:random"),
            ("smoother:randon", "smoother:random"),
            ("smother:activ", "smoother:active"),
            ("gradiant:active", "gradient:random"),
        ] {
            let message = scenario.chosen(Some(&[name.to_owned()])).unwrap_err().to_string();
            assert!(message.contains(&format!("did you mean `{meant}`?")), "{message}");
        }
        for name in ["xyz", "xyz:random", "rls:xyz"] {
            let message = scenario.chosen(Some(&[name.to_owned()])).unwrap_err().to_string();
            assert!(!message.contains("did you mean") && message.contains("active, random"), "{message}");
        }
    }
}
