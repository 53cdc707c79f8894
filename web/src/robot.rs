//! A robot elsewhere: its suggestions, the status of its session, and the visitor's reports about suggestions.

use body_schema_ask_tell::{Answer, Outcome, Status, Suggestion};
use body_schema_scenario::WorldKind;
use body_schema_wire::{ChannelReading, Description, JointKind};

use crate::{
    host::Command,
    panel::{Panel, Robot},
    wire::Standing,
};

/// The visitor's report about the suggested movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Said {
    /// The robot cannot go there.
    NotReachable,
    /// It went there, and nothing was seen.
    NotSeen,
    /// It shall not go there.
    Skip,
}

impl Said {
    /// All reports, with the labels of their buttons and what each does.
    pub const ALL: [(Self, &str, &str); 3] = [
        (
            Self::NotReachable,
            "Not reachable",
            "The robot cannot go there: postures near it are not suggested any more, the wider around the more often it is said",
        ),
        (Self::NotSeen, "Not seen", "The robot went there and nothing was seen: such places count as harder to see"),
        (Self::Skip, "Skip", "It is not carried out, and leaves no trace"),
    ];
}

impl Panel {
    /// Whether the session is one with a robot elsewhere.
    pub fn is_external(&self) -> bool {
        self.session.as_ref().is_some_and(|session| session.world == WorldKind::External)
    }

    /// The movement that is suggested next.
    pub fn suggestion(&self) -> Option<&Suggestion> {
        self.robot.standing.as_ref()?.pending.first()
    }

    pub(crate) fn take_standing(&mut self, standing: Standing) {
        let next = |robot: &Robot| robot.standing.as_ref()?.pending.first().map(|suggestion| suggestion.id);
        let before = next(&self.robot);
        self.robot.standing = Some(standing);
        if next(&self.robot) != before {
            self.copied = None;
        }
    }

    /// Asks for a suggestion, as the robot's own program would.
    pub(crate) fn suggest(&mut self) {
        let Some(session) = self.asked_session() else { return };
        self.ask(Command::Suggest { session });
    }

    /// Reports the outcome of the suggested movement.
    pub(crate) fn say(&mut self, said: Said) {
        let Some(Suggestion { id: suggestion, configuration, .. }) = self.suggestion().cloned() else { return };
        let Some(session) = self.asked_session() else { return };
        self.ask(match said {
            Said::NotReachable => Command::EndSuggestion { session, suggestion, state: Outcome::Infeasible },
            Said::Skip => Command::EndSuggestion { session, suggestion, state: Outcome::Abandoned },
            Said::NotSeen => Command::NotSeen { session, suggestion, configuration },
        });
    }

    /// The session, if no other request about it is under way.
    fn asked_session(&mut self) -> Option<String> {
        let session = self.session.as_ref().filter(|_| !self.robot.asking)?.id.clone();
        self.robot.asking = true;
        Some(session)
    }

    /// The present activity, in a sentence.
    pub(crate) fn robot_status(&self) -> String {
        let latest = self.history.latest();
        let Some(Standing { status, pending, .. }) = &self.robot.standing else { return "Loading…".to_owned() };
        if let Some(failure) = &status.failure {
            return format!("Nothing more is learned: {failure}");
        }
        if self.cursor < latest {
            return format!("Observation {} of {latest}.", self.cursor);
        }
        if !self.server {
            return "What was asked and told, up to its last observation.".to_owned();
        }
        match (pending.first(), &status.enough) {
            (Some(next), _) => format!("Waiting for the robot to carry out suggestion {}.", next.id),
            (None, Some(_)) => "Enough was learned; its files stand under Share.".to_owned(),
            (None, None) => "Waiting for the robot to ask where to move.".to_owned(),
        }
    }

