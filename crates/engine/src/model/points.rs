//! Where points of an arm are at many postures, and how every learned parameter moves them: what a [`KinematicData`](super::KinematicData) says
//! of one posture, for as many at a time as a register holds.
//!
//! In the words of the `kernel` of [`kinematics`](crate::kinematics), whose pass this is, with E the frame before a joint turns by
//! θ, F the same after, and q its origin,
//!
//! a point at x = q + r moves, by coordinate of the axis and by what is added to θ, with
//!
//! ```text
//! d₁, d₂,  d₂ × r,  r × d₁,  f₃ × r     [d₁ d₂] = [e₁ − f₁, e₂ − f₂]     revolute
//! θ e₁, θ e₂,  e₃                                                        prismatic
//! ```

mod perturbations;
mod posture;
mod slopes;

use fearless_simd::{ExtractToken, Simd, SimdBase};
use nalgebra::{Matrix3, Vector3};

use super::{Block, Layout, State, Target};
use crate::{
    kinematics::{Correction, Joint, JointKind, Kernel, Passed, Placed, Term, Turned, correction::LOADS},
    simd::{GROUP, Lanes, Rotations, Vector, groups, splat},
};

pub use perturbations::{Centre, Centres, Passage, Ray, Stage};
pub use posture::Posture;

/// Points of one state, to be looked up at many postures.
#[derive(Clone, Debug)]
pub struct Points {
    /// Where base coordinates start, and the origin of the base, metres.
    base: Option<(usize, Vector3<f64>)>,
    kernel: Kernel,
    joints: Vec<Learned>,
    /// Tangent coordinates, m.
    dimension: usize,
    /// The points, in the order of their links.
    places: Vec<Measured>,
}

/// The learned parameters of a joint.
#[derive(Clone, Debug)]
struct Learned {
    kind: JointKind,
    correction: Correction,
    /// The place of its axis, if that is learned.
    axis: Option<usize>,
    /// The places of its corrections, and what they multiply.
    terms: Vec<(usize, Term)>,
}

/// A point that is measured.
#[derive(Clone, Debug)]
struct Measured {
    /// The link that carries it.
    link: usize,
    /// The point and the axes of its link, as the kernel holds them.
    fixed: Placed,
    /// The place of its own coordinates, if they are learned.
    own: Option<usize>,
    /// The whitening of its columns.
    whitening: Whitening,
    /// Its index among the points.
    index: usize,
}

/// L⁻¹ of a point's noise.
#[derive(Clone, Debug, PartialEq)]
pub enum Whitening {
    /// 1/σ, the same in all directions, 1/m.
    Even(f64),
    /// L⁻¹, 1/m.
    Full(Matrix3<f64>),
}

/// An output that is asked for beside the positions of points.
enum Outputs<'a> {
    /// The Jacobian's rows of each group.
    Rows(&'a mut [f64]),
    /// The derivatives of the Jacobian's rows of each group, multiplied by given numbers.
    Slopes(&'a [f64], &'a mut [f64]),
    /// The rows of each group, and its joints.
    Centres(&'a mut [f64], &'a mut [f64]),
}

/// The output for the rows of one point at a few postures of a group: for each tangent coordinate all equations, for each
/// equation its candidates side by side.
struct Columns<'a> {
    /// The rows of the group, `equations × GROUP` numbers for each coordinate; all zero at first.
    rows: &'a mut [f64],
    /// Numbers of a coordinate.
    stride: usize,
    /// Where the first posture stands among those.
    first: usize,
    /// What they are multiplied by, beyond a weight that is the same in all directions.
    shape: Option<&'a Matrix3<f64>>,
}

impl Columns<'_> {
    #[inline(always)]
    fn put<S: Simd>(&mut self, coordinate: usize, column: Vector<S>) {
        let column = match self.shape {
            None => column,
            Some(shape) => column.through(shape),
        };
        let first = coordinate * self.stride + self.first;
        let numbers = &mut self.rows[first..first + 2 * GROUP + Lanes::<S>::LEN];
        column.store(numbers, [0, GROUP, 2 * GROUP]);
    }
}

