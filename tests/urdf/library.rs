//! Another library reads what was written: the poses in `urdf/*.json` come of yourdfpy, which knows nothing of this project.
//!
//! To compute them anew, let this test write the descriptions, and the script beside it read them:
//!
//! ```sh
//! cargo test --test all urdf::library; pip install yourdfpy
//! python tests/urdf/forward_kinematics.py target/tmp/panda.urdf panda_link0 panda_link8 > tests/urdf/panda.json
//! ```

use std::path::Path;

use body_schema::robot::Urdf;
use nalgebra::Matrix4;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

use super::{ROBOTS, random::learned};

#[derive(Deserialize)]
struct Poses {
    joints: Vec<String>,
    postures: Vec<Vec<f64>>,
    /// By row.
    poses: Vec<[[f64; 4]; 4]>,
}

#[test]
fn another_library_reads_the_same_robot() {
    let written = ROBOTS.map(|(name, text, base, tip, _)| {
        let urdf = Urdf::parse(text).expect(name);
        let chain = urdf.chain(base, tip).expect(name);
        let state = learned(&chain, 0.02, 0.005, true, &mut ChaCha8Rng::seed_from_u64(7));
        let written = urdf.written(&chain.fitted(&state).expect("writable").chain);
        std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.urdf")), &written).expect("written");
        written
    });
    for ((name, _, base, tip, _), written) in ROBOTS.iter().zip(&written) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/urdf/{name}.json"));
        let theirs: Poses = serde_json::from_str(&std::fs::read_to_string(path).expect(name)).expect(name);
        let ours = Urdf::parse(written).and_then(|urdf| urdf.chain(base, tip)).expect(name);
        let names: Vec<&str> = ours.readings.iter().map(|reading| reading.name.as_str()).collect();
        let column = |name: &&str| theirs.joints.iter().position(|joint| joint == name).expect("the same joints");
        let columns: Vec<usize> = names.iter().map(column).collect();
        assert!(theirs.postures.len() >= 20, "{name}");
        for (posture, pose) in theirs.postures.iter().zip(&theirs.poses) {
            let q: Vec<f64> = columns.iter().map(|column| posture[*column]).collect();
            let found = ours.tip_at(&ours.positions(&q)).to_homogeneous();
            let wanted = Matrix4::from_fn(|row, column| pose[row][column]);
            assert!((found - wanted).amax() < 1e-6, "{name}: {found}{wanted}");
        }
    }
}
