//! The A-criterion of postures that differ from one in a single joint each, as DIRECT asks for them.
//!
//! G = P Hᵀ at the posture in the middle is a sum over the chain. Where joint j moves, what joints behind it add to that sum turns
//! with the point, and what joints before it add changes by what moving the point changes (see
//! [`model::points::perturbations`](crate::model)): with U and V the sums over the columns before and behind, and T that of what drifts,
//!
//! ```text
//! G' = U + T × Δ + R V + Σ P h'   over j's own columns
//! ```
//!
//! so that a candidate takes some fifty multiplications for each tangent coordinate, however many there are, instead of three for
//! each pair. Lanes run across tangent coordinates, and the values of one perturbation do not depend on the others.

mod registers;

use fearless_simd::{Level, Simd, dispatch};
use nalgebra::{DMatrix, Matrix3, Vector3};

use registers::{Moved, drift, sum_behind, turn_all};

use super::innovation::{entries, place, traces};
use crate::{
    kinematics::JointBox,
    model::{Centre, Centres, Passage, Points, Ray},
    optimize::CoordinatePerturbations,
    simd::{Aligned, GROUP, Rotations, Vector, groups, narrowed},
};

/// Columns of a joint that are multiplied at once: those of its axis.
const OWN: usize = 4;

/// With fewer tangent coordinates it is faster to multiply those of every posture, postures side by side.
pub(super) const FEWEST: usize = 36;

/// Postures that differ from one in a single joint each: the same in the same order as a batch of DIRECT's.
#[derive(Clone, Debug, Default)]
pub(super) struct PerturbedCentres {
    /// Joints of a posture.
    dimension: usize,
    centres: Vec<f64>,
    /// The joint, and its reading there.
    rays: Vec<(usize, f64)>,
    /// Where the rays of each perturbation end.
    ends: Vec<usize>,
}

/// The criterion of perturbations under one hypothesis.
pub(super) struct AroundCentres<'a> {
    level: Level,
    points: &'a Points,
    passage: Passage,
    /// Tangent coordinates, and as many with those that fill the last register.
    sizes: [usize; 2],
    /// P in the order of the passage, columns of full registers, and a few more that are zero.
    p: Aligned,
    weights: Aligned,
    /// The criterion before the movement.
    value: f64,
}

/// What a perturbation is computed in. Of three numbers per coordinate, those of each dimension stand together.
#[derive(Default)]
pub(super) struct PerturbationBuffers {
    centres: Centres,
    /// h and b, by coordinate, then by dimension.
    columns: Vec<Vector3<f64>>,
    drifts: Vec<Vector3<f64>>,
    terms: Vec<Vector3<f64>>,
    /// h and b.
    across: [Aligned; 2],
    /// The sums behind every stage, and over all of them.
    behind: Aligned,
    /// T.
    drifting: Aligned,
    /// By how much the joint of each ray moves, its sine and cosine.
    angles: [Vec<f64>; 3],
    /// H P Hᵀ and G W Gᵀ of every ray.
    found: [Vec<f64>; 2],
}

impl PerturbedCentres {
    /// None yet, of postures of so many joints.
    pub fn new(dimension: usize) -> Self {
        Self { dimension, ..Self::default() }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.centres.clear();
        self.rays.clear();
        self.ends.clear();
    }

    /// Adds the points that divide a rectangle of the unit cube, which stands for these limits.
    pub fn push(&mut self, perturbation: &CoordinatePerturbations<'_>, limits: &JointBox) {
        let along = |(joint, x): (usize, f64)| limits.along_from_unit(joint, x);
        self.centres.extend(perturbation.centre.iter().copied().enumerate().map(along));
        self.rays.extend(perturbation.rays().map(|ray| (ray.0, along(ray))));
        self.ends.push(self.rays.len());
    }

    fn centres(&self) -> Vec<&[f64]> {
        self.centres.chunks_exact(self.dimension).collect()
    }
}

impl<'a> AroundCentres<'a> {
    /// `None` where not just the place of one point is measured, alike in all directions.
    pub fn new(
        level: Level,
        points: &'a Points,
        covariance: &DMatrix<f64>,
        weights: &[f64],
        value: f64,
    ) -> Option<Self> {
        let m = covariance.nrows();
        let passage = points.passage()?;
        let wide = m.next_multiple_of(GROUP);
        let mut p = Aligned::zeros(wide * (m + OWN));
        for (column, &of) in p.chunks_exact_mut(wide.max(1)).zip(&passage.order) {
            let given = covariance.column(of);
            column.iter_mut().zip(&passage.order).for_each(|(p, &row)| *p = given[row]);
        }
        let mut ordered = Aligned::zeros(wide);
        ordered.iter_mut().zip(&passage.order).for_each(|(weight, &of)| *weight = weights[of]);
        Some(Self { level, points, passage, sizes: [m, wide], p, weights: ordered, value })
    }

