//! Several movements planned together.
//!
//! One movement gives a few equations, a robot has many more parameters. Until there are enough movements to determine
//! it, what the next one is worth depends on those that follow, and the greedy choice wastes much: the best eight
//! movements of an arm of six joints leave half the trace of eight greedy ones. So the movements that are still needed
//! are planned together. With the poses θ₁ … θₕ of the plan,
//!
//! ```text
//! minimise tr(W P(θ₁ … θₕ)),    P⁻¹ = P₀⁻¹ + Σᵢ pᵢ HᵢᵀHᵢ
//! ```
//!
//! in the mean over the hypotheses, as [`MixtureCriterion`](super::MixtureCriterion) does for one movement, by exchange (Fedorov 1972): each pose in turn
//! is taken out of the plan (a downdate of low rank) and replaced by a better one, if there is one. The plan is made
//! for what is believed now, and made anew after every movement, from where it stood.

use std::sync::Arc;

use fearless_simd::Level;
use nalgebra::{Cholesky, DMatrix};

use super::{SelectionError, Weights, mixture_criterion::Expected};
use crate::{
    estimation::{Alternative, Belief},
    model::{eigen, rank},
    simd::{add_few_squares, times_few},
};

/// Movements that are planned and not yet made, with what the belief would be after all of them.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The belief before it.
    now: Arc<Belief>,
    /// The belief once the plan is carried out.
    pub after: Belief,
    /// The poses (rad or m), and by hypothesis how much of each is expected to be seen.
    pub poses: Vec<Vec<f64>>,
    /// By pair of hypotheses (as [`MixtureCriterion`](super::MixtureCriterion) orders them): by how much each pose tells them apart, B.
    told: Vec<Vec<f64>>,
    chances: Vec<Vec<f64>>,
    /// By pose and hypothesis: Hᵀ, whitened.
    rows: Vec<Arc<[DMatrix<f64>]>>,
    /// By pose and hypothesis: what must be left of a downdate.
    sound: Vec<Arc<[f64]>>,
}

impl Plan {
    /// No movement planned yet, under the heaviest hypotheses of `belief`.
    pub fn new(belief: &Belief, considered: usize) -> Self {
        let mut after = belief.clone();
        after.truncate(considered);
        Self {
            now: Arc::new(after.clone()),
            after,
            poses: Vec::new(),
            told: Vec::new(),
            chances: Vec::new(),
            rows: Vec::new(),
            sound: Vec::new(),
        }
    }

    /// How many independent equations a movement brings, by the rank of the Jacobian of what is believed to read at `posture` (rad or
    /// m); at least one.
    pub fn equations(&self, posture: &[f64]) -> usize {
        let Belief { state, layout, measurement_model, .. } = &self.after;
        rank(&measurement_model.believed_jacobian(state, layout, posture).transpose()).max(1)
    }

    /// How many directions in parameter space, weighted as the criterion does, have a standard deviation above `unknown`.
    ///
    /// # Errors
    ///
    /// [`SelectionError::NoCovariance`] without a covariance; [`SelectionError::NoFiniteCriterion`] if the weighted
    /// covariance is not finite.
    pub fn unknown(&self, weights: &Weights, unknown: f64) -> Result<usize, SelectionError> {
        let covariance = self.after.covariance.as_ref().ok_or(SelectionError::NoCovariance)?;
        let root = weights.roots();
        let weighted = covariance.component_mul(&(&root * root.transpose()));
        if !weighted.iter().all(|x| x.is_finite()) {
            return Err(SelectionError::NoFiniteCriterion);
        }
        let eigen = eigen(weighted).ok_or(SelectionError::NoFiniteCriterion)?;
        Ok(eigen.eigenvalues.iter().filter(|value| **value > unknown * unknown).count())
    }

