//! Why this posture: what DIRECT did, ready to be drawn.

use crate::{
    host::Command,
    panel::Panel,
    settings::Tab,
    wire::{BoxShape, Evaluation, Problem, SearchBox, Selection},
};

/// While steps are made, the search is asked for so often at most, s.
const ASK_EVERY: f64 = 0.5;

/// What is known of the last search.
#[derive(Clone, Debug, Default)]
pub struct Why {
    /// The search.
    pub selection: Option<Selection>,
    /// Why there is none.
    pub reason: Option<String>,
    /// The iteration that is shown; `None` for the last.
    pub iteration: Option<usize>,
    /// The visitor's posture and what it would have taught.
    pub evaluation: Option<Evaluation>,
    /// The posture is being judged.
    pub evaluating: bool,
    /// The posture that was asked for.
    pub proposed: Option<Vec<f64>>,
    /// Learner and step that were asked for.
    asked: Option<(String, u64)>,
    asked_at: f64,
    waiting: bool,
}

impl Why {
    pub(crate) fn answered(&mut self, learner: &str, selection: Option<Selection>) {
        self.waiting = false;
        let Some(selection) = selection.filter(is_sound) else {
            self.selection = None;
            self.reason = Some(format!("The last movement of {learner} was not chosen by DIRECT."));
            return;
        };
        let is_new =
            self.selection.as_ref().is_none_or(|old| (old.step, &old.learner) != (selection.step, &selection.learner));
        if is_new {
            (self.evaluation, self.proposed, self.evaluating) = (None, None, false);
        }
        self.reason = None;
        let last = selection.iterations.len() - 1;
        self.iteration = self.iteration.filter(|iteration| *iteration < last);
        self.selection = Some(selection);
    }

    pub(crate) fn refused(&mut self, problem: &Problem) {
        self.waiting = false;
        self.selection = None;
        self.reason = Some(format!("{}.", problem.sentence()));
    }

    pub(crate) fn evaluated(&mut self, evaluation: Evaluation) {
        // An answer to an older question is of no use.
        if self.proposed.as_deref() == Some(&evaluation.configuration) {
            self.evaluating = false;
            self.evaluation = Some(evaluation);
        }
    }
}

/// Whether everything that a selection refers to is there, so that drawing it needs no further care.
fn is_sound(selection: &Selection) -> bool {
    let joints = selection.joints.len();
    let boxes = &selection.boxes;
    joints > 0
        && selection.chosen.index < boxes.len()
        && selection.chosen.point.len() == joints
        && selection.chosen.configuration.len() == joints
        && !selection.iterations.is_empty()
        && selection.iterations.iter().all(|iteration| iteration.hull.iter().all(|index| *index < boxes.len()))
        && boxes.iter().all(|one| {
            one.centre.len() == joints
                && !one.shapes.is_empty()
                && one.shapes.iter().all(|shape| shape.levels.len() == joints)
        })
}

impl SearchBox {
    /// The shape at the end of an iteration; `None` before the box was made.
    pub fn shape(&self, iteration: usize) -> Option<&BoxShape> {
        self.shapes.iter().rev().find(|shape| shape.iteration <= iteration)
    }
}

impl BoxShape {
    /// Length of side i in the unit cube.
    pub fn side(&self, joint: usize) -> f64 {
        self.levels.get(joint).map_or(1.0, |level| 3f64.powi(-i32::try_from(*level).unwrap_or(i32::MAX)))
    }

    /// What the variant takes for the size of a box: the longest side (DIRECT-l) or half the diagonal (DIRECT).
    pub fn size(&self, variant: &str) -> f64 {
        let sides = (0..self.levels.len()).map(|joint| self.side(joint));
        if variant == "direct" {
            sides.map(|side| side * side).sum::<f64>().sqrt() / 2.0
        } else {
            sides.fold(0.0, f64::max)
        }
    }
}

/// A rectangle of the slice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Index of its box.
    pub index: usize,
    /// Lower left corner in the unit square.
    pub min: [f64; 2],
    /// Upper right corner.
    pub max: [f64; 2],
    /// The criterion at its centre.
    pub value: Option<f64>,
    /// Whether it is potentially optimal.
    pub optimal: bool,
}

/// A box in the diagram of sizes and values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dot {
    /// Its size.
    pub size: f64,
    /// Its value.
    pub value: f64,
    /// Whether it is potentially optimal.
    pub optimal: bool,
}

impl Selection {
    /// The last iteration.
    pub fn last(&self) -> usize {
        self.iterations.len().saturating_sub(1)
    }

