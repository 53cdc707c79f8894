//! Calibrations of made-up robots, where the truth is known.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

mod branches;
mod lenses;
mod pictures;
mod rows_needed;

use super::{Calibration, Case, Figures, Options, Report, Silent, Unit, calibrate};
use body_schema_robot::{Chain, Urdf};
use body_schema_scenario::{Scenario, builtin};

const UR10: &str = include_str!("../../../scenarios/ur10.urdf");

/// Real robots with a ball in sockets, by scenario, and the places where they were measured.
pub(super) const REAL: [(&str, &[&str]); 2] = [
    (
        "panda-sockets",
        &["back_left", "back_right", "front_center", "front_left", "front_right", "mid-high", "mid_left", "mid_right"],
    ),
    ("kinova-sockets", &["front", "front_rotated", "left", "right-high"]),
];

/// One of them that learns at a place, by a criterion.
pub(super) fn learned_at(name: &str, place: &str, criterion: &str) -> Scenario {
    let shipped = builtin(name).expect("built in");
    let mut lines: Vec<String> = shipped.source.lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("train = ") {
            *line = format!("train = [\"{place}\"]");
        } else if line.starts_with("criterion = ") {
            *line = criterion.to_owned();
        }
    }
    Scenario::parse("real.toml", &lines.join("\n"), &|file| shipped.data_file(file)).expect("valid")
}

/// One of them with the rows of a place alone.
pub(super) fn of_one_place(name: &str, place: &str) -> Scenario {
    let shipped = builtin(name).expect("built in");
    let mut lines: Vec<&str> = shipped.source.lines().filter(|line| !line.starts_with("train = ")).collect();
    let held_out = lines.iter().position(|line| line.starts_with("by = ")).expect("places are held out");
    lines[held_out] = "rows = []";
    let open = |file: &str| {
        let text = shipped.data_file(file)?;
        let (titles, rows) = text.split_once('\n').expect("titles");
        let rows = rows.lines().filter(|row| !file.ends_with(".csv") || row.split(',').any(|cell| cell == place));
        Ok(if file.ends_with(".csv") { format!("{titles}\n{}\n", rows.collect::<Vec<_>>().join("\n")) } else { text })
    };
    Scenario::parse("one-place.toml", &lines.join("\n"), &open).expect("valid")
}

/// A robot of so many joints that turn about x, y or z of frames that stand anywhere.
fn random_urdf(joints: usize, rng: &mut ChaCha8Rng) -> String {
    let link = |index: usize| match index {
        0 => "base_link".to_owned(),
        index if index == joints => "tool0".to_owned(),
        index => format!("l{index}"),
    };
    let mut urdf = "<robot name=\"made\">".to_owned();
    (0..=joints).for_each(|index| urdf += &format!("<link name=\"{}\"/>", link(index)));
    for index in 0..joints {
        let mut draw = |most: f64| Vector3::from_fn(|_, _| rng.random_range(-most..most));
        let ([x, y, z], turn): ([f64; 3], _) = (draw(0.3).into(), draw(1.5));
        // Half of all joints are parallel to the one before or at a right angle to it, as most are.
        let [roll, pitch, yaw]: [f64; 3] = if rng.random_bool(0.5) { [0.0; 3] } else { turn.into() };
        let axis = ["1 0 0", "0 1 0", "0 0 1"][rng.random_range(0..3)];
        urdf += &format!(
            "<joint name=\"j{index}\" type=\"revolute\"><origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>\
             <parent link=\"{}\"/><child link=\"{}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>",
            link(index),
            link(index + 1)
        );
    }
    urdf + "</robot>"
}

/// A robot, and a table of it.
struct Made {
    urdf: String,
    chain: Chain,
    rows: Vec<(Vec<f64>, Vector3<f64>)>,
    later: Vec<(Vec<f64>, Vector3<f64>)>,
}

