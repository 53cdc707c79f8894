//! Pictures of a partition: what a plane along two axes of the cube shows of its rectangles.

use std::cmp::Reverse;

use super::ternary;

/// A plane along two axes of the unit cube; along the only one where there is but one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plane {
    /// The axis drawn to the right.
    pub x: usize,
    /// The axis drawn upwards; `None` in one dimension.
    pub y: Option<usize>,
}

/// A rectangle as it lies in the unit square of a [`Plane`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Its centre.
    pub centre: [f64; 2],
    /// Half the length of each side.
    pub half: [f64; 2],
}

impl Plane {
    /// The two axes along which rectangles of these levels are divided most, in their order; the first ones of a tie.
    /// `None` without any rectangle.
    pub fn most_divided<'a>(rectangles: impl IntoIterator<Item = &'a [u8]>) -> Option<Self> {
        let mut divisions = Vec::new();
        for levels in rectangles {
            divisions.resize(levels.len().max(divisions.len()), 0_u64);
            divisions.iter_mut().zip(levels).for_each(|(sum, level)| *sum += u64::from(*level));
        }
        let mut axes: Vec<usize> = (0..divisions.len()).collect();
        axes.sort_by_key(|axis| Reverse(divisions[*axis]));
        axes.truncate(2);
        axes.sort_unstable();
        Some(Self { x: *axes.first()?, y: axes.get(1).copied() })
    }

    /// Its axes: `x` and, where there is one, `y`.
    pub fn axes(self) -> impl Iterator<Item = usize> {
        [self.x].into_iter().chain(self.y)
    }

    /// The rectangle of this centre and these levels, seen at right angles to the plane. In one dimension it fills the
    /// height of the square.
    ///
    /// # Panics
    ///
    /// If the rectangle has fewer axes than the plane, or a level above [`MAX_LEVEL`](super::MAX_LEVEL).
    pub fn project(self, centre: &[f64], levels: &[u8]) -> Projection {
        let along = |axis: usize| (centre[axis], 0.5 * ternary::side(levels[axis]));
        let ((x, half_x), (y, half_y)) = (along(self.x), self.y.map_or((0.5, 0.5), along));
        Projection { centre: [x, y], half: [half_x, half_y] }
    }

    /// Whether the plane, laid through `point`, cuts the rectangle of this centre and these levels: along all other
    /// axes it contains the point, borders included.
    ///
    /// # Panics
    ///
    /// If point or levels have fewer coordinates than the centre, or a level is above [`MAX_LEVEL`](super::MAX_LEVEL).
    pub fn cuts(self, centre: &[f64], levels: &[u8], point: &[f64]) -> bool {
        (0..centre.len())
            .filter(|&axis| axis != self.x && Some(axis) != self.y)
            .all(|axis| spans(centre[axis], levels[axis], point[axis]))
    }
}

/// Whether the rectangle of this centre and these levels contains a point of the cube, borders included.
///
/// # Panics
///
/// If a level is above [`MAX_LEVEL`](super::MAX_LEVEL).
pub fn contains(centre: &[f64], levels: &[u8], point: &[f64]) -> bool {
    centre.iter().zip(levels).zip(point).all(|((centre, level), x)| spans(*centre, *level, *x))
}

fn spans(centre: f64, level: u8, x: f64) -> bool {
    /// Forgives rounding, far less than any other rectangle is away.
    const SLACK: f64 = 1.0 + 1e-9;
    (centre - x).abs() <= 0.5 * ternary::side(level) * SLACK
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::{Direct, Settings};

    /// The rectangles that a plane through the best centre cuts fill its square, without overlap.
    #[test]
    fn what_a_plane_cuts_fills_its_square() {
        for dimension in [1, 2, 3, 4] {
            let mut search = Direct::new(dimension, Settings { max_evaluations: 150, ..Settings::default() }).unwrap();
            while let Some(batch) = search.ask() {
                let cost = |x: &[f64]| x.iter().zip(1..).map(|(x, i)| (x - 0.3).powi(2) * f64::from(i)).sum();
                let values: Vec<f64> = batch.iter().map(cost).collect();
                search.tell(&values).unwrap();
            }
            let (point, _) = search.best().expect("values were told");
            let partition = search.partition();
            let plane = Plane::most_divided(partition.iter().map(|rectangle| rectangle.levels)).expect("rectangles");
            let cut = partition.iter().filter(|one| plane.cuts(one.centre, one.levels, point));
            let area: f64 = cut
                .map(|one| plane.project(one.centre, one.levels).half)
                .map(|[half_x, half_y]| 4.0 * half_x * half_y)
                .sum();
            assert!((area - 1.0).abs() < 1e-12, "{dimension}: {area}");
        }
    }

    #[test]
    fn the_axes_divided_most_are_shown_in_their_order() {
        let plane = |levels: &[[u8; 3]]| Plane::most_divided(levels.iter().map(<[u8; 3]>::as_slice));
        assert_eq!(plane(&[[1, 2, 2], [0, 0, 1]]), Some(Plane { x: 1, y: Some(2) }));
        assert_eq!(plane(&[[2, 0, 1], [2, 0, 3]]), Some(Plane { x: 0, y: Some(2) }));
        assert_eq!(plane(&[[1, 1, 1]]), Some(Plane { x: 0, y: Some(1) }));
        assert_eq!(plane(&[]), None);
        assert_eq!(Plane::most_divided([[3].as_slice()]), Some(Plane { x: 0, y: None }));
    }
}
