//! The unit cube that a search divides.

use super::Scope;

/// The unit cube of all joints, of which a search divides those alone that do not follow from others.
#[derive(Clone, Debug)]
pub(super) struct Cube {
    joints: usize,
    pub(super) free: Vec<usize>,
}

impl Cube {
    pub(super) fn new(scope: &Scope<'_>, joints: usize) -> Self {
        let following: Vec<usize> = scope.following().collect();
        Self { joints, free: (0..joints).filter(|joint| !following.contains(joint)).collect() }
    }

    /// A number for each free joint, spread over all joints; `other` for those that follow.
    pub(super) fn spread<T: Copy>(&self, free: &[T], other: T) -> Vec<T> {
        let mut all = vec![other; self.joints];
        self.free.iter().zip(free).for_each(|(joint, x)| all[*joint] = *x);
        all
    }

    /// Of a number for each joint, those of the free joints.
    pub(super) fn free_of(&self, all: &[f64]) -> Vec<f64> {
        self.free.iter().map(|joint| all[*joint]).collect()
    }

    /// A point of the cube of all joints.
    pub(super) fn whole(&self, point: &[f64]) -> Vec<f64> {
        self.spread(point, 0.5)
    }
}
