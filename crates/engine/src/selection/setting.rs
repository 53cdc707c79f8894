//! What the hypotheses of a belief have to do with each other.

use std::sync::Arc;

use super::{Optimality, Weights, criterion::points};
use crate::{
    elementary::{exp, ln},
    estimation::Belief,
    model::{Block, Element, Layout, Points, State, Workspace},
};

/// What the hypotheses of a belief have to do with each other and with what is measured, whatever their covariances.
pub(super) struct Setting {
    /// By hypothesis: the points that are measured, where nothing else is.
    pub points: Vec<Option<Arc<Points>>>,
    /// Pairs of hypotheses, and πⱼ πₖ ‖xⱼ − xₖ‖²_W.
    pub pairs: Vec<(usize, usize, f64)>,
}

impl Setting {
    /// Of `belief`.
    pub fn new(belief: &Belief, weights: &Weights, optimality: Optimality, workspace: &Workspace) -> Self {
        let others = belief.alternatives.iter().map(|alternative| (alternative.weight, &alternative.state));
        let hypotheses: Vec<(f64, &State)> = std::iter::once((belief.weight(), &belief.state)).chain(others).collect();
        let mut pairs = Vec::new();
        for (k, (weight, state)) in hypotheses.iter().enumerate() {
            for (j, (other_weight, other)) in hypotheses[..k].iter().enumerate() {
                let distance = match optimality {
                    Optimality::A | Optimality::E => squared_distance(other, state, &belief.layout, weights),
                    Optimality::I => apart(other, state, workspace),
                    Optimality::D => 1.0,
                };
                pairs.push((j, k, other_weight * weight * distance));
            }
        }
        if optimality == Optimality::D {
            // Which hypothesis holds is worth the entropy of the weights, in shares of the pairs.
            let entropy: f64 = hypotheses.iter().map(|(weight, _)| -weight * ln(weight.max(f64::MIN_POSITIVE))).sum();
            let sum: f64 = pairs.iter().map(|pair| pair.2).sum();
            pairs.iter_mut().filter(|_| sum > 0.0).for_each(|pair| pair.2 *= entropy / sum);
        }
        Self { points: hypotheses.iter().map(|(_, state)| points(belief, state)).collect(), pairs }
    }

    /// What is left between all pairs of hypotheses once they are told apart by these B.
    pub fn between(&self, told: &[f64]) -> f64 {
        let told = told.iter().copied().chain(std::iter::repeat(0.0));
        self.pairs.iter().zip(told).map(|((.., between), told)| between * exp(-told)).sum()
    }
}

/// ‖x − x'‖²_W: squared angles between directions and rotations, squared distances between points and of plain numbers,
/// weighted like tangent coordinates.
fn squared_distance(a: &State, b: &State, layout: &Layout, weights: &Weights) -> f64 {
    let of_block = |(block, range): (Block, std::ops::Range<usize>)| match (block.of(a), block.of(b)) {
        (Element::Axis(a), Element::Axis(b)) => {
            let turned = weights.of(range.end - 1) * a.direction().angle(&b.direction()).powi(2);
            let moved = a.line().zip(b.line()).map_or(0.0, |(a, b)| (a.point - b.point).norm_squared());
            turned + weights.of(range.start) * moved
        }
        (a, b) => {
            let apart = a.local(&b).unwrap_or_default();
            apart.iter().zip(range).map(|(x, coordinate)| weights.of(coordinate) * x * x).sum()
        }
    };
    layout.blocks().map(of_block).sum()
}

/// Mean squared distance of predicted markers over the workspace, m².
fn apart(a: &State, b: &State, workspace: &Workspace) -> f64 {
    workspace.distance(&workspace.points(a), &workspace.points(b)).map_or(0.0, |(rms, _)| rms * rms)
}
