//! Independent work on several cores.

use crate::lanes::GROUP;

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

/// Candidates per batch product at most: enough to fill the matrix kernel, few enough for the caches and to share among cores.
const CHUNK: usize = 16;

/// Into chunks of which size so many candidates are divided: alike, as a small one costs nearly as much as a large one.
fn chunk(candidates: usize) -> usize {
    candidates.div_ceil(candidates.div_ceil(CHUNK)).next_multiple_of(GROUP)
}

/// The values of all candidates, in order, a chunk at a time: on several cores with the feature `parallel`.
pub fn in_chunks<C: Sync>(candidates: &[C], evaluate: impl Fn(&[C]) -> Vec<f64> + Sync) -> Vec<f64> {
    match candidates.len() {
        0 => Vec::new(),
        1..=CHUNK => evaluate(candidates),
        #[cfg(feature = "parallel")]
        count => {
            use rayon::prelude::*;
            candidates.par_chunks(chunk(count)).flat_map_iter(&evaluate).collect()
        }
        #[cfg(not(feature = "parallel"))]
        count => candidates.chunks(chunk(count)).flat_map(evaluate).collect(),
    }
}