/// What is wrong with a description, link by link, and how far readings are off, metres.
#[derive(Clone, Copy)]
enum Kind {
    /// Origins are off by 5 mm and 0.01 rad each, readings by 0.15 mm.
    Offsets,
    /// Nothing; readings are off by 1.2 mm.
    Right,
    /// As `Offsets`, and readings are exact.
    Exact,
}

/// Puts the origins of joints off, by these standard deviations of each coordinate.
fn put_off(chain: &mut Chain, shift_m: f64, turn_rad: f64, rng: &mut ChaCha8Rng) {
    let mut normal = |sd: f64| Vector3::from_fn(|_, _| sd * rng.sample::<f64, _>(StandardNormal));
    for segment in chain.segments.iter_mut().filter(|segment| segment.kind.moves().is_some()) {
        let (shift, turn) = (normal(shift_m), normal(turn_rad));
        segment.origin *= Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn));
    }
}

fn made(urdf: String, kind: Kind, seed: u64, rows: usize) -> Made {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut chain = Urdf::parse(&urdf).and_then(|urdf| urdf.chain("base_link", "tool0")).expect("a chain");
    let (scale, sigma) = match kind {
        Kind::Offsets => (1.0, 0.15e-3),
        Kind::Right => (0.0, 1.2e-3),
        Kind::Exact => (1.0, 0.0),
    };
    put_off(&mut chain, scale * 0.005, scale * 0.01, &mut rng);
    let joints = chain.moving().count();
    let marker = Point3::new(0.03, 0.02, 0.04);
    let mut draw = |noise: f64| {
        let configuration: Vec<f64> = (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect();
        let error = Vector3::from_fn(|_, _| noise * rng.sample::<f64, _>(StandardNormal));
        let seen = (chain.tip_at(&configuration) * marker).coords + error;
        (configuration, seen)
    };
    let (rows, later) = ((0..rows).map(|_| draw(sigma)).collect(), (0..60).map(|_| draw(0.0)).collect());
    Made { urdf, rows, later, chain }
}

fn table(rows: &[(Vec<f64>, Vector3<f64>)], names: &[String]) -> String {
    let cells = |(configuration, seen): &(Vec<f64>, Vector3<f64>)| {
        configuration.iter().chain(seen.iter()).map(f64::to_string).collect::<Vec<_>>().join(",")
    };
    std::iter::once(format!("{},x,y,z", names.join(","))).chain(rows.iter().map(cells)).collect::<Vec<_>>().join("\n")
}

fn scenario(made: &Made, held_out: &str) -> Scenario {
    let names: Vec<String> = made.chain.moving().map(|segment| segment.name.clone()).collect();
    let toml = format!(
        "name = \"made\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\n[[target]]\nname = \"marker\"\n\
         [[sensor]]\nchannel = \"position\"\nsigma_m = 0.0005\ncolumns = [\"x\", \"y\", \"z\"]\n[measurements]\nfile = \"rows.csv\"\n\
         [held_out]\n{held_out}\n"
    );
    let open = |file: &str| match file {
        "robot.urdf" => Ok(made.urdf.clone()),
        "rows.csv" => Ok(table(&made.rows, &names)),
        _ => Ok(table(&made.later, &names)),
    };
    Scenario::parse("made.toml", &toml, &open).unwrap_or_else(|error| panic!("{error}"))
}

/// Every error, noise and correction of a report.
fn figures(report: &Report) -> Vec<f64> {
    let held_out = report.held_out.clone().expect("held out");
    let of = [&held_out.before, &held_out.after, &held_out.full_model, &report.training.before, &report.training.after];
    let mut all: Vec<f64> = of.iter().flat_map(|it| it.told(Unit::Millimetres)).flatten().collect();
    all.push(report.noise[0].explaining_sigma.expect("learned"));
    let norm = |it: [f64; 3]| Vector3::from(it).norm();
    all.extend(report.joints.iter().flat_map(|joint| [norm(joint.shift_mm), norm(joint.turn_deg)]));
    all
}

/// One row of thirty that went wrong, whatever it says, changes no error, no noise and no correction: it is told by name.
#[test]
fn a_row_that_went_wrong_counts_for_nothing() {
    type Ruin = (&'static str, fn(f64) -> f64);
    let cases: [(u64, usize, [Ruin; 2]); 2] = [
        (1, 0, [("-9999", |_| -9999.0), ("millimetres", |x| x * 1e3)]),
        (2, 13, [("zeros", |_| 0.0), ("1e9", |x| x * 1e9)]),
    ];
    for (seed, at, ruined) in cases {
        let made = made(UR10.to_owned(), Kind::Offsets, seed, 30);
        // Every row in the fold that it has with all thirty.
        let calibrated = |ruin: &dyn Fn(&mut Option<Vec<f64>>)| -> Report {
            let scenario = scenario(&made, "folds = 5");
            let mut case = Case::new(&scenario).expect("measured");
            ruin(&mut case.rows[at].observation.readings[0]);
            let Calibration { report, .. } = calibrate(&case, &Options::default(), &Silent).expect("calibrated");
            report
        };
        let without = calibrated(&|reading| *reading = None);
        assert!(without.outliers.is_empty() && without.doubts.is_empty(), "{:?}", without.doubts);
        let wanted = figures(&without);
        for (name, ruin) in ruined {
            let with = calibrated(&|reading| reading.iter_mut().flatten().for_each(|x| *x = ruin(*x)));
            assert_eq!(with.outliers.iter().map(|it| it.row - 1).collect::<Vec<_>>(), [at], "{name}, seed {seed}");
            let found = figures(&with);
            let near = found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() <= 0.05 * b.abs());
            assert!(near && found.len() == wanted.len(), "{name}, seed {seed}: {found:?} {wanted:?}");
        }
    }
}

/// Readings without any noise, as of a simulator: none is an outlier beside others that are explained to a digit more, and what
/// they determine is found.
#[test]
fn exact_readings_reject_none() {
    for seed in 1001..1031 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (joints, rows) = (rng.random_range(2..=6), rng.random_range(15..30));
        let made = made(random_urdf(joints, &mut rng), Kind::Exact, seed, rows);
        let scenario = scenario(&made, "folds = 5");
        let case = Case::new(&scenario).expect("measured");
        for split in case.splits(None).expect("as the file says") {
            let nominal = case.nominal(&split.training).expect("fitted");
            for near in [None, Some(nominal.state())] {
                let fit = case.fit(&case.writable(), &split.training, near).expect("fitted");
                let worst = Figures::of(&case.residuals(&fit, &split.held_out)).max_mm.expect("lengths");
                assert!(fit.suspected().is_empty(), "seed {seed}, {rows} rows: {:?}", fit.suspected());
                assert!(worst < 0.01, "seed {seed}, {rows} rows: {worst} mm");
            }
        }
    }
}

