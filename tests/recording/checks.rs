//! What a recording must hold of the reports.

use body_schema::{
    experiment::{Description, LearnerReport, ModelReport, StepReport},
    selection::Partition,
};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::reading::Reading;

const TOLERANCE: f64 = 1e-6;

fn close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= TOLERANCE, "{what}: {found} instead of {expected}");
    }
}

/// Every value of the reports, entity by entity and step by step.
pub fn check(reading: &Reading, description: &Description, reports: &[StepReport]) {
    for report in reports {
        for learner in &report.learners {
            check_estimate(reading, report.step, learner);
            check_arms(reading, report.step, learner);
            check_metrics(reading, report.step, learner);
            check_movement(reading, report.step, learner, description);
        }
    }
    let changed = reports.iter().filter_map(|report| Some((Some(report.step), report.truth.as_ref()?)));
    let start = description.truth.as_ref().map(|truth| (description.change_at.map(|_| reports[0].step), truth));
    for (step, truth) in start.into_iter().chain(changed) {
        for learner in &description.learners {
            let zero = format!("/{}/zero/truth", learner.name);
            close(&reading.strip(&format!("{zero}/links"), step), &truth.skeleton_m().concat(), "true links");
            check_axes(reading, &format!("{zero}/axes"), step, truth);
        }
    }
    let frustum = format!("/{}/head/frustum", description.learners[0].name);
    assert_eq!(reading.entities().contains(&frustum), description.head.is_some());
    if let Some(head) = &description.head {
        let strips = reading.strips(&frustum, None);
        for corner in strips.iter().flatten() {
            let ray = Vector3::from(*corner) - Vector3::from(head.position_m);
            let angle = ray.angle(&Vector3::from(head.look));
            let reach = head.lens_half_angle_rad.max(head.pan_limit_rad.hypot(head.tilt_limit_rad));
            assert!(ray.norm() < 1e-6 || angle < reach + 1e-3, "{angle}");
        }
    }
}

/// At θ = 0.
fn check_estimate(reading: &Reading, step: u64, learner: &LearnerReport) {
    let (zero, model) = (format!("/{}/zero", learner.name), &learner.estimate);
    close(&reading.strip(&format!("{zero}/links"), Some(step)), &model.skeleton_m().concat(), "links");
    check_axes(reading, &format!("{zero}/axes"), Some(step), model);
    let (origins, vectors) = reading.arrows(&format!("{zero}/axes"), Some(step));
    let length = Vector3::from(vectors[0]).norm();
    let tip = |i: usize| std::array::from_fn(|k| origins[i][k] + vectors[i][k]);
    let directions: Vec<_> = (model.joints.iter().enumerate())
        .filter_map(|(i, joint)| Some((Some(tip(i)), joint.direction_covariance_rad2?)))
        .collect();
    check_ellipsoids(reading, &format!("{zero}/directions"), step, &directions, length);
}

/// In the configuration of the movement.
fn check_arms(reading: &Reading, step: u64, learner: &LearnerReport) {
    let (name, model) = (&learner.name, &learner.estimate);
    let movement = learner.movement.as_ref();
    let skeleton = movement.map(|movement| movement.estimated_skeleton_m.as_slice());
    if let Some(skeleton) = skeleton {
        check_capsules(reading, &format!("/{name}/arm/estimate"), step, skeleton, model);
    }
    if let Some(truth) = movement.and_then(|movement| movement.true_skeleton_m.as_ref()) {
        check_capsules(reading, &format!("/{name}/arm/truth"), step, truth, model);
    }
    // Prismatic joints have no point, and so no ellipsoid.
    let pivots = (model.joints.iter().filter(|joint| joint.point_m.is_some()).enumerate())
        .filter_map(|(pivot, joint)| Some((skeleton.map(|skeleton| skeleton[pivot]), joint.point_covariance_m2?)));
    let marker = model.marker_covariance_m2.map(|covariance| (skeleton.map(|it| it[it.len() - 1]), covariance));
    let points: Vec<_> = pivots.chain(marker).collect();
    check_ellipsoids(reading, &format!("/{name}/point_ellipsoids"), step, &points, 1.0);
}

