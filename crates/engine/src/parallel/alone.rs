//! One batch after the other on this thread: what [`batches`](super) is without the feature `parallel`.

/// Evaluates batches.
pub struct Batches<'a, C> {
    evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync),
}

/// Does `work` with what evaluates batches by `evaluate`, `candidates` in all.
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
