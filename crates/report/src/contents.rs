//! The contents of a report, in the order of a reader's questions.

use super::{
    document::{Document, Part, number, sentence},
    extras, plots,
};
use body_schema_calibration::{
    Case, Coefficient, Coverage, Figures, Joint, Noise, Placement, Reading, Report, SocketDistance, Target, Unit,
};

/// The most readings that are listed; of more, the worst are.
const LISTED: usize = 200;
/// The most points listed of the error by number of rows.
const SHOWN: usize = 12;

pub fn document(report: &Report, case: &Case<'_>) -> Document {
    let mut document = Document {
        title: format!("Calibration of {}", report.scenario),
        subtitle: format!("{}. body-schema {}.", report.title, report.version),
        parts: Vec::new(),
    };
    headline(&mut document, report, case);
    doubts(&mut document, report);
    let mut drawings = plots::plots(report).into_iter();
    document.heading("Residuals");
    document.parts.extend(drawings.next());
    outliers(&mut document, report);
    noise(&mut document, &report.noise);
    readings_of_joints(&mut document, report);
    document.parts.extend(report.coverage.as_ref().map(|it| Part::Text(covered(it))));
    document.heading("What was learned");
    let frame = case.link(0);
    placements(
        &mut document,
        (&frame, case.described.is_some()),
        &report.base,
        report.targets.iter().chain(&report.cameras),
    );
    corrections(&mut document, &frame, &report.joints, &[&report.intrinsics, &report.distortion]);
    document.parts.extend(drawings);
    document.heading("What the rows cannot tell");
    undetermined(&mut document, report);
    document.heading("More rows");
    document.text(sentence(&report.more_rows.said));
    by_number(&mut document, report);
    extras::write(&mut document, report);
    folds(&mut document, report);
    written(&mut document, report, case);
    readings(&mut document, report);
    document
}

fn headline(document: &mut Document, report: &Report, case: &Case<'_>) {
    let unit = report.unit;
    let means = report.held_out.as_ref().map(|held_out| (held_out.before.mean(), held_out.after.mean()));
    let said = match means {
        Some((Some(before), Some(after))) => {
            let change = 100.0 * (1.0 - after / before);
            let verdict =
                if change >= 0.0 { format!("{change:.0}\u{a0}% less") } else { format!("{:.0}\u{a0}% more", -change) };
            if case.meets_itself() {
                format!(
                    "Where it has not been before, the calibrated robot meets itself within {after:.2} {unit} on average; the \
                     nominal one, within {before:.2} {unit}: {verdict}."
                )
            } else {
                format!(
                    "On rows that it has not seen the calibrated robot misses by {after:.2} {unit} on average; the nominal \
                     one, by {before:.2} {unit}: {verdict}."
                )
            }
        }
        Some(_) => "The rows that were held out predict nothing.".to_owned(),
        None => "No row was held out: how good this calibration is on new data is not known. Hold some out, by \
                 folds: in the file, in the form of the page, or by --folds 5."
            .to_owned(),
    };
    let of = if case.described.is_some() { "calibrated.urdf" } else { "these axes" };
    document.parts.push(Part::Lead(sentence(&report.verdict.said(of))));
    document.text(said);
    document.text(format!(
        "The table has {} rows; the calibrated model is learned from {} of them. Held out: {}. Nominal means the chain as the file has it, with base, targets, \
         cameras and sockets fitted to the same rows: what can be reached without touching the description. Errors are the \
         distances of what was measured from what is predicted, reading by reading.",
        report.rows, report.training_rows, report.held_out_by
    ));
    let held_out = report.held_out.iter().flat_map(|held_out| {
        let full = (!same(&held_out.after, &held_out.full_model))
            .then_some(("held out, extended model", &held_out.full_model));
        [("held out, nominal", &held_out.before), ("held out, calibrated", &held_out.after)].into_iter().chain(full)
    });
    let training =
        [("learned from, nominal", &report.training.before), ("learned from, calibrated", &report.training.after)];
    figures(document, held_out.chain(training));
    if !report.sockets.is_empty() {
        document.text(
            "That a ball meets itself says nothing of how large the robot is. So here is how far the two sockets of every place \
             are apart, places that nothing was learned from:",
        );
        let row = |it: &SocketDistance| [it.place.clone(), number(Some(it.predicted_mm)), number(it.known_mm)];
        document.table(1, ["place", "predicted (mm)", "known (mm)"], report.sockets.iter().map(row));
    }
    document.parts.extend(report.span_1m_sd_mm.map(|sd_mm| Part::Text(span(sd_mm))));
}

