//! Where points of an arm are at many postures, and how every learned parameter moves them: what a [`Pass`](super::Pass) says
//! of one posture, for as many at a time as a register holds.
//!
//! Every joint has a frame: its axis w is the third direction, the basis b₁, b₂ of the axis' chart are the others, and its
//! origin is the pivot v. Between one joint's frame and the next lie a fixed rotation and a fixed arm, so that with E the frame
//! before the joint turns by θ, F the same after, and q its origin,
//!
//! ```text
//! F = E rot₃(θ),     E⁺ = F (BᵀB⁺),     q⁺ = q + F Bᵀ(v⁺ − v)
//! ```
//!
//! and a point at x = q + r moves, by coordinate of the axis and by what is added to θ, with
//!
//! ```text
//! d₁, d₂,  d₂ × r,  r × d₁,  f₃ × r     [d₁ d₂] = [e₁ − f₁, e₂ − f₂]     revolute
//! θ e₁, θ e₂,  e₃                                                        prismatic
//! ```

mod passed;
mod posture;
mod slopes;
mod star;

use fearless_simd::{ExtractToken, Simd, SimdBase};
use nalgebra::{Matrix3, Vector3};

use super::{Block, Correction, Layout, State, pass::Term};
use crate::{
    kinematics::{JointKind, chart},
    lanes::{Frame, GROUP, Lanes, Vector, groups, sin_cos, splat},
};

use passed::{Passed, Turned};

pub use posture::Posture;
pub use star::{Centre, Centres, Passage, Ray, Stage};

/// Points of one state, to be looked up at many postures.
#[derive(Clone, Debug)]
pub struct Points {
    /// Where base coordinates start, and the origin of the base, metres.
    base: Option<(usize, Vector3<f64>)>,
    /// E and q of the first joint.
    first: (Matrix3<f64>, Vector3<f64>),
    joints: Vec<Turn>,
    /// Tangent coordinates, m.
    dimension: usize,
    /// In the order of their links.
    places: Vec<Place>,
}

/// A joint.
#[derive(Clone, Debug)]
struct Turn {
    kind: JointKind,
    correction: Correction,
    /// Where its axis stands, if that is learned.
    axis: Option<usize>,
    /// Where corrections of θ stand, and what they are multiplied by.
    terms: Vec<(usize, Term)>,
    /// BᵀB⁺ and Bᵀ(v⁺ − v); of the last joint nothing.
    next: Option<(Matrix3<f64>, Vector3<f64>)>,
}