    /// Adds a pose of which this is expected.
    pub fn add(&mut self, pose: Vec<f64>, expected: Expected) {
        let Expected { chances, told, rows } = expected;
        let rows: Arc<[DMatrix<f64>]> = rows.unwrap_or_else(|| jacobians(&self.after, &pose)).into();
        by_rows(&mut self.after, &rows, &[], counted(&chances, 1.0));
        self.sound.push(sound(&self.now, &rows));
        self.poses.push(pose);
        self.chances.push(chances);
        self.told.push(told);
        self.rows.push(rows);
    }

    /// Takes a pose out of the plan.
    pub fn remove(&mut self, index: usize) -> Vec<f64> {
        let (pose, chances) = (self.poses.remove(index), self.chances.remove(index));
        self.told.remove(index);
        let (rows, sound) = (self.rows.remove(index), self.sound.remove(index));
        if !by_rows(&mut self.after, &rows, &sound, counted(&chances, -1.0)) {
            // Too much would cancel: from the beginning, without it.
            self.after = (*self.now).clone();
            for (rows, chances) in self.rows.iter().zip(&self.chances) {
                by_rows(&mut self.after, rows, &[], counted(chances, 1.0));
            }
        }
        pose
    }

    /// tr(W P) in the mean over the hypotheses if a pose were taken out of the plan; `None` where too much would cancel.
    pub fn trace_without(&self, index: usize, weights: &Weights) -> Option<f64> {
        let estimate = self.after.covariance.iter().map(|covariance| (self.after.weight(), covariance));
        let others = self.after.alternatives.iter().map(|alternative| (alternative.weight, &alternative.covariance));
        let (level, often) = (crate::simd::level(), counted(&self.chances[index], -1.0));
        let mut sum = 0.0;
        for (hypothesis, ((share, covariance), rows)) in estimate.chain(others).zip(self.rows[index].iter()).enumerate()
        {
            let c = often(hypothesis);
            let sound = self.sound[index].get(hypothesis).copied().unwrap_or(SOUND);
            let gained =
                if c.abs() < NOTHING { 0.0 } else { weights.squares(&root(level, covariance, rows, c, sound)?) };
            sum += share * (weights.trace(covariance) + gained);
        }
        Some(sum)
    }

    /// Σ B over the poses of the plan, by pair.
    pub fn told(&self) -> Vec<f64> {
        self.told_but(None)
    }

    /// The same without one of the poses.
    pub fn told_without(&self, index: usize) -> Vec<f64> {
        self.told_but(Some(index))
    }

    fn told_but(&self, left_out: Option<usize>) -> Vec<f64> {
        let pairs = self.told.first().map_or(0, Vec::len);
        let counted = || self.told.iter().enumerate().filter(|(index, _)| Some(*index) != left_out);
        (0..pairs).map(|pair| counted().map(|(_, told)| told[pair]).sum()).collect()
    }
}

/// How often a pose counts that each hypothesis expects to be seen with these chances.
fn counted(chances: &[f64], sign: f64) -> impl Fn(usize) -> f64 {
    move |index| sign * chances.get(index).copied().unwrap_or(1.0)
}

/// Changes the covariance of every hypothesis of `belief` as an observation after moving to `pose` would, counted `weight`
/// times, by hypothesis; a negative weight takes it out again. Whether that was sound.
pub(super) fn condition(belief: &mut Belief, pose: &[f64], weight: impl Fn(usize) -> f64) -> bool {
    let rows = jacobians(belief, pose);
    let sound = sound(belief, &rows);
    by_rows(belief, &rows, &sound, weight)
}

/// Hᵀ, whitened, of a pose under every hypothesis, of the channels that would read there: how likely any does is told apart.
fn jacobians(belief: &Belief, pose: &[f64]) -> Vec<DMatrix<f64>> {
    let Belief { state, layout, measurement_model, alternatives, .. } = belief;
    let states = std::iter::once(state).chain(alternatives.iter().map(|alternative| &alternative.state));
    states.map(|state| measurement_model.believed_jacobian(state, layout, pose)).collect()
}

