//! Numbers that begin where a cache line does.

use std::ops::{Deref, DerefMut};

/// As many numbers as a cache line holds.
const LINE: usize = 8;

/// Numbers of which every eighth begins a cache line: a register that is read from two lines costs twice as much.
#[derive(Debug, Default)]
pub struct Aligned {
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

impl Aligned {
    /// A buffer of `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut zeros = Self::default();
        zeros.ensure(len);
        zeros
    }

    /// Makes so many of them: zeros where there was no room for so many, else what they were.
    pub fn ensure(&mut self, len: usize) {
        if self.numbers.len() < len + LINE {
            self.numbers = vec![0.0; len + LINE];
        }
        // What cannot be aligned need not be.
        self.first = self.numbers.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE);
        self.len = len;
    }
}

impl Clone for Aligned {
    /// The same numbers, at the beginning of a cache line of their own.
    fn clone(&self) -> Self {
        let mut clone = Self::zeros(self.len);
        clone.copy_from_slice(self);
        clone
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
    fn so_many_numbers_begin_a_line_and_those_there_is_room_for_stay() {
        for len in [0, 1, 97, 4096] {
            let mut numbers = Aligned::zeros(len);
            assert!(numbers.len() == len && numbers.iter().all(|x| *x == 0.0));
            assert!(numbers.as_ptr().addr().is_multiple_of(LINE * size_of::<f64>()));
            numbers.fill(1.0);
            numbers.ensure(len / 2);
            assert!(numbers.len() == len / 2 && numbers.iter().all(|x| *x == 1.0));
            numbers.ensure(3 * len + LINE);
            assert!(numbers.len() == 3 * len + LINE && numbers.iter().all(|x| *x == 0.0));
        }
    }
}