    /// The robot in sentences: the suggestion, and the status of the session.
    pub(crate) fn robot_words(&self) -> Vec<String> {
        let (Some(Standing { status, last, .. }), Some(description)) = (&self.robot.standing, self.description())
        else {
            return Vec::new();
        };
        let mut words = Vec::new();
        if let Some(next) = self.suggestion() {
            let joints = positions(description, next).into_iter().map(|[name, _, shown]| format!("{name} {shown}"));
            words.push(format!("Suggestion {}: {}.", next.id, joints.collect::<Vec<_>>().join(", ")));
            words.extend(expectations(description, next, status));
        }
        words.extend(standing(status, last.as_ref()));
        words
    }
}

/// The target of a suggestion for each joint: its name, the position in the units of the URDF, and in units for people.
pub fn positions(description: &Description, suggestion: &Suggestion) -> Vec<[String; 3]> {
    let joints = description.joints.iter().filter_map(|joint| {
        let position = *suggestion.configuration.get(&joint.name)?;
        let [own, shown] = match joint.kind {
            JointKind::Prismatic => [format!("{position:.4} m"), format!("{:.1} mm", position * 1e3)],
            JointKind::Revolute => [format!("{position:.4} rad"), format!("{:.1}°", position.to_degrees())],
        };
        Some([joint.name.clone(), own, shown])
    });
    joints.collect()
}

/// The expectations of a suggestion, in sentences.
pub fn expectations(description: &Description, suggestion: &Suggestion, status: &Status) -> Vec<String> {
    let mut words = Vec::new();
    if let Some(socket) = &suggestion.socket {
        words.push(format!("The target is to be held in socket {socket}."));
    }
    match (status.expected_error_mm, suggestion.expected_error_mm_after) {
        (Some(now), Some(after)) if after < now => {
            let less = length(now - after);
            words.push(format!("Expected to lower the error by {less}, from {} to {}.", length(now), length(after)));
        }
        (_, Some(after)) => words.push(format!("An error of {} is expected after it.", length(after))),
        _ => {}
    }
    let mut details = vec![format!("Chance to be seen {:.0} %", suggestion.chance_seen * 100.0)];
    if let Some(travel) = suggestion.travel_rad {
        let turns = description.joints.iter().all(|joint| joint.kind == JointKind::Revolute);
        let travel = if turns {
            format!("{:.0}°", travel.to_degrees())
        } else {
            format!("{travel:.2} (rad, or m where it slides)")
        };
        details.push(format!("the joint that moves farthest moves {travel}"));
    }
    words.push(details.join("; ") + ".");
    words
}

/// The status of a session, in sentences.
pub fn standing(status: &Status, last: Option<&Answer>) -> Vec<String> {
    let mut words = vec![accuracy(status), told(status)];
    if status.up_to_motion {
        words.push(
            "Nothing tells where the whole stands: its place is a convention, and errors are those beyond it."
                .to_owned(),
        );
    }
    words.extend(last.map(latest));
    if !status.outliers.is_empty() {
        words.push(format!("Taken for outliers: {}.", list(&status.outliers)));
    }
    match status.changes_noticed {
        0 => {}
        1 => words.push("The body seemed to have changed once.".to_owned()),
        many => words.push(format!("The body seemed to have changed {many} times.")),
    }
    words
}

/// A sentence on its accuracy, and how many movements are left until that is enough.
fn accuracy(status: &Status) -> String {
    let Some(now) = status.expected_error_mm else {
        return "How accurate it is, this estimator cannot tell.".to_owned();
    };
    let is_below = now < status.wanted_mm;
    let (now, wanted) = (length(now), length(status.wanted_mm));
    if let Some(enough) = &status.enough {
        let reached = length(enough.expected_error_mm);
        return format!("Enough: an error of {reached} is expected, {wanted} was wanted.");
    }
    let left = match (status.movements_left, status.model_error_mm) {
        _ if is_below => ": it is enough once five movements in a row have confirmed it".to_owned(),
        (Some(1), _) => ": about one more movement".to_owned(),
        (Some(left), _) => format!(": about {left} more movements"),
        (None, Some(own)) if own > status.wanted_mm => {
            format!("; the model itself is off by {}, so that no number of movements will do", length(own))
        }
        (None, _) => "; how many more movements that takes cannot be told yet".to_owned(),
    };
    format!("An error of {now} is expected, {wanted} is wanted{left}.")
}

