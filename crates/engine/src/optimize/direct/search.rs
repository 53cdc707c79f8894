//! The search itself: ask, tell, divide, choose.

use std::ops::Range;

use super::batch::Batch;
use super::classes::SizeClasses;
use super::hull::{HullPoint, lower_right_hull};
use super::lineage::{Lineage, surrogate};
use super::partition::{Division, Rectangles};
use super::settings::{DirectError, Settings, Variant};

/// A search of the unit cube by DIRECT or DIRECT-l, as told by the [`Variant`](super::Variant).
///
/// The search asks for a batch of points at a time, everything one iteration samples, and is told their values, so
/// that the caller decides how to evaluate them, when to stop, and what to look at in between:
///
/// ```
/// use body_schema_engine::optimize::{Direct, Settings};
///
/// let mut direct = Direct::new(2, Settings { max_evaluations: 100, ..Settings::default() })?;
/// while let Some(batch) = direct.ask() {
///     let values: Vec<f64> = batch.iter().map(|x| (x[0] - 0.3).powi(2) + (x[1] - 0.6).powi(2)).collect();
///     direct.tell(&values)?;
/// }
/// let (point, value) = direct.best().expect("the objective is finite everywhere");
/// assert!(value < 1e-4 && (point[0] - 0.3).abs() < 0.01);
/// assert!(direct.evaluations() <= 100);
/// # Ok::<(), body_schema_engine::optimize::DirectError>(())
/// ```
///
/// The first batch is the centre of the cube. Every later one belongs to an iteration: for each
/// [potentially optimal](Self::potentially_optimal) rectangle in turn, two points on every longest side. The choice
/// for the next iteration is made as soon as the values are told, so the [partition](Self::partition), the
/// [hull](Self::hull) and the choice always describe the same moment.
///
/// # Budget
///
/// The budget is never exceeded. The rectangles of an iteration are divided in the order of
/// [`potentially_optimal`](Self::potentially_optimal) as long as all samples of a rectangle fit; with the first
/// that does not, the search ends, even if a later one would. A few evaluations, fewer than twice the dimension,
/// may thus remain unspent. In return the points of a search are always the first points of the same search on a
/// larger budget. (Gablonsky's code completes the iteration, and exceeds the budget.)
#[derive(Debug, Clone)]
pub struct Direct {
    settings: Settings,
    rectangles: Rectangles,
    classes: SizeClasses,
    lineage: Lineage,
    hull: Vec<HullPoint>,
    /// The potentially optimal rectangles, in the order of their division.
    chosen: Vec<usize>,
    /// How many of the chosen the pending batch divides.
    dividing: usize,
    /// Rounds of selection so far.
    round: usize,
    iterations: usize,
    asked: bool,
    /// Whether the budget has cut an iteration short, which makes it the last.
    exhausted: bool,
    best: Option<(usize, f64)>,
    /// The greatest feasible value, for the surrogates of centres with no feasible one nearby.
    worst: f64,
}

/// Rectangles for which there is room from the beginning.
const ROOM: usize = 4096;

/// Size classes for whose best rectangles there is room from the beginning.
const CLASSES: usize = 16;

impl Direct {
    /// Prepares a search of the unit cube of that dimension.
    ///
    /// # Errors
    ///
    /// If the dimension or the budget is zero, or ε negative or not finite.
    pub fn new(dimension: usize, settings: Settings) -> Result<Self, DirectError> {
        settings.check()?;
        if dimension == 0 {
            return Err(DirectError::NoDimension);
        }
        let room = settings.max_evaluations.min(ROOM);
        Ok(Self {
            settings,
            rectangles: Rectangles::cube(dimension, room),
            classes: SizeClasses::default(),
            lineage: Lineage::default(),
            hull: Vec::with_capacity(CLASSES),
            chosen: Vec::with_capacity(CLASSES),
            dividing: 0,
            round: 0,
            iterations: 0,
            asked: false,
            exhausted: false,
            best: None,
            worst: f64::NEG_INFINITY,
        })
    }

