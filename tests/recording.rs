//! Recordings, read back with Rerun's own decoder, hold what the reports said.

mod calibrations;
mod channels;
mod checks;
mod live;
pub(crate) mod reading;

use std::{fs, path::PathBuf};

use body_schema::{
    design::best_designs,
    experiment::{Comparison, Description, Experiment, StepReport, Trace},
    recording::{
        EllipsoidSize, LiveLog, Recorder, RecordingError, StepsCsv, Target, comparison_csv, learner_color,
        learner_slots,
    },
    scenario::{Scenario, builtin},
    wire::BestDesign,
};
use checks::check;
use reading::Reading;

/// The report of one more step.
fn next(experiment: &mut Experiment) -> StepReport {
    experiment.step().unwrap();
    StepReport::of(experiment)
}

fn run(scenario: &str, steps: usize) -> (Description, Vec<StepReport>) {
    let mut experiment = builtin(scenario).unwrap().experiment(3, None).unwrap();
    let mut reports = vec![StepReport::of(&experiment)];
    for _ in 0..steps {
        reports.push(next(&mut experiment));
    }
    (Description::of(&experiment), reports)
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn record(description: &Description, reports: &[StepReport], target: Target) {
    let mut recorder = Recorder::new(description, target).unwrap();
    reports.iter().for_each(|report| recorder.log(report).unwrap());
    recorder.finish().unwrap();
}

#[test]
fn a_recording_holds_what_the_reports_said() {
    let (description, mut reports) = run("arm-6dof", 5);
    // A miss, and a learner that stops.
    reports[3].learners[0].movement.as_mut().unwrap().measured_marker_m = None;
    reports[3].learners[0].metrics.nis = None;
    for report in &mut reports[4..] {
        report.learners[2].movement = None;
        report.learners[2].failure = Some("the estimate has diverged".to_owned());
        report.learners[2].metrics.prediction_m = None;
    }
    let (file, live) = (path("arm-6dof.rrd"), LiveLog::new());
    let mut recorder = Recorder::new(&description, Target::live(live.clone()).and_file(&file)).unwrap();
    for report in &reports {
        recorder.log(report).unwrap();
        recorder.flush().unwrap();
    }
    let so_far = Reading::of(&live.complete().unwrap());
    recorder.finish().unwrap();
    let bytes = fs::read(&file).unwrap();
    let whole = Reading::of(&live.parts_from(0).concat());
    assert_eq!(whole.timelines(), ["complete", "motion", "step"]);
    check(&whole, &description, &reports);
    for reading in [Reading::of(&bytes), so_far, Reading::of(&live.complete().unwrap())] {
        check(&reading, &description, &reports);
        assert_eq!(reading.recording_id, "arm-6dof-seed-3");
        assert_eq!(reading.timelines(), ["step"]);
        assert_eq!(reading.steps("/gradient/failure"), [4]);
        let note = reading.note();
        for word in ["arm-6dof", "seed 3", "active", "gradient", "1σ", "metres", "body-schema run arm-6dof --seed 3"] {
            assert!(note.contains(word), "the note says {word}: {note}");
        }
    }
}

#[test]
fn the_entities_are_the_documented_ones() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    let mut expected: Vec<String> =
        ["/", "/__properties", "/note", "/key", "/ground/light", "/ground/dark"].map(str::to_owned).into();
    for (learner, estimator, policy) in [("active", "rls", "active"), ("random", "rls", "r"), ("gradient", "g", "r")] {
        let mut entities = vec![
            "body",
            "name",
            "arm/truth",
            "arm/estimate",
            "marker/predicted",
            "marker/measured",
            "marker/error",
            "on_dark/name",
            "on_dark/error",
            "in_files/name",
            "in_files/error",
            "readings/residuals/marker",
            "readings/outliers/marker",
            "zero/links",
            "zero/axes",
            "zero/truth/links",
            "zero/truth/axes",
        ];
        if estimator == "rls" {
            entities.extend(["point_ellipsoids", "allowed_ellipsoids", "zero/directions"]);
        }
        if policy == "active" {
            entities.extend(["axes", "boxes", "centres", "chosen", "criterion", "leaves"].map(|name| match name {
                "axes" => "direct/axes",
                "boxes" => "direct/boxes",
                "centres" => "direct/centres",
                "chosen" => "direct/chosen",
                "criterion" => "direct/criterion",
                _ => "direct/leaves",
            }));
        }
        expected.push(format!("/{learner}"));
        expected.extend(entities.iter().map(|entity| format!("/{learner}/{entity}")));
        for metric in
            "orientation_deg axis_deg location_m prediction_m prediction_mean_m scatter_m expected_prediction_m trace bound_trace nis \
                       nis_dof nees nees_dof movements misses settled selection_ms criterion gain evaluations"
                .split_whitespace()
        {
            expected.push(format!("/{learner}/metrics/{metric}"));
        }
    }
    expected.sort();
    assert_eq!(reading.entities(), expected);
}

