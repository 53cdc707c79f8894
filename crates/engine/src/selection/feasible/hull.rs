//! Convex parts of a robot, and how far they are apart.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// A convex part of a robot: the hull of points, and all that is within a radius of it. A ball is one point, a capsule are two.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    /// What people call it.
    pub name: String,
    /// The link that carries it: 0 for the base, i + 1 behind the i-th joint.
    pub link: usize,
    /// At θ = 0 in the frame of the base, metres; one at least.
    points: Vec<Point3<f64>>,
    /// A point on another link, if the part is drawn out between the two as by a joint that slides.
    start: Option<(usize, Point3<f64>)>,
    /// Metres.
    radius: f64,
    /// A ball around the points: its centre, and its radius in metres.
    ball: (Point3<f64>, f64),
}

impl Hull {
    /// The hull of `points`, at θ = 0 in the frame of the base, and all within `radius` (metres) of it. `None` without a point, and
    /// where one is not finite.
    pub fn new(name: String, link: usize, points: Vec<Point3<f64>>, radius: f64) -> Option<Self> {
        let is_finite = points.iter().flat_map(|point| point.iter()).chain([&radius]).all(|number| number.is_finite());
        let first = points.first().filter(|_| is_finite)?;
        let (lower, upper) =
            points.iter().fold((*first, *first), |(lower, upper), point| (lower.inf(point), upper.sup(point)));
        let centre = nalgebra::center(&lower, &upper);
        let reach = points.iter().map(|point| (point - centre).norm()).fold(0.0, f64::max);
        Some(Self { name, link, points, start: None, radius, ball: (centre, reach) })
    }

    /// The same, drawn out from a point on another link.
    pub(super) fn drawn_from(self, link: usize, at: Point3<f64>) -> Self {
        Self { start: Some((link, at)), ball: (self.ball.0, f64::INFINITY), ..self }
    }

    /// The point that is furthest in a direction, with the links of the robot here.
    fn furthest(&self, links: &[Isometry3<f64>], direction: &Vector3<f64>) -> Point3<f64> {
        let link = &links[self.link];
        let own = link.inverse_transform_vector(direction);
        let along = |point: &&Point3<f64>| point.coords.dot(&own);
        let furthest = self.points.iter().max_by(|a, b| along(a).total_cmp(&along(b)));
        let furthest = link * furthest.unwrap_or(&self.ball.0);
        let start = self.start.as_ref().map(|(link, at)| links[*link] * at);
        start.filter(|start| (start - furthest).dot(direction) > 0.0).unwrap_or(furthest)
    }

    /// The distance between two parts with the links of the robot here, metres: 0 where they meet. Where it is `enough` or more some
    /// distance is told that is also.
    ///
    /// The nearest point to the origin of the hull of all differences between their points, by the nearest point of a simplex of
    /// these at a time (Gilbert, Johnson, Keerthi 1988, doi 10.1109/56.2083).
    pub fn distance(&self, other: &Self, links: &[Isometry3<f64>], enough: f64) -> f64 {
        /// More than any two hulls of points need.
        const MOST_STEPS: usize = 64;
        let radii = self.radius + other.radius;
        let between = links[self.link] * self.ball.0 - links[other.link] * other.ball.0;
        let least = between.norm() - self.ball.1 - other.ball.1;
        if least - radii >= enough {
            return least - radii;
        }
        let mut simplex: Vec<Vector3<f64>> = Vec::with_capacity(4);
        let mut nearest = between;
        let mut is_inside = false;
        for _ in 0..MOST_STEPS {
            let next = self.furthest(links, &-nearest) - other.furthest(links, &nearest);
            // No difference is nearer to the origin than the plane through the one that is furthest towards it.
            let length = nearest.norm();
            let bound = next.dot(&nearest) / length;
            if bound - radii >= enough {
                return bound - radii;
            }
            // The first nearest point is of no simplex yet.
            if !simplex.is_empty() && (simplex.contains(&next) || bound >= length * (1.0 - 1e-12)) {
                break;
            }
            simplex.push(next);
            nearest = reduced(&mut simplex);
            is_inside = simplex.len() == 4 || nearest.norm() < 1e-12;
            if is_inside {
                break;
            }
        }
        if is_inside { 0.0 } else { (nearest.norm() - radii).max(0.0) }
    }
}

