//! Robots whose meshes are beside their description.

use std::fs;

use body_schema::robot::Hulls;

use super::{done, failure};

/// A turning post with a lid, both as meshes, and a marker's readings.
const ARM: &str = r#"<robot name="post">
  <link name="base"><collision><geometry><mesh filename="package://post/meshes/cube.obj" scale="0.1 0.1 0.2"/></geometry></collision></link>
  <link name="post"/>
  <link name="lid">
    <visual><geometry><mesh filename="package://post/meshes/cube.obj" scale="0.2 0.1 0.02"/></geometry></visual>
    <collision><geometry><mesh filename="package://post/meshes/cube.dae"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="post"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="open" type="revolute"><parent link="post"/><child link="lid"/><origin xyz="0.1 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"#;
const CUBE: &str = "v -0.5 -0.5 -0.5\nv 0.5 -0.5 -0.5\nv 0.5 0.5 -0.5\nv -0.5 0.5 -0.5\nv -0.5 -0.5 0.5\nv 0.5 -0.5 0.5\nv 0.5 0.5 0.5\nv -0.5 0.5 0.5\n\
    f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn rows() -> String {
    let mut csv = "turn_deg,open_deg,x_mm,y_mm,z_mm\n".to_owned();
    for k in 0..12 {
        let (turn, open) = (f64::from(k * 31 % 120 - 60), f64::from(k * 47 % 140 - 70));
        let (a, b) = (turn.to_radians(), open.to_radians());
        let out = 100.0 + 150.0 * b.cos();
        csv += &format!(
            "{turn},{open},{},{},{}\n",
            out * a.cos() - 20.0 * a.sin(),
            out * a.sin() + 20.0 * a.cos(),
            200.0 - 150.0 * b.sin()
        );
    }
    csv
}

#[test]
fn init_writes_what_links_are_made_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    fs::create_dir_all(place("urdf")).expect("a folder");
    fs::create_dir_all(place("meshes")).expect("a folder");
    let (urdf, csv) = (place("urdf/post.urdf"), place("rows.csv"));
    fs::write(&urdf, ARM).expect("written");
    fs::write(&csv, rows()).expect("written");
    // Without meshes nothing is written but the calibration file, and it is told what that means.
    let said = done(&["init", &urdf, &csv, "--out", &place("plain.toml")]);
    assert!(said.contains("package://post/meshes/cube.dae and 1 more cannot be read as STL or OBJ"), "{said}");
    assert!(!fs::read_to_string(place("plain.toml")).expect("written").contains("shapes"));
    fs::write(place("meshes/cube.obj"), CUBE).expect("written");
    let said = done(&["init", &urdf, &csv]);
    assert!(
        said.contains("wrote") && said.contains("rows.shapes.json: the shapes of links by the meshes of"),
        "{said}"
    );
    assert!(said.contains("package://post/meshes/cube.dae cannot be read"), "{said}");
    let begun = fs::read_to_string(place("rows.toml")).expect("written");
    assert!(begun.contains("shapes = \"rows.shapes.json\""), "{begun}");
    let hulls = Hulls::parse(&fs::read_to_string(place("rows.shapes.json")).expect("written")).expect("hulls");
    assert_eq!(hulls.0.keys().collect::<Vec<_>>(), ["base"], "the other link has a mesh that is not there");
    let corners = || hulls.0["base"].iter().flatten();
    let highest = [0, 1, 2].map(|side| corners().map(|corner| corner[side]).fold(f64::MIN, f64::max));
    assert_eq!(highest, [0.05, 0.05, 0.1]);
    // Both commands that read the file take it, and say so if the shapes are gone.
    done(&["calibrate", &place("rows.toml"), "--folds", "0", "--out", &place("out")]);
    done(&["observability", &place("rows.toml"), "--postures", "4"]);
    // Nothing is written over.
    fs::remove_file(place("rows.toml")).expect("removed");
    let (code, said) = failure(&["init", &urdf, &csv]);
    assert!(code == 2 && said.contains("rows.shapes.json is there already"), "{said}");
    fs::remove_file(place("rows.shapes.json")).expect("removed");
    fs::write(place("rows.toml"), begun).expect("written");
    let (code, said) = failure(&["observability", &place("rows.toml")]);
    assert!(code == 2 && said.contains("robot.shapes") && said.contains("rows.shapes.json"), "{said}");
}
