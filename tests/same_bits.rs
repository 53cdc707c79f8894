//! The same bits from every processor: whole runs with plainer and wider instructions, on one thread and on two.

mod runs;

use body_schema::{Instructions, use_at_most};

use runs::{RUNS, result};

#[test]
fn results_are_the_same_whatever_the_instructions_and_the_threads() {
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let (one, two) = (pool(1), pool(2));
    for run in RUNS {
        use_at_most(Instructions::Baseline);
        let expected = one.install(|| result(run));
        for instructions in [Instructions::Sse4_2, Instructions::Avx2, Instructions::Widest] {
            use_at_most(instructions);
            let found = two.install(|| result(run));
            let first = expected.bytes().zip(found.bytes()).position(|(a, b)| a != b);
            let around =
                |text: &str| first.map(|at| text[at.saturating_sub(200)..(at + 40).min(text.len())].to_owned());
            assert!(expected == found, "{}, {instructions:?}: {:?} {:?}", run.0, around(&expected), around(&found));
        }
    }
}

/// Writes what comes of every run for others to compare: `tests/same_bits/wasm/run` does.
#[test]
#[ignore = "for tests/same_bits/wasm/run"]
fn results_are_written() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits");
    std::fs::create_dir_all(&folder).expect("a folder");
    for run in RUNS {
        std::fs::write(folder.join(format!("{}.json", run.0)), result(run)).expect("written");
    }
}
