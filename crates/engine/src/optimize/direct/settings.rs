//! What a search is told before it starts, and what it refuses.

use serde::{Deserialize, Serialize};

use super::ternary;

/// How a rectangle is measured, and how many rectangles of one size are divided at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// DIRECT (Jones, Perttunen and Stuckman 1993). The size of a rectangle is the distance from its centre to a
    /// corner, and of several potentially optimal rectangles equal in size and value all are divided.
    #[default]
    Original,
    /// DIRECT-l (Gablonsky and Kelley 2001). The size of a rectangle is half its longest side, and at most one
    /// rectangle of each size is divided per iteration. There are fewer sizes, hence fewer divisions per
    /// iteration and a search that commits sooner: the better choice when there are few local minima.
    LocallyBiased,
}

impl Variant {
    /// Its name in scenarios and reports: `direct` or `direct-l`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Original => "direct",
            Self::LocallyBiased => "direct-l",
        }
    }

    /// The variant of that name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Original, Self::LocallyBiased].into_iter().find(|variant| variant.name() == name)
    }

    /// The size of a rectangle of these levels, at least one and none above [`MAX_LEVEL`](super::MAX_LEVEL).
    pub fn size_of(self, levels: &[u8]) -> f64 {
        self.size(self.class(levels), levels.len())
    }

    /// The size class of a rectangle: 0 is the whole cube, and larger numbers are smaller rectangles.
    ///
    /// Only longest sides are divided, so the levels of one rectangle differ by at most one and their sum
    /// determines the diagonal.
    pub(super) fn class(self, levels: &[u8]) -> usize {
        match self {
            Self::Original => levels.iter().copied().map(usize::from).sum(),
            Self::LocallyBiased => usize::from(longest(levels)),
        }
    }

    /// The size that all rectangles of a class have in common.
    pub(super) fn size(self, class: usize, dimension: usize) -> f64 {
        let (level, shorter) = match self {
            Self::Original => (class / dimension, class % dimension),
            Self::LocallyBiased => (class, 0),
        };
        let half_side = 0.5 * ternary::side(level as u8);
        match self {
            Self::Original => half_side * ((dimension - shorter) as f64 + shorter as f64 / 9.0).sqrt(),
            Self::LocallyBiased => half_side,
        }
    }
}

/// The trisection level of the longest sides.
pub(super) fn longest(levels: &[u8]) -> u8 {
    levels.iter().copied().reduce(u8::min).unwrap_or(0)
}

/// The settings of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Which of the two algorithms to run.
    pub variant: Variant,
    /// Jones' ε: a rectangle is only potentially optimal if it could improve on the best value by ε·|best value|.
    /// It keeps the search from polishing a minimum it has already found. Must be finite and not negative.
    pub epsilon: f64,
    /// How many points may be evaluated, at least one. See [`Direct`](super::Direct) for what happens to the
    /// iteration that would exceed it.
    pub max_evaluations: usize,
    /// Whether an iteration divides the smallest of the chosen rectangles first, as NLopt does, instead of the largest, as
    /// Gablonsky's code does. It matters to the iteration that the budget cuts short, whose last samples then lie around
    /// the best point, and to the order of ties.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub smallest_first: bool,
}

impl Default for Settings {
    /// The original algorithm with ε = 10⁻⁴, as in the paper, and a thousand evaluations, the largest rectangles first.
    fn default() -> Self {
        Self { variant: Variant::Original, epsilon: 1e-4, max_evaluations: 1_000, smallest_first: false }
    }
}

impl Settings {
    pub(super) fn check(&self) -> Result<(), DirectError> {
        if !(self.epsilon.is_finite() && self.epsilon >= 0.0) {
            return Err(DirectError::Epsilon(self.epsilon));
        }
        if self.max_evaluations == 0 {
            return Err(DirectError::NoEvaluations);
        }
        Ok(())
    }
}

/// A misuse of [`Direct`](super::Direct). The search is unchanged by a call that returns one.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DirectError {
    /// The cube has no dimension.
    #[error("a search needs at least one dimension")]
    NoDimension,
    /// The budget allows no evaluation at all.
    #[error("a search needs a budget of at least one evaluation")]
    NoEvaluations,
    /// ε is negative or not finite.
    #[error("epsilon must be finite and not negative, not {0}")]
    Epsilon(f64),
    /// Values were told that had not been asked for.
    #[error("values told without asking for points first")]
    NotAsked,
    /// The number of values differs from the number of points asked.
    #[error("{asked} points were asked but {told} values told")]
    ValueCount {
        /// Points in the batch.
        asked: usize,
        /// Values handed over.
        told: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_original_size_is_the_distance_from_centre_to_corner() {
        for levels in [[0, 0, 0], [1, 0, 1], [1, 1, 1], [4, 5, 4]] {
            let corner = levels.map(|level| 0.5 * ternary::side(level));
            let expected = corner.iter().map(|half| half * half).sum::<f64>().sqrt();
            let size = Variant::Original.size_of(&levels);
            assert!((size / expected - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn the_locally_biased_size_is_half_the_longest_side() {
        for (levels, expected) in [([0, 0], 0.5), ([1, 0], 0.5), ([1, 2], 0.5 / 3.0)] {
            assert_eq!(Variant::LocallyBiased.size_of(&levels), expected);
        }
    }

    #[test]
    fn variants_are_found_by_their_names() {
        for variant in [Variant::Original, Variant::LocallyBiased] {
            assert_eq!(Variant::named(variant.name()), Some(variant));
        }
        assert_eq!(Variant::named("DIRECT"), None);
    }

    #[test]
    fn sizes_shrink_from_class_to_class_down_to_the_deepest() {
        for variant in [Variant::Original, Variant::LocallyBiased] {
            let deepest = variant.class(&[ternary::MAX_LEVEL; 5]);
            let sizes: Vec<f64> = (0..=deepest).map(|class| variant.size(class, 5)).collect();
            assert!(sizes.is_sorted_by(|larger, smaller| larger > smaller));
        }
    }
}
