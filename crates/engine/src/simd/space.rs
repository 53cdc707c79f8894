//! Vectors and frames in space.

use std::ops::{Add, Neg, Sub};

use fearless_simd::{ExtractToken, Simd};
use nalgebra::{Matrix3, Vector3};

use super::{Lanes, load, splat, store};

/// A vector (three components) for each candidate.
#[derive(Clone, Copy)]
pub struct Vector<S: Simd>(pub [Lanes<S>; 3]);

impl<S: Simd> Vector<S> {
    /// The vector `v` in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, v: &Vector3<f64>) -> Self {
        Self([splat(simd, v.x), splat(simd, v.y), splat(simd, v.z)])
    }

    /// The vectors whose components begin at these places.
    #[inline(always)]
    pub fn load(simd: S, numbers: &[f64], [x, y, z]: [usize; 3]) -> Self {
        Self([load(simd, numbers, x), load(simd, numbers, y), load(simd, numbers, z)])
    }

    /// Puts the components where these places are.
    #[inline(always)]
    pub fn store(self, numbers: &mut [f64], [at_x, at_y, at_z]: [usize; 3]) {
        let [x, y, z] = self.0;
        store::<S>(x, numbers, at_x);
        store::<S>(y, numbers, at_y);
        store::<S>(z, numbers, at_z);
    }

    /// k v.
    #[inline(always)]
    pub fn scaled(self, k: Lanes<S>) -> Self {
        let [x, y, z] = self.0;
        Self([x * k, y * k, z * k])
    }

    /// k v + other.
    #[inline(always)]
    pub fn scaled_onto(self, k: Lanes<S>, other: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        Self([x * k + a, y * k + b, z * k + c])
    }

    /// v × other.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        Self([y * c - z * b, z * a - x * c, x * b - y * a])
    }

    /// v × other + sum.
    #[inline(always)]
    pub fn cross_onto(self, other: Self, sum: Self) -> Self {
        let ([x, y, z], [a, b, c], [u, v, w]) = (self.0, other.0, sum.0);
        Self([y * c + ((-z) * b + u), z * a + ((-x) * c + v), x * b + ((-y) * a + w)])
    }

    /// v · other.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<S> {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        x * a + (y * b + z * c)
    }

    /// A v, for one A in all lanes.
    #[inline(always)]
    pub fn through(self, a: &Matrix3<f64>) -> Self {
        let [x, y, z] = self.0;
        let frame = Rotations::splat(x.token(), a);
        let [a, b, c] = frame.0;
        a.scaled_onto(x, b.scaled_onto(y, c.scaled(z)))
    }
}

impl<S: Simd> Add for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        Self([x + a, y + b, z + c])
    }
}

impl<S: Simd> Sub for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        Self([x - a, y - b, z - c])
    }
}

impl<S: Simd> Neg for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let [x, y, z] = self.0;
        Self([-x, -y, -z])
    }
}

/// A rotation for each candidate: the columns of its matrix.
#[derive(Clone, Copy)]
pub struct Rotations<S: Simd>(pub [Vector<S>; 3]);

impl<S: Simd> Rotations<S> {
    /// The rotation in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, rotation: &Matrix3<f64>) -> Self {
        let [a, b, c] = columns(rotation);
        Self([Vector::splat(simd, &a), Vector::splat(simd, &b), Vector::splat(simd, &c)])
    }

    /// R v, for one v in all lanes.
    #[inline(always)]
    pub fn times(&self, v: &Vector3<f64>) -> Vector<S> {
        let ([a, b, c], simd) = (self.0, self.0[0].0[0].token());
        a.scaled_onto(splat(simd, v.x), b.scaled_onto(splat(simd, v.y), c.scaled(splat(simd, v.z))))
    }

    /// R v + sum.
    #[inline(always)]
    pub fn times_onto(&self, v: Vector<S>, sum: Vector<S>) -> Vector<S> {
        let ([a, b, c], [x, y, z]) = (self.0, v.0);
        a.scaled_onto(x, b.scaled_onto(y, c.scaled_onto(z, sum)))
    }

    /// R C, for one C in all lanes.
    #[inline(always)]
    pub fn then(&self, c: &Matrix3<f64>) -> Self {
        let [x, y, z] = columns(c);
        Self([self.times(&x), self.times(&y), self.times(&z)])
    }

    /// This rotation followed by one about its own third axis, by an angle with this sine and cosine.
    #[inline(always)]
    pub fn turned(&self, sine: Lanes<S>, cosine: Lanes<S>) -> Self {
        let [a, b, c] = self.0;
        Self([a.scaled_onto(cosine, b.scaled(sine)), b.scaled_onto(cosine, a.scaled(-sine)), c])
    }
}

#[inline(always)]
fn columns(a: &Matrix3<f64>) -> [Vector3<f64>; 3] {
    [Vector3::new(a.m11, a.m21, a.m31), Vector3::new(a.m12, a.m22, a.m32), Vector3::new(a.m13, a.m23, a.m33)]
}
