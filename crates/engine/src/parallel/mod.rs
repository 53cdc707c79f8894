//! Independent work on several cores.

use crate::simd::GROUP;

/// `of` of every item, in order: on several cores with the feature `parallel`. The results do not depend on how many.
pub fn mapped<T: Sync, R: Send>(items: &[T], of: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if let Some(_pool) = pool::taken() {
        use rayon::prelude::*;
        return items.par_iter().map(of).collect();
    }
    items.iter().map(of).collect()
}

/// Candidates per batch product at most: enough to fill the matrix kernel, few enough for the caches and to share among cores.
const CHUNK: usize = 16;

/// The chunk size for so many candidates: chunks of nearly equal size, as a small one costs nearly as much as a large
/// one.
fn chunk(candidates: usize) -> usize {
    candidates.div_ceil(candidates.div_ceil(CHUNK)).next_multiple_of(GROUP)
}

/// The values of all candidates, in order, a chunk at a time: on several cores with the feature `parallel`.
pub fn in_chunks<C: Sync>(candidates: &[C], evaluate: impl Fn(&[C]) -> Vec<f64> + Sync) -> Vec<f64> {
    #[cfg(feature = "parallel")]
    if candidates.len() > CHUNK
        && let Some(_pool) = pool::taken()
    {
        use rayon::prelude::*;
        return candidates.par_chunks(chunk(candidates.len())).flat_map_iter(&evaluate).collect();
    }
    in_turn(candidates, evaluate)
}

/// The values of all candidates, in order, a chunk at a time, on this thread.
pub fn in_turn<C>(candidates: &[C], evaluate: impl Fn(&[C]) -> Vec<f64>) -> Vec<f64> {
    match candidates.len() {
        0 => Vec::new(),
        1..=CHUNK => evaluate(candidates),
        count => candidates.chunks(chunk(count)).flat_map(evaluate).collect(),
    }
}

/// The threads that all share.
#[cfg(feature = "parallel")]
mod pool {
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// How many callers from other threads are at work there.
    static TAKEN: AtomicUsize = AtomicUsize::new(0);

    /// The place of a caller from another thread in the pool, until it is dropped; the pool's own threads need none.
    pub struct Seat {
        is_counted: bool,
    }

    /// The number of places: with two threads for each nobody waits long.
    pub fn places() -> usize {
        (rayon::current_num_threads() / 2).max(1)
    }

    /// Takes a place in the pool; `None` while all are taken. A caller with little to do then works alone rather than wait
    /// behind those with much, as the sessions of a server would.
    pub fn taken() -> Option<Seat> {
        if rayon::current_thread_index().is_some() {
            return Some(Seat { is_counted: false });
        }
        let places = places();
        let one_more = |taken| (taken < places).then_some(taken + 1);
        TAKEN.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).ok().map(|_| Seat { is_counted: true })
    }

    impl Drop for Seat {
        fn drop(&mut self) {
            if self.is_counted {
                TAKEN.fetch_sub(1, Ordering::Relaxed);
            }
        }
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn nobody_waits_for_a_place_in_the_pool() {
        let items: Vec<f64> = (0..100).map(f64::from).collect();
        let doubled: Vec<f64> = items.iter().map(|item| 2.0 * item).collect();
        let mut held = Vec::new();
        // Other tests come and go.
        while held.len() < pool::places() {
            held.extend(pool::taken());
            thread::yield_now();
        }
        let here = thread::current().id();
        let double = |item: &f64| {
            assert_eq!(thread::current().id(), here);
            2.0 * item
        };
        assert_eq!(mapped(&items, double), doubled);
        assert_eq!(in_chunks(&items, |chunk| chunk.iter().map(double).collect()), doubled);
        drop(held);
        // The same where it has one.
        assert_eq!(mapped(&items, |item| 2.0 * item), doubled);
    }
}
