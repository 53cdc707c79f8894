//! What selection costs: the A-criterion in batches against one candidate at a time against building the posterior,
//! and DIRECT's own share. Ratios within one run are what counts.
//!
//! `cargo bench --bench selection`

use std::hint::black_box;

use body_schema::{
    estimation::Belief,
    model::jacobian,
    optimize::{Direct, Settings, Variant},
    scenario::{Scenario, builtin},
    selection::{Actions, Active, Criterion, Minimiser, Past, Policy, Situation, Weights},
    sensing::MeasurementModel,
};
use divan::Bencher;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() {
    divan::main();
}

const SCENARIOS: [&str; 2] = ["arm-6dof", "arm-12dof"];
const CANDIDATES: usize = 300;

struct Case {
    scenario: Scenario,
    belief: Belief,
    weights: Weights,
    candidates: Vec<Vec<f64>>,
}

fn case(name: &str) -> Case {
    let scenario = builtin(name).expect("built in");
    let layout = scenario.robot.layout.clone();
    let prior_sd = scenario.prior.standard_deviations(&layout);
    let weights = scenario.weights();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw =
        || scenario.robot.limits.joints().iter().map(|&(lower, upper)| rng.random_range(lower..upper)).collect();
    let candidates = (0..CANDIDATES).map(|_| draw()).collect();
    let measurement_model = MeasurementModel::tracker(scenario.filter.sigma());
    let belief = Belief::new(scenario.robot.state.clone(), layout.into(), measurement_model.into())
        .with_covariance(DMatrix::from_diagonal(&prior_sd.map(|sd| sd * sd)));
    Case { scenario, belief, weights, candidates }
}

#[divan::bench(args = SCENARIOS)]
fn a_criterion_in_one_batch(bencher: Bencher<'_, '_>, name: &str) {
    let case = case(name);
    let criterion = Criterion::new(&case.belief, &case.weights).expect("a covariance");
    bencher.bench(|| criterion.evaluate(black_box(&case.candidates)));
}

#[divan::bench(args = SCENARIOS)]
fn b_criterion_one_at_a_time(bencher: Bencher<'_, '_>, name: &str) {
    let case = case(name);
    let criterion = Criterion::new(&case.belief, &case.weights).expect("a covariance");
    bencher.bench(|| {
        let single = |theta| criterion.evaluate(std::slice::from_ref(black_box(theta)))[0];
        case.candidates.iter().map(single).collect::<Vec<f64>>()
    });
}

/// What the criterion abbreviates: the posterior of every candidate, in the gain form.
#[divan::bench(args = SCENARIOS)]
fn c_posterior_of_every_candidate(bencher: Bencher<'_, '_>, name: &str) {
    let case = case(name);
    let covariance = case.belief.covariance.clone().expect("a covariance");
    bencher.bench(|| {
        let posterior = |theta: &Vec<f64>| {
            let (_, h) = jacobian(&case.belief.state, &case.belief.layout, black_box(theta));
            let numerator = &covariance * h.transpose();
            let mut s = &h * &numerator;
            (0..3).for_each(|k| s[(k, k)] += case.scenario.filter.variance);
            let gain = &numerator * s.try_inverse().expect("positive");
            case.weights.trace(&(&covariance - gain * numerator.transpose()))
        };
        case.candidates.iter().map(posterior).collect::<Vec<f64>>()
    });
}

#[divan::bench(args = SCENARIOS)]
fn d_one_active_selection(bencher: Bencher<'_, '_>, name: &str) {
    let case = case(name);
    let active = Active::new(case.weights.clone(), Minimiser::Direct(case.scenario.selection.search));
    let actions = Actions::Box(case.scenario.robot.limits.clone());
    let history = Past::default();
    let situation = Situation { belief: &case.belief, actions: &actions, history: &history, constraints: None };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    bencher.bench_local(|| active.select(&situation, &mut rng).expect("a selection"));
}

/// A search of [`bowl`], by as many evaluations as there are candidates.
fn search(dimension: usize) -> Direct {
    let settings =
        Settings { variant: Variant::LocallyBiased, epsilon: 1e-4, max_evaluations: CANDIDATES, ..Settings::default() };
    Direct::new(dimension, settings).expect("valid settings")
}

fn bowl(x: &[f64]) -> f64 {
    x.iter().map(|x| (x - 0.3).powi(2)).sum()
}

#[divan::bench(args = [6, 12])]
fn e_direct_alone(bencher: Bencher<'_, '_>, dimension: usize) {
    bencher.bench(|| {
        let mut direct = search(dimension);
        while let Some(batch) = direct.ask() {
            let values: Vec<f64> = batch.iter().map(bowl).collect();
            direct.tell(&values).expect("as many values as points");
        }
        direct.evaluations()
    });
}

/// What of [`e_direct_alone`] is its objective's.
#[divan::bench(args = [6, 12])]
fn f_objective_alone(bencher: Bencher<'_, '_>, dimension: usize) {
    let (mut direct, mut batches) = (search(dimension), Vec::new());
    while let Some(batch) = direct.ask() {
        let values: Vec<f64> = batch.iter().map(bowl).collect();
        batches.push(batch.iter().flatten().copied().collect::<Vec<f64>>());
        direct.tell(&values).expect("as many values as points");
    }
    bencher.bench(|| {
        let values = |batch: &Vec<f64>| batch.chunks_exact(dimension).map(bowl).collect::<Vec<f64>>();
        batches.iter().map(|batch| black_box(values(batch)).len()).sum::<usize>()
    });
}
