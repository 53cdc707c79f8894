//! Random robots and tables that are wrong in one way: the fault is named where the data can tell it, and nothing is where there is none.

use body_schema_diagnostics::{Base, Diagnostic, DiagnosticKind, Evidence, Seen, Subject, examine};
use body_schema_engine::{
    kinematics::{Joint, Line},
    model::best_motion,
};
use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Whether more is tried than by day.
fn is_night() -> bool {
    std::env::var_os("BODY_SCHEMA_SEEDS").is_some()
}

const SIGMA: f64 = 5e-4;
/// Metres that count as much as a radian, with 0.1 deg of noise.
const ARM: f64 = SIGMA / 0.001_745;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    Sign,
    Zero,
    Degrees,
    Millimetres,
    Size,
    Swapped,
    Mirrored,
    Inverted,
    RealFirst,
    RealLast,
    RollPitchYaw,
    Lag,
    Base,
}

fn normal(rng: &mut ChaCha8Rng, sd: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sd * rng.sample::<f64, _>(StandardNormal))
}

fn turn(rng: &mut ChaCha8Rng, least: f64) -> UnitQuaternion<f64> {
    let axis = UnitVector3::new_normalize(normal(rng, 1.0));
    UnitQuaternion::from_axis_angle(&axis, rng.random_range(least..3.1))
}

/// Axes anywhere, along coordinates, parallel with a slide between (SCARA), an upright one before parallel ones, and wrists.
fn robot(rng: &mut ChaCha8Rng) -> (Vec<Joint>, Point3<f64>) {
    let (count, kind) = (rng.random_range(1..=8), rng.random_range(0..5));
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let mut point = Point3::new(0.0, 0.0, 0.2);
    let mut joints = Vec::new();
    for joint in 0..count {
        let direction = match kind {
            0 => UnitVector3::new_normalize(normal(rng, 1.0)),
            1 => axes[rng.random_range(0..3)],
            2 => axes[2],
            3 => axes[if joint == 0 { 2 } else { 1 }],
            _ => axes[joint % 3],
        };
        let is_wrist = kind == 4 && joint + 2 >= count && count > 2;
        if !is_wrist {
            point += Vector3::from_fn(|_, _| rng.random_range(-0.35..0.35));
        }
        let slides = (kind == 2 && joint == 2) || (kind == 1 && rng.random_bool(0.15));
        joints.push(if slides { Joint::Prismatic(direction) } else { Joint::Revolute(Line { point, direction }) });
    }
    let target = if rng.random_bool(0.25) {
        point + joints[count - 1].direction().into_inner() * 0.1
    } else {
        point + Vector3::from_fn(|_, _| rng.random_range(-0.15..0.15))
    };
    (joints, target)
}

/// The robot as it is, off by what calibration is for.
fn off(described: &[Joint], rng: &mut ChaCha8Rng) -> Vec<Joint> {
    let mut carried = Isometry3::identity();
    let mut of = |joint: &Joint| {
        let centre = joint.line().map_or(Point3::origin(), |line| line.point);
        let turned = Isometry3::rotation_wrt_point(UnitQuaternion::from_scaled_axis(normal(rng, 0.007)), centre);
        carried *= Translation3::from(normal(rng, 0.003)) * turned;
        joint.transformed(&carried)
    };
    described.iter().map(&mut of).collect()
}

fn motions(joints: &[Joint], rows: &[Vec<f64>]) -> Vec<Isometry3<f64>> {
    let of = |row: &Vec<f64>| joints.iter().zip(row).fold(Isometry3::identity(), |at, (joint, q)| at * joint.exp(*q));
    rows.iter().map(of).collect()
}

