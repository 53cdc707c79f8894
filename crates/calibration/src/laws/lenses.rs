//! Calibrations by pictures of a board through a lens, where the truth is known.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{UR10, put_off};
use crate::{Case, Fit, Options, Silent, calibrate, misfit::misfit};
use body_schema_engine::model::{Distortion, DistortionModel, Frame};
use body_schema_robot::{Chain, Urdf};
use body_schema_scenario::Scenario;

const CAMERA: [f64; 3] = [2.6, 0.3, 0.9];
const FOCAL_PX: f64 = 800.0;
const SIZE_PX: [f64; 2] = [1280.0, 960.0];
const SIGMA_PX: f64 = 0.2;
const K1: f64 = -0.3;

/// A robot whose origins are off, and the postures in which its board is in the picture, through the lens too.
struct Made {
    truth: Chain,
    postures: Vec<Vec<f64>>,
    later: Vec<Vec<f64>>,
}

/// A board of three columns.
fn board(points: usize) -> Vec<Point3<f64>> {
    (0..points).map(|k| Point3::new(0.06 * (k % 3) as f64 - 0.06, 0.06 * (k / 3) as f64 - 0.06, 0.03)).collect()
}

fn lens() -> Distortion {
    Distortion::new(DistortionModel::BrownConrady, &[K1, 0.0, 0.0, 0.0]).expect("a lens")
}

/// A point of the board in the camera's frame.
fn seen_from_camera(truth: &Chain, posture: &[f64], point: &Point3<f64>) -> Vector3<f64> {
    let eye = Vector3::from(CAMERA);
    let forward = -eye.normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let camera = Isometry3::from_parts(eye.into(), rotation);
    (camera.inverse() * (truth.tip_at(posture) * point)).coords
}

/// The pixel of a point, and whether that is in the picture.
fn pixel(at: &Vector3<f64>, lens: Option<&Distortion>) -> ([f64; 2], bool) {
    let place = lens.map_or_else(|| at.xy() / at.z, |lens| lens.image(at).at);
    let pixel = [FOCAL_PX * place.x + 0.5 * SIZE_PX[0], FOCAL_PX * place.y + 0.5 * SIZE_PX[1]];
    let inside = pixel.iter().zip(SIZE_PX).all(|(x, size)| (0.0..size).contains(x));
    (pixel, at.z > 0.0 && inside && lens.is_none_or(|lens| lens.holds(at)))
}

impl Made {
    fn new(seed: u64, rows: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Urdf::parse(UR10).and_then(|urdf| urdf.chain("base_link", "tool0")).expect("a chain");
        put_off(&mut truth, 0.002, 0.004, &mut rng);
        let joints = truth.moving().count();
        let all = |posture: &[f64]| {
            board(12).iter().all(|point| {
                let at = seen_from_camera(&truth, posture, point);
                pixel(&at, None).1 && pixel(&at, Some(&lens())).1
            })
        };
        let draws = std::iter::repeat_with(|| (0..joints).map(|_| rng.random_range(-3.0..3.0)).collect::<Vec<f64>>());
        let mut postures: Vec<Vec<f64>> = draws.filter(|posture| all(posture)).take(rows + 200).collect();
        let later = postures.split_off(rows);
        Self { truth, postures, later }
    }

    fn table(&self, points: usize, lens: Option<&Distortion>, is_half_absent: bool, rng: &mut ChaCha8Rng) -> String {
        let titles = (1..=points).map(|k| format!(",eye_board_u{k},eye_board_v{k}")).collect::<String>();
        let mut text = self.truth.names().join(",") + &titles + "\n";
        for posture in &self.postures {
            text += &posture.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            let mut is_absent: Vec<bool> = (0..points).map(|k| is_half_absent && 2 * k < points).collect();
            is_absent.shuffle(rng);
            for (point, is_absent) in board(points).iter().zip(is_absent) {
                let (pixel, _) = pixel(&seen_from_camera(&self.truth, posture, point), lens);
                let [u, v] = pixel.map(|x| x + SIGMA_PX * rng.sample::<f64, _>(StandardNormal));
                text += &if is_absent { ",,".to_owned() } else { format!(",{u},{v}") };
            }
            text += "\n";
        }
        text
    }

    fn scenario(&self, points: usize, keys: [&str; 2], table: &str) -> Scenario {
        let list: Vec<[f64; 3]> = board(points).iter().map(|point| point.coords.into()).collect();
        let [of_target, of_camera] = keys;
        let text = format!(
            "name = \"board\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\nreading_sigma_deg = 0.0\n\
             [base]\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n\
             [[target]]\nname = \"board\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\npoints_m = {list:?}\n\
             known = {{ to_m = 0.02, to_deg = 2.0 }}\n{of_target}\n\
             [[camera]]\nname = \"eye\"\nat_m = {CAMERA:?}\nlooks_at_m = [0.0, 0.0, 0.0]\nsize_px = {SIZE_PX:?}\n\
             focal_px = {FOCAL_PX:?}\n{of_camera}\n\
             [[sensor]]\nchannel = \"pixels\"\nsigma_px = {SIGMA_PX:?}\n\
             [measurements]\nfile = \"rows.csv\"\n[held_out]\nfolds = 5\n"
        );
        let open = |file: &str| Ok(if file == "robot.urdf" { UR10.to_owned() } else { table.to_owned() });
        Scenario::parse("board.toml", &text, &open).unwrap_or_else(|error| panic!("{error}"))
    }

