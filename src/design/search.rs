//! The search for the best data: an approximate A-optimal design, by exchange.

use nalgebra::{Cholesky, DMatrix};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Problem;
use crate::optimize::{Polish, polish};

/// An approximate A-optimal design.
#[derive(Clone, Debug)]
pub struct Design {
    /// Its poses, rad or m.
    pub poses: Vec<Vec<f64>>,
    /// The share of each in all movements.
    pub shares: Vec<f64>,
    /// tr(W M⁻¹).
    pub trace: f64,
    /// By how much the trace may exceed the optimum, as a fraction of it: the gap of the equivalence theorem over 4500
    /// candidates, the best hundred of them polished. Where a head watches, the polish cannot follow the border of what it sees,
    /// and the gap may be some tenths of a percent too small.
    pub gap: f64,
}

/// Candidates inside the joint box, on its faces and on its corners, each.
const CANDIDATES: usize = 1500;
/// Candidates polished in every exchange.
const POLISHED: usize = 6;
/// Candidates polished before a design is called optimal: the best few often climb to the same pose.
const CERTIFYING: usize = 100;
/// Poses of the first design.
const STARTING: usize = 100;
const EXCHANGES: usize = 60;
const BALANCING: usize = 150;
/// Poses with a smaller share leave the design.
const NEGLIGIBLE: f64 = 1e-5;

impl Problem {
    /// The best design of `movements` movements, to within `gap` of the optimum or as near as it came. `None` where the
    /// prior and the movements leave something open.
    pub fn best_design(&self, movements: usize, gap: f64) -> Option<Design> {
        self.best_design_from(movements, gap, None)
    }

    /// The same, from a design of another number of movements: where data outweigh the prior the two are nearly alike.
    pub fn best_design_from(&self, movements: usize, gap: f64, start: Option<&Design>) -> Option<Design> {
        let mut search = Search::new(self, movements, start);
        for _ in 0..EXCHANGES {
            let state = search.state()?;
            let mut found = search.favoured(&state, POLISHED);
            if excess(&found, &state) <= gap * state.trace {
                found = search.favoured(&state, CERTIFYING);
                let excess = excess(&found, &state);
                if excess <= gap * state.trace {
                    return Some(search.design(&state, excess));
                }
                found.sort_by(|a, b| b.1.total_cmp(&a.1));
                found.truncate(POLISHED);
            }
            let joined = found.into_iter().filter(|(_, sensitivity)| *sensitivity > state.mean);
            search.join(joined.map(|(pose, _)| pose).collect());
            search.balance()?;
        }
        let state = search.state()?;
        let excess = excess(&search.favoured(&state, CERTIFYING), &state);
        Some(search.design(&state, excess))
    }
}

/// max φ − Σ pᵢ φᵢ over what was found.
fn excess(found: &[(Vec<f64>, f64)], state: &Standing) -> f64 {
    found.iter().map(|(_, sensitivity)| *sensitivity).fold(0.0, f64::max) - state.mean
}

/// A design on its way.
struct Search<'a> {
    problem: &'a Problem,
    movements: f64,
    /// In the unit cube.
    candidates: Vec<Vec<f64>>,
    poses: Vec<Vec<f64>>,
    information: Vec<DMatrix<f64>>,
    shares: Vec<f64>,
}

struct Standing {
    trace: f64,
    /// N M⁻¹ W M⁻¹.
    sensitivity: DMatrix<f64>,
    /// Σ pᵢ φᵢ.
    mean: f64,
}

impl<'a> Search<'a> {
    fn new(problem: &'a Problem, movements: usize, start: Option<&Design>) -> Self {
        let n = problem.limits.dimension();
        // A fixed stream of its own: limits depend on no seed.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut candidates = Vec::with_capacity(3 * CANDIDATES);
        for at_bounds in [0.0, 0.5, 1.0] {
            for _ in 0..CANDIDATES {
                let coordinate = |_| {
                    let x: f64 = rng.random();
                    if rng.random::<f64>() < at_bounds { x.round() } else { x }
                };
                candidates.push((0..n).map(coordinate).collect::<Vec<f64>>());
            }
        }
        let mut search = Self {
            problem,
            movements: movements as f64,
            candidates,
            poses: Vec::new(),
            information: Vec::new(),
            shares: Vec::new(),
        };
        match start {
            Some(design) => {
                search.information = design.poses.iter().map(|pose| problem.information(pose)).collect();
                (search.poses, search.shares) = (design.poses.clone(), design.shares.clone());
            }
            None => {
                let seen =
                    search.candidates.iter().filter(|point| problem.seen(&problem.limits.from_unit(point)).is_some());
                let seen: Vec<Vec<f64>> = seen.cloned().collect();
                search.join(seen.iter().step_by(seen.len().div_ceil(STARTING).max(1)).cloned().collect());
            }
        }
        search
    }