pub(super) fn covered(coverage: &Coverage) -> String {
    let percent = |share: f64| format!("{:.0}\u{a0}%", 100.0 * share);
    let wider = match coverage.widened {
        widened if widened < 1.005 => String::new(),
        widened => format!(
            ", {widened:.2} times as wide as these alone would have it, since what no parameter explains is larger in some postures, as \
             folds among the training rows say"
        ),
    };
    format!(
        "Of {} held-out readings {} lie within the 95\u{a0}% that are stated for them, by the noise and the uncertainty of what was \
         learned{wider} ({} to {}, 95\u{a0}% interval, clustered by posture).",
        coverage.readings,
        percent(coverage.share),
        percent(coverage.low),
        percent(coverage.high)
    )
}

fn span(sd_mm: f64) -> String {
    format!(
        "By what was learned and the prior, a span of 1 m of the calibrated robot is right to ± {sd_mm:.2} mm (one standard deviation, \
         over the joint limits): errors that no parameter explains come on top."
    )
}

fn same(one: &Figures, other: &Figures) -> bool {
    one == other
}

pub(super) fn figures<'a>(document: &mut Document, rows: impl Iterator<Item = (&'a str, &'a Figures)>) {
    let rows: Vec<_> = rows.collect();
    let units = [Unit::Millimetres, Unit::Degrees, Unit::Pixels].into_iter();
    let shown: Vec<Unit> =
        units.filter(|unit| rows.iter().any(|(_, figures)| figures.told(*unit)[0].is_some())).collect();
    let mut head = vec!["errors".to_owned(), "readings".to_owned()];
    for unit in &shown {
        head.extend(["mean", "rms", "max"].map(|name| format!("{name} ({unit})")));
    }
    let cells = |(name, figures): &(&str, &Figures)| {
        let numbers = shown.iter().flat_map(|unit| figures.told(*unit)).map(number);
        [(*name).to_owned(), figures.readings.to_string()].into_iter().chain(numbers).collect()
    };
    let rows = rows.iter().map(cells).collect();
    document.parts.push(Part::Table(super::document::Table { words: 1, head, rows }));
}

fn doubts(document: &mut Document, report: &Report) {
    if report.doubts.is_empty() {
        return;
    }
    document.heading("Doubts about the table");
    document.text("Nothing was corrected. Look into these first: a calibration cannot be better than its data.");
    document.parts.push(Part::List(report.doubts.clone()));
}

fn outliers(document: &mut Document, report: &Report) {
    if report.outliers.is_empty() {
        return;
    }
    document.text(
        "Rows that are likelier outliers than not, by the residuals of their readings. They hardly count in the fit; what is off by more than ten times the median counts in no figure of errors either:",
    );
    let row = |outlier: &body_schema_calibration::Outlier| {
        [outlier.row.to_string(), line(outlier.line, outlier.file.as_deref()), format!("{:.3}", outlier.probability)]
    };
    document.table(0, ["row", "line of the file", "probability"], report.outliers.iter().map(row));
}

/// A line of the file, named where there is more than one file.
fn line(number: usize, file: Option<&str>) -> String {
    file.map_or_else(|| number.to_string(), |file| format!("{number} of {file}"))
}

/// What is said of targets that err together.
fn together(shared: f64) -> String {
    match shared {
        shared if shared < 1.05 => String::new(),
        shared => format!(
            "; the targets of this link err together, so that of {shared:.1} equations each counts as one, and variances of what is learned are so many \
             times as large"
        ),
    }
}