    /// How far the hand is from where a fit has it in later postures, root mean square, metres.
    fn missed(&self, fit: &Fit) -> f64 {
        let board = board(12)[0];
        let square = |posture: &Vec<f64>| {
            let found = fit.state().frame_at(Frame::Target(0), posture) * board;
            (found - self.truth.tip_at(posture) * board).norm_squared()
        };
        (self.later.iter().map(square).sum::<f64>() / self.later.len() as f64).sqrt()
    }
}

/// What is learned from all rows.
fn fitted(case: &Case<'_>) -> Fit {
    let rows: Vec<usize> = (0..case.rows.len()).collect();
    case.fit(&case.writable(), &rows, None).expect("fitted")
}

/// A board of twelve points of which a random half is seen, through a lens whose k1 is known or learned, tells as much as a board of
/// six that is seen whole by a pinhole.
#[test]
fn half_a_board_through_a_lens_is_as_good_as_a_whole_one() {
    let (mut half, mut learned, mut whole) = (0.0, 0.0, 0.0);
    for seed in 1001..1013 {
        let made = Made::new(seed, 24);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let table = made.table(12, Some(&lens()), true, &mut rng);
        let partly = "partly_seen = true\nleast_points = 4";
        let known = made.scenario(12, [partly, &format!("distortion = [{K1:?}, 0.0, 0.0, 0.0]")], &table);
        half += made.missed(&fitted(&Case::new(&known).expect("measured")));
        let to_learn = made.scenario(12, [partly, "learn_distortion_to = [0.5, 0.0, 0.0, 0.0]"], &table);
        let case = Case::new(&to_learn).expect("measured");
        let fit = fitted(&case);
        learned += made.missed(&fit);
        let [k1] = case.lenses(&fit)[1].clone().try_into().expect("one coefficient");
        assert_eq!((k1.camera.as_str(), k1.name.as_str()), ("eye", "k1"));
        assert!((k1.value - K1).abs() < 5.0 * k1.sd && k1.sd < 0.01, "{k1:?}");
        let plain = made.scenario(6, ["", ""], &made.table(6, None, false, &mut rng));
        whole += made.missed(&fitted(&Case::new(&plain).expect("measured")));
    }
    assert!(half < 1.2 * whole && learned < 1.2 * whole, "{half} {learned} {whole}");
}

/// What is measured is predicted by half a board of twelve points, seen through a lens that is known, as well as by all twelve without a lens: held
/// out, 1.2 times the error at most. (Where the hand truly is, half as many points tell √2 as badly at best.)
#[test]
fn half_a_board_through_a_lens_predicts_pictures_as_well_as_the_whole_one_without() {
    let held_out = |scenario: &Scenario| {
        let case = Case::new(scenario).expect("measured");
        let report =
            calibrate(&case, &Options { folds: Some(3), ..Options::default() }, &Silent).expect("calibrated").report;
        report.held_out.expect("folds").after.rms_px.expect("pixels")
    };
    let (mut half, mut whole) = (0.0, 0.0);
    for seed in 1021..1024 {
        let made = Made::new(seed, 24);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let keys = ["partly_seen = true\nleast_points = 4", &format!("distortion = [{K1:?}, 0.0, 0.0, 0.0]")];
        half += held_out(&made.scenario(12, keys, &made.table(12, Some(&lens()), true, &mut rng)));
        whole += held_out(&made.scenario(12, ["", ""], &made.table(12, None, false, &mut rng)));
    }
    assert!(half < 1.2 * whole, "{half} {whole}");
}

/// The lens left out, the description does not fit, and that is told.
#[test]
fn a_lens_that_is_left_out_is_a_misfit() {
    let made = Made::new(1004, 24);
    let table = made.table(12, Some(&lens()), true, &mut ChaCha8Rng::seed_from_u64(1004));
    let told = |camera: &str| {
        let scenario = made.scenario(12, ["partly_seen = true", camera], &table);
        let case = Case::new(&scenario).expect("measured");
        let fit = fitted(&case);
        let noise = case.noise(&fit);
        let outliers = fit.readings.iter().filter(|reading| reading.weight < 0.5).count();
        let residuals = case.residuals(&fit, &fit.rows);
        assert_eq!(residuals.iter().flat_map(|it| &it.measured).filter(|x| x.is_nan()).count(), 24 * 12);
        assert!(residuals.iter().all(|it| it.norms.pixels.is_some_and(f64::is_finite)));
        assert!(
            (noise[0].degrees + fit.noise[0].absorbed - 24.0 * 12.0).abs() < 24.0,
            "{noise:?}: half of all numbers"
        );
        (misfit(&noise, None, outliers, case.rows.len()).is_some(), noise[0].explaining_sigma.expect("many"))
    };
    let (is_told, sigma) = told("");
    assert!(is_told, "{sigma} px");
    let (is_told, sigma) = told("distortion = [-0.3, 0.0, 0.0, 0.0]");
    assert!(!is_told && (sigma / SIGMA_PX - 1.0).abs() < 0.2, "{sigma} px");
}
