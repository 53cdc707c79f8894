//! The drawings of a report.

use super::document::Part;
use body_schema_calibration::{ActivePoint, Reading, Report, Unit};
use body_schema_chart::{Axis, Chart, Colour, Layer, Marker, Panel, Style};
use body_schema_palette::learner_color;

/// The most points of a plot: of more, the greatest in every stretch of rows is drawn.
const POINTS: usize = 1200;

/// All drawings for which there are data.
pub fn plots(report: &Report) -> Vec<Part> {
    [residuals(report), corrections(report)].into_iter().flatten().collect()
}

fn residuals(report: &Report) -> Option<Part> {
    let unit = report.unit;
    let panels: Vec<Panel> = [by_row(report, unit), by_number(report, unit)].into_iter().flatten().collect();
    if panels.is_empty() {
        return None;
    }
    let has_numbers = panels.len() > 1;
    let mut legend = Vec::new();
    if report.residuals.iter().any(|reading| !reading.held_out) {
        legend.push(("row learned from".to_owned(), Style::points(Marker::Circle, trained())));
    }
    if report.held_out.is_some() {
        legend.push(("row held out".to_owned(), Style::points(Marker::Diamond, held_out())));
    }
    if !report.outliers.is_empty() {
        legend.push(("likelier an outlier than not".to_owned(), Style::points(Marker::Square, outlier())));
    }
    if has_numbers {
        legend.push(("random rows, median and quartiles".to_owned(), random_style()));
    }
    if !report.active.is_empty() {
        legend.push(("chosen rows".to_owned(), chosen_style()));
    }
    let chart = Chart {
        title: "How far predictions miss".to_owned(),
        subtitle: "the distance of what was measured from what the calibrated model predicts".to_owned(),
        legend,
        rows: vec![panels],
        notes: Vec::new(),
    };
    let mut caption = "Left: the residual of every reading; with folds each row is predicted by the model that had not learned from it."
        .to_owned();
    if report.residuals.len() > POINTS {
        caption.push_str(&format!(" Of {} readings the greatest of every stretch are drawn.", report.residuals.len()));
    }
    if has_numbers {
        caption.push_str(" Right: the error on held-out rows against how many rows were learned from.");
    }
    Some(Part::Figure { name: "residuals".to_owned(), svg: chart.svg(), caption })
}

fn trained() -> Colour {
    learner_color(5)
}

fn held_out() -> Colour {
    learner_color(2)
}

fn outlier() -> Colour {
    learner_color(8)
}

fn random_style() -> Style {
    Style { colour: learner_color(1), dashes: "7 3", marker: None }
}

fn chosen_style() -> Style {
    Style { colour: learner_color(0), dashes: "", marker: Some(Marker::Dot) }
}

fn by_row(report: &Report, unit: Unit) -> Option<Panel> {
    let drawn = thinned(&report.residuals, unit);
    let values = drawn.iter().filter_map(|reading| unit.of_reading(reading));
    let most = values.fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let suspected: Vec<usize> = report.outliers.iter().map(|outlier| outlier.row).collect();
    let points = |wanted: &dyn Fn(&Reading) -> bool| -> Vec<[f64; 2]> {
        let wanted = drawn.iter().filter(|reading| wanted(reading));
        wanted.filter_map(|reading| Some([reading.row as f64, unit.of_reading(reading)?])).collect()
    };
    let is_suspected = |reading: &Reading| suspected.contains(&reading.row);
    let layer = |points, marker, colour| Layer::Points { points, marker, colour };
    let mut layers = vec![
        layer(points(&|it| !it.held_out && !is_suspected(it)), Marker::Circle, trained()),
        layer(points(&|it| it.held_out && !is_suspected(it)), Marker::Diamond, held_out()),
        layer(points(&is_suspected), Marker::Square, outlier()),
    ];
    if let Some(mean) = report.held_out.as_ref().and_then(|held_out| held_out.after.mean()) {
        layers.insert(0, Layer::Level { y: mean, label: "mean, held out".to_owned() });
    }
    Some(Panel {
        title: "residual of every reading".to_owned(),
        x: Axis::linear("row of the table", [].into_iter()).over(0.0, report.rows as f64 + 1.0),
        y: Axis::linear(&format!("residual ({unit})"), [].into_iter()).over(0.0, most * 1.06),
        layers,
    })
}

