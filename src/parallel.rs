//! Independent work on several cores.

/// `of` of every item, in order: on several cores with the feature `parallel`. The results do not depend on how many.
pub fn mapped<T: Sync, R: Send>(items: &[T], of: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_iter().map(of).collect()
    }
    #[cfg(not(feature = "parallel"))]
    items.iter().map(of).collect()
}
