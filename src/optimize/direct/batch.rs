//! The points that a search asks for at a time.

use super::partition::Rectangles;

/// Points to evaluate, all of which may be evaluated at once.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    rectangles: &'a Rectangles,
    centres: &'a [f64],
}

impl PartialEq for Batch<'_> {
    /// Whether the points are the same.
    fn eq(&self, other: &Self) -> bool {
        self.rectangles.dimension == other.rectangles.dimension && self.centres == other.centres
    }
}

impl<'a> Batch<'a> {
    pub(super) fn new(rectangles: &'a Rectangles, centres: &'a [f64]) -> Self {
        Self { rectangles, centres }
    }

    /// How many points there are: one at least.
    #[expect(clippy::len_without_is_empty, reason = "a batch is never empty")]
    pub fn len(&self) -> usize {
        self.centres.len() / self.rectangles.dimension
    }

    /// The points in the order in which their values are to be told.
    pub fn iter(&self) -> std::slice::ChunksExact<'a, f64> {
        self.centres.chunks_exact(self.rectangles.dimension)
    }
}

impl<'a> IntoIterator for Batch<'a> {
    type Item = &'a [f64];
    type IntoIter = std::slice::ChunksExact<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