/// A point that is measured.
#[derive(Clone, Debug)]
struct Place {
    /// Joints before it.
    link: usize,
    /// Its place in the frame of the last of them, and the axes of the link there; in the frame of the measurements if there
    /// is none.
    local: (Vector3<f64>, Matrix3<f64>),
    /// Where its own coordinates stand, if they are learned.
    own: Option<usize>,
    /// What columns are multiplied by.
    whitening: Whitening,
    /// Which of the points it is.
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

/// What is wanted of postures beside the places of points.
enum Wanted<'a> {
    /// The rows of each group.
    Rows(&'a mut [f64]),
    /// Of what multiplies the rows of each group, the derivatives of the product.
    Slopes(&'a [f64], &'a mut [f64]),
    /// The rows of each group, and its joints.
    Centres(&'a mut [f64], &'a mut [f64]),
}

/// Where the rows of one point at a few postures of a group are put: of each tangent coordinate all equations, of each of them
/// one candidate beside the other.
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
        let mut terms = vec![Vec::new(); state.joints.len()];
        for (block, range) in layout.blocks() {
            match block {
                Block::Offset(joint) => terms[joint].push((range.start, Term::Offset)),
                Block::Ratio(joint) => terms[joint].push((range.start, Term::Ratio)),
                Block::Eccentricity(joint) => {
                    terms[joint].extend([(range.start, Term::Sine), (range.start + 1, Term::Cosine)]);
                }
                Block::Compliance(..) => return None,
                _ => {}
            }
        }
        if state.bending().is_some() {
            return None;
        }
        let base = state.base.rotation.to_rotation_matrix().into_inner();
        let frames: Vec<(Matrix3<f64>, Vector3<f64>)> = state
            .joints
            .iter()
            .map(|joint| {
                let (w, pivot) =
                    (joint.direction(), joint.line().map_or_else(Vector3::zeros, |line| line.point.coords));
                let basis = chart::basis(&w);
                (Matrix3::from_columns(&[basis.column(0).into_owned(), basis.column(1).into_owned(), *w]), pivot)
            })
            .collect();
        let first = frames.first().map_or((base, state.base.translation.vector), |(frame, pivot)| {
            (base * frame, (state.base * nalgebra::Point3::from(*pivot)).coords)
        });
        let joints = state.joints.iter().zip(terms).enumerate().map(|(index, (joint, terms))| {
            let (frame, pivot) = &frames[index];
            let next = frames.get(index + 1);
            Turn {
                kind: joint.kind(),
                correction: state.corrections[index],
                axis: layout.direction(index).map(|range| layout.point(index).map_or(range.start, |point| point.start)),
                terms,
                next: next.map(|(next, after)| (frame.tr_mul(next), frame.tr_mul(&(after - pivot)))),
            }
        });
        let joints = joints.collect();
        let places = targets.iter().enumerate().map(|(index, (target, whitening))| {
            let place = &state.targets[*target];
            let origin = place.place.origin();
            let local = match place.link.checked_sub(1) {
                None => ((state.base * origin).coords, base),
                Some(last) => {
                    let (frame, pivot) = &frames[last];
                    (frame.tr_mul(&(origin.coords - pivot)), frame.transpose())
                }
            };
            let own = layout.block(Block::Target(*target)).map(|range| range.start);
            Place { link: place.link, local, own, whitening: whitening.clone(), index }
        });
        let mut places: Vec<Place> = places.collect();
        places.sort_by_key(|place| place.link);
        let base = layout.block(Block::Base).map(|range| (range.start, state.base.translation.vector));
        Some(Self { base, first, joints, dimension: layout.dimension(), places })
    }

    /// Equations of a candidate: three for each point.
    pub fn equations(&self) -> usize {
        3 * self.places.len()
    }

    /// The points at `candidates` (readings, rad or m), three coordinates each in `readings`, metres, and their whitened rows:
    /// of each [group](GROUP) of candidates m × equations × GROUP numbers in `rows`, all zero at first.
    #[inline(always)]
    pub fn rows<S: Simd, C: AsRef<[f64]>>(&self, simd: S, candidates: &[C], readings: &mut [f64], rows: &mut [f64]) {
        self.pass(simd, candidates, readings, Wanted::Rows(rows));
    }

    #[inline(always)]
    fn pass<S: Simd, C: AsRef<[f64]>>(&self, simd: S, candidates: &[C], readings: &mut [f64], mut wanted: Wanted<'_>) {
        let mut passed = Passed::with_room(simd, self.joints.len());
        let (d, width) = (self.equations(), Lanes::<S>::LEN);
        let groups = groups(candidates.len()).max(1);
        let (of_group, of_slopes) = (self.dimension * d * GROUP, self.joints.len() * GROUP);
        for (index, few) in candidates.chunks(width).enumerate() {
            let first = index * width;
            passed.count = 0;
            let mut places = self.places.iter().peekable();
            let mut frame = Frame::splat(simd, &self.first.0);
            let mut pivot = Vector::splat(simd, &self.first.1);
            for link in 0..=self.joints.len() {
                while let Some(place) = places.next_if(|place| place.link == link) {
                    let ((local, axes), fixed) = (&place.local, link == 0);
                    let x = if fixed { Vector::splat(simd, local) } else { pivot + frame.times(local) };
                    let axes = if fixed { Frame::splat(simd, axes) } else { frame.then(axes) };
                    let (group, first_row) = (first / GROUP, 3 * place.index * GROUP + first % GROUP);
                    match &mut wanted {
                        Wanted::Rows(rows) => {
                            let rows = &mut rows[group * of_group..][..of_group];
                            self.put(place, (&x, &axes), &passed, first_row, rows);
                        }
                        Wanted::Slopes(factors, slopes) => {
                            let factors = &factors[group * of_group..][..of_group];
                            let slopes = &mut slopes[group * of_slopes..][..of_slopes];
                            self.slope(place, (&x, &axes), &passed, (first_row, factors), slopes);
                        }
                        Wanted::Centres(rows, joints) => {
                            self.put(place, (&x, &axes), &passed, first_row, &mut rows[group * of_group..][..of_group]);
                            let of_joints = joints.len() / groups;
                            star::keep(&passed, &mut joints[group * of_joints..][..of_joints], first % GROUP);
                        }
                    }
                    for (lane, reading) in readings[first * d..].chunks_mut(d).take(few.len()).enumerate() {
                        for (k, x) in x.0.iter().enumerate() {
                            reading[3 * place.index + k] = x[lane];
                        }
                    }
                }
                let Some(joint) = self.joints.get(link) else { break };
                if let Some((rotation, arm)) = link.checked_sub(1).and_then(|before| self.joints[before].next.as_ref())
                {
                    pivot = pivot + frame.times(arm);
                    frame = frame.then(rotation);
                }
                let reading = Lanes::<S>::from_fn(simd, |lane| few[lane.min(few.len() - 1)].as_ref()[link]);
                passed.push(&joint.turn(reading, &mut frame, &mut pivot));
            }
        }
    }

    /// Puts the rows of a point at x, whose link has these axes.
    #[inline(always)]
    fn put<S: Simd>(
        &self,
        place: &Place,
        (x, axes): (&Vector<S>, &Frame<S>),
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
        for (index, joint) in self.joints.iter().enumerate().take(passed.count) {
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
                let [reading, sine, cosine] = turned.reading;
                let column = match term {
                    Term::Ratio => column.scaled(reading),
                    Term::Sine => column.scaled(sine),
                    Term::Cosine => column.scaled(cosine),
                    Term::Offset | Term::Torque(_) => column,
                };
                columns.put(*coordinate, column);
            }
        }
        if let Some(start) = place.own {
            for k in 0..3 {
                columns.put(start + k, axes.0[k].scaled(weight));
            }
        }
    }
}