/// What the description leaves of positions at best, base and target free: in turn the motion that fits best and the target that
/// does, from many starts.
fn left(joints: &[Joint], rows: &[Vec<f64>], seen: &[Point3<f64>], target: Point3<f64>, rng: &mut ChaCha8Rng) -> f64 {
    let motions = motions(joints, rows);
    let mut best = f64::INFINITY;
    for start in 0..12 {
        let mut at = target + if start == 0 { Vector3::zeros() } else { normal(rng, 0.1) };
        for _ in 0..60 {
            let base = best_motion(&motions.iter().map(|motion| motion * at).collect::<Vec<_>>(), seen);
            let (mut information, mut vector) = (Matrix3::identity() * 1e-9, Vector3::zeros());
            for (motion, seen) in motions.iter().zip(seen) {
                let whole = base * motion;
                let turned = whole.rotation.to_rotation_matrix();
                information += Matrix3::identity();
                vector += turned.transpose() * (seen - whole.translation.vector).coords;
            }
            at = Point3::from(information.try_inverse().expect("regular") * vector);
            let squares: f64 =
                motions.iter().zip(seen).map(|(motion, seen)| (base * motion * at - seen).norm_squared()).sum();
            best = best.min((squares / seen.len() as f64).sqrt());
        }
    }
    best
}

struct Case {
    joints: Vec<Joint>,
    /// The description's guess of the target.
    target: Point3<f64>,
    rows: Vec<Vec<f64>>,
    poses: Vec<Isometry3<f64>>,
    turns: Vec<Vector3<f64>>,
    base: Option<Base>,
    /// What is to be said first, where anything is.
    wanted: Option<(DiagnosticKind, Option<String>)>,
    /// Whether the data can tell.
    is_told: bool,
    /// What the right reading leaves, metres.
    right: f64,
}

