//! One posture at a time, and how a value that depends on readings and rows changes with the posture: backwards, from what it
//! does with every reading and row to what it does with every joint, in one pass along the chain.
//!
//! When a joint k turns at f₃, a point x behind it moves by ẋ = f₃ × (x − q), and with it a column c of its rows: what belongs to
//! a joint behind k turns as a whole, what belongs to one before k is a lever ω × x + v whose end moves,
//!
//! ```text
//! ċ = f₃ × c     behind k,          ċ = ω × ẋ     before k
//! ```
//!
//! and for a value whose derivative by c is u these are `f₃ · (c × u)` and `ẋ · (u × ω)`: sums along the chain. A joint that slides
//! turns nothing, and moves what is behind it by its axis.

use nalgebra::{Matrix3, Vector3};

use super::{Measured, Passed, Points, Turned, Whitening};
use crate::kinematics::{JointKind, Numbers, Plain, correction::LOADS};

/// Points at one posture, with their whitened rows.
pub struct Posture<'a> {
    points: &'a Points,
    joints: Passed<Plain>,
    /// x and the axes of its link, in the order of the links.
    places: Vec<(Vector3<f64>, Matrix3<f64>)>,
    readings: Vec<f64>,
    rows: Vec<f64>,
}

/// A column of a point's rows before it is whitened, with the joint that it belongs to.
struct Column {
    coordinate: usize,
    column: Vector3<f64>,
    /// How it changes while its own joint turns or slides by itself.
    own: Vector3<f64>,
    /// ω of the lever that it is.
    lever: Vector3<f64>,
    /// How it changes with the joint's reading by itself.
    read: Vector3<f64>,
}

impl Whitening {
    fn whiten(&self, x: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Even(weight) => x * *weight,
            Self::Full(shape) => shape * x,
        }
    }

    /// Multiplies by the transpose of the whitening.
    fn unwhiten(&self, x: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Even(weight) => x * *weight,
            Self::Full(shape) => shape.tr_mul(&x),
        }
    }
}

