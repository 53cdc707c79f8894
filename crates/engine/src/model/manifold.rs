//! The postures in which a target is at a given place.
//!
//! ```text
//! p(θ) = s,      J = ∂p/∂θ  (3 × n, by the joints' readings)
//! ```
//!
//! are three equations for n readings. What is left are n − 3 dimensions along which the arm moves while the target stays:
//! its self-motion manifold (Burdick 1989), with the null space of J as tangent. Distances between postures are Euclidean,
//! in radians and metres.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Point3, Vector3};
use rand::Rng;

use super::{Frame, Links, State, eigen};
use crate::kinematics::JointBox;

/// The postures within joint limits at which a target of a robot is at a given place.
#[derive(Clone, Copy, Debug)]
pub struct Manifold<'a> {
    state: &'a State,
    target: usize,
    place: Point3<f64>,
    limits: &'a JointBox,
}

/// A posture counts as on the manifold when its target is this near to the place, metres.
const LANDED_M: f64 = 1e-10;
/// The distance below which rounding ends the search, metres.
const EXACT_M: f64 = 1e-13;
/// Steps of one projection.
const STEPS: usize = 100;
/// The longest step of a joint, rad or m.
const LONGEST_STEP: f64 = 0.5;
/// The distance from a limit, rad or m, below which a joint counts as being at it, because rounding leaves it a hair
/// within.
const TOUCHING: f64 = 2e-9;
/// λ, at first and at most, m².
const DAMPING: f64 = 1e-4;
const STUCK: f64 = 1e4;
/// The most steps towards the nearest posture, and the length of a step (rad or m) below which they end.
const SLIDES: usize = 1000;
const STILL: f64 = 1e-11;

impl<'a> Manifold<'a> {
    /// The manifold of `state` within `limits` on which `target` is at `place` (metres, frame of the measurements).
    pub fn new(state: &'a State, target: usize, place: Point3<f64>, limits: &'a JointBox) -> Self {
        Self { state, target, place, limits }
    }

    /// s − p(θ), metres.
    fn miss(&self, links: &mut Links<'_>, positions: &[f64]) -> Vector3<f64> {
        self.place.coords - links.at(positions).target(self.target)
    }

    /// A posture on the manifold, from `start` by damped Gauss–Newton steps
    ///
    /// ```text
    /// Δθ = Jᵀ (J Jᵀ + λ I)⁻¹ (s − p)
    /// ```
    ///
    /// without the joints that a step would press against their limits. `None` where it does not come to a posture whose
    /// target is at the place to 1e-10 m.
    pub fn project(&self, start: &[f64]) -> Option<Vec<f64>> {
        let mut links = Links::towards(self.state, [Frame::Target(self.target)]);
        let mut positions = self.within(start);
        let mut miss = self.miss(&mut links, &positions);
        let mut lambda = DAMPING;
        for _ in 0..STEPS {
            if miss.norm() < EXACT_M {
                break;
            }
            let jacobian = links.at(&positions).target_jacobian(self.target);
            let Some(step) = self.step(&jacobian, &miss, lambda, &positions) else { break };
            let step = &step * (LONGEST_STEP / step.amax()).min(1.0);
            let next = self.within_vector(&positions, &step);
            let missed = self.miss(&mut links, &next);
            if missed.norm() < miss.norm() {
                (positions, miss) = (next, missed);
                lambda *= 0.1;
            } else {
                lambda *= 10.0;
                if lambda > STUCK || miss.norm() < LANDED_M {
                    break;
                }
            }
        }
        (miss.norm() < LANDED_M).then_some(positions)
    }

    /// The posture on the manifold that is nearest to `start`: projected, then slid along the tangent for as long as that
    /// brings it nearer. A local minimum of the distance, as every such search finds; `None` where none is found.
    ///
    /// Where the projection is caught at the limits it begins anew farther from them.
    pub fn nearest(&self, start: &[f64]) -> Option<Vec<f64>> {
        let middle = self.limits.from_unit(&vec![0.5; start.len()]);
        let inward = |share: f64| {
            let start: Vec<f64> = start.iter().zip(&middle).map(|(a, b)| a + share * (b - a)).collect();
            self.project(&start)
        };
        let mut positions = [0.0, 0.03, 0.1, 0.3, 0.6].into_iter().find_map(inward)?;
        let distance = |positions: &[f64]| difference(start, positions).norm();
        for _ in 0..SLIDES {
            let towards = difference(start, &positions);
            let jacobian = self.state.target_jacobian(self.target, &positions);
            let slide = self.slide(&jacobian, &towards, &positions);
            if slide.amax() < STILL {
                break;
            }
            let shares = (0..20).map(|halvings| 0.5_f64.powi(halvings));
            let mut trials = shares.filter_map(|share| {
                let moved = self.within_vector(&positions, &(&slide * share));
                self.project(&moved).filter(|next| distance(next) < distance(&positions))
            });
            let Some(next) = trials.next() else { break };
            positions = next;
        }
        Some(positions)
    }