    /// The boxes that the plane of two joints through the chosen configuration meets, at the end of an iteration.
    pub fn slice(&self, (a, b): (usize, usize), iteration: usize) -> Vec<Rectangle> {
        let hull = self.iterations.get(iteration).map_or(&[][..], |iteration| &iteration.hull);
        let boxes = self.boxes.iter().enumerate();
        boxes
            .filter_map(|(index, one)| {
                let shape = one.shape(iteration)?;
                let half = |joint: usize| shape.side(joint) / 2.0;
                let meets =
                    |joint: usize| (one.centre[joint] - self.chosen.point[joint]).abs() <= half(joint) * (1.0 + 1e-9);
                let others = (0..self.joints.len()).filter(|joint| *joint != a && *joint != b);
                others.into_iter().all(meets).then(|| Rectangle {
                    index,
                    min: [one.centre[a] - half(a), one.centre[b] - half(b)],
                    max: [one.centre[a] + half(a), one.centre[b] + half(b)],
                    value: one.value,
                    optimal: hull.contains(&index),
                })
            })
            .collect()
    }

    /// Every box by size and value at the end of an iteration.
    pub fn diagram(&self, iteration: usize) -> Vec<Dot> {
        let hull = self.iterations.get(iteration).map_or(&[][..], |iteration| &iteration.hull);
        let boxes = self.boxes.iter().enumerate();
        boxes
            .filter_map(|(index, one)| {
                let size = one.shape(iteration)?.size(&self.variant);
                Some(Dot { size, value: one.value?, optimal: hull.contains(&index) })
            })
            .collect()
    }

    /// Smallest and largest value over the whole search, for one scale of colours over all iterations.
    pub fn range(&self) -> (f64, f64) {
        let values = self.boxes.iter().filter_map(|one| one.value).filter(|value| value.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low < high { (low, high) } else { (self.trace - 1.0, self.trace) }
    }

    /// The joints that were divided most, for a slice in which there is something to see.
    pub fn busiest(&self) -> (usize, usize) {
        let divisions =
            |joint: usize| -> u32 { self.boxes.iter().filter_map(|one| one.shapes.last()?.levels.get(joint)).sum() };
        let mut joints: Vec<usize> = (0..self.joints.len()).collect();
        joints.sort_by_key(|joint| std::cmp::Reverse(divisions(*joint)));
        match joints[..] {
            [a, b, ..] => (a.min(b), a.max(b)),
            _ => (0, 0),
        }
    }

    /// The configuration of a point of the slice.
    pub fn configuration(&self, (a, b): (usize, usize), [x, y]: [f64; 2]) -> Vec<f64> {
        let mut configuration = self.chosen.configuration.clone();
        for (joint, place) in [(a, x), (b, y)] {
            if let (Some(value), Some(Some([low, high]))) =
                (configuration.get_mut(joint), self.joints.get(joint).map(|joint| Some(joint.limits)))
            {
                *value = (low + place.clamp(0.0, 1.0) * (high - low)).clamp(low, high);
            }
        }
        configuration
    }
}

impl Panel {
    /// The learner whose choice is explained.
    pub fn explained(&self) -> Option<&str> {
        let learners = &self.description()?.learners;
        let chosen = self.settings.learner.as_ref().and_then(|name| learners.iter().find(|one| one.name == *name));
        let active = || learners.iter().find(|one| one.policy.starts_with("active"));
        Some(&chosen.or_else(active)?.name)
    }

    /// Asks how the latest movement was chosen, if that is to be seen and not known yet.
    pub(crate) fn explain(&mut self, now: f64) {
        let latest = self.history.latest();
        if self.settings.tab != Tab::Why || !self.is_ready() || self.why.waiting || self.restoring.is_some() {
            return;
        }
        let (Some(learner), Some(session)) = (self.explained().map(str::to_owned), &self.session) else { return };
        let wanted = (learner.clone(), latest);
        if self.why.asked.as_ref() == Some(&wanted) || (self.playing && now - self.why.asked_at < ASK_EVERY) {
            return;
        }
        let session = session.id.clone();
        (self.why.asked, self.why.asked_at, self.why.waiting) = (Some(wanted), now, true);
        self.ask(Command::Select { session, learner });
    }

    /// Asks what a posture would have taught.
    pub fn propose(&mut self, configuration: Vec<f64>) {
        let (Some(session), Some(selection)) = (&self.session, &self.why.selection) else { return };
        let (session, learner) = (session.id.clone(), selection.learner.clone());
        self.why.proposed = Some(configuration.clone());
        self.why.evaluating = true;
        self.ask(Command::Evaluate { session, learner, configuration });
    }
}
