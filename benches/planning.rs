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
/// Several, since runs differ by how long rivals last.
const SEEDS: std::ops::RangeInclusive<u64> = 1001..=1004;

#[divan::bench(args = ["arm-6dof", "arm-12dof", "arm-20dof"], sample_count = 1)]
fn a_run_of_global(bencher: Bencher<'_, '_>, name: &str) {
    let scenario = builtin(name).expect("built in");
    let begin = |seed| scenario.experiment(seed, Some(&["global".to_owned()])).expect("an experiment");
    let all = || SEEDS.map(begin).collect::<Vec<Experiment>>();
    let count = ItemsCount::new(MOVEMENTS * SEEDS.count());
    bencher.counter(count).with_inputs(all).bench_local_values(|mut runs: Vec<Experiment>| {
        for experiment in &mut runs {
            for _ in 0..MOVEMENTS {
                experiment.step().expect("a step");
            }
        }
        runs
    });
}
