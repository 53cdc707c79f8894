//! Scenarios whose robot comes from a URDF in which joints branch: which joints are in, and what is refused.

use body_schema_engine::model::Block;
use body_schema_scenario::{Scenario, ScenarioError, WorldSpec, builtin};

const URDF: &str = r#"<robot name="torso">
  <link name="base"/> <link name="torso"/> <link name="arm"/> <link name="left"/> <link name="tool"/> <link name="right"/>
  <link name="neck"/> <link name="eye"/> <link name="alone"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="torso"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="l1" type="continuous"><parent link="torso"/><child link="arm"/><origin xyz="0 0.2 0"/><axis xyz="0 1 0"/></joint>
  <joint name="l2" type="continuous"><parent link="arm"/><child link="left"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/></joint>
  <joint name="holds" type="fixed"><parent link="left"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>
  <joint name="r1" type="continuous"><parent link="torso"/><child link="right"/><origin xyz="0 -0.2 0"/><axis xyz="0 1 0"/></joint>
  <joint name="pan" type="continuous"><parent link="torso"/><child link="neck"/><origin xyz="0 0 0.5"/></joint>
  <joint name="sees" type="fixed"><parent link="neck"/><child link="eye"/><origin xyz="0.1 0 0"/></joint>
</robot>"#;

const CAMERA: &str = "[[camera]]\nname = \"cam\"\nlink = \"eye\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n\
                      size_px = [640.0, 480.0]\nfocal_px = [600.0, 600.0]\nknown = { to_m = 0.01, to_deg = 5.0 }\n";

/// A target at a place, or on the tip.
fn target(name: &str, link: Option<&str>) -> String {
    let link = link.map(|link| format!("link = \"{link}\"\n")).unwrap_or_default();
    format!("[[target]]\nname = \"{name}\"\n{link}at_m = [0.0, 0.0, 0.1]\nknown = {{ to_m = 0.05 }}\n")
}

fn parsed(robot: &str, rest: &str, titles: &str) -> Result<Scenario, ScenarioError> {
    let row = |k: usize| (0..titles.split(',').count()).map(|at| format!("0.{}", k + at)).collect::<Vec<_>>().join(",");
    let table = std::iter::once(titles.to_owned()).chain((1..9).map(row)).collect::<Vec<_>>().join("\n");
    let text =
        format!("name = \"branches\"\n[robot]\nurdf = \"r.urdf\"\n{robot}\n[measurements]\nfile = \"r.csv\"\n{rest}");
    Scenario::parse("branches.toml", &text, &|file| Ok(if file == "r.csv" { table.clone() } else { URDF.to_owned() }))
}

const ALL: &str = "lift,l1,l2,r1,pan,x,y,z";

fn joints(robot: &str, rest: &str, titles: &str) -> (String, Vec<String>) {
    let scenario = parsed(robot, rest, titles).unwrap_or_else(|error| panic!("{error}"));
    (scenario.robot.described.as_ref().expect("a URDF").chain.base.clone(), scenario.robot.names)
}

#[test]
fn the_joints_are_those_between_the_links_that_are_named() {
    let on_left = target("probe", Some("tool"));
    let pixels = format!("{CAMERA}{}[[sensor]]\nchannel = \"pixels\"\ntarget = \"tag\"\n", target("tag", Some("left")));
    let uv = "lift,l1,l2,r1,pan,cam_tag_u,cam_tag_v";
    for (robot, rest, titles, base, wanted) in [
        ("base = \"base\"\ntip = \"tool\"", "", ALL, "base", &["lift", "l1", "l2"][..]),
        ("base = \"base\"\ntips = [\"tool\"]", "", ALL, "base", &["lift", "l1", "l2"]),
        ("base = \"base\"\ntips = [\"right\", \"tool\"]", "", ALL, "base", &["lift", "r1", "l1", "l2"]),
        ("tips = [\"tool\", \"right\"]", "", ALL, "torso", &["l1", "l2", "r1"]),
        // Without tips, what moves targets and cameras.
        ("base = \"base\"", &on_left, ALL, "base", &["lift", "l1", "l2"]),
        ("base = \"base\"\ntip = \"right\"", &on_left, ALL, "base", &["lift", "r1", "l1", "l2"]),
        ("", &pixels, uv, "torso", &["l1", "l2", "pan"]),
        ("base = \"base\"", &pixels, uv, "base", &["lift", "l1", "l2", "pan"]),
        ("base = \"base\"\ntip = \"left\"", &pixels, uv, "base", &["lift", "l1", "l2", "pan"]),
    ] {
        let wanted = wanted.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(joints(robot, rest, titles), (base.to_owned(), wanted), "{robot}\n{rest}");
    }
}

