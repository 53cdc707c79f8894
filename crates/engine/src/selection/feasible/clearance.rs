//! How near the links of a robot may come to one another.

use nalgebra::Isometry3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Constraints, Hull, Violation};

/// Postures drawn to find the links that are often near one another.
const DRAWS: usize = 200;
/// The share of them in which these are, at least: so often that it is the shape of the robot, as of a short wrist, and no accident.
/// Shapes say more than lines do: of them it takes more.
const OFTEN: f64 = 0.25;
const OFTEN_BY_SHAPE: f64 = 0.5;

/// The least distance between links that do not follow one another.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearance {
    /// Metres.
    least: f64,
    /// What stands for the links: lines between their ends, or the shapes that a description gives them.
    hulls: Vec<Hull>,
    /// The pairs of these that are held apart, and by how much, metres.
    pairs: Vec<([usize; 2], f64)>,
}

impl Clearance {
    /// How far the parts of a pair are to be from one another at most, metres: between the middle lines of links, or between their shapes.
    pub fn least(&self) -> f64 {
        self.least
    }

    /// How many pairs of parts are held apart.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// The pairs that are nearer than they may be, with the links of the robot here: their parts, their distance and the least, metres.
    fn too_near(&self, links: &[Isometry3<f64>]) -> impl Iterator<Item = (usize, [&Hull; 2], [f64; 2])> {
        let distances = self.pairs.iter().enumerate().map(|(index, (pair, least))| {
            let [one, other] = pair.map(|part| &self.hulls[part]);
            (index, [one, other], [one.distance(other, links, *least), *least])
        });
        distances.filter(|(.., [distance, least])| distance < least)
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
        let pairs = if least > 0.0 { self.outline.pairs_apart(&self.middle(), least) } else { Vec::new() };
        let pairs = pairs.into_iter().map(|pair| (pair, least)).collect();
        self.clearance = Some(Clearance { least, hulls: self.outline.capsules(0.0), pairs });
        self.leave_alone(OFTEN, known);
    }

    /// Holds the shapes of links apart by `least` (m), and links without a shape as capsules, whose middle lines are `between` (m) apart.
    /// Where the way along the robot between two links is shorter than the robot, so is what they are held apart by: a tenth at least.
    /// Pairs are left alone on one link or on two of which one carries the other; otherwise as [`hold_apart`](Self::hold_apart) does, but for
    /// half of all postures instead of a quarter.
    pub fn hold_shapes_apart<'p>(
        &mut self,
        shapes: Vec<Hull>,
        least: f64,
        between: f64,
        known: impl IntoIterator<Item = &'p [f64]>,
    ) {
        let capsules = self.outline.capsules(0.5 * (between - least));
        let is_bare: Vec<bool> = capsules.iter().map(|it| shapes.iter().all(|shape| shape.link != it.link)).collect();
        let of_capsules = self.outline.pairs_apart(&self.middle(), between);
        let of_capsules = of_capsules.into_iter().filter(|pair| pair.iter().all(|capsule| is_bare[*capsule]));
        // Capsules first, so that their pairs are as they were.
        let count = capsules.len();
        let hulls: Vec<Hull> = capsules.into_iter().chain(shapes).collect();
        let of_shapes = (count..hulls.len()).flat_map(|shape| (0..shape).map(move |other| [other, shape]));
        let of_shapes = of_shapes.filter(|[other, shape]| {
            is_bare.get(*other).copied().unwrap_or(true)
                && self.outline.are_distant([*other, *shape].map(|part| hulls[part].link))
        });
        let (frames, length) = (self.outline.frames(&self.middle()), self.length());
        let pairs = of_capsules.chain(of_shapes).map(|pair| {
            let way = self.outline.way(pair.map(|part| hulls[part].link), &frames);
            (pair, least * (way / length).clamp(0.1, 1.0))
        });
        let pairs = pairs.collect();
        self.clearance = Some(Clearance { least, hulls, pairs });
        self.leave_alone(OFTEN_BY_SHAPE, known);
    }

    /// Leaves pairs alone that are near in this share of all postures, or in a known one.
    fn leave_alone<'p>(&mut self, often: f64, known: impl IntoIterator<Item = &'p [f64]>) {
        let Some(mut clearance) = self.clearance.take() else { return };
        let mut near = vec![0.0; clearance.pairs.len()];
        let mut count = |posture: &[f64], weight: f64| {
            clearance.too_near(&self.outline.frames(posture)).for_each(|(pair, ..)| near[pair] += weight);
        };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        (0..DRAWS).for_each(|_| count(&self.tightened.draw(&mut rng), 1.0));
        known.into_iter().for_each(|posture| count(posture, f64::INFINITY));
        let mut near = near.into_iter();
        clearance.pairs.retain(|_| near.next().is_some_and(|near| near < often * DRAWS as f64));
        self.clearance = Some(clearance);
    }

    /// The middle of the limits, rad or m per joint.
    fn middle(&self) -> Vec<f64> {
        self.tightened.from_unit(&vec![0.5; self.tightened.dimension()])
    }

    /// The parts that come too near to one another, with the links of the robot here.
    pub(super) fn too_near(&self, links: &[Isometry3<f64>]) -> impl Iterator<Item = Violation> {
        self.clearance.iter().flat_map(|clearance| {
            clearance.too_near(links).map(|(_, parts, [distance, least])| Violation::Near {
                parts: parts.map(|part| part.name.clone()),
                distance,
                least,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::{Point3, UnitVector3, Vector3};

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
        assert_eq!((one.as_str(), other.as_str()), ("the link to `elbow`", "the link to `tip`"));
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
}
