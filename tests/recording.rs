//! Recordings, read back with Rerun's own decoder, hold what the reports said.

#![cfg(feature = "app")]

#[path = "recording/reading.rs"]
mod reading;

use std::{fs, path::PathBuf};

use body_schema::{
    experiment::{Comparison, Description, LearnerReport, ModelReport, StepReport, Trace},
    recording::{LiveLog, Recorder, RecordingError, SIGMAS, StepsCsv, Target, comparison_csv, learner_color},
    scenario::builtin,
    selection::Partition,
};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use reading::Reading;

const TOLERANCE: f64 = 1e-6;

fn run(scenario: &str, steps: usize) -> (Description, Vec<StepReport>) {
    let mut experiment = builtin(scenario).unwrap().experiment(3, None).unwrap();
    let mut reports = vec![experiment.latest().clone()];
    for _ in 0..steps {
        reports.push(experiment.step().unwrap().clone());
    }
    (experiment.description().clone(), reports)
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn record(description: &Description, reports: &[StepReport], target: Target) {
    let mut recorder = Recorder::new(description, target).unwrap();
    reports.iter().for_each(|report| recorder.log(report).unwrap());
    recorder.finish().unwrap();
}

fn close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= TOLERANCE, "{what}: {found} instead of {expected}");
    }
}

/// Every value of the reports, entity by entity and step by step.
fn check(reading: &Reading, description: &Description, reports: &[StepReport]) {
    for report in reports {
        for learner in &report.learners {
            check_estimate(reading, report.step, learner);
            check_metrics(reading, report.step, learner);
            check_movement(reading, report.step, learner, description);
        }
    }
    if let Some(truth) = &description.truth {
        close(&reading.strip("/world/truth/links", None), &truth.skeleton_m().concat(), "true links");
        check_axes(reading, "/world/truth/axes", None, truth);
    }
}

fn check_estimate(reading: &Reading, step: u64, learner: &LearnerReport) {
    let (name, model) = (&learner.name, &learner.estimate);
    close(&reading.strip(&format!("/{name}/links"), Some(step)), &model.skeleton_m().concat(), "links");
    check_axes(reading, &format!("/{name}/axes"), Some(step), model);
    let points = model.joints.iter().filter_map(|joint| Some((joint.point_m?, joint.point_covariance_m2?)));
    let marker = model.marker_covariance_m2.map(|covariance| (model.marker_m, covariance));
    let points: Vec<_> = points.chain(marker).collect();
    check_ellipsoids(reading, &format!("/{name}/point_ellipsoids"), step, &points, 1.0);

    let (origins, vectors) = reading.arrows(&format!("/{name}/axes"), Some(step));
    let length = Vector3::from(vectors[0]).norm();
    let tip = |i: usize| std::array::from_fn(|k| origins[i][k] + vectors[i][k]);
    let directions: Vec<_> = (model.joints.iter().enumerate())
        .filter_map(|(i, joint)| Some((tip(i), joint.direction_covariance_rad2?)))
        .collect();
    check_ellipsoids(reading, &format!("/{name}/direction_uncertainty"), step, &directions, length);
}

fn check_axes(reading: &Reading, entity: &str, step: Option<u64>, model: &ModelReport) {
    let (origins, vectors) = reading.arrows(entity, step);
    assert_eq!(vectors.len(), model.joints.len());
    for (index, joint) in model.joints.iter().enumerate() {
        let direction = Vector3::from(vectors[index]).normalize();
        close(direction.as_slice(), &joint.axis, "axis");
        let next = model.joints[index..].iter().find_map(|joint| joint.point_m);
        close(&origins[index], &next.unwrap_or(model.marker_m), "origin of an arrow");
    }
}

