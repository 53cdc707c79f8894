//! Drawings of a robot that branches, and of what the camera on its neck sees.

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, UnitVector3, Vector3};

use super::laws::{Recorded, is_near};
use body_schema_engine::{
    kinematics::{Joint, Line},
    model::{Device, Frame, Place, State, Target},
};
use body_schema_scenario::builtin;
use body_schema_wire::{
    Body, CameraDescription, Description, JointDescription, JointKind, ModelReport, Picture, StepReport,
    TargetDescription,
};

/// Torso; then a neck with a camera and an arm with a cube by turns, so that neighbours in the list are none on the robot.
const NAMES: [&str; 6] = ["torso_yaw", "neck_yaw", "shoulder_pitch", "neck_pitch", "elbow_pitch", "wrist_roll"];
const PARENTS: [Option<usize>; 6] = [None, Some(0), Some(0), Some(1), Some(2), Some(4)];
const STEPS: u64 = 5;

fn figure() -> State {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let axes = [
        ([0.0, 0.0, 0.9], z),
        ([0.0, 0.0, 1.45], z),
        ([0.0, -0.2, 1.4], y),
        ([0.0, 0.0, 1.55], y),
        ([0.3, -0.2, 1.4], y),
        ([0.5, -0.2, 1.4], x),
    ];
    let turning = |(point, axis): ([f64; 3], Vector3<f64>)| {
        Joint::Revolute(Line { point: point.into(), direction: UnitVector3::new_normalize(axis) })
    };
    let marker = Point3::new(0.6, -0.2, 1.4);
    let mut state = State::branching(axes.map(turning).to_vec(), PARENTS.to_vec(), (6, marker)).expect("a tree");
    state.targets[0] = Target { link: 6, place: Place::Pose(Isometry3::translation(marker.x, marker.y, marker.z)) };
    // It looks along x.
    let ahead = UnitQuaternion::from_euler_angles(-std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2);
    let pose = Isometry3::from_parts([0.08, 0.0, 1.6].into(), ahead);
    state.devices.push(Device {
        link: Some(4),
        pose,
        intrinsics: Some([500.0, 500.0, 320.0, 240.0]),
        distortion: None,
    });
    state
}

