//! What is read, and what is refused with line, column and mend.

use body_schema::{
    kinematics::JointKind,
    robot::{Follows, SegmentKind, Urdf, UrdfError},
};
use nalgebra::{UnitQuaternion, Vector3};

use super::ROBOTS;

const ARM: &str = r#"<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base"/>
  <link name="upper"/>
  <link name="fore"/>
  <link name="hand"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <parent link="base"/> <child link="upper"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="2"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/> <child link="fore"/>
    <axis xyz="0 0 3"/>
    <mimic joint="shoulder" multiplier="-2" offset="0.5"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="fore"/> <child link="hand"/>
    <limit lower="0" upper="0.2"/>
  </joint>
</robot>
"#;

fn error(text: &str, base: &str, tip: &str) -> UrdfError {
    Urdf::parse(text).and_then(|urdf| urdf.chain(base, tip)).expect_err(text)
}

/// Refused after a replacement on a line, with line, column, words of what is wrong and words of the mend.
#[track_caller]
fn refused(from: &str, to: &str, at: (usize, usize), what: &str, hint: &str) {
    assert!(ARM.contains(from), "the test's own premise: {from}");
    let error = error(&ARM.replacen(from, to, 1), "base", "hand");
    assert!(error.what.contains(what) && error.hint.contains(hint), "{error}");
    assert_eq!((error.line, error.column), at, "{error}");
    assert!(error.to_string().starts_with(&format!("line {}, column {}: ", at.0, at.1)), "{error}");
}

#[test]
fn a_chain_is_read() {
    let chain = Urdf::parse(ARM).and_then(|urdf| urdf.chain("base", "hand")).expect("a chain");
    assert_eq!((chain.names(), chain.tip()), (vec!["shoulder".into(), "elbow".into(), "slide".into()], "hand"));
    let kinds: Vec<SegmentKind> = chain.segments.iter().map(|segment| segment.kind).collect();
    assert_eq!(kinds, [SegmentKind::Revolute, SegmentKind::Continuous, SegmentKind::Prismatic]);
    let readings: Vec<_> = chain.readings.iter().map(|reading| (reading.name.as_str(), reading.kind)).collect();
    assert_eq!(readings, [("shoulder", JointKind::Revolute), ("slide", JointKind::Prismatic)]);
    assert_eq!(chain.segments[1].follows, Some(Follows { terms: vec![(0, -2.0)], offset: 0.5 }));
    assert_eq!(chain.positions(&[1.0, 0.1]), [1.0, -1.5, 0.1]);
    assert_eq!(chain.limits().expect("limits").joints()[2], (0.0, 0.2));
    // Without an axis a joint has x.
    assert_eq!(chain.state().joints[2].direction().into_inner(), Vector3::x());
    let tip = chain.tip_at(&chain.positions(&[0.3, 0.1]));
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0) * UnitQuaternion::from_euler_angles(0.0, 0.0, -0.1);
    assert!((tip.translation.vector - (Vector3::z() + turned * Vector3::x() * 0.1)).norm() < 1e-15);
}

#[test]
fn a_state_moves_as_its_chain() {
    for (name, text, base, tip, joints) in ROBOTS {
        let chain = Urdf::parse(text).and_then(|urdf| urdf.chain(base, tip)).expect(name);
        let state = chain.state();
        let q: Vec<f64> = (0..joints).map(|joint| 0.1 + 0.2 * joint as f64).collect();
        let found = state.frame_at(body_schema::model::Frame::Target(0), &q);
        let wanted = chain.tip_at(&q);
        assert!((found.translation.vector - wanted.translation.vector).norm() < 1e-12, "{name}");
        assert!(found.rotation.angle_to(&wanted.rotation) < 1e-12, "{name}");
        assert_eq!(chain.links(&q).len(), chain.segments.len() + 1, "{name}");
    }
}

#[test]
fn the_text_may_have_a_byte_order_mark_and_other_line_ends() {
    let text = format!("\u{feff}{}", ARM.replace('\n', "\r\n"));
    let urdf = Urdf::parse(&text).expect("a URDF");
    let chain = urdf.chain("base", "hand").expect("a chain");
    let mut moved = chain.clone();
    moved.segments[0].origin.translation.vector.z = 1.5;
    moved.segments[2].origin.translation.vector.z = -1e-7;
    let written = urdf.written(&moved);
    let inserted = "type=\"prismatic\">\r\n    <origin xyz=\"0 0 -1e-7\" rpy=\"0 0 0\"/>\r\n    <parent";
    assert_eq!(written, text.replace("0 0 1\"", "0 0 1.5\"").replace("type=\"prismatic\">\r\n    <parent", inserted));
    let error = error(&text.replace("0 1 0", "0 0 0"), "base", "hand");
    assert_eq!((error.line, error.column), (10, 16));
}

