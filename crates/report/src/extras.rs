//! The section on what correcting more than axes changes.

use super::document::{Document, Part, number, sentence};
use body_schema_calibration::{Extra, JointCompliance, Report, Trial};
use body_schema_engine::model::listed;

pub(super) fn write(document: &mut Document, report: &Report) {
    document.heading("What axes cannot explain");
    if report.extras.iter().all(|trial| trial.inner.is_none()) {
        document.text("There are too few rows to tell whether anything beside the axes is worth learning.");
        return;
    }
    let kept = report.extras.iter().any(|trial| trial.kept);
    document.text(format!(
        "What is added must predict rows better that it has not seen: five folds among the training rows decide, by more than twice \
         the standard error of the difference. Rows that are held out decide nothing. {}",
        if kept { "What stays is in readings.yaml, with axes of its own." } else { "Nothing stays." }
    ));
    let unit = report.unit;
    let row = |trial: &Trial| {
        let name = listed(trial.extras.iter().map(|extra: &Extra| extra.name().to_owned()).collect());
        [
            name,
            trial.parameters.to_string(),
            number(trial.inner_without),
            number(trial.inner),
            number(trial.standard_error),
            number(trial.held_out.and_then(|figures| figures.mean())),
            if trial.kept { "yes" } else { "no" }.to_owned(),
        ]
    };
    let inner = format!("without ({unit})");
    document.table(
        1,
        ["added", "parameters", &inner, "with", "± difference", "held out", "kept"],
        report.extras.iter().map(row),
    );
    let mut merged: Vec<&String> = report.extras.iter().flat_map(|trial| &trial.merged).collect();
    merged.sort_unstable();
    merged.dedup();
    if !merged.is_empty() {
        document.parts.push(Part::List(merged.into_iter().map(|said| sentence(said)).collect()));
    }
    compliance(document, report);
}

fn compliance(document: &mut Document, report: &Report) {
    let Some(compliance) = &report.compliance else { return };
    let [x, y, z] = compliance.up;
    document.text(format!(
        "Joints give way to gravity. By how much for every N·m with which it pulls at 1 kg at the target, or at the elbow (the origin \
         of {}), up being [{x:.3}, {y:.3}, {z:.3}]:",
        compliance.elbow
    ));
    let row = |term: &JointCompliance| {
        [
            term.joint.clone(),
            term.load.clone(),
            format!("{:+.4} ± {:.4}", term.deg_per_nm, term.sd_deg_per_nm),
            format!("{:+.3}", term.greatest_deg),
        ]
    };
    let head = ["joint", "load at the", "deg per N·m", "at its greatest load (deg)"];
    document.table(2, head, compliance.terms.iter().map(row));
    let rises = |term: &&JointCompliance| term.deg_per_nm < -2.0 * term.sd_deg_per_nm;
    let rising: Vec<String> =
        compliance.terms.iter().filter(rises).map(|term| format!("{} at the {}", term.joint, term.load)).collect();
    if !rising.is_empty() {
        document.text(format!(
            "No joint rises under a load: below 0 by more than two standard deviations ({}) something else is explained.",
            listed(rising)
        ));
    }
}
