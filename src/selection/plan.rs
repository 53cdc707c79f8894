//! Several movements planned together.
//!
//! One movement gives three numbers, a chain has many more parameters. Until there are enough movements to determine
//! it, what the next one is worth depends on those that follow, and the greedy choice wastes much: the best eight
//! movements of an arm of six joints leave half the trace of eight greedy ones. So the movements that are still needed
//! are planned together. With the poses θ₁ … θₕ of the plan,
//!
//! ```text
//! minimise tr(W P(θ₁ … θₕ)),    P⁻¹ = P₀⁻¹ + Σᵢ pᵢ HᵢᵀHᵢ / r
//! ```
//!
//! in the mean over the hypotheses, as [`Outlook`](super::Outlook) does for one movement, by exchange (Fedorov 1972): each pose in turn
//! is taken out of the plan (a downdate of rank three) and replaced by a better one, if there is one. The plan is made
//! for what is believed now, and made anew after every movement, from where it stood.

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen};

use super::{SelectionError, Weights};
use crate::{
    estimation::{Alternative, Belief},
    kinematics::jacobian::jacobian,
    sensing::isotropic,
};

/// Movements that are planned and not yet made, with what the belief would be after all of them.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The belief once the plan is carried out.
    pub after: Belief,
    /// The poses (rad or m), and by hypothesis how much of each is expected to be seen.
    pub poses: Vec<Vec<f64>>,
    /// By pair of hypotheses (as [`Outlook`](super::Outlook) orders them): by how much each pose tells them apart, B.
    told: Vec<Vec<f64>>,
    chances: Vec<Vec<f64>>,
}

impl Plan {
    /// No movement planned yet, under the heaviest hypotheses of `belief`.
    pub fn new(belief: &Belief, considered: usize) -> Self {
        let mut after = belief.clone();
        after.alternatives.truncate(considered.saturating_sub(1));
        Self { after, poses: Vec::new(), told: Vec::new(), chances: Vec::new() }
    }

    /// How many movements are still needed: a third of the number of directions in parameter space, weighted as the
    /// criterion does, whose standard deviation exceeds `unknown`.
    pub fn unknown(&self, weights: &Weights, unknown: f64) -> Result<usize, SelectionError> {
        let covariance = self.after.covariance.as_ref().ok_or(SelectionError::NoCovariance)?;
        let root = DVector::from_fn(covariance.nrows(), |k, _| weights.of(k).sqrt());
        let weighted = covariance.component_mul(&(&root * root.transpose()));
        let eigenvalues = SymmetricEigen::new(weighted).eigenvalues;
        Ok(eigenvalues.iter().filter(|value| **value > unknown * unknown).count().div_ceil(3))
    }

    /// Adds a pose that each hypothesis expects to be seen with these chances, and that tells pairs apart by `told`.
    pub fn add(&mut self, pose: Vec<f64>, chances: Vec<f64>, told: Vec<f64>) {
        self.each(&pose, &chances, 1.0);
        self.poses.push(pose);
        self.chances.push(chances);
        self.told.push(told);
    }

    /// Takes a pose out of the plan.
    pub fn remove(&mut self, index: usize) -> Vec<f64> {
        let (pose, chances) = (self.poses.remove(index), self.chances.remove(index));
        self.told.remove(index);
        self.each(&pose, &chances, -1.0);
        pose
    }

    /// Σ B over the poses of the plan, by pair.
    pub fn told(&self) -> Vec<f64> {
        let pairs = self.told.first().map_or(0, Vec::len);
        (0..pairs).map(|pair| self.told.iter().map(|told| told[pair]).sum()).collect()
    }

    /// The rank-three update (sign 1) or downdate (sign −1) of every hypothesis' covariance by a pose.
    fn each(&mut self, pose: &[f64], chances: &[f64], sign: f64) {
        let (layout, noise) = (self.after.layout.clone(), self.after.noise_m2);
        if let Some(covariance) = &mut self.after.covariance {
            let (_, h) = jacobian(&self.after.chain, &layout, pose);
            update(covariance, &h, noise, sign * chances.first().copied().unwrap_or(1.0));
        }
        for (index, Alternative { chain, covariance, .. }) in self.after.alternatives.iter_mut().enumerate() {
            let (_, h) = jacobian(chain, &layout, pose);
            update(covariance, &h, noise, sign * chances.get(index + 1).copied().unwrap_or(1.0));
        }
    }
}

/// P ← (P⁻¹ + c HᵀH/r)⁻¹ = P − P Hᵀ (r/c I + H P Hᵀ)⁻¹ H P, for c < 0 a downdate; as it was, where c is nothing or a
/// downdate would leave no covariance.
fn update(covariance: &mut DMatrix<f64>, h: &nalgebra::Matrix3xX<f64>, noise_m2: f64, c: f64) {
    if c.abs() < 1e-9 {
        return;
    }
    let numerator = &*covariance * h.transpose();
    let spread = (h * &numerator).fixed_view::<3, 3>(0, 0).into_owned();
    let spread = (spread + spread.transpose()) * 0.5;
    let middle: Matrix3<f64> = (isotropic(noise_m2 / c) + spread) * c.signum();
    let Some(inverse) = middle.cholesky().map(|s| s.inverse() * c.signum()) else { return };
    let change = &numerator * inverse * numerator.transpose();
    *covariance -= (&change + change.transpose()) * 0.5;
}
