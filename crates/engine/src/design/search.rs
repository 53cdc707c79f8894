//! The search for the best data: an approximate A-optimal design, by exchange.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Problem,
    balance::{Shares, Standing},
    candidates::{candidates, within},
    sensitivity::Sensitivity,
};
use crate::{
    normal::StandardNormal,
    optimize::{Polish, Slopes, descend},
};

/// An approximate A-optimal design.
#[derive(Clone, Debug)]
pub struct Design {
    /// Its poses, rad or m.
    pub poses: Vec<Vec<f64>>,
    /// The share of each in all movements.
    pub shares: Vec<f64>,
    /// tr(W M⁻¹).
    pub trace: f64,
    /// The most by which the trace exceeds the optimum, as a fraction of it: the gap of the equivalence theorem over 4500
    /// candidates, the best third of them and the poses of the design polished. Some maxima draw from nearby alone: climbing from
    /// 100 000 other poses finds up to 0.01 more. Where some poses are out of view, the polish cannot follow the border of view:
    /// more candidates are polished there, and 0.07 more was found where a head watches.
    pub gap: f64,
}

/// Candidates polished in every exchange, the best of them: the best few often climb to the same pose.
const POLISHED: usize = 100;
/// Candidates polished before a design is called optimal: some maxima draw from nearby alone.
const CERTIFYING: usize = 1500;
/// Poses that join in every exchange at most.
const JOINING: usize = 40;
/// Sides of the cube by which one of the coordinates of two of them must differ.
const APART: f64 = 0.02;
/// Poses of the first design.
const STARTING: usize = 100;
/// How far shares are balanced, as a fraction of the last excess.
const UNBALANCED: f64 = 0.1;
const EXCHANGES: usize = 60;
/// The polish of candidates, to a hundredth of the gap that is usually asked for.
const CLIMB: Polish = Polish { steps: 40, tolerance: 1e-4 };
/// The number of the best poses found by ascent that then follow the border of view, and the most steps of each; the first step and
/// the last, in sides of the cube.
const FOLLOWED: usize = 40;
const FOLLOWING: usize = 250;
const LONGEST: f64 = 0.03;
const SHORTEST: f64 = 1e-4;

impl Problem {
    /// The best design of `movements` movements, to within `gap` of the optimum or as near as it came. `None` where the
    /// prior and the movements leave something open, and where no movement shows anything.
    pub fn best_design(&self, movements: usize, gap: f64) -> Option<Design> {
        self.best_design_from(movements, gap, None)
    }

    /// The best design of `movements` movements, searched from a design of another number of movements: where data
    /// outweigh the prior the two are nearly alike. `None` as for [`best_design`](Self::best_design).
    pub fn best_design_from(&self, movements: usize, gap: f64, start: Option<&Design>) -> Option<Design> {
        // What never sees anything is left out: it would change the last digits of all sums, and so the way that a search takes.
        if let Some(sighted) = self.sighted() {
            return sighted.best_design_from(movements, gap, start);
        }
        let mut search = DesignSearch::new(self, movements, start);
        if search.candidates.is_empty() {
            return None;
        }
        // Polishes that end at the border of what a head sees end at many places. Rows of cameras take longer than those of points.
        let polished = if self.head.is_some() { search.candidates.len() } else { POLISHED };
        let certifying = polished.max(CERTIFYING);
        let mut exchanges = 0;
        // Balancing to the last digit is no use before the right poses are there.
        let mut tolerance = 0.1;
        loop {
            let standing = search.balance(tolerance)?;
            let mut found = search.favoured(&standing, polished);
            let is_last = exchanges == EXCHANGES;
            if (excess(&found, &standing) <= gap * standing.trace || is_last) && certifying > polished {
                found = search.favoured(&standing, certifying);
            }
            let excess = excess(&found, &standing);
            if excess <= gap * standing.trace || is_last {
                return Some(search.design(&standing, excess));
            }
            tolerance = UNBALANCED * excess / standing.trace;
            search.join(found, &standing);
            exchanges += 1;
        }
    }
}

/// max φ − Σ pᵢ φᵢ over what was found, the greatest first.
fn excess(found: &[(Vec<f64>, f64)], standing: &Standing) -> f64 {
    found.first().map_or(0.0, |(_, sensitivity)| *sensitivity) - standing.mean
}

/// A design that is being searched.
pub struct DesignSearch<'a> {
    problem: &'a Problem,
    sensitivity: Sensitivity<'a>,
    /// Poses, rad or m, all of which are seen.
    pub candidates: Vec<Vec<f64>>,
    poses: Vec<Vec<f64>>,
    shares: Shares<'a>,
}