/// The readings to draw: where there are many, the greatest residual of every stretch of rows.
fn thinned(readings: &[Reading], unit: Unit) -> Vec<&Reading> {
    let length = readings.len().div_ceil(POINTS).max(1);
    let size = |reading: &&Reading| unit.of_reading(reading).unwrap_or(0.0);
    readings.chunks(length).filter_map(|chunk| chunk.iter().max_by(|a, b| size(a).total_cmp(&size(b)))).collect()
}

fn by_number(report: &Report, unit: Unit) -> Option<Panel> {
    let points = if report.active.is_empty() { &report.learning } else { &report.active };
    let curve = |of: fn(&ActivePoint) -> Option<f64>| -> Vec<[f64; 2]> {
        points.iter().filter_map(|point| Some([point.rows as f64, of(point)?])).collect()
    };
    let (median, active) = (curve(|it| it.random_median_mm), curve(|it| it.active_mm));
    let band: Vec<[f64; 3]> = points
        .iter()
        .filter_map(|point| Some([point.rows as f64, point.random_q25_mm?, point.random_q75_mm?]))
        .collect();
    let last = points.last()?.rows as f64;
    let before = report.held_out.as_ref()?.before.mean()?;
    let values = median.iter().chain(&active).map(|point| point[1]).chain([before]);
    let y = Axis::log(&format!("mean held-out error ({unit})"), values);
    Some(Panel {
        title: "held-out error by rows".to_owned(),
        x: Axis::linear("rows learned from", [].into_iter()).over(0.0, last * 1.03),
        y,
        layers: vec![
            Layer::Band { points: band, colour: learner_color(1) },
            Layer::Level { y: before, label: "nominal".to_owned() },
            Layer::Curve { points: median, style: random_style() },
            Layer::Curve { points: active, style: chosen_style() },
        ],
    })
}

/// A joint's correction and its standard deviation, by coordinate.
type Correction = fn(&body_schema_calibration::Joint) -> ([f64; 3], [f64; 3]);

fn corrections(report: &Report) -> Option<Part> {
    if !report.joints.iter().any(|joint| joint.learned) {
        return None;
    }
    let axes = ["x", "y", "z"];
    let colours = [learner_color(1), learner_color(2), learner_color(0)];
    let markers = [Marker::Triangle, Marker::Square, Marker::Circle];
    let panel = |title: &str, label: &str, of: Correction| {
        let (mut layers, mut extent) = (vec![Layer::Level { y: 0.0, label: String::new() }], vec![0.0]);
        for k in 0..3 {
            let mut points = Vec::new();
            for (index, joint) in report.joints.iter().enumerate().filter(|(_, joint)| joint.learned) {
                let (values, deviations) = of(joint);
                // What an axis cannot do is not drawn: a shift along it, a turn about it.
                if values[k] == 0.0 && deviations[k] < 1e-9 {
                    continue;
                }
                let x = (index + 1) as f64 + 0.2 * (k as f64 - 1.0);
                let bar = vec![[x, values[k] - deviations[k]], [x, values[k] + deviations[k]]];
                extent.extend([bar[0][1], bar[1][1]]);
                layers
                    .push(Layer::Curve { points: bar, style: Style { colour: colours[k], dashes: "", marker: None } });
                points.push([x, values[k]]);
            }
            layers.push(Layer::Points { points, marker: markers[k], colour: colours[k] });
        }
        Panel {
            title: title.to_owned(),
            x: Axis::linear("joint, numbered as in the table", [].into_iter())
                .over(0.4, report.joints.len() as f64 + 0.6),
            y: Axis::linear(label, extent.into_iter()),
            layers,
        }
    };
    let chart = Chart {
        title: "How the axes were corrected".to_owned(),
        subtitle: "in the base link's frame with all joints at 0; bars are one standard deviation".to_owned(),
        legend: (0..3).map(|k| (axes[k].to_owned(), Style::points(markers[k], colours[k]))).collect(),
        rows: vec![vec![
            panel("shift of the axis", "shift (mm)", |joint| (joint.shift_mm, joint.shift_sd_mm)),
            panel("turn of the axis", "turn (deg)", |joint| (joint.turn_deg, joint.turn_sd_deg)),
        ]],
        notes: Vec::new(),
    };
    let caption =
        "How far every axis was shifted across itself, and by what it was turned. A bar that reaches beyond 0 is no \
                   correction to rely on by itself."
            .to_owned();
    Some(Part::Figure { name: "corrections".to_owned(), svg: chart.svg(), caption })
}
