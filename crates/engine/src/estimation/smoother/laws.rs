//! Laws of the smoother, over random chains.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Point3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{
    HypothesisSettings, Smoother,
    mode::{Mode, StoppingCriteria},
    normal::{Buffers, Normal},
    posterior::{Measurement, Posterior},
};
use crate::{
    estimation::Estimator,
    kinematics::Joint,
    model::{
        Block, Device, Hand, KinematicData, Layout, Prior, State, Symmetry, jacobian,
        random::{random_arm, random_pose},
    },
    sensing::{Distance, Loss, MeasurementModel, Observation, Position, Relative, Sensor},
};

const THOROUGH: StoppingCriteria<'_> =
    StoppingCriteria { steps: 200, tolerance: 1e-14, hopeless: f64::INFINITY, known: &[] };
const SIGMA: f64 = 0.01;

/// A truth, a guess near it, and the posterior after some noisy measurements.
fn case(seed: u64, joints: usize, count: usize, anywhere: bool) -> (State, Layout, Posterior, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let truth = random_arm(&mut rng, joints);
    let layout = Layout::of_arm(&truth, &[], false);
    let m = layout.dimension();
    let guess = truth.retract(&layout, &DVector::from_fn(m, |_, _| rng.random_range(-0.15..0.15)));
    let covariance = DMatrix::identity(m, m) * 0.09;
    let within = |block| (anywhere && matches!(block, Block::Axis(_))).then_some(1.0);
    let prior = Prior::new(guess, &layout, covariance, within).expect("a prior");
    let mut posterior = Posterior::new(prior, Arc::new(MeasurementModel::tracker(SIGMA)));
    for _ in 0..count {
        let positions: Vec<f64> = (0..joints).map(|_| rng.random_range(-1.5..1.5)).collect();
        let noise = Vector3::from_fn(|_, _| SIGMA * rng.sample::<f64, _>(StandardNormal));
        let marker: Point3<f64> = truth.marker_at(&positions) + noise;
        posterior.measurements.push(Measurement { positions, observation: Observation::seen(marker), movement: 0 });
    }
    (truth, layout, posterior, rng)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The negative gradient is minus the derivative of the cost, for either prior, and with measurements that have
    /// marginalised elsewhere: the state drifts on and is written with the pivots of the prior, not of the marginalised state.
    #[test]
    fn descent_is_the_derivative_of_the_cost(seed: u64, anywhere: bool, marginalised in 0_usize..5) {
        let (truth, layout, mut posterior, mut rng) = case(seed, 4, 6, anywhere);
        let m = layout.dimension();
        if marginalised > 0 {
            let there = truth.retract(&layout, &DVector::from_fn(m, |_, _| rng.random_range(-0.05..0.05)));
            posterior.marginalise(marginalised, &there.slid_towards(&posterior.pins), &layout);
        }
        let chain = truth.retract(&layout, &DVector::from_fn(m, |_, _| rng.random_range(-0.2..0.2)));
        let chain = chain.slid_towards(&posterior.pins);
        let normal = posterior.normal(&chain, &layout).expect("in the chart");
        prop_assert!((normal.cost - posterior.cost(&chain, &layout)).abs() < 1e-9 * normal.cost);
        for k in 0..m {
            let moved = |step: f64| {
                let mut delta = DVector::zeros(m);
                delta[k] = step;
                posterior.cost(&chain.retract(&layout, &delta), &layout)
            };
            let difference = -(moved(1e-6) - moved(-1e-6)) / 2e-6;
            let scale = 1.0 + normal.negative_gradient.amax();
            prop_assert!((difference - normal.negative_gradient[k]).abs() < 1e-5 * scale, "{k}: {difference} {}", normal.negative_gradient[k]);
        }
    }

    /// What a search keeps from step to step changes no bit of its equations, whatever was put there before.
    #[test]
    fn a_place_that_is_used_again_changes_nothing(seed: u64, count in 1_usize..70, is_robust: bool) {
        let (truth, layout, mut posterior, mut rng) = case(seed, 3, count, false);
        if is_robust {
            posterior.loss = Loss::Huber;
        }
        let mut buffers = Buffers::default();
        // What is no number at one step is none of the next.
        for scale in [1.0, 0.5, f64::NAN, 1.0, 2.0] {
            posterior.scales.fill(scale);
            let away = DVector::from_fn(layout.dimension(), |_, _| rng.random_range(-0.2..0.2));
            let state = truth.retract(&layout, &away).slid_towards(&posterior.pins);
            let loss = posterior.loss.into();
            let again = posterior.normal_by(loss, &state, &layout, &mut buffers).expect("no chart ends");
            let fresh = posterior.normal_by(loss, &state, &layout, &mut Buffers::default()).expect("no chart ends");
            let bits = |x: &f64| x.to_bits();
            let all = |normal: &Normal| -> Vec<u64> {
                let (information, negative_gradient) = (normal.information.lower_triangle(), &normal.negative_gradient);
                information.iter().chain(negative_gradient.iter()).map(bits).chain([normal.cost.to_bits()]).collect()
            };
            if scale.is_finite() {
                prop_assert_eq!(all(&again), all(&fresh));
            }
            buffers.put_back(again);
        }
    }

    /// At a mode the gradient vanishes, and its covariance is that of prior and data linearised there.
    #[test]
    fn a_mode_is_stationary(seed: u64) {
        let (truth, layout, posterior, _) = case(seed, 4, 12, false);
        let mode = posterior.mode(&truth, &layout, THOROUGH).expect("a mode");
        let normal = posterior.normal(&mode.state, &layout).expect("in the chart");
        // In standard deviations.
        let step = mode.covariance() * &normal.negative_gradient;
        prop_assert!(step.dot(&(&mode.information * &step)) < 1e-6);
        prop_assert!(mode.cost <= posterior.cost(&truth, &layout) + 1e-9);
        let m = layout.dimension();
        prop_assert!((mode.covariance() * &mode.information - DMatrix::identity(m, m)).amax() < 1e-6);
    }

    /// Compressing measurements at the mode changes neither the mode nor its covariance.
    #[test]
    fn settling_keeps_the_mode(seed: u64) {
        let (truth, layout, mut posterior, _) = case(seed, 4, 30, false);
        let mode = posterior.mode(&truth, &layout, THOROUGH).expect("a mode");
        posterior.marginalise(15, &mode.state, &layout);
        posterior.marginalise(10, &mode.state, &layout);
        prop_assert_eq!((posterior.measurements.len(), posterior.count()), (5, 30));
        let after = posterior.mode(&mode.state, &layout, THOROUGH).expect("a mode");
        prop_assert!((after.cost - mode.cost).abs() < 1e-6 * mode.cost.max(1.0));
        let moved = mode.state.local(&layout, &after.state).expect("near");
        prop_assert!(moved.dot(&(&mode.information * &moved)) < 1e-4);
        prop_assert!((&after.information - &mode.information).amax() < 1e-3 * mode.information.amax());
    }
}

