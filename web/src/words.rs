//! Plain words for what the engine names by its terms, which stand in the tooltips.

use body_schema_experiment::CONFIRMATION;
use body_schema_wire::LearnerDescription;

use crate::{history::Verdict, panel::Panel};

/// What the page is about, in one line.
pub const STATEMENT: &str = "A robot learns its own arm by moving it. Who learns fastest?";

/// A length in millimetres, to three digits where it is small.
pub fn millimetres(metres: f64) -> String {
    let mm = metres * 1e3;
    match mm.abs() {
        small if small < 10.0 => format!("{mm:.2} mm"),
        small if small < 100.0 => format!("{mm:.1} mm"),
        _ => format!("{mm:.0} mm"),
    }
}

/// Names as a list: "a", "a and b", "a, b and c".
pub fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

/// How a learner goes about it, in a few words.
pub fn about(learner: &LearnerDescription) -> &'static str {
    let plans = learner.estimator.starts_with("smoother");
    match learner.policy.as_str() {
        "human" => "you choose the movements",
        "random" if learner.estimator == "gradient" => "moves at random, learns by gradient",
        "random" => "moves at random",
        policy if policy.contains("naive") => "asks, but forgets that it may not see",
        policy if policy.starts_with("active") && plans => "asks, weighing all movements together",
        policy if policy.starts_with("active") => "asks which movement teaches most",
        _ => "another way to choose",
    }
}

/// So many movements, in words.
pub fn movements(count: u64) -> String {
    if count == 1 { "1 movement".to_owned() } else { format!("{count} movements") }
}

/// How a learner learns and how it chooses, in a sentence that no other combination has.
pub fn how(learner: &LearnerDescription) -> String {
    let learns = match learner.estimator.as_str() {
        "smoother" => "Weighs all movements together",
        "rls" => "Learns from one movement after the other",
        "rls-six-numbers" => "Learns one after the other, with six numbers a joint",
        "unscented" => "Learns one after the other, by trying variants of its guess",
        "gradient" => "Takes small steps downhill",
        other => return format!("{other}; {}", learner.policy),
    };
    let chooses = match learner.policy.as_str() {
        "human" => "you choose the movements",
        "random" => "moves at random",
        "active" => "asks which movement teaches most",
        "active-naive" => "asks, but forgets that it may not see",
        "active-planned" => "asks, and plans several movements ahead",
        "active-direct" => "asks, searching by DIRECT",
        "active-random-search" => "asks, of postures drawn at random",
        "active-bayesian" => "asks, searching by a model of what teaches",
        "active-monte-carlo" => "asks, averaging over what its arm may be",
        other => other,
    };
    format!("{learns}; {chooses}")
}

/// The description of a learner with the terms of the field.
pub fn terms(learner: &LearnerDescription) -> String {
    let LearnerDescription { name, estimator, policy, .. } = learner;
    let about = about(learner);
    format!("{name}: {about}. Estimator: {estimator}; policy, by which it chooses its movements: {policy}.")
}

impl Panel {
    /// The state of a learner at the shown step, in words.
    pub fn verdict(&self, learner: usize) -> String {
        let change = self.description().and_then(|one| one.change_at).filter(|change| self.cursor > *change);
        match self.history.verdict(self.cursor, learner) {
            Verdict::Waiting => "not moved yet".to_owned(),
            Verdict::Diverged => "ran away".to_owned(),
            Verdict::Learning => "learning".to_owned(),
            Verdict::Settled => "sure of itself".to_owned(),
            Verdict::Outside => "not accurate yet".to_owned(),
            Verdict::Within(first, _) => format!("accurate since {first}"),
            Verdict::Converged(first) => match change {
                Some(change) => format!("recovered in {}", first - change),
                None => format!("learned in {first}"),
            },
        }
    }

    /// The meaning of that state, with its term.
    pub(crate) fn verdict_terms(&self, learner: usize) -> String {
        let thresholds = self.description().map(|description| description.thresholds);
        let [degrees, millimetres] =
            thresholds.map_or([0.0; 2], |limits| [limits.orientation_deg, limits.location_m * 1e3]);
        let accurate = format!("orientation within {degrees}° and location within {millimetres:.0} mm");
        let own = match self.history.row(self.cursor, learner).is_some_and(|row| row.settled) {
            true => "It has settled: by its own estimate, without the truth, it predicts well enough.",
            false => "It has not settled: by its own estimate it does not predict well enough yet.",
        };
        match self.history.verdict(self.cursor, learner) {
            Verdict::Diverged => {
                let why = self.history.failure(learner).unwrap_or("its estimate left all bounds");
                format!("It diverged: {why}")
            }
            Verdict::Converged(first) => {
                format!("It converged: {accurate} from movement {first} on, confirmed by {CONFIRMATION} more. {own}")
            }
            Verdict::Within(first, confirmed) => format!(
                "Its errors are {accurate} since movement {first}. It has converged once {CONFIRMATION} movements confirm \
                 it; {confirmed} have so far. {own}"
            ),
            Verdict::Outside => format!("It converges once its errors stay in bounds: {accurate}. {own}"),
            _ => own.to_owned(),
        }
    }

    /// Whether a filter's own uncertainty is kept large on purpose, far above what its data allow.
    pub(crate) fn is_kept_large(&self, learner: usize) -> bool {
        const MUCH: f64 = 3.0;
        let learners = self.description().map(|description| &description.learners);
        let is_stabilised = learners.and_then(|all| all.get(learner)).is_some_and(|one| one.stabilised);
        let row = self.history.row(self.cursor, learner);
        is_stabilised && row.and_then(|row| Some(row.trace? > MUCH * row.bound?)).unwrap_or(false)
    }

    /// The unit of the learners' uncertainty.
    pub(crate) fn uncertainty_unit(&self) -> &str {
        self.description().map_or("", |description| description.uncertainty_unit.as_str())
    }

    /// The names of those learners, as a list.
    pub(crate) fn kept_large(&self) -> Option<String> {
        let learners = &self.description()?.learners;
        let names: Vec<&str> = learners
            .iter()
            .enumerate()
            .filter(|(index, _)| self.is_kept_large(*index))
            .map(|(_, learner)| learner.name.as_str())
            .collect();
        (!names.is_empty()).then(|| listed(&names))
    }
}

#[cfg(test)]
mod tests {
    use super::how;
    use body_schema_scenario::{BUILTIN, builtin};

    #[test]
    fn every_way_to_learn_and_to_choose_has_words_of_its_own() {
        let mut said = std::collections::BTreeMap::new();
        for scenario in BUILTIN.iter().map(|scenario| builtin(scenario.name).expect("built in").summary()) {
            for learner in scenario.offered() {
                let way = (learner.estimator.clone(), learner.policy.clone());
                let words = how(learner);
                assert!(
                    !words.contains(&learner.estimator) && !words.contains(&format!("; {}", learner.policy)),
                    "{words}"
                );
                assert_eq!(*said.entry(words.clone()).or_insert_with(|| way.clone()), way, "{words}");
            }
        }
    }
}