fn check_ellipsoids(reading: &Reading, entity: &str, step: u64, expected: &[([f64; 3], [[f64; 3]; 3])], scale: f64) {
    let found = reading.ellipsoids(entity, step);
    assert_eq!(found.len(), expected.len(), "{entity}");
    close(
        &reading.numbers(entity, "covariances", Some(step)).unwrap_or_default(),
        &expected.iter().flat_map(|(_, covariance)| covariance.concat()).collect::<Vec<_>>(),
        "covariances",
    );
    for ((centre, half_sizes, [x, y, z, w]), (expected_centre, covariance)) in found.into_iter().zip(expected) {
        close(&centre, expected_centre, "centre of an ellipsoid");
        let quaternion = Quaternion::new(w, x, y, z);
        assert!((quaternion.norm() - 1.0).abs() < TOLERANCE);
        let axes = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix().into_inner();
        // The variance along each axis is the one that is drawn, but for the axis without any, drawn as a thin disc.
        let covariance = Matrix3::from_fn(|row, column| covariance[row][column]);
        let largest = half_sizes.iter().copied().fold(0.0, f64::max);
        for (axis, half) in half_sizes.into_iter().enumerate() {
            let axis: Vector3<f64> = axes.column(axis).into();
            let standard_deviation = axis.dot(&(covariance * axis)).max(0.0).sqrt();
            let expected = SIGMAS * scale * standard_deviation;
            if expected > 1e-3 * largest {
                close(&[half], &[expected], "half-size");
            } else {
                assert!((half / largest - 0.02).abs() < 1e-3, "the flat axis is thin, and to be seen");
            }
        }
    }
}

fn check_metrics(reading: &Reading, step: u64, learner: &LearnerReport) {
    let metrics = &learner.metrics;
    let movement = learner.movement.as_ref();
    let expected = [
        ("orientation_deg", metrics.orientation_deg),
        ("axis_deg", metrics.axis_deg),
        ("location_m", metrics.location_m),
        ("prediction_m", metrics.prediction_m),
        ("prediction_mean_m", metrics.prediction_mean_m),
        ("expected_prediction_m", metrics.expected_prediction_m),
        ("trace", metrics.trace),
        ("nis", metrics.nis),
        ("nis_dof", metrics.nis_dof.map(|dof| dof as f64)),
        ("nees", metrics.nees),
        ("nees_dof", metrics.nees_dof.map(|dof| dof as f64)),
        ("movements", Some(metrics.movements as f64)),
        ("misses", Some(metrics.misses as f64)),
        ("settled", Some(if metrics.settled { 1.0 } else { 0.0 })),
        ("selection_ms", movement.map(|movement| movement.selection_ms)),
        ("criterion", movement.and_then(|movement| movement.criterion)),
        ("gain", movement.and_then(|movement| movement.gain)),
        ("evaluations", movement.map(|movement| movement.evaluations as f64)),
    ];
    for (name, expected) in expected {
        let found = reading.numbers(&format!("/{}/metrics/{name}", learner.name), "Scalars:scalars", Some(step));
        assert_eq!(found, expected.map(|value| vec![value]), "{name} of {} at step {step}", learner.name);
    }
}

fn check_movement(reading: &Reading, step: u64, learner: &LearnerReport, description: &Description) {
    let entity = |path: &str| format!("/{}/{path}", learner.name);
    let Some(movement) = &learner.movement else {
        for path in ["marker/predicted", "marker/measured"] {
            assert!(reading.points(&entity(path), step).is_none_or(|points| points.is_empty()));
        }
        return;
    };
    close(&reading.strip(&entity("movement/links"), Some(step)), &movement.estimated_skeleton_m.concat(), "movement");
    assert_eq!(movement.true_skeleton_m.is_some(), description.truth.is_some());
    if let Some(truth) = &movement.true_skeleton_m {
        close(&reading.strip(&entity("movement/truth"), Some(step)), &truth.concat(), "true movement");
    }
    close(&reading.points(&entity("marker/predicted"), step).unwrap(), &movement.predicted_marker_m, "predicted");
    let measured = movement.measured_marker_m.map(Vec::from).unwrap_or_default();
    close(&reading.points(&entity("marker/measured"), step).unwrap(), &measured, "measured");
    let leaves = reading.numbers(&entity("direct/leaves"), "centres", Some(step));
    assert_eq!(leaves.is_some(), movement.partition.is_some());
    if let Some(partition) = &movement.partition {
        check_partition(reading, &entity("direct"), step, partition);
    }
}

