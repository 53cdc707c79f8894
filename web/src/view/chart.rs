//! The charts over the steps, and their scales.

use egui_plot::{GridInput, GridMark};

use crate::{history::Row, panel::Panel};

/// A chart.
pub(super) struct Chart {
    pub(super) title: &'static str,
    pub(super) unit: &'static str,
    /// An explanation of the number.
    pub(super) tip: &'static str,
    pub(super) logarithmic: bool,
    /// Whether convergence is marked on it.
    pub(super) judged: bool,
    /// Whether it is an error, on which it is marked where a learner has learned the arm.
    pub(super) is_error: bool,
    pub(super) value: fn(&Row) -> Option<f64>,
    /// What the data collected allow of it.
    pub(super) bound: Option<fn(&Row) -> Option<f64>>,
}

/// The title of the error where nothing but sockets is measured.
pub(super) const SCATTER: &str = "Scatter in sockets";

/// The title of the error that a robot elsewhere can be told.
pub(super) const EXPECTED: &str = "Expected error";

/// The title of the trace that active learners make small.
const UNCERTAINTY: &str = "Uncertainty";

pub(super) const CHARTS: [Chart; 8] = [
    Chart {
        title: "Orientation error",
        unit: "°",
        tip: "Mean error of the angles between the joints' axes; dashed: the threshold of convergence",
        logarithmic: true,
        judged: true,
        is_error: true,
        value: |row| row.orientation_deg,
        bound: None,
    },
    Chart {
        title: "Location error",
        unit: "mm",
        tip: "Mean distance of the true axis points from the estimated axes; dashed: the threshold of convergence",
        logarithmic: true,
        judged: true,
        is_error: true,
        value: |row| Some(row.location_m? * 1e3),
        bound: None,
    },
    Chart {
        title: "Prediction error",
        unit: "mm",
        tip: "Mean distance between the predicted and the true marker over postures never seen",
        logarithmic: true,
        judged: false,
        is_error: true,
        value: |row| Some(row.prediction_m? * 1e3),
        bound: None,
    },
    Chart {
        title: SCATTER,
        unit: "mm",
        tip: "Mean distance of the predicted target from its own mean, in sockets that nobody has learned from: it is blind to \
              how large the robot is",
        logarithmic: true,
        judged: false,
        is_error: true,
        value: |row| Some(row.scatter_m? * 1e3),
        bound: None,
    },
    Chart {
        title: EXPECTED,
        unit: "mm",
        tip: "Mean error of predictions over the workspace, as the learner expects it by its own estimate; dashed: what is wanted",
        logarithmic: true,
        judged: false,
        is_error: true,
        value: |row| Some(row.expected_m? * 1e3),
        bound: None,
    },
    Chart {
        title: UNCERTAINTY,
        unit: "",
        tip: "How unsure each learner is by its own account, which the active ones make as small as they can: the trace \
              of the weighted covariance, tr(W P). In rad², one metre counts as one radian unless the scenario says \
              otherwise; in prior variances, 1 a parameter is what the first guess left open",
        logarithmic: true,
        judged: false,
        is_error: false,
        value: |row| row.trace,
        bound: Some(|row| row.bound),
    },
    Chart {
        title: "Misses",
        unit: "movements",
        tip: "Movements after which the marker was not seen",
        logarithmic: false,
        judged: false,
        is_error: false,
        value: |row| Some(row.misses as f64),
        bound: None,
    },
    Chart {
        title: "Time of a choice",
        unit: "ms",
        tip: "How long it took to choose the movement",
        logarithmic: true,
        judged: false,
        is_error: false,
        value: |row| row.selection_ms.filter(|ms| *ms > 0.0),
        bound: None,
    },
];

/// A title as an address has it: `location-error`.
pub(crate) fn in_address(title: &str) -> String {
    title.to_lowercase().replace(' ', "-")
}

/// The title of the chart that an address names so.
pub(crate) fn of_address(name: &str) -> Option<&'static str> {
    CHARTS.iter().map(|chart| chart.title).find(|title| in_address(title) == name)
}

/// Numbers below this are drawn as this where the scale is logarithmic.
const FLOOR: f64 = 1e-9;

impl Chart {
    /// Its title with its unit.
    pub(super) fn label(&self, panel: &Panel) -> String {
        match self.unit(panel) {
            "" => self.title.to_owned(),
            unit => format!("{}, {unit}", self.title),
        }
    }

    /// The unit of its numbers; that of the uncertainty is the scenario's choice.
    pub(super) fn unit<'a>(&self, panel: &'a Panel) -> &'a str {
        if self.title == UNCERTAINTY { panel.uncertainty_unit() } else { self.unit }
    }

    pub(super) fn y(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(FLOOR).log10() } else { value }
    }

    pub(super) fn number(&self, y: f64) -> String {
        let value = if self.logarithmic { 10f64.powf(y) } else { y };
        // Three significant digits, without trailing zeros.
        let digits = (2 - value.abs().max(1e-6).log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }

    pub(super) fn threshold(&self, panel: &Panel) -> Option<f64> {
        if self.title == EXPECTED {
            return panel.robot.standing.as_ref().map(|standing| standing.status.wanted_mm);
        }
        let description = panel.description().filter(|description| description.truth.is_some() && self.judged)?;
        let thresholds = description.thresholds;
        Some(if self.unit == "°" { thresholds.orientation_deg } else { thresholds.location_m * 1e3 })
    }
}

/// Marks at powers of ten and, where they are few, between them, y being its logarithm.
pub(super) fn decades(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    if !(low.is_finite() && high.is_finite()) || high - low > 40.0 {
        return Vec::new();
    }
    let mut marks = Vec::new();
    for decade in low.floor() as i32..=high.ceil() as i32 {
        marks.push(GridMark { value: f64::from(decade), step_size: 1.0 });
        let digits: &[f64] = match high - low {
            range if range < 0.7 => &[1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            range if range < 2.5 => &[2.0, 5.0],
            _ => &[],
        };
        marks.extend(digits.iter().map(|digit| GridMark { value: f64::from(decade) + digit.log10(), step_size: 0.5 }));
    }
    // Labels are drawn for every mark, wherever it lies.
    marks.retain(|mark| (low..=high).contains(&mark.value));
    marks
}

/// Marks at some five whole steps.
pub(super) fn steps(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let range = high - low;
    if !(range.is_finite() && range > 0.0) {
        return Vec::new();
    }
    let rough = (range / 5.0).max(1.0);
    let power = 10f64.powf(rough.log10().floor());
    let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|digit| digit * power >= rough).unwrap_or(10.0) * power;
    let first = (low / nice).ceil() as i64;
    (first..)
        .map(|k| k as f64 * nice)
        .take_while(|value| *value <= high)
        .take(20)
        .map(|value| GridMark { value, step_size: nice })
        .collect()
}
