//! The divisible rectangles, sorted by size and within a size by score.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Scores this close are taken for equal when all best rectangles of a size are divided: the figure of
/// Gablonsky's code. Rounding makes symmetric points differ in their last bits, and the published counts rest on
/// dividing such points together.
const TIE: f64 = 1e-13;

/// A rectangle within its class. Equal scores are served first come, first served.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    rank: i64,
    arrival: usize,
    rectangle: usize,
}

impl Entry {
    fn new(score: f64, arrival: usize, rectangle: usize) -> Self {
        Self { rank: flipped(score.to_bits() as i64), arrival, rectangle }
    }

    fn score(self) -> f64 {
        f64::from_bits(flipped(self.rank) as u64)
    }
}

/// Makes integers that are in the order of `f64::total_cmp` of a number's bits, and bits of those.
fn flipped(bits: i64) -> i64 {
    bits ^ ((bits >> 63) as u64 >> 1) as i64
}

/// The best rectangle of a size class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    pub class: usize,
    pub rectangle: usize,
    pub score: f64,
}

/// One heap per size class, so that an iteration looks at one rectangle per size rather than at all.
///
/// What is taken out stays in its heap until it gets to the top: a rectangle's entry counts only as long as it is the latest.
#[derive(Debug, Clone, Default)]
pub struct SizeClasses {
    classes: Vec<BinaryHeap<Reverse<Entry>>>,
    /// When each rectangle joined the class that it is in; 0 if it is in none.
    arrivals: Vec<usize>,
    clock: usize,
}

impl SizeClasses {
    /// With room for so many rectangles.
    pub fn with_room(room: usize) -> Self {
        Self { arrivals: Vec::with_capacity(room), ..Self::default() }
    }

    /// Adds a rectangle, which is in no class, behind those of its class that have the same score.
    pub fn insert(&mut self, class: usize, rectangle: usize, score: f64) {
        if self.classes.len() <= class {
            self.classes.resize_with(class + 1, BinaryHeap::new);
        }
        if self.arrivals.len() <= rectangle {
            self.arrivals.resize(rectangle + 1, 0);
        }
        self.clock += 1;
        self.arrivals[rectangle] = self.clock;
        self.classes[class].push(Reverse(Entry::new(score, self.clock, rectangle)));
    }

    /// Takes a rectangle out of its class, and says whether it was there.
    pub fn remove(&mut self, class: usize, rectangle: usize) -> bool {
        let was_there = self.arrivals.get_mut(rectangle).is_some_and(|arrival| std::mem::take(arrival) > 0);
        if let Some(heap) = self.classes.get_mut(class) {
            while heap.peek().is_some_and(|Reverse(entry)| self.arrivals[entry.rectangle] != entry.arrival) {
                heap.pop();
            }
        }
        was_there
    }

    /// The best rectangle of every class that has one, from the largest size to the smallest.
    pub fn heads(&self) -> impl Iterator<Item = Head> {
        self.classes.iter().enumerate().filter_map(|(class, heap)| {
            let &Reverse(entry) = heap.peek()?;
            Some(Head { class, rectangle: entry.rectangle, score: entry.score() })
        })
    }

    /// The rectangles of a class, other than the best, whose score ties with that of the best, in their order.
    pub fn ties(&self, class: usize) -> impl Iterator<Item = usize> {
        let entries = self.classes.get(class).map_or(&[][..], BinaryHeap::as_slice);
        let best = entries.first().map_or(f64::NAN, |Reverse(entry)| entry.score());
        let mut ties = Vec::new();
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            let Some(Reverse(entry)) = entries.get(node) else { continue };
            // Compared twice, since the difference of two infinite scores is not a number. What is below a node is no better.
            if entry.score() == best || entry.score() - best <= TIE {
                ties.extend((self.arrivals[entry.rectangle] == entry.arrival).then_some(*entry));
                open.extend([2 * node + 1, 2 * node + 2]);
            }
        }
        ties.sort_unstable();
        ties.into_iter().skip(1).map(|entry| entry.rectangle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_run_from_large_to_small_and_skip_empty_classes() {
        let mut classes = SizeClasses::default();
        classes.insert(4, 0, 1.0);
        classes.insert(1, 1, 3.0);
        classes.insert(4, 2, 0.5);
        let heads: Vec<_> = classes.heads().collect();
        let expected = [(1, 1, 3.0), (4, 2, 0.5)];
        assert_eq!(heads, expected.map(|(class, rectangle, score)| Head { class, rectangle, score }));
        assert!(classes.remove(4, 2) && !classes.remove(4, 2));
        assert_eq!(classes.heads().nth(1).map(|head| head.rectangle), Some(0));
    }

    #[test]
    fn ranks_are_in_the_order_of_scores_and_lose_nothing() {
        let scores = [f64::NEG_INFINITY, -1e300, -2.0, -1e-300, 0.0, 5e-324, 1.0, 1.0 + f64::EPSILON, f64::INFINITY];
        for pair in scores.windows(2) {
            assert!(Entry::new(pair[0], 1, 1) < Entry::new(pair[1], 0, 0));
        }
        assert!(scores.iter().all(|score| Entry::new(*score, 0, 0).score().to_bits() == score.to_bits()));
    }

    #[test]
    fn equal_scores_are_served_in_order_of_arrival() {
        let mut classes = SizeClasses::default();
        for rectangle in [7, 3, 5] {
            classes.insert(0, rectangle, 1.0);
        }
        assert!(classes.remove(0, 7));
        classes.insert(0, 7, 1.0);
        assert_eq!(classes.heads().next().map(|head| head.rectangle), Some(3));
        assert_eq!(classes.ties(0).collect::<Vec<_>>(), [5, 7]);
    }

    #[test]
    fn ties_allow_for_rounding_and_for_infinite_scores() {
        let mut classes = SizeClasses::default();
        for (rectangle, score) in [(0, 1.0), (1, 1.0 + 1e-14), (2, 1.0 + 1e-12)] {
            classes.insert(0, rectangle, score);
        }
        assert_eq!(classes.ties(0).collect::<Vec<_>>(), [1]);
        classes.insert(1, 3, f64::INFINITY);
        classes.insert(1, 4, f64::INFINITY);
        assert_eq!(classes.ties(1).collect::<Vec<_>>(), [4]);
        assert_eq!(classes.ties(9).count(), 0);
    }

    /// Against a list that is sorted anew at every turn, with rectangles that leave from the middle and come back.
    #[test]
    fn order_survives_those_who_leave() {
        let (mut classes, mut listed) = (SizeClasses::default(), Vec::<(f64, usize, usize)>::new());
        for turn in 0..2_000_usize {
            let rectangle = turn * 7_919 % 61;
            let was_there = listed.iter().any(|known| known.2 == rectangle);
            assert_eq!(classes.remove(0, rectangle), was_there);
            listed.retain(|known| known.2 != rectangle);
            if turn % 3 > 0 {
                let score = (turn * 31 % 5) as f64;
                classes.insert(0, rectangle, score);
                listed.push((score, turn, rectangle));
            }
            listed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let best = listed.first().map(|known| known.2);
            assert_eq!(classes.heads().next().map(|head| head.rectangle), best);
            let ties = listed.iter().filter(|known| known.0 == listed[0].0).skip(1).map(|known| known.2);
            assert!(classes.ties(0).eq(ties));
        }
    }
}
