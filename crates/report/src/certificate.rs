//! A certificate as one HTML file, made of its JSON alone, which it holds within.

use std::fmt::Write;

use super::{
    contents::{corrections, covered, figures, noise, placements},
    document::{Document, Part, number, sentence},
    html,
};
use body_schema_calibration::{Certificate, Errors, File, Reach, Unit};
use body_schema_palette::{hex, viridis};

/// What stands before the JSON in the page, and behind it.
const BEGINS: &str = "<script type=\"application/json\" id=\"certificate\">";
const ENDS: &str = "</script>";

/// `certificate.json` and `certificate.html`.
pub fn certificate_files(certificate: &Certificate) -> Vec<File> {
    vec![
        File::new("certificate.json", json(certificate) + "\n"),
        File::new("certificate.html", certificate_page(certificate)),
    ]
}

/// The page of a certificate: nothing is fetched, no script runs.
pub fn certificate_page(certificate: &Certificate) -> String {
    let page = html::page(&document(certificate));
    // In a script element nothing but its end has a meaning.
    let held = json(certificate).replace('<', "\\u003c");
    page.replace("</body>", &format!("{BEGINS}\n{held}\n{ENDS}\n</body>"))
}

/// The JSON that a page holds; `None` if it is no page of a certificate.
pub fn certificate_of_page(page: &str) -> Option<&str> {
    let (_, behind) = page.rsplit_once(BEGINS)?;
    Some(behind.split_once(ENDS)?.0.trim())
}

fn json(certificate: &Certificate) -> String {
    // It holds numbers, texts and lists alone.
    serde_json::to_string_pretty(certificate).unwrap_or_default()
}

fn document(certificate: &Certificate) -> Document {
    let issued = certificate.issued_at_s.map_or_else(String::new, |at_s| format!("Issued {} by ", day(at_s)));
    let mut document = Document {
        title: format!("Certificate of calibration: {}", certificate.name),
        subtitle: format!("{}. {issued}{}.", certificate.title, certificate.software),
        parts: Vec::new(),
    };
    let of = if certificate.chain.is_some() { "calibrated.urdf" } else { "these axes" };
    document.parts.push(Part::Lead(sentence(&certificate.verdict.said(of))));
    error(&mut document, certificate);
    if !certificate.doubts.is_empty() {
        document.heading("Doubts about the table");
        document.parts.push(Part::List(certificate.doubts.clone()));
    }
    document.heading("Where predictions are good to what");
    match &certificate.workspace {
        Some(reach) => workspace(&mut document, reach),
        None => document.text("No covariance was learned: nothing is known of predictions elsewhere."),
    }
    document.heading("What the rows do not determine");
    if certificate.undetermined.is_empty() {
        document.text("They determine every parameter that was learned.");
    } else {
        document.parts.push(Part::List(certificate.undetermined.iter().map(|said| sentence(said)).collect()));
    }
    document.heading("What was learned");
    if !certificate.undetermined.is_empty() {
        document.text(
            "Deviations below are those of what the rows determine. What they do not determine, above, stays as described, and its \
             uncertainty is in no number here.",
        );
    }
    let (frame, has_links) = certificate.chain.as_ref().map_or(("base", false), |chain| (chain.base.as_str(), true));
    let others = certificate.targets.iter().chain(&certificate.cameras);
    placements(&mut document, (frame, has_links), &certificate.base, others);
    corrections(&mut document, frame, &certificate.joints, &[&certificate.intrinsics, &certificate.distortion]);
    document.heading("Noise");
    noise(&mut document, &certificate.noise);
    document.text(match certificate.outliers {
        None => "Outliers were not looked for: no model explains a row without taking all others for that.".to_owned(),
        Some(0) => "No row is likelier an outlier than not.".to_owned(),
        Some(1) => "One row is likelier an outlier than not.".to_owned(),
        Some(rows) => format!("{rows} rows are likelier outliers than not."),
    });
    repeat(&mut document, certificate);
    document
}

