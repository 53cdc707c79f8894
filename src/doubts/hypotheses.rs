//! Other ways to read columns, compared by how well they fit.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    Doubt, DoubtKind, Evidence, Subject,
    doubt::length,
    fit::{Fit, Sight},
};
use crate::{
    kinematics::{Joint, JointKind},
    most::middle,
};

/// A way to read a column must bring the residual below this share of what it was.
const CONVINCING: f64 = 0.5;
/// Zeros that are off by less are what calibration is for, radians.
const OFF: f64 = 0.05;
/// Faults that are looked for one after the other.
const ROUNDS: usize = 4;
/// Rows of fits, and the joints above which fits take fewer.
const ROWS: usize = 200;
const MANY_JOINTS: usize = 40;
/// Up to so many joints any two columns are tried in each other's place, and beyond it neighbours.
const SWAPS: usize = 12;

/// A way to read the table.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hypothesis {
    /// A joint's readings times a factor: −1 turns the sign round, others change units.
    Scaled(usize, f64),
    /// All angles times a factor.
    Angles(f64),
    /// A joint's readings plus an angle.
    Shifted(usize, f64),
    /// Two joints' columns in each other's place.
    Swapped(usize, usize),
    /// The target's coordinates times a factor.
    Target(f64),
    /// The target's coordinates in a left-handed frame.
    Mirrored,
}

pub fn doubts(subject: &Subject, evidence: &Evidence) -> Vec<Doubt> {
    let Some(mut readings) = Readings::new(subject, evidence) else { return Vec::new() };
    let mut doubts: Vec<Doubt> = Vec::new();
    let mut residual = readings.sight.fit(&readings.motions());
    for _ in 0..ROUNDS {
        let Some((hypothesis, left)) = readings.best().filter(|(_, left)| left.judged < CONVINCING * residual.judged)
        else {
            break;
        };
        doubts.push(hypothesis.doubt(subject, &readings.target, residual, left));
        readings.apply(hypothesis);
        residual = left;
    }
    doubts
}

/// The rows of the fits as they are read at present.
struct Readings<'a> {
    joints: &'a [Joint],
    configurations: Vec<Vec<f64>>,
    sight: Sight,
    /// The name of the target.
    target: String,
}

impl<'a> Readings<'a> {
    fn new(subject: &Subject<'a>, evidence: &Evidence) -> Option<Self> {
        let most = if subject.joints.len() > MANY_JOINTS { ROWS / 4 } else { ROWS };
        let usable: Vec<usize> = match (&evidence.sockets, evidence.targets.first()) {
            (Some(sockets), _) => (0..sockets.len()).collect(),
            (None, Some(seen)) => (0..seen.points.len()).filter(|row| seen.points[*row].is_some()).collect(),
            (None, None) => return None,
        };
        // Fewer rows than these fit under too many hypotheses.
        if usable.len() < 6 {
            return None;
        }
        let count = usable.len().min(most);
        let rows: Vec<usize> = (0..count).map(|k| usable[k * usable.len() / count]).collect();
        let sight = match (&evidence.sockets, evidence.targets.first()) {
            (Some(sockets), _) => Sight::Sockets(rows.iter().map(|row| sockets[*row]).collect()),
            (None, seen) => Sight::Points(subject.target, rows.iter().filter_map(|row| seen?.points[*row]).collect()),
        };
        let configurations = rows.iter().map(|row| evidence.configurations[*row].clone()).collect();
        let target = evidence.targets.first().map(|seen| seen.name.clone()).unwrap_or_default();
        Some(Self { joints: subject.joints, configurations, sight, target })
    }

    /// By row: what the joints do to the last link.
    fn motions(&self) -> Vec<Isometry3<f64>> {
        let motion = |row: &Vec<f64>| {
            self.joints.iter().zip(row).fold(Isometry3::identity(), |motion, (joint, q)| motion * joint.exp(*q))
        };
        self.configurations.iter().map(motion).collect()
    }

    fn apply(&mut self, hypothesis: Hypothesis) {
        if let Sight::Points(_, points) = &mut self.sight {
            points.iter_mut().for_each(|point| *point = hypothesis.of_point(point));
        }
        let kinds: Vec<JointKind> = self.joints.iter().map(Joint::kind).collect();
        for row in &mut self.configurations {
            match hypothesis {
                Hypothesis::Scaled(joint, factor) => row[joint] *= factor,
                Hypothesis::Shifted(joint, by) => row[joint] += by,
                Hypothesis::Swapped(one, other) => row.swap(one, other),
                Hypothesis::Angles(factor) => {
                    let angles = row.iter_mut().zip(&kinds).filter(|(_, kind)| **kind == JointKind::Revolute);
                    angles.for_each(|(angle, _)| *angle *= factor);
                }
                Hypothesis::Target(_) | Hypothesis::Mirrored => {}
            }
        }
    }

