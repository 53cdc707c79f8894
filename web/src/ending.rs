//! The end of a run, in a sentence computed from the run that names both sides of every comparison.

use crate::{
    history::{Verdict, Yardstick},
    panel::Panel,
};

/// The outcome of a learner at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Accurate from this movement on; after a change of the body movements are counted from the change.
    After(u64),
    /// Its estimate diverged.
    Diverged,
    /// Not accurate within this many movements.
    NotWithin(u64),
    /// The error over held-out measurements, metres, where there is no truth to judge by: at the end, and the mean over
    /// the run.
    HeldOut {
        /// At the end.
        last: f64,
        /// Mean over all movements.
        mean: f64,
    },
}

/// The end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// The sentence.
    pub sentence: String,
    /// The quantity that was counted.
    pub counted: String,
    /// Every learner by its place in the description, the best first.
    pub outcomes: Vec<(usize, Outcome)>,
}

impl Outcome {
    /// The outcome in a few words.
    pub fn words(self) -> String {
        match self {
            Self::After(movements) => movements.to_string(),
            Self::Diverged => "ran away".to_owned(),
            Self::NotWithin(movements) => format!("not within {movements}"),
            Self::HeldOut { last, .. } => format!("{:.1} mm", last * 1e3),
        }
    }

    /// The rank: the smaller, the better.
    fn rank(self) -> f64 {
        match self {
            Self::After(movements) => movements as f64,
            Self::HeldOut { mean, .. } => mean,
            Self::NotWithin(_) => f64::MAX,
            Self::Diverged => f64::INFINITY,
        }
    }
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
        let over = over && !self.is_outside();
        let description = self.description().filter(|_| over && latest > 0 && self.human().is_none())?;
        let change = description.change_at.filter(|change| latest > *change);
        let mut outcomes: Vec<(usize, Outcome)> =
            (0..description.learners.len()).map(|learner| (learner, self.outcome(learner))).collect();
        outcomes.sort_by(|(_, a), (_, b)| a.rank().total_cmp(&b.rank()));
        let counted = match change {
            _ if self.history.yardstick() == Yardstick::Expected => format!("Expected error after {latest} movements"),
            _ if description.truth.is_none() => format!("Error over measurements held out, after {latest} movements"),
            Some(_) => "Movements after the body changed, until accurate again".to_owned(),
            None => "Movements until accurate".to_owned(),
        };
        let name = |learner: usize| description.learners[learner].name.as_str();
        let sentence = self.compared(&outcomes).map_or_else(
            || match self.history.yardstick() {
                Yardstick::Expected => {
                    let (learner, outcome) = outcomes[0];
                    format!("After {latest} movements {} expects an error of {}.", name(learner), outcome.words())
                }
                _ => format!("{}: {}.", name(outcomes[0].0), outcomes[0].1.words()),
            },
            |[(a, first), (b, second)]| sentence(name(a), first, name(b), second),
        );
        Some(Ending { sentence, counted, outcomes })
    }

    fn outcome(&self, learner: usize) -> Outcome {
        let latest = self.history.latest();
        let begin = self.history.begin(latest);
        match self.history.verdict(latest, learner) {
            Verdict::Diverged => Outcome::Diverged,
            Verdict::Converged(first) => Outcome::After(first - begin),
            Verdict::Learning | Verdict::Settled | Verdict::Waiting => {
                let errors = self.history.errors(learner);
                let last = errors.last().map_or(f64::INFINITY, |[_, error]| *error);
                Outcome::HeldOut { last, mean: self.history.mean_error(learner) }
            }
            Verdict::Outside | Verdict::Within(..) => Outcome::NotWithin(latest - begin),
        }
    }

    /// The two learners that the sentence compares, the better one first: one that chooses with one that does not, or
    /// else the first with the last.
    fn compared(&self, outcomes: &[(usize, Outcome)]) -> Option<[(usize, Outcome); 2]> {
        let learners = &self.description()?.learners;
        let named = |name: &str| outcomes.iter().position(|(learner, _)| learners[*learner].name == name);
        let (a, b) = named("active").zip(named("random")).unwrap_or((0, outcomes.len() - 1));
        (a != b).then(|| [outcomes[a.min(b)], outcomes[a.max(b)]])
    }
}

/// The sentence, where `a` is the better.
fn sentence(a: &str, first: Outcome, b: &str, second: Outcome) -> String {
    use Outcome::{After, Diverged, HeldOut, NotWithin};
    match (first, second) {
        (After(few), After(many)) if few == many => format!("{a} and {b} needed {few} movements each."),
        (After(few), After(many)) => {
            let times = many as f64 / few.max(1) as f64;
            format!("{a} needed {times:.1} times fewer movements than {b}.")
        }
        (After(few), NotWithin(made)) => {
            format!("{a} needed {few} movements; {made} were not enough for {b}.")
        }
        (After(few), _) => format!("{a} needed {few} movements; {b} ran away from the truth."),
        (HeldOut { mean: low, .. }, HeldOut { mean: high, .. }) if low > 0.97 * high => {
            format!("Over the whole run {a} and {b} predicted equally well.")
        }
        (HeldOut { mean: low, .. }, HeldOut { mean: high, .. }) => {
            let less = (1.0 - low / high) * 100.0;
            format!("Over the whole run, the mean error of {a} was {less:.0} % below that of {b}.")
        }
        (NotWithin(made), NotWithin(_)) => format!("{made} movements were not enough for {a} and {b}."),
        (NotWithin(made), _) => format!("{made} movements were not enough for {a}, and {b} ran away from the truth."),
        (Diverged, _) | (HeldOut { .. }, _) => format!("{a} and {b} ran away from the truth."),
    }
}

#[cfg(test)]
mod tests {
    use super::{
        Outcome::{After, Diverged, HeldOut, NotWithin},
        sentence,
    };

    #[test]
    fn sentences_name_both_sides_and_what_they_compare() {
        assert_eq!(
            sentence("active", After(55), "random", After(484)),
            "active needed 8.8 times fewer movements than random."
        );
        let open = sentence("active", After(55), "random", NotWithin(1000));
        assert_eq!(open, "active needed 55 movements; 1000 were not enough for random.");
        assert!(sentence("active", After(7), "rigid", Diverged).contains("rigid ran away"));
        let held_out = |last, mean| HeldOut { last, mean };
        let better = sentence("active", held_out(0.002, 0.003), "random", held_out(0.002, 0.004));
        assert!(better.contains("the mean error of active was 25 % below that of random"));
        assert!(sentence("a", held_out(0.2, 0.30), "b", held_out(0.2, 0.301)).contains("equally well"));
    }
}
