//! The directions that the rows cannot determine, in words.
//!
//! With Λ the information of the rows alone, scaled to a unit diagonal, directions whose eigenvalue is less than 10⁻¹² of the
//! greatest are determined by no row: there the estimate stays as described. Also named are parameters whose deviation has
//! hardly fallen from the prior's.

use nalgebra::{DMatrix, DVector, Isometry3, Vector3};

use super::{Case, Fit, Parameters};
use body_schema_engine::{
    kinematics::Joint,
    model::{Block, Layout, Place, State, listed, null_space},
};
use body_schema_scenario::WorldSpec;

/// The share of a parameter that undetermined directions must hold for it to be named.
const NAMED: f64 = 0.05;
/// The share of the prior's deviation above which a deviation has hardly fallen.
const HARDLY: f64 = 0.9;

impl Case<'_> {
    /// The determined and undetermined parameters of a fit.
    pub(super) fn determined(&self, fit: &Fit) -> Parameters {
        let layout = &*fit.belief.layout;
        let free = self.undetermined(fit);
        let (meanings, left) = self.meanings(fit.state(), layout, &free);
        let mut undetermined: Vec<String> = self.unread().into_iter().chain(meanings).collect();
        undetermined.extend(self.names.untold(layout, &left, "these rows"));
        undetermined.extend(self.hardly(fit, &free));
        Parameters { learned: layout.dimension(), rank: layout.dimension() - free.ncols(), undetermined }
    }

    /// The fit with the covariance of the written files: a direction that no row determines is as the file has it, and has no
    /// deviation.
    pub(super) fn in_gauge(&self, fit: &Fit) -> Fit {
        let free = self.undetermined(fit);
        let mut shown = fit.clone();
        let fixed = || {
            let covariance = fit.belief.covariance.as_ref().filter(|_| free.ncols() > 0)?;
            let weighed = free.tr_mul(&covariance.clone().cholesky()?.solve(&free));
            Some(covariance - &free * weighed.cholesky()?.inverse() * free.transpose())
        };
        if let Some(covariance) = fixed() {
            shown.belief.covariance = Some(covariance);
        }
        shown
    }

    /// The meaning of the directions `free` (m × k, orthonormal), in words, and those of unknown meaning.
    fn meanings(&self, state: &State, layout: &Layout, free: &DMatrix<f64>) -> (Vec<String>, DMatrix<f64>) {
        let (mut said, mut left) = (Vec::new(), free.clone());
        let mut take = |moved: Vec<State>| {
            let before = left.ncols();
            for other in moved {
                let Some(direction) = state.local(layout, &other).and_then(|it| it.try_normalize(0.0)) else {
                    continue;
                };
                if (&direction - free * free.tr_mul(&direction)).norm() > ALIKE {
                    continue;
                }
                let beside = &left * left.tr_mul(&direction);
                if beside.norm() > ALIKE {
                    left = without(&left, &beside);
                }
            }
            before - left.ncols()
        };
        let joints = &self.names.joints;
        let base = if layout.block(Block::Base).is_some() { moved_with_base(state) } else { Vec::new() };
        let on_base = joints.iter().enumerate().filter(|(joint, _)| state.tree.parent(*joint).is_none());
        let on_base: Vec<String> = on_base.map(|(_, name)| name.clone()).collect();
        match (take(base), on_base.as_slice()) {
            (0, _) | (_, []) => {}
            (count, [first]) => said.push(format!(
                "where the base stands cannot be separated from where {first} and all that it carries are on it: {} no reading",
                together(count)
            )),
            (count, _) => said.push(format!(
                "where the base stands cannot be separated from where {}, and all that they carry, are on it: {} no reading",
                listed(on_base),
                together(count)
            )),
        }
        let is_alone = layout.block(Block::Base).is_none() && state.sockets.is_empty();
        match take(if is_alone { moved_as_one(state) } else { Vec::new() }) {
            0 => {}
            count => said.push(format!(
                "nothing is measured from outside, so that all is known up to one rigid motion: {} in which all joints, targets and \
                 cameras move together change no reading",
                match count {
                    1 => "a direction".to_owned(),
                    _ => format!("{count} directions"),
                }
            )),
        }
        let mut turned = |joint: usize| take(vec![moved_behind(state, joint)]) > 0;
        let zeros: Vec<usize> = (0..joints.len()).filter(|j| layout.block(Block::Offset(*j)).is_some()).collect();
        let zeros: Vec<String> = zeros.into_iter().filter(|joint| turned(*joint)).map(|j| joints[j].clone()).collect();
        match zeros.len() {
            0 => {}
            1 => said.push(format!(
                "the zero of {} cannot be separated from where the axes and targets behind it are",
                listed(zeros)
            )),
            _ => said.push(format!(
                "the zeros of {} cannot be separated from where the axes and targets behind each are",
                listed(zeros)
            )),
        }
        if take(vec![larger(state)]) > 0 {
            said.push(
                "how large the robot is cannot be told: with all lengths longer by the same share every reading stays"
                    .to_owned(),
            );
        }
        (said, left)
    }

    /// A sentence on the joints that the table has no column of.
    fn unread(&self) -> Option<String> {
        let WorldSpec::Measured { measurements, .. } = &self.scenario.world else { return None };
        let unread = measurements.unread.clone();
        let held = match unread.len() {
            0 => return None,
            1 => "it is held at 0 and stays",
            _ => "they are held at 0 and stay",
        };
        Some(format!(
            "the table has no column of {}, with which nothing moves that is measured: {held} as described",
            listed(unread)
        ))
    }

    /// An orthonormal basis of the directions that no row determines (m × k).
    fn undetermined(&self, fit: &Fit) -> DMatrix<f64> {
        let belief = &fit.belief;
        let mut information = self.information(fit);
        if let Some(known) = self.known {
            let nowhere = vec![0.0; belief.state.joints.len()];
            let rows = belief.rig.equations_of(&belief.state, &belief.layout, &nowhere, known).rows;
            information += &rows * rows.transpose();
        }
        null_space(&information)
    }

    /// The information of a fit's rows about its parameters, without the prior (m × m).
    pub(super) fn information(&self, fit: &Fit) -> DMatrix<f64> {
        let belief = &fit.belief;
        let m = belief.layout.dimension();
        let mut information = DMatrix::zeros(m, m);
        for row in fit.rows.iter().map(|row| &self.rows[*row]) {
            let rows = belief.rig.equations_of(&belief.state, &belief.layout, &row.positions, &row.observation).rows;
            information += &rows * rows.transpose();
        }
        information
    }

    /// A sentence on the blocks whose every coordinate is known hardly better than before.
    fn hardly(&self, fit: &Fit, free: &DMatrix<f64>) -> Option<String> {
        let layout = &*fit.belief.layout;
        let covariance = fit.belief.covariance.as_ref()?;
        // As the rows have them: what shrinks with the scale of the prior alone is not told by rows.
        let prior = match (self.chain(layout), &fit.scales) {
            (Some(chain), Some(scales)) => chain.covariance(scales).diagonal().map(|x| x.max(0.0).sqrt()),
            _ => self.deviations(layout),
        };
        let share = |coordinate: usize| covariance[(coordinate, coordinate)].sqrt() / prior[coordinate];
        let is_told = |coordinate: usize| free.ncols() > 0 && free.row(coordinate).norm_squared() > NAMED;
        let hardly = |(block, range): (Block, std::ops::Range<usize>)| {
            let untold = range.clone().all(|coordinate| share(coordinate) > HARDLY) && !range.clone().all(is_told);
            untold.then(|| self.names.block(block))
        };
        let names: Vec<String> = layout.blocks().filter_map(hardly).collect();
        (!names.is_empty()).then(|| {
            format!(
                "these rows say next to nothing of {}: what is known has hardly grown beyond the prior; add rows in which the \
                 joints behind it move farther",
                listed(names)
            )
        })
    }
}

