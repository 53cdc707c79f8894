//! What a pass along the tree computes with: one posture in plain numbers, or as many as a register holds.

use std::ops::{Add, Mul, Neg, Sub};

use fearless_simd::{Simd, SimdBase};
use nalgebra::{Matrix3, Vector3};

use crate::{
    elementary,
    simd::{self, Lanes, Rotations, Vector},
};

/// Numbers, vectors and rotations of one posture or of several postures side by side.
pub trait Numbers: Copy {
    /// A number for each posture.
    type Number: Copy + Add<Output = Self::Number> + Mul<Output = Self::Number> + Neg<Output = Self::Number>;
    /// A vector for each posture.
    type Vector: Copy + Add<Output = Self::Vector> + Sub<Output = Self::Vector>;
    /// A rotation for each posture.
    type Rotation: Copy;
    /// How many postures there are.
    const COUNT: usize;

    /// The number `x` for every posture.
    fn number(self, x: f64) -> Self::Number;
    /// The vector `v` for every posture.
    fn vector(self, v: &Vector3<f64>) -> Self::Vector;
    /// The rotation `r` for every posture.
    fn rotation(self, r: &Matrix3<f64>) -> Self::Rotation;
    /// The vectors whose components begin at these places.
    fn load(self, numbers: &[f64], at: [usize; 3]) -> Self::Vector;
    /// Puts the components of vectors where these places are.
    fn store(v: Self::Vector, numbers: &mut [f64], at: [usize; 3]);
    /// A vector of these components.
    fn join(components: [Self::Number; 3]) -> Self::Vector;
    /// The components of a vector.
    fn components(v: Self::Vector) -> [Self::Number; 3];
    /// The sum of three. Each kind of numbers has its own order, and always the same one: results depend on it to the last bit.
    fn sum(terms: [Self::Number; 3]) -> Self::Number;
    /// Sine and cosine of angles, radians.
    fn sin_cos(angle: Self::Number) -> (Self::Number, Self::Number);
    /// k v.
    fn scaled(v: Self::Vector, k: Self::Number) -> Self::Vector;
    /// The columns of a rotation's matrix.
    fn columns(r: &Self::Rotation) -> [Self::Vector; 3];
    /// The rotation with these columns.
    fn of_columns(columns: [Self::Vector; 3]) -> Self::Rotation;
    /// R v, for one v at every posture.
    fn times(r: &Self::Rotation, v: &Vector3<f64>) -> Self::Vector;
    /// R C, for one C at every posture.
    fn then(r: &Self::Rotation, c: &Matrix3<f64>) -> Self::Rotation;
    /// R turned about its own third axis by an angle of these sines and cosines.
    fn turned(r: &Self::Rotation, sin: Self::Number, cos: Self::Number) -> Self::Rotation;
}

/// One posture.
#[derive(Clone, Copy, Debug)]
pub struct Plain;

impl Numbers for Plain {
    type Number = f64;
    type Vector = Vector3<f64>;
    type Rotation = Matrix3<f64>;
    const COUNT: usize = 1;

    #[inline(always)]
    fn number(self, x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn vector(self, v: &Vector3<f64>) -> Vector3<f64> {
        *v
    }

    #[inline(always)]
    fn rotation(self, r: &Matrix3<f64>) -> Matrix3<f64> {
        *r
    }

    #[inline(always)]
    fn load(self, numbers: &[f64], at: [usize; 3]) -> Vector3<f64> {
        Vector3::from(at.map(|place| numbers[place]))
    }

    #[inline(always)]
    fn store(v: Vector3<f64>, numbers: &mut [f64], at: [usize; 3]) {
        at.into_iter().zip(v.iter()).for_each(|(place, x)| numbers[place] = *x);
    }

    #[inline(always)]
    fn join(components: [f64; 3]) -> Vector3<f64> {
        Vector3::from(components)
    }

    #[inline(always)]
    fn components(v: Vector3<f64>) -> [f64; 3] {
        v.into()
    }

    #[inline(always)]
    fn sum([a, b, c]: [f64; 3]) -> f64 {
        a + b + c
    }

    #[inline(always)]
    fn sin_cos(angle: f64) -> (f64, f64) {
        elementary::sin_cos(angle)
    }

    #[inline(always)]
    fn scaled(v: Vector3<f64>, k: f64) -> Vector3<f64> {
        v * k
    }

    #[inline(always)]
    fn columns(r: &Matrix3<f64>) -> [Vector3<f64>; 3] {
        [r.column(0).into_owned(), r.column(1).into_owned(), r.column(2).into_owned()]
    }

    #[inline(always)]
    fn of_columns(columns: [Vector3<f64>; 3]) -> Matrix3<f64> {
        Matrix3::from_columns(&columns)
    }

    #[inline(always)]
    fn times(r: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        r * v
    }

    #[inline(always)]
    fn then(r: &Matrix3<f64>, c: &Matrix3<f64>) -> Matrix3<f64> {
        r * c
    }

    #[inline(always)]
    fn turned(r: &Matrix3<f64>, sin: f64, cos: f64) -> Matrix3<f64> {
        let [a, b, c] = Self::columns(r);
        Matrix3::from_columns(&[a * cos + b * sin, b * cos - a * sin, c])
    }
}

impl<S: Simd> Numbers for S {
    type Number = Lanes<S>;
    type Vector = Vector<S>;
    type Rotation = Rotations<S>;
    const COUNT: usize = Lanes::<S>::LEN;

    #[inline(always)]
    fn number(self, x: f64) -> Lanes<S> {
        simd::splat(self, x)
    }

    #[inline(always)]
    fn vector(self, v: &Vector3<f64>) -> Vector<S> {
        Vector::splat(self, v)
    }

    #[inline(always)]
    fn rotation(self, r: &Matrix3<f64>) -> Rotations<S> {
        Rotations::splat(self, r)
    }

    #[inline(always)]
    fn load(self, numbers: &[f64], at: [usize; 3]) -> Vector<S> {
        Vector::load(self, numbers, at)
    }

    #[inline(always)]
    fn store(v: Vector<S>, numbers: &mut [f64], at: [usize; 3]) {
        v.store(numbers, at);
    }

    #[inline(always)]
    fn join(components: [Lanes<S>; 3]) -> Vector<S> {
        Vector(components)
    }

    #[inline(always)]
    fn components(v: Vector<S>) -> [Lanes<S>; 3] {
        v.0
    }

    #[inline(always)]
    fn sum([a, b, c]: [Lanes<S>; 3]) -> Lanes<S> {
        b + (c + a)
    }

    #[inline(always)]
    fn sin_cos(angle: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
        simd::sin_cos::<S>(angle)
    }

    #[inline(always)]
    fn scaled(v: Vector<S>, k: Lanes<S>) -> Vector<S> {
        v.scaled(k)
    }

    #[inline(always)]
    fn columns(r: &Rotations<S>) -> [Vector<S>; 3] {
        r.0
    }

    #[inline(always)]
    fn of_columns(columns: [Vector<S>; 3]) -> Rotations<S> {
        Rotations(columns)
    }

    #[inline(always)]
    fn times(r: &Rotations<S>, v: &Vector3<f64>) -> Vector<S> {
        r.times(v)
    }

    #[inline(always)]
    fn then(r: &Rotations<S>, c: &Matrix3<f64>) -> Rotations<S> {
        r.then(c)
    }

    #[inline(always)]
    fn turned(r: &Rotations<S>, sin: Lanes<S>, cos: Lanes<S>) -> Rotations<S> {
        r.turned(sin, cos)
    }
}