fn check_partition(reading: &Reading, direct: &str, step: u64, partition: &Partition) {
    let leaves = format!("{direct}/leaves");
    let dimension = partition.leaves[0].centre.len();
    let centres = reading.numbers(&leaves, "centres", Some(step)).unwrap();
    let values = reading.numbers(&leaves, "values", Some(step)).unwrap();
    let levels = reading.levels(&leaves, step);
    assert_eq!(reading.counts(&leaves, "dimension", step), [dimension as u32]);
    assert_eq!(reading.counts(&leaves, "chosen", step), [partition.chosen as u32]);
    assert_eq!(values.len(), partition.leaves.len());
    for (index, leaf) in partition.leaves.iter().enumerate() {
        let range = index * dimension..(index + 1) * dimension;
        assert_eq!(centres[range.clone()], leaf.centre);
        assert_eq!(levels[range], leaf.levels);
        assert_eq!(Some(values[index]).filter(|value| !value.is_nan()), leaf.value);
    }
    fills_the_cube(&centres, &levels, dimension);
    // The slice fills the unit square.
    let area: f64 = reading.half_sizes_2d(&format!("{direct}/boxes"), step).iter().map(|[x, y]| 4.0 * x * y).sum();
    close(&[area], &[1.0], "area of the slice");
    let cut = reading.half_sizes_2d(&format!("{direct}/boxes"), step).len();
    let other = reading.points_2d(&format!("{direct}/centres"), step).len();
    assert_eq!(cut + other, partition.leaves.len());
    assert_eq!(reading.points_2d(&format!("{direct}/chosen"), step).len(), 1);
}

