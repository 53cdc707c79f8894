//! What the best design of 40 movements costs, with its certificate. Ratios within one run are what counts, and those
//! against an older commit.
//!
//! `cargo bench --no-default-features --bench design`
//!
//! The design's trace, its gap and how many poses it has go to the standard error: time means nothing without them.

use std::sync::Once;

use body_schema::scenario::builtin;
use divan::Bencher;

fn main() {
    divan::main();
}

const MOVEMENTS: usize = 40;
/// As `best_designs` asks for it.
const GAP: f64 = 0.01;

#[divan::bench(args = ["arm-6dof", "arm-12dof", "arm-20dof", "head-fov"], sample_count = 3, sample_size = 1)]
fn best_design(bencher: Bencher<'_, '_>, name: &str) {
    let problem = builtin(name).expect("built in").design_problem().expect("simulated, with noise");
    let told = Once::new();
    bencher.bench_local(|| {
        let design = problem.best_design(MOVEMENTS, GAP).expect("informative");
        told.call_once(|| {
            eprintln!("{name}: trace {:.6e}, gap {:.2e}, {} poses", design.trace, design.gap, design.poses.len())
        });
        design
    });
}
