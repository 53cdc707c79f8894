//! Whether the marker will be seen: the weight of a movement's gain when a head watches, and what misses teach.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Point3};

use super::Past;
use crate::{elementary::exp_m1, sensing::Head};

/// How much a miss says about its neighbourhood, in units of the joint box (each joint's range is 1): at this distance
/// a movement's chance is discounted by a factor of 1 − e^{−1/2}.
const RADIUS: f64 = 0.15;
/// By how much that grows with every further miss in a row …
const GROWTH: f64 = 0.05;
/// … and how far.
const WIDEST: f64 = 0.6;
/// The least chance that misses leave: where constraints leave one posture only, it is tried again.
const HOPE: f64 = 1e-6;
/// κ², by which the believed covariance of the marker is widened: linearised at a poor estimate it is too small. Of 4, 9
/// and 16 four served best (`head-fov`, seeds 1001 to 1040); 1 and 2 did no better on a first look.
pub(super) const CAUTION: f64 = 4.0;

/// The chance that the marker is seen after a movement, as believed before it:
///
/// ```text
/// p(θ) = P(marker in view | marker ~ N(h(θ), κ² H P Hᵀ)) × Πₖ (1 − exp(−‖u(θ) − u(θₖ)‖² / 2ρ²))
/// ```
///
/// The first factor is [`Head::chance`], with κ = 2, as a filter that linearises is surer than it should be. The
/// second discounts what lies near the latest misses θₖ, with u the position in the joint box scaled to the unit cube and
/// ρ = 0.15: a miss changes no estimate, so without it a learner that wrongly believes the marker in view would choose
/// the same movement again and again. Where sensors themselves see or do not, ρ grows with misses in a row: what is believed of
/// their view is wrong farther from them, too.
#[derive(Clone, Copy, Debug)]
pub struct Visibility<'a> {
    head: Option<&'a Head>,
    /// The latest misses, scaled to the unit cube.
    misses: &'a VecDeque<Vec<f64>>,
    /// ρ.
    radius: f64,
}

impl<'a> Visibility<'a> {
    /// Of what `head` sees, or without one of all, with the misses that there were.
    pub fn new(head: Option<&'a Head>, history: &'a Past) -> Self {
        let in_a_row = if head.is_some() { 0 } else { history.misses_in_a_row().saturating_sub(1) };
        let radius = (RADIUS + GROWTH * in_a_row as f64).min(WIDEST);
        Self { head, misses: history.misses(), radius }
    }

    /// The head that watches.
    pub fn head(&self) -> Option<&'a Head> {
        self.head
    }

    /// The latest misses, scaled to the unit cube.
    pub fn misses(&self) -> impl Iterator<Item = &'a Vec<f64>> + use<'a> {
        self.misses.iter()
    }

    /// The chance of seeing the marker, predicted as N(`marker`, `covariance`), at a configuration scaled to the unit
    /// cube.
    pub fn chance(&self, scaled: &[f64], marker: &Point3<f64>, covariance: &Matrix3<f64>) -> f64 {
        let believed = self.head.map_or(1.0, |head| head.chance(marker, &(covariance * CAUTION)));
        if believed == 0.0 { 0.0 } else { believed * self.discount(scaled) }
    }

    /// The factor by which the latest misses lower the chance at a configuration scaled to the unit cube.
    pub fn discount(&self, scaled: &[f64]) -> f64 {
        let discount = self.misses.iter().fold(1.0, |chance, miss| {
            let squared: f64 = scaled.iter().zip(miss).map(|(a, b)| (a - b).powi(2)).sum();
            chance * -exp_m1(-0.5 * squared / (self.radius * self.radius))
        });
        f64::max(discount, HOPE)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::{
        kinematics::JointBox,
        selection::{Actions, Movement, situation::MEMORY},
        sensing::Observation,
    };

    #[test]
    fn a_miss_discounts_its_neighbourhood_and_is_forgotten_in_time() {
        let head = Head {
            position: Point3::origin(),
            look: UnitVector3::new_normalize(Vector3::x()),
            pan_limit: 0.3,
            tilt_limit: 0.3,
            lens_half_angle: 0.3,
            baseline: None,
        };
        let mut history = Past::default();
        let movement = |at: f64| Movement::to(vec![at, 0.5]);
        let limits = JointBox::new(vec![(0.0, 1.0); 2]).expect("limits");
        let miss = |history: &mut Past, at: f64| {
            history.moved(&movement(at), &Actions::Box(limits.clone()), &Observation::missed(1));
        };
        let chance = |history: &Past, at: f64| {
            let visibility = Visibility::new(Some(&head), history);
            visibility.chance(&[at, 0.5], &Point3::new(1.0, 0.0, 0.0), &Matrix3::zeros())
        };
        assert_eq!(chance(&history, 0.5), 1.0);
        miss(&mut history, 0.5);
        assert!(chance(&history, 0.5) <= HOPE);
        assert!((chance(&history, 0.5 + RADIUS) - (1.0 - (-0.5_f64).exp())).abs() < 1e-12);
        assert!(chance(&history, 1.0) > 0.95);
        (0..MEMORY).for_each(|_| miss(&mut history, 9.0));
        assert!(chance(&history, 0.5) > 0.99);
    }
}