#[test]
fn what_is_wrong_has_line_column_and_mend() {
    refused("0 1 0", "0 0 0", (10, 16), "the axis `0 0 0` has no direction", "`fixed`");
    refused("0 0 1\"", "0 0\"", (8, 18), "`xyz` holds 2 numbers", "write 3");
    refused("0 0 1\"", "0 0 1,5\"", (8, 18), "`1,5` in `xyz` is not a finite number", "0.03");
    refused("0 0 1\"", "0 0 inf\"", (8, 18), "`inf` in `xyz` is not a finite number", "0.03");
    refused("0 0 1\"", "0 0 1e13\"", (8, 18), "`1e13` in `xyz` is beyond ±1e12", "0.03");
    refused("0 0 1\"", "0 0 ${height}\"", (8, 18), "expression of xacro", "xacro robot.urdf.xacro");
    refused(
        "type=\"revolute\"",
        "type=\"ball\"",
        (7, 32),
        "`shoulder` is of type `ball`",
        "as `upper`, which it carries, for the base",
    );
    refused(" type=\"revolute\"", "", (7, 3), "<joint> has no `type`", "add type");
    refused("    <limit lower=\"-1\" upper=\"2\"/>\n", "", (7, 3), "joint `shoulder` has no <limit>", "`continuous`");
    refused(
        "lower=\"-1\"",
        "lower=\"3\"",
        (11, 5),
        "`shoulder`: the lower limit 3 is above",
        "lower=\"2\" upper=\"3\"",
    );
    refused("name=\"elbow\"", "name=\"shoulder\"", (13, 16), "`shoulder` is on line 7 already", "name of its own");
    refused(
        "<link name=\"hand\"/>",
        "<link name=\"fore\"/>",
        (6, 15),
        "`fore` is on line 5 already",
        "name of its own",
    );
    refused("child link=\"hand\"", "child link=\"hnad\"", (19, 40), "no link `hnad`", "did you mean `hand`?");
    refused(
        "child link=\"hand\"",
        "child link=\"fore\"",
        (19, 40),
        "`fore` hangs on joint `elbow`",
        "hangs on one joint",
    );
    refused(
        "joint=\"shoulder\"",
        "joint=\"sholder\"",
        (16, 19),
        "no joint `sholder` to mimic",
        "did you mean `shoulder`?",
    );
    refused("joint=\"shoulder\"", "joint=\"elbow\"", (16, 19), "which nothing moves", "moves by itself");
    let two = "<axis xyz=\"0 1 0\"/><axis xyz=\"0 1 0\"/>";
    refused("<axis xyz=\"0 1 0\"/>", two, (10, 24), "a second <axis>", "leave one");
    let both = "rpy=\"0 0 0\" quat_xyzw=\"0 0 0 1\"";
    refused("rpy=\"0 0 0\"", both, (8, 37), "`rpy` and `quat_xyzw`", "leave one");
    refused("rpy=\"0 0 0\"", "quat_xyzw=\"0 0 0 0\"", (8, 36), "has the length 0", "0 0 0 1");
    refused("<parent link=\"base\"/>", "<parent link=\"hand\"/>", (18, 3), "in a circle", "hang on nothing");
}

#[test]
fn links_that_form_no_chain_are_refused() {
    let apart = error(ARM, "hand", "fore");
    assert!(apart.what.contains("`fore` does not hang on `hand`") && apart.hint.contains("upper, base"), "{apart}");
    assert_eq!(apart.line, 13);
    let root = error(ARM, "hand", "base");
    assert!(root.hint.contains("`base` hangs on nothing"), "{root}");
    assert!(error(ARM, "bse", "hand").hint.contains("did you mean `base`?"));
    assert!(error(ARM, "elbow", "hand").hint.contains("the link that it carries is `fore`"));
    assert!(error(ARM, "camera", "hand").hint.contains("its links are base, upper, fore, hand"));
    assert!(error(ARM, "hand", "hand").what.contains("no joint moves between"));
}

