//! The divisible rectangles, sorted by size and within a size by score.

use std::cmp::Ordering;
use std::collections::BTreeSet;

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

/// The divisible rectangles, a set for each size class in the order in which they are served, so that an iteration looks at one
/// rectangle per size rather than at all.
#[derive(Debug, Clone, Default)]
pub struct SizeClasses {
    classes: Vec<BTreeSet<Entry>>,
    /// Of each rectangle what stands for it in the class that it is in, if it is in one.
    entries: Vec<Option<Entry>>,
    /// How many have arrived.
    arrivals: usize,
}

/// A rectangle in its class: served by its score and, of equal scores, first come, first served.
#[derive(Debug, Clone, Copy)]
struct Entry {
    score: f64,
    arrival: usize,
    rectangle: usize,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.score.total_cmp(&other.score).then(self.arrival.cmp(&other.arrival))
    }
}

impl PartialOrd for Entry {
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

impl SizeClasses {
    /// Knows the first so many rectangles, never fewer than before: those that are new to it are in no class yet.
    pub fn know(&mut self, rectangles: usize) {
        self.entries.resize(rectangles, None);
    }

    /// Adds a rectangle, which is known and in no class, behind those of its class that have the same score.
    pub fn insert(&mut self, class: usize, rectangle: usize, score: f64) {
        if self.classes.len() <= class {
            self.classes.resize_with(class + 1, BTreeSet::new);
        }
        let entry = Entry { score, arrival: self.arrivals, rectangle };
        self.arrivals += 1;
        self.entries[rectangle] = Some(entry);
        self.classes[class].insert(entry);
    }

    /// Takes a rectangle out of its class, and says whether it was there.
    pub fn remove(&mut self, class: usize, rectangle: usize) -> bool {
        self.entries[rectangle].take().is_some_and(|entry| self.classes[class].remove(&entry))
    }

    /// The best rectangle of every class that has one, from the largest size to the smallest.
    pub fn heads(&self) -> impl Iterator<Item = Head> {
        self.classes.iter().enumerate().filter_map(|(class, entries)| {
            let Entry { score, rectangle, .. } = *entries.first()?;
            Some(Head { class, rectangle, score })
        })
    }

    /// The rectangles of a class, other than the best, whose score ties with that of the best, in their order.
    pub fn ties(&self, class: usize) -> impl Iterator<Item = usize> {
        let mut entries = self.classes.get(class).into_iter().flatten();
        let best = entries.next().map_or(f64::NAN, |entry| entry.score);
        // Compared twice, since the difference of two infinite scores is not a number.
        entries.take_while(move |entry| entry.score == best || entry.score - best <= TIE).map(|entry| entry.rectangle)
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
