//! What measurements cost the estimator of the learner `global`, after so many before them: what it has long explained
//! alone is compressed, so that the time stops growing; and what hypotheses cost while much is unknown. Ratios within one run
//! are what counts.
//!
//! `cargo bench --bench smoother`

use std::hint::black_box;

use body_schema::{
    estimation::{Estimator, HypothesisSettings, Smoother},
    model::Prior,
    scenario::builtin,
    sensing::{Loss, MeasurementModel, Observation},
};
use divan::{Bencher, counter::ItemsCount};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn main() {
    divan::main();
}

/// Measurements before the first that is timed.
const BEFORE: [usize; 6] = [20, 60, 120, 200, 480, 2000];
/// One in so many is an outlier, where there are any.
const OUTLIERS: usize = 10;
const HYPOTHESES: [usize; 5] = [1, 2, 4, 8, 16];
/// Measurements that are timed together: as many as lie between two compressions.
const TIMED: usize = 30;

type Seen = (Vec<f64>, Observation);

/// A smoother that has seen `before` random movements of an arm, and the next ones; with a loss that expects outliers there
/// are some. As many hypotheses as are asked for, or as the scenario says.
fn case(name: &str, before: usize, loss: Loss, hypotheses: Option<usize>) -> (Smoother, Vec<Seen>) {
    let scenario = builtin(name).expect("built in");
    let layout = scenario.robot.layout.clone();
    let deviations = scenario.prior.standard_deviations(&layout);
    let prior = Prior::with_deviations(scenario.robot.state.clone(), &layout, &deviations).expect("a prior");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let sigma_m = scenario.smoother.sigma;
    let mut seen: Vec<Seen> = (0..before + TIMED)
        .map(|index| {
            let limits = scenario.robot.limits.joints();
            let theta: Vec<f64> = limits.iter().map(|&(lower, upper)| rng.random_range(lower..upper)).collect();
            let noise = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
            let scatter = if loss != Loss::None && index % OUTLIERS == OUTLIERS - 1 { 50.0 * sigma_m } else { sigma_m };
            let marker = scenario.robot.state.marker_at(&theta) + scatter * noise;
            (theta, Observation::seen(marker))
        })
        .collect();
    let next = seen.split_off(before);
    let settings =
        hypotheses.map_or(scenario.smoother.hypotheses, |count| HypothesisSettings { spawned: count, kept: count });
    let mut smoother =
        Smoother::new(prior, layout.into(), MeasurementModel::tracker(sigma_m).into(), settings, rng).with_loss(loss);
    observe(&mut smoother, &seen);
    (smoother, next)
}

fn observe(smoother: &mut Smoother, seen: &[Seen]) {
    seen.iter().for_each(|(theta, observation)| {
        smoother.update(theta, observation).expect("an update");
    });
}

#[divan::bench(args = BEFORE, sample_count = 20)]
fn a_thirty_measurements_of_6_joints_after(bencher: Bencher<'_, '_>, before: usize) {
    time(bencher, case("arm-6dof", before, Loss::None, None));
}

#[divan::bench(args = BEFORE, sample_count = 20)]
fn b_thirty_measurements_of_12_joints_after(bencher: Bencher<'_, '_>, before: usize) {
    time(bencher, case("arm-12dof", before, Loss::None, None));
}

#[divan::bench(args = BEFORE, sample_count = 20)]
fn c_thirty_measurements_of_6_joints_with_outliers_after(bencher: Bencher<'_, '_>, before: usize) {
    time(bencher, case("arm-6dof", before, Loss::MIXTURE, None));
}

#[divan::bench(args = BEFORE, sample_count = 20)]
fn d_thirty_measurements_of_12_joints_with_outliers_after(bencher: Bencher<'_, '_>, before: usize) {
    time(bencher, case("arm-12dof", before, Loss::MIXTURE, None));
}

/// The first measurements of an arm of which nothing is known, with so many hypotheses searched for and kept.
#[divan::bench(args = HYPOTHESES, sample_count = 5)]
fn e_first_measurements_of_12_joints_by_hypotheses(bencher: Bencher<'_, '_>, count: usize) {
    time(bencher, case("arm-12dof-no-prior", 0, Loss::None, Some(count)));
}

fn time(bencher: Bencher<'_, '_>, (smoother, next): (Smoother, Vec<Seen>)) {
    bencher.counter(ItemsCount::new(TIMED)).with_inputs(|| smoother.clone()).bench_local_values(|mut smoother| {
        observe(&mut smoother, black_box(&next));
        smoother
    });
}
