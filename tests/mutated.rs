//! Files and bodies that are nearly right. The short form of `fuzz/`: the same functions, for a few seconds.

mod entries;

use std::fs;

use proptest::{
    collection::vec,
    prelude::*,
    sample::select,
    test_runner::{RngAlgorithm, TestRng, TestRunner},
};

/// What often stands at the edge of what is read.
const WORDS: [&str; 22] = [
    "",
    "0",
    "-1",
    "1e308",
    "1e-320",
    "nan",
    "inf",
    "9223372036854775808",
    "null",
    "true",
    "\"",
    "[",
    "]",
    "{",
    "}",
    "\n",
    ",",
    "=",
    "<",
    "/>",
    "\u{0}",
    "é",
];

/// A change to a text: where, as a part of its length, how much goes, and what comes.
type Edit = (f64, usize, &'static str);

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    vec((0.0..1.0, 0..12_usize, select(&WORDS[..])), 1..5)
}

fn mutated(seed: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for (at, goes, comes) in edits {
        let from = ((bytes.len() as f64 * at) as usize).min(bytes.len());
        let to = (from + goes).min(bytes.len());
        bytes.splice(from..to, comes.bytes());
    }
    bytes
}

/// The files of this repository that end so, as long as nobody minds trying them often.
fn seeds(folder: &str, end: &str) -> Vec<Vec<u8>> {
    let folder = format!("{}/{folder}", env!("CARGO_MANIFEST_DIR"));
    let files = fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("a file").path());
    let mut files: Vec<_> = files.filter(|file| file.to_string_lossy().ends_with(end)).collect();
    files.sort();
    let seeds: Vec<_> =
        files.iter().map(|file| fs::read(file).expect("a file")).filter(|file| file.len() < 40_000).collect();
    assert!(!seeds.is_empty(), "{folder}");
    seeds
}

/// The same changes each time: `fuzz/` is for new ones.
fn each(seeds: &[Vec<u8>], cases: u32, entry: fn(&[u8])) {
    seeds.iter().for_each(|seed| entry(seed));
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let tried = runner.run(&(0..seeds.len(), edits()), |(seed, edits)| {
        entry(&mutated(&seeds[seed], &edits));
        Ok(())
    });
    tried.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn scenarios() {
    each(&seeds("scenarios", ".toml"), 600, entries::scenario);
}

#[test]
fn calibrations() {
    let keys = "[robot]\nurdf = \"two.urdf\"\nbase = \"wall\"\ntip = \"hand\"\n[sensor]\nchannel = \"position\"\nsigma_m = 0.001\n\
                [[target]]\nname = \"marker\"\nat_m = [0.0, 0.0, 0.1]\nknown = { to_m = 0.02 }\n\
                [prior]\ndirection_rad = 0.05\npoint_m = 0.01\n[settled]\nexpected_prediction_m = 0.002\n";
    each(&[keys.into()], 150, entries::calibration);
}

#[test]
fn descriptions() {
    let mut seeds = seeds("tests/urdf/robots", ".urdf");
    seeds.push(entries::URDF.into());
    each(&seeds, 600, entries::urdf);
}

#[test]
fn tables() {
    let mut seeds = seeds("scenarios", ".csv");
    seeds.push(entries::TABLE.into());
    each(&seeds, 600, entries::table);
}

#[test]
fn bodies() {
    each(&seeds("tests/mutated/bodies", ".json"), 300, entries::body);
}

#[test]
fn events() {
    each(&seeds("tests/mutated", "events.json"), 150, entries::events);
}

/// Recordings are read back by `repair` and by pages that follow late.
#[test]
fn recordings() {
    use body_schema::{
        recording::{Recorder, Target},
        scenario::builtin,
        wire::{Description, StepReport},
    };

    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.rrd");
    let mut experiment =
        builtin("arm-6dof").expect("built in").experiment(1, Some(&["random".to_owned()])).expect("valid");
    let mut recorder = Recorder::new(&Description::of(&experiment), Target::file(&whole)).expect("a recorder");
    recorder.log(&StepReport::of(&experiment)).expect("recorded");
    for _ in 0..3 {
        experiment.step().expect("a step");
        recorder.log(&StepReport::of(&experiment)).expect("recorded");
    }
    recorder.finish().expect("finished");
    let whole = fs::read(whole).expect("the recording");
    let broken_off = [0.2, 0.5, 0.9, 0.999].map(|part| whole[..(whole.len() as f64 * part) as usize].to_vec());
    // Lengths that Arrow's reader believes are among what a single byte decides.
    for place in (0..whole.len()).step_by(whole.len() / 150) {
        let mut damaged = whole.clone();
        damaged[place] = b'0';
        entries::recording(&damaged);
    }
    each(&[&[whole], &broken_off[..]].concat(), 60, entries::recording);
}