    /// C(θ) of every ray, in order; not finite where it is no number.
    pub fn evaluate(&self, perturbations: &PerturbedCentres, buffers: &mut PerturbationBuffers) -> Vec<f64> {
        let [m, wide] = self.sizes;
        let centres = perturbations.centres();
        let level = narrowed(self.level, centres.len());
        dispatch!(level, simd => self.points.look_up(simd, &centres, &mut buffers.centres));
        let [h, b] = &mut buffers.across;
        for numbers in [h, b, &mut buffers.drifting] {
            numbers.ensure(3 * wide);
        }
        buffers.columns.resize(m, Vector3::zeros());
        buffers.drifts.resize(m, Vector3::zeros());
        buffers.behind.ensure((self.passage.stages.len() + 1) * 3 * wide);
        let count = perturbations.rays.len();
        for angles in &mut buffers.angles {
            angles.resize(angles.len().max(count.next_multiple_of(GROUP)), 0.0);
        }
        let mut begin = 0;
        for (centre, &end) in centres.iter().zip(&perturbations.ends) {
            for ray in begin..end {
                let (joint, reading) = perturbations.rays[ray];
                buffers.angles[0][ray] = self.points.travel(joint, centre[joint], reading);
            }
            begin = end;
        }
        let of_group = entries(3) * GROUP;
        for found in &mut buffers.found {
            found.resize(groups(count) * of_group, 0.0);
        }
        dispatch!(self.level, simd => {
            turn_all(simd, count, &mut buffers.angles);
            let mut begin = 0;
            for (index, (centre, &end)) in centres.iter().zip(&perturbations.ends).enumerate() {
                self.perturbation(simd, (index, centre), (begin, &perturbations.rays[begin..end]), buffers);
                begin = end;
            }
        });
        let mut values = traces(self.level, 3, &buffers.found[0], &buffers.found[1]);
        values.truncate(count);
        for value in &mut values {
            *value = if value.is_finite() { self.value - *value } else { f64::INFINITY };
        }
        values
    }

    /// H P Hᵀ and G W Gᵀ of the rays of one perturbation.
    #[inline(always)]
    fn perturbation<S: Simd>(
        &self,
        simd: S,
        (index, readings): (usize, &[f64]),
        (first, rays): (usize, &[(usize, f64)]),
        buffers: &mut PerturbationBuffers,
    ) {
        let [_, wide] = self.sizes;
        let stages = &self.passage.stages;
        let PerturbationBuffers { centres, columns, drifts, terms, across, behind, drifting, angles, found } = buffers;
        let centre = centres.at(self.points, index);
        self.gather(&centre, readings, (columns, drifts), across);
        sum_behind(simd, wide, stages, (&self.p, columns), behind);
        drifting.fill(0.0);
        let (all, behind) = behind.split_at(3 * wide);
        let (mut next, mut drifted) = (0, 0);
        for (stage, at) in stages.iter().enumerate() {
            let sums_behind = &behind[stage * 3 * wide..][..3 * wide];
            // Of all from this stage on.
            let from_here = if stage == 0 { all } else { &behind[(stage - 1) * 3 * wide..][..3 * wide] };
            let is_last = stage + 1 == stages.len();
            if next == rays.len() {
                break;
            }
            let is_asked = is_last || rays[next].0 + 1 == stage;
            if !is_asked {
                continue;
            }
            drift(simd, wide, &stages[drifted..stage], (&self.p, drifts), drifting);
            drifted = stage;
            let pivot = (!is_last).then(|| centre.pivot(stage - 1, &columns[at.coordinates.clone()]));
            while let Some(&(joint, reading)) = rays.get(next)
                && (joint + 1 == stage || is_last)
            {
                let ray = first + next;
                next += 1;
                let turn = if let Some(pivot) = &pivot {
                    pivot.ray(reading, [angles[0][ray], angles[1][ray], angles[2][ray]], terms)
                } else {
                    // Nothing moves before the point: its own columns stay what they are.
                    terms.clear();
                    terms.extend_from_slice(&columns[at.coordinates.clone()]);
                    Ray { rotation: Matrix3::identity(), shift: Vector3::zeros(), axis: [Vector3::zeros(); 4] }
                };
                let [h1, h2, h3, h4] = &turn.axis;
                let p = &self.p[at.coordinates.start * wide..];
                let moved = Moved {
                    simd,
                    wide,
                    rotation: Rotations::splat(simd, &turn.rotation),
                    shift: Vector::splat(simd, &turn.shift),
                    axis: [
                        Vector::splat(simd, h1),
                        Vector::splat(simd, h2),
                        Vector::splat(simd, h3),
                        Vector::splat(simd, h4),
                    ],
                    p: [&p[..wide], &p[wide..2 * wide], &p[2 * wide..3 * wide], &p[3 * wide..4 * wide]],
                    of_axis: at.of_axis,
                    terms,
                    p_of_terms: &p[at.of_axis * wide..],
                    across,
                    sums: [all, from_here, sums_behind, drifting],
                    weights: &self.weights,
                };
                let spreads = moved.multiply(&at.coordinates);
                let place = place(3, 0, 0, ray);
                for (found, sums) in found.iter_mut().zip(spreads) {
                    let found = &mut found[place..=place + 5 * GROUP];
                    (0..6).for_each(|entry| found[entry * GROUP] = sums[entry]);
                }
            }
        }
    }

