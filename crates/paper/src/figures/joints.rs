//! Fig. 7: direction and location of every joint, learner by learner.

use super::{Figure, Source};
use crate::outcome::LearnedJoint;
use body_schema_chart::{Axis, Chart, Layer, Panel, Style};
use body_schema_wire::{Curve, JointMetrics, LearnerComparison};

/// More joints than this cannot be told apart in one panel.
const MOST: usize = 12;

pub fn figure(source: Source<'_>) -> Option<Figure> {
    let trial = source.outcome.trials().first()?;
    let learners = &trial.comparison.learners;
    let joints = Some(&trial.joints).filter(|joints| (1..=MOST).contains(&joints.len()))?;
    let thresholds = source.scenario.thresholds;
    let styles: Vec<Style> = (0..joints.len()).map(|index| joint_style(index, joints.len())).collect();
    let rows = [
        row(&source, "direction error (deg)", |joint| joint.axis_deg, 1.0, thresholds.orientation_deg)?,
        row(&source, "location error (cm)", |joint| joint.location_m, 100.0, thresholds.location_m * 100.0)?,
    ];
    let id = if source.experiment.id == "head-fov" {
        "fig-7".to_owned()
    } else {
        format!("{}-joints", source.experiment.id)
    };
    let chart = Chart {
        title: format!("{}, joint by joint", source.title()),
        subtitle: source.provenance(),
        legend: joints.iter().map(|joint| joint.name.replace('_', " ")).zip(styles).collect(),
        rows: rows.into(),
        notes: vec![
            "Medians over the seeds. Top: angle between true and estimated axis; bottom: distance of the true axis \
                     point from the estimated axis. Dashed grey: thresholds of the mean over the joints."
                .to_owned(),
        ],
    };
    let names: Vec<&str> = learners.iter().map(|learner| learner.name.as_str()).collect();
    let caption = format!(
        "{}: direction and location error of every learned joint for {}; medians over the seeds, {}",
        source.title(),
        names.join(", "),
        source.provenance()
    );
    Some(Figure { id, caption, chart })
}

/// One panel per learner, all over the same range.
fn row(
    source: &Source<'_>,
    label: &str,
    error: fn(&JointMetrics) -> Option<f64>,
    scale: f64,
    threshold: f64,
) -> Option<Vec<Panel>> {
    let trial = source.outcome.trials().first()?;
    let points = |learner: &LearnerComparison, joint: &LearnedJoint| -> Vec<[f64; 2]> {
        let at = |point: &Curve| Some([point.movements as f64, error(point.joints.get(joint.index)?)? * scale]);
        smoothed(learner.curve.iter().filter_map(at))
    };
    let learners = &trial.comparison.learners;
    let all = learners.iter().flat_map(|learner| trial.joints.iter().flat_map(|joint| points(learner, joint)));
    let y = Axis::log(label, all.map(|[_, y]| y).chain([threshold]));
    let panels = learners.iter().map(|learner| {
        let last = learner.curve.last().map_or(2.0, |point| point.movements as f64).max(2.0);
        let mut layers = vec![Layer::Level { y: threshold, label: String::new() }];
        layers.extend(trial.joints.iter().enumerate().map(|(index, joint)| Layer::Curve {
            points: points(learner, joint),
            style: joint_style(index, trial.joints.len()),
        }));
        Panel {
            title: learner.name.clone(),
            x: Axis::log("movements", [1.0, last].into_iter()).over(1.0, last),
            y: y.clone(),
            layers,
        }
    });
    Some(panels.collect())
}

/// Joints from the base, dark, to the hand, bright, so that they can be told apart in grey; colours of learners would
/// mean something else here.
fn joint_style(index: usize, joints: usize) -> Style {
    const STOPS: [[f64; 3]; 3] = [[20.0, 20.0, 60.0], [175.0, 45.0, 95.0], [240.0, 165.0, 20.0]];
    let place = if joints > 1 { 2.0 * index as f64 / (joints - 1) as f64 } else { 0.0 };
    let lower = (place as usize).min(1);
    let [from, to] = [STOPS[lower], STOPS[lower + 1]];
    let colour = std::array::from_fn(|channel| {
        (from[channel] + (place - lower as f64) * (to[channel] - from[channel])).round() as u8
    });
    Style::at(index, colour)
}

/// Points in bins of a ninth of the way each, at the geometric means of their places and values: many noisy curves in one
/// panel hide one another otherwise.
fn smoothed(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut bins: Vec<(f64, Vec<[f64; 2]>)> = Vec::new();
    for [x, y] in points.filter(|[x, y]| *x > 0.0 && *y > 0.0) {
        match bins.last_mut() {
            Some((first, bin)) if x <= *first * 1.12 => bin.push([x.ln(), y.ln()]),
            _ => bins.push((x, vec![[x.ln(), y.ln()]])),
        }
    }
    let mean = |bin: &[[f64; 2]], side: usize| (bin.iter().map(|p| p[side]).sum::<f64>() / bin.len() as f64).exp();
    bins.iter().map(|(_, bin)| [mean(bin, 0), mean(bin, 1)]).collect()
}