pub(super) fn noise(document: &mut Document, noise: &[Noise]) {
    let said = noise.iter().filter_map(|noise| {
        let explaining = noise.explaining_sigma?;
        let (factor, name) = match noise.unit.as_str() {
            "m" => (1e3, "mm"),
            "rad" => (1_f64.to_degrees(), "deg"),
            other => (1.0, other),
        };
        Some(format!(
            "{}: χ² is {:.1} with {:.1} degrees of freedom for a nominal σ of {:.3} {name} per coordinate; a σ of {:.3} {name}, \
             {:.1} times as much, explains the residuals{}.",
            noise.sensor,
            noise.chi2,
            noise.degrees,
            noise.sigma * factor,
            explaining * factor,
            explaining / noise.sigma,
            together(noise.shared)
        ))
    });
    let said: Vec<String> = said.collect();
    match said.as_slice() {
        [] => {}
        [only] => document.text(only.clone()),
        _ => document.parts.push(Part::List(said)),
    }
}

fn readings_of_joints(document: &mut Document, report: &Report) {
    let joints = report.joints.iter().zip(&report.reading_sigmas);
    let said: Vec<String> = joints.filter_map(|(joint, sigma)| reading(joint, *sigma)).collect();
    if !said.is_empty() {
        document.text(format!(
            "Joints stand beside what they read, anew at every posture; standard deviations that explain the residuals: {}.",
            said.join(", ")
        ));
    }
}

fn reading(joint: &Joint, sigma: f64) -> Option<String> {
    let said = match joint.kind.as_str() {
        "prismatic" => format!("{} {:.3} mm", joint.name, sigma * 1e3),
        _ => format!("{} {:.3} deg", joint.name, sigma.to_degrees()),
    };
    (sigma > 0.0).then_some(said)
}

/// The places of the base, whose link is `frame`, and of all else; of a robot from a URDF on links, otherwise behind joints.
pub(super) fn placements<'a>(
    document: &mut Document,
    (frame, has_links): (&str, bool),
    base: &Placement,
    others: impl Iterator<Item = &'a Target>,
) {
    let mm = |xyz: &[f64; 3]| xyz.map(|x| format!("{:.2}", x * 1e3)).join(", ");
    let deg = |rpy: &[f64; 3]| rpy.map(|x| format!("{:.3}", x.to_degrees())).join(", ");
    let sd = |xyz: &Option<[f64; 3]>| xyz.as_ref().map_or_else(|| "known".to_owned(), |xyz| format!("± {}", mm(xyz)));
    let Placement { xyz_m, rpy_rad, xyz_sd_m, .. } = base;
    let base = [format!("{frame} in the frame of the measurements"), mm(xyz_m), sd(xyz_sd_m), deg(rpy_rad)];
    let target = |target: &Target| {
        let rpy = target.rpy_rad.as_ref().map_or_else(|| "–".to_owned(), deg);
        let place = if has_links { "in the frame of" } else { "behind" };
        [format!("{} {place} {}", target.name, target.link), mm(&target.xyz_m), sd(&target.xyz_sd_m), rpy]
    };
    let rows = std::iter::once(base).chain(others.map(target));
    document.table(1, ["where", "x, y, z (mm)", "standard deviations (mm)", "roll, pitch, yaw (deg)"], rows);
}

