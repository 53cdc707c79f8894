//! The least error that any learner could reach, drawn beside what the learners reached.

use super::Source;
use body_schema_chart::{Axis, Layer, Panel, Style};
use body_schema_engine::selection::CriterionUnits;
use body_schema_palette::TRUTH_COLOR;
use body_schema_wire::{BestDesign, Comparison, Curve, LearnerComparison, Quantiles};

/// Dashes of a learner's bound.
const BOUND: &str = "1.5 2.5";
/// The line of the best designs.
const BEST: Style = Style { colour: [0x33; 3], dashes: "6 2 1.5 2", marker: None };

/// What the lines of [`panel`] mean.
pub fn legend() -> [(String, Style); 2] {
    [
        ("what its data allow".to_owned(), Style { colour: TRUTH_COLOR, dashes: BOUND, marker: None }),
        ("best design".to_owned(), BEST),
    ]
}

/// A mark on the horizontal axis at the number of movements with as many equations as unknowns.
pub fn counting(comparison: &Comparison) -> Layer {
    let count = comparison.movements_by_counting;
    Layer::Event { x: count as f64, label: format!("counting: {count}"), colour: TRUTH_COLOR, dashes: "1 3" }
}

/// A panel with the trace that every learner believes, the least that its data allow, and the least that any data
/// allow. `None` where no truth is known.
pub fn panel(
    source: Source<'_>,
    comparison: &Comparison,
    styles: &[Style],
    x: &Axis,
    marks: &[Layer],
) -> Option<Panel> {
    let learners = || comparison.learners.iter().zip(styles);
    let mut layers: Vec<Layer> = marks.to_vec();
    let mut seen: Vec<f64> = Vec::new();
    let mut draw = |points: Vec<[f64; 2]>, style: Style| {
        if !points.is_empty() {
            seen.extend(points.iter().map(|[_, y]| *y));
            layers.push(Layer::Curve { points, style });
        }
    };
    for (learner, style) in learners() {
        draw(medians(learner, |point| point.bound_trace), Style { dashes: BOUND, marker: None, ..*style });
        draw(medians(learner, |point| point.trace), *style);
    }
    // A design after the change of the body begins a line of its own.
    let stretches = comparison.best_designs.chunk_by(|before, after| before.movements < after.movements);
    for stretch in stretches {
        draw(
            stretch
                .iter()
                .map(|BestDesign { step, best_design_trace, .. }| [*step as f64, *best_design_trace])
                .collect(),
            BEST,
        );
    }
    let is_bounded = learners().any(|(learner, _)| learner.curve.iter().any(|point| point.bound_trace.is_some()));
    let label = match source.scenario.selection.units {
        CriterionUnits::CharacteristicLength(1.0) => "trace tr(W P) (m² + rad²)".to_owned(),
        CriterionUnits::CharacteristicLength(length) => format!("trace tr(W P) (rad², 1 rad for {length} m)"),
        CriterionUnits::Prior => "trace tr(W P) (prior variances)".to_owned(),
    };
    let y = Axis::log(&label, seen.into_iter());
    is_bounded.then(|| Panel { title: "(d) covariance and limits".to_owned(), x: x.clone(), y, layers })
}

/// Medians over the seeds; a log axis has no place for movement 0.
fn medians(learner: &LearnerComparison, quantity: fn(&Curve) -> Option<Quantiles>) -> Vec<[f64; 2]> {
    let after_start = learner.curve.iter().filter(|point| point.movements > 0);
    after_start.filter_map(|point| Some([point.movements as f64, quantity(point)?.median])).collect()
}
