//! Whether as many rows as a report asks for do what it promises: tables of arms whose truth is known are measured again, so long.

use std::fmt::Write;

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::put_off;
use crate::{Case, Figures, Fit, MoreRows};
use body_schema_robot::{Chain, Urdf};
use body_schema_scenario::Scenario;

const UR10: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/ur10.urdf"));
const PANDA: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/panda.urdf"));
const GEN3LITE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/gen3lite.urdf"));
const TIAGO: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/tiago.urdf"));
const TALOS: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/talos.urdf"));

/// Ten arms: a URDF, from where to where.
const ARMS: [(&str, &str, &str); 10] = [
    (UR10, "base_link", "tool0"),
    (UR10, "base_link", "wrist_1_link"),
    (UR10, "base_link", "forearm_link"),
    (PANDA, "panda_link0", "panda_link8"),
    (PANDA, "panda_link0", "panda_link4"),
    (GEN3LITE, "kinova_base_link", "end_effector_link"),
    (TIAGO, "base_footprint", "arm_tool_link"),
    (TIAGO, "torso_lift_link", "arm_5_link"),
    (TALOS, "base_link", "wrist_left_ft_link"),
    (TALOS, "torso_2_link", "wrist_left_ft_link"),
];
const SIGMA_M: f64 = 0.001;
const SIGMA_RAD: f64 = 0.002;
const SIGMA_PX: f64 = 0.5;
const FOCAL_PX: f64 = 600.0;
/// What distances are measured to, metres.
const ANCHORS: [[f64; 3]; 4] = [[2.0, 0.3, 0.1], [-1.5, 1.4, 0.4], [-1.0, -1.8, 0.2], [0.2, 0.4, 2.2]];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Sensor {
    Position,
    Pose,
    Pixels,
    Distances,
}

/// An arm, its truth, and what measures it.
struct Arm {
    urdf: String,
    ends: (&'static str, &'static str),
    truth: Chain,
    sensor: Sensor,
}

const MARKER: [f64; 3] = [0.03, 0.02, 0.05];
/// Two cameras: what one sees leaves open how far away it is.
const CAMERAS: [[f64; 3]; 2] = [[2.5, 0.4, 0.8], [-0.6, -2.4, 1.1]];

impl Arm {
    fn new((file, base, tip): (&str, &'static str, &'static str), sensor: Sensor, rng: &mut ChaCha8Rng) -> Self {
        let urdf = file.to_owned();
        let mut truth = Urdf::parse(&urdf).and_then(|urdf| urdf.chain(base, tip)).expect("a chain");
        put_off(&mut truth, 0.003, 0.006, rng);
        Self { urdf, ends: (base, tip), truth, sensor }
    }

    fn names(&self) -> Vec<String> {
        self.truth.names()
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        self.truth.limits().expect("limits").draw(rng)
    }

    fn at(&self, configuration: &[f64]) -> Isometry3<f64> {
        self.truth.tip_at(configuration)
    }

    /// A camera's axes: it looks at the base's origin from where it stands.
    fn axes(camera: [f64; 3]) -> Matrix3<f64> {
        let forward = -Vector3::from(camera).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        Matrix3::from_columns(&[right, forward.cross(&right), forward])
    }

    /// A table of so many rows.
    fn table(&self, rows: usize, rng: &mut ChaCha8Rng) -> String {
        let columns = match self.sensor {
            Sensor::Position => "marker_x,marker_y,marker_z",
            Sensor::Pose => "marker_x,marker_y,marker_z,marker_rx,marker_ry,marker_rz",
            Sensor::Pixels => "cam0_marker_u,cam0_marker_v,cam1_marker_u,cam1_marker_v",
            Sensor::Distances => "d0,d1,d2,d3",
        };
        let mut text = format!("{},{columns}\n", self.names().join(","));
        for _ in 0..rows {
            let configuration = self.draw(rng);
            let tip = self.at(&configuration);
            let seen = (tip * Point3::from(MARKER)).coords;
            let mut noisy = |sd: f64, exact: f64| exact + sd * rng.sample::<f64, _>(StandardNormal);
            let mut numbers = configuration;
            match self.sensor {
                Sensor::Position => numbers.extend(seen.iter().map(|x| noisy(SIGMA_M, *x))),
                Sensor::Pose => {
                    numbers.extend(seen.iter().map(|x| noisy(SIGMA_M, *x)));
                    let error = Vector3::from_fn(|_, _| noisy(SIGMA_RAD, 0.0));
                    numbers.extend((UnitQuaternion::from_scaled_axis(error) * tip.rotation).scaled_axis().iter());
                }
                Sensor::Pixels => {
                    for camera in CAMERAS {
                        let at = Self::axes(camera).transpose() * (seen - Vector3::from(camera));
                        numbers.push(noisy(SIGMA_PX, 960.0 + FOCAL_PX * at.x / at.z));
                        numbers.push(noisy(SIGMA_PX, 540.0 + FOCAL_PX * at.y / at.z));
                    }
                }
                Sensor::Distances => {
                    numbers.extend(ANCHORS.map(|anchor| noisy(SIGMA_M, (seen - Vector3::from(anchor)).norm())));
                }
            }
            let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
            let _ = writeln!(text, "{}", numbers.join(","));
        }
        text
    }

