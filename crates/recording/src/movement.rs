//! The markers of a step: predicted, measured, and the error between them.

use std::sync::Arc;

use super::{
    rerun::{Color, LineStrips3D, Points3D, Radius, arrow::array::StringArray},
    solid::single,
    values::{Cell, Values},
};
use body_schema_wire::{ChannelReading, MovementReport};

/// The colour of a measurement, which no learner has and which shows on dark and on light backgrounds.
pub(super) const MEASURED: [u8; 3] = [0xE6, 0xB4, 0x22];
/// The colour of an error, and of a marker that was not seen.
pub(super) const ERROR: [u8; 3] = [0xD6, 0x3B, 0x3B];
/// Radius of a marker and of the line of an error, as parts of the arm's reach.
const MARKER: f64 = 0.048;
const LINE: f64 = 0.011;
/// The labels of markers, the last for all to see.
pub(super) const PREDICTED: &str = "predicted";
pub(super) const SEEN: &str = "seen";
pub(super) const NOT_SEEN: &str = "not seen";
/// Half the width of the cross at an outlier.
const CROSS: f64 = 0.1;

/// The entities of a movement, all of them at each step: what a step does not have is empty, not the last step's.
pub(super) struct Movement {
    pub(super) predicted: [Cell; 1],
    pub(super) measured: [Cell; 1],
    /// The line from the predicted to the measured marker, labelled with its length.
    pub(super) error: [Cell; 2],
    /// A cross where the learner takes what was measured for an outlier; `None` if it weighs no readings.
    pub(super) outlier: Option<LineStrips3D>,
    /// The true marker after a miss.
    pub(super) missed: [Cell; 1],
}

impl Movement {
    /// The entities of a report; empty for a learner that has stopped, or whose arm is moving. The line of an error
    /// begins at what was measured and is drawn only as far as `is_near` holds; its label says its whole length.
    pub(super) fn of(report: Option<&MovementReport>, reach_m: f64, is_near: impl Fn(&[f64; 3]) -> bool) -> Self {
        let predicted = report.map(|report| report.predicted_marker_m).filter(finite);
        let measured = report.and_then(|report| report.measured_marker_m);
        let truth = report.and_then(|report| report.true_skeleton_m.as_ref()?.last().copied());
        let missed = truth.filter(|_| measured.is_none());
        let ends = predicted.zip(measured);
        let reading = report.and_then(|report| report.readings.iter().find(|reading| reading.weight.is_some()));
        let is_outlier = reading.is_some_and(ChannelReading::is_outlier);
        let label = ends.map(|(from, to)| {
            let distance = off((0..3).map(|i| (to[i] - from[i]).powi(2)).sum::<f64>().sqrt());
            if is_outlier { format!("outlier, {distance}") } else { distance }
        });
        let marker = |place: Option<[f64; 3]>| {
            let place = Values::Triples(place.map(single).into_iter().collect());
            [(Points3D::descriptor_positions(), place)]
        };
        // A line to a place beside a neighbour would seem to be the neighbour's.
        let seen = ends.map(|(from, to)| (within(from, to, is_near), to));
        let line: Vec<_> = seen.iter().flat_map(|(from, to)| [from, to]).copied().map(single).collect();
        let lines = Values::Lists(ends.iter().map(|_| line.len()).collect(), Box::new(Values::Triples(line)));
        let labels = Values::Arrays(vec![Arc::new(StringArray::from_iter_values(label))]);
        Self {
            predicted: marker(predicted),
            measured: marker(measured),
            error: [(LineStrips3D::descriptor_strips(), lines), (LineStrips3D::descriptor_labels(), labels)],
            outlier: reading.map(|_| cross(measured.filter(|_| is_outlier), reach_m)),
            missed: marker(missed),
        }
    }
}

/// The look of a marker.
pub(super) fn marker_look(colour: [u8; 3], label: &str, reach_m: f64) -> Points3D {
    Points3D::update_fields()
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_scene_units((MARKER * reach_m) as f32)])
        .with_labels([label])
        .with_show_labels(label == NOT_SEEN)
}

/// The look of the line of an error.
pub(super) fn error_look(colour: [u8; 3], reach_m: f64) -> LineStrips3D {
    LineStrips3D::update_fields()
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_scene_units((LINE * reach_m) as f32)])
        .with_show_labels(true)
}

/// The point on the way to `from`, as seen from `to`, that is as far out as one that is near may be: `from` itself if it is near.
fn within(from: [f64; 3], to: [f64; 3], is_near: impl Fn(&[f64; 3]) -> bool) -> [f64; 3] {
    /// The steps in which the way is cut.
    const STEPS: u32 = 100;
    let at = |step: u32| -> [f64; 3] {
        let part = f64::from(step) / f64::from(STEPS);
        std::array::from_fn(|k| from[k] + part * (to[k] - from[k]))
    };
    (0..STEPS).map(at).find(|point| is_near(point)).unwrap_or(to)
}

/// A cross of three lines.
fn cross(place: Option<[f64; 3]>, reach_m: f64) -> LineStrips3D {
    let arm = CROSS * reach_m;
    let strips = place.into_iter().flat_map(|place| {
        (0..3).map(move |axis| {
            [-arm, arm].map(|way| single(std::array::from_fn(|i| place[i] + if i == axis { way } else { 0.0 })))
        })
    });
    LineStrips3D::new(strips)
        .with_colors([Color::from(ERROR)])
        .with_radii([Radius::new_scene_units((1.4 * LINE * reach_m) as f32)])
}

fn finite(point: &[f64; 3]) -> bool {
    point.iter().all(|x| x.is_finite())
}

/// A distance in a unit that reads well.
fn off(distance_m: f64) -> String {
    if distance_m < 1.0 { format!("{:.0} mm off", distance_m * 1e3) } else { format!("{distance_m:.1} m off") }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_line_ends_where_a_neighbour_begins() {
        let is_near = |point: &[f64; 3]| point[0] < 1.0;
        assert_eq!(super::within([0.5, 0.0, 0.0], [0.0; 3], is_near), [0.5, 0.0, 0.0]);
        let [x, y, z] = super::within([2.0, 4.0, 0.0], [0.0; 3], is_near);
        assert!((0.97..1.0).contains(&x) && (y - 2.0 * x).abs() < 1e-9 && z == 0.0, "{x}, {y}, {z}");
        assert_eq!(super::within([3.0, 0.0, 0.0], [2.0, 0.0, 0.0], is_near), [2.0, 0.0, 0.0]);
    }

    #[test]
    fn distances_are_said_in_words() {
        assert_eq!(super::off(0.0187), "19 mm off");
        assert_eq!(super::off(1.25), "1.2 m off");
    }
}
