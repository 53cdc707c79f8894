//! Several candidates at a time, one in each lane of a vector register.
//!
//! Where one quantity is computed for many candidates, lanes run across candidates: nothing is summed across lanes, so that a
//! value does not depend on which others it is computed with. The widest instructions that the processor has are chosen at run
//! time, by [`dispatch!`](fearless_simd::dispatch), in safe code. A function is compiled for those instructions only where it is
//! inlined into the dispatched one: hence `#[inline(always)]` throughout, and loops instead of closures that are handed lanes.
//! Nothing is multiplied and added at once, and no sum is parted by the width of a register: every processor gives the same bits.
//!
//! In memory, candidates stand in groups of [`GROUP`], whatever the width of a register: for each number of a group, the values
//! of its candidates stand side by side.

mod aligned;
mod level;
mod rotor;
mod space;
mod symmetric;

use std::ops::Range;

use fearless_simd::{Level, Simd, SimdBase};

pub use aligned::Aligned;
pub(crate) use level::level;
pub use level::{Instructions, use_at_most};
pub use rotor::sin_cos;
pub use space::{Rotations, Vector};
pub use symmetric::{add_few_squares, times, times_few, write_times};

/// As many numbers as a register holds.
pub type Lanes<S> = <S as Simd>::f64s;

/// Candidates of a group: the lanes of the widest register that there is.
pub const GROUP: usize = 8;

/// The number `x` in all lanes.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, x: f64) -> Lanes<S> {
    Lanes::<S>::splat(simd, x)
}

/// A register filled with the numbers from `first` on.
#[inline(always)]
pub fn load<S: Simd>(simd: S, numbers: &[f64], first: usize) -> Lanes<S> {
    Lanes::<S>::from_slice(simd, &numbers[first..first + Lanes::<S>::LEN])
}

/// Stores a register at `first`.
#[inline(always)]
pub fn store<S: Simd>(lanes: Lanes<S>, numbers: &mut [f64], first: usize) {
    lanes.store_slice(&mut numbers[first..first + Lanes::<S>::LEN]);
}

/// Sums that run along numbers in [groups](GROUP): one for each place in a group, whatever the width of a register.
#[derive(Clone, Copy)]
pub struct GroupSum<S: Simd>([Lanes<S>; SLOTS]);

/// Registers of a group at most: those of two numbers.
const SLOTS: usize = GROUP / 2;

impl<S: Simd> GroupSum<S> {
    /// A sum of nothing yet.
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        Self([splat(simd, 0.0); SLOTS])
    }

    /// Adds a × b, where a register's numbers begin at `first` of their group.
    #[inline(always)]
    pub fn add_product(&mut self, first: usize, a: Lanes<S>, b: Lanes<S>) {
        let sum = &mut self.0[first % GROUP / Lanes::<S>::LEN];
        *sum = a * b + *sum;
    }

    /// The sum: neighbours first, then neighbouring pairs, then the halves of the group.
    #[inline(always)]
    pub fn total(&self) -> f64 {
        let mut all = [0.0; GROUP];
        for (sum, all) in self.0.iter().zip(all.chunks_exact_mut(Lanes::<S>::LEN)) {
            sum.store_slice(all);
        }
        let [a, b, c, d, e, f, g, h] = all;
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }
}

/// A run of groups that are computed alike.
pub struct Run {
    /// The instructions that suit these groups best.
    pub level: Level,
    /// Which groups.
    pub groups: Range<usize>,
    /// How many candidates each holds.
    pub candidates: usize,
}

/// The runs of groups that hold `candidates`: the full groups, and the last one, which may be half empty. For at most half a
/// group, registers of half the width are enough and give the same bits.
pub fn runs(level: Level, candidates: usize) -> impl Iterator<Item = Run> {
    let (full, left) = (candidates / GROUP, candidates % GROUP);
    let full_ones = Run { level, groups: 0..full, candidates: GROUP };
    let last = Run { level: narrowed(level, left), groups: full..groups(candidates), candidates: left };
    [full_ones, last].into_iter().filter(|run| !run.groups.is_empty())
}

/// The level narrowed to no more lanes than `candidates` need.
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_variables))]
pub fn narrowed(level: Level, candidates: usize) -> Level {
    #[cfg(target_arch = "x86_64")]
    if candidates <= GROUP / 2 && level.as_avx512().is_some() {
        return level.as_avx2().map_or(level, Level::Avx2);
    }
    level
}

/// Groups that hold so many candidates.
pub fn groups(candidates: usize) -> usize {
    candidates.div_ceil(GROUP)
}

/// Every level of instructions that this processor has, the plainest first.
#[cfg(test)]
pub fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(Level::new().as_sse4_2().map(Level::Sse4_2));
        levels.extend(Level::new().as_avx2().map(Level::Avx2));
    }
    levels.push(Level::new());
    levels
}