/// Starting from nothing, with enough data: the truth within a few standard deviations, alone.
#[test]
fn hypotheses_find_the_truth_without_a_guess() {
    for seed in 0..4 {
        let (truth, layout, posterior, mut rng) = case(seed, 3, 0, true);
        let layout = Arc::new(layout);
        let settings = HypothesisSettings::default();
        let rng_of_search = ChaCha8Rng::seed_from_u64(9);
        let mut smoother = Smoother::new(
            posterior.prior.clone(),
            layout.clone(),
            posterior.measurement_model.clone(),
            settings,
            rng_of_search,
        );
        assert!(smoother.belief().weight() < 0.5, "ambiguous at first");
        for _ in 0..25 {
            let theta: Vec<f64> = (0..3).map(|_| rng.random_range(-1.5..1.5)).collect();
            let noise = Vector3::from_fn(|_, _| SIGMA * rng.sample::<f64, _>(StandardNormal));
            smoother.update(&theta, &Observation::seen(truth.marker_at(&theta) + noise)).expect("an update");
        }
        let belief = smoother.belief();
        assert!(belief.weight() > 0.99, "seed {seed}: {}", belief.weight());
        for _ in 0..20 {
            let theta: Vec<f64> = (0..3).map(|_| rng.random_range(-1.5..1.5)).collect();
            let error = (belief.state.marker_at(&theta) - truth.marker_at(&theta)).norm();
            let expected = belief.marker_covariance(&theta).expect("kept").trace().sqrt();
            assert!(error < 6.0 * expected, "seed {seed}: {error} {expected}");
        }
    }
}

