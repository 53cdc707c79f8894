//! What courses of movements come to.

use nalgebra::DMatrix;

use super::{Accuracy, Course, Deviation, ErrorPoint, IndexTable, Indices, Needed, Observability, Prospect, Weak};
use crate::model::Block;

/// The share of a weak direction that a block must hold to be named.
const NAMED: f64 = 0.1;

impl Prospect {
    pub(super) fn summary(
        &self,
        free: DMatrix<f64>,
        best: Course,
        drawn: &[Course],
        floor_m: f64,
        wanted_m: f64,
    ) -> Observability {
        let (learned, count) = (self.layout.dimension(), best.movements.len());
        let rank = learned - free.ncols();
        let of = |course: &Course| Indices::of(&self.scaled(&course.information), rank, count);
        let random: Vec<Indices> = drawn.iter().map(of).collect();
        let median_of = |index: fn(&Indices) -> f64| median(random.iter().map(index).collect());
        let errors: Vec<ErrorPoint> = (0..count).map(|index| point(index, &best, drawn)).collect();
        Observability {
            rank,
            weak: self.weak(&best, free.ncols()),
            undetermined: free,
            indices: IndexTable {
                best: of(&best),
                random_median: Indices {
                    o1: median_of(|it| it.o1),
                    o2: median_of(|it| it.o2),
                    o3: median_of(|it| it.o3),
                    o4: median_of(|it| it.o4),
                    o5: median_of(|it| it.o5),
                },
            },
            deviations: (0..learned).map(|at| self.deviation(at, &best, drawn)).collect(),
            accuracy: accuracy(&errors, floor_m, wanted_m),
            errors,
            best: best.movements,
        }
    }

    fn weak(&self, best: &Course, undetermined: usize) -> Vec<Weak> {
        let weak = self.weakest(&best.information, undetermined).into_iter();
        weak.map(|(left, direction)| {
            let mut blocks: Vec<(f64, Block)> = self
                .layout
                .blocks()
                .map(|(block, range)| (direction.rows_range(range).norm_squared(), block))
                .filter(|(share, _)| *share > NAMED)
                .collect();
            blocks.sort_by(|a, b| b.0.total_cmp(&a.0));
            Weak { left, blocks: blocks.into_iter().map(|(_, block)| block).collect() }
        })
        .collect()
    }

    fn deviation(&self, at: usize, best: &Course, drawn: &[Course]) -> Deviation {
        let after = |course: &Course| course.covariance[(at, at)].max(0.0).sqrt();
        Deviation {
            prior: self.deviations[at],
            best: after(best),
            random_median: median(drawn.iter().map(after).collect()),
        }
    }
}

fn point(index: usize, best: &Course, drawn: &[Course]) -> ErrorPoint {
    let mut random: Vec<f64> = drawn.iter().map(|course| course.errors_m[index]).collect();
    random.sort_by(f64::total_cmp);
    ErrorPoint {
        best_m: best.errors_m[index],
        random_median_m: quantile(&random, 0.5),
        random_q25_m: quantile(&random, 0.25),
        random_q75_m: quantile(&random, 0.75),
    }
}

fn accuracy(errors: &[ErrorPoint], floor_m: f64, wanted_m: f64) -> Accuracy {
    let needed = |of: fn(&ErrorPoint) -> f64| {
        let errors: Vec<f64> = errors.iter().map(of).collect();
        Needed::of(&errors, floor_m, wanted_m)
    };
    Accuracy { wanted_m, floor_m, best: needed(|it| it.best_m), random: needed(|it| it.random_median_m) }
}

/// Once in what the visitor's browser loads, where it is called six times.
#[inline(never)]
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}

/// A quantile of sorted values, interpolated between neighbours; 0 without values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * sorted.len().saturating_sub(1) as f64;
    match (sorted.get(at.floor() as usize), sorted.get(at.ceil() as usize)) {
        (Some(low), Some(high)) => low + (high - low) * at.fract(),
        _ => 0.0,
    }
}
