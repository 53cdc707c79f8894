//! What the search for designs must keep.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Problem, balance::Shares, search::DesignSearch, sensitivity::Sensitivity};
use crate::{
    kinematics::JointBox,
    model::{
        Layout,
        random::{all_blocks, random_state, stiff},
    },
    selection::{CriterionUnits, Weights},
    sensing::{MeasurementModel, Position, Sensor, examples},
};

/// A robot of which anything may be learned, by one channel.
fn random_problem(rng: &mut ChaCha8Rng, joints: usize, channel: Option<usize>) -> Problem {
    let state = random_state(rng, joints);
    let sensors = examples(rng, &state);
    let (sensor, (truth, blocks)) = match channel {
        Some(channel) => (sensors[channel % sensors.len()].clone(), (state.clone(), all_blocks(&state))),
        None => (Sensor::even(Position { target: 0 }, rng.random_range(0.1..1.0)), stiff(state)),
    };
    let measurement_model = MeasurementModel::new(vec![sensor]);
    let layout = Layout::new(&truth, blocks);
    let m = layout.dimension();
    let limits = (0..joints).map(|_| (rng.random_range(-3.0..-1.0), rng.random_range(1.0..3.0))).collect();
    let deviations = DVector::from_element(m, 1.0);
    Problem {
        measurement_model: Arc::new(measurement_model),
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

#[test]
fn a_sensitivity_that_is_no_number_is_nobodys_favourite() {
    let problem = random_problem(&mut ChaCha8Rng::seed_from_u64(1006), 6, None);
    let mut search = DesignSearch::new(&problem, 20, None);
    let standing = search.balance(1e-6).expect("informative");
    let wanted = search.favoured(&standing, 6);
    let n = problem.limits.dimension();
    search.candidates.splice(0..0, [vec![f64::NAN; n], vec![-f64::NAN; n]]);
    assert_eq!(search.favoured(&standing, 6), wanted);
}