impl Points {
    /// The origins of targets with the whitening of their measurements; `None` where joints give way to loads, whose torques
    /// depend on the whole posture.
    pub fn new(state: &State, layout: &Layout, targets: &[(usize, Whitening)]) -> Option<Self> {
        if layout.has_compliance() || state.bending().is_some() {
            return None;
        }
        let terms = layout.corrections();
        let needs_sine = |joint: usize| terms[joint].iter().any(|(_, term)| term.needs_sine());
        let kernel = Kernel::new(&state.tree, &state.base, (&state.joints, &state.corrections), |_| true, needs_sine);
        let learned = |(index, (joint, terms)): (usize, (&Joint, Vec<_>))| Learned {
            kind: joint.kind(),
            correction: state.corrections[index],
            axis: layout.direction(index).map(|range| layout.point(index).map_or(range.start, |point| point.start)),
            terms,
        };
        let places = targets.iter().enumerate().map(|(index, (target, whitening))| {
            let Target { link, place } = &state.targets[*target];
            let own = layout.block(Block::Target(*target)).map(|range| range.start);
            let fixed = kernel.fixed(*link, &place.origin());
            Measured { link: *link, fixed, own, whitening: whitening.clone(), index }
        });
        let mut places: Vec<Measured> = places.collect();
        places.sort_by_key(|place| place.link);
        let base = layout.block(Block::Base).map(|range| (range.start, state.base.translation.vector));
        let joints = state.joints.iter().zip(terms).enumerate().map(learned).collect();
        Some(Self { base, kernel, joints, dimension: layout.dimension(), places })
    }

    /// The number of equations of a candidate: three for each point.
    pub fn equations(&self) -> usize {
        3 * self.places.len()
    }

    /// The points at `candidates` (readings, rad or m), three coordinates each in `readings`, metres, and their whitened rows:
    /// of each [group](GROUP) of candidates m × equations × GROUP numbers in `rows`, all zero at first.
    #[inline(always)]
    pub fn rows<S: Simd, C: AsRef<[f64]>>(&self, simd: S, candidates: &[C], readings: &mut [f64], rows: &mut [f64]) {
        self.pass(simd, candidates, readings, Outputs::Rows(rows));
    }

    #[inline(always)]
    fn pass<S: Simd, C: AsRef<[f64]>>(&self, simd: S, candidates: &[C], readings: &mut [f64], mut wanted: Outputs<'_>) {
        let mut walk = self.kernel.walk(simd);
        let (d, width) = (self.equations(), Lanes::<S>::LEN);
        let groups = groups(candidates.len()).max(1);
        let (of_group, of_slopes) = (self.dimension * d * GROUP, self.joints.len() * GROUP);
        for (index, few) in candidates.chunks(width).enumerate() {
            let first = index * width;
            walk.restart();
            let mut places = self.places.iter().peekable();
            for link in 0..=self.joints.len() {
                while let Some(place) = places.next_if(|place| place.link == link) {
                    let (x, axes) = walk.place(&place.fixed);
                    let (group, first_row) = (first / GROUP, 3 * place.index * GROUP + first % GROUP);
                    match &mut wanted {
                        Outputs::Rows(rows) => {
                            let rows = &mut rows[group * of_group..][..of_group];
                            self.put(place, (&x, &axes), &walk.passed, first_row, rows);
                        }
                        Outputs::Slopes(factors, slopes) => {
                            let factors = &factors[group * of_group..][..of_group];
                            let slopes = &mut slopes[group * of_slopes..][..of_slopes];
                            self.slope(place, (&x, &axes), &walk.passed, (first_row, factors), slopes);
                        }
                        Outputs::Centres(rows, joints) => {
                            let rows = &mut rows[group * of_group..][..of_group];
                            self.put(place, (&x, &axes), &walk.passed, first_row, rows);
                            let of_joints = joints.len() / groups;
                            perturbations::keep(
                                &walk.passed,
                                &mut joints[group * of_joints..][..of_joints],
                                first % GROUP,
                            );
                        }
                    }
                    for (lane, reading) in readings[first * d..].chunks_mut(d).take(few.len()).enumerate() {
                        for (k, x) in x.0.iter().enumerate() {
                            reading[3 * place.index + k] = x[lane];
                        }
                    }
                }
                if link < self.joints.len() {
                    let reading = Lanes::<S>::from_fn(simd, |lane| few[lane.min(few.len() - 1)].as_ref()[link]);
                    walk.step(&self.kernel, reading, None);
                }
            }
        }
    }

    /// The joints that move a point, in order.
    #[inline(always)]
    fn moving(&self, place: &Measured) -> impl Iterator<Item = (usize, &Learned)> {
        let (link, tree) = (place.link, self.kernel.tree());
        self.joints.iter().enumerate().take(link).filter(move |(joint, _)| tree.moves(*joint, link))
    }

