//! How near the links of a robot may come to one another.

use nalgebra::{Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Constraints, Violation};

/// Postures drawn to find the links that are often near one another.
const DRAWS: usize = 200;
/// The share of them in which these are, at least: so often that it is the shape of the robot, as of a short wrist, and no accident.
const OFTEN: f64 = 0.25;

/// The least distance between links that do not follow one another: each is a capsule around the line between its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearance {
    /// Between their middle lines, metres: twice the radius of the capsules.
    least: f64,
    /// The pairs that are held apart, by their places in [`Outline::links`](super::Outline::links).
    pairs: Vec<[usize; 2]>,
}

impl Clearance {
    /// Between middle lines, metres.
    pub fn least(&self) -> f64 {
        self.least
    }

    /// How many pairs of links are held apart.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }
}

impl Constraints {
    /// The length of the robot as it is described, metres: of its longest branch, along the links, in the middle of its limits.
    pub fn length(&self) -> f64 {
        self.outline.length(&self.middle())
    }

    /// Holds links apart by `least` (m) between their middle lines; by 0 it says that nothing is to be held apart. Pairs are left
    /// alone that never come further apart, since the way along the robot from one to the other is no longer than that; that are
    /// nearer in a quarter of all postures within the limits; and that are nearer in one of these postures, in which the robot is
    /// known to have been.
    pub fn hold_apart<'p>(&mut self, least: f64, known: impl IntoIterator<Item = &'p [f64]>) {
        let mut pairs = if least > 0.0 { self.outline.pairs_apart(&self.middle(), least) } else { Vec::new() };
        let distances = |posture: &[f64]| self.distances(&pairs, &self.outline.at(posture));
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut near = vec![0.0; pairs.len()];
        for _ in 0..DRAWS {
            let distances = distances(&self.tightened.draw(&mut rng));
            near.iter_mut().zip(distances).filter(|(_, distance)| *distance < least).for_each(|(near, _)| *near += 1.0);
        }
        let mut is_kept: Vec<bool> = near.iter().map(|near| *near < OFTEN * DRAWS as f64).collect();
        for posture in known {
            is_kept.iter_mut().zip(distances(posture)).for_each(|(is_kept, distance)| *is_kept &= distance >= least);
        }
        let mut is_kept = is_kept.into_iter();
        pairs.retain(|_| is_kept.next() == Some(true));
        self.clearance = Some(Clearance { least, pairs });
    }

    /// The middle of the limits, rad or m per joint.
    fn middle(&self) -> Vec<f64> {
        self.tightened.from_unit(&vec![0.5; self.tightened.dimension()])
    }

    /// The distances between pairs of links whose parts are at these points, metres.
    fn distances(&self, pairs: &[[usize; 2]], points: &[Point3<f64>]) -> Vec<f64> {
        let links: Vec<[&Point3<f64>; 2]> =
            self.outline.links().map(|(ends, _)| ends.map(|part| &points[part])).collect();
        pairs.iter().map(|[one, other]| distance(links[*one], links[*other])).collect()
    }

    /// The links that come too near to one another, their parts at these points.
    pub(super) fn too_near(&self, points: &[Point3<f64>]) -> impl Iterator<Item = Violation> {
        let held = self.clearance.iter().flat_map(|Clearance { least, pairs }| {
            pairs.iter().zip(self.distances(pairs, points)).map(move |(pair, distance)| (pair, distance, *least))
        });
        let name = |link: usize| self.outline.links().nth(link).map_or("", |(_, name)| name).to_owned();
        held.filter(|(_, distance, least)| distance < least).map(move |(pair, distance, least)| Violation::Near {
            parts: pair.map(name),
            distance,
            least,
        })
    }
}

