//! What recordings hold of sensors: cameras and what they see, outliers, residuals, a base that is learned.

use std::fs;

use body_schema::{
    experiment::{Description, StepReport},
    recording::{LiveLog, Recorder, Target},
    scenario::{Scenario, builtin},
};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

use crate::recording::{checks::check, next, path, reading::Reading, record, run};

fn recorded(scenario: &str, steps: usize) -> (Reading, Vec<StepReport>, Vec<String>) {
    let (description, reports) = run(scenario, steps);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let reading = Reading::of(&live.complete().unwrap());
    check(&reading, &description, &reports);
    (reading, reports, description.learners.iter().map(|learner| learner.name.clone()).collect())
}

fn isometry((shift, [x, y, z, w]): ([f64; 3], [f64; 4])) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(shift), turn)
}

#[test]
fn a_fixed_camera_has_rays_to_what_it_saw_and_to_nothing_else() {
    let (reading, reports, learners) = recorded("arm-6dof-camera", 8);
    let mut misses = 0;
    for report in &reports[1..] {
        for (learner, name) in report.learners.iter().zip(&learners) {
            let sight = |path: &str| format!("/{name}/sight/{path}");
            let movement = learner.movement.as_ref().unwrap();
            let reading_of_tag = &movement.readings[0];
            let rays = reading.strips(&sight("rays"), Some(report.step));
            assert_eq!(rays.is_empty(), reading_of_tag.residual_sigmas.is_none());
            misses += usize::from(rays.is_empty());
            let corners = reading.points(&sight("truth/points"), report.step).unwrap();
            assert_eq!(corners.len(), 3 * 4);
            assert_eq!(reading.points(&sight("estimate/points"), report.step).unwrap().len(), 3 * 4);
            for (ray, corner) in rays.iter().zip(corners.chunks(3)) {
                // Where the scenario puts the camera.
                assert!((Point3::from(ray[0]) - Point3::new(0.75, -0.75, 0.75)).norm() < 1e-6);
                assert!((Point3::from(ray[1]) - Point3::from_slice(corner)).norm() < 1e-6);
            }
            // One camera and the outline of one tag; the camera is known, so that the estimate has a tag alone.
            assert_eq!(reading.strips(&sight("truth"), Some(report.step)).len(), 6 + 1);
            assert_eq!(reading.strips(&sight("estimate"), Some(report.step)).len(), 1);
            let residual = format!("/{name}/readings/residuals/tag\\ seen\\ by\\ eye");
            let found = reading.numbers(&residual, "Scalars:scalars", Some(report.step));
            assert_eq!(found, reading_of_tag.residual_sigmas.map(|value| vec![value]));
        }
    }
    assert!((1..16).contains(&misses), "some are seen, some are not: {misses}");
}

#[test]
fn a_camera_on_the_hand_moves_with_it() {
    let (description, reports) = run("hand-eye-6dof", 3);
    let live = LiveLog::new();
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    reports.iter().for_each(|report| recorder.log_moving(report, 3).unwrap());
    recorder.finish().unwrap();
    let reading = Reading::of(&live.parts_from(0).concat());
    let name = &description.learners[0].name;
    for report in &reports[1..] {
        let movement = report.learners[0].movement.as_ref().unwrap();
        // The lines from the eye follow the picture's outline.
        for (kind, skeleton) in
            [("truth", movement.true_skeleton_m.as_ref().unwrap()), ("estimate", &movement.estimated_skeleton_m)]
        {
            let strips = reading.strips(&format!("/{name}/sight/{kind}"), Some(report.step));
            let eye = Point3::from(strips[1][0]);
            assert!((eye - Point3::from(*skeleton.last().unwrap())).norm() < 1e-6, "{kind}: the camera is the hand");
        }
        let seen = movement.readings[0].residual_sigmas.is_some();
        let rays = reading.strips(&format!("/{name}/sight/rays"), Some(report.step));
        assert_eq!(rays.len(), if seen { 12 } else { 0 });
    }
    assert_eq!(reading.times(&format!("/{name}/sight/truth"), "motion").len(), 4 + 3 * 3, "also on the way");
}

