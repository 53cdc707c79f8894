//! What measurements cost the estimator of the learner `global`, after so many before them: what it has long explained
//! alone is compressed, so that the time stops growing. Ratios within one run are what counts.
//!
//! `cargo bench --bench smoother`

use std::hint::black_box;

use body_schema::{
    estimation::{Estimator, Smoother},
    model::Prior,
    scenario::builtin,
    sensing::{Observation, Rig},
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
const BEFORE: [usize; 5] = [20, 60, 120, 240, 480];
/// Measurements that are timed together: as many as lie between two compressions.
const TIMED: usize = 30;

type Seen = (Vec<f64>, Observation);

/// A smoother that has seen `before` random movements of an arm, and the next ones.
fn case(name: &str, before: usize) -> (Smoother, Vec<Seen>) {
    let scenario = builtin(name).expect("built in");
    let layout = scenario.robot.layout.clone();
    let deviations = scenario.prior.standard_deviations(&layout);
    let prior = Prior::with_deviations(scenario.robot.state.clone(), &layout, &deviations).expect("a prior");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let sigma_m = scenario.smoother.sigma;
    let mut seen: Vec<Seen> = (0..before + TIMED)
        .map(|_| {
            let limits = scenario.robot.limits.joints();
            let theta: Vec<f64> = limits.iter().map(|&(lower, upper)| rng.random_range(lower..upper)).collect();
            let noise = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
            let marker = scenario.robot.state.marker_at(&theta) + sigma_m * noise;
            (theta, Observation::seen(marker))
        })
        .collect();
    let next = seen.split_off(before);
    let settings = scenario.smoother.hypotheses;
    let mut smoother = Smoother::new(prior, layout.into(), Rig::tracker(sigma_m).into(), settings, rng);
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
    time(bencher, "arm-6dof", before);
}

#[divan::bench(args = BEFORE, sample_count = 20)]
fn b_thirty_measurements_of_12_joints_after(bencher: Bencher<'_, '_>, before: usize) {
    time(bencher, "arm-12dof", before);
}

fn time(bencher: Bencher<'_, '_>, name: &str, before: usize) {
    let (smoother, next) = case(name, before);
    bencher.counter(ItemsCount::new(TIMED)).with_inputs(|| smoother.clone()).bench_local_values(|mut smoother| {
        observe(&mut smoother, black_box(&next));
        smoother
    });
}