/// For data that are linear in the error the smoother and recursive least squares are the same estimator.
#[test]
fn near_the_truth_it_agrees_with_the_filter() {
    let (truth, layout, _, mut rng) = case(5, 4, 0, false);
    let layout = Arc::new(layout);
    let m = layout.dimension();
    let guess = truth.retract(&layout, &DVector::from_element(m, 1e-5));
    let deviations = DVector::from_element(m, 1e-4);
    let sigma = 1e-5;
    let prior = Prior::with_deviations(guess.clone(), &layout, &deviations).expect("a prior");
    let settings = HypothesisSettings { kept: 1, spawned: 0 };
    let mut smoother = Smoother::new(
        prior,
        layout.clone(),
        Arc::new(MeasurementModel::tracker(sigma)),
        settings,
        ChaCha8Rng::seed_from_u64(1),
    );
    let mut information = DMatrix::from_diagonal(&deviations.map(|sd| sd.powi(-2)));
    for _ in 0..8 {
        let theta: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
        smoother.update(&theta, &Observation::seen(truth.marker_at(&theta))).expect("an update");
        let (_, h) = jacobian(&truth, &layout, &theta);
        information += h.transpose() * h / (sigma * sigma);
    }
    // Noise that is told is a guess: readings without any make it smaller.
    let scale = smoother.posterior.scales[0];
    let known = DMatrix::from_diagonal(&deviations.map(|sd| sd.powi(-2)));
    let information = &known + (information - &known) / (scale * scale);
    let covariance = information.try_inverse().expect("positive");
    let found = smoother.belief().covariance.as_ref().expect("kept");
    assert!((found - &covariance).amax() < 1e-3 * covariance.amax());
}

/// A reading without a prediction says nothing, and what others say stays theirs: in the equations, in what is compressed, and in how
/// many equations parameters account for.
#[test]
fn a_reading_without_a_prediction_shifts_no_other() {
    let (truth, layout, plain, mut rng) = case(7, 3, 0, false);
    let theta = [0.4, -0.3, 0.7];
    // The target is where the distance is measured from: every direction leads away.
    let state = truth.slid_towards(&plain.pins);
    let to = KinematicData::new(&state, &layout).at(&theta).target(0).into();
    let sensors = vec![
        Sensor::even(Position { target: 0 }, SIGMA),
        Sensor::even(Distance { target: 0, to }, 1e-4),
        Sensor::even(Distance { target: 0, to: Point3::new(0.3, 0.2, 1.0) }, 0.02),
    ];
    let measurement_model = Arc::new(MeasurementModel::new(sensors));
    let seen = |theta: &[f64], rng: &mut ChaCha8Rng| {
        let v: Vec<f64> = (0..measurement_model.equations()).map(|_| rng.sample(StandardNormal)).collect();
        let mut observation = measurement_model.observe(&truth, theta, &v);
        observation.readings[1] = Some(vec![0.7]);
        observation
    };
    for loss in [Loss::None, Loss::Huber, Loss::MIXTURE] {
        let mut all = Posterior::new(plain.prior.clone(), measurement_model.clone());
        all.loss = loss;
        for index in 0..4 {
            let positions = if index == 1 { theta.to_vec() } else { vec![0.1 * index as f64; 3] };
            let observation = seen(&positions, &mut rng);
            all.measurements.push(Measurement { positions, observation, movement: index + 1 });
        }
        let mut others = all.clone();
        others.measurements[1].observation.readings[1] = None;
        let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() <= 1e-12 * b.amax();
        let [one, other] = [&all, &others].map(|posterior| posterior.normal(&state, &layout).expect("in the chart"));
        assert!((one.cost - other.cost).abs() <= 1e-12 * other.cost, "{loss:?}: {} {}", one.cost, other.cost);
        assert!(near(&one.information, &other.information), "{loss:?}");
        assert!(
            (&one.negative_gradient - &other.negative_gradient).amax() <= 1e-12 * other.negative_gradient.amax(),
            "{loss:?}"
        );
        let equations = [&all, &others].map(|posterior| {
            let Measurement { positions, observation, .. } = &posterior.measurements[1];
            posterior.measurement_model.equations_of(&state, &layout, positions, observation)
        });
        assert!(equations[0].rows.ncols() == 4 && equations[0].rows == equations[1].rows);
        assert_eq!(equations[0].residual, equations[1].residual);
        let modes = [(&all, one), (&others, other)];
        let modes = modes.map(|(posterior, normal)| Mode::at(posterior.level, state.clone(), normal).expect("a prior"));
        let absorbed = [(&all, &modes[0]), (&others, &modes[1])];
        let absorbed = absorbed.map(|(posterior, mode)| posterior.absorbed(mode, &layout).expect("in the chart"));
        assert!(absorbed[0].iter().zip(&absorbed[1]).all(|(a, b)| (a - b).abs() < 1e-9), "{absorbed:?}");
        for posterior in [&mut all, &mut others] {
            posterior.marginalise(3, &state, &layout);
        }
        let marginalised = [&all, &others].map(|posterior| posterior.marginalised.as_ref().expect("compressed"));
        for (one, other) in marginalised[0].noises.iter().zip(&marginalised[1].noises) {
            assert!(near(&one.information, &other.information) && (one.misfit - other.misfit).abs() < 1e-9, "{loss:?}");
        }
    }
}