/// Where nothing is measured from outside, nobody asks where the robot stands: it is known up to one motion of the whole.
#[test]
fn what_is_measured_from_the_robot_itself_needs_no_base() {
    let plate = "[[target]]\nname = \"plate\"\nlink = \"right\"\nat_m = [0.1, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n\
                 known = { to_m = 0.01, to_deg = 5.0 }\n";
    let both = target("tag", Some("left")) + plate;
    let fixed = "[[camera]]\nname = \"cam\"\nat_m = [2.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\nsize_px = [640.0, 480.0]\n\
                 focal_px = [600.0, 600.0]\n";
    for (sensor, titles, stands) in [
        ("channel = \"position\"\ntarget = \"tag\"\nin = \"plate\"", "plate_tag_x,plate_tag_y,plate_tag_z", false),
        ("channel = \"depth\"\ntarget = \"tag\"\nin = \"plate\"", "plate_tag_depth", false),
        ("channel = \"distance\"\ntarget = \"tag\"\nto = \"plate\"", "plate_tag_distance", false),
        ("channel = \"position\"\ntarget = \"tag\"", "tag_x,tag_y,tag_z", true),
        ("channel = \"distance\"\ntarget = \"tag\"\nto_m = [0.0, 0.0, 0.0]", "tag_distance", true),
    ] {
        let rest = format!("{both}[[sensor]]\n{sensor}\nsigma_m = 0.001\n");
        let scenario = parsed("", &rest, &format!("l1,l2,r1,{titles}")).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.prior.of(Block::Base).is_some(), stands, "{sensor}");
        assert_eq!(scenario.robot.up_to_motion, !stands, "{sensor}");
    }
    // What a camera sees that carries a frame of its own: on the robot, or in the world.
    for (camera, stands) in [(CAMERA, false), (fixed, true)] {
        let sensor = "[[sensor]]\nchannel = \"position\"\ntarget = \"tag\"\nin = \"cam\"\nsigma_m = 0.001\n";
        let rest = format!("{camera}{}{sensor}", target("tag", Some("left")));
        let scenario = parsed("base = \"base\"", &rest, "lift,l1,l2,pan,cam_tag_x,cam_tag_y,cam_tag_z");
        let scenario = scenario.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.prior.of(Block::Base).is_some(), stands, "{camera}");
    }
}

/// A link beside the way to the tip that no other joint moves adds no joint, not even a fixed one; a target without a link is on the
/// first tip.
#[test]
fn links_that_are_fixed_beside_the_chain_add_nothing() {
    let with =
        |rest: &str| parsed("base = \"base\"\ntip = \"left\"", rest, ALL).unwrap_or_else(|error| panic!("{error}"));
    let (alone, beside) = (with(""), with(&target("probe", Some("tool"))));
    let chain = |scenario: &Scenario| scenario.robot.described.as_ref().expect("a URDF").chain.clone();
    assert_eq!(chain(&alone), chain(&beside));
    let at = beside.robot.state.targets[0].place.origin();
    assert!((at - nalgebra::Point3::new(0.4, 0.2, 0.1)).norm() < 1e-12, "{at}");
    let on_tip = parsed("tips = [\"right\", \"tool\"]", &target("probe", None), ALL).expect("valid").robot.state;
    assert_eq!((on_tip.targets[0].link, on_tip.joints.len()), (1, 3));
    assert!((on_tip.targets[0].place.origin() - nalgebra::Point3::new(0.0, -0.2, 0.1)).norm() < 1e-12);
}

