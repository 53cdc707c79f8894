//! What the directions that nothing determines mean, in words.

use nalgebra::{DMatrix, DVector};

use super::{Block, Layout, Names, State, Symmetry, listed};

impl Names {
    /// Sentences on the directions in the columns of `free` (m × k, orthonormal) at a state, which `by` does not determine: what they mean
    /// where that is known, and of the others which parameters they move.
    pub fn undetermined(&self, state: &State, layout: &Layout, free: &DMatrix<f64>, by: &str) -> Vec<String> {
        let (mut said, left) = self.meanings(state, layout, free);
        said.extend(self.untold(layout, &left, by));
        said
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
        let joints = &self.joints;
        let is_placed = layout.block(Block::Base).is_some();
        let base = if is_placed { stepped(Symmetry::WithBase, state) } else { Vec::new() };
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
        let is_alone = !is_placed && state.sockets.is_empty();
        match take(if is_alone { stepped(Symmetry::AsOne, state) } else { Vec::new() }) {
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
        let mut turned = |joint: usize| take(stepped(Symmetry::Zero(joint), state)) > 0;
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
        if take(stepped(Symmetry::Size, state)) > 0 {
            said.push(
                "how large the robot is cannot be told: with all lengths longer by the same share every reading stays"
                    .to_owned(),
            );
        }
        (said, left)
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

/// The states that small steps along the coordinates of a symmetry lead to.
fn stepped(symmetry: Symmetry, state: &State) -> Vec<State> {
    let to = |k: usize| {
        let mut a = vec![0.0; symmetry.dimension()];
        a[k] = STEP;
        symmetry.applied(state, &a)
    };
    (0..symmetry.dimension()).map(to).collect()
}