/// Links from pivot to pivot and on to the marker, then the pins of the joints.
fn check_capsules(reading: &Reading, entity: &str, step: u64, skeleton: &[[f64; 3]], model: &ModelReport) {
    let capsules = reading.capsules(entity, step);
    assert_eq!(capsules.len(), 2 * model.joints.len(), "{entity}");
    // Where a joint has no point, nothing begins.
    let links = capsules.into_iter().zip(&model.joints).filter(|(_, joint)| joint.point_m.is_some());
    let (mut points, mut end): (Vec<_>, _) = (Vec::new(), None);
    for ((from, to), _) in links {
        points.push(from);
        end = Some(to);
    }
    points.extend(end);
    close(&points.concat(), &skeleton.concat(), entity);
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

/// Where an ellipsoid is, if that is known, and its covariance at θ = 0.
type Expected = (Option<[f64; 3]>, [[f64; 3]; 3]);

fn check_ellipsoids(reading: &Reading, entity: &str, step: u64, expected: &[Expected], scale: f64) {
    let found = reading.ellipsoids(entity, step);
    assert_eq!(found.len(), expected.len(), "{entity}");
    let covariances = reading.numbers(entity, "covariances", Some(step)).unwrap_or_default();
    assert_eq!(covariances.len(), 9 * expected.len());
    for (((centre, half_sizes, [x, y, z, w]), (expected_centre, reported)), shown) in
        found.into_iter().zip(expected).zip(covariances.chunks(9))
    {
        if let Some(expected_centre) = expected_centre {
            close(&centre, expected_centre, "centre of an ellipsoid");
        }
        // As shown it is turned with its link.
        let covariance = Matrix3::from_row_slice(shown);
        let reported = Matrix3::from_fn(|row, column| reported[row][column]);
        close(&[covariance.trace(), covariance.norm()], &[reported.trace(), reported.norm()], "covariance");
        let quaternion = Quaternion::new(w, x, y, z);
        assert!((quaternion.norm() - 1.0).abs() < TOLERANCE);
        let axes = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix().into_inner();
        // The variance along each axis is the one that is drawn, but for the axis without any, drawn as a thin disc.
        let largest = half_sizes.iter().copied().fold(0.0, f64::max);
        for (axis, half) in half_sizes.into_iter().enumerate() {
            let axis: Vector3<f64> = axes.column(axis).into();
            let standard_deviation = axis.dot(&(covariance * axis)).max(0.0).sqrt();
            let expected = scale * standard_deviation;
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
        ("bound_trace", metrics.bound_trace),
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
    assert_eq!(movement.true_skeleton_m.is_some(), description.truth.is_some());
    close(&reading.points(&entity("marker/predicted"), step).unwrap(), &movement.predicted_marker_m, "predicted");
    let measured = movement.measured_marker_m.map(Vec::from).unwrap_or_default();
    close(&reading.points(&entity("marker/measured"), step).unwrap(), &measured, "measured");
    let lines = reading.strips(&entity("marker/error"), Some(step)).concat();
    assert_eq!(lines.len(), if movement.measured_marker_m.is_some() { 2 } else { 0 });
    if let (Some(measured), [from, to]) = (movement.measured_marker_m, lines.as_slice()) {
        close(to, &measured, "to what was measured");
        // From what was predicted, or as far on the way there as the learner's cell reaches.
        let [way, drawn] =
            [movement.predicted_marker_m, *from].map(|from| Vector3::from(from) - Vector3::from(measured));
        let part = drawn.norm() / way.norm().max(TOLERANCE);
        assert!(
            drawn.norm() <= way.norm() + TOLERANCE && (drawn - part * way).norm() < TOLERANCE,
            "{from:?} is on the way"
        );
    }
    assert_eq!(movement.gaze.is_some(), description.head.is_some());
    if let (Some(gaze), Some(head)) = (&movement.gaze, &description.head) {
        let strips = reading.strips(&entity("head/gaze"), Some(step));
        assert_eq!(strips.len() % gaze.eyes_m.len(), 0);
        let rim = Vector3::from(strips[0][0]) - Vector3::from(gaze.eyes_m[0]);
        close(&[rim.angle(&Vector3::from(gaze.direction))], &[head.lens_half_angle_rad], "the cone");
        let missed = reading.points(&entity("marker/missed"), step).unwrap();
        let marker = *movement.true_skeleton_m.as_ref().unwrap().last().unwrap();
        close(&missed, if movement.measured_marker_m.is_none() { &marker } else { &[] }, "missed");
        // Seen, if and only if in the cone.
        let angle = (Vector3::from(marker) - Vector3::from(gaze.eyes_m[0])).angle(&Vector3::from(gaze.direction));
        assert_eq!(angle <= head.lens_half_angle_rad, movement.measured_marker_m.is_some());
    }
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
