//! The joints that a walk along the chain has passed.

use fearless_simd::{Simd, SimdBase};

use crate::lanes::{Aligned, Lanes, Vector};

/// A joint at a few postures: d₁, d₂, f₃ and q; of a prismatic joint θ e₁ and θ e₂ in place of d₁ and d₂.
pub struct Turned<S: Simd> {
    pub swept: [Vector<S>; 2],
    pub axis: Vector<S>,
    /// f₁ and f₂.
    pub basis: [Vector<S>; 2],
    pub pivot: Vector<S>,
    /// The joint's reading, its sine and cosine.
    pub reading: [Lanes<S>; 3],
}

/// Numbers of it for each posture.
const OF_TURNED: usize = 21;

/// The joints that a walk along the chain has passed, at a few postures.
pub struct Passed<S: Simd> {
    simd: S,
    numbers: Aligned,
    /// How many there are.
    pub count: usize,
}

impl<S: Simd> Passed<S> {
    /// None, with room for so many.
    #[inline(always)]
    pub fn with_room(simd: S, joints: usize) -> Self {
        Self { simd, numbers: Aligned::of_any(joints * OF_TURNED * Lanes::<S>::LEN), count: 0 }
    }

    /// Adds the next one.
    #[inline(always)]
    pub fn push(&mut self, turned: &Turned<S>) {
        let width = Lanes::<S>::LEN;
        let numbers = &mut self.numbers[self.count * OF_TURNED * width..][..OF_TURNED * width];
        let Turned { swept: [d1, d2], axis, basis: [f1, f2], pivot, reading } = *turned;
        d1.store(numbers, [0, width, 2 * width]);
        d2.store(numbers, [3 * width, 4 * width, 5 * width]);
        axis.store(numbers, [6 * width, 7 * width, 8 * width]);
        f1.store(numbers, [9 * width, 10 * width, 11 * width]);
        f2.store(numbers, [12 * width, 13 * width, 14 * width]);
        pivot.store(numbers, [15 * width, 16 * width, 17 * width]);
        Vector::<S>(reading).store(numbers, [18 * width, 19 * width, 20 * width]);
        self.count += 1;
    }

    /// One of them.
    #[inline(always)]
    pub fn at(&self, index: usize) -> Turned<S> {
        let (simd, width) = (self.simd, Lanes::<S>::LEN);
        let numbers = &self.numbers[index * OF_TURNED * width..][..OF_TURNED * width];
        Turned {
            swept: [
                Vector::load(simd, numbers, [0, width, 2 * width]),
                Vector::load(simd, numbers, [3 * width, 4 * width, 5 * width]),
            ],
            axis: Vector::load(simd, numbers, [6 * width, 7 * width, 8 * width]),
            basis: [
                Vector::load(simd, numbers, [9 * width, 10 * width, 11 * width]),
                Vector::load(simd, numbers, [12 * width, 13 * width, 14 * width]),
            ],
            pivot: Vector::load(simd, numbers, [15 * width, 16 * width, 17 * width]),
            reading: Vector::load(simd, numbers, [18 * width, 19 * width, 20 * width]).0,
        }
    }
}