#[test]
fn a_real_robot_has_no_truth() {
    let (description, reports) = run("tiago-mocap", 3);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()).with_recording_id("a session of its own"));
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &description, &reports);
    assert_eq!(reading.recording_id, "a session of its own");
    let entities = reading.entities();
    assert!(!entities.iter().any(|entity| entity.contains("truth") || entity.contains("direct/")));
    // Eight joints, the marker among the ellipsoids.
    assert_eq!(reading.ellipsoids("/active/point_ellipsoids", 3).len(), 8);
}

#[test]
fn a_head_shows_what_it_sees_and_what_it_misses() {
    let (description, reports) = run("head-fov", 12);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &description, &reports);
    let misses = reports[12].learners[1].metrics.misses;
    assert!((1..12).contains(&misses), "random both sees and misses: {misses}");
    assert!(reading.note().contains("**Head**"));
}

#[test]
fn a_changed_body_is_drawn_anew() {
    let scenario = builtin("body-change").unwrap();
    let text = scenario.source.replace("\nstep = 300", "\nstep = 2");
    let scenario = Scenario::parse("sooner", &text, &|_| Err("none".into())).unwrap();
    let mut experiment = scenario.experiment(3, None).unwrap();
    let mut reports = vec![StepReport::of(&experiment)];
    (0..4).for_each(|_| reports.push(next(&mut experiment)));
    let changed: Vec<bool> = reports.iter().map(|report| report.truth.is_some()).collect();
    assert_eq!(changed, [false, false, false, true, false]);
    let live = LiveLog::new();
    record(&Description::of(&experiment), &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &Description::of(&experiment), &reports);
    assert_eq!(reading.steps("/active/zero/truth/links"), [0, 3]);
}

#[test]
fn learners_keep_their_colours() {
    let (description, reports) = run("arm-6dof", 1);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    let slots = learner_slots(description.learners.iter().map(|learner| learner.name.as_str()));
    for (learner, slot) in description.learners.iter().zip(slots) {
        let series = reading.colour(&format!("/{}/metrics/nees", learner.name), "SeriesLines:colors");
        assert_eq!(series, learner_color(slot));
        assert_eq!(
            reading.colour(&format!("/{}/arm/estimate", learner.name), "Capsules3D:colors"),
            learner_color(slot)
        );
    }
}

#[test]
fn the_arrangement_comes_with_the_recording() {
    let (description, reports) = run("arm-6dof", 1);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    assert!(reading.activated, "a blueprint is there and activated");
    let views = reading.views.iter().map(String::as_str).collect::<Vec<_>>();
    for view in ["Scene", "Orientation error (deg)", "Location error (m)", "DIRECT, active", "Note"] {
        assert!(views.contains(&view), "{view} in {views:?}");
    }
    let (description, reports) = run("tiago-mocap", 1);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let views = Reading::of(&live.complete().unwrap()).views;
    assert!(!views.iter().any(|view| view.contains("Orientation") || view.contains("DIRECT")), "{views:?}");
}

