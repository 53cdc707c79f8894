//! Runs and comparisons as CSV.

use std::io;

use super::{RecordingError, metrics};
use body_schema_table::{Component, Title, Writer};
use body_schema_wire::{Comparison, Description, JointKind, Quantiles, StepReport};

/// A writer of one row per step and learner. Units stand in the names of the columns; null is an empty cell.
pub struct StepsCsv<W: io::Write> {
    writer: Writer<W>,
    joints: usize,
}

impl<W: io::Write> StepsCsv<W> {
    /// Writes the header: `step`, `learner`, the metrics, the configuration as `q_{joint}_rad` or `q_{joint}_m`, the
    /// marker as measured and as predicted before the measurement.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Csv`] if the output refuses the header.
    pub fn new(description: &Description, output: W) -> Result<Self, RecordingError> {
        let mut table = Self::without_header(description, output);
        let mut header: Vec<String> =
            ["step", "learner"].iter().chain(&metrics::NAMES).map(|&s| s.to_owned()).collect();
        header.extend(description.joints.iter().map(|joint| match joint.kind {
            JointKind::Revolute => format!("q_{}_rad", joint.name),
            JointKind::Prismatic => format!("q_{}_m", joint.name),
        }));
        for what in ["measured", "predicted"] {
            let title = |component| Title { before: what, component, number: "", unit: "m" }.to_string();
            header.extend(Component::PLACE.map(title));
        }
        table.writer.write(&header)?;
        Ok(table)
    }

    /// A writer that continues a table whose header is written elsewhere.
    pub fn without_header(description: &Description, output: W) -> Self {
        Self { writer: Writer::new(output), joints: description.joints.len() }
    }

    /// Writes the rows of one step.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Csv`] if the output refuses a row.
    pub fn write(&mut self, report: &StepReport) -> Result<(), RecordingError> {
        let cell = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
        for learner in &report.learners {
            let movement = learner.movement.as_ref();
            let configuration = |index: usize| movement.and_then(|m| m.configuration.get(index).copied());
            let measured = movement.and_then(|m| m.measured_marker_m);
            let predicted = movement.map(|m| m.predicted_marker_m);
            let mut row = vec![report.step.to_string(), learner.name.clone()];
            row.extend(metrics::values(learner).map(cell));
            row.extend((0..self.joints).map(|index| cell(configuration(index))));
            for marker in [measured, predicted] {
                row.extend((0..3).map(|axis| cell(marker.map(|marker| marker[axis]))));
            }
            self.writer.write(&row)?;
        }
        Ok(())
    }

    /// Flushes all rows to the output.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Csv`] if the output cannot be flushed.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(|source| RecordingError::Csv(source.into()))
    }
}

/// Writes the curves of a comparison in long format, one row per learner, number of movements and metric, over the
/// seeds; metrics without a value have no row.
///
/// # Errors
///
/// [`RecordingError::Csv`] if the output refuses a row.
pub fn comparison_csv(comparison: &Comparison, output: impl io::Write) -> Result<(), RecordingError> {
    let mut writer = Writer::new(output);
    writer.write(["learner", "movements", "metric", "mean", "median", "q25", "q75"])?;
    for learner in &comparison.learners {
        for point in &learner.curve {
            let metrics = [
                ("orientation_deg", point.orientation_deg),
                ("axis_deg", point.axis_deg),
                ("location_m", point.location_m),
                ("prediction_m", point.prediction_m),
                ("prediction_mean_m", point.prediction_mean_m),
                ("scatter_m", point.scatter_m),
                ("trace", point.trace),
                ("bound_trace", point.bound_trace),
            ];
            for (metric, quantiles) in metrics {
                let Some(Quantiles { mean, median, q25, q75 }) = quantiles else { continue };
                let numbers = [mean, median, q25, q75].map(|value| value.to_string());
                let about = [learner.name.clone(), point.movements.to_string(), metric.to_owned()];
                writer.write(about.into_iter().chain(numbers))?;
            }
        }
    }
    writer.flush().map_err(|source| RecordingError::Csv(source.into()))
}
