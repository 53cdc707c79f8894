//! Fig. 7: direction and location of every joint, learner by learner.

use super::{Figure, Source};
use crate::{
    experiment::Quantiles,
    paper::{
        chart::{Axis, Chart, Layer, Panel, Style},
        outcome::JointCurve,
    },
    recording::learner_color,
};

/// More joints than this cannot be told apart in one panel.
const MOST: usize = 12;

pub fn figure(source: Source<'_>) -> Option<Figure> {
    let trial = source.outcome.trials().first()?;
    let learners = &trial.comparison.learners;
    let joints = trial.joints.first().filter(|joints| (1..=MOST).contains(&joints.len()))?;
    let thresholds = source.scenario.thresholds;
    let styles: Vec<Style> = (0..joints.len()).map(|index| joint_style(index, joints.len())).collect();
    let rows = [
        row(&source, "direction error (deg)", |joint| &joint.axis_deg, 1.0, thresholds.orientation_deg)?,
        row(&source, "location error (cm)", |joint| &joint.location_m, 100.0, thresholds.location_m * 100.0)?,
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
    error: fn(&JointCurve) -> &Vec<Quantiles>,
    scale: f64,
    threshold: f64,
) -> Option<Vec<Panel>> {
    let trial = source.outcome.trials().first()?;
    let medians = |joint: &JointCurve| -> Vec<f64> { error(joint).iter().map(|error| error.median * scale).collect() };
    let all = trial.joints.iter().flatten().flat_map(medians).chain([threshold]);
    let y = Axis::log(label, all);
    let panels = trial.comparison.learners.iter().zip(&trial.joints).map(|(learner, joints)| {
        let movements: Vec<f64> = learner.curve.iter().map(|point| point.movements as f64).collect();
        let last = movements.last().copied().unwrap_or(2.0).max(2.0);
        let mut layers = vec![Layer::Level { y: threshold, label: String::new() }];
        layers.extend(joints.iter().enumerate().map(|(index, joint)| {
            let points = movements.iter().zip(medians(joint)).filter(|(x, _)| **x > 0.0).map(|(x, y)| [*x, y]);
            Layer::Curve { points: points.collect(), style: joint_style(index, joints.len()) }
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

/// Joints from the base, dark, to the hand, bright: colours of learners would mean something else here.
fn joint_style(index: usize, joints: usize) -> Style {
    let place = if joints > 1 { index as f64 / (joints - 1) as f64 } else { 0.0 };
    const DARK: [f64; 3] = [0x1B as f64, 0x1B as f64, 0x3A as f64];
    let hand = learner_color(1).map(f64::from);
    let colour = std::array::from_fn(|channel| (DARK[channel] + place * (hand[channel] - DARK[channel])).round() as u8);
    Style::at(index, colour)
}
