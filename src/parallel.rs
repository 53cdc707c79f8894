//! Independent work on several cores.

use crate::lanes::GROUP;

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

/// Into chunks of which size so many candidates are divided: alike, as a small one costs nearly as much as a large one.
fn chunk(candidates: usize) -> usize {
    candidates.div_ceil(candidates.div_ceil(CHUNK)).next_multiple_of(GROUP)
}

/// The values of all candidates, in order, a chunk at a time: on several cores with the feature `parallel`.
pub fn in_chunks<C: Sync>(candidates: &[C], evaluate: impl Fn(&[C]) -> Vec<f64> + Sync) -> Vec<f64> {
    match candidates.len() {
        0 => Vec::new(),
        1..=CHUNK => evaluate(candidates),
        count => {
            #[cfg(feature = "parallel")]
            if let Some(_pool) = pool::taken() {
                use rayon::prelude::*;
                return candidates.par_chunks(chunk(count)).flat_map_iter(&evaluate).collect();
            }
            candidates.chunks(chunk(count)).flat_map(evaluate).collect()
        }
    }
}

/// The threads that all share.
#[cfg(feature = "parallel")]
mod pool {
    use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

    static TAKEN: Mutex<()> = Mutex::new(());

    /// Of one who has come from elsewhere, until it is dropped; of one of the pool's own threads nothing.
    pub struct Taken(#[expect(dead_code, reason = "held")] Option<MutexGuard<'static, ()>>);

    /// The pool, or `None` while another has it: one who has little to do does not wait behind those who have much, as the
    /// sessions of a server would, but works alone meanwhile.
    pub fn taken() -> Option<Taken> {
        if rayon::current_thread_index().is_some() {
            return Some(Taken(None));
        }
        match TAKEN.try_lock() {
            Ok(pool) => Some(Taken(Some(pool))),
            Err(TryLockError::Poisoned(pool)) => Some(Taken(Some(PoisonError::into_inner(pool)))),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests {
    use std::{
        sync::{Barrier, mpsc},
        thread,
        time::Duration,
    };

    use super::*;

    #[test]
    fn nobody_waits_behind_those_who_have_the_pool() {
        let items: Vec<f64> = (0..40 * rayon::current_num_threads()).map(|item| item as f64).collect();
        let doubled: Vec<f64> = items.iter().map(|item| 2.0 * item).collect();
        let begun = Barrier::new(2);
        let (done, waits) = mpsc::channel::<()>();
        thread::scope(|scope| {
            let (begun, items) = (&begun, &items);
            scope.spawn(move || {
                let first = std::sync::Once::new();
                let waits = std::sync::Mutex::new(waits);
                // Every thread of the pool stands until the other is done, or has given up.
                mapped(items, |item| {
                    first.call_once(|| {
                        begun.wait();
                    });
                    let _held = waits.lock().unwrap().recv_timeout(Duration::from_secs(20));
                    2.0 * item
                });
            });
            begun.wait();
            let (answer, answered) = mpsc::channel();
            scope.spawn(move || {
                let chunked = in_chunks(items, |chunk| chunk.iter().map(|item| 2.0 * item).collect());
                answer.send((mapped(items, |item| 2.0 * item), chunked)).unwrap();
            });
            let answer = answered.recv_timeout(Duration::from_secs(10));
            drop(done);
            assert_eq!(answer.expect("an answer, at once"), (doubled.clone(), doubled));
        });
    }
}