    /// Writes the Jacobian's rows of a point at x, whose link has these axes.
    #[inline(always)]
    fn put<S: Simd>(
        &self,
        place: &Measured,
        (x, axes): (&Vector<S>, &Rotations<S>),
        passed: &Passed<S>,
        first: usize,
        rows: &mut [f64],
    ) {
        let simd = x.0[0].token();
        let (weight, shape) = match &place.whitening {
            Whitening::Even(weight) => (splat(simd, *weight), None),
            Whitening::Full(shape) => (splat(simd, 1.0), Some(shape)),
        };
        // The weight is put on one factor of each column beforehand.
        let mut columns = Columns { rows, stride: self.equations() * GROUP, first, shape };
        if let Some((start, origin)) = &self.base {
            let arm = *x - Vector::splat(simd, origin);
            for k in 0..3 {
                let unit = Vector::splat(simd, &Vector3::ith(k, 1.0)).scaled(weight);
                columns.put(start + k, unit);
                columns.put(start + 3 + k, unit.cross(arm));
            }
        }
        for (index, joint) in self.moving(place) {
            let turned = passed.at(index);
            let arm = *x - turned.pivot;
            let [d1, d2] = [turned.swept[0].scaled(weight), turned.swept[1].scaled(weight)];
            if let Some(start) = joint.axis {
                columns.put(start, d1);
                columns.put(start + 1, d2);
                if joint.kind == JointKind::Revolute {
                    columns.put(start + 2, d2.cross(arm));
                    columns.put(start + 3, arm.cross(d1));
                }
            }
            if joint.terms.is_empty() {
                continue;
            }
            let axis = turned.axis.scaled(weight);
            let column = if joint.kind == JointKind::Revolute { axis.cross(arm) } else { axis };
            for (coordinate, term) in &joint.terms {
                let (factor, _) = term.factor(simd, turned.reading, &[0.0; LOADS]);
                columns.put(*coordinate, column.scaled(factor));
            }
        }
        if let Some(start) = place.own {
            for k in 0..3 {
                columns.put(start + k, axes.0[k].scaled(weight));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;
    use nalgebra::DMatrix;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::{
            KinematicData,
            random::{branched, random_stiff_state},
        },
        simd::{groups, levels},
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// What the pass says of one posture after the other, for every kind of block and target, at every level.
        #[test]
        fn points_are_those_of_the_pass(seed: u64, joints in 1_usize..=12, count in 1_usize..=9) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, blocks) = random_stiff_state(&mut rng, joints);
            let state = if seed % 2 == 0 { branched(state, &mut rng) } else { state };
            let layout = Layout::new(&state, blocks);
            let m = layout.dimension();
            let full = Matrix3::from_fn(|_, _| rng.random_range(-5.0..5.0));
            let whitenings = [Whitening::Full(full), Whitening::Even(rng.random_range(1.0..9.0))];
            let targets: Vec<(usize, Whitening)> =
                (0..state.targets.len()).map(|target| (target, whitenings[target % 2].clone())).collect();
            let points = Points::new(&state, &layout, &targets).expect("no loads");
            let candidates: Vec<Vec<f64>> =
                (0..count).map(|_| (0..joints).map(|_| rng.random_range(-4.0..4.0)).collect()).collect();
            let d = points.equations();
            for level in levels() {
                let (mut rows, mut readings) = (vec![0.0; groups(count) * m * d * GROUP], vec![0.0; d * count]);
                dispatch!(level, simd => points.rows(simd, &candidates, &mut readings, &mut rows));
                let mut pass = KinematicData::new(&state, &layout);
                for (index, candidate) in candidates.iter().enumerate() {
                    pass.at(candidate);
                    for (point, (target, whitening)) in targets.iter().enumerate() {
                        let mut columns = DMatrix::zeros(3, m);
                        let x = pass.point_columns(*target, |coordinate, column| {
                            columns.set_column(coordinate, &match whitening {
                                Whitening::Even(weight) => column * *weight,
                                Whitening::Full(inverse) => inverse * column,
                            });
                        });
                        let scale = columns.amax().max(1.0);
                        for row in 0..3 {
                            prop_assert!((readings[index * d + 3 * point + row] - x[row]).abs() < 1e-12 * scale);
                            for k in 0..m {
                                let found = rows[((index / GROUP * m + k) * d + 3 * point + row) * GROUP + index % GROUP];
                                let wanted = columns[(row, k)];
                                prop_assert!((found - wanted).abs() < 1e-12 * scale, "{level:?} {k}: {found} {wanted}");
                            }
                        }
                    }
                }
            }
        }
    }
}
