//! A weighted set of modes of the posterior: a Gaussian mixture.
//!
//! Each mode's evidence is that of its Laplace approximation, `−E − ½ ln det Λ`. Modes are searched again from where
//! they are after every measurement; new ones are searched from draws of the prior and from the modes there are, with
//! some joints drawn anew. Modes that meet are merged, and those without a share of the evidence are dropped.

use rand::{Rng, RngExt};

use super::posterior::{Effort, Mode, Posterior};
use crate::{
    kinematics::{Joint, Line},
    model::{Block, Layout, State},
};

/// How many modes are kept, and how hard new ones are searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HypothesisSettings {
    /// Modes kept at most.
    pub kept: usize,
    /// Searches begun after every measurement while the belief may be ambiguous.
    pub spawned: usize,
}

impl Default for HypothesisSettings {
    fn default() -> Self {
        Self { kept: 16, spawned: 16 }
    }
}

/// The modes, the heaviest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Hypotheses {
    pub modes: Vec<Mode>,
    /// Steps in a row in which no new mode counted for anything.
    pub calm: usize,
}

/// Modes nearer than this (squared, in standard deviations) are one.
const MERGED: f64 = 0.3;
/// A mode of a smaller share of the evidence is dropped.
const NEGLIGIBLE: f64 = 1e-5;
/// Logarithm of the evidence ratio from which on another mode does not count.
const HOPELESS: f64 = 40.0;

const WARM: Effort = Effort { steps: 30, tolerance: 1e-6, hopeless: f64::INFINITY };
const COLD: Effort = Effort { steps: 40, tolerance: 1e-4, hopeless: f64::INFINITY };

impl Hypotheses {
    /// Searches every mode again after the posterior has changed.
    pub fn follow(&mut self, posterior: &Posterior, layout: &Layout) {
        self.modes = self.modes.iter().filter_map(|mode| posterior.mode(&mode.state, layout, WARM)).collect();
    }

    /// Searches new modes, half of them from the prior, half of them from the modes there are.
    pub fn spawn(&mut self, count: usize, posterior: &Posterior, layout: &Layout, rng: &mut impl Rng) {
        let best = self.modes.iter().map(|mode| mode.cost).fold(f64::INFINITY, f64::min);
        let effort = Effort { hopeless: (best + HOPELESS) * 10.0 + 1e3, ..COLD };
        let before = self.modes.len();
        for index in 0..count {
            let drawn = posterior.prior.draw(layout, rng);
            let start = if index % 2 == 0 || before == 0 {
                drawn
            } else {
                mutated(&self.modes[rng.random_range(0..before)].state, &drawn, layout, rng)
            };
            self.modes.extend(posterior.mode(&start, layout, effort));
        }
    }

    /// Merges, weighs, sorts and prunes.
    pub fn condense(&mut self, kept: usize, layout: &Layout) {
        // Evidence is finite: what has none is no mode.
        self.modes.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        let best = self.modes.first().map_or(0.0, |mode| mode.log_evidence);
        let mut distinct: Vec<Mode> = Vec::new();
        for mode in self.modes.drain(..) {
            if mode.log_evidence < best - HOPELESS || distinct.len() >= kept {
                break;
            }
            let is_new = distinct.iter().all(|other| {
                other
                    .state
                    .local(layout, &mode.state)
                    .is_none_or(|delta| delta.dot(&(&other.information * &delta)) > MERGED)
            });
            if is_new {
                distinct.push(mode);
            }
        }
        let total: f64 = distinct.iter().map(|mode| (mode.log_evidence - best).exp()).sum();
        distinct.iter_mut().for_each(|mode| mode.weight = (mode.log_evidence - best).exp() / total);
        distinct.retain(|mode| mode.weight >= NEGLIGIBLE);
        self.modes = distinct;
    }
}

/// `state` with one to three of its learned axes drawn anew or turned round; of other blocks, where no axis is learned.
fn mutated(state: &State, drawn: &State, layout: &Layout, rng: &mut impl Rng) -> State {
    let mut mutated = state.clone();
    let learned: Vec<Block> = layout.blocks().map(|(block, _)| block).collect();
    let axes: Vec<Block> = learned.iter().copied().filter(|block| matches!(block, Block::Axis(_))).collect();
    let places = if axes.is_empty() { learned } else { axes };
    if places.is_empty() {
        return mutated;
    }
    for _ in 0..rng.random_range(1..=3) {
        let block = places[rng.random_range(0..places.len())];
        let turns_round = rng.random_range(0..4) == 0;
        match block {
            Block::Axis(index) => {
                mutated.joints[index] = match mutated.joints[index] {
                    Joint::Revolute(line) if turns_round => {
                        Joint::Revolute(Line { direction: -line.direction, ..line })
                    }
                    _ => drawn.joints[index],
                };
            }
            _ => block.put(&mut mutated, block.of(drawn)),
        }
    }
    mutated
}