#[test]
fn what_is_no_urdf_is_refused() {
    for (text, line, what, hint) in [
        ("", 1, "the file is empty", "give a URDF"),
        ("hello", 1, "not XML", "correct it"),
        ("<robot>\n<link name=\"a\">\n</robot>", 3, "not XML", "correct it"),
        ("<sdf/>", 1, "<sdf> is not the description of a robot", "give a URDF"),
        ("<!DOCTYPE robot [<!ENTITY a \"1\">]>\n<robot/>", 1, "<!DOCTYPE> defines entities", "remove it"),
        ("<robot>\n<xacro:property name=\"a\"/></robot>", 2, "a template in xacro", "xacro robot.urdf.xacro"),
        ("INFO: expanded\n<?xml version=\"1.0\"?><robot/>", 1, "begins with `INFO: expanded`", "before <?xml"),
        ("<x:sdf/>", 1, "<x:sdf> is not the description of a robot", "give a URDF"),
        ("<robot>\n<link/></robot>", 2, "<link> has no `name`", "add name"),
    ] {
        let error = Urdf::parse(text).expect_err(text);
        assert!(error.what.contains(what) && error.hint.contains(hint) && error.line == line, "{text}: {error}");
    }
    refused("type=\"revolute\"", "type=\"${type}\"", (7, 32), "`${type}` is an expression of xacro", "expand it first");
    refused("<axis xyz=\"0 1 0\"/>", "<xacro:axis/>", (10, 5), "<xacro:axis>: this is a template", "expand it first");
    let template = ARM.replace("  <link name=\"hand\"/>", "  <xacro:include filename=\"hand.xacro\"/>");
    let error = Urdf::parse(&template).expect_err("a template");
    assert!(error.what.contains("<xacro:include>") && error.line == 6, "{error}");
}

#[test]
fn depth_and_size_do_no_harm() {
    let deep = "<a>".repeat(100_000);
    Urdf::parse(&format!("<robot>{deep}")).expect_err("never closed");
    let links: String = (0..20_000).map(|k| format!("<link name=\"l{k}\"/>")).collect();
    let joint = |k: usize| {
        format!("<joint name=\"j{k}\" type=\"continuous\"><parent link=\"l{k}\"/><child link=\"l{}\"/></joint>", k + 1)
    };
    let joints: String = (0..19_999).map(joint).collect();
    let urdf = Urdf::parse(&format!("<robot>{links}{joints}</robot>")).expect("a long chain");
    assert_eq!(urdf.chain("l0", "l19999").expect("a long chain").moving().count(), 19_999);
}

/// What `text` is with the first origin moved, written; what is to be the same otherwise.
fn is_written_in_place(text: &str) {
    let urdf = Urdf::parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let mut chain = urdf.chain("base", "hand").unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(urdf.written(&chain), text);
    chain.segments[0].origin.translation.vector.z = 1.25;
    chain.segments[1].origin.translation.vector.x = 0.5;
    let written = urdf.written(&chain);
    let inserted = "<origin xyz=\"0.5 0 0\" rpy=\"0 0 0\"/>\n    <parent link=\"upper\"/>";
    let wanted = text.replace("\"0 0 1\"", "\"0 0 1.25\"").replace("<parent link=\"upper\"/>", inserted);
    assert_eq!(written, wanted);
}

#[test]
fn prefixes_that_nobody_declares_are_parts_of_names() {
    for (from, to) in [
        ("<limit lower", "<limit drake:acceleration=\"2.5\" ü:é=\"1\" lower"),
        ("<link name=\"hand\"/>", "<link name=\"hand\"><gz:plugin mujoco:a='b'><gz:c/></gz:plugin></link>"),
        // No joint, link or origin of this description.
        ("<link name=\"hand\"/>", "<link name=\"hand\"/><drake:joint name=\"shoulder\"/><drake:link/>"),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 0\"/><drake:axis xyz=\"1 0 0\"/>"),
        ("<origin xyz", "<origin my:xyz=\"9 9 9\" xyz"),
        ("<robot name=\"arm\"", "<robot name=\"arm\" xmlns=\"http://ros.org\" xmlns:drake=\"http://drake.mit.edu\""),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 0\"/><!-- ---- was: <a:b c=\"--\"/> ---->"),
    ] {
        assert!(ARM.contains(from), "the test's own premise: {from}");
        is_written_in_place(&ARM.replacen(from, to, 1));
    }
    // A declared one is another's as well.
    let other = "<drake:joint name=\"elbow\" xmlns:drake=\"http://drake.mit.edu\"/>\n  <link name=\"hand\"/>";
    is_written_in_place(&ARM.replacen("<link name=\"hand\"/>", other, 1));
}

#[test]
fn anything_but_text_may_stand_before_the_declaration() {
    let declared = "<?xml version=\"1.0\"?>\n";
    for before in
        ["\n", " \t\r\n", "<!-- made by -- a tool -->\n", "\u{feff}\n", "\n\u{feff}", "\u{feff}\u{feff}", declared]
    {
        is_written_in_place(&format!("{before}{ARM}"));
        let error = error(&format!("{before}{}", ARM.replace("0 1 0", "0 0 0")), "base", "hand");
        assert_eq!((error.line, error.column), (10 + before.matches('\n').count(), 16), "{before:?}");
    }
    is_written_in_place(&ARM.replacen('\n', "\n<!DOCTYPE robot>\n", 1));
    is_written_in_place(&ARM.replace("<?xml version=\"1.0\"?>", "<?xml encoding='utf-8'?>"));
    is_written_in_place(&ARM.replace("<?xml version=\"1.0\"?>\n", ""));
}