/// The corrections of joints, in the frame of the link `frame`, and what was learned of `cameras`: intrinsics and distortion.
pub(super) fn corrections(document: &mut Document, frame: &str, joints: &[Joint], cameras: &[&[Coefficient]; 2]) {
    document.text(format!(
        "Corrections of the axes, in the frame of {frame} with all joints at 0, with standard deviations. Along and about an axis \
         nothing is corrected: that moves nothing."
    ));
    let triple = |values: &[f64; 3], deviations: &[f64; 3], decimals: usize| {
        let cell = |k: usize| format!("{:+.decimals$} ± {:.decimals$}", values[k], deviations[k]);
        [cell(0), cell(1), cell(2)].join(", ")
    };
    let row = |(index, joint): (usize, &Joint)| {
        let name = format!("{}. {}", index + 1, joint.name);
        if !joint.learned {
            return [name, "held".to_owned(), "held".to_owned()];
        }
        let shift = match joint.kind.as_str() {
            "prismatic" => "–".to_owned(),
            _ => triple(&joint.shift_mm, &joint.shift_sd_mm, 2),
        };
        [name, shift, triple(&joint.turn_deg, &joint.turn_sd_deg, 3)]
    };
    document.table(1, ["joint", "shift x, y, z (mm)", "turn about x, y, z (deg)"], joints.iter().enumerate().map(row));
    let offsets: Vec<_> = joints.iter().filter_map(|joint| Some((joint, joint.offset?))).collect();
    if !offsets.is_empty() {
        let unit = |joint: &Joint| if joint.kind == "prismatic" { "mm" } else { "deg" };
        let row = |(joint, offset): (&Joint, body_schema_calibration::Correction)| {
            [joint.name.clone(), format!("{:+.3} ± {:.3} {}", offset.value, offset.sd, unit(joint))]
        };
        document.table(1, ["joint", "offset of its reading"], offsets.into_iter().map(row));
    }
    let [intrinsics, distortion] = cameras;
    let row = |(decimals, it): (usize, &Coefficient)| {
        [it.camera.clone(), it.name.clone(), format!("{:+.decimals$} ± {:.decimals$}", it.value, it.sd)]
    };
    let rows: Vec<_> = intrinsics.iter().map(|it| (2, it)).chain(distortion.iter().map(|it| (5, it))).collect();
    if !rows.is_empty() {
        document.table(
            2,
            ["camera", "what was learned of its lens (fx, fy, cx, cy in px)", "value"],
            rows.into_iter().map(row),
        );
    }
}

fn undetermined(document: &mut Document, report: &Report) {
    let parameters = &report.parameters;
    document.text(format!(
        "{} parameters were learned; the rows determine {} directions among them.",
        parameters.learned, parameters.rank
    ));
    if !parameters.undetermined.is_empty() {
        document.parts.push(Part::List(parameters.undetermined.iter().map(|said| sentence(said)).collect()));
    }
    if report.correlations.is_empty() {
        document.text("No two parameters are correlated above 0.9.");
        return;
    }
    document.text("Pairs of parameters that the rows hardly tell apart; what is known is their sum or difference. b₁ and b₂ are the two directions across an axis.");
    let row = |it: &body_schema_calibration::Correlation| {
        [it.first.clone(), it.second.clone(), format!("{:+.3}", it.correlation)]
    };
    document.table(2, ["one", "other", "correlation"], report.correlations.iter().map(row));
}

fn by_number(document: &mut Document, report: &Report) {
    if let Some(choice) = &report.selection {
        let rows = choice.rows.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        document.text(format!(
            "Rows were chosen one by one by criterion {}; it began with {}. Of all training rows it chooses, in this order, {rows}.",
            choice.criterion, choice.start
        ));
    }
    let points = if report.active.is_empty() { &report.learning } else { &report.active };
    if points.is_empty() {
        return;
    }
    let unit = report.unit;
    let step = points.len().div_ceil(SHOWN);
    let shown = points.iter().enumerate().filter(|(index, _)| (points.len() - 1 - index).is_multiple_of(step));
    let row = |(_, point): (usize, &body_schema_calibration::ActivePoint)| {
        let [active, median, low, high] =
            [point.active_mm, point.random_median_mm, point.random_q25_mm, point.random_q75_mm].map(number);
        [point.rows.to_string(), active, median, low, high]
    };
    document.text("Mean error on held-out rows after so many rows:");
    let title = |name: &str| format!("{name} ({unit})");
    let (chosen, median) = (title("chosen"), title("random, median"));
    document.table(0, ["rows", &chosen, &median, "lower quartile", "upper quartile"], shown.map(row));
}

