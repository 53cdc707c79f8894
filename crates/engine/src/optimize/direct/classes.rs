//! The divisible rectangles, sorted by size and within a size by score.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Scores this close are taken for equal when all best rectangles of a size are divided: the figure of
/// Gablonsky's code. Rounding makes symmetric points differ in their last bits, and the published counts rest on
/// dividing such points together.
const TIE: f64 = 1e-13;

/// The best rectangle of a size class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    pub class: usize,
    pub rectangle: usize,
    pub score: f64,
}

/// What a heap holds: a rectangle's score and arrival. The greatest is who is served first: of the least score and, of equal
/// scores, the first to come.
#[derive(Debug, Clone, Copy)]
struct Entry {
    score: f64,
    arrival: usize,
}

impl Entry {
    fn is_latest(&self, arrived: &[usize], arrivals: &[usize]) -> bool {
        arrivals[arrived[self.arrival]] == self.arrival
    }
}

impl Ord for Entry {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        other.score.total_cmp(&self.score).then(other.arrival.cmp(&self.arrival))
    }
}

impl PartialOrd for Entry {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

/// One heap per size class, so that an iteration looks at one rectangle per size rather than at all. Equal scores are served
/// first come, first served.
///
/// What is taken out stays in its heap until it gets to the top: an arrival counts only as long as it is the rectangle's
/// latest.
#[derive(Debug, Clone, Default)]
pub struct SizeClasses {
    classes: Vec<BinaryHeap<Entry>>,
    /// Who arrived, in the order of arrival.
    arrived: Vec<usize>,
    /// Of each rectangle the arrival in the class that it is in; [`NOWHERE`] if it is in none.
    arrivals: Vec<usize>,
}

/// The arrival of a rectangle that is in no class.
const NOWHERE: usize = usize::MAX;

/// Rectangles of a class for which there is room from the beginning.
const CLASS_ROOM: usize = 64;

impl SizeClasses {
    /// Knows the first so many rectangles, never fewer than before: those that are new to it are in no class yet.
    pub fn know(&mut self, rectangles: usize) {
        self.arrivals.resize(rectangles, NOWHERE);
    }

    /// Adds a rectangle, which is known and in no class, behind those of its class that have the same score.
    #[inline]
    pub fn insert(&mut self, class: usize, rectangle: usize, score: f64) {
        if self.classes.len() <= class {
            self.classes.resize_with(class + 1, || BinaryHeap::with_capacity(CLASS_ROOM));
        }
        let arrival = self.arrived.len();
        self.arrived.push(rectangle);
        self.arrivals[rectangle] = arrival;
        self.classes[class].push(Entry { score, arrival });
    }

    /// Takes a rectangle out of its class, and says whether it was there.
    pub fn remove(&mut self, class: usize, rectangle: usize) -> bool {
        let Self { classes, arrived, arrivals } = self;
        let arrival = std::mem::replace(&mut arrivals[rectangle], NOWHERE);
        if let Some(heap) = classes.get_mut(class) {
            while heap.peek().is_some_and(|entry| !entry.is_latest(arrived, arrivals)) {
                heap.pop();
            }
        }
        arrival != NOWHERE
    }

    /// The best rectangle of every class that has one, from the largest size to the smallest.
    pub fn heads(&self) -> impl Iterator<Item = Head> {
        self.classes.iter().enumerate().filter_map(|(class, heap)| {
            let Entry { score, arrival } = *heap.peek()?;
            Some(Head { class, rectangle: self.arrived[arrival], score })
        })
    }

    /// The rectangles of a class, other than the best, whose score ties with that of the best, in their order.
    pub fn ties(&self, class: usize) -> impl Iterator<Item = usize> {
        let entries = self.classes.get(class).map_or(&[][..], BinaryHeap::as_slice);
        let best = entries.first().map_or(f64::NAN, |entry| entry.score);
        let mut ties = Vec::new();
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            let Some(&entry) = entries.get(node) else { continue };
            // Compared twice, since the difference of two infinite scores is not a number. What is below a node is no better.
            if entry.score == best || entry.score - best <= TIE {
                ties.extend(entry.is_latest(&self.arrived, &self.arrivals).then_some(entry));
                open.extend([2 * node + 1, 2 * node + 2]);
            }
        }
        ties.sort_unstable_by(|a, b| b.cmp(a));
        ties.into_iter().skip(1).map(|entry| self.arrived[entry.arrival])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(rectangles: usize) -> SizeClasses {
        let mut classes = SizeClasses::default();
        classes.know(rectangles);
        classes
    }

    #[test]
    fn heads_run_from_large_to_small_and_skip_empty_classes() {
        let mut classes = known(10);
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
    fn equal_scores_are_served_in_order_of_arrival() {
        let mut classes = known(10);
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
        let mut classes = known(10);
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
        let (mut classes, mut listed) = (known(61), Vec::<(f64, usize, usize)>::new());
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
