//! The rectangles: how they are stored, and the view others have of them.

use std::ops::Range;

use super::settings::Variant;
use super::ternary::{self, MAX_LEVEL};

/// Levels for which there is room from the beginning.
const LEVELS: usize = 8;

/// All rectangles. One whose value has not been told yet has a centre but no more, one that has not been cut out of its
/// parent no levels.
#[derive(Debug, Clone)]
pub struct Rectangles {
    pub dimension: usize,
    pub centres: Vec<f64>,
    /// Levels at birth, which are those of now until a rectangle is divided and has all sides alike.
    birth_levels: Vec<u8>,
    /// 0, …, 0, 1, …, 1, …: the levels of rectangles that have all sides alike.
    levels_alike: Vec<u8>,
    pub records: Vec<Record>,
    /// The sides along which the last rectangles to be sampled around are cut: each gives two children, the last ones.
    pub sides: Vec<usize>,
    /// Those of the rectangle that is being cut: the lower of the two children's scores, and the number of the side.
    ranking: Vec<(f64, usize)>,
}

/// What is known of a rectangle whose value has been told.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    /// The value, or the surrogate of an infeasible centre, or infinity where it has none.
    pub score: f64,
    /// Whether the centre is feasible.
    is_feasible: bool,
    /// The iteration that gave it its present shape.
    pub generation: usize,
    /// The round of selection in which it was last chosen.
    pub chosen: usize,
    /// Who was divided for it; the cube is its own parent.
    pub parent: usize,
    /// The level of the longest sides; the others are one level deeper.
    longest: u8,
    /// How many sides are longest.
    long_sides: u32,
}

impl Record {
    /// `None` where the centre is infeasible.
    pub fn value(&self) -> Option<f64> {
        self.is_feasible.then_some(self.score)
    }

    /// The size class: as [`Variant::class`] says of its levels.
    pub fn class(&self, dimension: usize, variant: Variant) -> usize {
        match variant {
            Variant::Original => dimension * (usize::from(self.longest) + 1) - self.long_sides as usize,
            Variant::LocallyBiased => usize::from(self.longest),
        }
    }

    /// Whether all sides are longest, as those of a rectangle that has been divided.
    fn has_sides_alike(&self, dimension: usize) -> bool {
        self.long_sides as usize == dimension
    }

    /// Whether there is a side left to divide.
    pub fn is_divisible(&self) -> bool {
        self.longest < MAX_LEVEL
    }
}

impl Rectangles {
    /// The undivided cube, its centre not evaluated yet, with room for so many rectangles.
    pub fn cube(dimension: usize, room: usize) -> Self {
        let mut centres = Vec::with_capacity(room * dimension);
        centres.resize(dimension, 0.5);
        let (mut birth_levels, mut levels_alike) =
            (Vec::with_capacity(room * dimension), Vec::with_capacity(LEVELS * dimension));
        birth_levels.resize(dimension, 0);
        levels_alike.resize(dimension, 0);
        let (sides, ranking) = (Vec::with_capacity(4 * dimension), Vec::with_capacity(dimension));
        let records = Vec::with_capacity(room);
        Self { dimension, centres, birth_levels, levels_alike, records, sides, ranking }
    }

    /// How many values have been told.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// How many centres wait for a value.
    pub fn pending(&self) -> usize {
        self.centres.len() / self.dimension - self.len()
    }

    pub fn centre(&self, rectangle: usize) -> &[f64] {
        &self.centres[rectangle * self.dimension..][..self.dimension]
    }

    /// How often each side has been trisected.
    pub fn levels(&self, rectangle: usize) -> &[u8] {
        let record = &self.records[rectangle];
        if record.has_sides_alike(self.dimension) {
            &self.levels_alike[usize::from(record.longest) * self.dimension..][..self.dimension]
        } else {
            self.birth_levels(rectangle)
        }
    }

    /// The same when the rectangle was cut out of its parent.
    pub fn birth_levels(&self, rectangle: usize) -> &[u8] {
        &self.birth_levels[rectangle * self.dimension..][..self.dimension]
    }

    /// How many sides of a rectangle are longest, and so would be trisected.
    pub fn long_sides(&self, rectangle: usize) -> usize {
        self.records[rectangle].long_sides as usize
    }

    /// The size class of a rectangle.
    pub fn class(&self, rectangle: usize, variant: Variant) -> usize {
        self.records[rectangle].class(self.dimension, variant)
    }

