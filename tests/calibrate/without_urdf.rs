//! Robots without a URDF: from Denavit–Hartenberg parameters, with a joint that a linkage holds.

use std::fs;

use body_schema::robot::{Convention, Urdf, urdf_of_dh};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::Value;

use super::{done, failure};

/// A palletizing arm: the linkage keeps its flange level.
const ARM: &str = "joint,theta_deg,d_mm,a_mm,alpha_deg,lower_deg,upper_deg\n\
    base,0,800,300,90,-170,170\n\
    shoulder,90,0,1200,0,-50,50\n\
    elbow,-90,0,1400,0,-40,60\n\
    wrist,0,0,250,-90,-180,180\n\
    flange,0,-200,0,0,-180,180\n";
const LEVEL: &str = "-(shoulder + elbow)";
const ROWS: usize = 60;

/// Measurements of an arm some millimetres off, with 0.2 mm of noise.
fn measured(seed: u64) -> String {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut urdf = Urdf::parse(&urdf_of_dh("arm", ARM, Convention::Standard).expect("a table")).expect("a URDF");
    urdf.couple("wrist", LEVEL).expect("a linkage");
    let mut truth = urdf.chain("base_link", "tool0").expect("a chain");
    let limits: Vec<(f64, f64)> = truth.readings.iter().map(|it| it.limits.expect("limits")).collect();
    fn drawn(rng: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal) * size)
    }
    for segment in &mut truth.segments {
        let turn = UnitQuaternion::from_scaled_axis(drawn(rng, 0.004));
        segment.origin *= Isometry3::from_parts(Translation3::from(drawn(rng, 0.003)), turn);
    }
    let stands = Isometry3::new(drawn(rng, 0.5), drawn(rng, 0.3));
    let marker = Point3::new(0.06, -0.03, -0.1);
    let mut csv = "base_deg,shoulder_deg,elbow_deg,flange_deg,x_mm,y_mm,z_mm\n".to_owned();
    for _ in 0..ROWS {
        let readings: Vec<f64> = limits.iter().map(|(lower, upper)| rng.random_range(*lower..*upper)).collect();
        let at = stands * truth.tip_at(&truth.positions(&readings)) * marker + drawn(rng, 0.0002);
        let cells = readings.iter().map(|q| q.to_degrees()).chain(at.coords.iter().map(|x| x * 1e3));
        csv.push_str(&cells.map(|cell| cell.to_string()).collect::<Vec<_>>().join(","));
        csv.push('\n');
    }
    csv
}

#[test]
fn an_arm_of_dh_parameters_with_a_linkage_is_calibrated() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (dh, csv) = (path("arm.csv"), path("measured.csv"));
    fs::write(&dh, ARM).expect("written");
    fs::write(&csv, measured(1)).expect("written");
    let (code, said) = failure(&["init", "--dh", &dh]);
    assert!(code == 2 && said.contains("the table of measurements is missing"), "{said}");
    // Without the linkage the wrist lacks a column.
    let (code, said) = failure(&["init", "--dh", &dh, &csv, "--tip", "tool0"]);
    assert!(code == 2 && said.contains("wrist"), "{said}");
    assert!(!folder.path().join("arm.urdf").exists(), "nothing is left of what was refused");

    // A dry run says all of that, and writes nothing.
    let before = fs::read_dir(folder.path()).expect("a folder").count();
    let coupled = format!("wrist = {LEVEL}");
    let would = done(&["init", "--dh", &dh, &csv, "--coupled", &coupled, "--dry-run"]);
    assert!(would.contains("would write") && would.contains("arm.urdf: the convention is"), "{would}");
    let shown = done(&["init", "--dh", &dh, &csv, "--coupled", &coupled, "--dry-run", "--out", "-"]);
    assert!(shown.contains("arm.urdf\"\n"), "{shown}");
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), before);
    let said = done(&["init", "--dh", &dh, &csv, "--coupled", &format!("wrist = {LEVEL}")]);
    assert!(said.contains("arm.urdf") && said.contains("--modified"), "{said}");
    let held_out = |file: &str| {
        let report: Value = serde_json::from_str(&done(&["calibrate", file, "--json", "-"])).expect("a report");
        let mean = |when: &str| report["held_out"][when]["mean_mm"].as_f64().expect("a figure");
        (mean("before"), mean("after"))
    };
    // Of postures that the linkage can take predictions are as good as where it was measured.
    let certified = path("certified");
    done(&["calibrate", &path("measured.toml"), "--certificate", "--out", &certified]);
    let certificate = fs::read_to_string(format!("{certified}/certificate.json")).expect("a certificate");
    let certificate: Value = serde_json::from_str(&certificate).expect("JSON");
    let median = certificate["workspace"]["median_mm"].as_f64().expect("a median");
    assert!(median < 3.0, "{median} mm");
    let (before, after) = held_out(&path("measured.toml"));
    assert!(before > 2.0 && after < 0.8, "{before} and {after} mm");

    // A zero before the linkage moves what follows it, which a watch would not see.
    let (code, said) = failure(&["watch", &path("measured.toml"), "--table", &csv]);
    assert!(code == 2 && said.contains("joint `wrist` follows other joints"), "{said}");

    // A linkage that is told wrongly is no small matter.
    let text = fs::read_to_string(path("measured.toml")).expect("begun");
    fs::write(path("wrong.toml"), text.replace(LEVEL, "-shoulder")).expect("written");
    let (_, wrong) = held_out(&path("wrong.toml"));
    assert!(wrong > 20.0 * after, "{wrong} mm");
    fs::write(path("wrong.toml"), text.replace(LEVEL, "-(shouldr + elbow)")).expect("written");
    let (code, said) = failure(&["calibrate", &path("wrong.toml")]);
    assert!(code == 2 && said.contains("robot.coupled.wrist") && said.contains("did you mean `shoulder`?"), "{said}");

    // What is there is not overwritten, and two descriptions are one too many.
    let (code, said) = failure(&["init", "--dh", &dh, &csv, "--out", &path("other.toml")]);
    assert!(code == 2 && said.contains("is there already"), "{said}");
    let (code, said) = failure(&["init", "--dh", &dh, &path("arm.urdf"), &csv]);
    assert!(code == 2 && said.contains("both describe the robot"), "{said}");
    let (code, said) = failure(&["init", &csv]);
    assert!(code == 2 && said.contains("table of measurements is missing"), "{said}");
}