    /// Adds poses, with a small share each.
    fn join(&mut self, points: Vec<Vec<f64>>) {
        if points.is_empty() {
            return;
        }
        let share = if self.shares.is_empty() { 1.0 } else { 0.1 } / points.len() as f64;
        let rest = 1.0 - share * points.len() as f64;
        self.shares.iter_mut().for_each(|other| *other *= rest);
        for point in points {
            let pose = self.problem.limits.from_unit(&point);
            self.information.push(self.problem.information(&pose));
            self.poses.push(pose);
            self.shares.push(share);
        }
    }

    fn state(&self) -> Option<Standing> {
        let mut m = self.problem.prior.clone();
        for (information, share) in self.information.iter().zip(&self.shares) {
            m += information * (share * self.movements);
        }
        let inverse = Cholesky::new(m)?.inverse();
        let weights = &self.problem.weights;
        let sensitivity = &inverse * weights.scale(&inverse) * self.movements;
        let mean = self.sensitivities(&sensitivity).zip(&self.shares).map(|(phi, share)| phi * share).sum();
        Some(Standing { trace: weights.trace(&inverse), sensitivity, mean })
    }

    fn sensitivities<'b>(&'b self, sensitivity: &'b DMatrix<f64>) -> impl Iterator<Item = f64> + 'b {
        self.information.iter().map(|information| information.dot(sensitivity))
    }

    /// The `count` candidates of the greatest sensitivity, polished, with it.
    fn favoured(&self, state: &Standing, count: usize) -> Vec<(Vec<f64>, f64)> {
        let phi = |point: &[f64]| {
            let seen = self.problem.seen(&self.problem.limits.from_unit(point));
            seen.map_or(f64::NEG_INFINITY, |rows| (&state.sensitivity * &rows).dot(&rows))
        };
        let values = self.candidates.iter().enumerate().map(|(index, point)| (phi(point), index));
        // Poses out of sight, and those whose sensitivity cannot be computed, favour nobody.
        let mut values: Vec<(f64, usize)> = values.filter(|(phi, _)| phi.is_finite()).collect();
        values.sort_by(|a, b| b.0.total_cmp(&a.0));
        let settings = Polish { steps: 40, tolerance: 1e-6 };
        let polished = values.iter().take(count).map(|(_, index)| {
            let evaluate = |points: &[Vec<f64>]| points.iter().map(|point| -phi(point)).collect();
            let (point, value) = polish(&self.candidates[*index], settings, evaluate);
            (point, -value)
        });
        polished.collect()
    }

    /// Balances the shares, and drops poses without one.
    fn balance(&mut self) -> Option<()> {
        for _ in 0..BALANCING {
            let state = self.state()?;
            let roots: Vec<f64> = self.sensitivities(&state.sensitivity).map(|phi| phi.max(0.0).sqrt()).collect();
            let total: f64 = roots.iter().zip(&self.shares).map(|(root, share)| root * share).sum();
            self.shares.iter_mut().zip(&roots).for_each(|(share, root)| *share *= root / total);
        }
        let kept: Vec<bool> = self.shares.iter().map(|share| *share >= NEGLIGIBLE).collect();
        let mut keep = kept.iter();
        self.poses.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = kept.iter();
        self.information.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = kept.iter();
        self.shares.retain(|_| *keep.next().unwrap_or(&true));
        let total: f64 = self.shares.iter().sum();
        self.shares.iter_mut().for_each(|share| *share /= total);
        Some(())
    }

    fn design(self, state: &Standing, excess: f64) -> Design {
        Design { poses: self.poses, shares: self.shares, trace: state.trace, gap: (excess / state.trace).max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::builtin;

    use super::*;

    #[test]
    fn a_sensitivity_that_is_no_number_is_nobodys_favourite() {
        let problem = builtin("arm-6dof").expect("built in").design_problem().expect("simulated");
        let mut search = Search::new(&problem, 20, None);
        let state = search.state().expect("informative");
        let wanted = search.favoured(&state, POLISHED);
        let n = problem.limits.dimension();
        search.candidates.splice(0..0, [vec![f64::NAN; n], vec![-f64::NAN; n]]);
        assert_eq!(search.favoured(&state, POLISHED), wanted);
    }
}
