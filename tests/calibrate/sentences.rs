//! Whether what a report says in words is what it says in numbers.

use body_schema::{
    calibration::{Calibration, Case, Figures, Unit, Use},
    report,
};

use super::shipped;

/// The numbers of a text that stand before a unit, as they are written.
fn measures<'a>(text: &'a str, unit: &str) -> Vec<&'a str> {
    let unit = format!(" {unit}");
    let is_whole =
        |(at, found): &(usize, &str)| !text[at + found.len()..].starts_with(|next: char| next.is_ascii_alphanumeric());
    let ends = text.match_indices(&unit).filter(is_whole);
    let number = |(at, _): (usize, &str)| {
        let before = &text[..at];
        &before[before.rfind(|c: char| !(c.is_ascii_digit() || c == '.')).map_or(0, |start| start + 1)..]
    };
    let numbers = ends.map(number).filter(|number| !number.is_empty());
    numbers.collect()
}

/// All numbers below a value.
fn numbers(value: &serde_json::Value, found: &mut Vec<f64>) {
    match value {
        serde_json::Value::Number(number) => found.extend(number.as_f64()),
        serde_json::Value::Array(list) => list.iter().for_each(|value| numbers(value, found)),
        serde_json::Value::Object(keys) => keys.values().for_each(|value| numbers(value, found)),
        _ => {}
    }
}

/// Whatever a report says of a data set that ships, its sentences have the numbers of its JSON, and say nothing against each other.
#[test]
fn no_sentence_of_a_report_contradicts_another() {
    for name in ["ur10-camera", "tiago-mocap-3", "panda-sockets", "kinova-sockets", "talos-contact", "positioner"] {
        let (scenario, calibration) = shipped(name);
        let case = Case::new(&scenario).expect("measured");
        let mut files = calibration.files(&case).expect("written");
        files.extend(report::files(&calibration, &case));
        let text = |path: &str| files.iter().find(|file| file.path == path).expect(path).text.clone();
        let json: serde_json::Value = serde_json::from_str(&text("report.json")).expect("JSON");
        let (markdown, Calibration { report, .. }) = (text("report.md"), &*calibration);

        // What the rows cannot tell at all is held, and is correlated with nothing: the positioner's first joint stands with its base.
        let named = report.correlations.iter().flat_map(|it| [&it.first, &it.second]);
        assert!(report.correlations.iter().all(|it| it.correlation.abs() <= 1.0), "{name}: {:?}", report.correlations);
        assert!(
            name != "positioner" || named.clone().all(|it| !it.starts_with("joint_1, shift")),
            "{:?}",
            report.correlations
        );

        // Every measure of a sentence is that of a figure.
        let known = |keys: &[&str]| {
            let mut found = Vec::new();
            keys.iter().for_each(|key| numbers(&json[key], &mut found));
            found
        };
        let judged = ["held_out", "training", "sockets", "more_rows", "span_1m_sd_mm"];
        let said = |key: &str, part: &str| json[key][part].as_str().expect("a sentence").to_owned();
        let sentences =
            [(said("verdict", "because"), known(&judged)), (said("more_rows", "said"), known(&["more_rows"]))];
        for (sentence, known) in &sentences {
            for written in ["mm", "px", "deg"].into_iter().flat_map(|unit| measures(sentence, unit)) {
                let digits = written.split_once('.').map_or(0, |(_, digits)| digits.len());
                let is_it = |known: &f64| format!("{known:.digits$}") == written;
                assert!(known.iter().any(is_it), "{name}: {written} of `{sentence}` is nowhere in {known:?}");
            }
        }
        // The page says the verdict and the mean errors in the unit that they have.
        let held_out = report.held_out.as_ref().expect("held out");
        let mean = |figures: &Figures| figures.told(report.unit)[0].expect("a mean");
        let (before, after) = (mean(&held_out.before), mean(&held_out.after));
        assert!(markdown.contains(&report.verdict.because), "{name}");
        for mean in [before, after] {
            assert!(markdown.contains(&format!("{mean:.2} {}", report.unit)), "{name}: {mean}");
        }
        assert_eq!(measures(&report.verdict.because, "px").is_empty(), report.unit != Unit::Pixels, "{name}");

        // What is to be used is better than what there was, and what is limited says by what.
        assert_eq!(report.verdict.r#use != Use::No, after < 0.98 * before, "{name}: {:?}", report.verdict);
        assert_eq!(report.verdict.because.contains("; but "), report.verdict.r#use == Use::Limited, "{name}");
        let more = &report.more_rows;
        let expected = more.expected_mm.expect("expected");
        assert_eq!(
            more.said.contains("are reached"),
            more.rows_needed.is_some_and(|needed| needed <= more.rows as u64),
            "{name}"
        );
        assert_eq!(
            more.said.starts_with("no number of rows"),
            more.rows_needed.is_none() && more.rows_needed_if_noise.is_none(),
            "{name}"
        );
        if more.said.contains("are reached") && more.rows_needed.is_some() {
            assert!(expected <= more.wanted_mm * 1.0001, "{name}: {more:?}");
        }
        let parts = more.from_parameters_mm.expect("told").hypot(more.model_error_mm);
        assert!((parts - expected).abs() < 1e-9 * expected, "{name}: {more:?}");
        // A direction that rows do not tell is named, and only then.
        let undetermined = report.parameters.learned - report.parameters.rank;
        assert_eq!(report.parameters.undetermined.is_empty(), undetermined == 0, "{name}: {:?}", report.parameters);
        // Coverage warns where its interval says so, and nowhere else.
        // How far a target scatters in sockets is one number a place.
        let Some(coverage) = &report.coverage else { continue };
        let warned = report.doubts.iter().any(|doubt| doubt.contains("held-out readings lie within"));
        assert_eq!(warned, !(coverage.low..=coverage.high).contains(&0.95), "{name}: {coverage:?}");
        let share = format!("{:.0}\u{a0}%", 100.0 * coverage.share);
        assert!(markdown.contains(&share) || markdown.contains(&share.replace('\u{a0}', " ")), "{name}: {share}");
    }
}
