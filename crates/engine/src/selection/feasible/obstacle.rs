//! Boxes that a robot must keep out of.

use nalgebra::{Point3, Vector3};

/// A box with its sides along the axes of the frame of the nominal base, metres. Its faces belong to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// What it is called.
    pub name: String,
    /// Its corner of the least coordinates.
    pub lower: Point3<f64>,
    /// Its corner of the greatest coordinates.
    pub upper: Point3<f64>,
}

impl Obstacle {
    /// Whether a point is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|side| (self.lower[side]..=self.upper[side]).contains(&point[side]))
    }

    /// Whether the segment between two points meets the box, exactly: the part of it that is between each pair of opposite
    /// faces is cut out, pair by pair, until nothing is left (Liang and Barsky 1984).
    pub fn meets(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let along: Vector3<f64> = to - from;
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for side in 0..3 {
            let (below, above) = (self.lower[side] - from[side], self.upper[side] - from[side]);
            if along[side] == 0.0 {
                if below > 0.0 || above < 0.0 {
                    return false;
                }
                continue;
            }
            let (first, last) = (below / along[side], above / along[side]);
            enters = enters.max(first.min(last));
            leaves = leaves.min(first.max(last));
        }
        enters <= leaves
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unit_box() -> Obstacle {
        Obstacle { name: "box".to_owned(), lower: Point3::new(0.0, 0.0, 0.0), upper: Point3::new(1.0, 2.0, 3.0) }
    }

    #[test]
    fn segments_along_its_sides_are_told_exactly() {
        let meets = |from: [f64; 3], to: [f64; 3]| unit_box().meets(&Point3::from(from), &Point3::from(to));
        assert!(meets([-1.0, 1.0, 1.0], [2.0, 1.0, 1.0]), "through it");
        assert!(meets([0.5, 0.5, 0.5], [0.6, 0.5, 0.5]), "inside");
        assert!(meets([0.5, 0.5, 0.5], [0.5, 0.5, 0.5]), "a point inside");
        assert!(meets([-1.0, 0.0, 3.0], [2.0, 0.0, 3.0]), "along an edge");
        assert!(meets([-1.0, 1.0, 1.0], [0.0, 1.0, 1.0]), "up to a face");
        assert!(!meets([-1.0, 1.0, 1.0], [-0.001, 1.0, 1.0]), "short of a face");
        assert!(!meets([-0.6, 0.5, 1.0], [0.5, -0.6, 1.0]), "past an edge");
        assert!(!meets([2.0, 1.0, 1.0], [3.0, 1.0, 1.0]), "behind it");
    }

    proptest! {
        /// Against many points of the segment: what meets the box has a point inside, or comes nearer than the steps are long.
        #[test]
        fn is_what_points_of_the_segment_say(
            from in prop::array::uniform3(-2.0..4.0_f64),
            to in prop::array::uniform3(-2.0..4.0_f64),
        ) {
            let (from, to, one) = (Point3::from(from), Point3::from(to), unit_box());
            let points = (0..=1000).map(|k| from + (to - from) * (f64::from(k) / 1000.0));
            let nearest = points.map(|point| {
                (0..3).map(|side| (one.lower[side] - point[side]).max(point[side] - one.upper[side]).max(0.0)).sum::<f64>()
            }).fold(f64::INFINITY, f64::min);
            let step = (to - from).abs().sum() / 1000.0;
            if one.meets(&from, &to) {
                prop_assert!(nearest <= step);
            } else {
                prop_assert!(nearest > 0.0);
            }
        }
    }
}
