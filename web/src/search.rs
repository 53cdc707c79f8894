//! The search of DIRECT for a movement, ready to be drawn.

use body_schema_engine::optimize::{MAX_LEVEL, Plane, Projection, Variant};
use body_schema_wire::{BoxReport, Choice, ShapeReport};

/// A checked search: everything that it refers to exists, so that drawing it needs no further checks.
#[derive(Clone, Debug)]
pub struct Search {
    choice: Choice,
    variant: Variant,
    busiest: Plane,
}

/// A rectangle of the slice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its place in the unit square.
    pub place: Projection,
    /// The criterion at its centre.
    pub value: Option<f64>,
    /// Whether it is potentially optimal.
    pub optimal: bool,
}

/// A rectangle in the diagram of sizes and values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dot {
    /// Its size, as the variant measures it.
    pub size: f64,
    /// Its value.
    pub value: f64,
    /// Whether it is potentially optimal.
    pub optimal: bool,
}

impl Search {
    /// The search behind a choice; `None` if the choice is inconsistent.
    pub fn of(choice: Choice) -> Option<Self> {
        let (joints, boxes) = (choice.joints.len(), &choice.boxes);
        let is_shape =
            |shape: &ShapeReport| shape.levels.len() == joints && shape.levels.iter().all(|level| *level <= MAX_LEVEL);
        let is_sound = choice.chosen.rectangle < boxes.len()
            && choice.chosen.point.len() == joints
            && choice.chosen.configuration.len() == joints
            && !choice.iterations.is_empty()
            && choice.iterations.iter().all(|iteration| iteration.hull.iter().all(|index| *index < boxes.len()))
            && boxes
                .iter()
                .all(|one| one.centre.len() == joints && !one.shapes.is_empty() && one.shapes.iter().all(is_shape));
        if !is_sound {
            return None;
        }
        let variant = Variant::named(&choice.variant)?;
        let shapes = boxes.iter().filter_map(|one| one.shapes.last());
        let busiest = Plane::most_divided(shapes.map(|shape| shape.levels.as_slice()))?;
        Some(Self { choice, variant, busiest })
    }

    /// The choice that the search led to.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// The variant of DIRECT, which decides how rectangles are measured.
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// The best of the centres that were tried until the end of an iteration.
    pub fn best(&self, iteration: usize) -> Option<Vec<f64>> {
        let tried = self.boxes(iteration).filter_map(|(one, ..)| Some((one, one.value?)));
        let (best, _) = tried.min_by(|(_, one), (_, other)| one.total_cmp(other))?;
        Some(best.centre.iter().enumerate().map(|(joint, share)| self.value(joint, *share)).collect())
    }

    /// What happens after an iteration, and why, as a sentence.
    pub fn next(&self, iteration: usize) -> String {
        let count = self.boxes(iteration).count();
        let mut split: Vec<Dot> = self.diagram(iteration).into_iter().filter(|dot| dot.optimal).collect();
        split.sort_by(|one, other| other.size.total_cmp(&one.size).then(one.value.total_cmp(&other.value)));
        let teaches = |value: f64| self.choice.trace.map_or(String::new(), |trace| format!(" ({:.3})", trace - value));
        match split.as_slice() {
            _ if iteration >= self.last() => {
                let chosen = &self.choice.chosen.configuration;
                // A policy that plans weighs more than a search for one movement does.
                let end = match self.best(iteration) {
                    Some(best) if best.iter().zip(chosen).all(|(one, other)| (one - other).abs() < 1e-9) => {
                        "The best centre is the movement that was made."
                    }
                    _ => "The movement that was made is another: it was weighed together with others.",
                };
                format!("The search ends with {count} boxes. {end}")
            }
            [] => format!("{count} boxes. Nowhere is the hand sure to be seen: the largest are split next."),
            [_] if count == 1 => {
                "At first all postures are one box, whose centre is tried. It is split next.".to_owned()
            }
            [one] => {
                let taught = teaches(one.value);
                format!("Of {count} boxes one is split next: it is large, and its centre teaches much{taught}.")
            }
            [largest, .., smallest] => {
                let (known, taught) = (teaches(largest.value), teaches(smallest.value));
                let others = match split.len() - 1 {
                    1 => "a smaller one whose centre teaches more".to_owned(),
                    others => format!("{others} smaller ones whose centres teach more"),
                };
                format!(
                    "Of {count} boxes {} are split next: the largest, in which the least is known{known}, and {others}{taught}.",
                    split.len()
                )
            }
        }
    }

    /// The joints that were divided most, for a slice with something to see.
    pub fn busiest(&self) -> Plane {
        self.busiest
    }

    /// The last iteration.
    pub fn last(&self) -> usize {
        self.choice.iterations.len() - 1
    }

    /// The rectangles at the end of an iteration with their shapes then, and whether they are potentially optimal.
    fn boxes(&self, iteration: usize) -> impl Iterator<Item = (&BoxReport, &[u8], bool)> {
        let hull = self.choice.iterations.get(iteration).map_or(&[][..], |iteration| &iteration.hull);
        self.choice.boxes.iter().enumerate().filter_map(move |(index, one)| {
            let shape = one.shapes.iter().rev().find(|shape| shape.iteration <= iteration)?;
            Some((one, shape.levels.as_slice(), hull.contains(&index)))
        })
    }

