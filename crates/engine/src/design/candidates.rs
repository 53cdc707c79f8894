//! Movements among which the best design is sought: those after which something is seen.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Problem;

/// Candidates inside the joint box, on its faces and on its corners, each.
const CANDIDATES: usize = 1500;
/// Candidates that are wanted at least in view of every sensor that sees some postures only, and rounds of draws in search of them.
const IN_VIEW: usize = 3000;
const ROUNDS: usize = 40;
/// How far, in sides of the cube, poses are drawn beside others that are in view; and draws for each that is wanted.
const BESIDE: [f64; 4] = [0.01, 0.03, 0.1, 0.3];
const DRAWS: usize = 20;

impl Problem {
    /// This problem without the channels that see nothing at any candidate; `None` if there are no such channels.
    pub(super) fn sighted(&self) -> Option<Self> {
        if !self.measurement_model.has_view() || self.measurement_model.sensors().len() < 2 {
            return None;
        }
        let mut sighted = vec![false; self.measurement_model.sensors().len()];
        for pose in candidates(self) {
            sighted.iter_mut().zip(self.visible(&pose)).for_each(|(any, visible)| *any |= visible);
        }
        let is_some = sighted.contains(&true) && sighted.contains(&false);
        is_some
            .then(|| Self { measurement_model: Arc::new(self.measurement_model.limited_to(&sighted)), ..self.clone() })
    }

    /// At most `count` poses that `is_wanted`, drawn beside known ones and beside the one at which something is known to
    /// be seen.
    fn beside(
        &self,
        count: usize,
        known: &[Vec<f64>],
        is_wanted: impl Fn(&[f64]) -> bool,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<f64>> {
        let said = self.visible_pose.iter().filter(|pose| pose.len() == self.limits.dimension());
        let said = said.map(|pose| self.limits.from_unit(&within(self.limits.to_unit(pose))));
        let mut found: Vec<Vec<f64>> = said.filter(|pose| is_wanted(pose)).collect();
        if known.is_empty() && found.is_empty() {
            return found;
        }
        for draw in 0..DRAWS * count {
            if found.len() >= count {
                break;
            }
            let place = rng.random_range(0..known.len() + found.len());
            let from = self.limits.to_unit(known.get(place).unwrap_or_else(|| &found[place - known.len()]));
            let step = BESIDE[draw % BESIDE.len()];
            let pose = within(from.iter().map(|x| x + step * rng.random_range(-1.0..1.0)).collect());
            let pose = self.limits.from_unit(&pose);
            if is_wanted(&pose) {
                found.push(pose);
            }
        }
        found
    }

    /// A pose inside the joint box whose coordinates are at a limit with the chance `at_bounds`.
    fn drawn(&self, at_bounds: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let coordinate = |_| {
            let x: f64 = rng.random();
            if rng.random::<f64>() < at_bounds { x.round() } else { x }
        };
        let point: Vec<f64> = (0..self.limits.dimension()).map(coordinate).collect();
        self.limits.from_unit(&point)
    }
}

/// A point brought within the unit cube.
pub(super) fn within(mut point: Vec<f64>) -> Vec<f64> {
    point.iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
    point
}

/// Poses inside the joint box, on its faces and on its corners, after which something is seen: of every sensor that sees some postures
/// only as many as are wanted, as far as they are found.
pub(super) fn candidates(problem: &Problem) -> Vec<Vec<f64>> {
    // A fixed stream of its own: limits depend on no seed.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut candidates = Vec::with_capacity(3 * CANDIDATES);
    let sensors = problem.measurement_model.sensors();
    // How many each channel sees; those that see everything want none.
    let mut seen: Vec<usize> = sensors.iter().map(|it| if it.subject().has_view { 0 } else { IN_VIEW }).collect();
    for round in 0..ROUNDS {
        for at_bounds in [0.0, 0.5, 1.0] {
            for _ in 0..CANDIDATES {
                let pose = problem.drawn(at_bounds, &mut rng);
                let visible = problem.visible(&pose);
                // Once there are candidates of all, only those count that cameras want.
                let all = round == 0 || candidates.is_empty();
                let is_wanted = |channel: usize| visible[channel] && (all || seen[channel] < IN_VIEW);
                if (0..sensors.len()).any(is_wanted) {
                    candidates.push(pose);
                    seen.iter_mut().zip(visible).for_each(|(seen, visible)| *seen += usize::from(visible));
                }
            }
        }
        if seen.iter().all(|seen| *seen >= IN_VIEW) && !candidates.is_empty() {
            return candidates;
        }
    }
    for channel in (0..sensors.len()).filter(|channel| seen[*channel] < IN_VIEW) {
        let is_wanted = |pose: &[f64]| problem.visible(pose)[channel];
        let known: Vec<Vec<f64>> = candidates.iter().filter(|pose| is_wanted(pose)).cloned().collect();
        candidates.extend(problem.beside(IN_VIEW.saturating_sub(known.len()), &known, is_wanted, &mut rng));
    }
    if candidates.is_empty() {
        candidates.extend(problem.beside(IN_VIEW, &[], |pose| problem.sees(pose), &mut rng));
    }
    candidates
}
