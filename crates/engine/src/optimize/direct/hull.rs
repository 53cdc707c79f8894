//! Which rectangles could hold the minimum, for some rate of change of the objective.

use serde::{Deserialize, Serialize};

/// A vertex of the lower right convex hull of the (size, value) points of all rectangles: the figure by which
/// Jones, Perttunen and Stuckman explain the method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HullPoint {
    /// The rectangle behind the point, as numbered in the [`Division`](super::Division).
    pub rectangle: usize,
    /// Its size.
    pub size: f64,
    /// Its value: that of its centre, or the surrogate of an infeasible one.
    pub value: f64,
    /// Whether the vertex passed the ε test, so that the rectangle is potentially optimal.
    pub potentially_optimal: bool,
}

/// Reduces the best point of each size, handed in from the largest size to the smallest, to the lower right hull
/// in the same order, and applies the ε test against the `best` value known.
///
/// A rectangle j of size dⱼ and value fⱼ is potentially optimal if a K > 0 exists with
///
/// ```text
/// fⱼ − K dⱼ ≤ fᵢ − K dᵢ          for every rectangle i,
/// fⱼ − K dⱼ ≤ fmin − ε |fmin|.
/// ```
///
/// The first line says that the point lies on the hull; the second is easiest to meet for the largest such K,
/// which is the slope to the next larger vertex, and infinite for the largest one. Points in the interior of an
/// edge count as vertices, and a point is off the hull if a larger rectangle has the same value.
pub fn lower_right_hull(points: impl Iterator<Item = HullPoint>, best: f64, epsilon: f64, hull: &mut Vec<HullPoint>) {
    hull.clear();
    for point in points {
        if hull.last().is_some_and(|larger| point.value >= larger.value) {
            continue;
        }
        while let [.., largest, middle] = hull[..]
            && slope(point, middle) > slope(middle, largest)
        {
            hull.pop();
        }
        hull.push(point);
    }
    let target = best - epsilon * best.abs();
    let mut larger = None;
    for point in hull {
        let rate = larger.map_or(f64::INFINITY, |larger| slope(*point, larger));
        point.potentially_optimal = point.value - rate * point.size <= target;
        larger = Some(*point);
    }
}

fn slope(smaller: HullPoint, larger: HullPoint) -> f64 {
    (larger.value - smaller.value) / (larger.size - smaller.size)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hull(points: &[(f64, f64)], epsilon: f64) -> Vec<(usize, bool)> {
        let best = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        let points = points.iter().enumerate().map(|(rectangle, &(size, value))| HullPoint {
            rectangle,
            size,
            value,
            potentially_optimal: false,
        });
        let mut hull = Vec::new();
        lower_right_hull(points, best, epsilon, &mut hull);
        hull.iter().map(|point| (point.rectangle, point.potentially_optimal)).collect()
    }

    #[test]
    fn keeps_the_convex_chain_from_the_largest_to_the_lowest_point() {
        let points = [(8.0, 10.0), (6.0, 9.5), (4.0, 3.0), (3.0, 2.9), (2.0, 1.0), (1.0, 5.0)];
        assert_eq!(hull(&points, 0.0), [(0, true), (2, true), (4, true)]);
    }

    #[test]
    fn keeps_points_in_the_interior_of_an_edge() {
        assert_eq!(hull(&[(3.0, 3.0), (2.0, 2.0), (1.0, 1.0)], 0.0), [(0, true), (1, true), (2, true)]);
    }

    #[test]
    fn of_two_equal_values_only_the_larger_rectangle_counts() {
        assert_eq!(hull(&[(3.0, 1.0), (2.0, 1.0)], 0.0), [(0, true)]);
    }

    #[test]
    fn the_epsilon_test_rejects_the_small_end_first() {
        let points = [(3.0, 3.0), (2.0, 1.0), (1.0, 0.9)];
        assert_eq!(hull(&points, 0.0), [(0, true), (1, true), (2, true)]);
        assert_eq!(hull(&points, 0.5), [(0, true), (1, true), (2, false)]);
    }
}
