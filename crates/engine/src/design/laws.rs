//! What the search for designs must keep.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Problem, balance::Shares, movements_by_counting, search::Search, sensitivity::Sensitivity};
use crate::{
    kinematics::JointBox,
    model::{
        Frame, Layout, State,
        laws::{all_blocks, random_state, stiff},
    },
    selection::{CriterionUnits, Movement, Weights},
    sensing::{Channel, Equipment, Facing, InView, Pixels, Position, Rig, examples},
};
use body_schema_experiment::{Draw, Gauge, World};
use body_schema_scenario::builtin;

/// A robot of which anything may be learned, by one channel.
fn random_problem(rng: &mut ChaCha8Rng, joints: usize, channel: Option<usize>) -> Problem {
    let state = random_state(rng, joints);
    let channels = examples(rng, &state);
    let (channel, (truth, blocks)) = match channel {
        Some(channel) => (channels[channel % channels.len()].clone(), (state.clone(), all_blocks(&state))),
        None => {
            let marker = Position::of_marker(rng.random_range(0.1..1.0));
            (Arc::new(marker) as Arc<dyn Channel>, stiff(state))
        }
    };
    let rig = Rig::new(vec![channel]);
    let layout = Layout::new(&truth, blocks);
    let m = layout.dimension();
    let limits = (0..joints).map(|_| (rng.random_range(-3.0..-1.0), rng.random_range(1.0..3.0))).collect();
    let deviations = DVector::from_element(m, 1.0);
    Problem {
        rig: Arc::new(rig),
        limits: JointBox::new(limits).expect("in order"),
        head: None,
        visible_pose: None,
        prior: DMatrix::identity(m, m),
        weights: Weights::new(CriterionUnits::CharacteristicLength(rng.random_range(0.2..2.0)), &layout, &deviations),
        layout,
        truth,
    }
}

fn random_poses(rng: &mut ChaCha8Rng, problem: &Problem, count: usize) -> Vec<Vec<f64>> {
    let n = problem.limits.dimension();
    (0..count).map(|_| problem.limits.from_unit(&(0..n).map(|_| rng.random()).collect::<Vec<f64>>())).collect()
}