/// Two real robots with a ball in sockets, learned from eight rows of each place in turn: nothing is measured but that the ball was there,
/// and elsewhere they meet themselves better than as they are described.
#[test]
fn eight_rows_in_sockets_make_nothing_worse() {
    for ((name, places), most) in REAL.into_iter().zip([0.25, 1.0]) {
        let [mut nominal, mut learned] = [0.0; 2];
        for place in places {
            let scenario = learned_at(name, place, "criterion = \"d\"");
            let case = Case::new(&scenario).expect("measured");
            let splits = case.splits(None).expect("as the file says");
            let training = &splits[0].training;
            let eight: Vec<usize> = (0..8).map(|index| training[index * training.len() / 8]).collect();
            let before = case.nominal(&eight).expect("fitted");
            let after = case.fit(&case.writable(), &eight, Some(before.state())).expect("fitted");
            let mean = |fit| Figures::of(&case.residuals(fit, &splits[0].held_out)).mean().expect("lengths");
            nominal += mean(&before);
            learned += mean(&after);
        }
        assert!(learned <= most * nominal, "{name}: {nominal} to {learned} mm, summed over its places");
    }
}

/// With few rows, too, a description that is right stays right, and one that is off link by link is mended: medians of draws.
#[test]
fn few_rows_make_nothing_worse() {
    for (kind, seeds, most) in [(Kind::Right, 1001..1041, [1.1, 1.1]), (Kind::Offsets, 1001..1021, [0.5, 0.2])] {
        for (rows, most) in [8, 12].into_iter().zip(most) {
            let ratio = |seed: u64| {
                let made = made(UR10.to_owned(), kind, seed, rows);
                let scenario = scenario(&made, "file = \"later.csv\"");
                let case = Case::new(&scenario).expect("measured");
                let split = case.splits(None).expect("as the file says").remove(0);
                let nominal = case.nominal(&split.training).expect("fitted");
                let fit = case.fit(&case.writable(), &split.training, Some(nominal.state())).expect("fitted");
                let mean = |fit| Figures::of(&case.residuals(fit, &split.held_out)).mean().expect("lengths");
                mean(&fit) / mean(&nominal)
            };
            let mut ratios: Vec<f64> = seeds.clone().map(ratio).collect();
            ratios.sort_by(f64::total_cmp);
            let median = ratios[ratios.len() / 2];
            assert!(median < most, "{rows} rows: {median} of nominal");
        }
    }
}