fn case(fault: Fault, noise: f64, seed: u64) -> Option<Case> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (joints, target) = robot(&mut rng);
    let is_off = fault != Fault::None && rng.random_bool(0.5);
    let truth = if is_off { off(&joints, &mut rng) } else { joints.clone() };
    let of_poses = matches!(fault, Fault::Inverted | Fault::RealFirst | Fault::RealLast | Fault::RollPitchYaw);
    let is_pose = of_poses || (fault == Fault::None && rng.random_bool(0.5));
    let base = Isometry3::from_parts(Translation3::from(normal(&mut rng, 0.6)), turn(&mut rng, 0.0));
    let body = turn(&mut rng, 0.0);
    let draw = |joint: &Joint, rng: &mut ChaCha8Rng| {
        let most = if joint.line().is_some() { 1.5 } else { 0.3 };
        rng.random_range(-most..most)
    };
    let count = rng.random_range(20..60);
    let mut rows: Vec<Vec<f64>> =
        (0..count).map(|_| truth.iter().map(|joint| draw(joint, &mut rng)).collect()).collect();
    let seen = |motion: Isometry3<f64>| {
        let (shift, turned) = (normal(&mut rng, noise), normal(&mut rng, noise / ARM));
        let rotation = UnitQuaternion::from_scaled_axis(turned) * (base * motion).rotation * body;
        Isometry3::from_parts(Translation3::from((base * motion * target).coords + shift), rotation)
    };
    let mut poses: Vec<Isometry3<f64>> = motions(&truth, &rows).into_iter().map(seen).collect();
    let points = |poses: &[Isometry3<f64>]| poses.iter().map(|it| it.translation.vector.into()).collect::<Vec<_>>();
    let right = left(&joints, &rows, &points(&poses), target, &mut rng);

    let joint = rng.random_range(0..joints.len());
    let turns_about = joints[joint].line().is_some();
    let marker = Some("marker".to_owned());
    let mut of_column = Some(format!("j{joint}"));
    let mut roll_pitch_yaw = None;
    let requaternion = |pose: &mut Isometry3<f64>, q: [f64; 4]| {
        pose.rotation = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
    };
    let kind = match fault {
        Fault::None => None,
        Fault::Sign => {
            rows.iter_mut().for_each(|row| row[joint] *= -1.0);
            Some(DiagnosticKind::Sign)
        }
        Fault::Zero | Fault::Degrees if !turns_about => return None,
        Fault::Zero => {
            let by = rng.random_range(10_f64..180.0).to_radians();
            rows.iter_mut().for_each(|row| row[joint] += by);
            Some(DiagnosticKind::Zero)
        }
        Fault::Degrees => {
            rows.iter_mut().for_each(|row| row[joint] = row[joint].to_degrees());
            Some(DiagnosticKind::Unit)
        }
        Fault::Swapped => {
            let other = rng.random_range(0..joints.len());
            if other == joint {
                return None;
            }
            rows.iter_mut().for_each(|row| row.swap(joint, other));
            of_column = Some(format!("j{}", joint.min(other)));
            Some(DiagnosticKind::Order)
        }
        Fault::Lag => {
            rows.remove(0);
            poses.pop();
            of_column = None;
            Some(DiagnosticKind::Lag)
        }
        Fault::Base => {
            of_column = None;
            Some(DiagnosticKind::Base)
        }
        of_target => {
            of_column = marker;
            let size = rng.random_range(0.8..1.25);
            let mut angles = Vec::new();
            for pose in &mut poses {
                let (place, q) = (pose.translation.vector, pose.rotation);
                match of_target {
                    Fault::Millimetres => pose.translation.vector *= 1e3,
                    Fault::Size => pose.translation.vector *= size,
                    Fault::Mirrored => pose.translation.vector = Vector3::new(place.y, place.x, place.z),
                    Fault::Inverted => *pose = pose.inverse(),
                    // Written w, x, y, z and read as x, y, z, w; and the other way round.
                    Fault::RealFirst => requaternion(pose, [q.k, q.w, q.i, q.j]),
                    Fault::RealLast => requaternion(pose, [q.i, q.j, q.k, q.w]),
                    _ => angles.push(Vector3::from(<[f64; 3]>::from(q.euler_angles()))),
                }
            }
            roll_pitch_yaw = (!angles.is_empty()).then_some(angles);
            Some(match of_target {
                Fault::Millimetres => DiagnosticKind::Unit,
                Fault::Size if (size - 1.0_f64).abs() < 0.05 => return None,
                Fault::Size => DiagnosticKind::Size,
                Fault::Mirrored => DiagnosticKind::Mirror,
                _ => DiagnosticKind::Pose,
            })
        }
    };
    let wrong = left(&joints, &rows, &points(&poses), target, &mut rng);
    // Of small robots a rotation may be anything else's; of others positions tell what calibration does not mend.
    let is_told = match fault {
        Fault::None => true,
        Fault::Base => joints.len() > 2,
        _ if of_poses => joints.len() > 2,
        Fault::Millimetres => joints.len() > 2 && wrong > 20.0 * right.max(SIGMA),
        _ => wrong > 20.0 * right.max(SIGMA) && wrong > 0.03,
    };
    let turns = match roll_pitch_yaw {
        Some(angles) => angles,
        None if is_pose => poses.iter().map(|pose| pose.rotation.scaled_axis()).collect(),
        None => Vec::new(),
    };
    let base = (fault == Fault::Base).then(|| Base {
        at: Isometry3::from_parts(base.translation, turn(&mut rng, 0.3) * base.rotation),
        sd_m: 1e-6,
        sd_rad: 1e-6,
    });
    let guess = if is_off { target + Vector3::from_fn(|_, _| rng.random_range(-0.1..0.1)) } else { target };
    let wanted = kind.map(|kind| (kind, of_column));
    Some(Case { joints, target: guess, rows, poses, turns, base, wanted, is_told, right })
}

