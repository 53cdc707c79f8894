//! The end of a run, in a sentence computed from the run that names every learner, the best first.

use body_schema_experiment::CONFIRMATION;

use crate::{
    history::Yardstick,
    outcome::Outcome,
    panel::Panel,
    words::{listed, millimetres, movements},
};

/// The end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// The sentence.
    pub sentence: String,
    /// By what it is judged.
    pub judged: String,
    /// Every learner by its place in the description, the best first.
    pub outcomes: Vec<(usize, Outcome)>,
}

impl Panel {
    /// Whether every learner has learned the arm, judged with hindsight, or never will.
    pub fn is_told(&self) -> bool {
        self.description().is_some_and(|description| description.truth.is_some()) && self.history.is_told()
    }

    /// The end of the run; `None` while it goes on.
    pub fn ending(&self) -> Option<Ending> {
        let latest = self.history.latest();
        let over = self.is_told() || latest >= self.run_to() || self.remaining() == Some(0);
        let over = over && !self.is_external();
        let description = self.description().filter(|_| over && latest > 0 && self.human().is_none())?;
        let outcomes = self.history.outcomes(description.learners.len());
        let mut outcomes: Vec<(usize, Outcome)> = outcomes.into_iter().enumerate().collect();
        outcomes.sort_by(|(_, a), (_, b)| a.rank().partial_cmp(&b.rank()).unwrap_or(std::cmp::Ordering::Equal));
        let named: Vec<(&str, Outcome)> = (outcomes.iter())
            .map(|(learner, outcome)| (description.learners[*learner].name.as_str(), *outcome))
            .collect();
        let limits = description.thresholds;
        let accurate = format!(
            "accurate: axes within {}° and {:.0} mm, for at least {CONFIRMATION} movements more",
            limits.orientation_deg,
            limits.location_m * 1e3
        );
        let is_expected = self.history.yardstick() == Yardstick::Expected;
        let (sentence, judged) = match description.truth {
            None if is_expected => (expected(&named), "as each learner expects it by its own estimate".to_owned()),
            None => (held_out(&named), "judged by measurements held out from learning".to_owned()),
            Some(_) => {
                let changed = description.change_at.is_some_and(|change| latest > change);
                (counted(&named, changed), accurate)
            }
        };
        Some(Ending { sentence, judged, outcomes })
    }
}

/// How many movements each learner needed. The best stand first.
fn counted(outcomes: &[(&str, Outcome)], changed: bool) -> String {
    let after: Vec<(&str, u64)> = (outcomes.iter())
        .filter_map(|(name, outcome)| match outcome {
            Outcome::After(movements) => Some((*name, *movements)),
            _ => None,
        })
        .collect();
    let made = outcomes.iter().find_map(|(_, outcome)| match outcome {
        Outcome::NotWithin(movements) => Some(*movements),
        _ => None,
    });
    let those = |is: fn(&Outcome) -> bool| -> Vec<&str> {
        outcomes.iter().filter(|(_, outcome)| is(outcome)).map(|(name, _)| *name).collect()
    };
    let slow = those(|outcome| matches!(outcome, Outcome::NotWithin(_)));
    let lost = those(|outcome| matches!(outcome, Outcome::Diverged));
    let mut clauses = Vec::new();
    if let [(best, first), others @ ..] = &after[..] {
        let others: String = others.iter().map(|(name, movements)| format!(", {name} {movements}")).collect();
        clauses.push(format!("{best} needed {}{others}", movements(*first)));
    }
    if let Some(made) = made {
        clauses.push(format!("{made} were not enough for {}", listed(&slow)));
        if after.is_empty() {
            clauses[0] = format!("{made} movements were not enough for {}", listed(&slow));
        }
    }
    if !lost.is_empty() {
        clauses.push(format!("{} ran away from the truth", listed(&lost)));
    }
    let told = clauses.join("; ") + ".";
    if changed { format!("After the body changed, {told}") } else { told }
}

/// After how many movements each learner's error over held-out measurements stayed near the best error at the end, and
/// with which error the others end.
fn held_out(outcomes: &[(&str, Outcome)]) -> String {
    let ends: Vec<(&str, f64, Option<u64>)> = (outcomes.iter())
        .filter_map(|(name, outcome)| match outcome {
            Outcome::HeldOut { last, near } => Some((*name, *last, *near)),
            _ => None,
        })
        .collect();
    let best = ends.iter().map(|(_, last, _)| *last).fold(f64::INFINITY, f64::min);
    let near: Vec<(&str, u64)> = ends.iter().filter_map(|(name, _, near)| Some((*name, (*near)?))).collect();
    let far: Vec<String> = (ends.iter())
        .filter(|(.., near)| near.is_none())
        .map(|(name, last, _)| format!("{name} ends at {}", millimetres(*last)))
        .collect();
    let [(first, needed), others @ ..] = &near[..] else { return far.join(", ") + "." };
    let others: String = others.iter().map(|(name, movements)| format!(", {name} after {movements}")).collect();
    let best = millimetres(best);
    let mut told = match ends.len() {
        1 => format!("{first} ends at {best}"),
        _ => format!("{first} came within 10 % of the best error, {best}, after {}{others}", movements(*needed)),
    };
    if !far.is_empty() {
        told += &format!("; {}", far.join(", "));
    }
    told + "."
}

/// The errors that learners expect of themselves.
fn expected(outcomes: &[(&str, Outcome)]) -> String {
    let errors = outcomes.iter().filter_map(|(name, outcome)| match outcome {
        Outcome::HeldOut { last, .. } => Some(format!("{name} by {}", millimetres(*last))),
        _ => None,
    });
    format!("By their own estimates they err at the end: {}.", errors.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::{
        Outcome::{After, Diverged, HeldOut, NotWithin},
        counted, expected, held_out,
    };

    #[test]
    fn sentences_name_every_learner_the_best_first() {
        let all = [("global", After(10)), ("active", After(91)), ("random", After(168))];
        assert_eq!(counted(&all, false), "global needed 10 movements, active 91, random 168.");
        assert_eq!(counted(&all[..1], true), "After the body changed, global needed 10 movements.");
        assert_eq!(counted(&[("a", After(1))], false), "a needed 1 movement.");
        let open =
            [("active", After(55)), ("random", NotWithin(1000)), ("naive", NotWithin(1000)), ("rigid", Diverged)];
        assert_eq!(
            counted(&open, false),
            "active needed 55 movements; 1000 were not enough for random and naive; rigid ran away from the truth."
        );
        assert_eq!(counted(&open[1..2], false), "1000 movements were not enough for random.");
    }

    #[test]
    fn held_out_errors_are_compared_at_the_end_and_by_the_movements_until_then() {
        let held = |last, near| HeldOut { last, near };
        let all =
            [("global", held(0.00062, Some(21))), ("random", held(0.0006, Some(63))), ("nominal", held(0.0021, None))];
        assert_eq!(
            held_out(&all),
            "global came within 10 % of the best error, 0.60 mm, after 21 movements, random after 63; nominal ends at \
             2.10 mm."
        );
        assert_eq!(held_out(&all[..1]), "global ends at 0.62 mm.");
        assert_eq!(expected(&all[..1]), "By their own estimates they err at the end: global by 0.62 mm.");
    }
}