    /// The hypothesis that fits best, and what it leaves.
    fn best(&self) -> Option<(Hypothesis, Fit)> {
        let mut tried = self.of_target();
        tried.extend(self.of_order());
        tried.extend(self.of_joints());
        tried.into_iter().filter(|(_, left)| left.judged.is_finite()).min_by(|a, b| a.1.judged.total_cmp(&b.1.judged))
    }

    fn whole(&self, hypothesis: Hypothesis) -> (Hypothesis, Fit) {
        let mut readings = Self {
            joints: self.joints,
            configurations: self.configurations.clone(),
            sight: self.sight.clone(),
            target: String::new(),
        };
        readings.apply(hypothesis);
        (hypothesis, readings.sight.fit(&readings.motions()))
    }

    fn of_target(&self) -> Vec<(Hypothesis, Fit)> {
        let mut tried = vec![self.whole(Hypothesis::Angles(PI / 180.0)), self.whole(Hypothesis::Angles(180.0 / PI))];
        if let Sight::Points(guess, points) = &self.sight {
            let motions = self.motions();
            let expected = spread(&motions.iter().map(|motion| motion * guess).collect::<Vec<_>>());
            for hypothesis in [Hypothesis::Target(1e-3), Hypothesis::Target(1e3), Hypothesis::Mirrored] {
                let read: Vec<Point3<f64>> = points.iter().map(|point| hypothesis.of_point(point)).collect();
                // Points that shrink come nearer to anything: they must be spread as the robot's are.
                let is_likely = (0.2..5.0).contains(&(spread(&read) / expected));
                let fit = Sight::Points(*guess, read).fit(&motions);
                tried.extend(is_likely.then_some((hypothesis, fit)));
            }
        }
        tried
    }

    fn of_order(&self) -> Vec<(Hypothesis, Fit)> {
        let joints = self.joints.len();
        let reach = if joints > SWAPS { 1 } else { joints };
        let pairs = (0..joints).flat_map(|one| (one + 1..joints.min(one + 1 + reach)).map(move |other| (one, other)));
        if joints > MANY_JOINTS {
            return Vec::new();
        }
        pairs
            .filter(|(one, other)| self.joints[*one].kind() == self.joints[*other].kind() || joints <= SWAPS)
            .map(|(one, other)| self.whole(Hypothesis::Swapped(one, other)))
            .collect()
    }

    /// Each joint by itself; what stands before and behind it is computed once, so that a joint costs the same however many
    /// there are.
    fn of_joints(&self) -> Vec<(Hypothesis, Fit)> {
        let mut tried = Vec::new();
        let mut before: Vec<Isometry3<f64>> = vec![Isometry3::identity(); self.configurations.len()];
        let mut behind = self.motions();
        for (index, joint) in self.joints.iter().enumerate() {
            for (row, behind) in self.configurations.iter().zip(&mut behind) {
                *behind = joint.exp(-row[index]) * *behind;
            }
            let read = |of: &dyn Fn(f64) -> f64| {
                let rows = self.configurations.iter().zip(before.iter().zip(&behind));
                let motions = rows.map(|(row, (before, behind))| before * joint.exp(of(row[index])) * behind);
                self.sight.fit(&motions.collect::<Vec<_>>())
            };
            let factors: &[f64] = match joint.kind() {
                JointKind::Revolute => &[-1.0, PI / 180.0, 180.0 / PI],
                JointKind::Prismatic => &[-1.0, 1e-3, 1e3],
            };
            tried.extend(factors.iter().map(|&factor| (Hypothesis::Scaled(index, factor), read(&|q| factor * q))));
            if joint.kind() == JointKind::Revolute {
                let (by, left) = shift(&|by| read(&|q| q + by), self.joints.len() <= MANY_JOINTS);
                tried.extend((by.abs() > OFF).then_some((Hypothesis::Shifted(index, by), left)));
            }
            for (row, before) in self.configurations.iter().zip(&mut before) {
                *before *= joint.exp(row[index]);
            }
        }
        tried
    }
}

