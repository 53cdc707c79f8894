//! Numbers that begin where a cache line does.

use std::{
    cell::RefCell,
    ops::{Deref, DerefMut},
};

/// As many numbers as a cache line holds.
const LINE: usize = 8;

/// How many buffers a thread keeps for the next caller, and the largest size kept, in numbers.
const KEPT: usize = 6;
const LARGEST: usize = 1 << 16;

thread_local! {
    /// Buffers that are not in use. Allocating one costs a good part of the few microseconds that the work takes.
    static SPARE: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// A buffer of numbers of which every eighth begins a cache line: reading a register from two lines costs twice as
/// much.
#[derive(Debug, Default)]
pub struct Aligned {
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

impl Aligned {
    /// A buffer of `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut zeros = Self::of_any(len);
        zeros.fill(0.0);
        zeros
    }

    /// A buffer of `len` numbers with any values; each must be written before it is read.
    pub fn of_any(len: usize) -> Self {
        let spare = || SPARE.with_borrow_mut(|spare| spare.pop());
        let mut any =
            Self { numbers: if len > LARGEST { None } else { spare() }.unwrap_or_default(), first: 0, len: 0 };
        any.ensure(len);
        any
    }

    /// Resizes the buffer to `len` numbers: zeros if it had no room for them, otherwise whatever they were.
    pub fn ensure(&mut self, len: usize) {
        if self.numbers.len() < len + LINE {
            self.numbers = vec![0.0; (len + LINE).next_power_of_two()];
        }
        // What cannot be aligned need not be.
        self.first = self.numbers.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE);
        self.len = len;
    }
}

impl Drop for Aligned {
    fn drop(&mut self) {
        let numbers = std::mem::take(&mut self.numbers);
        if (1..=2 * LARGEST).contains(&numbers.len()) {
            // A thread that ends keeps nothing.
            let _ = SPARE.try_with(|spare| {
                let mut spare = spare.borrow_mut();
                if spare.len() < KEPT {
                    spare.push(numbers);
                }
            });
        }
    }
}

impl Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[self.first..self.first + self.len]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.first..self.first + self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_used_again_and_zeros_are_zero() {
        for round in 0..3 {
            let all: Vec<Aligned> = (0..2 * KEPT)
                .map(|index| {
                    let mut zeros = Aligned::zeros(97 * index + round);
                    assert_eq!(zeros.len(), 97 * index + round);
                    assert!(zeros.iter().all(|x| *x == 0.0));
                    zeros.fill(f64::NAN);
                    zeros
                })
                .collect();
            assert!(all.iter().all(|numbers| numbers.iter().all(|x| x.is_nan())));
            drop(all);
            assert!(SPARE.with_borrow(|spare| spare.len() <= KEPT));
        }
    }
}