/// The point of a simplex of at most four corners that is nearest to the origin; corners that do not say it are left out. With four
/// left the origin is inside.
fn reduced(simplex: &mut Vec<Vector3<f64>>) -> Vector3<f64> {
    let count = simplex.len();
    let mut best: Option<(f64, Vector3<f64>, usize)> = None;
    for chosen in 1..1_usize << count {
        let mut corners = (0..count).filter(|corner| chosen >> corner & 1 == 1).map(|corner| simplex[corner]);
        let Some(first) = corners.next() else { continue };
        // Of an affine hull the point nearest to the origin: the edges times the weights of the corners behind the first.
        let mut edges = Matrix3::zeros();
        let mut sides = 0;
        for corner in corners {
            edges.set_column(sides, &(corner - first));
            sides += 1;
        }
        let mut gram = edges.tr_mul(&edges);
        (sides..3).for_each(|side| gram[(side, side)] = 1.0);
        let Some(inverse) = gram.try_inverse() else { continue };
        let weights = -(inverse * edges.tr_mul(&first));
        let is_within = weights.iter().take(sides).all(|weight| *weight >= 0.0) && weights.sum() <= 1.0;
        let point = first + edges * weights;
        let distance = point.norm_squared();
        if is_within && best.is_none_or(|(least, ..)| distance < least) {
            best = Some((distance, point, chosen));
        }
    }
    let Some((_, point, chosen)) = best else { return simplex[count - 1] };
    let mut corner = 0..;
    simplex.retain(|_| corner.next().is_some_and(|corner| chosen >> corner & 1 == 1));
    point
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;

    fn hull(points: &[[f64; 3]], radius: f64) -> Hull {
        Hull::new("part".to_owned(), 0, points.iter().copied().map(Point3::from).collect(), radius)
            .expect("finite points")
    }

    /// A box about the origin.
    fn cuboid(half: [f64; 3]) -> Hull {
        let corner = |index: usize| [0, 1, 2].map(|side| if index >> side & 1 == 1 { half[side] } else { -half[side] });
        hull(&(0..8).map(corner).collect::<Vec<_>>(), 0.0)
    }

    /// With the other at a pose.
    fn apart(one: &Hull, other: &Hull, pose: Isometry3<f64>) -> f64 {
        told(one, other, pose, f64::INFINITY)
    }

    fn told(one: &Hull, other: &Hull, pose: Isometry3<f64>, enough: f64) -> f64 {
        one.distance(&Hull { link: 1, ..other.clone() }, &[Isometry3::identity(), pose], enough)
    }

    #[test]
    fn known_distances() {
        let die = cuboid([1.0; 3]);
        let at = Isometry3::translation;
        assert!((apart(&die, &die, at(5.0, 0.5, 0.0)) - 3.0).abs() < 1e-9, "faces");
        assert!((apart(&die, &die, at(5.0, 5.0, 0.0)) - 3.0 * 2.0_f64.sqrt()).abs() < 1e-9, "edges");
        assert!((apart(&die, &die, at(-5.0, 5.0, 5.0)) - 3.0 * 3.0_f64.sqrt()).abs() < 1e-9, "corners");
        assert_eq!(apart(&die, &die, at(1.9, 0.1, 0.3)), 0.0, "one in the other");
        assert_eq!(apart(&die, &die, Isometry3::identity()), 0.0, "one at the other");
        assert_eq!(apart(&die, &hull(&[[0.2, 0.1, 0.3]], 0.1), Isometry3::identity()), 0.0, "a ball inside");
        assert!((apart(&die, &hull(&[[0.0; 3]], 0.25), at(0.0, 0.0, 3.0)) - 1.75).abs() < 1e-9, "a ball");
        assert!(Hull::new(String::new(), 0, Vec::new(), 0.0).is_none());
        assert!(Hull::new(String::new(), 0, vec![Point3::new(0.0, f64::NAN, 0.0)], 0.0).is_none());
    }

    /// Capsules lie beside one another, cross or touch.
    #[test]
    fn lines_without_volume() {
        let line = hull(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 0.0);
        let at = Isometry3::translation;
        assert!((apart(&line, &line, at(0.3, 0.0, 0.2)) - 0.2).abs() < 1e-9, "parallel");
        assert!((apart(&line, &line, at(2.5, 0.0, 0.0)) - 0.5).abs() < 1e-9, "in a row");
        let quarter = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let crossed = |z: f64| Isometry3::from_parts(Translation3::new(0.2, 0.1, z), quarter);
        assert!((apart(&line, &line, crossed(0.4)) - 0.4).abs() < 1e-9, "crosswise");
        assert!(apart(&line, &line, crossed(0.0)) < 1e-9, "crossing");
    }

    /// A rod that a joint draws out is as long as its ends are apart.
    #[test]
    fn a_part_between_two_links() {
        let end = Hull::new("rod".to_owned(), 1, vec![Point3::new(1.0, 0.0, 0.0)], 0.0).expect("a point");
        let rod = end.drawn_from(0, Point3::origin());
        let ball = Hull::new("ball".to_owned(), 0, vec![Point3::new(2.0, 0.5, 0.0)], 0.0).expect("a point");
        for (drawn, distance) in [(0.0, 1.25_f64.sqrt()), (0.5, 0.5_f64.sqrt()), (1.0, 0.5), (2.0, 0.5)] {
            let links = [Isometry3::identity(), Isometry3::translation(drawn, 0.0, 0.0)];
            assert!((rod.distance(&ball, &links, f64::INFINITY) - distance).abs() < 1e-9, "{drawn}");
        }
    }

    /// Bounds of the distance by a method that is slow and keeps no simplex: the nearest point on the way to the furthest difference, again
    /// and again (Gilbert 1966).
    fn bounds(one: &Hull, other: &Hull, pose: Isometry3<f64>) -> [f64; 2] {
        let links = [Isometry3::identity(), pose];
        let other = &Hull { link: 1, ..other.clone() };
        let mut nearest = one.points[0] - pose * other.points[0];
        let mut lower = 0.0_f64;
        for _ in 0..2000 {
            let next = one.furthest(&links, &-nearest) - other.furthest(&links, &nearest);
            lower = lower.max(next.dot(&nearest) / nearest.norm().max(1e-300));
            let way = next - nearest;
            let share = -nearest.dot(&way) / way.norm_squared().max(1e-300);
            nearest += way * share.clamp(0.0, 1.0);
        }
        [lower, nearest.norm()]
    }

    proptest! {
        /// Of corners on a grid many are in one plane, on one line, or one.
        #[test]
        fn flat_and_pointed_hulls_are_as_far_apart_as_a_slow_method_says(
            one in prop::collection::vec(prop::array::uniform3(-2_i8..=2), 1..10),
            other in prop::collection::vec(prop::array::uniform3(-2_i8..=2), 1..10),
            turns in 0_u8..4,
            shift in prop::array::uniform3(-6_i8..=6),
        ) {
            let on_grid = |corners: Vec<[i8; 3]>| {
                hull(&corners.iter().map(|corner| corner.map(f64::from)).collect::<Vec<_>>(), 0.0)
            };
            let (one, other) = (on_grid(one), on_grid(other));
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, f64::from(turns) * std::f64::consts::FRAC_PI_2);
            let pose = Isometry3::from_parts(Vector3::from(shift.map(f64::from)).into(), turn);
            let ([lower, upper], found) = (bounds(&one, &other, pose), apart(&one, &other, pose));
            prop_assert!(lower - 1e-9 <= found && found <= upper + 1e-9, "{lower} {found} {upper}");
        }
    }

    proptest! {
        /// Weights that make a nearer pair of points are not found by drawing them, and a plane between the two says that there
        /// are none: both bounds of what is told.
        #[test]
        fn no_drawn_points_are_nearer(
            one in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 1..12),
            other in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 1..12),
            turn in prop::array::uniform3(-3.0..3.0_f64),
            shift in prop::array::uniform3(-2.5..2.5_f64),
            enough in 0.0..2.0_f64,
            draws in prop::collection::vec(prop::array::uniform12(0.0..1.0_f64), 40),
        ) {
            let (one, other) = (hull(&one, 0.0), hull(&other, 0.0));
            let pose = Isometry3::from_parts(shift.into(), UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]));
            let found = apart(&one, &other, pose);
            let mixed = |hull: &Hull, weights: &[f64]| {
                // Raised, so that few corners count.
                let weights: Vec<f64> = weights.iter().take(hull.points.len()).map(|weight| weight.powi(6) + 1e-9).collect();
                let sum: Vector3<f64> = hull.points.iter().zip(&weights).map(|(point, weight)| point.coords * *weight).sum();
                Point3::from(sum / weights.iter().sum::<f64>())
            };
            for draw in &draws {
                let mut turned = *draw;
                turned.rotate_left(5);
                let between = mixed(&one, draw) - pose * mixed(&other, &turned);
                prop_assert!(found <= between.norm() + 1e-9, "{found} {}", between.norm());
            }
            // What is told with an end in sight is on the same side of it.
            let told = told(&one, &other, pose, enough);
            prop_assert!((told >= enough) == (found >= enough) || (found - enough).abs() < 1e-9, "{told} {found} {enough}");
            prop_assert!(told <= found + 1e-9);
            // It does not depend on which is first, nor on the frame.
            let turned = apart(&other, &one, pose.inverse());
            prop_assert!((turned - found).abs() < 1e-7, "{found} {turned}");
            // Some plane holds them apart by as much: the points that are furthest to both sides of where they come nearest.
            if found > 1e-6 {
                let larger = Hull { radius: 0.5 * found, ..one.clone() };
                let rounded = apart(&larger, &other, pose);
                prop_assert!((rounded - 0.5 * found).abs() < 1e-7, "{rounded} {found}");
            }
        }
    }
}