    /// An orthonormal basis of the tangent at a posture (n × (n − 3); more columns where the arm is singular).
    pub fn tangent(&self, positions: &[f64]) -> DMatrix<f64> {
        let jacobian = self.state.target_jacobian(self.target, positions);
        let Some(eigen) = eigen(jacobian.tr_mul(&jacobian)) else { return DMatrix::zeros(positions.len(), 0) };
        let greatest = eigen.eigenvalues.amax();
        let free = |k: &usize| eigen.eigenvalues[*k] <= 1e-10 * greatest;
        let columns: Vec<_> = (0..positions.len()).filter(free).map(|k| eigen.eigenvectors.column(k)).collect();
        if columns.is_empty() { DMatrix::zeros(positions.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// A posture drawn uniformly within the limits and projected; draws are repeated a limited number of times until
    /// one lands.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Option<Vec<f64>> {
        const PATIENCE: usize = 200;
        (0..PATIENCE).find_map(|_| self.project(&self.limits.draw(rng)))
    }

    /// A damped Gauss–Newton step; `None` where nothing moves the target.
    fn step(
        &self,
        jacobian: &Matrix3xX<f64>,
        miss: &Vector3<f64>,
        lambda: f64,
        positions: &[f64],
    ) -> Option<DVector<f64>> {
        self.unpressed(positions, |free| {
            let free = masked(jacobian, free);
            let damped = free.clone() * free.transpose() + Matrix3::identity() * lambda;
            Some(jacobian.tr_mul(&(damped.try_inverse()? * miss)))
        })
        .filter(|step| step.amax() > 0.0)
    }

    /// The part of `way` that leads along the tangent.
    fn slide(&self, jacobian: &Matrix3xX<f64>, way: &DVector<f64>, positions: &[f64]) -> DVector<f64> {
        let along = self.unpressed(positions, |free| {
            let free = masked(jacobian, free);
            let square = free.clone() * free.transpose();
            let damped = square + Matrix3::identity() * (1e-14 * square.amax().max(f64::MIN_POSITIVE));
            Some(way - jacobian.tr_mul(&(damped.try_inverse()? * (&free * way))))
        });
        along.unwrap_or_else(|| DVector::zeros(way.len()))
    }

    /// A step by the free joints alone, all of them at first; those that it presses against their limits are held, the one that
    /// presses most first: without it others may no longer press. One that is held and would be moved off its limit, were it free, is
    /// freed again, each once. `step` tells where all joints would go while those that it is given hold the target.
    fn unpressed(&self, positions: &[f64], step: impl Fn(&[bool]) -> Option<DVector<f64>>) -> Option<DVector<f64>> {
        let mut free = vec![true; positions.len()];
        let mut is_freed = vec![false; positions.len()];
        loop {
            let mut found = step(&free)?;
            let presses = |joint: &usize| {
                let (position, step) = (positions[*joint], found[*joint]);
                (position <= self.limits.lower(*joint) + TOUCHING && step < 0.0)
                    || (position >= self.limits.upper(*joint) - TOUCHING && step > 0.0)
            };
            let most = |a: &usize, b: &usize| found[*a].abs().total_cmp(&found[*b].abs());
            let pressing = (0..positions.len()).filter(|joint| free[*joint] && presses(joint)).max_by(most);
            if let Some(joint) = pressing {
                free[joint] = false;
                continue;
            }
            let leaves = |joint: &usize| !free[*joint] && !is_freed[*joint] && found[*joint] != 0.0 && !presses(joint);
            if let Some(joint) = (0..positions.len()).filter(leaves).max_by(most) {
                (free[joint], is_freed[joint]) = (true, true);
                continue;
            }
            (0..free.len()).filter(|joint| !free[*joint]).for_each(|joint| found[joint] = 0.0);
            return Some(found);
        }
    }

    fn within(&self, positions: &[f64]) -> Vec<f64> {
        let limits = self.limits.joints().iter();
        positions.iter().zip(limits).map(|(position, (lower, upper))| position.clamp(*lower, *upper)).collect()
    }

    fn within_vector(&self, positions: &[f64], step: &DVector<f64>) -> Vec<f64> {
        let moved: Vec<f64> = positions.iter().zip(step).map(|(position, step)| position + step).collect();
        self.within(&moved)
    }
}

fn difference(to: &[f64], from: &[f64]) -> DVector<f64> {
    DVector::from_iterator(to.len(), to.iter().zip(from).map(|(to, from)| to - from))
}

fn masked(jacobian: &Matrix3xX<f64>, free: &[bool]) -> Matrix3xX<f64> {
    let mut masked = jacobian.clone();
    for (joint, _) in free.iter().enumerate().filter(|(_, free)| !**free) {
        masked.column_mut(joint).fill(0.0);
    }
    masked
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::random::random_state;

    /// A robot of seven joints with everything, its limits, and a place that its marker can reach.
    fn case(seed: u64) -> (State, JointBox, Point3<f64>, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_state(&mut rng, 7);
        let limits = JointBox::new(vec![(-1.5, 1.5); 7]).expect("limits");
        let place = state.target_at(0, &limits.draw(&mut rng));
        (state, limits, place, rng)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn the_jacobian_equals_central_differences(seed: u64) {
            let (state, limits, _, mut rng) = case(seed);
            let theta = limits.draw(&mut rng);
            for target in 0..state.targets.len() {
                let jacobian = state.target_jacobian(target, &theta);
                for joint in 0..theta.len() {
                    let moved = |step: f64| {
                        let mut moved = theta.clone();
                        moved[joint] += step;
                        state.target_at(target, &moved)
                    };
                    let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    prop_assert!((slope - jacobian.column(joint)).norm() < 1e-7);
                }
            }
        }

        /// To a nanometre, and within the limits.
        #[test]
        fn what_is_projected_lies_on_the_manifold(seed: u64) {
            let (state, limits, place, mut rng) = case(seed);
            let manifold = Manifold::new(&state, 0, place, &limits);
            let landed = manifold.draw(&mut rng).expect("a place that can be reached");
            prop_assert!(limits.contains(&landed));
            prop_assert!((state.target_at(0, &landed) - place).norm() < 1e-9);
            // And a small way along the tangent leads off it in the second order only.
            let tangent = manifold.tangent(&landed);
            prop_assert!(tangent.ncols() >= 4);
            let moved: Vec<f64> = landed.iter().zip(tangent.column(0).iter()).map(|(a, b)| a + 1e-4 * b).collect();
            prop_assert!((state.target_at(0, &moved) - place).norm() < 1e-6);
        }

        /// No posture on the manifold beside it is nearer.
        #[test]
        fn the_nearest_posture_is_nearest(seed: u64) {
            nearest_is_nearest(seed)?;
        }
    }

    /// Some at which a joint that only touched its limit, or was held there for good, kept it from being so.
    #[test]
    fn the_nearest_posture_is_nearest_in_corners_too() {
        for seed in [1362, 2873, 855_526_433_415_615_286, 12_839_231_596_424_114_542] {
            nearest_is_nearest(seed).expect("nearest");
        }
    }

    fn nearest_is_nearest(seed: u64) -> Result<(), TestCaseError> {
        let (state, limits, place, mut rng) = case(seed);
        let manifold = Manifold::new(&state, 0, place, &limits);
        let on = manifold.draw(&mut rng).expect("a place that can be reached");
        let start: Vec<f64> = on.iter().map(|x| (x + rng.random_range(-0.05..0.05)).clamp(-1.5, 1.5)).collect();
        let found = manifold.nearest(&start).expect("there is one nearby");
        prop_assert!(limits.contains(&found) && (state.target_at(0, &found) - place).norm() < 1e-9);
        let least = difference(&start, &found).norm();
        prop_assert!(least <= difference(&start, &on).norm() + 1e-9, "the one that it began beside");
        for _ in 0..20 {
            let beside: Vec<f64> = found.iter().map(|x| x + rng.random_range(-1e-3..1e-3)).collect();
            if let Some(other) = manifold.project(&beside) {
                prop_assert!(difference(&start, &other).norm() > least - 1e-7);
            }
        }
        Ok(())
    }

    #[test]
    fn a_place_out_of_reach_has_no_posture() {
        let (state, limits, ..) = case(3);
        let far = Point3::new(100.0, 0.0, 0.0);
        let manifold = Manifold::new(&state, 0, far, &limits);
        assert!(manifold.project(&[0.0; 7]).is_none() && manifold.nearest(&[0.0; 7]).is_none());
        assert!(manifold.draw(&mut ChaCha8Rng::seed_from_u64(1)).is_none());
    }
}