fn told(status: &Status) -> String {
    let mut text = match status.observations {
        0 => return "Nothing was observed yet.".to_owned(),
        1 => "1 observation".to_owned(),
        many => format!("{many} observations"),
    };
    if status.not_seen > 0 {
        text += &format!(", {} of which saw nothing", status.not_seen);
    }
    if !status.excluded.is_empty() {
        text += &format!(", without {}, which count for nothing", list(&status.excluded));
    }
    text + "."
}

fn latest(answer: &Answer) -> String {
    let number = answer.observation;
    let Some(sigmas) = answer.innovation_sigmas.filter(|_| answer.seen) else {
        return format!("The last, {number}, saw nothing.");
    };
    let mut text = format!("The last, {number}, was {sigmas:.1} σ from what was expected");
    if let Some(probability) = answer.outlier_probability.filter(|p| *p > ChannelReading::OUTLIER) {
        text += &format!(", an outlier with a probability of {:.0} %", probability * 100.0);
    }
    if answer.body_seems_changed {
        text += "; the body seems to have changed";
    }
    text + "."
}

fn list(numbers: &[u64]) -> String {
    numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// A length in millimetres with three digits.
fn length(mm: f64) -> String {
    let digits = if mm < 0.9995 {
        3
    } else if mm < 9.995 {
        2
    } else {
        1
    };
    format!("{mm:.digits$} mm")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status() -> Status {
        Status {
            revision: 9,
            observations: 5,
            excluded: vec![],
            not_seen: 0,
            outliers: vec![],
            pending: 0,
            expected_error_mm: Some(1.8),
            up_to_motion: false,
            model_error_mm: None,
            wanted_mm: 1.0,
            enough: None,
            movements_left: Some(7),
            changes_noticed: 0,
            failure: None,
        }
    }

    #[test]
    fn how_many_movements_are_left_is_said_or_why_it_cannot_be() {
        let mut status = status();
        assert_eq!(accuracy(&status), "An error of 1.80 mm is expected, 1.00 mm is wanted: about 7 more movements.");
        status.expected_error_mm = Some(0.9);
        assert!(
            accuracy(&status)
                .ends_with("1.00 mm is wanted: it is enough once five movements in a row have confirmed it.")
        );
        status.expected_error_mm = Some(1.8);
        (status.movements_left, status.model_error_mm) = (None, Some(1.2));
        assert!(
            accuracy(&status).ends_with("the model itself is off by 1.20 mm, so that no number of movements will do.")
        );
        status.model_error_mm = Some(0.1);
        assert!(accuracy(&status).ends_with("cannot be told yet."));
    }

    #[test]
    fn observations_and_the_last_of_them_are_said() {
        let mut status = status();
        (status.not_seen, status.excluded, status.outliers) = (1, vec![2], vec![3, 5]);
        let mut answer = Answer {
            observation: 5,
            seen: true,
            innovation_sigmas: Some(41.0),
            outlier_probability: Some(0.97),
            expected_error_mm: Some(1.8),
            body_seems_changed: false,
        };
        assert_eq!(
            standing(&status, Some(&answer))[1..],
            [
                "5 observations, 1 of which saw nothing, without 2, which count for nothing.",
                "The last, 5, was 41.0 σ from what was expected, an outlier with a probability of 97 %.",
                "Taken for outliers: 3, 5.",
            ]
        );
        answer.seen = false;
        assert_eq!(latest(&answer), "The last, 5, saw nothing.");
    }
}