fn error(document: &mut Document, certificate: &Certificate) {
    let (unit, data) = (certificate.unit, &certificate.data);
    document.heading("Error on data that it has not seen");
    let Some(errors) = &certificate.held_out else {
        document.text("No row was held out: how good this calibration is on new data is not known.");
        return;
    };
    let Errors { described, calibrated, median, p95, mean_by_rows, mean_by_folds } = errors;
    document.text(format!(
        "The table has {} rows; the calibrated model is learned from {} of them. Held out: {}.",
        data.rows.len(),
        data.training_rows,
        certificate.held_out_by
    ));
    figures(document, [("nominal", described), ("calibrated", calibrated)].into_iter());
    let mean = number(calibrated.told(unit)[0]);
    let interval = |[low, high]: &[f64; 2]| format!("{low:.2} to {high:.2}");
    let mut rows = vec![
        ["mean, with its 95 % interval by rows".to_owned(), mean.clone(), interval(mean_by_rows)],
        ["median".to_owned(), number(Some(*median)), String::new()],
        ["95 of 100 readings are below".to_owned(), number(Some(*p95)), String::new()],
    ];
    if let Some(by_folds) = mean_by_folds {
        rows.insert(1, ["mean, with its 95 % interval by folds".to_owned(), mean, interval(by_folds)]);
    }
    document.table(1, [&format!("error ({unit})"), "calibrated", "interval"], rows);
    let folds =
        "By folds: Student's interval of the folds' means, which has what comes of learning from other rows, too.";
    document.text(format!(
        "By rows: postures drawn anew, for this model. {}",
        if mean_by_folds.is_some() {
            folds
        } else {
            "There are no folds, whose means would tell what comes of learning from other rows."
        }
    ));
    document.text(certificate.coverage.as_ref().map_or_else(
        || {
            "How many readings lie within the intervals that are stated for them is not told: that takes ten held-out rows, each of which \
             is predicted by itself; in a socket nothing is known but how far several rows scatter."
                .to_owned()
        },
        covered,
    ));
    let [_, _, greatest] = calibrated.told(unit);
    document.text(format!("The greatest error is {} {unit}.", number(greatest)));
}

fn workspace(document: &mut Document, reach: &Reach) {
    let Reach { median_mm, p95_mm, greatest_mm, wanted_mm, share_within, .. } = reach;
    document.text(format!(
        "Of postures anywhere within the joint limits half are expected to be predicted to {median_mm:.2} mm, 95 of 100 to {p95_mm:.2} mm, all to \
         {greatest_mm:.2} mm; {:.0} % to the {wanted_mm} mm that are wanted. It is what is not known of the parameters, and what no \
         parameter explains where the rows are: far from them that may be more.",
        100.0 * share_within
    ));
    document.parts.push(Part::Figure {
        name: "workspace".to_owned(),
        svg: drawing(reach),
        caption: "The expected error where the target is, by its distance from the base's axis and its height over the base; rings are the rows \
                  of the table."
            .to_owned(),
    });
}

fn repeat(document: &mut Document, certificate: &Certificate) {
    document.heading("To repeat it");
    document.parts.push(Part::Text(certificate.command.clone()));
    document.text("body-schema verify certificate.json DATA computes all of it anew and names what differs; DATA is the calibration file.");
    let Certificate { software, data, urdf_sha256, .. } = certificate;
    let row = |name: &str, value: String| [name.to_owned(), value];
    let mut rows = vec![
        row("program", software.clone()),
        row(&format!("{} rows", data.rows.len()), format!("SHA-256 {}", data.sha256)),
    ];
    rows.extend(urdf_sha256.iter().map(|hash| row("URDF", format!("SHA-256 {hash}"))));
    document.table(2, ["of", "identity"], rows);
    document.text("Every row has a hash of its own in certificate.json, which this page holds within.");
}