/// The share of a direction outside the basis below which the direction counts as part of it.
const ALIKE: f64 = 1e-4;
/// The step by which states are moved to find directions: rad, or a share of lengths.
const STEP: f64 = 1e-6;

fn together(count: usize) -> String {
    match count {
        1 => "1 direction in which both move together changes".to_owned(),
        _ => format!("{count} directions in which both move together change"),
    }
}

/// An orthonormal basis of the part of the space of `basis` orthogonal to `direction`.
fn without(basis: &DMatrix<f64>, direction: &DVector<f64>) -> DMatrix<f64> {
    let k = basis.ncols();
    let Some(along) = basis.tr_mul(direction).try_normalize(0.0) else { return basis.clone() };
    // The reflection that brings the last unit vector to `along`: its other columns are across it.
    let mut towards = along.clone();
    towards[k - 1] -= if along[k - 1] > 0.0 { -1.0 } else { 1.0 };
    let square = towards.norm_squared();
    let reflection = DMatrix::identity(k, k) - &towards * towards.transpose() * (2.0 / square);
    basis * reflection.columns(0, k - 1)
}

/// Small shifts along x, y and z, and small turns about them.
fn motions() -> impl Iterator<Item = Isometry3<f64>> {
    (0..6).map(|k| {
        let unit = Vector3::from_fn(|axis, _| if axis == k % 3 { STEP } else { 0.0 });
        if k < 3 { Isometry3::translation(unit.x, unit.y, unit.z) } else { Isometry3::rotation(unit) }
    })
}

/// The states with the robot and what stands beside it moved as one, in its own frame.
fn moved_as_one(state: &State) -> Vec<State> {
    let moved = |motion: Isometry3<f64>| {
        let mut moved = state.carried(&motion, |_| true);
        let outside = state.base * motion * state.base.inverse();
        moved
            .devices
            .iter_mut()
            .filter(|device| device.link.is_none())
            .for_each(|device| device.pose = outside * device.pose);
        moved
    };
    motions().map(moved).collect()
}

