//! How rows change with posture.
//!
//! With h the columns of a point's rows and g numbers that multiply them, Σ g·h has a derivative by every joint j, which moves
//! all behind it by the velocity J at the point and the angular velocity ω (0 where it slides). In the words of
//! [`points`](super), columns of joints behind j turn with ω; those of j and of joints before it change as the point moves:
//!
//! ```text
//! ∂/∂θⱼ Σ g·h = ω·Σ_{i>j} h × g  +  J·Σ_{i≤j} (g₃ × d₂ + d₁ × g₄ + f g₅ × f₃)  +  f₁·(g₂ + r × g₃) − f₂·(g₁ + g₄ × r)
//! ```
//!
//! so that one walk along the chain gives all of them.

use fearless_simd::{ExtractToken, Simd};
use nalgebra::Vector3;

use super::{Measured, Outputs, Passed, Points, Whitening};
use crate::{
    kinematics::{JointKind, correction::LOADS},
    simd::{GROUP, Lanes, Rotations, Vector, load, splat, store},
};

/// What multiplies the rows of one point at a few postures, as its columns would be before they are whitened.
struct Factors<'a> {
    numbers: &'a [f64],
    stride: usize,
    first: usize,
    whitening: &'a Whitening,
}

impl Factors<'_> {
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, coordinate: usize) -> Vector<S> {
        let first = coordinate * self.stride + self.first;
        let g = Vector([0, GROUP, 2 * GROUP].map(|row| load(simd, self.numbers, first + row)));
        match self.whitening {
            Whitening::Even(weight) => g.scaled(splat(simd, *weight)),
            Whitening::Full(shape) => g.through(&shape.transpose()),
        }
    }
}

impl Points {
    /// Of `factors`, as many numbers as [`rows`](Self::rows) has and in their order, the derivatives of Σ g·h by the readings of
    /// all joints: n × GROUP numbers of each [group](GROUP) of candidates are added to `slopes`, per rad or m.
    #[inline(always)]
    pub fn slopes<S: Simd, C: AsRef<[f64]>>(
        &self,
        simd: S,
        candidates: &[C],
        factors: &[f64],
        readings: &mut [f64],
        slopes: &mut [f64],
    ) {
        self.pass(simd, candidates, readings, Outputs::Slopes(factors, slopes));
    }

    /// Adds those of a point at x, whose link has these axes.
    #[inline(always)]
    pub(super) fn slope<S: Simd>(
        &self,
        place: &Measured,
        (x, axes): (&Vector<S>, &Rotations<S>),
        passed: &Passed<S>,
        (first, factors): (usize, &[f64]),
        slopes: &mut [f64],
    ) {
        let simd = x.0[0].token();
        let factors =
            Factors { numbers: factors, stride: self.equations() * GROUP, first, whitening: &place.whitening };
        let lane = first % GROUP;
        let nothing = Vector::splat(simd, &Vector3::zeros());
        // What multiplies J, and what multiplies ω of all joints before the ones that are passed.
        let (mut moved, mut turning) = (nothing, nothing);
        if let Some((start, _)) = &self.base {
            for k in 0..3 {
                moved = moved + factors.of(simd, start + 3 + k).cross(Vector::splat(simd, &Vector3::ith(k, 1.0)));
            }
        }
        for (index, joint) in self.moving(place) {
            let turned = passed.at(index);
            let (arm, is_revolute) = (*x - turned.pivot, joint.kind == JointKind::Revolute);
            let velocity = if is_revolute { turned.axis.cross(arm) } else { turned.axis };
            let mut own = splat(simd, 0.0);
            if let Some(start) = joint.axis {
                let [d1, d2] = turned.swept;
                let [g1, g2] = [factors.of(simd, start), factors.of(simd, start + 1)];
                turning = turning + d1.cross(g1) + d2.cross(g2);
                let [f1, f2] = turned.basis;
                if is_revolute {
                    let [g3, g4] = [factors.of(simd, start + 2), factors.of(simd, start + 3)];
                    turning = turning + d2.cross(arm).cross(g3) + arm.cross(d1).cross(g4);
                    moved = moved + g3.cross(d2) + d1.cross(g4);
                    own = f1.dot(g2 + arm.cross(g3)) - f2.dot(g1 + g4.cross(arm));
                } else {
                    own = f1.dot(g1) + f2.dot(g2);
                }
            }
            let mut by_reading = splat(simd, 0.0);
            for (coordinate, term) in &joint.terms {
                let (factor, growth) = term.factor(simd, turned.reading, &[0.0; LOADS]);
                let g = factors.of(simd, *coordinate);
                by_reading = growth * velocity.dot(g) + by_reading;
                let g = g.scaled(factor);
                turning = turning + velocity.cross(g);
                if is_revolute {
                    moved = moved + g.cross(turned.axis);
                }
            }
            let mut by_position = own + velocity.dot(moved);
            if is_revolute {
                by_position -= turned.axis.dot(turning);
            }
            add::<S>(
                self.joints[index].correction.rate(simd, turned.reading) * by_position + by_reading,
                slopes,
                index * GROUP + lane,
            );
        }
        if let Some(start) = place.own {
            for k in 0..3 {
                turning = turning + axes.0[k].cross(factors.of(simd, start + k));
            }
        }
        for (index, joint) in self.moving(place) {
            let turned = passed.at(index);
            if joint.kind == JointKind::Revolute {
                add::<S>(
                    self.joints[index].correction.rate(simd, turned.reading) * turned.axis.dot(turning),
                    slopes,
                    index * GROUP + lane,
                );
            }
        }
    }
}

