//! Other ways to read a table, compared by how well the description explains them.
//!
//! A reading of the table is first tried with the chain as described, base and target free. Those few that fit best are then
//! compared by the evidence of the description with its own errors ([`description`](super::description)): errors that calibration
//! would correct are no fault of the table. A table of sockets, whose evidence has no scale, and that of a very long chain are
//! judged by their residuals alone.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::{
    Diagnostic, DiagnosticKind, Evidence, Line, Subject,
    description::{Explained, Known, explain},
    diagnostic::length,
    fit::{self, Fit, Placed, Sight},
    hypothesis::{Hypothesis, LENGTHS, Seen, zeros_diagnostic},
    moving,
};
use body_schema_engine::{
    elementary::{exp, ln},
    kinematics::{Joint, JointKind},
    model::{Links, State},
    most::{self, middle},
};

/// The share of the residual below which another reading of the table must bring it, where evidence has no scale.
const CONVINCING: f64 = 0.5;
/// The logarithm of the odds from which on another reading of the table is reported.
const TOLD: f64 = 15.0;
/// The size of zeros (radians), and of the change of a size (a share), below which they are left to calibration.
const OFF: f64 = 0.1;
const ANOTHER_SIZE: f64 = 0.03;
/// A row is taken for one that went wrong where it is so many times as far off as the middle one; and one row in how many may be.
const WRONG: (f64, usize) = (3.0, 5);
/// The most rounds in which such rows are left out.
const LEFT_OUT: usize = 5;
/// The most faults that are looked for one after the other.
const ROUNDS: usize = 5;
/// The number of rows of fits, and the number of joints above which fits take fewer.
const ROWS: usize = 100;
const MANY_JOINTS: usize = 40;
/// The number of joints up to which any two columns are tried in each other's place; beyond it only neighbours are.
const SWAPS: usize = 12;
/// The number of readings of the table whose evidence is computed.
const ASKED: usize = 8;
/// The lag of rows below which the test of moving rows decides, if any does.
const LAGGING: f64 = 0.02;
/// The residuals after calibration above which a description does not fit: a share of how far readings are spread, and radians.
const MISFIT: (f64, f64) = (0.05, 0.09);
/// The share of how far places in pictures are spread by which most must be off for a description not to fit.
const MISFIT_OF_MOST: f64 = 0.1;

/// The share of its predicted spread below which a target never moves: less than any other unit makes of it.
const STILL: f64 = 1e-4;

/// The reach above which a robot must be described in another unit, metres.
const LARGE: f64 = 30.0;

pub fn diagnostics(subject: &Subject, evidence: &Evidence) -> Vec<Diagnostic> {
    let Some(mut readings) = Readings::new(subject, evidence) else { return Vec::new() };
    if let Some(still) = readings.still() {
        return vec![still];
    }
    let mut diagnostics: Vec<Diagnostic> = Vec::new();
    let mut standing = readings.judged();
    for _ in 0..ROUNDS {
        if readings.is_explained(&standing.fit) {
            break;
        }
        let best = readings.best(&mut standing);
        let evidence = best.as_ref().and_then(|(_, found)| found.explained.as_ref()).map(|it| it.log_evidence);
        if let Some((shifts, found)) = readings.of_zeros(&standing, evidence) {
            diagnostics.push(zeros_diagnostic(subject, &shifts, &standing.fit, &found.fit));
            readings = shifts
                .iter()
                .fold(readings, |readings, (joint, by)| readings.applied(Hypothesis::Shifted(*joint, *by)));
            standing = found;
            continue;
        }
        let Some((hypothesis, found)) = best else { break };
        diagnostics.push(hypothesis.diagnostic(subject, &readings.seen(), &standing.fit, &found.fit));
        readings = readings.applied(hypothesis);
        standing = found;
    }
    diagnostics.extend(readings.elsewhere(&standing));
    diagnostics.extend(readings.moving(&standing));
    if let Some(misfit) = readings.misfit(&standing) {
        diagnostics.insert(0, misfit);
    }
    diagnostics
}