impl<'a> DesignSearch<'a> {
    /// Begins with a given design, or with one made of candidates.
    pub fn new(problem: &'a Problem, movements: usize, start: Option<&Design>) -> Self {
        let candidates = candidates(problem);
        let (poses, shares) = match start {
            Some(design) => (design.poses.clone(), design.shares.clone()),
            None => {
                let poses: Vec<_> =
                    candidates.iter().step_by(candidates.len().div_ceil(STARTING).max(1)).cloned().collect();
                let shares = vec![1.0 / poses.len() as f64; poses.len()];
                (poses, shares)
            }
        };
        let shares = Shares::new(problem, movements as f64, &poses, shares);
        Self { problem, sensitivity: Sensitivity::new(problem), candidates, poses, shares }
    }

    /// Balances the shares to `tolerance` of the trace; `None` if the information is singular.
    pub fn balance(&mut self, tolerance: f64) -> Option<Standing> {
        let (kept, standing) = self.shares.balance(tolerance)?;
        let mut keep = kept.into_iter();
        self.poses.retain(|_| keep.next().unwrap_or(true));
        Some(standing)
    }

    /// The `count` candidates of the greatest sensitivity and the poses of the design, all polished, with their sensitivity: the
    /// greatest first.
    pub fn favoured(&self, standing: &Standing, count: usize) -> Vec<(Vec<f64>, f64)> {
        let limits = &self.problem.limits;
        let values = self.sensitivity.values(&standing.sensitivity, &self.candidates);
        let mut values: Vec<(f64, usize)> = values.into_iter().zip(0..).collect();
        // Poses whose sensitivity cannot be computed favour nobody.
        values.retain(|(phi, _)| phi.is_finite());
        values.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = values.iter().take(count).map(|(_, index)| &self.candidates[*index]);
        let starts = best.chain(&self.poses).map(|pose| limits.to_unit(pose)).collect();
        let sides: Vec<f64> = limits.joints().iter().map(|(lower, upper)| upper - lower).collect();
        let climbed = descend(starts, CLIMB, |points| {
            let poses: Vec<_> = points.iter().map(|point| limits.from_unit(point)).collect();
            let Slopes { mut values, mut gradients } = self.sensitivity.slopes(&standing.sensitivity, &poses);
            values.iter_mut().for_each(|phi| *phi = -*phi);
            gradients.iter_mut().zip(sides.iter().cycle()).for_each(|(slope, side)| *slope *= -side);
            Slopes { values, gradients }
        });
        let found = climbed.into_iter().map(|(point, value)| (point, -value));
        let mut found: Vec<_> = found.filter(|(_, phi)| phi.is_finite()).collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        if self.problem.measurement_model.has_view() {
            self.follow_border(standing, &mut found);
        }
        found
    }

    /// Climbs on from the best of `found` where slopes end at the border of what is in view: by steps in random directions, longer
    /// after one that leads up and shorter after one that does not (an evolution strategy of one parent and one child; Rechenberg 1973).
    fn follow_border(&self, standing: &Standing, found: &mut [(Vec<f64>, f64)]) {
        // A fixed stream of its own.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let limits = &self.problem.limits;
        let count = found.len().min(FOLLOWED);
        let mut steps = vec![LONGEST; count];
        for _ in 0..FOLLOWING {
            let tried: Vec<usize> = (0..count).filter(|index| steps[*index] > SHORTEST).collect();
            let beside = tried.iter().map(|index| {
                let from = &found[*index].0;
                within(from.iter().map(|x| x + steps[*index] * rng.sample::<f64, _>(StandardNormal)).collect())
            });
            let beside: Vec<Vec<f64>> = beside.collect();
            let poses: Vec<Vec<f64>> = beside.iter().map(|point| limits.from_unit(point)).collect();
            let values = self.sensitivity.values(&standing.sensitivity, &poses);
            for ((index, point), phi) in tried.into_iter().zip(beside).zip(values) {
                let is_better = phi > found[index].1;
                steps[index] *= if is_better { 1.5 } else { 0.9 };
                if is_better {
                    found[index] = (point, phi);
                }
            }
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
    }

    /// Adds the poses that are favoured more than the design's own, each once.
    fn join(&mut self, found: Vec<(Vec<f64>, f64)>, standing: &Standing) {
        let mut joining: Vec<Vec<f64>> = Vec::new();
        for (point, sensitivity) in found {
            let is_other = |other: &Vec<f64>| point.iter().zip(other).any(|(x, y)| (x - y).abs() > APART);
            if sensitivity > standing.mean && joining.len() < JOINING && joining.iter().all(is_other) {
                joining.push(point);
            }
        }
        let joining: Vec<_> = joining.iter().map(|point| self.problem.limits.from_unit(point)).collect();
        self.shares.join(&joining);
        self.poses.extend(joining);
    }

    fn design(self, standing: &Standing, excess: f64) -> Design {
        let (shares, trace) = (self.shares.shares().to_vec(), standing.trace);
        Design { poses: self.poses, shares, trace, gap: (excess / trace).max(0.0) }
    }
}