#[test]
fn ellipsoids_are_as_large_as_was_asked() {
    let (description, reports) = run("arm-6dof", 1);
    let half_sizes = |size: EllipsoidSize| {
        let live = LiveLog::new();
        record(&description, &reports, Target::live(live.clone()).with_ellipsoids(size));
        let reading = Reading::of(&live.complete().unwrap());
        assert!(reading.note().contains(size.label()), "the note says how large");
        let found = reading.ellipsoids("/active/point_ellipsoids", 1);
        found.into_iter().map(|(_, [a, b, _], _)| [a, b]).collect::<Vec<_>>().concat()
    };
    let one = half_sizes(EllipsoidSize::OneSigma);
    // A pivot's covariance has no part along its axis: two dimensions.
    for (size, factor) in [(EllipsoidSize::TwoSigma, 2.0), (EllipsoidSize::NinetyFivePercent, 2.447_746_8)] {
        for (large, small) in half_sizes(size).iter().zip(&one) {
            assert!((large / small - factor).abs() < 1e-4, "{size:?}: {large} / {small}");
        }
    }
}

#[test]
fn a_recorder_moves_between_threads() {
    fn sends<T: Send + 'static>() {}
    fn shares<T: Send + Sync + Clone + 'static>() {}
    sends::<Recorder>();
    shares::<LiveLog>();
}

#[test]
fn what_was_flushed_survives_a_kill() {
    let (description, reports) = run("arm-6dof", 2);
    let file = path("killed.rrd");
    let mut recorder = Recorder::new(&description, Target::default().and_file(&file)).unwrap();
    reports.iter().for_each(|report| recorder.log(report).unwrap());
    recorder.flush().unwrap();
    // As if the process ended here: no footer, no drop.
    std::mem::forget(recorder);
    check(&Reading::of(&fs::read(&file).unwrap()), &description, &reports);
}

#[test]
fn a_file_has_its_name_once_it_is_finished() {
    let (description, reports) = run("arm-6dof", 1);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.rrd");
    fs::write(&file, "before").unwrap();
    let begun = || {
        let mut recorder = Recorder::new(&description, Target::file(&file)).unwrap();
        recorder.log(&reports[0]).and_then(|()| recorder.flush()).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"before");
        recorder
    };
    begun().discard();
    assert_eq!(fs::read(&file).unwrap(), b"before");
    begun().finish().unwrap();
    check(&Reading::of(&fs::read(&file).unwrap()), &description, &reports[..1]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is beside it");
}

#[test]
fn a_long_recording_is_small() {
    let (description, reports) = run("arm-6dof", 200);
    assert_eq!(description.learners.len(), 3);
    let file = path("long.rrd");
    record(&description, &reports, Target::file(&file));
    let bytes = fs::metadata(&file).unwrap().len();
    assert!(bytes < 10_000_000, "{bytes} bytes in 200 steps of three learners");
}

#[test]
fn what_a_learner_no_longer_knows_does_not_stay_in_sight() {
    let (description, mut reports) = run("arm-6dof", 3);
    for joint in &mut reports[2].learners[0].estimate.joints {
        joint.point_covariance_m2 = None;
        joint.allowed_point_covariance_m2 = None;
    }
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &description, &reports);
    assert_eq!(reading.steps("/active/point_ellipsoids"), [0, 1, 2, 3]);
    assert!(reading.ellipsoids("/active/point_ellipsoids", 2).is_empty());
    assert_eq!(reading.ellipsoids("/active/point_ellipsoids", 3).len(), 6);
}

#[test]
fn errors_name_the_file() {
    let (description, reports) = run("tiago-mocap", 1);
    let missing = path("no/such/folder/a.rrd");
    let error = Recorder::new(&description, Target::file(&missing)).err().unwrap();
    assert!(matches!(error, RecordingError::Create { .. }));
    assert!(error.to_string().contains("no/such/folder/a.rrd"), "{error}");
    if cfg!(target_os = "linux") {
        // A disk that is always full. The live log is not affected.
        let live = LiveLog::new();
        let result = Recorder::new(&description, Target::live(live.clone()).and_file("/dev/full"))
            .and_then(|mut recorder| recorder.log(&reports[0]).and_then(|()| recorder.finish()));
        let error = result.unwrap_err();
        assert!(matches!(error, RecordingError::Write { .. }), "{error}");
        assert!(error.to_string().contains("/dev/full"), "{error}");
    }
}