#[test]
fn what_names_no_branches_is_refused() {
    let on = |link: &str| target("probe", Some(link));
    let left_and = |link: &str| on("left") + &target("other", Some(link));
    for (robot, rest, key, what, hint) in [
        (
            "base = \"base\"\ntip = \"left\"\ntips = [\"right\"]",
            String::new(),
            "robot.tip",
            "`tips` names tips too",
            "leave one",
        ),
        ("base = \"base\"\ntips = []", String::new(), "robot.tips", "it names no link", "name the links"),
        ("base = \"base\"", String::new(), "robot.tip", "missing", "add `tip = "),
        ("base = \"base\"", target("probe", None), "robot.tip", "missing", "add `tip = "),
        ("tip = \"left\"", String::new(), "robot.base", "missing", "add `base = "),
        // One hangs on the other: nothing says where to begin.
        ("tips = [\"left\", \"arm\"]", String::new(), "robot.base", "missing", "add `base = "),
        (
            "base = \"base\"\ntips = [\"left\", \"rigth\"]",
            String::new(),
            "robot.urdf",
            "no link `rigth`",
            "did you mean `right`?",
        ),
        (
            "base = \"arm\"\ntips = [\"left\", \"right\"]",
            String::new(),
            "robot.urdf",
            "link `right` does not hang on `arm`",
            "torso, base",
        ),
        (
            "base = \"arm\"\ntip = \"left\"",
            left_and("right"),
            "target[1].link",
            "link `right` does not hang on `arm`",
            "torso, base",
        ),
        (
            "base = \"base\"\ntip = \"left\"",
            left_and("alone"),
            "target[1].link",
            "`alone` does not hang",
            "`alone` hangs on nothing",
        ),
        (
            "base = \"base\"\ntip = \"left\"",
            on("lefft"),
            "target[0].link",
            "there is no link `lefft`",
            "write one of the links: base",
        ),
        (
            "base = \"base\"\ntips = [\"left\"]",
            on("right"),
            "target[0].link",
            "joints that `robot.tips` leaves out: r1",
            "add \"right\"",
        ),
        (
            "base = \"base\"",
            on("alone"),
            "robot.urdf",
            "link `alone` does not hang on `base`",
            "`alone` hangs on nothing",
        ),
    ] {
        let error = parsed(robot, &rest, ALL).expect_err(what).to_string();
        assert!(error.contains(key) && error.contains(what) && error.contains(hint), "{robot}\n{rest}\n{error}");
    }
    let text = builtin("arm-6dof").expect("built in").source.replacen("[robot]", "[robot]\ntips = [\"a\"]", 1);
    let error = Scenario::parse("a.toml", &text, &|_| Err("no".to_owned())).expect_err("no URDF").to_string();
    assert!(error.contains("`robot.tips`: it names a link of a URDF, and there is none"), "{error}");
}

/// Joints that move nothing measured need no column; they stay at 0, and nothing is learned of them.
#[test]
fn columns_may_lack_of_joints_that_move_nothing_measured() {
    let robot = "base = \"base\"\ntips = [\"tool\", \"right\", \"eye\"]";
    let scenario = parsed(robot, &target("probe", Some("tool")), "l2,lift,l1_deg,x,y,z").expect("valid");
    let WorldSpec::Measured { measurements, .. } = &scenario.world else { panic!("measured") };
    assert_eq!(measurements.unread, ["r1", "pan"]);
    assert_eq!(measurements.columns, ["lift", "l1_deg", "l2", "", ""]);
    let [lift, l1, l2, r1, pan] = measurements.configurations[0][..] else { panic!("five joints") };
    assert!((lift - 0.2).abs() < 1e-15 && (l1 - 0.3_f64.to_radians()).abs() < 1e-15 && (l2 - 0.1).abs() < 1e-15);
    assert_eq!((r1, pan), (0.0, 0.0));
    let learned: Vec<bool> = (0..5).map(|joint| scenario.robot.layout.is_learned(joint)).collect();
    assert_eq!(learned, [true, true, true, false, false]);
    // Camera and tag ride on the same lift.
    let pixels = format!("{CAMERA}{}[[sensor]]\nchannel = \"pixels\"\ntarget = \"tag\"\n", target("tag", Some("left")));
    let scenario = parsed("base = \"base\"", &pixels, "l1,l2,pan,cam_tag_u,cam_tag_v").expect("valid");
    let WorldSpec::Measured { measurements, .. } = &scenario.world else { panic!("measured") };
    assert_eq!(measurements.unread, ["lift"]);
    for (titles, joint) in [("lift,l1,x,y,z", "l2"), ("l1,l2,x,y,z", "lift")] {
        let error = parsed(robot, &target("probe", Some("tool")), titles).expect_err("it is needed").to_string();
        assert!(error.contains(&format!("has no column `{joint}`")), "{error}");
    }
}
