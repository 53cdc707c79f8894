//! What the best design of 40 movements costs, with its certificate. Ratios within one run are what counts, and those
//! against an older commit.
//!
//! `RAYON_NUM_THREADS=1 cargo bench --bench design`
//!
//! `best_design` is certified to within 1 %, `rough_design` to within 8 %, which commit ca1285b reaches too. A design's trace, its gap
//! and how many poses it has go to the standard error: time means nothing without them.

use std::sync::Once;

use body_schema::scenario::builtin;
use divan::Bencher;

fn main() {
    divan::main();
}

const MOVEMENTS: usize = 40;
/// As `best_designs` asks for it.
const GAP: f64 = 0.01;
const ROUGH_GAP: f64 = 0.08;

#[divan::bench(args = ["arm-6dof", "arm-12dof", "arm-20dof", "head-fov"], sample_count = 3, sample_size = 1)]
fn best_design(bencher: Bencher<'_, '_>, name: &str) {
    certified(bencher, name, GAP);
}

#[divan::bench(args = ["arm-6dof", "arm-12dof", "arm-20dof"], sample_count = 3, sample_size = 1)]
fn rough_design(bencher: Bencher<'_, '_>, name: &str) {
    certified(bencher, name, ROUGH_GAP);
}

fn certified(bencher: Bencher<'_, '_>, name: &str, gap: f64) {
    let problem = builtin(name).expect("built in").design_problem().expect("simulated, with noise");
    let told = Once::new();
    bencher.bench_local(|| {
        let design = problem.best_design(MOVEMENTS, gap).expect("informative");
        told.call_once(|| {
            let poses = design.poses.len();
            eprintln!("{name}: trace {:.6e}, gap {:.2e} of {gap} asked, {poses} poses", design.trace, design.gap)
        });
        design
    });
}
