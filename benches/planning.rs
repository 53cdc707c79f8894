//! What a movement of the learner `global` costs: choosing it, with the movements that are still needed, and learning from
//! it. Ratios within one run are what counts, and those against an older commit.
//!
//! `cargo bench --bench planning`

use body_schema::{experiment::Experiment, scenario::builtin};
use divan::{Bencher, counter::ItemsCount};

fn main() {
    divan::main();
}

/// Movements of a run that are timed together, from the first on: those that a robot is learned by.
const MOVEMENTS: usize = 25;
const SEED: u64 = 1001;

#[divan::bench(args = ["arm-6dof", "arm-12dof", "arm-20dof"], sample_count = 5)]
fn a_run_of_global(bencher: Bencher<'_, '_>, name: &str) {
    let scenario = builtin(name).expect("built in");
    let begin = || scenario.experiment(SEED, Some(&["global".to_owned()])).expect("an experiment");
    bencher.counter(ItemsCount::new(MOVEMENTS)).with_inputs(begin).bench_local_values(|mut experiment: Experiment| {
        for _ in 0..MOVEMENTS {
            experiment.step().expect("a step");
        }
        experiment
    });
}
