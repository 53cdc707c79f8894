//! One batch after the other, each shared with threads that stay at hand: to hand out a few microseconds' work to a thread that
//! sleeps costs more than the work.

use std::{
    hint::spin_loop,
    sync::mpsc::{Receiver, Sender, TryRecvError, channel},
    thread::yield_now,
    time::Instant,
};

use super::pool;
use crate::lanes::GROUP;

/// Candidates are shared in portions of this size: the lanes of the narrower registers of a group.
const SHARE: usize = GROUP / 2;

/// The most helpers of a batch: batches are small.
const HELPERS: usize = 3;

/// How often a waiting thread looks again before it lets others go first.
const LOOKS: usize = 200;

/// Seconds of work for which waking helpers pays: that takes them a tenth of this.
const WORTH_A_CALL: f64 = 5e-4;

/// Seconds of work in a batch for which it pays to hand over a part.
const WORTH_SHARING: f64 = 5e-6;

/// The number of candidates from which the cost of one is estimated.
const JUDGED: usize = 24;

/// An evaluator of batches, each divided among helpers where there are any.
pub struct Batches<'a, C> {
    evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync),
    helpers: Vec<Helper<C>>,
    /// How to call helpers, once it is known that they pay.
    call: Option<Call<'a, C>>,
    /// The least number of candidates for which a batch is shared.
    fewest: usize,
}

/// The state before helpers are called.
struct Call<'a, C> {
    helpers: &'a dyn Fn() -> Vec<Helper<C>>,
    /// The number of candidates still to come.
    to_come: usize,
    /// The number of candidates evaluated so far, and the seconds that they took.
    evaluated: usize,
    seconds: f64,
}

/// A helper, seen from the calling thread.
struct Helper<C> {
    /// It may begin late, or never while others have more to do.
    is_there: bool,
    asked: Sender<Vec<C>>,
    /// Candidates with their values; at first an empty message, which says that the helper is there.
    told: Receiver<(Vec<C>, Vec<f64>)>,
}

/// Calls `work` with an evaluator of batches that uses `evaluate`, for `candidates` in all. Where there is enough work, idle
/// threads of the pool help for as long as it lasts. `evaluate` must give a candidate the same value in any batch, so that
/// values do not depend on who helps.
pub fn shared<C: Send, R>(
    evaluate: &(dyn Fn(&[C]) -> Vec<f64> + Sync),
    candidates: usize,
    work: impl FnOnce(&mut Batches<'_, C>) -> R,
) -> R {
    if rayon::current_num_threads() > 1
        && let Some(_place) = pool::taken()
    {
        return rayon::in_place_scope(|scope| {
            let helper = || {
                let ((asked, asks), (tells, told)) = (channel(), channel());
                scope.spawn(move |_| help(evaluate, &asks, &tells));
                Helper { is_there: false, asked, told }
            };
            let helpers = || (1..rayon::current_num_threads()).take(HELPERS).map(|_| helper()).collect();
            let call = Call { helpers: &helpers, to_come: candidates, evaluated: 0, seconds: 0.0 };
            work(&mut Batches { call: Some(call), ..Batches::alone(evaluate) })
        });
    }
    work(&mut Batches::alone(evaluate))
}

/// Evaluates what is asked until nobody asks any more.
fn help<C>(evaluate: &(dyn Fn(&[C]) -> Vec<f64> + Sync), asks: &Receiver<Vec<C>>, tells: &Sender<(Vec<C>, Vec<f64>)>) {
    let mut told = tells.send((Vec::new(), Vec::new()));
    while told.is_ok()
        && let Some(candidates) = next(asks)
    {
        let values = evaluate(&candidates);
        told = tells.send((candidates, values));
    }
}

/// The next message, awaited without falling asleep; `None` once there will be none.
fn next<T>(from: &Receiver<T>) -> Option<T> {
    let mut looks = 0;
    loop {
        match from.try_recv() {
            Ok(found) => return Some(found),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) if looks < LOOKS => {
                looks += 1;
                spin_loop();
            }
            Err(TryRecvError::Empty) => yield_now(),
        }
    }
}

impl<'a, C> Batches<'a, C> {
    /// Evaluates them on this thread.
    pub fn alone(evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync)) -> Self {
        Self { evaluate, helpers: Vec::new(), call: None, fewest: 0 }
    }

    /// The values of all candidates, in order.
    pub fn evaluate(&mut self, candidates: &mut Vec<C>) -> Vec<f64> {
        if let Some(call) = self.call.take() {
            return self.judge(call, candidates);
        }
        if !self.helpers.is_empty() && candidates.len() >= self.fewest {
            return self.evaluate_together(candidates);
        }
        (self.evaluate)(candidates)
    }

    /// Evaluates them here, and calls others if what is left takes long enough.
    fn judge(&mut self, mut call: Call<'a, C>, candidates: &[C]) -> Vec<f64> {
        let start = Instant::now();
        let values = (self.evaluate)(candidates);
        call.to_come = call.to_come.saturating_sub(candidates.len());
        // The first one finds nothing in the caches.
        if candidates.len() > 1 {
            call.evaluated += candidates.len();
            call.seconds += start.elapsed().as_secs_f64();
        }
        let each = call.seconds / call.evaluated as f64;
        if call.evaluated < JUDGED {
            self.call = Some(call);
        } else if each * call.to_come as f64 > WORTH_A_CALL {
            self.helpers = (call.helpers)();
            self.fewest = (2 * SHARE + 1).max((WORTH_SHARING / each) as usize);
        }
        values
    }

    fn evaluate_together(&mut self, candidates: &mut Vec<C>) -> Vec<f64> {
        for helper in &mut self.helpers {
            helper.is_there |= helper.told.try_recv().is_ok();
        }
        let mut sharers = 1 + self.helpers.iter().filter(|helper| helper.is_there).count();
        let mut asked = Vec::with_capacity(sharers);
        for helper in self.helpers.iter().filter(|helper| helper.is_there) {
            // What does not divide evenly stays here, where nothing has to be handed over.
            let left = candidates.len().div_ceil(SHARE);
            let part = candidates.split_off(((left - left / sharers) * SHARE).min(candidates.len()));
            sharers -= 1;
            if !part.is_empty() {
                helper.asked.send(part).expect("whoever is there waits for work");
                asked.push(helper);
            }
        }
        let mut values = (self.evaluate)(candidates);
        // The last part was taken from the front of what was left.
        for helper in asked.into_iter().rev() {
            let (mut part, of_part) = next(&helper.told).expect("whoever is asked tells");
            candidates.append(&mut part);
            values.extend(of_part);
        }
        values
    }
}