/// The distance between two segments, each by its ends: the nearest points of the lines through them, or of an end and the
/// other segment, whichever are in the segments (Ericson 2005, section 5.1.9).
fn distance([a, b]: [&Point3<f64>; 2], [c, d]: [&Point3<f64>; 2]) -> f64 {
    let (first, second, between): (Vector3<f64>, Vector3<f64>, Vector3<f64>) = (b - a, d - c, a - c);
    let (own, other, both) = (first.norm_squared(), second.norm_squared(), first.dot(&second));
    let (along_first, along_second) = (first.dot(&between), second.dot(&between));
    /// A share of a segment of this squared length; of a point there is one alone.
    fn share(of: f64, length: f64) -> f64 {
        if length > 0.0 { (of / length).clamp(0.0, 1.0) } else { 0.0 }
    }
    let determinant = own * other - both * both;
    // Of parallel segments any point of the first does to begin with.
    let s = share(both * along_second - other * along_first, determinant);
    let t = share(both * s + along_second, other);
    // The nearest of the first to that of the second, which may have been moved to an end.
    let s = share(both * t - along_first, own);
    (between + first * s - second * t).norm()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::UnitVector3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        kinematics::{Joint, JointBox, Line},
        model::State,
        selection::Outline,
        sensing::{Equipment, TargetKind},
    };

    /// An arm in a plane, of four links of 0.3 m.
    fn planar() -> Constraints {
        let up = UnitVector3::new_normalize(Vector3::z());
        let joint = |k: f64| Joint::Revolute(Line { point: Point3::new(0.3 * k, 0.0, 0.0), direction: up });
        let arm = State::arm([0.0, 1.0, 2.0, 3.0].map(joint).to_vec(), Point3::new(1.2, 0.0, 0.0));
        let names: Vec<String> = ["shoulder", "elbow", "wrist", "knuckle"].map(str::to_owned).to_vec();
        let mut equipment = Equipment::default();
        let points = vec![Point3::origin()];
        equipment.targets.push(TargetKind { name: "tip".to_owned(), points, facing: None, partly_seen: None });
        let outline = Outline::new(&arm, &names, &equipment);
        Constraints::new(names, JointBox::new(vec![(-PI, PI); 4]).expect("limits"), outline)
    }

    #[test]
    fn links_that_do_not_follow_one_another_are_held_apart() {
        let mut constraints = planar();
        constraints.hold_apart(0.05, []);
        // Of four links three pairs do not follow one another: the first and third, the first and fourth, the second and fourth.
        assert_eq!(constraints.clearance.as_ref().map(Clearance::pairs), Some(3));
        let near = |posture: [f64; 4]| {
            let found = constraints.violations(None, &posture);
            found
                .map(|violation| match violation {
                    Violation::Near { parts: [one, other], distance, .. } => (one, other, distance),
                    other => panic!("{other}"),
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(near([0.0; 4]), [], "stretched");
        assert_eq!(
            near([0.0, PI, 0.0, 0.0]).len(),
            1,
            "folded at the elbow, the third link begins where the first does"
        );
        assert_eq!(near([0.3, FRAC_PI_2, FRAC_PI_2, 0.0]), [], "a hook");
        let [(one, other, distance)] = &near([0.3, FRAC_PI_2, FRAC_PI_2, 1.5])[..] else { panic!("a square") };
        assert_eq!((one.as_str(), other.as_str()), ("elbow", "tip"));
        // The tip is beside the shoulder by what the last angle lacks of a right one.
        assert!((distance - 0.3 * (FRAC_PI_2 - 1.5).sin()).abs() < 1e-9, "{distance}");
    }

    #[test]
    fn what_the_shape_of_the_robot_or_a_known_posture_brings_together_is_left_alone() {
        let mut constraints = planar();
        let further = constraints.outline.pairs_apart(&[0.0; 4], 0.35);
        assert_eq!(further, [[0, 3]], "only the first and last are further along");
        constraints.hold_apart(0.35, []);
        let pairs = constraints.clearance.as_ref().map(Clearance::pairs);
        assert_eq!(pairs, Some(0), "and these are nearer in more than a quarter of all postures");
        let folded = [0.0, PI, 0.0, 0.0];
        constraints.hold_apart(0.05, [&folded[..]]);
        assert!(constraints.allow(None, &folded));
        assert!(!constraints.allow(None, &[0.3, FRAC_PI_2, FRAC_PI_2, FRAC_PI_2]), "another pair");
    }

    proptest! {
        /// It is what many points of both segments say, also of segments that are points, parallel or crossing.
        #[test]
        fn the_distance_is_that_of_the_nearest_points(
            ends in prop::array::uniform4(prop::array::uniform3(-2_i8..=2)),
            moved in prop::array::uniform3(0.0..1.0_f64),
        ) {
            let mut ends = ends.map(|end| Point3::from(end.map(f64::from)));
            ends[0] += Vector3::from(moved);
            let [a, b, c, d] = ends;
            let found = distance([&a, &b], [&c, &d]);
            let on = |from: Point3<f64>, to: Point3<f64>, k: u32| from + (to - from) * (f64::from(k) / 100.0);
            let mut least = f64::INFINITY;
            for k in 0..=100 {
                for l in 0..=100 {
                    least = least.min((on(a, b, k) - on(c, d, l)).norm());
                }
            }
            let step = ((b - a).norm() + (d - c).norm()) / 200.0;
            prop_assert!(found <= least + 1e-9 && least <= found + step + 1e-9, "{found} {least}");
            prop_assert!((found - distance([&d, &c], [&b, &a])).abs() < 1e-9);
        }
    }
}