fn random_matrix(rng: &mut ChaCha8Rng, m: usize) -> DMatrix<f64> {
    let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-1.0..1.0));
    &root * root.transpose()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// Sensitivities are those of the rows, and their slopes are their differences: of points in vector registers, and of every
    /// other channel.
    #[test]
    fn slopes_are_differences_of_the_sensitivity(seed: u64, joints in 1_usize..=8, channel in prop::option::of(0_usize..12)) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let problem = random_problem(&mut rng, joints, channel);
        let s = random_matrix(&mut rng, problem.layout.dimension());
        let sensitivity = Sensitivity::new(&problem);
        let mut poses = random_poses(&mut rng, &problem, 3);
        // Beside poses anywhere, what little a camera sees.
        poses.extend(random_poses(&mut rng, &problem, 500).into_iter().filter(|pose| problem.sees(pose)).take(2));
        let found = sensitivity.slopes(&s, &poses);
        prop_assert_eq!(&found.values, &sensitivity.values(&s, &poses), "without slopes");
        for (pose, (phi, slopes)) in poses.iter().zip(found.values.iter().zip(found.gradients.chunks(joints))) {
            let wanted = problem.information(pose).dot(&s);
            if !problem.sees(pose) {
                prop_assert_eq!((*phi, wanted), (f64::NEG_INFINITY, 0.0), "nothing is seen, so that nothing is told");
                continue;
            }
            prop_assert!((phi - wanted).abs() <= 1e-10 * wanted, "{phi} {wanted}");
            for (joint, slope) in slopes.iter().enumerate() {
                let difference = |step: f64| {
                    let moved = [1.0, -1.0, 2.0, -2.0].map(|steps| {
                        let mut moved = pose.clone();
                        moved[joint] += steps * step;
                        moved
                    });
                    let values = sensitivity.values(&s, &moved);
                    (8.0 * (values[0] - values[1]) - (values[2] - values[3])) / (12.0 * step)
                };
                let (coarse, fine) = (difference(1e-4), difference(5e-5));
                if !coarse.is_finite() || !fine.is_finite() {
                    // At the border of what is seen.
                    continue;
                }
                // Beside a camera's plane of no image differences leave out more than elsewhere, of rows as of what is asked here.
                let left_out = 4.0 * (coarse - fine).abs();
                let apart = (slope - coarse).abs();
                prop_assert!(apart <= 1e-6 * phi.max(slope.abs()) + left_out, "{joint}: {slope} {coarse} {fine} {phi}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The equivalence theorem over the poses that there are.
    #[test]
    fn balanced_shares_are_optimal(seed: u64, joints in 1_usize..=5, count in 1_usize..=60, movements in 1_usize..200) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let problem = random_problem(&mut rng, joints, None);
        let poses = random_poses(&mut rng, &problem, count);
        let mut shares = Shares::new(&problem, movements as f64, &poses, vec![1.0 / count as f64; count]);
        let before = shares.standing().expect("a prior").trace;
        let (kept, standing) = shares.balance(1e-6).expect("a prior");
        prop_assert!((shares.shares().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!(standing.trace <= before * (1.0 + 1e-12));
        let mut shares = shares.shares().iter();
        for (pose, kept) in poses.iter().zip(kept) {
            let phi = problem.information(pose).dot(&standing.sensitivity);
            let share = if kept { *shares.next().expect("kept") } else { 0.0 };
            // What little shares have been dropped is felt, too.
            let most = 1e-3 * standing.trace;
            prop_assert!(phi - standing.mean <= most, "{share}: {phi} {}", standing.mean);
            prop_assert!(share * (standing.mean - phi) <= most, "{share}: {phi} {}", standing.mean);
        }
    }
}

/// What the truth tells of one movement, by a world that knows nothing of designs: the information of what was read there.
fn told(world: &World, problem: &Problem, pose: &[f64]) -> DMatrix<f64> {
    let draw = Draw { noise: vec![0.0; problem.rig.equations()], outliers: Vec::new(), joints: Vec::new() };
    let read = world.observe(&Movement::to(pose.to_vec()), &draw).expect("within the limits");
    let rows = problem.rig.equations_of(&problem.truth, &problem.layout, pose, &read).rows;
    &rows * rows.transpose()
}

/// Whoever climbs from elsewhere finds no pose that the certificate did not allow for, and nobody has found a better design:
/// the traces are those of 60 exchanges of six poses each, balanced by multiplication, with their gaps 0.7, 8.1 and 0.1 %. What poses
/// tell is judged by what the simulated world reads there, not by what the search believes to be in view.
#[test]
fn certificates_hold() {
    for (name, seed, found_before) in [
        ("arm-6dof", 1001, 3.228_829e-3),
        ("arm-12dof", 1002, 8.622_693e-3),
        ("head-fov", 1003, 4.441_355e-3),
        ("arm-6dof-camera", 1004, f64::INFINITY),
    ] {
        let scenario = builtin(name).expect("built in");
        let problem = scenario.design_problem().expect("simulated");
        let experiment = scenario.experiment(seed, None).expect("simulated");
        let world = experiment.world();
        let design = problem.best_design(40, 0.01).expect("noise");
        assert!(design.gap <= 0.01 && design.trace < found_before, "{name}: {} {}", design.trace, design.gap);
        // M, and all that follows from it, by what is read.
        let mut m = problem.prior.clone();
        for (pose, share) in design.poses.iter().zip(&design.shares) {
            let told = told(world, &problem, pose);
            assert!(told.amax() > 0.0, "{name}: nothing is read at {pose:?}, share {share}");
            m += told * (40.0 * share);
        }
        let inverse = m.cholesky().expect("a prior").inverse();
        let trace = problem.weights.trace(&inverse);
        assert!((trace / design.trace - 1.0).abs() < 1e-9, "{name}: {trace} and {}", design.trace);
        let sensitivity = &inverse * problem.weights.scale(&inverse) * 40.0;
        let phi = |pose: &[f64]| told(world, &problem, pose).dot(&sensitivity);
        let mean: f64 = design.poses.iter().zip(&design.shares).map(|(pose, share)| share * phi(pose)).sum();
        let mut search = Search::new(&problem, 40, Some(&design));
        let standing = search.balance(1.0).expect("informative");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let anywhere = random_poses(&mut rng, &problem, 100_000);
        let by_chance = anywhere.iter().take(10_000).map(|pose| phi(pose)).fold(0.0, f64::max);
        search.candidates = anywhere;
        let climbed = search.favoured(&standing, 300);
        let greatest = climbed.iter().take(50).map(|(point, _)| phi(&problem.limits.from_unit(point)));
        let excess = (greatest.fold(by_chance, f64::max) - mean) / trace;
        assert!(
            (climbed[0].1 / phi(&problem.limits.from_unit(&climbed[0].0)) - 1.0).abs() < 1e-9,
            "{name}: as is believed"
        );
        // What the documentation of `Design::gap` admits: some maxima draw from nearby alone, and nobody follows the border of what
        // is in view.
        let missed = if problem.rig.is_watched(problem.head.as_ref()) { 0.1 } else { 0.01 };
        assert!(excess <= design.gap + missed, "{name}: {excess} and {}", design.gap);
    }
}

/// By its own geometry, whether a camera has a target in its picture, whole, in front and facing it.
fn is_in_picture(state: &State, rig: &Rig, kinds: &Equipment, pose: &[f64]) -> bool {
    let channels = rig.channels().iter();
    channels.filter_map(|channel| channel.sight()).any(|(camera, target)| {
        let [eye, body] = [Frame::Device(camera), Frame::Target(target)].map(|frame| state.frame_at(frame, pose));
        let [fx, fy, cx, cy] = state.devices[camera].intrinsics.expect("a lens");
        let [width, height] = kinds.cameras[camera].size_px;
        let inside = kinds.targets[target].points.iter().all(|point| {
            let at = eye.inverse() * (body * point);
            let (u, v) = (fx * at.x / at.z + cx, fy * at.y / at.z + cy);
            at.z > 0.0 && (-1e-6..=width + 1e-6).contains(&u) && (-1e-6..=height + 1e-6).contains(&v)
        });
        let towards = eye.translation.vector - body.translation.vector;
        let faces = |facing: &Facing| (body.rotation * facing.direction.into_inner()).angle(&towards) <= facing.within;
        inside && kinds.targets[target].facing.as_ref().is_none_or(faces)
    })
}

/// The best design of what cameras see has all its weight where they see it.
#[test]
fn designs_are_in_view() {
    for name in ["arm-6dof-camera", "hand-eye-6dof"] {
        let scenario = builtin(name).expect("built in");
        let problem = scenario.design_problem().expect("simulated");
        let design = problem.best_design(20, 0.05).expect("something is in view");
        let seen = |pose: &Vec<f64>| is_in_picture(&problem.truth, &problem.rig, &scenario.robot.equipment, pose);
        let weight: f64 = design.poses.iter().zip(&design.shares).filter(|(pose, _)| seen(pose)).map(|it| it.1).sum();
        assert!((weight - 1.0).abs() < 1e-9, "{name}: {weight} of the weight is in view");
        let start = problem.weights.trace(&problem.prior.clone().cholesky().expect("a prior").inverse());
        assert!(design.trace < 0.2 * start, "{name}: {} of {start}", design.trace);
    }
}

/// A second camera that looks away is as good as none: no design, no bound and no count has anything of it.
#[test]
fn a_camera_that_looks_away_changes_nothing() {
    let scenario = builtin("arm-6dof-camera").expect("built in");
    let problem = scenario.design_problem().expect("simulated");
    let mut two = problem.clone();
    // Where the first one is, turned about its own x.
    let mut away = two.truth.devices[0].clone();
    away.pose *= nalgebra::Isometry3::rotation(nalgebra::Vector3::x() * std::f64::consts::PI);
    two.truth.devices.push(away);
    let Some((_, target)) = two.rig.channels()[0].sight() else { panic!("a camera") };
    let (kind, camera) = (&scenario.robot.equipment.targets[target], two.truth.devices.len() - 1);
    let blind = Pixels {
        camera,
        target,
        points: kind.points.clone().into(),
        size_px: scenario.robot.equipment.cameras[0].size_px,
        facing: kind.facing,
        sigma_px: 0.5,
    };
    let channels = two.rig.channels().iter().cloned().chain([Arc::new(blind) as Arc<dyn Channel>]);
    two.rig = Arc::new(Rig::new(channels.collect()));
    let mut rng = ChaCha8Rng::seed_from_u64(1005);
    for pose in random_poses(&mut rng, &problem, 200) {
        let [one, both] = [&problem, &two].map(|problem| problem.information(&pose));
        assert!((&one - &both).amax() <= 1e-9 * one.amax(), "{pose:?}");
    }
    let [one, both] = [&problem, &two].map(|problem| problem.best_design(10, 0.05).expect("in view"));
    assert!((both.trace / one.trace - 1.0).abs() < 1e-9, "{} and {}", one.trace, both.trace);
    let [one, both] = [&problem, &two].map(|problem| {
        let Problem { truth, layout, rig, limits, .. } = problem;
        let gauge = Gauge::new(truth, layout, rig, InView::By(None), limits);
        (movements_by_counting(truth, layout, rig, InView::By(None), limits), gauge.undetermined())
    });
    assert_eq!(one, both);
}

/// Where nothing is ever in view there is no design, and no movement to count.
#[test]
fn where_nothing_is_in_view_there_is_no_design() {
    let scenario = builtin("arm-6dof-camera").expect("built in");
    let mut problem = scenario.design_problem().expect("simulated");
    problem.truth.devices[0].pose.translation.vector.z += 100.0;
    assert!(problem.best_design(10, 0.05).is_none());
    let Problem { truth, layout, rig, limits, .. } = &problem;
    assert_eq!(movements_by_counting(truth, layout, rig, InView::By(None), limits), 0);
    assert_eq!(Gauge::new(truth, layout, rig, InView::By(None), limits).undetermined(), layout.dimension());
}
