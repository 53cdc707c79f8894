//! The sensitivity of many movements at a time, and how it changes with the posture.
//!
//! ```text
//! φ(θ) = tr(H S Hᵀ),     ∂φ/∂θⱼ = 2 Σ (H S) · ∂H/∂θⱼ
//! ```
//!
//! Where nothing but points is measured, both run through vector registers (see [`simd`](crate::simd)). For other sensors
//! ∂H/∂θⱼ are central differences of fourth order of the rows.

use fearless_simd::{Level, Simd, SimdBase, dispatch};
use nalgebra::DMatrix;

use super::Problem;
use crate::{
    model::{KinematicData, Points},
    optimize::Slopes,
    simd::{GROUP, Lanes, load, splat, store, write_times},
};

/// H at the truth, for any movement.
pub(super) struct Sensitivity<'a> {
    problem: &'a Problem,
    points: Option<Points>,
    level: Level,
}

/// The half-width of differences, rad or m. What they leave out is below 10⁻¹⁰ of H where what is measured changes over
/// centimetres, and rounding takes 10⁻¹².
const DIFFERENCE: f64 = 1e-4;

impl<'a> Sensitivity<'a> {
    pub fn new(problem: &'a Problem) -> Self {
        let points = problem.measurement_model.points();
        let points = points.and_then(|points| Points::new(&problem.truth, &problem.layout, &points));
        Self { problem, points, level: crate::simd::level() }
    }

    /// φ of every pose (rad or m) for the matrix S; −∞ where nothing is seen.
    pub fn values(&self, s: &DMatrix<f64>, poses: &[Vec<f64>]) -> Vec<f64> {
        self.evaluate(s, poses, None)
    }

    /// φ of every pose (rad or m) for the matrix S, with its derivatives by the positions of all joints, per rad or m.
    pub fn slopes(&self, s: &DMatrix<f64>, poses: &[Vec<f64>]) -> Slopes {
        let mut gradients = vec![0.0; poses.len() * self.problem.limits.dimension()];
        let values = self.evaluate(s, poses, Some(&mut gradients));
        Slopes { values, gradients }
    }

    fn evaluate(&self, s: &DMatrix<f64>, poses: &[Vec<f64>], gradients: Option<&mut [f64]>) -> Vec<f64> {
        let mut values = vec![0.0; poses.len()];
        match &self.points {
            Some(points) => {
                dispatch!(self.level, simd => in_lanes(simd, (points, s), poses, &mut values, gradients));
                for (value, pose) in values.iter_mut().zip(poses) {
                    if !self.problem.sees(pose) {
                        *value = f64::NEG_INFINITY;
                    }
                }
            }
            None => self.one_by_one(s, poses, &mut values, gradients),
        }
        values
    }

    fn one_by_one(&self, s: &DMatrix<f64>, poses: &[Vec<f64>], values: &mut [f64], mut gradients: Option<&mut [f64]>) {
        let Problem { truth, layout, measurement_model, .. } = self.problem;
        let mut data = KinematicData::new(truth, layout);
        let mut readings = vec![0.0; measurement_model.equations()];
        let mut rows = DMatrix::zeros(layout.dimension(), measurement_model.equations());
        for (index, (pose, value)) in poses.iter().zip(values).enumerate() {
            // What is seen here is taken for seen beside it too: where it is lost, no difference says anything.
            let visible = self.problem.visible(pose);
            if !visible.contains(&true) {
                *value = f64::NEG_INFINITY;
                continue;
            }
            let unseen = measurement_model.unseen(data.at(pose).links());
            let mut rows_at = |pose: &[f64], rows: &mut DMatrix<f64>| {
                rows.fill(0.0);
                measurement_model.rows_without(&unseen, data.at(pose), &mut readings, rows.as_mut_slice());
                measurement_model.hide(&visible, rows.as_mut_slice());
            };
            rows_at(pose, &mut rows);
            let products = s * &rows;
            *value = products.dot(&rows);
            let Some(gradients) = &mut gradients else { continue };
            let mut moved = pose.clone();
            for (joint, slope) in gradients[index * pose.len()..][..pose.len()].iter_mut().enumerate() {
                let [near_above, near_below, far_above, far_below] = [1.0, -1.0, 2.0, -2.0].map(|steps| {
                    moved[joint] = pose[joint] + steps * DIFFERENCE;
                    rows_at(&moved, &mut rows);
                    products.dot(&rows)
                });
                moved[joint] = pose[joint];
                *slope = (8.0 * (near_above - near_below) - (far_above - far_below)) / (6.0 * DIFFERENCE);
            }
        }
    }
}

/// Computes a group at a time, so that its rows and products stay in the nearest cache.
#[inline(always)]
fn in_lanes<S: Simd>(
    simd: S,
    (points, s): (&Points, &DMatrix<f64>),
    poses: &[Vec<f64>],
    values: &mut [f64],
    mut gradients: Option<&mut [f64]>,
) {
    let d = points.equations();
    // Coordinates that move no point stay zero.
    let mut rows = vec![0.0; s.nrows() * d * GROUP];
    let mut products = vec![0.0; rows.len()];
    let mut readings = vec![0.0; d * GROUP];
    let mut slopes = Vec::new();
    for (index, (group, values)) in poses.chunks(GROUP).zip(values.chunks_mut(GROUP)).enumerate() {
        points.rows(simd, group, &mut readings, &mut rows);
        write_times(simd, [d, GROUP], (&rows, s.as_slice()), &mut products);
        let mut sums = [0.0; GROUP];
        for lane in (0..GROUP).step_by(Lanes::<S>::LEN) {
            let mut sum = splat(simd, 0.0);
            for first in (lane..rows.len()).step_by(GROUP) {
                sum = load(simd, &rows, first) * load(simd, &products, first) + sum;
            }
            store::<S>(sum, &mut sums, lane);
        }
        values.copy_from_slice(&sums[..values.len()]);
        let Some(gradients) = &mut gradients else { continue };
        let n = group[0].len();
        slopes.clear();
        slopes.resize(n * GROUP, 0.0);
        points.slopes(simd, group, &products, &mut readings, &mut slopes);
        for (place, slope) in gradients[index * GROUP * n..].iter_mut().take(group.len() * n).enumerate() {
            *slope = 2.0 * slopes[place % n * GROUP + place / n];
        }
    }
}
