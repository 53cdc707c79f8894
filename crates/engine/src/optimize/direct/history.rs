//! A finished search, iteration by iteration: for whoever wants to see how the rectangles came about.

use super::{
    hull::HullPoint,
    search::Direct,
    settings::{DirectError, Settings},
};

/// How a rectangle shrank: its levels from an iteration on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shape {
    /// The iteration at whose end it had this shape for the first time; that of the first entry is its birth.
    pub iteration: usize,
    /// How often each side had been trisected.
    pub levels: Vec<u8>,
}

/// The search at the end of one iteration.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// How many values had been told.
    pub evaluations: usize,
    /// The best rectangle so far, if any centre was feasible.
    pub best: Option<usize>,
    /// The lower right hull, from the largest size to the smallest.
    pub hull: Vec<HullPoint>,
    /// The rectangles that the next iteration divides.
    pub potentially_optimal: Vec<usize>,
}

/// A search told once more the values it was told before, with a record of every iteration.
#[derive(Debug, Clone)]
pub struct History {
    /// The search at its end.
    pub search: Direct,
    /// The shapes of every rectangle, in the order of their evaluation.
    pub shapes: Vec<Vec<Shape>>,
    /// One per iteration; the first is the cube with its centre.
    pub moments: Vec<Moment>,
}

impl History {
    /// Tells a search `values` in the order in which they were asked; a value that is not finite is an infeasible
    /// centre. The search ends where the values do.
    ///
    /// # Errors
    ///
    /// As [`Direct::new`].
    pub fn replay(dimension: usize, settings: Settings, values: &[f64]) -> Result<Self, DirectError> {
        let mut search = Direct::new(dimension, settings)?;
        let (mut shapes, mut moments) = (Vec::<Vec<Shape>>::new(), Vec::new());
        while let Some(asked) = search.ask().map(|batch| batch.len()) {
            let told = search.evaluations();
            let Some(batch) = values.get(told..told + asked) else { break };
            search.tell(batch)?;
            let iteration = moments.len();
            for (index, rectangle) in search.partition().iter().enumerate() {
                let levels = || rectangle.levels.to_vec();
                match shapes.get_mut(index) {
                    None => shapes.push(vec![Shape { iteration, levels: levels() }]),
                    Some(known) if known.last().is_none_or(|shape| shape.levels != rectangle.levels) => {
                        known.push(Shape { iteration, levels: levels() });
                    }
                    Some(_) => {}
                }
            }
            moments.push(Moment {
                evaluations: search.evaluations(),
                best: search.best_rectangle(),
                hull: search.hull().to_vec(),
                potentially_optimal: search.potentially_optimal().to_vec(),
            });
        }
        Ok(Self { search, shapes, moments })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the end of every iteration the shapes of that moment fill the cube, and the last ones are the partition's.
    #[test]
    fn the_shapes_of_every_moment_fill_the_cube() {
        let settings = Settings { max_evaluations: 200, ..Settings::default() };
        let f = |x: &[f64]| (x[0] - 0.2).powi(2) + (x[1] - 0.7).powi(2) * 3.0 + x[2] * x[0];
        let mut search = Direct::new(3, settings).expect("settings");
        let mut values = Vec::new();
        while let Some(batch) = search.ask() {
            let told: Vec<f64> = batch.iter().map(f).collect();
            values.extend_from_slice(&told);
            search.tell(&told).expect("as many as asked");
        }
        let history = History::replay(3, settings, &values).expect("settings");
        assert_eq!(history.search.best(), search.best());
        assert_eq!(history.moments.len(), search.iterations() + 1);
        for (iteration, moment) in history.moments.iter().enumerate() {
            let volume: f64 = history
                .shapes
                .iter()
                .filter_map(|shapes| shapes.iter().rfind(|shape| shape.iteration <= iteration))
                .map(|shape| shape.levels.iter().map(|level| 3_f64.powi(-i32::from(*level))).product::<f64>())
                .sum();
            assert!((volume - 1.0).abs() < 1e-12, "iteration {iteration}: {volume}");
            assert!(moment.best.is_some() && !moment.hull.is_empty());
        }
        for (shapes, rectangle) in history.shapes.iter().zip(search.partition().iter()) {
            assert_eq!(shapes.last().expect("born").levels, rectangle.levels);
        }
    }
}