impl Turn {
    /// Whether the sine and the cosine of the reading count.
    fn needs_sine(&self) -> bool {
        let Correction { sine, cosine, .. } = self.correction;
        let is_of_sine = |(_, term): &(usize, Term)| matches!(term, Term::Sine | Term::Cosine);
        sine != 0.0 || cosine != 0.0 || self.terms.iter().any(is_of_sine)
    }

    /// Turns or slides a joint's frame, which is before the joint, to a reading.
    #[inline(always)]
    fn turn<S: Simd>(&self, reading: Lanes<S>, frame: &mut Frame<S>, pivot: &mut Vector<S>) -> Turned<S> {
        let simd = reading.token();
        let Correction { offset, ratio, sine, cosine, .. } = self.correction;
        let mut theta = reading * splat(simd, ratio) + splat(simd, offset);
        let mut of_reading = [reading; 3];
        if self.needs_sine() {
            let (sin, cos) = sin_cos::<S>(reading);
            of_reading = [reading, sin, cos];
            theta = sin * splat(simd, sine) + (cos * splat(simd, cosine) + theta);
        }
        let [e1, e2, axis] = frame.0;
        let swept = match self.kind {
            JointKind::Revolute => {
                let (sin, cos) = sin_cos::<S>(theta);
                *frame = frame.turned(sin, cos);
                [e1 - frame.0[0], e2 - frame.0[1]]
            }
            JointKind::Prismatic => {
                *pivot = axis.scaled_onto(theta, *pivot);
                [e1.scaled(theta), e2.scaled(theta)]
            }
        };
        Turned { swept, axis, basis: [frame.0[0], frame.0[1]], pivot: *pivot, reading: of_reading }
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
        lanes::{groups, levels},
        model::{Pass, random::random_stiff_state},
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// What the pass says of one posture after the other, for every kind of block and target, at every level.
        #[test]
        fn points_are_those_of_the_pass(seed: u64, joints in 1_usize..=12, count in 1_usize..=9) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, blocks) = random_stiff_state(&mut rng, joints);
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
                let mut pass = Pass::new(&state, &layout);
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