/// The table as it is read at present.
#[derive(Clone)]
pub struct Readings<'a> {
    subject: Subject<'a>,
    /// The joints' positions in all rows of the table, with or without a reading, each with its moment; ascending.
    moments: Vec<(isize, Vec<f64>)>,
    /// Of these the rows with a reading.
    rows: Vec<usize>,
    /// The lines of these rows.
    lines: Vec<Line>,
    sight: Sight,
    /// The name of the target.
    target: String,
    /// The factor by which the target's coordinates have been scaled.
    size: f64,
}

/// How well the description explains a table.
struct Judged {
    fit: Fit,
    /// The explanation; `None` where evidence has no scale.
    explained: Option<Explained>,
}

impl<'a> Readings<'a> {
    fn new(subject: &Subject<'a>, evidence: &Evidence) -> Option<Self> {
        let seen = evidence.targets.first();
        if evidence.unjudged().is_some() {
            return None;
        }
        let usable = evidence.usable();
        let sight = match (&evidence.sockets, seen) {
            (Some(sockets), _) => Sight::Sockets(usable.iter().map(|row| sockets[*row]).collect()),
            (None, seen) => {
                let seen = seen?;
                let turn = |row: &usize| seen.turns.get(*row).copied().unwrap_or_default();
                let turned = |row: &usize| UnitQuaternion::from_scaled_axis(turn(row));
                let pose = |row: &usize| Some(Isometry3::from_parts(seen.points[*row]?.coords.into(), turned(row)));
                let (poses, turns) = (usable.iter().filter_map(pose).collect(), usable.iter().map(turn).collect());
                let mirrored = |row: &usize| seen.mirrored.get(*row).map(|it| it.unwrap_or_default());
                Sight::Target(fit::Seen {
                    guess: subject.target,
                    poses,
                    turns,
                    mirrored: usable.iter().filter_map(mirrored).collect(),
                    arm: seen.arm_m.filter(|_| !seen.turns.is_empty()),
                })
            }
        };
        let target = seen.map(|seen| seen.name.clone()).unwrap_or_default();
        let lines = usable.iter().map(|row| evidence.line(*row)).collect();
        let moments = evidence.moments().into_iter().zip(evidence.configurations.iter().cloned()).collect();
        Some(Self { subject: *subject, moments, rows: usable, lines, sight, target, size: 1.0 })
    }

