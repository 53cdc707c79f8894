//! The points that a search asks for at a time.

use super::partition::Rectangles;

/// Points to evaluate, all of which may be evaluated at once.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    rectangles: &'a Rectangles,
    /// The rectangles that the points divide.
    dividing: &'a [usize],
    centres: &'a [f64],
}

/// The points that divide one rectangle: two on every longest side i, c + 3⁻ˡ⁻¹ eᵢ and c − 3⁻ˡ⁻¹ eᵢ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoordinatePerturbations<'a> {
    /// c, the rectangle's centre, whose value has been told.
    pub centre: &'a [f64],
    sides: &'a [usize],
    points: &'a [f64],
}

impl PartialEq for Batch<'_> {
    /// Whether the points are the same.
    fn eq(&self, other: &Self) -> bool {
        self.rectangles.dimension == other.rectangles.dimension && self.centres == other.centres
    }
}

impl<'a> Batch<'a> {
    pub(super) fn new(rectangles: &'a Rectangles, dividing: &'a [usize], centres: &'a [f64]) -> Self {
        Self { rectangles, dividing, centres }
    }

    /// How many points there are: one at least.
    #[expect(clippy::len_without_is_empty, reason = "a batch is never empty")]
    pub fn len(&self) -> usize {
        self.centres.len() / self.rectangles.dimension
    }

    /// The points in the order in which their values are to be told.
    pub fn iter(&self) -> std::slice::ChunksExact<'a, f64> {
        self.centres.chunks_exact(self.rectangles.dimension)
    }

    /// The same by the rectangle that they divide; the cube's centre, which is asked for first, divides none.
    pub fn perturbations(&self) -> impl ExactSizeIterator<Item = CoordinatePerturbations<'a>> + use<'a> {
        let Self { rectangles, dividing, centres } = *self;
        let (mut left, mut sides_left) = (centres, &rectangles.sides[..]);
        dividing.iter().map(move |&rectangle| {
            let (sides, other_sides) = sides_left.split_at(rectangles.long_sides(rectangle));
            let (points, others) = left.split_at(2 * sides.len() * rectangles.dimension);
            (left, sides_left) = (others, other_sides);
            CoordinatePerturbations { centre: rectangles.centre(rectangle), sides, points }
        })
    }
}

impl<'a> CoordinatePerturbations<'a> {
    /// How many points there are: two at least.
    #[expect(clippy::len_without_is_empty, reason = "every rectangle that is divided has a longest side")]
    pub fn len(&self) -> usize {
        2 * self.sides.len()
    }

    /// The points in the order of the batch.
    pub fn points(&self) -> std::slice::ChunksExact<'a, f64> {
        self.points.chunks_exact(self.centre.len())
    }

    /// The same: in which coordinate each differs from the centre, and what it is there.
    pub fn rays(&self) -> impl Iterator<Item = (usize, f64)> {
        self.sides.iter().flat_map(|&side| [side; 2]).zip(self.points()).map(|(side, point)| (side, point[side]))
    }
}

impl<'a> IntoIterator for Batch<'a> {
    type Item = &'a [f64];
    type IntoIter = std::slice::ChunksExact<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, Settings};

    /// Perturbations say in other words which points the batch has.
    #[test]
    fn stars_are_the_points_of_the_batch() {
        let mut direct = Direct::new(4, Settings { max_evaluations: 400, ..Settings::default() }).expect("valid");
        let mut batches = 0;
        while let Some(batch) = direct.ask() {
            let of_one = |perturbation: super::CoordinatePerturbations<'_>| {
                let replaced = |(side, x): (usize, f64)| {
                    let mut point = perturbation.centre.to_vec();
                    point[side] = x;
                    point
                };
                perturbation.rays().map(replaced).collect::<Vec<_>>()
            };
            let points: Vec<Vec<f64>> = batch.perturbations().flat_map(of_one).collect();
            let asked: Vec<Vec<f64>> = batch.iter().map(<[f64]>::to_vec).collect();
            assert_eq!(points, if batches == 0 { Vec::new() } else { asked });
            let values: Vec<f64> = batch.iter().map(|x| x.iter().map(|x| (x - 0.4).powi(2)).sum()).collect();
            direct.tell(&values).expect("as many");
            batches += 1;
        }
        assert!(batches > 5);
    }
}