    /// Appends the centres that a division of `parent` samples: c ± 3⁻ˡ⁻¹ eᵢ for every longest side i in turn, plus
    /// before minus.
    pub fn sample_around(&mut self, parent: usize) {
        let (dimension, record) = (self.dimension, self.records[parent]);
        let centre = parent * dimension;
        let (first, first_side) = (self.centres.len(), self.sides.len());
        repeat(&mut self.centres, centre..centre + dimension, 2 * record.long_sides as usize);
        let (alike, levels) = (record.has_sides_alike(dimension), &self.birth_levels[centre..centre + dimension]);
        self.sides.extend((0..dimension).filter(|&side| alike || levels[side] == record.longest));
        let (known, children) = self.centres.split_at_mut(first);
        for (&side, pair) in self.sides[first_side..].iter().zip(children.chunks_exact_mut(2 * dimension)) {
            [pair[side], pair[dimension + side]] = ternary::thirds(known[centre + side], record.longest);
        }
    }

    /// Records the values of the next centres in line; one that is not finite marks an infeasible centre.
    pub fn record(&mut self, values: &[f64], generation: usize) {
        let long_sides = self.dimension as u32;
        self.records.extend(values.iter().map(|value| {
            let is_feasible = value.is_finite();
            // Adding zero turns −0 into +0, which would otherwise sort apart.
            let score = if is_feasible { value + 0.0 } else { f64::INFINITY };
            Record { score, is_feasible, generation, chosen: 0, parent: 0, longest: 0, long_sides }
        }));
    }

    /// Cuts `parent` along its longest sides into itself and the children from `first_child` on, who are next in line, whose
    /// values are known by now, and returns who they are.
    ///
    /// Each side is ranked by the lower of its two children's scores; the parent is cut along the best side first,
    /// so that the best children keep the largest rectangles. Sides that tie are cut in the order of coordinates.
    pub fn divide(&mut self, parent: usize, first_child: usize) -> Range<usize> {
        let Self { dimension, birth_levels, levels_alike, records, sides, ranking, .. } = self;
        let (dimension, Record { longest, long_sides, .. }) = (*dimension, records[parent]);
        let children = first_child..first_child + 2 * long_sides as usize;
        let sides = &sides[sides.len() - (records.len() - first_child) / 2..];
        ranking.clear();
        let pairs = records[children.clone()].chunks_exact(2).enumerate();
        ranking.extend(pairs.map(|(number, pair)| (pair[0].score.min(pair[1].score), number)));
        ranking.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Who is cut along every longest side has all sides alike; a child lacks the cuts that come after its own.
        let divided = longest + 1;
        if levels_alike.len() <= usize::from(divided) * dimension {
            levels_alike.resize(levels_alike.len() + dimension, divided);
        }
        birth_levels.resize(children.end * dimension, divided);
        (records[parent].longest, records[parent].long_sides) = (divided, dimension as u32);
        for (rank, (_, side)) in ranking.iter().enumerate() {
            let child = first_child + 2 * side;
            let later = &ranking[rank + 1..];
            let (plus, minus) = birth_levels[child * dimension..][..2 * dimension].split_at_mut(dimension);
            for (_, side) in later {
                let side = sides[*side];
                (plus[side], minus[side]) = (longest, longest);
            }
            let of_longest = if later.is_empty() { (divided, dimension as u32) } else { (longest, later.len() as u32) };
            for record in &mut records[child..child + 2] {
                record.parent = parent;
                (record.longest, record.long_sides) = of_longest;
            }
        }
        children
    }
}

/// Appends part of a buffer to it so many times.
fn repeat<T: Copy>(buffer: &mut Vec<T>, part: Range<usize>, times: usize) {
    let (begin, length) = (buffer.len(), part.len());
    let end = begin + times * length;
    buffer.reserve(end - begin);
    buffer.extend_from_within(part);
    while buffer.len() < end {
        buffer.extend_from_within(begin..buffer.len().min(begin + end - buffer.len()));
    }
}

/// The rectangles into which the unit cube is divided: they overlap in faces only and fill it completely.
///
/// A rectangle keeps its number and its centre for good, while its sides shrink. Numbers follow the order in which
/// the centres were asked for.
#[derive(Debug, Clone, Copy)]
pub struct Division<'a> {
    pub(super) rectangles: &'a Rectangles,
    pub(super) variant: Variant,
    pub(super) round: usize,
    pub(super) remote: f64,
}

/// One rectangle of a [`Division`].
#[derive(Debug, Clone, Copy, PartialEq)]
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

impl<'a> Division<'a> {
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
        let record = all.records[index];
        let score = record.score.min(self.remote);
        Rectangle {
            centre: all.centre(index),
            levels,
            value: record.value(),
            score: score.is_finite().then_some(score),
            size: self.variant.size_of(levels),
            generation: record.generation,
            potentially_optimal: record.chosen == self.round,
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
