//! `paper`: its files, that it continues where it was interrupted, and what it says when it cannot.

use std::{
    path::Path,
    process::{Command, Output},
    sync::Mutex,
};

use serde_json::Value;

use body_schema::paper::{EXPERIMENTS, Ending, PaperExperiment, Plan, Progress, Report, markdown, run};

fn paper(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_body-schema")).arg("paper").args(arguments).output().expect("the program starts")
}

/// How each experiment ended, by name.
#[derive(Default)]
struct Endings(Mutex<Vec<(&'static str, Ending)>>);

impl Progress for Endings {
    fn start(&self, _: &PaperExperiment, _: u64) {}
    fn tick(&self) {}
    fn finish(&self, experiment: &PaperExperiment, how: Ending) {
        self.0.lock().expect("no panic").push((experiment.id, how));
    }
}

/// Runs a few experiments and says how the first of them ended.
fn quick(out: &Path, only: &[&str]) -> (Report, Ending) {
    let only: Vec<String> = only.iter().map(|id| (*id).to_owned()).collect();
    let wanted = only[0].clone();
    let endings = Endings::default();
    let report = run(&Plan { quick: true, only, out: out.to_owned() }, &endings).expect("runs");
    let endings = endings.0.into_inner().expect("no panic");
    assert_eq!(endings.len(), EXPERIMENTS.len());
    (report, endings.iter().find(|(id, _)| *id == wanted).expect("an experiment").1)
}

fn assert_is_a_figure(folder: &Path, id: &str) {
    let svg = std::fs::read_to_string(folder.join(format!("{id}.svg"))).expect("a drawing");
    let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).expect("valid SVG");
    assert!(tree.root().has_children(), "{id} is empty");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{id} has places that are no numbers");
    let png = std::fs::read(folder.join(format!("{id}.png"))).expect("a picture");
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().expect("a header");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut pixels).expect("pixels");
    let inked = pixels.chunks_exact(4).filter(|pixel| pixel[..3] != [0xFF; 3]).count();
    assert!(inked > 5_000, "{id}: {inked} pixels are not white");
}

#[test]
fn json_alone_goes_to_standard_output_and_everything_else_into_the_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("a plain path");
    let only = ["--only", "fig-3", "--only", "learning-rates"];
    let output = paper(&[&["--quick", "--out", out, "--json", "-"][..], &only].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "no progress bars when piped: {}", String::from_utf8_lossy(&output.stderr));
    let report: Report = serde_json::from_slice(&output.stdout).expect("JSON only");
    let written = std::fs::read_to_string(folder.path().join("paper.json")).expect("paper.json");
    assert_eq!(serde_json::from_str::<Report>(&written).expect("JSON"), report);
    let table = std::fs::read_to_string(folder.path().join("paper.md")).expect("paper.md");
    assert_eq!(table, markdown(&report));

    for row in &report.rows {
        let measured = ["fig-3", "learning-rates"].contains(&row.experiment.as_deref().unwrap_or("none"));
        assert_eq!(row.agrees.is_some(), measured, "{row:?}");
        assert_eq!(row.command.is_some() && row.seeds.is_some() && row.runs.is_some(), measured, "{row:?}");
        assert!(measured || (row.ours.is_none() && row.ours_text.starts_with("not measured: ")), "{row:?}");
        assert!(!row.why.is_empty() && table.contains(&row.what), "{row:?}");
    }
    let figures: Vec<&str> = report.figures.iter().map(|figure| figure.id.as_str()).collect();
    assert_eq!(figures, ["fig-3", "learning-rates"]);
    figures.iter().for_each(|id| assert_is_a_figure(folder.path(), id));
}

#[test]
fn what_is_kept_is_reused_until_it_no_longer_fits() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first, ending) = quick(folder.path(), &["learning-rates"]);
    assert_eq!(ending, Ending::Measured);
    let (second, ending) = quick(folder.path(), &["learning-rates"]);
    assert_eq!((ending, &second), (Ending::Reused, &first));
    // Kept outcomes show even where another experiment is asked for.
    let (third, _) = quick(folder.path(), &["fig-3"]);
    let row = |report: &Report| report.rows.iter().find(|row| row.id == "learning-rates").cloned().expect("a row");
    assert_eq!(row(&third), row(&first));

    let kept = folder.path().join("outcomes/learning-rates.json");
    let text = std::fs::read_to_string(&kept).expect("an outcome");
    for (what, spoilt) in [
        ("another scenario", text.replacen("sigma_m = 0.01", "sigma_m = 0.02", 1)),
        ("other seeds", text.replacen("\"seeds\":[1,4]", "\"seeds\":[1,5]", 1)),
        ("another program", text.replacen("\"build\":\"", "\"build\":\"0", 1)),
        ("an unknown program", text.replacen("\"build\":", "\"formerly\":", 1)),
        ("another version", text.replacen(env!("CARGO_PKG_VERSION"), "0.0.0", 1)),
        ("half a file", text[..text.len() / 2].to_owned()),
    ] {
        assert_ne!(spoilt, text, "{what}");
        std::fs::write(&kept, spoilt).expect("written");
        let (again, ending) = quick(folder.path(), &["learning-rates"]);
        assert_eq!((ending, row(&again)), (Ending::Measured, row(&first)), "{what}");
    }
}

#[test]
fn curves_of_all_learners_and_joints_are_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let (report, _) = quick(folder.path(), &["fig-4"]);
    ["fig-4", "fig-4-joints"].iter().for_each(|id| assert_is_a_figure(folder.path(), id));
    let row = report.rows.iter().find(|row| row.id == "fig-4-faster").expect("a row");
    let outcome = std::fs::read_to_string(folder.path().join("outcomes/fig-4.json")).expect("an outcome");
    let outcome: Value = serde_json::from_str(&outcome).expect("JSON");
    let learners = &outcome["outcome"]["trials"][0]["comparison"]["learners"];
    let median = |index: usize| learners[index]["summary"]["median_converged_at"].as_f64().expect("converges");
    assert_eq!(row.ours, Some(median(0) / median(1)), "{row:?}");
    // Over 20 seeds the ratio is below a half; 4 leave room for their spread.
    assert!(median(0) < 0.9 * median(1), "active {} beside random {}", median(0), median(1));
    let learners = "--learner active --learner random --learner gradient";
    let command = format!("body-schema compare arm-6dof {learners} --seeds 1..4 --steps 400");
    assert_eq!(row.command, Some(command));
}

#[test]
fn what_cannot_be_done_is_said() {
    let output = paper(&["--only", "fig-44"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("did you mean `fig-4`?") && message.contains("head-fov"), "{message}");
    let output = paper(&["--quick", "--only", "fig-3", "--out", "/dev/null/paper"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("/dev/null/paper") && message.contains("--out"), "{message}");
    assert_eq!(message.matches("os error").count(), 1, "the cause is told once: {message}");
}