    fn seen(&self) -> Seen<'_> {
        Seen { target: &self.target, is_pictured: self.is_pictured(), is_too_large: self.is_too_large() }
    }

    /// Whether the target was found in pictures.
    fn is_pictured(&self) -> bool {
        matches!(&self.sight, Sight::Target(seen) if !seen.mirrored.is_empty())
    }

    /// The joints' positions, for each row with a reading.
    fn configurations(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.rows.iter().map(|row| &self.moments[*row].1)
    }

    fn joints(&self) -> &'a [Joint] {
        self.subject.joints
    }

    /// The rows that fits take, spread evenly over the table.
    fn taken(&self) -> Self {
        let joints = self.joints().len();
        let most = if joints > MANY_JOINTS { ROWS / 2 } else { ROWS };
        let all = self.rows.len();
        let count = all.min(most);
        let rows: Vec<usize> = (0..count).map(|k| k * all / count).collect();
        let sight = match &self.sight {
            Sight::Target(seen) => Sight::Target(seen.of(&rows)),
            Sight::Sockets(sockets) => Sight::Sockets(rows.iter().map(|row| sockets[*row]).collect()),
        };
        let moments = rows.iter().map(|row| self.moments[self.rows[*row]].clone()).collect();
        let lines = rows.iter().map(|row| self.lines[*row].clone()).collect();
        Self { moments, rows: (0..count).collect(), lines, sight, target: self.target.clone(), ..*self }
    }

    /// The motion of the last link in each row.
    fn motions(&self) -> Vec<Isometry3<f64>> {
        let described = State::arm(self.joints().to_vec(), Point3::origin());
        let mut links = Links::new(&described);
        self.configurations().map(|row| links.at(row).link(row.len()).pose()).collect()
    }

    /// The table as a hypothesis reads it.
    fn applied(&self, hypothesis: Hypothesis) -> Self {
        let mut read = self.clone();
        if let Sight::Target(seen) = &mut read.sight {
            if hypothesis == Hypothesis::Mirrored && !seen.mirrored.is_empty() {
                std::mem::swap(&mut seen.poses, &mut seen.mirrored);
            } else {
                seen.poses.iter_mut().for_each(|pose| *pose = hypothesis.of_pose(pose));
            }
            if hypothesis == Hypothesis::RollPitchYaw {
                let numbers = seen.poses.iter_mut().zip(&seen.turns);
                numbers.for_each(|(pose, it)| pose.rotation = UnitQuaternion::from_euler_angles(it.x, it.y, it.z));
            }
        }
        let kinds: Vec<JointKind> = self.joints().iter().map(Joint::kind).collect();
        match hypothesis {
            Hypothesis::Target(factor) | Hypothesis::Size(factor) => read.size *= factor,
            Hypothesis::Lag(rows) => read.lag(rows),
            _ => {}
        }
        for (_, row) in &mut read.moments {
            match hypothesis {
                Hypothesis::Scaled(joint, factor) => row[joint] *= factor,
                Hypothesis::Shifted(joint, by) => row[joint] += by,
                Hypothesis::Swapped(one, other) => row.swap(one, other),
                Hypothesis::Angles(factor) => {
                    let angles = row.iter_mut().zip(&kinds).filter(|(_, kind)| **kind == JointKind::Revolute);
                    angles.for_each(|(angle, _)| *angle *= factor);
                }
                _ => {}
            }
        }
        read
    }

    /// Pairs the measurements with the joints of `lag` moments later.
    fn lag(&mut self, lag: f64) {
        let (whole, part) = (lag.floor() as isize, lag - lag.floor());
        let at = |moment: isize| {
            let found = self.moments.binary_search_by_key(&moment, |(moment, _)| *moment);
            found.ok().map(|row| &self.moments[row].1)
        };
        let between = |moment: isize| -> Option<Vec<f64>> {
            let before = at(moment + whole)?;
            let after = if part > 0.0 { at(moment + whole + 1)? } else { before };
            Some(before.iter().zip(after).map(|(a, b)| a + part * (b - a)).collect())
        };
        let mut moments = Vec::new();
        let (mut rows, mut kept) = (Vec::new(), Vec::new());
        for (row, (moment, _)) in self.moments.iter().enumerate() {
            let Some(read) = between(*moment) else { continue };
            if let Ok(of) = self.rows.binary_search(&row) {
                rows.push(moments.len());
                kept.push(of);
            }
            moments.push((*moment, read));
        }
        (self.moments, self.rows) = (moments, rows);
        self.lines = kept.iter().map(|row| self.lines[*row].clone()).collect();
        self.sight = match &self.sight {
            Sight::Target(seen) => Sight::Target(seen.of(&kept)),
            Sight::Sockets(sockets) => Sight::Sockets(kept.iter().map(|row| sockets[*row]).collect()),
        };
    }

    fn judged(&self) -> Judged {
        let taken = self.taken();
        let fit = taken.sight.fit(&taken.motions(), true);
        let explained = taken.explained(&fit, None, Known::DESCRIBED);
        Judged { fit, explained }
    }

    /// How well the description explains the rows of a fit, its own errors included.
    fn explained(&self, fit: &Fit, from: Option<Placed>, known: Known<'_>) -> Option<Explained> {
        let (Sight::Target(whole), Some((placed, rows))) = (&self.sight, &fit.placed) else { return None };
        if self.joints().len() > MANY_JOINTS {
            return None;
        }
        let configurations: Vec<Vec<f64>> = rows.iter().map(|row| self.moments[self.rows[*row]].1.clone()).collect();
        let seen = whole.of(rows);
        let subject = Subject { sigma_m: self.subject.sigma_m * self.size, ..self.subject };
        let from = from.unwrap_or(*placed);
        // A row that went wrong stands out more clearly once the description's errors are found.
        let explained = |kept: &[usize]| {
            let rows = kept.iter().map(|row| configurations[*row].clone()).collect::<Vec<_>>();
            let found = explain(&subject, &rows, &seen.of(kept), from, known);
            let away = found.as_ref().map(|found| found.away(&subject, &configurations, &seen));
            (found, away.unwrap_or_else(|| vec![0.0; configurations.len()]))
        };
        let away = |(_, away): &(_, Vec<f64>), row: usize| away[row];
        let (found, away) = most::fitted(rows.len(), (WRONG.0, rows.len() / WRONG.1, LEFT_OUT), explained, away);
        // What is left is judged by all rows but a few.
        let mut nearest: Vec<usize> = (0..rows.len()).collect();
        nearest.sort_by(|a, b| away[*a].total_cmp(&away[*b]));
        nearest.truncate(rows.len() - rows.len() / fit::FEW);
        let near: Vec<Vec<f64>> = nearest.iter().map(|row| configurations[*row].clone()).collect();
        let found = found?.judged_by(&subject, &near, &seen.of(&nearest));
        // Readings of another unit are as likely as those that they stand for, per unit of their own.
        let counted = self.subject.counted(rows.len() * 3);
        // A target is spread as far as its robot reaches, to a factor of two or so.
        let (expected, spread) = self.spreads(whole);
        let far = ln(spread / expected) / ln(2_f64);
        let unlikely = if far.is_finite() { 0.5 * far * far } else { 0.0 };
        let log_evidence = found.log_evidence + counted * ln(self.size.abs()) - unlikely;
        Some(Explained { log_evidence, ..found })
    }

    /// Whether the description explains everything by itself.
    fn is_explained(&self, fit: &Fit) -> bool {
        fit.placed.is_some() && fit.judged <= 2.0 * self.subject.sigma_m * self.size
    }

    /// Whether the residuals of a table, given the description's errors, are no larger than calibration leaves.
    fn fits(&self, left: &Explained) -> bool {
        let Sight::Target(seen) = &self.sight else { return true };
        let most = (MISFIT.0 * self.spreads(seen).1).max(10.0 * self.subject.sigma_m * self.size);
        left.rms <= most && left.turned.is_none_or(|turned| turned <= MISFIT.1)
    }

    /// Where the target is explained to be in each row with a reading.
    fn places(&self, explained: &Explained, seen: &fit::Seen) -> Vec<Point3<f64>> {
        let configurations: Vec<Vec<f64>> = self.configurations().cloned().collect();
        explained.places(&self.subject, &configurations, seen)
    }

    /// Whether most places are near where they are explained to be: of some pictures a body's pose is another, and lenses bend.
    fn fits_most(&self, left: &Explained) -> bool {
        let Sight::Target(seen) = &self.sight else { return true };
        let places = self.places(left, seen);
        let off = places.iter().zip(&seen.poses).map(|(place, pose)| (place.coords - pose.translation.vector).norm());
        middle(off.collect()).is_none_or(|off| off <= MISFIT_OF_MOST * self.spreads(seen).1)
    }

    /// The hypothesis to report, if any, and how well it explains the table; `standing` is found anew where the hypothesis leads to a
    /// better place.
    fn best(&self, standing: &mut Judged) -> Option<(Hypothesis, Judged)> {
        let taken = self.taken();
        let mut tried = taken.of_target();
        tried.extend(taken.of_order());
        tried.extend(taken.of_joints());
        tried.extend(self.of_lags());
        let left = |(hypothesis, fit): &(Hypothesis, Fit)| fit.judged / hypothesis.size();
        tried.retain(|it| left(it).is_finite());
        tried.sort_by(|a, b| left(a).total_cmp(&left(b)));
        let Some(before) = standing.explained.clone() else {
            let first = tried.into_iter().next().filter(|it| left(it) < CONVINCING * standing.fit.judged);
            return first.map(|(hypothesis, fit)| (hypothesis, Judged { fit, explained: None }));
        };
        // Another unit may be right and leave much, as long as something else is wrong too.
        let is_unit = |it: &(Hypothesis, Fit)| matches!(it.0, Hypothesis::Target(_) | Hypothesis::Inverted);
        tried.retain(|it| is_unit(it) || left(it) < 0.95 * standing.fit.judged);
        tried.sort_by_key(|it| !is_unit(it));
        let asked = tried.into_iter().take(ASKED).filter_map(|(hypothesis, _)| {
            let read = self.applied(hypothesis).taken();
            let fit = read.sight.fit(&read.motions(), true);
            let explained = read.explained(&fit, None, Known::DESCRIBED).filter(|it| {
                hypothesis.may_leave_much()
                    || read.fits(it)
                    || left(&(hypothesis, fit.clone())) < CONVINCING * standing.fit.judged
            })?;
            Some((
                hypothesis,
                explained.log_evidence + hypothesis.log_prior(self.joints().len()),
                Judged { fit, explained: Some(explained) },
            ))
        });
        let (hypothesis, evidence, found) = asked.max_by(|a, b| a.1.total_cmp(&b.1))?;
        if evidence - before.log_evidence < TOLD {
            return None;
        }
        // The description as it is read may explain everything where it was not looked for.
        let there = found
            .fit
            .placed
            .as_ref()
            .and_then(|(placed, _)| taken.explained(&standing.fit, Some(*placed), Known::DESCRIBED));
        if let Some(there) = there.filter(|there| there.log_evidence > before.log_evidence) {
            let odds = evidence - there.log_evidence;
            standing.explained = Some(there);
            if odds < TOLD {
                return None;
            }
        }
        Some((hypothesis, found))
    }

    /// The zeros of several joints that are off at once, as after another assembly or homing, if that explains more than anything
    /// else, whose evidence is `other`.
    fn of_zeros(&self, standing: &Judged, other: Option<f64>) -> Option<(Vec<(usize, f64)>, Judged)> {
        let before = standing.explained.as_ref().filter(|left| !self.fits(left))?;
        let taken = self.taken();
        let free = taken.explained(&standing.fit, None, Known::ZEROS_ANYWHERE)?;
        let off: Vec<(usize, f64)> = free.zeros.iter().copied().enumerate().filter(|(_, by)| by.abs() > OFF).collect();
        let read =
            off.iter().fold(self.clone(), |read, (joint, by)| read.applied(Hypothesis::Shifted(*joint, *by))).taken();
        let fit = read.sight.fit(&read.motions(), true);
        let explained = read.explained(&fit, None, Known::DESCRIBED).filter(|left| read.fits(left))?;
        let doubtful = off.len() as f64 * (2.0 + ln(self.joints().len() as f64));
        let evidence = explained.log_evidence - doubtful;
        let is_told =
            off.len() > 1 && evidence > before.log_evidence + TOLD && other.is_none_or(|other| evidence > other);
        is_told.then_some((off, Judged { fit, explained: Some(explained) }))
    }

    fn whole(&self, hypothesis: Hypothesis) -> (Hypothesis, Fit) {
        let read = self.applied(hypothesis);
        (hypothesis, read.sight.fit(&read.motions(), false))
    }

    fn of_target(&self) -> Vec<(Hypothesis, Fit)> {
        let mut tried = vec![self.whole(Hypothesis::Angles(PI / 180.0)), self.whole(Hypothesis::Angles(180.0 / PI))];
        let Sight::Target(seen) = &self.sight else { return tried };
        let (expected, spread) = self.spreads(seen);
        let units = LENGTHS.map(|(factor, _)| Hypothesis::Target(factor)).into_iter().filter(|_| !self.is_pictured());
        for hypothesis in units.chain([Hypothesis::Mirrored]) {
            // Points that shrink come nearer to anything: they must be spread as the robot's are.
            let is_likely = (0.2..5.0).contains(&(hypothesis.size() * spread / expected));
            tried.extend(is_likely.then(|| self.whole(hypothesis)));
        }
        if (0.3..3.0).contains(&(spread / expected)) {
            let (size, fit) = self.sized();
            tried.extend(((size - 1.0).abs() > ANOTHER_SIZE).then_some((Hypothesis::Size(size), fit)));
        }
        if seen.arm.is_some() && !self.is_pictured() {
            let of_poses = [
                Hypothesis::Inverted,
                Hypothesis::Transposed,
                Hypothesis::RealFirst,
                Hypothesis::RealLast,
                Hypothesis::RollPitchYaw,
                Hypothesis::RotationVector,
            ];
            tried.extend(of_poses.map(|hypothesis| self.whole(hypothesis)));
        }
        tried
    }

    /// Whether the described robot is larger than any robot.
    fn is_too_large(&self) -> bool {
        matches!(&self.sight, Sight::Target(seen) if self.spreads(seen).0 > LARGE)
    }

    /// The predicted and the measured spread of the target, metres.
    fn spreads(&self, seen: &fit::Seen) -> (f64, f64) {
        let at: Vec<Point3<f64>> = self.motions().iter().map(|motion| motion * seen.guess).collect();
        let points: Vec<Point3<f64>> = seen.poses.iter().map(|pose| pose.translation.vector.into()).collect();
        (spread(&at), spread(&points))
    }

    /// The diagnostic about a target that is measured at one place wherever the joints are.
    fn still(&self) -> Option<Diagnostic> {
        let Sight::Target(seen) = &self.sight else { return None };
        let (predicted, measured) = self.spreads(seen);
        (measured < STILL * predicted).then(|| Diagnostic {
            kind: DiagnosticKind::Still,
            column: Some(self.target.clone()),
            lines: Vec::new(),
            what: "its place never changes, though joints move".to_owned(),
            evidence: format!(
                "within {} of one place in {} rows, among which the description moves it by {} on the mean",
                length(measured),
                self.rows.len(),
                length(predicted)
            ),
            hint: "see whether what measures sends new places, and whether it measures what the joints move".to_owned(),
        })
    }

    /// The factor of the coordinates that fits best.
    fn sized(&self) -> (f64, Fit) {
        let left = |log: f64| {
            let fit = self.whole(Hypothesis::Size(exp(log))).1;
            (fit.judged / exp(log), fit)
        };
        let grid = (-10..=10).map(|k| f64::from(k) * 0.05);
        let mut best =
            grid.map(|log| (log, left(log))).min_by(|a, b| a.1.0.total_cmp(&b.1.0)).unwrap_or((0.0, left(0.0)));
        let mut step = 0.025;
        while step > 5e-4 {
            for log in [best.0 - step, best.0 + step] {
                let there = left(log);
                if there.0 < best.1.0 {
                    best = (log, there);
                }
            }
            step /= 2.0;
        }
        (exp(best.0), best.1.1)
    }

    fn of_lags(&self) -> Vec<(Hypothesis, Fit)> {
        if self.rows.len() < 10 {
            return Vec::new();
        }
        let of = |rows: f64| {
            let read = self.applied(Hypothesis::Lag(rows)).taken();
            (Hypothesis::Lag(rows), read.sight.fit(&read.motions(), false))
        };
        let mut tried = [-2.0, -1.0, 1.0, 2.0].map(of).to_vec();
        // A robot that was followed while it moved may lag by less than a row.
        let parts = [-1.5, -0.5, -0.2, 0.2, 0.5, 1.5].map(of);
        if let Some((Hypothesis::Lag(mut by), mut best)) =
            parts.into_iter().min_by(|a, b| a.1.judged.total_cmp(&b.1.judged))
        {
            let mut step = 0.16;
            while step > 0.005 {
                for (hypothesis, there) in [of(by - step), of(by + step)] {
                    if let (true, Hypothesis::Lag(rows)) = (there.judged < best.judged, hypothesis) {
                        (by, best) = (rows, there);
                    }
                }
                step /= 2.0;
            }
            tried.extend((by.abs() > LAGGING).then_some((Hypothesis::Lag(by), best)));
        }
        tried
    }

    fn of_order(&self) -> Vec<(Hypothesis, Fit)> {
        let joints = self.joints().len();
        let reach = if joints > SWAPS { 1 } else { joints };
        let pairs = (0..joints).flat_map(|one| (one + 1..joints.min(one + 1 + reach)).map(move |other| (one, other)));
        if joints > MANY_JOINTS {
            return Vec::new();
        }
        pairs
            .filter(|(one, other)| self.joints()[*one].kind() == self.joints()[*other].kind() || joints <= SWAPS)
            .map(|(one, other)| self.whole(Hypothesis::Swapped(one, other)))
            .collect()
    }

    /// Tries each joint by itself; what stands before and behind it is computed once, so that a joint costs the same
    /// however many there are.
    fn of_joints(&self) -> Vec<(Hypothesis, Fit)> {
        let mut tried = Vec::new();
        let mut before: Vec<Isometry3<f64>> = vec![Isometry3::identity(); self.rows.len()];
        let mut behind = self.motions();
        for (index, joint) in self.joints().iter().enumerate() {
            for (row, behind) in self.configurations().zip(&mut behind) {
                *behind = joint.exp(-row[index]) * *behind;
            }
            let read = |of: &dyn Fn(f64) -> f64| {
                let rows = self.configurations().zip(before.iter().zip(&behind));
                let motions = rows.map(|(row, (before, behind))| before * joint.exp(of(row[index])) * behind);
                self.sight.fit(&motions.collect::<Vec<_>>(), false)
            };
            let units = match joint.kind() {
                JointKind::Revolute => vec![PI / 180.0, 180.0 / PI],
                JointKind::Prismatic => LENGTHS.map(|(factor, _)| factor).to_vec(),
            };
            let factors = [-1.0].into_iter().chain(units);
            tried.extend(factors.map(|factor| (Hypothesis::Scaled(index, factor), read(&|q| factor * q))));
            if joint.kind() == JointKind::Revolute {
                let (by, left) = shift(&|by| read(&|q| q + by), self.joints().len() <= MANY_JOINTS);
                tried.extend((by.abs() > OFF).then_some((Hypothesis::Shifted(index, by), left)));
            }
            for (row, before) in self.configurations().zip(&mut before) {
                *before *= joint.exp(row[index]);
            }
        }
        tried
    }

    /// The diagnostic that the base is where the file says.
    fn elsewhere(&self, standing: &Judged) -> Option<Diagnostic> {
        let base = self.subject.base?;
        let (placed, _) = standing.fit.placed.as_ref()?;
        let free = standing.explained.as_ref()?;
        let said = Known { base: Some(&base), ..Known::DESCRIBED };
        let known = self.taken().explained(&standing.fit, None, said)?;
        let odds = free.log_evidence - known.log_evidence;
        let is_better = free.rms.max(self.subject.sigma_m) < CONVINCING * known.rms;
        if odds < TOLD || !is_better {
            return None;
        }
        let shift = (placed.base.translation.vector - base.at.translation.vector).norm();
        let turn = placed.base.rotation.angle_to(&base.at.rotation).to_degrees();
        Some(Diagnostic {
            kind: DiagnosticKind::Base,
            column: None,
            lines: Vec::new(),
            what: format!("the base stands elsewhere than [base] says, by {} and {turn:.0} deg", length(shift)),
            evidence: format!(
                "free, the description fits to {} instead of {} rms",
                length(standing.fit.rms),
                length(known.rms)
            ),
            hint: "correct [base], or leave it out: then it is found from the rows".to_owned(),
        })
    }

    /// The diagnostic that the robot stood still at every row.
    fn moving(&self, standing: &Judged) -> Option<Diagnostic> {
        let (Sight::Target(seen), Some(explained)) = (&self.sight, &standing.explained) else { return None };
        let places = self.places(explained, seen);
        let seen: Vec<Point3<f64>> = seen.poses.iter().map(|pose| pose.translation.vector.into()).collect();
        moving::diagnostic(&self.lines, &places, &seen, self.subject.sigma_m * self.size)
    }

    /// The diagnostic that anything explains the table.
    fn misfit(&self, standing: &Judged) -> Option<Diagnostic> {
        let left = standing.explained.as_ref()?;
        if self.fits(left) || (self.is_pictured() && self.fits_most(left)) {
            return None;
        }
        let turned = left.turned.map(|turned| format!(" and {:.1} deg", turned.to_degrees())).unwrap_or_default();
        Some(Diagnostic {
            kind: DiagnosticKind::Misfit,
            column: None,
            lines: Vec::new(),
            what: "the description does not fit these rows".to_owned(),
            evidence: format!(
                "{}{turned} rms are left of `{}` where base, target and all axes are fitted, and no other unit, sign, zero, order or frame \
                 of a column explains them",
                length(left.rms),
                self.target
            ),
            hint: "is this the robot, and is its target on the link that is named? No calibration of it can be trusted"
                .to_owned(),
        })
    }
}

/// The shift within half a turn with the least residual: on a grid of 30 deg, then between its neighbours if `fine`.
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

/// The distance of most points from where most are.
fn spread(points: &[Point3<f64>]) -> f64 {
    let middle = |values: Vec<f64>| middle(values).unwrap_or(f64::NAN);
    let centre = Point3::from(Vector3::from_fn(|k, _| middle(points.iter().map(|point| point[k]).collect())));
    middle(points.iter().map(|point| (point - centre).norm()).collect())
}