    fn scenario(&self, table: &str, wanted_m: f64) -> Scenario {
        let (base, tip) = self.ends;
        let sensors = match self.sensor {
            Sensor::Position => "[[sensor]]\nchannel = \"position\"\ntarget = \"marker\"\nsigma_m = 0.001\n".to_owned(),
            Sensor::Pose => format!(
                "[[sensor]]\nchannel = \"pose\"\ntarget = \"marker\"\nsigma_m = 0.001\nsigma_deg = {}\n",
                SIGMA_RAD.to_degrees()
            ),
            Sensor::Pixels => (0..CAMERAS.len()).fold(String::new(), |text, k| {
                text + &format!(
                    "[[camera]]\nname = \"cam{k}\"\nat_m = {:?}\nlooks_at_m = [0.0, 0.0, 0.0]\nsize_px = [1920.0, 1080.0]\nfocal_px = \
                     [{FOCAL_PX:?}, {FOCAL_PX:?}]\n[[sensor]]\nchannel = \"pixels\"\ncamera = \"cam{k}\"\ntarget = \"marker\"\n\
                     sigma_px = {SIGMA_PX:?}\n",
                    CAMERAS[k]
                )
            }),
            Sensor::Distances => (0..ANCHORS.len()).fold(String::new(), |text, k| {
                text + &format!(
                    "[[sensor]]\nchannel = \"distance\"\ntarget = \"marker\"\ncolumns = [\"d{k}\"]\nto_m = {:?}\nsigma_m = 0.001\n",
                    ANCHORS[k]
                )
            }),
        };
        let text = format!(
            "name = \"arm\"\n[robot]\nurdf = \"robot.urdf\"\nbase = \"{base}\"\ntip = \"{tip}\"\n[base]\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n\
             [[target]]\nname = \"marker\"\n{sensors}[measurements]\nfile = \"rows.csv\"\n[held_out]\nfolds = 5\n[settled]\nexpected_prediction_m = {wanted_m:?}\n"
        );
        let open = |file: &str| Ok(if file == "robot.urdf" { self.urdf.clone() } else { table.to_owned() });
        Scenario::parse("arm.toml", &text, &open).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// What is learned from some rows.
fn fitted(case: &Case<'_>, rows: &[usize]) -> Fit {
    let nominal = case.nominal(rows).expect("fitted");
    case.fit(&case.writable(), rows, Some(nominal.state())).expect("fitted")
}

/// How far the hand is from where it is believed to be, root mean square over postures within the limits, metres.
fn missed(arm: &Arm, scenario: &Scenario, rng: &mut ChaCha8Rng) -> f64 {
    let case = Case::new(scenario).expect("measured");
    let fit = fitted(&case, &(0..case.rows.len()).collect::<Vec<_>>());
    let square = |configuration: Vec<f64>| {
        let truth = arm.at(&configuration) * Point3::from(MARKER);
        (fit.state().marker_at(&configuration) - truth).norm_squared()
    };
    (0..300).map(|_| square(arm.draw(rng))).sum::<f64>().sqrt() / 300_f64.sqrt()
}

/// What a report says of it.
fn said(scenario: &Scenario) -> MoreRows {
    let case = Case::new(scenario).expect("measured");
    let splits = case.splits(None).expect("folds");
    let fit = fitted(&case, &(0..case.rows.len()).collect::<Vec<_>>());
    let residuals: Vec<_> =
        splits.iter().flat_map(|split| case.residuals(&fitted(&case, &split.training), &split.held_out)).collect();
    let figures = Figures::of(&residuals);
    let share = 1.0 - 1.0 / splits.len() as f64;
    case.more_rows(&fit, &case.asked_about(fit.state(), &splits), Some((&figures, share)), (&case.noise(&fit), None))
}

#[test]
fn so_many_rows_reach_what_is_promised() {
    let (mut right, mut told, mut lines) = (0, 0, String::new());
    for (index, arm) in ARMS.into_iter().enumerate() {
        for (which, sensor) in
            [Sensor::Position, Sensor::Pose, Sensor::Pixels, Sensor::Distances].into_iter().enumerate()
        {
            let mut rng = ChaCha8Rng::seed_from_u64(1001 + (index * 4 + which) as u64);
            let arm = Arm::new(arm, sensor, &mut rng);
            let rows = rng.random_range(25..45);
            let table = arm.table(rows, &mut rng);
            let wanted = rng.random_range(0.45..0.9) * missed(&arm, &arm.scenario(&table, 1.0), &mut rng);
            let more = said(&arm.scenario(&table, wanted));
            let Some(needed) = more.rows_needed.or(more.rows_needed_if_noise) else {
                let _ = writeln!(lines, "{index} {sensor:?} {rows}: {}", more.said);
                continue;
            };
            let again: f64 = (0..4)
                .map(|_| {
                    let table = arm.table(needed as usize, &mut rng);
                    missed(&arm, &arm.scenario(&table, wanted), &mut rng).powi(2)
                })
                .sum();
            // An error falls with the square root of the number of rows.
            let truly = needed as f64 * again / 4.0 / wanted.powi(2);
            let ratio = needed as f64 / truly;
            told += 1;
            right += usize::from((1.0 / 1.5..1.5).contains(&ratio));
            let _ = writeln!(
                lines,
                "{index} {sensor:?} {rows}: {needed} ({:?}) reach {:.3} mm; it takes {truly:.0}: {ratio:.2}; floor {:.3}",
                more.rows_needed,
                wanted * 1e3,
                more.model_error_mm
            );
        }
    }
    println!("{lines}");
    assert!(told >= 36 && right * 10 >= told * 8, "{right} of {told} within a factor of 1.5\n{lines}");
}