/// The states with the base moved one way, and all that it carries the other.
fn moved_with_base(state: &State) -> Vec<State> {
    let moved = |motion: Isometry3<f64>| {
        let mut moved = state.carried(&motion.inverse(), |_| true);
        moved.base *= motion;
        moved
    };
    motions().map(moved).collect()
}

/// The state with a joint's zero shifted, and all that is behind it moved the other way.
fn moved_behind(state: &State, joint: usize) -> State {
    let mut moved = state.carried(&state.joints[joint].exp(-STEP), |link| state.tree.moves(joint, link));
    moved.corrections[joint].offset += STEP;
    moved
}

/// The state with all lengths longer by a share.
fn larger(state: &State) -> State {
    let longer = |pose: &mut Isometry3<f64>| pose.translation.vector *= 1.0 + STEP;
    let mut moved = state.clone();
    longer(&mut moved.base);
    for (joint, correction) in moved.joints.iter_mut().zip(&mut moved.corrections) {
        match joint {
            Joint::Revolute(line) => line.point *= 1.0 + STEP,
            Joint::Prismatic(_) => correction.ratio *= 1.0 + STEP,
        }
    }
    for target in &mut moved.targets {
        match &mut target.place {
            Place::Point(point) => *point *= 1.0 + STEP,
            Place::Pose(pose) => longer(pose),
        }
    }
    moved.devices.iter_mut().for_each(|device| longer(&mut device.pose));
    moved.sockets.iter_mut().for_each(|socket| *socket *= 1.0 + STEP);
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use body_schema_scenario::{Scenario, builtin};

    /// What is undetermined of a real robot whose scenario is changed so, and its fit's covariance as it was and in the file's gauge.
    fn untold(name: &str, change: impl Fn(String) -> String) -> (Parameters, DMatrix<f64>, [DMatrix<f64>; 2]) {
        let nominal = builtin(name).expect("built in");
        let text = change(nominal.source.clone());
        let scenario = Scenario::parse("my.toml", &text, &|file| nominal.data_file(file)).expect("valid");
        let case = Case::new(&scenario).expect("measured");
        let rows: Vec<usize> = (0..case.rows.len()).collect();
        let nominal = case.nominal(&rows).expect("fitted");
        let fit = case.fit(&case.writable(), &rows, Some(nominal.state())).expect("fitted");
        let covariance = |fit: &Fit| fit.belief.covariance.clone().expect("kept");
        let free = case.undetermined(&fit);
        (case.determined(&fit), free, [covariance(&fit), covariance(&case.in_gauge(&fit))])
    }

    #[test]
    fn directions_are_told_by_their_meaning() {
        for (name, first) in [("ur10-camera", "shoulder_pan_joint"), ("tiago-mocap-3", "torso_lift_joint")] {
            let (Parameters { learned, rank, undetermined }, ..) = untold(name, |text| text);
            assert_eq!(learned - rank, 6, "{name}");
            let said = format!("where the base stands cannot be separated from where {first} and all that it carries");
            assert!(undetermined.len() == 1 && undetermined[0].starts_with(&said), "{undetermined:?}");
            assert!(undetermined[0].contains("6 directions in which both move together"), "{undetermined:?}");
        }
        let learned = "[robot]\noffsets = [\"elbow_joint\", \"wrist_1_joint\"]";
        let offsets = |text: String| text.replacen("[robot]", learned, 1);
        let (Parameters { undetermined, .. }, ..) = untold("ur10-camera", offsets);
        assert!(
            undetermined.iter().any(|said| said.starts_with("the zeros of elbow_joint and wrist_1_joint")),
            "{undetermined:?}"
        );
    }

    /// In the file's gauge nothing is known of what is fixed, and what rows tell is known as well as before.
    #[test]
    fn what_is_fixed_has_no_deviation() {
        let (_, free, [before, after]) = untold("ur10-camera", |text| text);
        let inverse = before.clone().cholesky().expect("positive").inverse();
        let across = free.tr_mul(&inverse);
        assert!((&across * &after).amax() < 1e-6 * (&across * &before).amax());
        for seed in 0..20 {
            // A combination that rows tell: across all that they do not.
            let some = DVector::from_fn(before.nrows(), |row, _| ((row * 7 + seed * 13) as f64).sin());
            let told = &some - &free * free.tr_mul(&some);
            let [one, other] = [&before, &after].map(|covariance| told.dot(&(covariance * &told)));
            assert!((one - other).abs() < 1e-6 * one, "{one} {other}");
        }
        assert!((0..before.nrows()).all(|k| after[(k, k)] <= before[(k, k)] * (1.0 + 1e-9)));
    }
}
