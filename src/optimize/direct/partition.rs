//! The rectangles: how they are stored, and the view others have of them.

use serde::Serialize;

use super::settings::Variant;
use super::ternary::{self, MAX_LEVEL};

/// All rectangles, field by field. One whose value has not been told yet has a centre and levels but no more.
#[derive(Debug, Clone)]
pub struct Rectangles {
    pub dimension: usize,
    pub centres: Vec<f64>,
    pub levels: Vec<u8>,
    /// Of the longest sides: their level, and how many there are. The others are one level deeper.
    longest: Vec<(u8, u32)>,
    /// `None` where the centre is infeasible.
    pub values: Vec<Option<f64>>,
    /// The value, or the surrogate of an infeasible centre, or infinity where it has none.
    pub scores: Vec<f64>,
    pub generations: Vec<usize>,
    /// The round of selection in which the rectangle was last chosen.
    pub chosen: Vec<usize>,
}

impl Rectangles {
    /// The undivided cube, its centre not evaluated yet, with room for so many rectangles.
    pub fn cube(dimension: usize, room: usize) -> Self {
        let (mut centres, mut levels) = (Vec::with_capacity(room * dimension), Vec::with_capacity(room * dimension));
        centres.resize(dimension, 0.5);
        levels.resize(dimension, 0);
        let (values, scores) = (Vec::with_capacity(room), Vec::with_capacity(room));
        let (generations, chosen) = (Vec::with_capacity(room), Vec::with_capacity(room));
        let mut longest = Vec::with_capacity(room);
        longest.push((0, dimension as u32));
        Self { dimension, centres, levels, longest, values, scores, generations, chosen }
    }

    /// How many values have been told.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// How many centres wait for a value.
    pub fn pending(&self) -> usize {
        self.centres.len() / self.dimension - self.len()
    }

    pub fn centre(&self, rectangle: usize) -> &[f64] {
        &self.centres[rectangle * self.dimension..][..self.dimension]
    }

    pub fn levels(&self, rectangle: usize) -> &[u8] {
        &self.levels[rectangle * self.dimension..][..self.dimension]
    }

    /// The trisection level of the longest sides.
    pub fn longest(&self, rectangle: usize) -> u8 {
        self.longest[rectangle].0
    }

    /// How many sides of a rectangle are longest, and so would be trisected.
    pub fn long_sides(&self, rectangle: usize) -> usize {
        self.longest[rectangle].1 as usize
    }

    /// The size class of a rectangle: as [`Variant::class`] says of its levels.
    pub fn class(&self, rectangle: usize, variant: Variant) -> usize {
        let (longest, count) = self.longest[rectangle];
        match variant {
            Variant::Original => self.dimension * (usize::from(longest) + 1) - count as usize,
            Variant::LocallyBiased => usize::from(longest),
        }
    }

    /// Whether the rectangle has a side left to divide.
    pub fn divisible(&self, rectangle: usize) -> bool {
        self.longest(rectangle) < MAX_LEVEL
    }

    /// Appends the centres that a division of `parent` samples: c ± 3⁻ˡ⁻¹ eᵢ for every longest side i in turn, plus
    /// before minus. Their levels are the parent's until their values decide who gets which.
    pub fn sample_around(&mut self, parent: usize) {
        let first = parent * self.dimension;
        let level = self.longest(parent);
        for side in 0..self.dimension {
            if self.levels[first + side] != level {
                continue;
            }
            for coordinate in ternary::thirds(self.centres[first + side], level) {
                let child = self.centres.len();
                self.centres.extend_from_within(first..first + self.dimension);
                self.centres[child + side] = coordinate;
                self.levels.extend_from_within(first..first + self.dimension);
                self.longest.push(self.longest[parent]);
            }
        }
    }

    /// Records the value of the next centre in line.
    pub fn record(&mut self, value: Option<f64>, generation: usize) {
        self.values.push(value);
        self.scores.push(value.unwrap_or(f64::INFINITY));
        self.generations.push(generation);
        self.chosen.push(0);
    }