#[test]
fn xacro_where_no_kinematics_is_counts_for_nothing() {
    let parts = [
        "<visual><xacro:grey/></visual>",
        "<collision><geometry><xacro:box size=\"${w}\"/></geometry></collision>",
        "<xacro:inertia m=\"${mass}\"/>",
    ];
    for part in parts {
        is_written_in_place(&ARM.replacen("<link name=\"fore\"/>", &format!("<link name=\"fore\">{part}</link>"), 1));
    }
    for element in ["material name=\"grey\"", "gazebo reference=\"fore\"", "transmission name=\"t\""] {
        let name = element.split(' ').next().unwrap_or_default();
        let with = format!("<{element}><xacro:rest a=\"$(arg b)\"/></{name}>\n</robot>");
        is_written_in_place(&ARM.replacen("</robot>", &with, 1));
    }
    // By any prefix that is declared for it.
    let text = ARM.replace("xmlns:xacro=\"http://www.ros.org/wiki/xacro\"", "xmlns:x=\"http://wiki.ros.org/xacro\"");
    let error = error(&text.replace("</robot>", "<x:arm/></robot>"), "base", "hand");
    assert!(error.what.contains("<x:arm>: this is a template"), "{error}");
}

/// The limits of `shoulder`, and the range in which it is moved.
fn limited(limit: &str) -> (Option<(f64, f64)>, (f64, f64)) {
    let text = ARM.replacen("lower=\"-1\" upper=\"2\"", limit, 1);
    let chain =
        Urdf::parse(&text).and_then(|urdf| urdf.chain("base", "hand")).unwrap_or_else(|error| panic!("{error}"));
    (chain.readings[0].limits, chain.limits().expect("a box").joints()[0])
}

#[test]
fn limits_that_stand_for_none_are_none() {
    use std::f64::consts::{PI, TAU};

    for (limit, lower, upper) in [
        ("-999999", -PI, PI),
        ("-1e16", -PI, PI),
        ("-1e300", -PI, PI),
        ("-inf", -PI, PI),
        ("-Infinity", -PI, PI),
        ("-10000", -PI, PI),
        // Far, though it may be meant: nobody need turn so far.
        ("-9999", -TAU, TAU),
        ("-7", -TAU, TAU),
        ("-6.29", -6.29, 6.29),
    ] {
        let positive = &limit[1..];
        let (limits, range) = limited(&format!("lower=\"{limit}\" upper=\"{positive}\""));
        assert_eq!(range, (lower, upper), "{limit}");
        assert_eq!(limits.is_none(), lower == -PI, "{limit}");
    }
    for (lower, upper, range) in [
        ("0", "1e9", (0.0, TAU)),
        ("-999999", "1", (-TAU, 1.0)),
        ("10", "inf", (10.0, 10.0 + TAU)),
        ("-1000", "-6.2", (-6.2 - TAU, -6.2)),
        ("10", "11", (10.0, 11.0)),
        ("-3", "20", (-3.0, TAU)),
    ] {
        let (limits, found) = limited(&format!("lower=\"{lower}\" upper=\"{upper}\""));
        assert_eq!(found, range, "{lower} {upper}");
        assert!(limits.is_some(), "the other limit counts");
    }
}

#[test]
fn limits_of_joints_that_cannot_move_are_told() {
    let shoulder = "lower=\"-1\" upper=\"2\"";
    refused(
        shoulder,
        "lower=\"0\" upper=\"0\"",
        (11, 5),
        "`shoulder`: it cannot move, as its limits are both 0",
        "`continuous`",
    );
    refused(shoulder, "lower=\"0.5\" upper=\"0.5\"", (11, 5), "both 0.5", "or `fixed`");
    refused(shoulder, "effort=\"9\"", (11, 5), "its <limit> has no `lower` and no `upper`", "in radians");
    refused(shoulder, "lower=\"nan\" upper=\"1\"", (11, 19), "`nan` in `lower` is not a finite number", "0.03");
    refused(shoulder, "lower=\"inf\" upper=\"-inf\"", (11, 5), "the lower limit inf is above", "lower=\"-inf\"");
    let slide = "lower=\"0\" upper=\"0.2\"";
    refused(slide, "lower=\"0\" upper=\"0\"", (20, 5), "`slide`: it cannot move", "how far it slides, in metres");
    refused(
        slide,
        "lower=\"-1e16\" upper=\"1e16\"",
        (20, 5),
        "`slide`: a limit of 10000 m or more",
        "how far it slides",
    );
    // That which follows another moves as the other does.
    let follower = ARM
        .replace("type=\"continuous\"", "type=\"revolute\"")
        .replace("<axis xyz=\"0 0 3\"/>", "<limit effort=\"1\"/>");
    Urdf::parse(&follower).and_then(|urdf| urdf.chain("base", "hand")).expect("a chain");
}