    /// The points to evaluate next, or `None` when the search has ended. Asking again without having told the
    /// values returns the same points.
    pub fn ask(&mut self) -> Option<Batch<'_>> {
        let centres = &self.rectangles.centres[self.rectangles.len() * self.rectangles.dimension..];
        self.asked = !centres.is_empty();
        self.asked.then_some(Batch::new(&self.rectangles, &self.chosen[..self.dividing], centres))
    }

    /// Takes the values of the points asked, in their order, divides the rectangles and chooses the next ones. A
    /// value that is not finite marks an infeasible point.
    ///
    /// # Errors
    ///
    /// If nothing was asked, or the number of values is not that of the points. The search is then unchanged, and
    /// the points are still to be told.
    pub fn tell(&mut self, values: &[f64]) -> Result<(), DirectError> {
        if !self.asked {
            return Err(DirectError::NotAsked);
        }
        let asked = self.rectangles.pending();
        if values.len() != asked {
            return Err(DirectError::ValueCount { asked, told: values.len() });
        }
        self.asked = false;
        let first = self.rectangles.len();
        self.iterations += usize::from(first > 0);
        let all_feasible = self.record(values);
        if first == 0 {
            self.enlist(0..1);
        } else {
            self.divide(first);
        }
        if !all_feasible || self.lineage.any_infeasible() {
            self.lineage.grow(&self.rectangles.records);
            self.set_surrogates(first);
        }
        self.choose();
        self.sample();
        Ok(())
    }

    /// Whether the search has ended, so that there is nothing more to ask.
    pub fn is_finished(&self) -> bool {
        self.rectangles.pending() == 0
    }

    /// The best feasible point so far and its value. Of equal values the one asked first counts.
    pub fn best(&self) -> Option<(&[f64], f64)> {
        self.best.map(|(rectangle, value)| (self.rectangles.centre(rectangle), value))
    }

    /// The number of the best rectangle in the [partition](Self::partition).
    pub fn best_rectangle(&self) -> Option<usize> {
        self.best.map(|(rectangle, _)| rectangle)
    }

    /// How many values have been told.
    pub fn evaluations(&self) -> usize {
        self.rectangles.len()
    }

    /// How many times rectangles have been divided; the evaluation of the cube's centre is not an iteration.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// The settings of the search.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The rectangles as of the last values told, and which of them are about to be divided. Empty before the
    /// first.
    pub fn partition(&self) -> Division<'_> {
        Division {
            rectangles: &self.rectangles,
            variant: self.settings.variant,
            round: self.round,
            remote: self.remote(),
        }
    }

    /// The lower right hull of the [partition](Self::partition) as it is now, from the largest size to the
    /// smallest, including the vertices that fail the ε test. Empty as long as no feasible point is known.
    pub fn hull(&self) -> &[HullPoint] {
        &self.hull
    }

    /// The numbers of the potentially optimal rectangles, in the order in which they are divided: the vertices of
    /// the [hull](Self::hull) that passed the ε test, then, in the original variant, the rectangles that tie with
    /// them. While no feasible point is known, the eldest of the largest rectangles. At the end of the budget some
    /// or all of them are left undivided.
    pub fn potentially_optimal(&self) -> &[usize] {
        &self.chosen
    }

    /// The surrogate of an infeasible centre with no feasible one nearby; not finite if there is none anywhere.
    fn remote(&self) -> f64 {
        if self.best.is_some() { (self.worst + 1.0).min(f64::MAX) } else { f64::INFINITY }
    }

    /// Takes the values, and says whether all are feasible.
    fn record(&mut self, values: &[f64]) -> bool {
        let mut all_feasible = true;
        let (mut best, mut least, mut worst) = (None, self.best.map_or(f64::INFINITY, |(_, best)| best), self.worst);
        for (index, &value) in values.iter().enumerate() {
            if !value.is_finite() {
                all_feasible = false;
                continue;
            }
            if value > worst {
                worst = value;
            }
            if value < least {
                (best, least) = (Some(self.rectangles.len() + index), value);
            }
        }
        self.worst = worst;
        self.rectangles.record(values, self.iterations);
        self.best = best.map(|rectangle| (rectangle, self.rectangles.records[rectangle].score)).or(self.best);
        self.classes.know(self.rectangles.len());
        all_feasible
    }

    fn divide(&mut self, first: usize) {
        let mut child = first;
        for index in 0..self.dividing {
            let parent = self.chosen[index];
            self.delist(parent);
            let children = self.rectangles.divide(parent, child);
            self.rectangles.records[parent].generation = self.iterations;
            child = children.end;
            self.enlist(children);
            self.enlist(parent..parent + 1);
        }
    }

    /// Brings the surrogates up to date after an iteration that evaluated the centres from `first` on: feasible ones
    /// among them may have come near infeasible ones, and doubled rectangles that shrank may have lost some.
    fn set_surrogates(&mut self, first: usize) {
        let mut near = Vec::new();
        for point in first..self.rectangles.len() {
            if let Some(value) = self.rectangles.records[point].value() {
                self.lineage.infeasible_near(point, &self.rectangles, |infeasible| near.push((infeasible, value)));
            }
        }
        for (infeasible, value) in near {
            if surrogate(value) < self.rectangles.records[infeasible].score {
                self.rescore(infeasible, surrogate(value));
            }
        }
        let divided = self.chosen[..self.dividing].to_vec();
        for changed in divided.into_iter().chain(first..self.rectangles.len()) {
            if self.rectangles.records[changed].value().is_none() {
                self.rescore(changed, surrogate(self.lineage.least_near(changed, &self.rectangles)));
            }
        }
    }

    fn rescore(&mut self, rectangle: usize, score: f64) {
        let listed = self.delist(rectangle);
        self.rectangles.records[rectangle].score = score;
        if listed {
            self.enlist(rectangle..rectangle + 1);
        }
    }

    /// Puts rectangles into their classes, those that can be divided.
    fn enlist(&mut self, rectangles: Range<usize>) {
        let Rectangles { dimension, records, .. } = &self.rectangles;
        for (rectangle, record) in rectangles.clone().zip(&records[rectangles]) {
            if record.is_divisible() {
                self.classes.insert(record.class(*dimension, self.settings.variant), rectangle, record.score);
            }
        }
    }

    fn delist(&mut self, rectangle: usize) -> bool {
        let class = self.rectangles.class(rectangle, self.settings.variant);
        self.classes.remove(class, rectangle)
    }

    /// Chooses the potentially optimal rectangles.
    fn choose(&mut self) {
        self.round += 1;
        self.chosen.clear();
        self.hull.clear();
        if let Some((_, best)) = self.best {
            let Settings { variant, epsilon, smallest_first, .. } = self.settings;
            let remote = self.remote();
            let points = self.classes.heads().map(|head| HullPoint {
                rectangle: head.rectangle,
                size: variant.size(head.class, self.rectangles.dimension),
                value: head.score.min(remote),
                potentially_optimal: false,
            });
            lower_right_hull(points, best, epsilon, &mut self.hull);
            let passed = self.hull.iter().filter(|point| point.potentially_optimal);
            self.chosen.extend(passed.map(|point| point.rectangle));
            if smallest_first {
                self.chosen.reverse();
            }
            if variant == Variant::Original {
                for index in 0..self.chosen.len() {
                    let class = self.rectangles.class(self.chosen[index], variant);
                    self.chosen.extend(self.classes.ties(class));
                }
            }
        } else {
            self.chosen.extend(self.classes.heads().next().map(|head| head.rectangle));
        }
        for &rectangle in &self.chosen {
            self.rectangles.records[rectangle].chosen = self.round;
        }
    }

    /// Samples around the chosen rectangles as far as the budget goes.
    fn sample(&mut self) {
        self.dividing = 0;
        self.rectangles.sides.clear();
        let mut points = self.rectangles.len();
        for &parent in &self.chosen {
            points += 2 * self.rectangles.long_sides(parent);
            self.exhausted |= points > self.settings.max_evaluations;
            if self.exhausted {
                break;
            }
            self.rectangles.sample_around(parent);
            self.dividing += 1;
        }
    }
}
