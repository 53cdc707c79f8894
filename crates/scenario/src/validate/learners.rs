//! The learners of a file, and the movements within which they promise to converge.

use std::collections::BTreeMap;

use toml::Spanned;

use super::{Check, raw};
use crate::{
    EstimatorKind, LearnerSpec, PolicyKind,
    error::did_you_mean,
    learners::HUMAN,
    misfit::{Fault, Misfit, Setting, misfit},
};

impl Check<'_> {
    pub(super) fn learners(&mut self, raw: &Spanned<Vec<raw::Learner>>, setting: Setting) -> Vec<LearnerSpec> {
        let mut learners: Vec<LearnerSpec> = Vec::new();
        for (index, learner) in raw.get_ref().iter().enumerate() {
            let (name, policy) = (learner.name.get_ref(), *learner.policy.get_ref());
            let key = format!("learner[{index}]");
            if learners.iter().any(|other| other.name == *name) || RESERVED.contains(&name.as_str()) || !is_plain(name)
            {
                let what = format!("{name:?} is taken, reserved or not a plain word");
                let hint = "give each learner a name of its own, of letters, digits, '-' and '_'";
                self.problem(learner.name.span(), format!("{key}.name"), what, hint);
            }
            if policy == PolicyKind::Human {
                let what = "a person is offered in every simulated scenario, by the name `human`";
                let hint = "remove this learner, or write another policy";
                self.problem(learner.policy.span(), format!("{key}.policy"), what, hint);
                continue;
            }
            match misfit(learner.estimator, policy, setting) {
                Some(Misfit { fault: Fault::Policy, what, instead: (_, policy) }) => {
                    let hint = format!("write `policy = \"{}\"`", policy.name());
                    self.problem(learner.policy.span(), format!("{key}.policy"), what, hint);
                }
                Some(Misfit { fault: Fault::Estimator, what, .. }) => {
                    let hint = "write `estimator = \"rls\"`, or set `learn_marker = false`";
                    self.problem(learner.name.span(), format!("{key}.estimator"), what, hint);
                }
                None => {}
            }
            if let (Some(key_span), EstimatorKind::Gradient) = (&learner.stabilising_noise, learner.estimator) {
                let hint = "remove it; only `rls` adds this noise";
                let what = "a gradient has no covariance to add noise to";
                self.problem(key_span.span(), format!("{key}.stabilising_noise"), what, hint);
            }
            if let (Some(given), true) = (&learner.robust, learner.estimator != EstimatorKind::Smoother) {
                let hint = "remove it; only a `smoother` has a loss that can be robust";
                self.problem(given.span(), format!("{key}.robust"), "this estimator knows least squares alone", hint);
            }
            if let (Some(given), true) = (&learner.holds_axes, learner.estimator != EstimatorKind::Smoother) {
                let hint = "remove it; only a `smoother` holds the axes and learns the rest";
                self.problem(given.span(), format!("{key}.holds_axes"), "this estimator learns all there is", hint);
            }
            let holds_axes = learner.holds_axes.as_ref().is_some_and(|given| *given.get_ref());
            // Beside what a real robot's sensors read it is a yardstick all the same: the description as it stands.
            let learns_nothing = setting.learns_axes_alone && !setting.is_measured && !setting.is_external;
            if let (Some(given), true, true) = (&learner.holds_axes, holds_axes, learns_nothing) {
                let hint = "remove it, or learn something else too, as with `learn_marker = true`";
                let what = "nothing is left to learn: this robot's axes are all that is learned";
                self.problem(given.span(), format!("{key}.holds_axes"), what, hint);
            }
            let stabilising = learner.stabilising_noise.as_ref().is_none_or(|given| *given.get_ref());
            let robust = learner.robust.as_ref().is_none_or(|given| *given.get_ref());
            let (name, by_default) = (name.clone(), learner.by_default);
            learners.push(LearnerSpec {
                name,
                estimator: learner.estimator,
                policy,
                stabilising,
                robust,
                holds_axes,
                by_default,
            });
        }
        if learners.is_empty() {
            self.problem(raw.span(), "learner", "there is no learner", "add a [[learner]]");
        }
        learners
    }

    pub(super) fn promises(
        &mut self,
        raw: &BTreeMap<Spanned<String>, Spanned<u64>>,
        learners: &[LearnerSpec],
    ) -> BTreeMap<String, u64> {
        let mut promises = BTreeMap::new();
        for (name, promise) in raw {
            let names = || learners.iter().map(|learner| learner.name.as_str());
            if !names().any(|known| known == name.get_ref()) {
                let hint = did_you_mean(name.get_ref(), names(), || {
                    format!("name one of {}", names().collect::<Vec<_>>().join(", "))
                });
                let key = format!("promises.{}", name.get_ref());
                self.problem(name.span(), key, "there is no such learner", hint);
            }
            promises.insert(name.get_ref().clone(), *promise.get_ref());
        }
        promises
    }
}

/// Names with another meaning: in recordings, and in comparisons of learners.
const RESERVED: [&str; 2] = ["world", HUMAN];

fn is_plain(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c))
}