/// The day of a time, UTC (H. Hinnant, chrono-compatible low-level date algorithms).
fn day(at_s: f64) -> String {
    let days = (at_s / 86_400.0).floor() as i64 + 719_468;
    let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = year + 400 * era + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

/// A map of the workspace.
fn drawing(reach: &Reach) -> String {
    const SIZE: f64 = 460.0;
    const LEFT: f64 = 70.0;
    const TOP: f64 = 16.0;
    let all = || reach.cells.iter().map(|cell| [cell.distance_m, cell.height_m]).chain(reach.rows_m.iter().copied());
    let least = |k: usize| all().map(|place| place[k]).fold(f64::INFINITY, f64::min) - reach.cell_m / 2.0;
    let most = |k: usize| all().map(|place| place[k]).fold(f64::NEG_INFINITY, f64::max) + reach.cell_m / 2.0;
    let (left, right, bottom, top) = (least(0), most(0), least(1), most(1));
    let scale = SIZE / (right - left).max(top - bottom).max(1e-9);
    let (width, height) = ((right - left) * scale, (top - bottom) * scale);
    let (x, y) = (|at: f64| LEFT + (at - left) * scale, |at: f64| TOP + (top - at) * scale);
    let errors = || reach.cells.iter().map(|cell| cell.error_mm);
    let (low, high) = (errors().fold(f64::INFINITY, f64::min), errors().fold(0.0, f64::max));
    let colour = |error: f64| hex(viridis(if high > low { (error - low) / (high - low) } else { 0.0 }));
    let (legend, bottom_line) = (LEFT + width + 36.0, TOP + height);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" aria-label=\"expected error by place\" \
         font-family=\"system-ui, sans-serif\" font-size=\"13\">\n<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{width:.1}\" height=\"{height:.1}\" \
         fill=\"#f2f4f6\"/>\n",
        legend + 190.0,
        bottom_line + 56.0
    );
    // Writing to a string does not fail.
    let side = reach.cell_m * scale;
    for cell in &reach.cells {
        let (left, top) = (x(cell.distance_m) - side / 2.0, y(cell.height_m) - side / 2.0);
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{}\"><title>{:.2} mm</title></rect>",
            side + 0.3,
            side + 0.3,
            colour(cell.error_mm),
            cell.error_mm
        );
    }
    for [distance, height] in &reach.rows_m {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.4\" fill=\"none\" stroke=\"#ffffff\" stroke-width=\"2.6\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" \
             r=\"3.4\" fill=\"none\" stroke=\"#111111\" stroke-width=\"1.1\"/>",
            x(*distance),
            y(*height),
            x(*distance),
            y(*height)
        );
    }
    for at in ticks(left, right) {
        let x = x(at);
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{bottom_line:.1}\" y2=\"{:.1}\" stroke=\"#5a636b\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\" fill=\"#1c2024\">{}</text>",
            bottom_line + 5.0,
            bottom_line + 20.0,
            tick(at)
        );
    }
    for at in ticks(bottom, top) {
        let y = y(at);
        let _ = writeln!(
            svg,
            "<line x1=\"{:.1}\" x2=\"{LEFT}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#5a636b\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" \
             fill=\"#1c2024\">{}</text>",
            LEFT - 5.0,
            LEFT - 9.0,
            y + 4.5,
            tick(at)
        );
    }
    let (middle, centre) = (LEFT + width / 2.0, TOP + height / 2.0);
    let _ = writeln!(
        svg,
        "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#1c2024\">distance from the base's axis (m)</text>\n<text \
         transform=\"translate(16 {centre:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"#1c2024\">height over the base (m)</text>",
        bottom_line + 44.0
    );
    const SHADES: usize = 6;
    let _ = writeln!(
        svg,
        "<text x=\"{legend:.1}\" y=\"{:.1}\" fill=\"#1c2024\">expected error ({})</text>",
        TOP + 12.0,
        Unit::Millimetres
    );
    for shade in 0..SHADES {
        let error = high + (low - high) * shade as f64 / (SHADES - 1) as f64;
        let top = TOP + 26.0 + 24.0 * shade as f64;
        let _ = writeln!(
            svg,
            "<rect x=\"{legend:.1}\" y=\"{top:.1}\" width=\"22\" height=\"18\" fill=\"{}\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"#1c2024\">{error:.2}</text>",
            colour(error),
            legend + 30.0,
            top + 14.0
        );
    }
    let top = TOP + 40.0 + 24.0 * SHADES as f64;
    let _ = writeln!(
        svg,
        "<circle cx=\"{:.1}\" cy=\"{top:.1}\" r=\"3.4\" fill=\"none\" stroke=\"#111111\" stroke-width=\"1.1\"/><text x=\"{:.1}\" y=\"{:.1}\" \
         fill=\"#1c2024\">row of the table</text>",
        legend + 11.0,
        legend + 30.0,
        top + 4.5
    );
    svg.push_str("</svg>\n");
    svg
}

/// About five round numbers between two.
fn ticks(from: f64, to: f64) -> Vec<f64> {
    let steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    let step = steps.into_iter().find(|step| (to - from) / step <= 6.0).unwrap_or(100.0);
    let first = (from / step).ceil() as i64;
    (first..).map(|index| index as f64 * step).take_while(|at| *at <= to).take(10).collect()
}

/// A round number without what rounding added.
fn tick(at: f64) -> String {
    let text = format!("{at:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (at_s, expected) in [
            (0.0, "1970-01-01"),
            (951_782_400.0, "2000-02-29"),
            (1_735_689_599.0, "2024-12-31"),
            (1_795_737_600.0, "2026-11-27"),
            (-1.0, "1969-12-31"),
        ] {
            assert_eq!(day(at_s), expected);
        }
    }

    #[test]
    fn ticks_are_few_and_round() {
        assert_eq!(
            ticks(-0.03, 1.17).into_iter().map(tick).collect::<Vec<_>>(),
            ["0", "0.2", "0.4", "0.6", "0.8", "1"]
        );
        assert!(ticks(0.0, 1e9).len() <= 10);
    }
}