/// Eight rows of a UR10 whose origins are off by some millimetres and that stands elsewhere, with 0.5 mm of noise.
const EIGHT: &str = "shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint,x,y,z\n\
    -0.5191,1.7066,-1.4442,0.1328,0.7545,-1.3756,1.64798,-0.45296,1.21946\n\
    0.3700,-0.7515,-1.2806,-0.1644,-0.8063,-0.6310,1.91319,1.02414,2.39610\n\
    -1.5950,1.5857,-0.8908,1.8687,-1.0436,-0.9012,1.08330,-0.35135,1.44201\n\
    1.5477,1.5100,1.7565,-0.4148,-0.8889,-1.0262,0.84333,0.18183,1.59448\n\
    0.3530,0.5891,-1.0586,0.6024,-1.8439,-0.9614,2.15579,0.03148,1.69322\n\
    1.3845,1.5389,0.7549,0.2336,1.5286,1.1288,0.72220,-0.24711,1.03303\n\
    -0.0890,0.2739,0.2932,0.0164,1.9765,-1.2980,2.05852,-0.62197,1.63246\n\
    0.6344,0.4699,1.5147,1.6181,-1.5541,0.6603,1.78765,-0.03020,1.06360\n";

/// A fit that starts where the description fits to 7 mm does not end with all rows for outliers and the base where it was guessed.
#[test]
fn rows_are_not_all_outliers() {
    let toml = "name = \"eight\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\n[[target]]\nname = \"marker\"\n\
         [[sensor]]\nchannel = \"position\"\nsigma_m = 0.0005\ncolumns = [\"x\", \"y\", \"z\"]\n[measurements]\nfile = \"rows.csv\"\n\
         [held_out]\nrows = []\n";
    let open = |file: &str| Ok(if file == "rows.csv" { EIGHT } else { UR10 }.to_owned());
    let scenario = Scenario::parse("eight.toml", toml, &open).unwrap_or_else(|error| panic!("{error}"));
    let case = Case::new(&scenario).expect("measured");
    let Calibration { report, fit, .. } =
        calibrate(&case, &Options { folds: Some(0), active: None }, &Silent).expect("calibrated");
    let [before, after] = [report.training.before, report.training.after].map(|it| it.mean_mm.expect("lengths"));
    assert!(after < before, "{after} instead of {before} mm");
    assert!(2 * fit.suspected().len() <= 8, "{:?}", fit.suspected());
}
