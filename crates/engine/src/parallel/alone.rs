//! Batches evaluated one after the other on this thread: the form of [`batches`](super) without the feature `parallel`.

/// An evaluator of batches.
pub struct Batches<'a, C> {
    evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync),
}

/// Calls `work` with an evaluator of batches that uses `evaluate`, for `candidates` in all.
pub fn shared<C, R>(
    evaluate: &(dyn Fn(&[C]) -> Vec<f64> + Sync),
    _candidates: usize,
    work: impl FnOnce(&mut Batches<'_, C>) -> R,
) -> R {
    work(&mut Batches::alone(evaluate))
}

impl<'a, C> Batches<'a, C> {
    /// Evaluates them on this thread.
    pub fn alone(evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync)) -> Self {
        Self { evaluate }
    }

    /// The values of all candidates, in order.
    #[expect(clippy::ptr_arg, reason = "where they are shared, parts of a batch go to others and come back")]
    pub fn evaluate(&mut self, candidates: &mut Vec<C>) -> Vec<f64> {
        (self.evaluate)(candidates)
    }
}
