//! Tables of pixels that are read otherwise than they were written are told, by a camera beside the robot and by one on its hand.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{UR10, put_off};
use crate::Case;
use body_schema_diagnostics::{Diagnostic, DiagnosticKind};
use body_schema_robot::Urdf;
use body_schema_scenario::Scenario;

const FOCAL_PX: f64 = 800.0;
const SIZE_PX: [f64; 2] = [1280.0, 960.0];
const CENTRE: [f64; 2] = [640.0, 480.0];
const ROWS: usize = 50;
/// A tag of 12 cm, its corners counted as one who faces it sees them run to the left.
const TAG: [[f64; 3]; 4] = [[-0.06, -0.06, 0.0], [0.06, -0.06, 0.0], [0.06, 0.06, 0.0], [-0.06, 0.06, 0.0]];

/// A frame at `eye` whose z looks at a place, its y as far down as may be.
fn looking(eye: [f64; 3], at: [f64; 3]) -> Isometry3<f64> {
    let (eye, at) = (Vector3::from(eye), Vector3::from(at));
    let forward = (at - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    Isometry3::from_parts(eye.into(), UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Where {
    Beside,
    OnTheHand,
}

/// The rows of a table: joints, and the pixels of the four corners.
#[derive(Clone)]
struct Table {
    titles: Vec<String>,
    rows: Vec<(Vec<f64>, [[f64; 2]; 4])>,
    eye: Where,
}

impl Table {
    /// What a camera sees of a robot whose origins are off by 2 mm and 4 mrad.
    fn new(seed: u64, eye: Where) -> Self {
        Self::mounted(seed, eye, Isometry3::identity())
    }

    /// The same with a camera that is so on the hand, or stands so where it would else be.
    fn mounted(seed: u64, eye: Where, mount: Isometry3<f64>) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Urdf::parse(UR10).and_then(|urdf| urdf.chain("base_link", "tool0")).expect("a chain");
        put_off(&mut truth, 0.002, 0.004, &mut rng);
        let titles = truth.names();
        let mut rows = Vec::new();
        while rows.len() < ROWS {
            let posture: Vec<f64> = titles.iter().map(|_| rng.random_range(-2.5..2.5)).collect();
            let hand = truth.tip_at(&posture);
            let place = match eye {
                Where::Beside => looking([2.6, 0.3, 0.9], [0.0, 0.0, 0.3]).inverse() * hand,
                Where::OnTheHand => hand.inverse() * Isometry3::new(Vector3::new(0.9, 0.2, 0.1), Vector3::zeros()),
            };
            let place = mount.inverse() * place;
            let seen = TAG.map(|point| (place * Point3::from(point)).coords);
            let is_faced = (place.rotation * Vector3::z()).dot(&place.translation.vector.normalize()) < -0.4;
            let pixels = seen.map(|at| [0, 1].map(|k| FOCAL_PX * at[k] / at.z + CENTRE[k]));
            let is_inside = pixels.iter().all(|at| (0..2).all(|k| (5.0..SIZE_PX[k] - 5.0).contains(&at[k])));
            if is_faced && is_inside && seen.iter().all(|at| (0.25..3.5).contains(&at.z)) {
                let noisy = pixels.map(|at| at.map(|x| x + 0.2 * rng.sample::<f64, _>(StandardNormal)));
                rows.push((posture, noisy));
            }
        }
        Self { titles: titles.iter().map(ToString::to_string).collect(), rows, eye }
    }

    /// The table with its joints read otherwise.
    fn joints(&self, mut of: impl FnMut(&mut Vec<f64>)) -> Self {
        let mut other = self.clone();
        other.rows.iter_mut().for_each(|(joints, _)| of(joints));
        other
    }

    /// The table with its pixels read otherwise.
    fn pixels(&self, of: impl Fn(&mut [[f64; 2]; 4])) -> Self {
        let mut other = self.clone();
        other.rows.iter_mut().for_each(|(_, pixels)| of(pixels));
        other
    }

    /// The table with what is measured a row later than its joints.
    fn late(&self) -> Self {
        let mut late = self.clone();
        for row in (1..ROWS).rev() {
            late.rows[row].1 = late.rows[row - 1].1;
        }
        late
    }

    /// What is doubted.
    fn doubts(&self) -> Vec<(DiagnosticKind, Option<String>)> {
        let found: Vec<Diagnostic> = self.scenario("").examine().expect("measured").diagnostics;
        found.into_iter().map(|doubt| (doubt.kind, doubt.column)).collect()
    }

    /// The table with a file that says nothing of where camera and tag are.
    fn of_unknown_places(&self) -> Scenario {
        let (tag, camera) = match self.eye {
            Where::Beside => ("tool0", ""),
            Where::OnTheHand => ("base_link", "link = \"tool0\"\n"),
        };
        let tag = format!("[[target]]\nlink = \"{tag}\"\nknown = \"unknown\"\n");
        self.described("", &tag, &format!("[[camera]]\n{camera}known = \"unknown\"\n"), "")
    }

    /// The table with its file, which has so many keys more of the robot.
    fn scenario(&self, of_robot: &str) -> Scenario {
        let (of_tag, of_eye) = match self.eye {
            Where::Beside => (
                "link = \"tool0\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]",
                "at_m = [2.5, 0.4, 0.8]\nlooks_at_m = [0.0, 0.0, 0.3]",
            ),
            Where::OnTheHand => (
                "link = \"base_link\"\nat_m = [0.85, 0.2, 0.1]\nrpy_deg = [0.0, 0.0, 0.0]",
                "link = \"tool0\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]",
            ),
        };
        let tag = format!("[[target]]\n{of_tag}\nknown = {{ to_m = 0.1, to_deg = 10.0 }}\n");
        let camera = format!("[[camera]]\n{of_eye}\nknown = {{ to_m = 0.2, to_deg = 15.0 }}\n");
        let base = "[base]\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n";
        self.described(of_robot, &tag, &camera, base)
    }

    /// The table with what is said of its robot, tag, camera and base.
    fn described(&self, of_robot: &str, tag: &str, camera: &str, base: &str) -> Scenario {
        let pixels: String = (1..=4).map(|k| format!(",eye_tag_u{k},eye_tag_v{k}")).collect();
        let mut table = self.titles.join(",") + &pixels + "\n";
        let cell = |number: &f64| if number.is_nan() { String::new() } else { number.to_string() };
        for (joints, pixels) in &self.rows {
            let cells: Vec<String> = joints.iter().chain(pixels.iter().flatten()).map(cell).collect();
            table += &(cells.join(",") + "\n");
        }
        let text = format!(
            "name = \"pictures\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\n{of_robot}\n{base}\n\
             {tag}name = \"tag\"\npoints_m = {TAG:?}\nfacing = [0, 0, 1]\n\
             {camera}name = \"eye\"\nsize_px = {SIZE_PX:?}\nfocal_px = {FOCAL_PX:?}\n\
             [[sensor]]\nchannel = \"pixels\"\nsigma_px = 0.2\n\
             [measurements]\nfile = \"rows.csv\"\n[held_out]\nfolds = 5\n"
        );
        let open = |file: &str| Ok(if file == "robot.urdf" { UR10.to_owned() } else { table.clone() });
        Scenario::parse("pictures.toml", &text, &open).unwrap_or_else(|error| panic!("{error}"))
    }
}

#[test]
fn columns_that_are_read_otherwise_are_told_by_pixels() {
    for (seed, eye) in
        [(1001, Where::Beside), (1002, Where::OnTheHand), (1003, Where::Beside), (1004, Where::OnTheHand)]
    {
        let table = Table::new(seed, eye);
        assert_eq!(table.doubts(), [], "{eye:?} {seed}: nothing is wrong");
        let title = |joint: usize| Some(table.titles[joint].clone());
        let reversed = table.joints(|joints| joints[2] *= -1.0);
        assert_eq!(reversed.doubts(), [(DiagnosticKind::Sign, title(2))], "{eye:?} {seed}");
        let exchanged = table.joints(|joints| joints.swap(3, 4));
        assert_eq!(exchanged.doubts(), [(DiagnosticKind::Order, title(3))], "{eye:?} {seed}");
        let from_another_zero = table.joints(|joints| joints[2] += 0.4);
        assert_eq!(from_another_zero.doubts(), [(DiagnosticKind::Zero, title(2))], "{eye:?} {seed}");
        let degrees = table.joints(|joints| joints[1] = joints[1].to_degrees());
        assert_eq!(degrees.doubts().first(), Some(&(DiagnosticKind::Unit, title(1))), "{eye:?} {seed}");
        let late = table.late();
        assert!(late.doubts().contains(&(DiagnosticKind::Lag, None)), "{eye:?} {seed}: {:?}", late.doubts());
    }
}

/// A line on which nothing was seen was a moment, too.
#[test]
fn rows_that_are_late_are_told_between_pictures_without_a_tag() {
    for (seed, eye) in [(1010, Where::Beside), (1011, Where::OnTheHand)] {
        let mut late = Table::new(seed, eye).late();
        late.rows.iter_mut().skip(2).step_by(3).for_each(|(_, pixels)| *pixels = [[f64::NAN; 2]; 4]);
        assert!(late.doubts().contains(&(DiagnosticKind::Lag, None)), "{eye:?} {seed}: {:?}", late.doubts());
    }
}

/// Nobody knows where a camera is, beside the robot or on its hand, nor where the tag is.
#[test]
fn cameras_of_unknown_place_are_found() {
    for (seed, eye) in (1012..1020).flat_map(|seed| [(seed, Where::Beside), (seed, Where::OnTheHand)]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mount = match eye {
            Where::Beside => Isometry3::identity(),
            Where::OnTheHand => Isometry3::new(
                Vector3::from_fn(|_, _| rng.random_range(-0.1..0.1)),
                Vector3::from_fn(|_, _| 2.0 * rng.sample::<f64, _>(StandardNormal)),
            ),
        };
        let scenario = Table::mounted(seed, eye, mount).of_unknown_places();
        assert_eq!(scenario.examine().expect("measured").diagnostics, [], "{eye:?} {seed}: nothing is wrong");
        let case = Case::new(&scenario).expect("measured");
        let (held_out, training): (Vec<usize>, Vec<usize>) = (0..ROWS).partition(|row| row % 5 == 0);
        let fit = case.fit(&case.writable(), &training, None).expect("fitted");
        let residuals = case.residuals(&fit, &held_out);
        let pixels = residuals.iter().flat_map(|it| it.predicted.iter().zip(&it.measured));
        let off: Vec<f64> = pixels.map(|(predicted, measured)| (predicted - measured).powi(2)).collect();
        let off = (off.iter().sum::<f64>() / off.len() as f64).sqrt();
        assert!(off < 0.6, "{eye:?} {seed}: off by {off:.2} px, with noise of 0.2 px");
    }
}

#[test]
fn pictures_that_are_read_otherwise_are_told() {
    for (seed, eye) in
        [(1005, Where::Beside), (1006, Where::OnTheHand), (1007, Where::Beside), (1008, Where::OnTheHand)]
    {
        let table = Table::new(seed, eye);
        let kinds = |table: &Table| table.doubts().into_iter().map(|doubt| doubt.0).collect::<Vec<_>>();
        let from_below = table.pixels(|pixels| pixels.iter_mut().for_each(|at| at[1] = SIZE_PX[1] - at[1]));
        assert_eq!(kinds(&from_below), [DiagnosticKind::Mirror], "{eye:?} {seed}");
        let exchanged = table.pixels(|pixels| pixels.iter_mut().for_each(|at| at.swap(0, 1)));
        assert!(kinds(&exchanged).contains(&DiagnosticKind::Mirror), "{eye:?} {seed}: {:?}", exchanged.doubts());
        let backwards = table.pixels(|pixels| pixels.reverse());
        assert_eq!(kinds(&backwards), [DiagnosticKind::Mirror], "{eye:?} {seed}");
        let from_another_corner = table.pixels(|pixels| pixels.rotate_left(1));
        assert_eq!(kinds(&from_another_corner), [], "{eye:?} {seed}: the tag is turned, no more");
        let crosswise = table.pixels(|pixels| pixels.swap(2, 3));
        assert!(kinds(&crosswise).contains(&DiagnosticKind::Order), "{eye:?} {seed}: {:?}", crosswise.doubts());
        // A picture of half the size. Of a small tag that is so far from its camera a camera on the hand tells no rotation.
        let half = table.pixels(|pixels| pixels.iter_mut().flatten().for_each(|x| *x *= 0.5));
        assert!(eye == Where::OnTheHand || kinds(&half) == [DiagnosticKind::Misfit], "{seed}: {:?}", half.doubts());
    }
}

/// Where columns cannot be judged that is said: of few rows, and by a camera on the hand of a body that is small in its pictures.
#[test]
fn what_cannot_be_judged_is_said() {
    let [beside, table] = [Where::Beside, Where::OnTheHand].map(|eye| Table::new(1009, eye));
    let unjudged = |table: &Table| table.scenario("").examine().expect("measured").unjudged;
    assert_eq!((unjudged(&beside), unjudged(&table)), (None, None));
    let mut few = beside.clone();
    few.rows.truncate(5);
    assert_eq!(unjudged(&few).as_deref(), Some("5 rows have a reading, and it takes 6"));
    let far = table.pixels(|pixels| {
        pixels.iter_mut().for_each(|at| (0..2).for_each(|k| at[k] = CENTRE[k] + 0.3 * (at[k] - CENTRE[k])))
    });
    let said = unjudged(&far).expect("too small");
    assert!(
        said.contains("pictures of `eye_tag_u1 … eye_tag_v4` tell within 6 degrees how the body is turned"),
        "{said}"
    );
}

/// Servos whose zeros are a few degrees off, few rows, and pictures of which some went wrong: nothing is wrong with the table's columns.
#[test]
fn rows_that_went_wrong_make_no_doubt_of_columns() {
    for seed in 1101..1121 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let zeros: Vec<f64> = (0..6).map(|_| 0.04 * rng.sample::<f64, _>(StandardNormal)).collect();
        let mut table = Table::new(seed, Where::Beside);
        table = table.joints(|joints| joints.iter_mut().zip(&zeros).for_each(|(q, zero)| *q += zero));
        table.rows.truncate(24);
        for (_, pixels) in table.rows.iter_mut().skip(3).step_by(9) {
            let by = [rng.random_range(-150.0..150.0), rng.random_range(-150.0..150.0)];
            pixels.iter_mut().for_each(|at| (0..2).for_each(|k| at[k] += by[k]));
        }
        assert_eq!(table.doubts(), [], "{seed}: {zeros:.3?}");
    }
}

/// Where zeros alone are learned and joints may stand beside what they read, no table of numbers that are no angles is explained so.
#[test]
fn no_play_explains_readings_of_another_kind() {
    let table = Table::new(1009, Where::Beside);
    let mut rng = ChaCha8Rng::seed_from_u64(1009);
    let playing = table.joints(|joints| joints.iter_mut().for_each(|q| *q += rng.random_range(-0.03..0.03)));
    let factors = [0.7, 0.8, 0.6, 0.7, 0.8, 0.75];
    let shares = table.joints(|joints| joints.iter_mut().zip(factors).for_each(|(q, factor)| *q *= factor));
    for (table, is_told) in [(&playing, false), (&shares, true)] {
        let scenario = table.scenario("learn = \"zeros\"");
        let case = Case::new(&scenario).expect("measured");
        let rows: Vec<usize> = (0..20).collect();
        let fit = case.fit(&case.writable(), &rows, None).expect("fitted");
        let told = case.readings_misfit(&fit);
        assert_eq!(told.is_some(), is_told, "{:?}", fit.reading_sigmas);
    }
}
