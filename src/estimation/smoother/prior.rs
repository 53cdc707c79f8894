//! What the smoother believes of a chain before any movement.
//!
//! The prior must hold for every line, also for one turned by more than 90 deg from the initial guess, where the chart
//! at the guess ends. So it is written without that chart. For a line (v, w) and the guess (v₀, w₀), with σₚ and σd the
//! scenario's standard deviations,
//!
//! ```text
//! cost = ‖(I − wwᵀ)(v − v₀)‖² / 2σₚ²  +  ∠(w, w₀)² / 2σd²
//! ```
//!
//! the distance of the guessed point from the line, and the angle to the guessed direction. Near the guess this is the
//! Gaussian of those standard deviations in tangent coordinates. Without a guess ([`Prior::Within`]) v₀ is the origin
//! and σₚ = b/√3, the standard deviation of a coordinate uniform within ±b. Directions are uniform on the sphere:
//! they cost nothing, and their information enters the covariance only, as 1/(π²/4 − 1) rad⁻², the reciprocal of the
//! variance per coordinate of a uniform direction in the chart at its own mean.

use nalgebra::{DMatrix, DVector, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::kinematics::{Chain, Joint, Quantity, TangentLayout, chart};

/// What is known of the chain before any movement.
#[derive(Clone, Debug, PartialEq)]
pub enum Prior {
    /// A guess, with the standard deviation of every tangent coordinate (m, rad).
    Around {
        /// The guess.
        guess: Chain,
        /// One standard deviation per tangent coordinate.
        deviations: DVector<f64>,
    },
    /// No guess: directions uniform on the sphere, points uniform within ±`bound_m` of the origin.
    Within {
        /// What is known all the same: kinds of joints, joints that are not learned, the marker. Learned axes in it
        /// are starting values and mean nothing.
        frame: Chain,
        /// Largest coordinate of a point, metres.
        bound_m: f64,
        /// Standard deviation of a learned marker, metres.
        marker_m: f64,
    },
}

/// E θ²/2 for a direction uniform on the sphere, θ its angle to the pole: (π²/2 − 2)/2.
const UNIFORM_VARIANCE: f64 = std::f64::consts::PI * std::f64::consts::PI / 4.0 - 1.0;

impl Prior {
    /// The chain to start from.
    pub fn start(&self) -> &Chain {
        match self {
            Self::Around { guess, .. } => guess,
            Self::Within { frame, .. } => frame,
        }
    }

    /// The points that axes are pinned to: every line is written with its point nearest to these.
    pub(super) fn pins(&self) -> Chain {
        let mut pins = self.start().clone();
        if let Self::Within { .. } = self {
            pins.joints.iter_mut().for_each(|joint| {
                if let Joint::Revolute(line) = joint {
                    line.point = nalgebra::Point3::origin();
                }
            });
        }
        pins
    }

    /// (σₚ, σd, σ of the marker) of a joint, or of the marker for `None`.
    fn deviation(&self, index: usize, fallback: f64) -> f64 {
        match self {
            Self::Around { deviations, .. } => deviations[index],
            Self::Within { .. } => fallback,
        }
    }

    /// The standard deviation of every tangent coordinate.
    pub(super) fn deviations(&self, layout: &TangentLayout) -> DVector<f64> {
        match self {
            Self::Around { deviations, .. } => deviations.clone(),
            Self::Within { bound_m, marker_m, .. } => {
                let deviation = |quantity: &Quantity| match quantity {
                    Quantity::Point => bound_m / 3_f64.sqrt(),
                    Quantity::Direction => UNIFORM_VARIANCE.sqrt(),
                    Quantity::Marker => *marker_m,
                };
                DVector::from_iterator(layout.dimension(), layout.quantities().iter().map(deviation))
            }
        }
    }

    /// The cost of `chain`. Its information (m × m) and the descent direction −∂cost/∂δ are added to `normal`, if
    /// wanted, in the chart at `chain`.
    pub(super) fn cost(
        &self,
        chain: &Chain,
        pins: &Chain,
        layout: &TangentLayout,
        mut normal: Option<(&mut DMatrix<f64>, &mut DVector<f64>)>,
    ) -> f64 {
        let mut cost = 0.0;
        let guess = self.start();
        for (index, joint) in chain.joints.iter().enumerate() {
            let Some(directions) = layout.direction(index).map(|range| range.start) else { continue };
            let w = joint.direction();
            let basis = chart::basis(&w);
            if let (Joint::Revolute(line), Some(pin), Some(points)) =
                (joint, pins.joints[index].line(), layout.point(index).map(|range| range.start))
            {
                let bound = if let Self::Within { bound_m, .. } = self { bound_m / 3_f64.sqrt() } else { 1.0 };
                let information = self.deviation(points, bound).powi(-2);
                let offset = line.point - pin.point;
                let a = basis.transpose() * offset;
                cost += 0.5 * information * a.norm_squared();
                // ∂a/∂(a, d) = [I, −(w·offset) I]: turning the line about its pivot carries it past the pin.
                let lever = -w.dot(&offset);
                if let Some((matrix, vector)) = &mut normal {
                    for k in 0..2 {
                        let (row, column) = (points + k, directions + k);
                        matrix[(row, row)] += information;
                        matrix[(row, column)] += information * lever;
                        matrix[(column, row)] += information * lever;
                        matrix[(column, column)] += information * lever * lever;
                        vector[row] -= information * a[k];
                        vector[column] -= information * lever * a[k];
                    }
                }
            }
            match self {
                Self::Around { deviations, .. } => {
                    let information = deviations[directions].powi(-2);
                    let back = chart::local_direction(&w, &guess.joints[index].direction())
                        .unwrap_or_else(|| Vector2::new(std::f64::consts::PI, 0.0));
                    cost += 0.5 * information * back.norm_squared();
                    if let Some((matrix, vector)) = &mut normal {
                        for k in 0..2 {
                            matrix[(directions + k, directions + k)] += information;
                            vector[directions + k] += information * back[k];
                        }
                    }
                }
                Self::Within { .. } => {
                    if let Some((matrix, _)) = &mut normal {
                        (0..2).for_each(|k| matrix[(directions + k, directions + k)] += UNIFORM_VARIANCE.recip());
                    }
                }
            }
        }
        if let Some(range) = layout.marker() {
            let fallback = if let Self::Within { marker_m, .. } = self { *marker_m } else { 1.0 };
            let information = self.deviation(range.start, fallback).powi(-2);
            let offset = chain.marker - guess.marker;
            cost += 0.5 * information * offset.norm_squared();
            if let Some((matrix, vector)) = &mut normal {
                for (k, index) in range.enumerate() {
                    matrix[(index, index)] += information;
                    vector[index] -= information * offset[k];
                }
            }
        }
        cost
    }

    /// A chain drawn from the prior.
    pub(super) fn draw(&self, layout: &TangentLayout, rng: &mut impl Rng) -> Chain {
        match self {
            Self::Around { guess, deviations } => {
                let delta = deviations.map(|deviation| deviation * rng.sample::<f64, _>(StandardNormal));
                guess.retract(layout, &delta)
            }
            Self::Within { frame, bound_m, marker_m } => {
                let mut chain = frame.clone();
                for index in 0..chain.joints.len() {
                    if layout.is_learned(index) {
                        chain.joints[index] = anywhere(&chain.joints[index], *bound_m, rng);
                    }
                }
                if layout.marker().is_some() {
                    chain.marker += nalgebra::Vector3::from_fn(|_, _| marker_m * rng.sample::<f64, _>(StandardNormal));
                }
                chain
            }
        }
    }
}

/// A joint of the same kind, its direction uniform on the sphere, its point uniform within ±`bound_m`.
pub(crate) fn anywhere(joint: &Joint, bound_m: f64, rng: &mut impl Rng) -> Joint {
    // Archimedes: the height of a uniform direction is uniform.
    let height: f64 = rng.random_range(-1.0..=1.0);
    let turn: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    let radius = (1.0 - height * height).max(0.0).sqrt();
    let direction =
        nalgebra::UnitVector3::new_normalize(nalgebra::Vector3::new(radius * turn.cos(), radius * turn.sin(), height));
    match joint {
        Joint::Revolute(_) => {
            let point =
                nalgebra::Point3::from(nalgebra::Vector3::from_fn(|_, _| bound_m * rng.random_range(-1.0..=1.0)));
            Joint::Revolute(crate::kinematics::Line { point, direction })
        }
        Joint::Prismatic(_) => Joint::Prismatic(direction),
    }
}
