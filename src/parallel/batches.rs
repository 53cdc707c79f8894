//! One batch after the other, each shared with threads that stay at hand: to hand out a few microseconds' work to a thread that
//! sleeps costs more than the work.

#[cfg(feature = "parallel")]
use std::{
    hint::spin_loop,
    sync::mpsc::{Receiver, Sender, TryRecvError, channel},
    thread::yield_now,
};

#[cfg(feature = "parallel")]
use super::pool;
#[cfg(feature = "parallel")]
use crate::lanes::GROUP;

/// Candidates are handed out in so many: as many as the narrower registers of a group hold.
#[cfg(feature = "parallel")]
const SHARE: usize = GROUP / 2;

/// Who helps at most: batches are small.
#[cfg(feature = "parallel")]
const HELPERS: usize = 3;

/// How often one who waits looks again before it lets others go first.
#[cfg(feature = "parallel")]
const LOOKS: usize = 200;

/// Evaluates batches, each in parts where others help.
pub struct Batches<'a, C> {
    evaluate: &'a (dyn Fn(&[C]) -> Vec<f64> + Sync),
    #[cfg(feature = "parallel")]
    helpers: Vec<Helper<C>>,
}

/// One who helps, seen from here.
#[cfg(feature = "parallel")]
struct Helper<C> {
    /// It may begin late, or never while others have more to do.
    is_there: bool,
    asked: Sender<Vec<C>>,
    /// Candidates with their values; at first none, to say that it is there.
    told: Receiver<(Vec<C>, Vec<f64>)>,
}

/// Does `work` with what evaluates batches by `evaluate`: with the feature `parallel` on threads of the pool, too, that have nothing
/// else to do, for as long as the work lasts. `evaluate` says of every candidate what it says of it in any other company, so that values
/// do not depend on who helps.
pub fn shared<C: Send, R>(
    evaluate: &(dyn Fn(&[C]) -> Vec<f64> + Sync),
    work: impl FnOnce(&mut Batches<'_, C>) -> R,
) -> R {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1
        && let Some(_place) = pool::taken()
    {
        return rayon::in_place_scope(|scope| {
            let helper = || {
                let ((asked, asks), (tells, told)) = (channel(), channel());
                scope.spawn(move |_| help(evaluate, &asks, &tells));
                Helper { is_there: false, asked, told }
            };
            let helpers = (1..rayon::current_num_threads()).take(HELPERS).map(|_| helper()).collect();
            work(&mut Batches { evaluate, helpers })
        });
    }
    work(&mut Batches::alone(evaluate))
}

/// Evaluates what is asked until nobody asks any more.
#[cfg(feature = "parallel")]
fn help<C>(evaluate: &(dyn Fn(&[C]) -> Vec<f64> + Sync), asks: &Receiver<Vec<C>>, tells: &Sender<(Vec<C>, Vec<f64>)>) {
    let mut told = tells.send((Vec::new(), Vec::new()));
    while told.is_ok()
        && let Some(candidates) = next(asks)
    {
        let values = evaluate(&candidates);
        told = tells.send((candidates, values));
    }
}

/// What comes next, looked for without falling asleep; `None` once nothing will.
#[cfg(feature = "parallel")]
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
        Self {
            evaluate,
            #[cfg(feature = "parallel")]
            helpers: Vec::new(),
        }
    }

    /// The values of all candidates, in order.
    #[cfg_attr(
        not(feature = "parallel"),
        expect(clippy::ptr_arg, reason = "parts of a batch go to others and come back")
    )]
    pub fn evaluate(&mut self, candidates: &mut Vec<C>) -> Vec<f64> {
        #[cfg(feature = "parallel")]
        if !self.helpers.is_empty() && candidates.len() > 2 * SHARE {
            return self.evaluate_together(candidates);
        }
        (self.evaluate)(candidates)
    }

    #[cfg(feature = "parallel")]
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