/// Updates or downdates every hypothesis; `least` must be left of a downdate, by hypothesis. Whether that was sound.
fn by_rows(belief: &mut Belief, rows: &[DMatrix<f64>], least: &[f64], weight: impl Fn(usize) -> f64) -> bool {
    let Belief { covariance, alternatives, .. } = belief;
    let others = alternatives.iter_mut().map(|Alternative { covariance, .. }| Some(covariance));
    let (level, mut sound) = (crate::simd::level(), true);
    for (index, (covariance, rows)) in std::iter::once(covariance.as_mut()).chain(others).zip(rows).enumerate() {
        sound &= covariance.is_none_or(|covariance| {
            let least = least.get(index).copied().unwrap_or(SOUND);
            update(level, covariance, rows, weight(index), least)
        });
    }
    sound
}

/// A downdate is sound while what is left of I/c − H P Hᵀ, by the squares of its Cholesky factor's diagonal, exceeds this, and so
/// many times the rounding of H P Hᵀ: that of P is the rounding of P₀, from which updates took it, and the noise magnifies it.
const SOUND: f64 = 1e-6;
const ROUNDINGS: f64 = 1e5;

/// By hypothesis what must be left of downdates by `rows`, with P₀ the covariance before all updates.
fn sound(before: &Belief, rows: &[DMatrix<f64>]) -> Arc<[f64]> {
    let Belief { covariance, alternatives, .. } = before;
    let others = alternatives.iter().map(|alternative| Some(&alternative.covariance));
    let of = |(covariance, rows): (Option<&DMatrix<f64>>, &DMatrix<f64>)| {
        let Some(covariance) = covariance else { return SOUND };
        let (m, d) = rows.shape();
        let spread =
            DMatrix::from_vec(m, d, times_few(crate::simd::level(), rows.as_slice(), covariance.as_slice(), m));
        let largest = rows.component_mul(&spread).row_sum().max();
        SOUND.max(ROUNDINGS * f64::EPSILON * largest)
    };
    std::iter::once(covariance.as_ref()).chain(others).zip(rows).map(of).collect()
}

/// What counts less often than this changes nothing.
const NOTHING: f64 = 1e-9;

/// P ← (P⁻¹ + c HᵀH)⁻¹ = P − P Hᵀ (I/c + H P Hᵀ)⁻¹ H P, for c < 0 a downdate; as it was, where c is nothing. False where a
/// downdate would cancel what is known.
fn update(level: Level, covariance: &mut DMatrix<f64>, rows: &DMatrix<f64>, c: f64, least: f64) -> bool {
    if c.abs() < NOTHING {
        return true;
    }
    let Some(root) = root(level, covariance, rows, c, least) else { return false };
    add_few_squares(level, root.as_slice(), -c.signum(), covariance.as_mut_slice());
    true
}

/// X (m × d), of whose square X Xᵀ P loses by an update, or gains by a downdate; `None` where that would cancel what is known.
fn root(level: Level, covariance: &DMatrix<f64>, rows: &DMatrix<f64>, c: f64, least: f64) -> Option<DMatrix<f64>> {
    let (m, d) = rows.shape();
    let numerator = DMatrix::from_vec(m, d, times_few(level, rows.as_slice(), covariance.as_slice(), m));
    let spread = rows.tr_mul(&numerator);
    let middle = (DMatrix::identity(d, d) / c + (&spread + spread.transpose()) * 0.5) * c.signum();
    let cholesky = Cholesky::new(middle)?;
    let l = cholesky.l_dirty();
    if c < 0.0 && l.diagonal().iter().any(|x| x * x < least) {
        return None;
    }
    // With L Lᵀ = ±(I/c + H P Hᵀ), X = P Hᵀ L⁻ᵀ, column by column.
    let mut root = numerator;
    for k in 0..d {
        for before in 0..k {
            let (found, mut column) = root.columns_range_pair_mut(before, k);
            column.axpy(-l[(k, before)], &found, 1.0);
        }
        root.column_mut(k).scale_mut(1.0 / l[(k, k)]);
    }
    Some(root)
}