    /// The rectangles that a plane through the chosen configuration cuts, at the end of an iteration.
    pub fn slice(&self, plane: Plane, iteration: usize) -> Vec<Cell> {
        let chosen = &self.choice.chosen.point;
        self.boxes(iteration)
            .filter(|(one, levels, _)| plane.cuts(&one.centre, levels, chosen))
            .map(|(one, levels, optimal)| Cell { place: plane.project(&one.centre, levels), value: one.value, optimal })
            .collect()
    }

    /// Every rectangle by size and value at the end of an iteration.
    pub fn diagram(&self, iteration: usize) -> Vec<Dot> {
        let boxes = self.boxes(iteration);
        boxes
            .filter_map(|(one, levels, optimal)| {
                Some(Dot { size: self.variant.size_of(levels), value: one.value?, optimal })
            })
            .collect()
    }

    /// Smallest and largest value over the whole search, for one scale of colours over all iterations.
    pub fn range(&self) -> (f64, f64) {
        let values = self.choice.boxes.iter().filter_map(|one| one.value);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        match low.is_finite() {
            true if low < high => (low, high),
            true => (low - 0.5, low + 0.5),
            false => (0.0, 1.0),
        }
    }

    /// The chosen configuration in the unit square of a plane.
    pub fn chosen(&self, plane: Plane) -> [f64; 2] {
        let point = &self.choice.chosen.point;
        [point[plane.x], plane.y.map_or(0.5, |y| point[y])]
    }

    /// A configuration of as many joints in the unit square of a plane.
    pub fn place(&self, plane: Plane, configuration: &[f64]) -> [f64; 2] {
        let unit = |joint: usize| {
            let [low, high] = self.choice.joints[joint].limits;
            (configuration[joint] - low) / (high - low).max(f64::MIN_POSITIVE)
        };
        [unit(plane.x), plane.y.map_or(0.5, unit)]
    }

    /// The configuration of a point of the unit square, the other joints as chosen.
    pub fn configuration(&self, plane: Plane, place: [f64; 2]) -> Vec<f64> {
        let mut configuration = self.choice.chosen.configuration.clone();
        for (joint, share) in plane.axes().zip(place) {
            configuration[joint] = self.value(joint, share.clamp(0.0, 1.0));
        }
        configuration
    }

    /// The value of a joint at this share of its range, rad or m.
    pub fn value(&self, joint: usize, share: f64) -> f64 {
        let [low, high] = self.choice.joints[joint].limits;
        (low + share * (high - low)).clamp(low, high)
    }
}

#[cfg(test)]
mod tests {
    use body_schema_engine::optimize::{History, Settings};
    use body_schema_scenario::builtin;

    use super::*;

    fn search() -> Search {
        let mut experiment = builtin("arm-6dof").and_then(|arm| arm.experiment(1, None)).expect("an experiment");
        experiment.step().expect("a step");
        Search::of(Choice::of(&experiment, "active").expect("a choice by DIRECT")).expect("it holds together")
    }

    /// The sizes are those that DIRECT-l goes by: half the longest side, one half for the undivided cube.
    #[test]
    fn sizes_are_those_of_the_search() {
        let search = search();
        assert_eq!(search.variant(), Variant::LocallyBiased);
        assert_eq!(search.diagram(0).iter().map(|dot| dot.size).collect::<Vec<_>>(), [0.5]);
        let choice = search.choice();
        let settings = Settings {
            variant: search.variant(),
            epsilon: choice.epsilon,
            max_evaluations: 10_000,
            ..Settings::default()
        };
        let values: Vec<f64> = choice.boxes.iter().map(|one| one.value.unwrap_or(f64::NAN)).collect();
        let replayed = History::replay(choice.joints.len(), settings, &values).expect("settings").search;
        let sizes = replayed.partition().iter().filter(|one| one.value.is_some()).map(|one| one.size);
        assert!(search.diagram(search.last()).iter().map(|dot| dot.size).eq(sizes));
    }

    #[test]
    fn slices_of_every_iteration_fill_the_square() {
        let search = search();
        let other = Plane { x: 5, y: Some(0) };
        for (plane, iteration) in
            [search.busiest(), other].into_iter().flat_map(|one| (0..=search.last()).map(move |i| (one, i)))
        {
            let cells = search.slice(plane, iteration);
            let area: f64 = cells.iter().map(|cell| 4.0 * cell.place.half[0] * cell.place.half[1]).sum();
            assert!((area - 1.0).abs() < 1e-12, "{plane:?} {iteration}: {area}");
            let [x, y] = search.chosen(plane);
            let holds = |cell: &Cell| {
                let Projection { centre, half } = cell.place;
                (x - centre[0]).abs() <= half[0] * 1.001 && (y - centre[1]).abs() <= half[1] * 1.001
            };
            assert!(cells.iter().any(holds));
        }
    }

    #[test]
    fn a_point_of_the_slice_is_a_configuration_and_back() {
        let search = search();
        let plane = search.busiest();
        let configuration = search.configuration(plane, [0.25, 0.75]);
        let [x, y] = search.place(plane, &configuration);
        assert!((x - 0.25).abs() < 1e-12 && (y - 0.75).abs() < 1e-12);
        let moved = configuration.iter().zip(&search.choice().chosen.configuration).filter(|(a, b)| a != b);
        assert!(moved.count() <= 2);
    }
}
