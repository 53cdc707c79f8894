//! Where what is measured leaves directions open, the prior alone says how far along them a mode is.
//!
//! The likelihood is the same wherever a [`Symmetry`] takes a state: the whole robot moved as one where nothing is measured from outside, a
//! zero shifted with all that is behind the joint moved back. What it makes of a state is curved in every chart. Steps of Gauss and
//! Newton creep along it, searches are given up at different places of it, and one body would be kept as many hypotheses. So where a
//! search ends, the state is taken along all its symmetries to where the prior costs least, and the search goes on from there:
//!
//! ```text
//! a = (Gᵀ Λ₀ G)⁻¹ Gᵀ d₀,     x ← x changed by a
//! ```
//!
//! with G (m × k) the derivative of x by the k coordinates of its symmetries, Λ₀ and d₀ the information and the negative gradient of
//! the prior.

use nalgebra::{DMatrix, DVector};

use super::posterior::Posterior;
use crate::model::{Layout, Links, State, Symmetry};

/// By which change (m and rad, or a share) it is tried whether a family of changes is a symmetry.
const TRIAL: [f64; 6] = [0.04, -0.03, 0.05, 0.06, 0.05, -0.04];
/// How far whitened residuals may differ by it, as a share of themselves and of a standard deviation.
const SAME: f64 = 1e-6;
/// The longest change at a time.
const LONGEST: f64 = 0.3;
/// The most steps of Gauss and Newton.
const STEPS: usize = 4;
/// A change that lowers the prior's cost by less than this is none.
const NEXT_TO_NOTHING: f64 = 1e-6;

impl Posterior {
    /// The families of changes that leave every reading at `state` where it is.
    pub fn symmetries(&self, state: &State, layout: &Layout) -> Vec<Symmetry> {
        // What was marginalised is known in one chart alone.
        match self.marginalised {
            Some(_) => Vec::new(),
            None => Symmetry::candidates(layout).filter(|it| self.is_symmetric(*it, state, layout)).collect(),
        }
    }

    fn is_symmetric(&self, symmetry: Symmetry, state: &State, layout: &Layout) -> bool {
        let trial = &TRIAL[..symmetry.dimension()];
        let Some(changed) = self.changed(&[symmetry], state, layout, trial) else {
            return false;
        };
        // What changes nothing that is learned moves nothing: the size of an arm that only slides, its target being known.
        if state.local(layout, &changed).is_none_or(|delta| delta.amax() < SAME * trial[0]) {
            return false;
        }
        let mut count = 0;
        let stays = self.all().all(|seen| {
            let residual = |state: &State| {
                let mut all: Vec<f64> = Vec::new();
                self.measurement_model.residuals_by_channel(
                    Links::new(state).at(&seen.positions),
                    &seen.observation,
                    |_, whitened| {
                        all.extend(whitened.iter().filter(|x| !x.is_nan()));
                    },
                );
                all
            };
            let (here, there) = (residual(state), residual(&changed));
            count += here.len();
            let is_same = |(here, there): (&f64, &f64)| (here - there).abs() <= SAME * (1.0 + here.abs());
            here.len() == there.len() && here.iter().zip(&there).all(is_same)
        });
        // Before anything is measured nothing stands for the whole of a family.
        stays && count > 0
    }

    /// `state` changed by `a`, as far as its learned blocks go; `None` outside their charts.
    fn changed(&self, symmetries: &[Symmetry], state: &State, layout: &Layout, a: &[f64]) -> Option<State> {
        let delta = state.local(layout, &applied(symmetries, state, a))?;
        let mut changed = state.retract(layout, &delta);
        changed.slide_towards(&self.pins);
        Some(changed)
    }

    /// A state taken along its [symmetries](Self::symmetries) to where the prior costs least.
    pub fn centred(&self, mut state: State, symmetries: &[Symmetry], layout: &Layout) -> State {
        let m = layout.dimension();
        for _ in 0..STEPS {
            let (mut information, mut negative_gradient) = (DMatrix::zeros(m, m), DVector::zeros(m));
            let cost = self.prior.cost(&state, Some((&mut information, &mut negative_gradient)));
            let Some(along) = along(symmetries, &state, layout) else { break };
            let (information, negative_gradient) =
                (along.tr_mul(&(information * &along)), along.tr_mul(&negative_gradient));
            // A prior that says nothing of it leaves it where it is.
            let Some(step) = information.cholesky().map(|cholesky| cholesky.solve(&negative_gradient)) else { break };
            let step = &step * (LONGEST / step.amax()).min(1.0);
            let changed = self.changed(symmetries, &state, layout, step.as_slice());
            match changed.filter(|changed| self.prior.cost(changed, None) < cost - NEXT_TO_NOTHING) {
                Some(changed) => state = changed,
                None => break,
            }
        }
        state
    }
}

/// A state changed by one symmetry after the other, by their coordinates in `a`.
fn applied(symmetries: &[Symmetry], state: &State, mut a: &[f64]) -> State {
    let mut changed = state.clone();
    for symmetry in symmetries {
        let (own, others) = a.split_at(symmetry.dimension());
        changed = symmetry.applied(&changed, own);
        a = others;
    }
    changed
}

/// G: how the coordinates of a state change with those of its symmetries.
fn along(symmetries: &[Symmetry], state: &State, layout: &Layout) -> Option<DMatrix<f64>> {
    let k = symmetries.iter().map(|symmetry| symmetry.dimension()).sum();
    state.slopes_along(layout, k, |index, step| {
        let mut a = vec![0.0; k];
        a[index] = step;
        applied(symmetries, state, &a)
    })
}