impl Points {
    /// The points at one posture (readings of the joints, rad or m, one per joint).
    pub fn at(&self, posture: &[f64]) -> Posture<'_> {
        let (mut walk, mut places) = (self.kernel.walk(Plain), Vec::with_capacity(self.places.len()));
        let mut next = self.places.iter().peekable();
        for link in 0..=self.joints.len() {
            while let Some(place) = next.next_if(|place| place.link == link) {
                places.push(walk.place(&place.fixed));
            }
            let Some(reading) = posture.get(link).filter(|_| link < self.joints.len()) else { break };
            walk.step(&self.kernel, *reading, None);
        }
        let joints = walk.passed;
        let (m, d) = (self.dimension, self.equations());
        let (mut readings, mut rows) = (vec![0.0; d], vec![0.0; d * m]);
        for (place, (x, axes)) in self.places.iter().zip(&places) {
            let at = 3 * place.index;
            readings[at..at + 3].copy_from_slice(x.as_slice());
            let rows = &mut rows[at * m..(at + 3) * m];
            let mut put = |coordinate: usize, column: Vector3<f64>| {
                let column = place.whitening.whiten(column);
                (0..3).for_each(|k| rows[k * m + coordinate] = column[k]);
            };
            self.columns_of_joints(place, &joints, *x, |_, of| put(of.coordinate, of.column));
            self.columns_of_base(*x, |coordinate, column, _| put(coordinate, column));
            place.own_columns(axes, put);
        }
        Posture { points: self, joints, places, readings, rows }
    }

    /// What the parameters of every joint before a point at x do, with the joint. What is not asked for costs nothing where this is
    /// written out.
    #[inline(always)]
    fn columns_of_joints(
        &self,
        place: &Measured,
        joints: &Passed<Plain>,
        x: Vector3<f64>,
        mut each: impl FnMut(usize, Column),
    ) {
        let nothing = Vector3::zeros();
        for (index, joint) in self.moving(place) {
            let Turned { swept: [d1, d2], axis, basis: [f1, f2], pivot, reading } = joints.at(index);
            let turns = joint.kind == JointKind::Revolute;
            let arm = x - pivot;
            let swept = if turns { axis.cross(&arm) } else { axis };
            let mut put = |coordinate: usize, column: Vector3<f64>, own: Vector3<f64>, lever: Vector3<f64>| {
                each(index, Column { coordinate, column, own, lever, read: nothing });
            };
            match (joint.axis, turns) {
                (Some(start), true) => {
                    put(start, d1, -f2, nothing);
                    put(start + 1, d2, f1, nothing);
                    put(start + 2, d2.cross(&arm), f1.cross(&arm) + d2.cross(&swept), d2);
                    put(start + 3, arm.cross(&d1), swept.cross(&d1) - arm.cross(&f2), -d1);
                }
                (Some(start), false) => {
                    put(start, d1, f1, nothing);
                    put(start + 1, d2, f2, nothing);
                }
                (None, _) => {}
            }
            for (coordinate, term) in &joint.terms {
                let (factor, rate) = term.factor(Plain, reading, &[0.0; LOADS]);
                let (own, lever) = if turns { (axis.cross(&swept), axis) } else { (nothing, nothing) };
                each(
                    index,
                    Column {
                        coordinate: *coordinate,
                        column: swept * factor,
                        own: own * factor,
                        lever: lever * factor,
                        read: swept * rate,
                    },
                );
            }
        }
    }

    /// What the coordinates of the base do to a point at x, and the levers that they are.
    fn columns_of_base(&self, x: Vector3<f64>, mut each: impl FnMut(usize, Vector3<f64>, Vector3<f64>)) {
        let Some((start, origin)) = &self.base else { return };
        for k in 0..3 {
            let unit = Vector3::ith(k, 1.0);
            each(start + k, unit, Vector3::zeros());
            each(start + 3 + k, unit.cross(&(x - origin)), unit);
        }
    }
}

impl Measured {
    /// What the point's own coordinates do, where its link has these axes.
    fn own_columns(&self, axes: &Matrix3<f64>, mut each: impl FnMut(usize, Vector3<f64>)) {
        let Some(start) = self.own else { return };
        Plain::columns(axes).into_iter().enumerate().for_each(|(k, column)| each(start + k, column));
    }
}

