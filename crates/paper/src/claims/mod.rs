//! Every number and remark of the paper as data, and how each is judged by what was measured.
//!
//! Verdicts are computed. A number agrees within a factor of 1.5 and in part within a factor of 3: robot, noise and
//! thresholds differ, so closer agreement would be chance. Remarks are turned into inequalities, stated in each row.

mod evidence;
mod joints;
mod remarks;
mod selectors;
mod setup;
mod speed;

pub use evidence::{Evidence, Finding};

use super::{
    Plan,
    experiments::{Kind, PaperExperiment, experiment},
    report::Row,
};

/// One number or remark of the paper.
#[derive(Clone, Copy, Debug)]
pub struct Claim {
    /// Its identifier.
    pub id: &'static str,
    /// Where the paper says it.
    pub figure: &'static str,
    /// What it is about.
    pub what: &'static str,
    /// What the paper says.
    pub paper: &'static str,
    /// The paper's number, in `unit`.
    pub paper_value: Option<f64>,
    /// Unit of the paper's number and ours.
    pub unit: &'static str,
    /// How it is judged.
    pub test: Test,
}

/// How a claim is judged.
#[derive(Clone, Copy, Debug)]
pub enum Test {
    /// By the outcome of the experiment of this name.
    By(&'static str, Judge),
    /// Not yet; the text says what is missing.
    Missing(&'static str),
}

/// A function that judges a claim by the outcome of its experiment; `None` if the outcome lacks the data.
type Judge = fn(&Evidence<'_>) -> Option<Finding>;

/// All claims, in the order of the paper.
pub fn claims() -> impl Iterator<Item = &'static Claim> {
    [setup::CLAIMS, speed::SIMULATED, joints::CLAIMS, speed::HEAD, selectors::CLAIMS, remarks::CLAIMS]
        .into_iter()
        .flatten()
}

impl Claim {
    /// The row of the report: the claim beside its evidence; an error says why there is no evidence.
    pub fn row(&self, plan: &Plan, evidence: Option<Result<Evidence<'_>, String>>) -> Row {
        let Test::By(id, judge) = self.test else {
            let missing = if let Test::Missing(missing) = self.test { missing } else { "" };
            return self.not_measured(missing);
        };
        let evidence = match evidence {
            Some(Ok(evidence)) => evidence,
            Some(Err(reason)) => return self.not_measured(&reason),
            None => return self.not_measured("its experiment was not run"),
        };
        let Some(finding) = judge(&evidence) else {
            return self.not_measured(&format!("the outcome of experiment `{id}` does not tell"));
        };
        let seeds = plan.seeds_of(evidence.experiment);
        Row {
            ours: finding.ours,
            ours_text: finding.text,
            agrees: Some(finding.agrees),
            why: finding.why,
            experiment: Some(id.to_owned()),
            scenario: Some(evidence.experiment.scenario.to_owned()),
            seeds: Some(format!("{}..{}", seeds.start(), seeds.end())),
            runs: Some(seeds.end() - seeds.start() + 1),
            command: Some(command(evidence.experiment, plan)),
            ..self.not_measured("")
        }
    }

    fn not_measured(&self, reason: &str) -> Row {
        Row {
            id: self.id.to_owned(),
            figure: self.figure.to_owned(),
            what: self.what.to_owned(),
            paper: self.paper.to_owned(),
            paper_value: self.paper_value,
            ours: None,
            ours_text: format!("not measured: {reason}"),
            unit: self.unit.to_owned(),
            agrees: None,
            why: reason.to_owned(),
            experiment: if let Test::By(id, _) = self.test { Some(id.to_owned()) } else { None },
            scenario: None,
            seeds: None,
            runs: None,
            command: None,
        }
    }

    /// The experiment that judges it, if there is one yet.
    pub fn experiment(&self) -> Option<&'static PaperExperiment> {
        match self.test {
            Test::By(id, _) => experiment(id),
            Test::Missing(_) => None,
        }
    }
}

/// The command that repeats an experiment.
fn command(experiment: &PaperExperiment, plan: &Plan) -> String {
    let seeds = plan.seeds_of(experiment);
    let (first, last) = (seeds.start(), seeds.end());
    let steps = experiment.kind.steps(plan.quick);
    let learners: String = experiment.learners.iter().map(|name| format!(" --learner {name}")).collect();
    let scenario = experiment.scenario;
    match experiment.kind {
        Kind::Comparison { .. } => {
            format!("body-schema compare {scenario}{learners} --seeds {first}..{last} --steps {steps}")
        }
        Kind::Sweep { key, values, .. } => {
            let values: Vec<String> = values.iter().map(f64::to_string).collect();
            let values = values.join(",");
            format!(
                "body-schema sweep {scenario}{learners} --set {key}={values} --seeds {first}..{last} --steps {steps}"
            )
        }
        Kind::Timing { .. } | Kind::Selection { .. } => {
            format!("body-schema paper --only {}{}", experiment.id, if plan.quick { " --quick" } else { "" })
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn claims_have_names_of_their_own_and_experiments_that_exist() {
        let mut ids = BTreeSet::new();
        for claim in claims() {
            assert!(ids.insert(claim.id), "{} twice", claim.id);
            if let Test::By(id, _) = claim.test {
                assert!(experiment(id).is_some(), "{}: no experiment {id}", claim.id);
            }
            assert!(claim.paper_value.is_none() || !claim.unit.is_empty(), "{}: a number without a unit", claim.id);
        }
    }
}