fn doubts(case: &Case) -> Vec<Diagnostic> {
    let columns: Vec<String> = (0..case.joints.len()).map(|joint| format!("j{joint}")).collect();
    let limits = vec![None; case.joints.len()];
    let subject = Subject {
        columns: &columns,
        joints: &case.joints,
        carriers: None,
        limits: &limits,
        target: case.target,
        target_sd_m: 0.3,
        learned: &[],
        zeros_rad: &[],
        unknowns: 0,
        sigma_m: SIGMA,
        direction_rad: 0.01,
        point_m: 0.005,
        base: case.base,
    };
    let lines: Vec<usize> = (2..case.rows.len() + 2).collect();
    let seen = Seen {
        name: "marker".to_owned(),
        points: case.poses.iter().map(|pose| Some(pose.translation.vector.into())).collect(),
        turns: case.turns.clone(),
        arm_m: (!case.turns.is_empty()).then_some(ARM),
        ..Seen::default()
    };
    let evidence = Evidence { lines: &lines, configurations: &case.rows, targets: vec![seen], ..Evidence::default() };
    let mut doubts = examine(&subject, &evidence).diagnostics;
    doubts.retain(|doubt| doubt.kind != DiagnosticKind::RepeatedPosture);
    doubts
}

/// What a doubt says that the description fits to, metres.
fn fits_to(doubt: &Diagnostic) -> f64 {
    let said = doubt.evidence.split("fits to ").nth(1).expect("says how well").split(' ').collect::<Vec<_>>();
    said[0].parse::<f64>().expect("a number") * if said[1] == "mm" { 1e-3 } else { 1.0 }
}

#[test]
fn a_table_that_is_right_raises_no_doubt() {
    // By day a sixth of the night's.
    let tables = if is_night() { 300 } else { 50 };
    for noise in [0.0, SIGMA] {
        let doubted: Vec<String> = (1001..1001 + tables)
            .flat_map(|seed| {
                doubts(&case(Fault::None, noise, seed).expect("a case"))
                    .into_iter()
                    .map(move |it| format!("{seed}: {it}"))
            })
            .collect();
        assert!(doubted.len() as u64 <= tables / 50, "σ {noise}: {doubted:?}");
    }
}

/// Where another reading explains a table as well as the right one, as the other sign of one of two joints, either may be told.
#[test]
fn the_fault_of_a_table_is_told_first() {
    use Fault::*;
    let faults = [
        Sign,
        Zero,
        Degrees,
        Millimetres,
        Size,
        Swapped,
        Mirrored,
        Inverted,
        RealFirst,
        RealLast,
        RollPitchYaw,
        Lag,
        Base,
    ];
    let wanted = if is_night() { 60 } else { 6 };
    for fault in faults {
        let cases: Vec<(u64, Case)> = (2001..=2160)
            .filter_map(|seed| Some((seed, case(fault, SIGMA, seed)?)))
            .filter(|(_, case)| case.is_told)
            .take(wanted)
            .collect();
        let is_right = |case: &Case, first: &Diagnostic| {
            let wanted = case.wanted.as_ref().expect("a fault");
            *wanted == (first.kind, first.column.clone())
                || (first.kind != DiagnosticKind::Misfit && fits_to(first) < 1.5 * case.right + SIGMA)
        };
        let missed: Vec<String> = cases
            .iter()
            .map(|(seed, case)| (seed, case, doubts(case)))
            .filter(|(_, case, doubts)| !doubts.first().is_some_and(|first| is_right(case, first)))
            .map(|(seed, case, doubts)| {
                let said: Vec<String> = doubts.iter().map(ToString::to_string).collect();
                format!("{seed}, {} joints, {:?}: {said:?}", case.joints.len(), case.wanted)
            })
            .collect();
        assert!(cases.len() >= wanted.min(26), "{fault:?}: {} cases", cases.len());
        // 95 of 100 are wanted; so many of these are missed with a chance of 3 % then.
        assert!(
            missed.len() <= 1 + cases.len() / 12,
            "{fault:?}: {} of {} missed\n{}",
            missed.len(),
            cases.len(),
            missed.join("\n")
        );
    }
}
