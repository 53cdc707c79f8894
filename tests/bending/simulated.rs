//! A simulated UR10 whose joints give way, as a table of measurements.

use std::fmt::Write;

use body_schema::{
    model::{Block, Layout, State},
    robot::Urdf,
    scenario::Scenario,
};
use nalgebra::{DVector, Isometry3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

pub const UR10: &str = include_str!("../urdf/robots/ur10.urdf");

/// What gives way at 1 kg, held out level by 1.25 m, by 1 deg; rad per N·m.
pub const ONE_DEGREE: f64 = std::f64::consts::PI / 180.0 / (9.81 * 1.25);

/// A UR10 with axes that are wrong by 2 mm and 2 mrad (σ), somewhere in the frame of a tracker, with a marker beyond its flange.
#[derive(Clone, Copy)]
pub struct Simulated {
    /// By joint, to the loads at the target and at the elbow, rad per N·m of 1 kg.
    pub compliance: [[f64; 2]; 6],
    /// How many are measured; the second half is held out.
    pub rows: usize,
    pub seed: u64,
}

impl Simulated {
    /// The shoulder gives way by a degree to a full load at the hand and by as much to one at the elbow, which carries two.
    pub fn bent(seed: u64) -> Self {
        let mut compliance = [[0.0; 2]; 6];
        compliance[1] = [ONE_DEGREE; 2];
        compliance[2][0] = 2.0 * ONE_DEGREE;
        Self { compliance, rows: 160, seed }
    }

    pub fn truth(&self, rng: &mut ChaCha8Rng) -> State {
        let chain = Urdf::parse(UR10).expect("a URDF").chain("base_link", "tool0").expect("a chain");
        let described = chain.state();
        let axes = Layout::new(&described, (0..6).map(Block::Axis));
        let wrong = DVector::from_fn(axes.dimension(), |_, _| normal(rng, 0.002));
        let truth = described.retract(&axes, &wrong);
        let marker = truth.marker() + Vector3::new(0.03, -0.05, 0.08);
        let mut truth = truth.with_marker(marker);
        truth.loads = Some(truth.loads_under(Vector3::z_axis(), None).into());
        for (correction, compliance) in truth.corrections.iter_mut().zip(self.compliance) {
            correction.compliance = compliance;
        }
        truth.base = Isometry3::new(Vector3::new(0.5, -0.2, 0.1), Vector3::new(0.02, -0.01, 1.0));
        truth
    }

    /// Readings of the joints and of a tracker with a noise of 0.2 mm.
    pub fn table(&self) -> String {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let truth = self.truth(&mut rng);
        let joints = "shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint";
        let mut text = format!("{joints},x,y,z\n");
        for _ in 0..self.rows {
            let readings: Vec<f64> = (0..6).map(|_| rng.random_range(-2.5..2.5)).collect();
            let seen = truth.marker_at(&readings).map(|x| x + normal(&mut rng, 0.0002));
            let numbers = readings.iter().chain(seen.iter()).map(|x| format!("{x:?}")).collect::<Vec<_>>();
            let _ = writeln!(text, "{}", numbers.join(","));
        }
        text
    }

    /// The calibration file; `keys` go below `[robot]`.
    pub fn file(&self, keys: &str) -> String {
        let held_out: Vec<usize> = (self.rows / 2..self.rows).collect();
        format!(
            "name = \"bent\"\n[robot]\nurdf = \"ur10.urdf\"\nbase = \"base_link\"\ntip = \"tool0\"\n{keys}\n[measurements]\nfile = \
             \"bent.csv\"\n[held_out]\nrows = {held_out:?}\n"
        )
    }

    pub fn scenario(&self, keys: &str) -> Scenario {
        let open = |file: &str| Ok(if file == "ur10.urdf" { UR10.to_owned() } else { self.table() });
        Scenario::parse("bent.toml", &self.file(keys), &open).unwrap_or_else(|error| panic!("{error}"))
    }
}

fn normal(rng: &mut ChaCha8Rng, sigma: f64) -> f64 {
    Normal::new(0.0, sigma).expect("a deviation").sample(rng)
}