/// The shift within half a turn that leaves least: on a grid of 30 deg, then between its neighbours if `fine`.
fn shift(left: &dyn Fn(f64) -> Fit, fine: bool) -> (f64, Fit) {
    const STEP: f64 = PI / 6.0;
    let grid = (-5..=6).map(|k| f64::from(k) * STEP).map(|by| (by, left(by)));
    let Some(mut best) = grid.min_by(|a, b| a.1.judged.total_cmp(&b.1.judged)) else { return (0.0, left(0.0)) };
    let mut step = STEP / 2.0;
    while fine && step > 0.002 {
        for by in [best.0 - step, best.0 + step] {
            let there = left(by);
            if there.judged < best.1.judged {
                best = (by, there);
            }
        }
        step /= 2.0;
    }
    best
}

/// How far most points are from where most are.
fn spread(points: &[Point3<f64>]) -> f64 {
    let middle = |values: Vec<f64>| middle(values).unwrap_or(f64::NAN);
    let centre = Point3::from(Vector3::from_fn(|k, _| middle(points.iter().map(|point| point[k]).collect())));
    middle(points.iter().map(|point| (point - centre).norm()).collect())
}

impl Hypothesis {
    fn of_point(self, point: &Point3<f64>) -> Point3<f64> {
        match self {
            Self::Target(factor) => point * factor,
            Self::Mirrored => Point3::new(point.y, point.x, point.z),
            _ => *point,
        }
    }

    fn doubt(self, subject: &Subject, target: &str, residual: Fit, left: Fit) -> Doubt {
        let column = |joint: usize| subject.columns[joint].clone();
        let turns = |joint: usize| subject.joints[joint].kind() == JointKind::Revolute;
        let small = |factor: f64| factor.abs() < 1.0;
        let (kind, column, what, mend) = match self {
            Self::Scaled(joint, -1.0) => (
                DoubtKind::Sign,
                Some(column(joint)),
                "its sign is reversed against the description".to_owned(),
                "turn the sign of the column round, or the joint's <axis>",
            ),
            Self::Scaled(joint, factor) if turns(joint) && small(factor) => (
                DoubtKind::Unit,
                Some(column(joint)),
                "degrees, read as radians".to_owned(),
                "end its title with `_deg`",
            ),
            Self::Scaled(joint, _) if turns(joint) => (
                DoubtKind::Unit,
                Some(column(joint)),
                "radians, read as degrees".to_owned(),
                "end its title with `_rad`",
            ),
            Self::Scaled(joint, factor) if small(factor) => (
                DoubtKind::Unit,
                Some(column(joint)),
                "millimetres, read as metres".to_owned(),
                "end its title with `_mm`",
            ),
            Self::Scaled(joint, _) => (
                DoubtKind::Unit,
                Some(column(joint)),
                "metres, read as millimetres".to_owned(),
                "end its title with `_m`",
            ),
            Self::Angles(factor) if small(factor) => (
                DoubtKind::Unit,
                None,
                "all joint angles are degrees, read as radians".to_owned(),
                "end their titles with `_deg`",
            ),
            Self::Angles(_) => (
                DoubtKind::Unit,
                None,
                "all joint angles are radians, read as degrees".to_owned(),
                "end their titles with `_rad`",
            ),
            Self::Shifted(joint, by) => (
                DoubtKind::Zero,
                Some(column(joint)),
                format!("its zero is {:.1} deg from the description's", -by.to_degrees()),
                "correct the column or the joint's <origin>, or learn an offset that wide",
            ),
            Self::Swapped(one, other) => (
                DoubtKind::Order,
                Some(column(one)),
                format!("in the place of column `{}`, and that in its", column(other)),
                "exchange the two titles",
            ),
            Self::Target(factor) if small(factor) => (
                DoubtKind::Unit,
                Some(target.to_owned()),
                "positions are millimetres, read as metres".to_owned(),
                "end their titles with `_mm`",
            ),
            Self::Target(_) => (
                DoubtKind::Unit,
                Some(target.to_owned()),
                "positions are metres, read as millimetres".to_owned(),
                "end their titles with `_m`",
            ),
            Self::Mirrored => (
                DoubtKind::Mirror,
                Some(target.to_owned()),
                "positions are in a left-handed frame".to_owned(),
                "exchange two coordinates' titles, or turn one's sign round",
            ),
        };
        let evidence =
            format!("read so, the description fits to {} instead of {} rms", length(left.rms), length(residual.rms));
        Doubt { kind, column, lines: Vec::new(), what, evidence, mend: mend.to_owned() }
    }
}