fn folds(document: &mut Document, report: &Report) {
    let Some(folds) = report.held_out.as_ref().map(|held_out| &held_out.folds).filter(|folds| !folds.is_empty()) else {
        return;
    };
    document.heading("Fold by fold");
    let unit = report.unit;
    let row = |fold: &body_schema_calibration::Fold| {
        let mean = |figures: &Figures| number(figures.mean());
        let figures = [&fold.before, &fold.after, &fold.full_model].map(mean);
        let [before, after, full] = figures;
        [fold.fold.to_string(), fold.rows.len().to_string(), before, after, full]
    };
    let described = format!("nominal ({unit})");
    document.table(0, ["fold", "rows held out", &described, "calibrated", "extended model"], folds.iter().map(row));
}

/// A sentence on what calibrated.urdf holds.
fn origins(report: &Report) -> String {
    let about = if report.joints.iter().any(|joint| joint.offset.is_some()) {
        "The learned offsets of readings are in these origins already: frames are turned or shifted by them along and about their axes, \
         and whoever adds them to the readings of the robot as well counts them twice. Frames of all other joints stay where they were \
         along and about their axes."
    } else {
        "Frames stay where they were along and about their axes."
    };
    format!(
        "calibrated.urdf: the description, byte for byte, with other origins of the learned joints. {about} Limits stay in the readings \
         of old."
    )
}

fn written(document: &mut Document, report: &Report, case: &Case<'_>) {
    document.heading("The files");
    if case.described.is_none() {
        document.text(
            "The robot was given joint by joint, not as a URDF, so none is written: the learned axes are in readings.yaml and \
             report.json. Name a URDF by `urdf` under [robot] to have it corrected.",
        );
        return;
    }
    let mut said = vec![
        origins(report),
        "kinematics.yaml: the same origins, as descriptions made by xacro take them.".to_owned(),
        "readings.yaml: the extended model, with axes of its own.".to_owned(),
        "report.json: every number of this report, and every reading.".to_owned(),
    ];
    if report.held_out.as_ref().is_some_and(|held_out| !held_out.folds.is_empty()) {
        said.push(
            "folds/K/calibrated.urdf: what fold K learned; these were judged. calibrated.urdf comes from all rows."
                .to_owned(),
        );
    }
    document.parts.push(Part::List(said));
}

fn readings(document: &mut Document, report: &Report) {
    document.heading("Readings");
    let unit = report.unit;
    let error_of = |reading: &Reading| unit.of_reading(reading).unwrap_or(0.0);
    let mut shown: Vec<&Reading> = report.residuals.iter().collect();
    if shown.len() > LISTED {
        shown.sort_by(|a, b| error_of(b).total_cmp(&error_of(a)));
        shown.truncate(LISTED);
        document.text(format!("The {LISTED} worst of {}; report.json has all.", report.residuals.len()));
    }
    document.text("Measured and predicted: metres, rotation vectors in radians, pixels.");
    let told = |x: &f64| if x.is_nan() { "–".to_owned() } else { format!("{x:.4}") };
    let numbers = |numbers: &[f64]| numbers.iter().map(told).collect::<Vec<_>>().join(", ");
    let row = |it: &Reading| {
        [
            it.row.to_string(),
            line(it.line, it.file.as_deref()),
            it.sensor.clone(),
            if it.held_out { "yes" } else { "no" }.to_owned(),
            it.chosen.map_or_else(String::new, |place| place.to_string()),
            numbers(&it.measured),
            numbers(&it.predicted),
            number(unit.of_reading(it)),
            it.outlier_probability.map_or_else(|| "–".to_owned(), |probability| format!("{probability:.2}")),
        ]
    };
    let error = format!("residual ({unit})");
    document.table(
        3,
        ["row", "line", "of", "held out", "chosen as", "measured", "predicted", &error, "outlier"],
        shown.into_iter().map(row),
    );
}