/// What a figure is recorded of, with a truth and an estimate that is a little off.
fn told(body: Option<Body>) -> (Description, Vec<StepReport>, State, State) {
    let scenario = builtin("arm-6dof").expect("a scenario");
    let mut experiment = scenario.experiment(1371, Some(&["active".to_owned()])).expect("an experiment");
    let mut description = Description::of(&experiment);
    let truth = figure();
    let mut estimate = truth.carried(&Isometry3::translation(0.0, 0.02, 0.0), |link| link == 2);
    estimate.devices[0].pose.translation.vector.z += 0.01;
    description.joints = (NAMES.iter())
        .map(|name| JointDescription {
            name: (*name).to_owned(),
            kind: JointKind::Revolute,
            learned: true,
            limits: [-1.0, 1.0],
        })
        .collect();
    description.truth = Some(ModelReport::of_state(&truth));
    description.cameras = vec![CameraDescription { name: "eye".to_owned(), size_px: [640.0, 480.0] }];
    let cube = [[0.02, 0.0, 0.0], [-0.02, 0.0, 0.0], [0.0, 0.02, 0.0]];
    description.targets = vec![TargetDescription { name: "cube".to_owned(), points_m: cube.to_vec() }];
    description.body = body;
    let mut reports = vec![StepReport::of(&experiment)];
    for _ in 0..STEPS {
        experiment.step().expect("a step");
        reports.push(StepReport::of(&experiment));
    }
    for report in &mut reports {
        let learner = &mut report.learners[0];
        let mut model = ModelReport::of_state(&estimate);
        for (joint, size) in model.joints.iter_mut().zip([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) {
            let variance = 1e-4 * size;
            joint.point_covariance_m2 = Some([[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, variance]]);
        }
        model.marker_covariance_m2 = Some([[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-4]]);
        learner.estimate = model;
        if let Some(movement) = &mut learner.movement {
            let of = |joint: usize| 0.9 * (report.step as f64 * 1.3 + joint as f64).sin();
            movement.configuration = (0..NAMES.len()).map(of).collect();
            // The third of them is a miss.
            let seen = |x: f64| (report.step != 3).then(|| vec![[x, 1.0], [x, 2.0], [f64::NAN, 3.0]]);
            movement.pictures = vec![Picture {
                camera: 0,
                target: 0,
                measured_px: seen(10.0 * report.step as f64),
                predicted_px: Some(vec![[5.0, 6.0], [7.0, 8.0], [9.0, 10.0]]),
                true_px: Some(vec![[-30.0, 700.0]]),
            }];
        }
    }
    (description, reports, truth, estimate)
}

fn recorded(body: Option<Body>) -> (Recorded, State, State) {
    let (description, reports, truth, estimate) = told(body);
    (Recorded::of_reports(&description, reports, |target| target), truth, estimate)
}

/// Where the capsules of an entity begin and end, step by step. Their lengths are said once: they are rigid.
fn capsules(recorded: &Recorded, entity: &str) -> Vec<(i64, Vec<[Vector3<f64>; 2]>)> {
    let turns = recorded.quads(entity, "Capsules3D:quaternions");
    let lengths = &recorded.singles(entity, "Capsules3D:lengths")[0].1;
    let mut all = Vec::new();
    for ((step, begins), (_, turns)) in recorded.triples(entity, "Capsules3D:translations").iter().zip(&turns) {
        let ends = begins.iter().zip(turns).zip(lengths).map(|((begin, turn), length)| {
            let ([x, y, z, w], begin) = (turn.map(f64::from), Vector3::from(begin.map(f64::from)));
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            [begin, begin + turn * Vector3::z() * f64::from(*length)]
        });
        all.push((*step, ends.collect()));
    }
    all
}

fn assert_near(found: Vector3<f64>, expected: Point3<f64>, what: &str) {
    assert!((found - expected.coords).norm() < 1e-5, "{what}: {found} instead of {expected}");
}

/// Every joint's capsule leads to the next on its own branch, the neck's ends at the camera, and a fork leads to where a branch begins.
#[test]
fn every_branch_is_drawn_where_it_is() {
    let (recorded, truth, estimate) = recorded(None);
    for (path, state) in [("/active/arm/truth", &truth), ("/active/arm/estimate", &estimate)] {
        let drawn = capsules(&recorded, path);
        assert_eq!(drawn.len() as u64, STEPS + 1);
        for ((step, drawn), report) in drawn.iter().zip(&recorded.reports).skip(1) {
            let readings = &report.learners[0].movement.as_ref().expect("a movement").configuration;
            let links = state.links(readings);
            let pivot = |joint: usize| {
                let carrier = PARENTS[joint].map_or(0, |parent| parent + 1);
                links[carrier] * state.joints[joint].line().expect("it turns").point
            };
            let camera = Point3::from(state.frame_at(Frame::Device(0), readings).translation.vector);
            let ends = [pivot(2), pivot(3), pivot(4), camera, pivot(5), state.marker_at(readings)];
            // Links, pins, and the fork at the torso, from which the neck leaves.
            assert_eq!(drawn.len(), 6 + 6 + 1, "{path}, {step}");
            for (joint, end) in ends.into_iter().enumerate() {
                assert_near(drawn[joint][0], pivot(joint), NAMES[joint]);
                assert_near(drawn[joint][1], end, NAMES[joint]);
            }
            assert_near(drawn[12][0], pivot(0), "the fork");
            assert_near(drawn[12][1], pivot(1), "the fork");
        }
    }
    let zero = recorded.triples_of_lists("/active/zero/links", "LineStrips3D:strips");
    assert_eq!(zero[0].iter().map(Vec::len).collect::<Vec<_>>(), [5, 4], "an arm and a neck that begins at the torso");
    assert_eq!(recorded.triples_of_lists("/active/zero/truth/links", "LineStrips3D:strips")[0].len(), 2);
}

/// Ellipsoids go with the links that carry their axes, and not with the joint before them in the list.
#[test]
fn uncertainty_goes_with_its_own_branch() {
    let (recorded, _, estimate) = recorded(None);
    let centres = recorded.triples("/active/point_ellipsoids", "Ellipsoids3D:centers");
    for ((step, centres), report) in centres.iter().zip(&recorded.reports).skip(1) {
        let readings = &report.learners[0].movement.as_ref().expect("a movement").configuration;
        let links = estimate.links(readings);
        assert_eq!(centres.len(), NAMES.len() + 1);
        for (joint, centre) in centres.iter().take(NAMES.len()).enumerate() {
            let carrier = PARENTS[joint].map_or(0, |parent| parent + 1);
            let expected = links[carrier] * estimate.joints[joint].line().expect("it turns").point;
            assert!(is_near(*centre, expected.coords), "{} at {step}", NAMES[joint]);
        }
        assert!(is_near(centres[NAMES.len()], estimate.marker_at(readings).coords), "the marker at {step}");
    }
}

/// The camera's pyramid stands on the neck, and the cube's points on the hand.
#[test]
fn cameras_and_targets_are_where_their_links_are() {
    let (recorded, truth, _) = recorded(None);
    let strips = recorded.triples_of_lists("/active/sight/truth", "LineStrips3D:strips");
    let points = recorded.triples("/active/sight/truth/points", "Points3D:positions");
    for ((strips, (_, points)), report) in strips.iter().zip(&points).zip(&recorded.reports).skip(1) {
        let readings = &report.learners[0].movement.as_ref().expect("a movement").configuration;
        let camera = truth.frame_at(Frame::Device(0), readings);
        let [rim, ray, ..] = strips.as_slice() else { panic!("a rim and rays: {strips:?}") };
        assert!(is_near(ray[0], camera.translation.vector), "the eye");
        // The middle of the rim is straight ahead.
        let middle = rim[..4].iter().map(|corner| Vector3::from(corner.map(f64::from))).sum::<Vector3<f64>>() / 4.0;
        let ahead = (middle - camera.translation.vector).normalize();
        assert!((ahead - camera * Vector3::z()).norm() < 1e-4, "{ahead}");
        let cube = truth.frame_at(Frame::Target(0), readings);
        assert!(is_near(points[0], (cube * Point3::new(0.02, 0.0, 0.0)).coords), "a corner of the cube");
    }
}

/// A figure's trunk turns with the torso and its head with the neck; the arm that the tree lacks hangs.
#[test]
fn a_figure_has_the_head_of_its_neck() {
    let (recorded, truth, _) = recorded(Some(Body::Humanoid));
    let [x, y, z] = recorded.triples("/active/body/head", "Capsules3D:translations")[0].1[0];
    let camera = truth.devices[0].pose.translation.vector;
    assert!(
        f64::from(x) < camera.x && f64::from(y).abs() < 1e-6 && (f64::from(z) - camera.z).abs() < 0.1,
        "behind its eye"
    );
    // Torso, shoulders, neck, and an arm of two.
    assert_eq!(recorded.triples("/active/body/trunk", "Capsules3D:translations")[0].1.len(), 5);
    for (path, link) in [("body/trunk", 1), ("body/head", 4)] {
        let poses = recorded.triples(&format!("/active/{path}"), "Transform3D:translation");
        for ((_, pose), report) in poses.iter().zip(&recorded.reports).skip(1) {
            let readings = &report.learners[0].movement.as_ref().expect("a movement").configuration;
            assert!(is_near(pose[0], truth.links(readings)[link].translation.vector), "{path}");
        }
    }
    let (plain, ..) = self::recorded(None);
    assert!(plain.has("/active/body/base") && !plain.has("/active/body/head"), "a pedestal has no head");
}

/// Limbs that stand on the base beside the arm are joined with it.
#[test]
fn limbs_on_the_base_are_not_left_in_the_air() {
    let (mut description, mut reports, truth, _) = told(None);
    // Without the torso the neck and the arm stand on the base.
    let fixed = |state: &State| {
        let parents = [None, None, None, Some(1), Some(2), Some(4)].to_vec();
        let mut fixed = State::branching(state.joints.clone(), parents, (6, state.marker())).expect("a tree");
        (fixed.targets, fixed.devices) = (state.targets.clone(), state.devices.clone());
        ModelReport::of_state(&fixed)
    };
    description.truth = Some(fixed(&truth));
    reports.iter_mut().for_each(|report| report.learners[0].estimate = fixed(&truth));
    let recorded = Recorded::of_reports(&description, reports, |target| target);
    let body = capsules(&recorded, "/active/body");
    let joined = |point: [f64; 3]| {
        body[0].1.iter().any(|ends| ends.iter().any(|end| (end - Vector3::from(point)).norm() < 1e-5))
    };
    assert!(joined([0.0, 0.0, 1.45]), "the neck: {body:?}");
    assert!(joined([0.0, 0.0, 0.9]), "the joint that carries nothing: {body:?}");
}

/// What the eye sees is recorded in pixels, and the blueprint has a view of it beside the scene.
#[test]
fn what_the_eye_sees_stands_beside_the_scene() {
    let (recorded, ..) = recorded(None);
    let of = |path: &str| recorded.pairs(&format!("/active/eye/eye/{path}"), "Points2D:positions");
    let measured = of("measured");
    assert_eq!(measured.len() as u64, STEPS + 1);
    for (step, points) in &measured {
        let x = 10.0 * *step as f32;
        // Nothing before the first movement and after a miss; a point that was not seen is none.
        let expected = if [0, 3].contains(step) { vec![] } else { vec![[x, 1.0], [x, 2.0]] };
        assert_eq!(points, &expected, "step {step}");
    }
    assert_eq!(of("predicted")[3].1, [[5.0, 6.0], [7.0, 8.0], [9.0, 10.0]]);
    assert_eq!(of("truth")[1].1, [[-30.0, 700.0]]);
    let frames = recorded.pairs_of_lists("/active/eye/eye/frame", "LineStrips2D:strips");
    assert_eq!(frames[0][0], [[0.0, 0.0], [640.0, 0.0], [640.0, 480.0], [0.0, 480.0], [0.0, 0.0]]);
    assert_eq!(recorded.pairs_of_lists("/active/eye/eye/error", "LineStrips2D:strips")[1].len(), 2);
    assert!(recorded.views.contains(&"eye, active".to_owned()), "{:?}", recorded.views);
    let scene = builtin("arm-6dof-camera").expect("a scenario");
    let beside = Recorded::of(&scene, 1, None, |target| target);
    assert!(!beside.has("/active/eye/eye/frame") && !beside.views.iter().any(|view| view.contains("eye")));
}

/// In a run, what is predicted is where the estimate before the movement has the board, by a pinhole's own formula; what is measured is
/// near to the truth.
#[test]
fn predictions_are_of_the_estimate_before_the_movement() {
    let scenario = builtin("hand-eye-6dof").expect("a scenario");
    let recorded = Recorded::of(&scenario, 8, Some(&["global".to_owned()]), |target| target);
    let description = Description::of(&scenario.experiment(3, None).expect("an experiment"));
    let points = &description.targets[0].points_m;
    let predicted = recorded.pairs("/global/eye/eye/predicted", "Points2D:positions");
    let [truth, measured] =
        ["truth", "measured"].map(|path| recorded.pairs(&format!("/global/eye/eye/{path}"), "Points2D:positions"));
    let (mut seen, mut foreseen) = (0, 0);
    for (step, reports) in recorded.reports.windows(2).enumerate() {
        let (before, movement) = (&reports[0].learners[0].estimate, reports[1].learners[0].movement.as_ref());
        let (state, movement) = (before.state().expect("finite"), movement.expect("a movement"));
        let camera = state.frame_at(Frame::Device(0), &movement.configuration);
        let board = state.frame_at(Frame::Target(1), &movement.configuration);
        let [fx, fy, cx, cy] = state.devices[0].intrinsics.expect("a camera");
        let at = |point: &[f64; 3]| camera.inverse() * board * Point3::from(*point);
        // Who does not know where the board is may take it to be behind the camera.
        let is_ahead = points.iter().all(|point| at(point).z > 0.0);
        let picture = &predicted[step + 1].1;
        assert_eq!(picture.len(), if is_ahead { points.len() } else { 0 }, "step {step}");
        foreseen += picture.len();
        for (at, found) in points.iter().map(at).zip(picture) {
            let expected = [fx * at.x / at.z + cx, fy * at.y / at.z + cy];
            let apart = (0..2).map(|k| (f64::from(found[k]) - expected[k]).abs()).fold(0.0, f64::max);
            assert!(
                apart < 1e-6 * expected[0].abs().max(expected[1].abs()).max(1e3),
                "step {step}: {found:?}, {expected:?}"
            );
        }
        // One pixel of noise.
        for (found, noiseless) in measured[step + 1].1.iter().zip(&truth[step + 1].1) {
            seen += 1;
            assert!((0..2).all(|k| (found[k] - noiseless[k]).abs() < 6.0), "{found:?} beside {noiseless:?}");
        }
    }
    assert!(seen > 0 && foreseen > 0, "the board was seen, {seen} points, and foreseen, {foreseen} points");
    let written = serde_json::to_string(&recorded.reports[1]).expect("JSON");
    assert!(!written.contains("_px\":[[") && !written.contains("bones"), "JSON has no more than it had: {written}");
}