/// The rectangles' volumes sum to 1 and no two overlap.
fn fills_the_cube(centres: &[f64], levels: &[u8], dimension: usize) {
    let half: Vec<f64> = levels.iter().map(|&level| 0.5 * 3_f64.powi(-i32::from(level))).collect();
    let volume: f64 = half.chunks(dimension).map(|half| half.iter().map(|half| 2.0 * half).product::<f64>()).sum();
    assert!((volume - 1.0).abs() < 1e-9, "volume {volume}");
    let leaves: Vec<_> = centres.chunks(dimension).zip(half.chunks(dimension)).collect();
    for (index, (a, half_a)) in leaves.iter().enumerate() {
        for (b, half_b) in &leaves[..index] {
            let apart = (0..dimension).any(|i| (a[i] - b[i]).abs() > half_a[i] + half_b[i] - 1e-12);
            assert!(apart, "leaves at {a:?} and {b:?} overlap");
        }
    }
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
    for reading in
        [Reading::of(&bytes), so_far, Reading::of(&live.complete().unwrap()), Reading::of(&live.parts_from(0).concat())]
    {
        check(&reading, &description, &reports);
        assert_eq!(reading.recording_id, "arm-6dof-seed-3");
        assert_eq!(reading.timelines(), ["step"]);
        assert_eq!(reading.steps("/gradient/failure"), [4]);
        let note = reading.note();
        for word in ["arm-6dof", "seed 3", "active", "gradient", "2σ", "metres", "body-schema run arm-6dof --seed 3"] {
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
        ["/", "/__properties", "/note", "/world/truth/axes", "/world/truth/links"].map(str::to_owned).into();
    for (learner, estimator, policy) in [("active", "rls", "active"), ("random", "rls", "r"), ("gradient", "g", "r")] {
        let mut entities =
            vec!["links", "axes", "movement/links", "movement/truth", "marker/predicted", "marker/measured"];
        if estimator == "rls" {
            entities.extend(["point_ellipsoids", "direction_uncertainty"]);
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
        expected.extend(entities.iter().map(|entity| format!("/{learner}/{entity}")));
        for metric in
            "orientation_deg axis_deg location_m prediction_m prediction_mean_m expected_prediction_m trace nis \
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
fn learners_keep_their_colours() {
    let (description, reports) = run("arm-6dof", 1);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    for (index, learner) in description.learners.iter().enumerate() {
        let series = reading.colour(&format!("/{}/metrics/nees", learner.name), "SeriesLines:colors");
        assert_eq!(series, learner_color(index));
        assert_eq!(reading.colour(&format!("/{}/links", learner.name), "LineStrips3D:colors"), learner_color(index));
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
    for view in ["active (rls × active)", "Orientation error (deg)", "Location error (m)", "DIRECT, active", "Note"] {
        assert!(views.contains(&view), "{view} in {views:?}");
    }
    let (description, reports) = run("tiago-mocap", 1);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let views = Reading::of(&live.complete().unwrap()).views;
    assert!(!views.iter().any(|view| view.contains("Orientation") || view.contains("DIRECT")), "{views:?}");
}

#[test]
fn a_live_log_is_followed_part_by_part() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    let woken = live.subscribe();
    assert_eq!((live.len(), live.header().len(), *woken.borrow()), (1, 12, 1));
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    recorder.log(&reports[0]).unwrap();
    recorder.flush().unwrap();
    assert!(woken.has_changed().unwrap());
    let seen = live.len();
    recorder.log(&reports[1]).unwrap();
    assert_eq!(live.len(), seen, "steps wait for the flush");
    recorder.flush().unwrap();
    let new = live.parts_from(seen);
    assert_eq!(new.len(), live.len() - seen);
    // Each part can be sent alone, behind the header.
    for part in &new {
        assert_eq!(reading::messages(&[live.header(), part.clone()].concat()).len(), 1);
    }
    assert!(live.parts_from(live.len()).is_empty() && live.parts_from(usize::MAX).is_empty());
    assert_eq!(live.bytes(), live.parts_from(0).concat().len());
    assert!(!live.is_closed());
    drop(recorder);
    assert!(live.is_closed());
    let length = live.len();
    live.append(&reading::messages(&live.parts_from(0).concat())).unwrap();
    assert_eq!(live.len(), length, "nothing is appended to a closed log");
}

#[test]
fn what_was_flushed_survives_a_kill() {
    let (description, reports) = run("arm-6dof", 2);
    let file = path("killed.rrd");
    let mut recorder = Recorder::new(&description, Target::file(&file)).unwrap();
    reports.iter().for_each(|report| recorder.log(report).unwrap());
    recorder.flush().unwrap();
    // As if the process ended here: no footer, no drop.
    std::mem::forget(recorder);
    check(&Reading::of(&fs::read(&file).unwrap()), &description, &reports);
}

#[test]
fn a_long_recording_is_small() {
    let steps = 40;
    let (description, reports) = run("arm-6dof", steps);
    let file = path("long.rrd");
    record(&description, &reports, Target::file(&file));
    let bytes = fs::metadata(&file).unwrap().len();
    // 200 steps stay well under 10 MB.
    assert!(bytes < 35_000 * steps as u64, "{bytes} bytes in {steps} steps");
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
    assert_eq!(rows.len(), 3 * 3 * 5);
    let expected = comparison.learners[1].curve[2].location_m.unwrap();
    let row = rows.iter().find(|row| [&row[0], &row[1], &row[2]] == ["random", "2", "location_m"]).unwrap();
    assert_eq!(row[4].parse(), Ok(expected.median));
    assert_eq!(row[6].parse(), Ok(expected.q75));
}