    /// h and b of all coordinates, in both orders.
    fn gather(
        &self,
        centre: &Centre<'_>,
        readings: &[f64],
        (columns, drifts): (&mut [Vector3<f64>], &mut [Vector3<f64>]),
        across: &mut [Aligned; 2],
    ) {
        let wide = self.sizes[1];
        columns.iter_mut().zip(centre.columns(&self.passage.order)).for_each(|(to, column)| *to = column);
        for (stage, at) in self.passage.stages.iter().enumerate() {
            let mut places = drifts[at.drifting.clone()].iter_mut();
            centre.drifts(stage, readings, &columns[at.coordinates.clone()], |b| {
                if let Some(place) = places.next() {
                    *place = b;
                }
            });
        }
        for (across, columns) in across.iter_mut().zip([&*columns, &*drifts]) {
            let (x, others) = across.split_at_mut(wide);
            let (y, z) = others.split_at_mut(wide);
            for (((x, y), z), column) in x.iter_mut().zip(y).zip(z).zip(columns) {
                (*x, *y, *z) = (column.x, column.y, column.z);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        estimation::Belief,
        model::{Layout, random::random_stiff_state},
        selection::{Criterion, CriterionUnits, Weights, criterion::points},
        sensing::{MeasurementModel, Position, Sensor},
        simd::levels,
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// For every kind of block and joint, at every level of instructions, whatever else is asked for beside a perturbation.
        #[test]
        fn perturbations_say_what_single_postures_say(seed: u64, joints in 1_usize..=9, count in 1_usize..=5) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, mut blocks) = random_stiff_state(&mut rng, joints);
            for last in (1..blocks.len()).rev() {
                blocks.swap(last, rng.random_range(0..=last));
            }
            blocks.truncate(rng.random_range(1..=blocks.len()));
            let layout = Layout::new(&state, blocks);
            let m = layout.dimension();
            let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-0.5..0.5));
            let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-3;
            let prior_sd = nalgebra::DVector::from_fn(m, |_, _| rng.random_range(0.1..2.0));
            let weights = Weights::new(CriterionUnits::Prior, &layout, &prior_sd);
            let target = rng.random_range(0..state.targets.len());
            let measurement_model = MeasurementModel::new(vec![Sensor::even(Position { target }, 0.1)]);
            let belief = Belief::new(state, layout.into(), measurement_model.into()).with_covariance(covariance);
            let criterion = Criterion::new(&belief, &weights).expect("a covariance");
            let points = points(&belief, &belief.state).expect("a tracker");
            let (mut perturbations, mut postures, mut alone) = (PerturbedCentres::new(joints), Vec::new(), Vec::new());
            for _ in 0..count {
                let centre: Vec<f64> = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
                let mut one = PerturbedCentres::new(joints);
                one.centres.extend(&centre);
                for joint in 0..joints {
                    for _ in 0..2 * rng.random_range(0..=1) {
                        let mut posture = centre.clone();
                        posture[joint] = rng.random_range(-3.0..3.0);
                        one.rays.push((joint, posture[joint]));
                        postures.push(posture);
                    }
                }
                one.ends.push(one.rays.len());
                perturbations.centres.extend(&one.centres);
                perturbations.rays.extend(&one.rays);
                perturbations.ends.push(perturbations.rays.len());
                alone.push(one);
            }
            let expected = criterion.evaluate(&postures);
            for level in levels() {
                let (p, value) = (belief.covariance.as_ref().expect("a covariance"), criterion.before());
                let around = AroundCentres::new(level, &points, p, weights.all(), value).expect("one point");
                let found = around.evaluate(&perturbations, &mut PerturbationBuffers::default());
                prop_assert_eq!(found.len(), expected.len());
                for (found, expected) in found.iter().zip(&expected) {
                    prop_assert!((found - expected).abs() < 1e-12 * criterion.before(), "{level:?}: {found} {expected}");
                }
                let mut buffers = PerturbationBuffers::default();
                let apart: Vec<f64> = alone.iter().flat_map(|perturbation| around.evaluate(perturbation, &mut buffers)).collect();
                prop_assert_eq!(apart, found);
            }
        }
    }
}