    /// Cuts `parent` along its longest sides into itself and the children from `first_child` on, whose values are
    /// known by now, and returns how many they are.
    ///
    /// Each side is ranked by the lower of its two children's scores; the parent is cut along the best side first,
    /// so that the best children keep the largest rectangles. Sides that tie are cut in the order of coordinates.
    pub fn divide(&mut self, parent: usize, first_child: usize, ranking: &mut Vec<(f64, usize, usize)>) -> usize {
        let longest = self.longest(parent);
        ranking.clear();
        for side in 0..self.dimension {
            if self.levels(parent)[side] == longest {
                let child = first_child + 2 * ranking.len();
                ranking.push((self.scores[child].min(self.scores[child + 1]), child, side));
            }
        }
        ranking.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (rank, &(_, _, side)) in ranking.iter().enumerate() {
            self.levels[parent * self.dimension + side] += 1;
            for &(_, child, _) in &ranking[rank..] {
                self.levels[child * self.dimension + side] += 1;
                self.levels[(child + 1) * self.dimension + side] += 1;
            }
        }
        // Who is cut along every longest side has all sides alike.
        let alike = (longest + 1, self.dimension as u32);
        for (rank, &(_, child, _)) in ranking.iter().enumerate() {
            let left = (ranking.len() - rank - 1) as u32;
            self.longest[child..child + 2].fill(if left > 0 { (longest, left) } else { alike });
        }
        self.longest[parent] = alike;
        2 * ranking.len()
    }
}

/// The rectangles into which the unit cube is divided: they overlap in faces only and fill it completely.
///
/// A rectangle keeps its number and its centre for good, while its sides shrink. Numbers follow the order in which
/// the centres were asked for.
#[derive(Debug, Clone, Copy)]
pub struct Partition<'a> {
    pub(super) rectangles: &'a Rectangles,
    pub(super) variant: Variant,
    pub(super) round: usize,
    pub(super) remote: f64,
}

/// One rectangle of a [`Partition`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rectangle<'a> {
    /// Its centre, where the objective was evaluated.
    pub centre: &'a [f64],
    /// How often each side was trisected: side i is 3^−levels\[i\] long. They differ by one at most.
    pub levels: &'a [u8],
    /// The objective at the centre, `None` if infeasible.
    pub value: Option<f64>,
    /// What the search goes by: the value or, for an infeasible centre, its surrogate. `None` as long as no
    /// feasible point is known at all.
    pub score: Option<f64>,
    /// The size the search goes by, which depends on the [`Variant`].
    pub size: f64,
    /// The iteration that gave the rectangle its present shape. It is 0 for the undivided cube.
    pub generation: usize,
    /// Whether the search has chosen it to be divided next.
    pub potentially_optimal: bool,
}

impl<'a> Partition<'a> {
    /// How many rectangles there are: as many as values told.
    pub fn len(&self) -> usize {
        self.rectangles.len()
    }

    /// Whether no value has been told yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rectangle of that number, if there is one.
    pub fn get(&self, index: usize) -> Option<Rectangle<'a>> {
        (index < self.len()).then(|| self.rectangle(index))
    }

    /// All rectangles in order of their numbers.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Rectangle<'a>> + use<'a> {
        let partition = *self;
        (0..self.len()).map(move |index| partition.rectangle(index))
    }

    fn rectangle(&self, index: usize) -> Rectangle<'a> {
        let all = self.rectangles;
        let levels = all.levels(index);
        let score = all.scores[index].min(self.remote);
        Rectangle {
            centre: all.centre(index),
            levels,
            value: all.values[index],
            score: score.is_finite().then_some(score),
            size: self.variant.size_of(levels),
            generation: all.generations[index],
            potentially_optimal: all.chosen[index] == self.round,
        }
    }
}

impl Rectangle<'_> {
    /// Half the length of each side: ½·3^−level, correctly rounded.
    pub fn half_sides(&self) -> impl ExactSizeIterator<Item = f64> {
        self.levels.iter().map(|&level| 0.5 * ternary::side(level))
    }

    /// The volume: 3 to the minus sum of the levels. Zero once it is too small for an `f64`.
    pub fn volume(&self) -> f64 {
        self.levels.iter().map(|&level| ternary::side(level)).product()
    }
}