impl Posture<'_> {
    /// The points, three coordinates each, metres.
    pub fn readings(&self) -> &[f64] {
        &self.readings
    }

    /// H, whitened: m numbers for each equation, one after the other.
    pub fn rows(&self) -> &[f64] {
        &self.rows
    }

    /// Adds to `slope` the derivative of a value by every joint's reading, given its derivatives by every whitened reading
    /// and by every number of the [rows](Self::rows).
    pub fn add_slope(&self, (by_readings, by_rows): (&[f64], &[f64]), slope: &mut [f64]) {
        let m = self.points.dimension;
        // By joint: Σ c × u and Σ u × ω of its columns.
        let mut sums = vec![(Vector3::zeros(), Vector3::zeros()); self.joints.count];
        for (place, (x, axes)) in self.points.places.iter().zip(&self.places) {
            let at = 3 * place.index;
            let by = |coordinate: usize| {
                let of = |k: usize| by_rows[(at + k) * m + coordinate];
                place.whitening.unwhiten(Vector3::new(of(0), of(1), of(2)))
            };
            let mut moved = place.whitening.unwhiten(Vector3::from_column_slice(&by_readings[at..at + 3]));
            let mut turned = Vector3::zeros();
            self.points.columns_of_base(*x, |coordinate, _, lever| moved += by(coordinate).cross(&lever));
            place.own_columns(axes, |coordinate, column| turned += column.cross(&by(coordinate)));
            sums.fill((Vector3::zeros(), Vector3::zeros()));
            self.points.columns_of_joints(place, &self.joints, *x, |joint, of| {
                let u = by(of.coordinate);
                sums[joint].0 += of.column.cross(&u);
                sums[joint].1 += u.cross(&of.lever);
                slope[joint] += self.rate(joint) * of.own.dot(&u) + of.read.dot(&u);
            });
            turned += sums.iter().map(|(turned, _)| turned).sum::<Vector3<f64>>();
            for (index, joint) in self.points.moving(place) {
                let Turned { axis, pivot, .. } = self.joints.at(index);
                turned -= sums[index].0;
                slope[index] += self.rate(index)
                    * match joint.kind {
                        JointKind::Revolute => axis.dot(&turned) + axis.cross(&(x - pivot)).dot(&moved),
                        JointKind::Prismatic => axis.dot(&moved),
                    };
                moved += sums[index].1;
            }
        }
    }

    /// ∂θ/∂q of a joint.
    fn rate(&self, joint: usize) -> f64 {
        self.points.joints[joint].correction.rate(Plain, self.joints.at(joint).reading)
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::{
            Layout,
            random::{branched, random_stiff_state},
        },
        simd::GROUP,
    };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Readings and rows are those of the lanes, and the slope of any function that is linear in both is that of central
        /// differences, for every kind of block and target.
        #[test]
        fn slopes_are_those_of_central_differences(seed: u64, joints in 1_usize..=8) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, blocks) = random_stiff_state(&mut rng, joints);
            let state = if seed % 2 == 0 { branched(state, &mut rng) } else { state };
            let layout = Layout::new(&state, blocks);
            let full = Matrix3::from_fn(|_, _| rng.random_range(-2.0..2.0));
            let whitenings = [Whitening::Full(full), Whitening::Even(rng.random_range(1.0..3.0))];
            let targets: Vec<(usize, Whitening)> =
                (0..state.targets.len()).map(|target| (target, whitenings[target % 2].clone())).collect();
            let points = Points::new(&state, &layout, &targets).expect("no loads");
            let (m, d) = (layout.dimension(), points.equations());
            let theta: Vec<f64> = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
            let posture = points.at(&theta);
            let (mut rows, mut readings) = (vec![0.0; m * d * GROUP], vec![0.0; d]);
            dispatch!(crate::simd::level(), simd => points.rows(simd, &[&theta], &mut readings, &mut rows));
            for equation in 0..d {
                prop_assert!((posture.readings()[equation] - readings[equation]).abs() < 1e-10);
                for k in 0..m {
                    let (found, wanted) = (posture.rows()[equation * m + k], rows[(k * d + equation) * GROUP]);
                    prop_assert!((found - wanted).abs() < 1e-9, "{equation} {k}: {found} {wanted}");
                }
            }
            let by_readings: Vec<f64> = (0..d).map(|_| rng.random_range(-1.0..1.0)).collect();
            let by_rows: Vec<f64> = (0..d * m).map(|_| rng.random_range(-1.0..1.0)).collect();
            let value = |theta: &[f64]| -> f64 {
                let posture = points.at(theta);
                let whitened = targets.iter().enumerate().flat_map(|(index, (_, whitening))| {
                    let x = Vector3::from_column_slice(&posture.readings()[3 * index..3 * index + 3]);
                    whitening.whiten(x).as_slice().to_vec()
                });
                let of_readings: f64 = whitened.zip(&by_readings).map(|(x, by)| x * by).sum();
                of_readings + posture.rows().iter().zip(&by_rows).map(|(x, by)| x * by).sum::<f64>()
            };
            let mut slope = vec![0.0; joints];
            posture.add_slope((&by_readings, &by_rows), &mut slope);
            for (joint, slope) in slope.iter().enumerate() {
                let moved = |step: f64| {
                    let mut moved = theta.clone();
                    moved[joint] += step;
                    value(&moved)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                prop_assert!((slope - difference).abs() < 1e-5 * (1.0 + slope.abs()), "{joint}: {slope} {difference}");
            }
        }
    }
}