#[inline(always)]
fn add<S: Simd>(lanes: Lanes<S>, numbers: &mut [f64], first: usize) {
    let simd = lanes.token();
    store::<S>(load(simd, numbers, first) + lanes, numbers, first);
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;
    use nalgebra::Matrix3;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::{
        model::{
            Layout, Points, Whitening,
            random::{branched, random_stiff_state},
        },
        simd::{GROUP, groups, levels},
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]

        /// Differences of the rows, for every kind of block and target, at every level.
        #[test]
        fn slopes_are_those_of_the_rows(seed: u64, joints in 1_usize..=12, count in 1_usize..=9) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, blocks) = random_stiff_state(&mut rng, joints);
            let state = if seed % 2 == 0 { branched(state, &mut rng) } else { state };
            let layout = Layout::new(&state, blocks);
            let full = Matrix3::from_fn(|_, _| rng.random_range(-5.0..5.0));
            let whitenings = [Whitening::Full(full), Whitening::Even(rng.random_range(1.0..9.0))];
            let targets: Vec<(usize, Whitening)> =
                (0..state.targets.len()).map(|target| (target, whitenings[target % 2].clone())).collect();
            let points = Points::new(&state, &layout, &targets).expect("no loads");
            let candidates: Vec<Vec<f64>> =
                (0..count).map(|_| (0..joints).map(|_| rng.random_range(-4.0..4.0)).collect()).collect();
            let size = groups(count) * layout.dimension() * points.equations() * GROUP;
            let factors: Vec<f64> = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut readings = vec![0.0; points.equations() * count];
            for level in levels() {
                let mut slopes = vec![0.0; groups(count) * joints * GROUP];
                dispatch!(level, simd => points.slopes(simd, &candidates, &factors, &mut readings, &mut slopes));
                // Of each candidate, and of what it is a sum of, the sizes.
                let mut moved = |joint: usize, by: f64| {
                    let moved: Vec<Vec<f64>> = candidates
                        .iter()
                        .map(|candidate| {
                            let mut moved = candidate.clone();
                            moved[joint] += by;
                            moved
                        })
                        .collect();
                    let mut rows = vec![0.0; size];
                    dispatch!(level, simd => points.rows(simd, &moved, &mut readings, &mut rows));
                    let mut sums = vec![(0.0, 0.0); count];
                    for (place, (row, factor)) in rows.iter().zip(&factors).enumerate() {
                        let candidate = place / (size / groups(count)) * GROUP + place % GROUP;
                        if let Some((sum, scale)) = sums.get_mut(candidate) {
                            *sum += row * factor;
                            *scale += (row * factor).abs();
                        }
                    }
                    sums
                };
                let step = 1e-3;
                for joint in 0..joints {
                    let [far, near] = [2.0, 1.0].map(|k| (moved(joint, k * step), moved(joint, -k * step)));
                    for candidate in 0..count {
                        let [far, near] = [&far, &near].map(|(above, below)| above[candidate].0 - below[candidate].0);
                        let wanted = (8.0 * near - far) / (12.0 * step);
                        let found = slopes[(candidate / GROUP * joints + joint) * GROUP + candidate % GROUP];
                        let scale = moved(joint, 0.0)[candidate].1.max(1.0);
                        prop_assert!((found - wanted).abs() < 1e-9 * scale, "{level:?} joint {joint}: {found} {wanted}");
                    }
                }
            }
        }
    }
}