#[test]
fn the_best_designs_stand_at_their_steps() {
    let (description, reports) = run("arm-6dof", 12);
    let designs = best_designs(&builtin("arm-6dof").unwrap().design_stretches(12));
    assert_eq!(designs.iter().map(|design| design.step).collect::<Vec<_>>(), [5, 10, 12]);
    let live = LiveLog::new();
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    reports.iter().for_each(|report| recorder.log(report).unwrap());
    let designs: Vec<_> = designs.into_iter().map(BestDesign::from).collect();
    recorder.log_best_designs(&designs).unwrap();
    recorder.finish().unwrap();
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &description, &reports);
    let series = "/limits/best_design_trace";
    assert_eq!(reading.steps(series), [i64::MIN, 5, 10, 12], "static, then where designs are");
    for design in &designs {
        let found = reading.numbers(series, "Scalars:scalars", Some(design.step));
        assert_eq!(found, Some(vec![design.best_design_trace]));
        for learner in &reports[design.step as usize].learners {
            let bound = learner.metrics.bound_trace.unwrap();
            assert!(bound >= design.best_design_trace * (1.0 - design.gap), "{}: {bound}", learner.name);
        }
    }
}

#[test]
fn steps_as_csv() {
    let (description, mut reports) = run("tiago-mocap", 2);
    reports[2].learners[1].movement.as_mut().unwrap().measured_marker_m = None;
    let mut bytes = Vec::new();
    let mut table = StepsCsv::new(&description, &mut bytes).unwrap();
    reports.iter().for_each(|report| table.write(report).unwrap());
    table.flush().unwrap();
    drop(table);
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap_or_else(|| panic!("{name} in {header:?}"));
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 9);
    let of = |step: usize, learner: usize, name: &str| rows[3 * step + learner].get(column(name)).unwrap();
    assert_eq!((of(0, 0, "step"), of(0, 0, "learner"), of(2, 2, "step")), ("0", "active", "2"));
    for name in ["orientation_deg", "location_m", "nees"] {
        assert_eq!(of(2, 0, name), "", "{name} is not known");
    }
    for name in ["selection_ms", "q_torso_lift_joint_m", "q_arm_1_joint_rad", "measured_x_m", "predicted_z_m"] {
        assert_eq!(of(0, 0, name), "", "no movement at step 0");
    }
    let movement = reports[1].learners[0].movement.as_ref().unwrap();
    assert_eq!(of(1, 0, "q_arm_7_joint_rad").parse(), Ok(movement.configuration[7]));
    assert_eq!(of(1, 0, "predicted_z_m").parse(), Ok(movement.predicted_marker_m[2]));
    assert_eq!(of(1, 0, "measured_y_m").parse(), Ok(movement.measured_marker_m.unwrap()[1]));
    assert_eq!(of(1, 0, "criterion").parse().ok(), movement.criterion);
    assert_eq!((of(2, 1, "measured_x_m"), of(1, 0, "movements"), of(1, 0, "settled")), ("", "1", "0"));
}

#[test]
fn comparisons_as_csv() {
    let scenario = builtin("arm-6dof").unwrap();
    let traces: Vec<Trace> =
        (1..=2).map(|seed| Trace::run(scenario.experiment(seed, None).unwrap(), 2, || ()).unwrap()).collect();
    let comparison = Comparison::of("arm-6dof", 2, &traces);
    let mut bytes = Vec::new();
    comparison_csv(&comparison, &mut bytes).unwrap();
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    assert_eq!(
        reader.headers().unwrap(),
        ["learner", "movements", "metric", "mean", "median", "q25", "q75"].as_slice()
    );
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    // The gradient keeps no covariance, and so no trace.
    assert_eq!(rows.len(), 3 * 3 * 6 + 2 * 3);
    let expected = comparison.learners[1].curve[2].location_m.unwrap();
    let row = rows.iter().find(|row| [&row[0], &row[1], &row[2]] == ["random", "2", "location_m"]).unwrap();
    assert_eq!(row[4].parse(), Ok(expected.median));
    assert_eq!(row[6].parse(), Ok(expected.q75));
}