#[test]
fn what_is_taken_for_an_outlier_is_crossed_out() {
    let (reading, reports, learners) = recorded("arm-6dof-outliers", 25);
    let robust = learners.iter().position(|name| name == "global").unwrap();
    let mut crossed = 0;
    for report in &reports[1..] {
        let movement = report.learners[robust].movement.as_ref().unwrap();
        let marker = &movement.readings[0];
        let probability = marker.outlier_probability.expect("a mixture tells one");
        let found = reading.numbers("/global/readings/outliers/marker", "Scalars:scalars", Some(report.step));
        assert_eq!(found, Some(vec![probability]));
        let cross = reading.strips("/global/marker/outlier", Some(report.step));
        assert_eq!(cross.len(), if probability > 0.5 { 3 } else { 0 });
        let label = reading.labels("/global/marker/error", "LineStrips3D:labels", report.step).concat();
        assert_eq!(label.starts_with("outlier, "), probability > 0.5, "{label}");
        for line in &cross {
            let middle = nalgebra::center(&Point3::from(line[0]), &Point3::from(line[1]));
            assert!((middle - Point3::from(movement.measured_marker_m.unwrap())).norm() < 1e-6);
            crossed += 1;
        }
    }
    assert!(crossed > 0, "one in ten is an outlier");
    assert!(!reading.entities().contains(&"/active/marker/outlier".to_owned()), "RLS weighs no readings");
    assert!(reading.views.iter().any(|view| view == "Probability of an outlier"), "{:?}", reading.views);
}

#[test]
fn a_robot_whose_base_is_learned_stays_in_its_place() {
    let (reading, reports, learners) = recorded("tiago-mocap", 5);
    let mut moved: f64 = 0.0;
    for (name, index) in learners.iter().zip(0..) {
        let stands = |step: u64| {
            let [row, body] =
                [format!("/{name}"), format!("/{name}/body")].map(|entity| isometry(reading.pose(&entity, step)));
            (row * body, body)
        };
        let (first, _) = stands(0);
        for report in &reports {
            let (here, body) = stands(report.step);
            assert!((here.to_homogeneous() - first.to_homogeneous()).amax() < 1e-5, "{here} instead of {first}");
            // In the frame of the measurements it is where the learner takes the base to be.
            let base = |report: &StepReport| report.learners[index as usize].estimate.base_frame().unwrap();
            let expected = base(report) * base(&reports[0]).inverse();
            assert!((body.inverse() * expected).translation.vector.norm() < 1e-5);
            moved = moved.max(expected.translation.vector.norm());
        }
    }
    assert!(moved > 0.05, "the bases were found: {moved}");
}

/// Gear ratios turn joints farther than they read.
#[test]
fn arms_with_gears_stand_as_reported() {
    recorded("arm-6dof-pose-gears", 4);
}

/// Rows of poses, of positions and of what was held in sockets, of robots that a URDF describes.
#[test]
fn robots_of_descriptions_stand_as_reported() {
    for name in ["panda-sockets", "ur10-camera", "positioner", "tiago-mocap-3"] {
        recorded(name, 4);
    }
}

/// Where no truth is known sockets stand where the learner takes them to be; those that are held out nowhere.
#[test]
fn believed_sockets_move_with_the_belief() {
    let (reading, reports, names) = recorded("panda-sockets", 6);
    let sockets = format!("/{}/sockets", names[0]);
    assert_eq!(reading.steps(&sockets).len(), 7);
    for report in &reports {
        let drawn = reading.points(&sockets, report.step).unwrap();
        let believed = report.learners[0].estimate.sockets_m.concat();
        assert_eq!((drawn.len(), believed.len()), (6, 6));
        assert!(drawn.iter().zip(&believed).all(|(a, b)| (a - b).abs() < 1e-5), "step {}", report.step);
    }
}

#[test]
fn a_long_recording_with_a_camera_is_small() {
    let text = builtin("arm-6dof-camera").unwrap().source;
    let third = "\n[[learner]]\nname = \"third\"\nestimator = \"smoother\"\npolicy = \"random\"\n";
    let scenario = Scenario::parse("three", &format!("{text}{third}"), &|_| Err("none".into())).unwrap();
    let mut experiment = scenario.experiment(3, None).unwrap();
    let mut reports = vec![StepReport::of(&experiment)];
    (0..200).for_each(|_| reports.push(next(&mut experiment)));
    assert_eq!(experiment.learners().len(), 3);
    let file = path("camera.rrd");
    record(&Description::of(&experiment), &reports, Target::file(&file));
    let bytes = fs::metadata(&file).unwrap().len();
    assert!(bytes < 10_000_000, "{bytes} bytes in 200 steps of three learners");
}
