//! Figs. 4, 5 and 6: three errors of all learners against the number of movements, and what could be reached.

use super::{Figure, Source, designs};
use body_schema_chart::{Axis, Chart, Layer, Panel, Style};
use body_schema_palette::{TRUTH_COLOR, learner_color, learner_slots};
use body_schema_scenario::WorldSpec;
use body_schema_wire::{Curve, LearnerComparison, Quantiles};

/// One error, in the unit of its axis.
struct Quantity {
    title: &'static str,
    label: &'static str,
    error: fn(&Curve) -> Option<Quantiles>,
    scale: f64,
    threshold: Option<(f64, String)>,
    /// Whether the medians of `converged_at` are marked.
    events: bool,
}

pub fn figure(source: Source<'_>) -> Option<Figure> {
    let comparison = &source.outcome.trials().first()?.comparison;
    let learners = &comparison.learners;
    let thresholds = source.scenario.thresholds;
    let location_cm = thresholds.location_m * 100.0;
    let quantities = [
        Quantity {
            title: "(a) prediction",
            label: "mean prediction error (cm)",
            error: |point| point.prediction_mean_m,
            scale: 100.0,
            threshold: None,
            events: false,
        },
        Quantity {
            title: "(b) orientation",
            label: "orientation error (deg)",
            error: |point| point.orientation_deg,
            scale: 1.0,
            threshold: Some((thresholds.orientation_deg, format!("{} deg", thresholds.orientation_deg))),
            events: true,
        },
        Quantity {
            title: "(c) location",
            label: "location error (cm)",
            error: |point| point.location_m,
            scale: 100.0,
            threshold: Some((location_cm, format!("{location_cm:.0} cm"))),
            events: true,
        },
    ];
    let slots = learner_slots(learners.iter().map(|learner| learner.name.as_str())).into_iter();
    let styles: Vec<Style> = slots.map(|slot| Style::at(slot, learner_color(slot))).collect();
    let last = learners.first()?.curve.last()?.movements as f64;
    let change = match &source.scenario.world {
        WorldSpec::Simulated { change, .. } => change.as_ref().map(|change| change.step as f64),
        WorldSpec::Measured { .. } | WorldSpec::External { .. } => None,
    };
    let x = match change {
        // What happens after a change late in the run would be crowded on a log axis.
        Some(_) => Axis::linear("movements", [].into_iter()).over(0.0, last),
        None => Axis::log("movements", [1.0, last].into_iter()).over(1.0, last.max(2.0)),
    };
    let mut marks = vec![designs::counting(comparison)];
    marks.extend(change.map(|x| Layer::Event { x, label: "change".into(), colour: TRUTH_COLOR, dashes: "6 2" }));
    let mut panels: Vec<Panel> =
        quantities.iter().map(|quantity| panel(quantity, learners, &styles, &x, &marks)).collect();
    let mut legend: Vec<_> = learners.iter().map(|learner| learner.name.clone()).zip(styles.iter().copied()).collect();
    let mut rows = Vec::new();
    if let Some(panel) = designs::panel(source, comparison, &styles, &x, &marks) {
        let below = panels.split_off(2.min(panels.len()));
        rows = vec![panels, below.into_iter().chain([panel]).collect()];
        legend.extend(designs::legend());
    } else {
        rows.push(panels);
    }
    let chart = Chart {
        title: source.title(),
        subtitle: source.provenance(),
        legend,
        rows,
        notes: vec![
            "Lines: medians over the seeds; bands: quartiles. Dashed grey: thresholds; ▾: median movement from which both \
             errors stay below them."
                .to_owned(),
            "Counting: as many independent equations as unknowns. What data allow: linearised at the truth; best design: of \
             any data."
                .to_owned(),
        ],
    };
    let caption = format!(
        "{}: prediction, orientation (every joint's axis with respect to every other's) and location error of each \
         learner; median and quartiles over the seeds; and the covariance beside what could be reached, {}",
        source.title(),
        source.provenance()
    );
    Some(Figure { id: source.experiment.id.to_owned(), caption, chart })
}

fn panel(quantity: &Quantity, learners: &[LearnerComparison], styles: &[Style], x: &Axis, marks: &[Layer]) -> Panel {
    // A log axis has no place for movement 0.
    let points = |learner: &LearnerComparison| -> Vec<(f64, Quantiles)> {
        let after_start = learner.curve.iter().filter(|point| point.movements > 0);
        after_start.filter_map(|point| Some((point.movements as f64, (quantity.error)(point)?))).collect()
    };
    let scale = quantity.scale;
    let mut layers = Vec::new();
    let mut seen = Vec::new();
    for (learner, style) in learners.iter().zip(styles) {
        let points = points(learner);
        seen.extend(points.iter().flat_map(|(_, error)| [error.q25 * scale, error.q75 * scale]));
        let band = points.iter().map(|(x, error)| [*x, error.q25 * scale, error.q75 * scale]).collect();
        layers.push(Layer::Band { points: band, colour: style.colour });
    }
    if let Some((y, label)) = &quantity.threshold {
        seen.push(*y);
        layers.push(Layer::Level { y: *y, label: label.clone() });
    }
    layers.extend_from_slice(marks);
    for (learner, style) in learners.iter().zip(styles) {
        if let Some(median) = learner.summary.median_converged_at.filter(|_| quantity.events) {
            let label = median.to_string();
            layers.push(Layer::Event { x: median, label, colour: style.colour, dashes: "1 3" });
        }
        let points = points(learner).iter().map(|(x, error)| [*x, error.median * scale]).collect();
        layers.push(Layer::Curve { points, style: *style });
    }
    Panel { title: quantity.title.to_owned(), x: x.clone(), y: Axis::log(quantity.label, seen.into_iter()), layers }
}
