//! The figure of a sweep: a key of the scenario against how soon learners converge, and how near they come.

use super::{Figure, Source};
use crate::experiments::Kind;
use body_schema_chart::{Axis, Chart, Layer, Panel, Scale, Style};
use body_schema_palette::{learner_color, learner_slots};

pub fn figure(source: Source<'_>) -> Option<Figure> {
    let Kind::Sweep { label, steps, quick_steps, .. } = source.experiment.kind else { return None };
    let steps = if source.plan.quick { quick_steps } else { steps };
    let trials = source.outcome.trials();
    // A value of 0 has no place on a log axis: it gets one a decade before the others.
    let values: Vec<f64> = trials.iter().filter_map(|trial| trial.value).collect();
    let least = values.iter().copied().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
    let place = |value: f64| if value > 0.0 { value } else { least / 10.0 };
    let zero = values.contains(&0.0);
    let slot = learner_slots(source.experiment.learners.iter().copied()).first().copied().unwrap_or(0);
    let style = Style { dashes: "", ..Style::at(slot, learner_color(slot)) };
    let learners: Vec<_> =
        trials.iter().filter_map(|trial| Some((place(trial.value?), trial.comparison.learners.first()?))).collect();
    let x = Axis::log(label, learners.iter().map(|(x, _)| *x));
    let [lower, upper] = x.range;
    let x = x.over(lower / 1.6, upper * 1.6);
    let x = if zero { x.with_zero_at(least / 10.0) } else { x };
    let runs = learners.first()?.1.summary.runs as f64;
    let converged = learners.iter().map(|(x, learner)| [*x, learner.summary.converged as f64]).collect();
    let medians: Vec<[f64; 2]> =
        learners.iter().filter_map(|(x, learner)| Some([*x, learner.summary.median_converged_at?])).collect();
    let late: Vec<[f64; 2]> =
        learners.iter().filter_map(|(x, learner)| Some([*x, learner.summary.p90_converged_at?])).collect();
    let locations: Vec<[f64; 4]> = learners
        .iter()
        .filter_map(|(x, learner)| {
            let error = learner.curve.last()?.location_m?;
            Some([*x, error.q25 * 100.0, error.median * 100.0, error.q75 * 100.0])
        })
        .collect();
    let threshold = source.scenario.thresholds.location_m * 100.0;
    let late_style = Style { dashes: "2 2.5", marker: None, ..style };
    // Where nothing converges there is nothing to show.
    let movements = (!medians.is_empty()).then(|| Panel {
        title: "movements until it converges".into(),
        x: x.clone(),
        y: Axis {
            label: "movements".into(),
            scale: Scale::Linear,
            range: [0.0, top(&late).max(top(&medians)) * 1.1],
            zero: None,
        },
        layers: vec![Layer::Curve { points: late, style: late_style }, Layer::Curve { points: medians, style }],
    });
    let counts = Panel {
        title: format!("runs of {runs} that converge"),
        x: x.clone(),
        y: Axis { label: "runs".into(), scale: Scale::Linear, range: [0.0, runs * 1.05], zero: None },
        layers: vec![Layer::Curve { points: converged, style }],
    };
    let ends = locations.iter().flat_map(|point| point[1..].to_vec()).chain([threshold]);
    let errors = Panel {
        title: format!("after {steps} movements"),
        x,
        y: Axis::log("location error (cm)", ends),
        layers: vec![
            Layer::Band { points: locations.iter().map(|p| [p[0], p[1], p[3]]).collect(), colour: style.colour },
            Layer::Level { y: threshold, label: format!("{threshold:.0} cm") },
            Layer::Curve { points: locations.iter().map(|p| [p[0], p[2]]).collect(), style },
        ],
    };
    let name = source.experiment.learners.join(", ");
    let mut legend = vec![(format!("{name}, median"), style)];
    legend.extend(movements.is_some().then(|| (format!("{name}, 90 % of the runs"), late_style)));
    let notes = if movements.is_some() {
        vec!["Left: no point where the median run, or the 90th percentile, does not converge. Right: median and quartiles.".into()]
    } else {
        vec!["The median run converges nowhere. Right: median and quartiles.".into()]
    };
    let chart = Chart {
        title: source.title(),
        subtitle: source.provenance(),
        legend,
        rows: vec![movements.into_iter().chain([counts, errors]).collect()],
        notes,
    };
    let caption = format!(
        "{}: how soon `{name}` converges, in how many runs, and its location error at the end (median and quartiles), {}",
        source.title(),
        source.provenance()
    );
    Some(Figure { id: source.experiment.id.to_owned(), caption, chart })
}

/// The highest of the points; 1 if there are none.
fn top(points: &[[f64; 2]]) -> f64 {
    points.iter().map(|point| point[1]).fold(1.0, f64::max)
}
