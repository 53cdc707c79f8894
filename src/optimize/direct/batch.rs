//! The points that a search asks for at a time.

/// Points to evaluate, all of which may be evaluated at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Batch<'a> {
    dimension: usize,
    centres: &'a [f64],
}

impl<'a> Batch<'a> {
    pub(super) fn new(dimension: usize, centres: &'a [f64]) -> Self {
        Self { dimension, centres }
    }

    /// How many points there are: one at least.
    #[expect(clippy::len_without_is_empty, reason = "a batch is never empty")]
    pub fn len(&self) -> usize {
        self.centres.len() / self.dimension
    }

    /// The points in the order in which their values are to be told.
    pub fn iter(&self) -> std::slice::ChunksExact<'a, f64> {
        self.centres.chunks_exact(self.dimension)
    }
}

impl<'a> IntoIterator for Batch<'a> {
    type Item = &'a [f64];
    type IntoIter = std::slice::ChunksExact<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