#[test]
fn what_is_no_number_is_refused_and_leaves_the_belief() {
    let (_, layout, posterior, _) = case(6, 3, 0, false);
    let settings = HypothesisSettings::default();
    let rng = ChaCha8Rng::seed_from_u64(1);
    let mut smoother = Smoother::new(posterior.prior, Arc::new(layout), posterior.measurement_model, settings, rng);
    let before = smoother.belief().state.clone();
    assert!(smoother.update(&[0.1; 3], &Observation::seen(Point3::new(f64::NAN, 0.0, 0.0))).is_err());
    assert!(smoother.update(&[0.1; 3], &Observation::missed(1)).is_ok());
    assert_eq!(smoother.belief().state, before);
}

/// An arm that a camera of unknown place watches: the place of a marker in its frame, and nothing else, is measured.
fn watched_by_itself(seed: u64) -> (State, Layout, Posterior, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut truth = random_arm(&mut rng, 4);
    truth.devices.push(Device { link: None, pose: random_pose(&mut rng), intrinsics: None, distortion: None });
    let blocks = (0..4).map(Block::Axis).chain([Block::Offset(1), Block::Target(0), Block::Device(0)]);
    let layout = Layout::new(&truth, blocks);
    let m = layout.dimension();
    let guess = truth.retract(&layout, &DVector::from_fn(m, |_, _| rng.random_range(-0.1..0.1)));
    let prior = Prior::around(guess, &layout, DMatrix::identity(m, m) * 0.04).expect("a prior");
    let channel = Relative { target: 0, seen_from: Hand::Device(0), has_rotation: false };
    let measurement_model = MeasurementModel::new(vec![Sensor::even(channel, 1e-4)]);
    let mut posterior = Posterior::new(prior, Arc::new(measurement_model.clone()));
    for movement in 1..=20 {
        let positions: Vec<f64> = (0..4).map(|_| rng.random_range(-1.5..1.5)).collect();
        let noise: Vec<f64> = (0..3).map(|_| rng.sample(StandardNormal)).collect();
        let observation = measurement_model.observe(&truth, &positions, &noise);
        posterior.measurements.push(Measurement { positions, observation, movement });
    }
    (truth, layout, posterior, rng)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Where nothing is measured from outside, a search ends at the same mode from wherever the robot is thought to stand: one body is
    /// one hypothesis.
    #[test]
    fn a_body_is_one_hypothesis_wherever_it_stands(seed: u64) {
        let (truth, layout, posterior, mut rng) = watched_by_itself(seed);
        let warm = StoppingCriteria { steps: 30, tolerance: 1e-3, hopeless: f64::INFINITY, known: &[] };
        prop_assert_eq!(posterior.symmetries(&truth, &layout), [Symmetry::AsOne, Symmetry::Zero(1)]);
        let first = posterior.mode(&truth, &layout, warm).expect("a mode");
        for _ in 0..4 {
            let a: Vec<f64> = (0..6).map(|_| rng.random_range(-0.3..0.3)).collect();
            let elsewhere = Symmetry::Zero(1).applied(&Symmetry::AsOne.applied(&first.state, &a), &[0.2]);
            let found = posterior.mode(&elsewhere, &layout, warm).expect("a mode");
            let apart = first.distance(&layout, &found.state).expect("in the chart");
            prop_assert!(apart < 0.01, "{apart}, at costs {} and {}", first.cost, found.cost);
        }
    }

    /// Nor is anything moved that a measurement tells.
    #[test]
    fn what_is_measured_from_outside_has_no_symmetry(seed: u64) {
        let (truth, layout, posterior, _) = case(seed, 4, 6, false);
        prop_assert!(posterior.symmetries(&truth, &layout).is_empty());
        let nothing = Posterior::new(posterior.prior.clone(), posterior.measurement_model.clone());
        prop_assert!(nothing.symmetries(&truth, &layout).is_empty(), "before anything is measured");
    }
}

/// The size of an arm that only slides is no parameter where its target is known, though every reading stays where it is.
#[test]
fn what_changes_no_parameter_is_no_symmetry() {
    let joints = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].map(Joint::Prismatic).to_vec();
    let truth = State::arm(joints, Point3::new(0.3, 0.2, 0.5));
    let layout = Layout::of_arm(&truth, &[], false);
    let m = layout.dimension();
    let prior = Prior::around(truth.clone(), &layout, DMatrix::identity(m, m)).expect("a prior");
    let mut posterior = Posterior::new(prior, Arc::new(MeasurementModel::tracker(SIGMA)));
    let positions = vec![0.1, -0.4, 0.2];
    let observation = Observation::seen(truth.marker_at(&positions));
    posterior.measurements.push(Measurement { positions, observation, movement: 1 });
    assert_eq!(posterior.symmetries(&truth, &layout), []);
}
