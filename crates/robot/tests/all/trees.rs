//! Laws of descriptions whose joints branch.

use std::fmt::Write;

use body_schema_engine::{
    kinematics::Joint,
    model::{Frame, State},
};
use body_schema_robot::{Chain, Urdf};
use nalgebra::{UnitQuaternion, UnitVector3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn vector(rng: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-size..size))
}

/// A random robot of so many links, `l0` the root; joints stand in any order, and some are fixed or mimic `j0`.
fn random_tree(rng: &mut ChaCha8Rng, links: usize) -> String {
    let mut joints: Vec<String> = Vec::new();
    for link in 1..links {
        let parent = if rng.random_bool(0.5) { link - 1 } else { rng.random_range(0..link) };
        let kind = ["revolute", "revolute", "continuous", "prismatic", "fixed"][rng.random_range(0..5)];
        let kind = if link == 1 { "revolute" } else { kind };
        let (at, turn, axis) = (vector(rng, 0.5), vector(rng, 1.5), vector(rng, 1.0));
        let mimic = if link > 1 && rng.random_bool(0.1) {
            "<mimic joint=\"j0\" multiplier=\"-2\" offset=\"0.1\"/>"
        } else {
            ""
        };
        joints.push(format!(
            "<joint name=\"j{index}\" type=\"{kind}\"><origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/><parent link=\"l{parent}\"/>\
             <child link=\"l{link}\"/><axis xyz=\"{} {} {}\"/><limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/>\
             {mimic}</joint>\n",
            at.x, at.y, at.z, turn.x, turn.y, turn.z, axis.x, axis.y, axis.z,
            index = link - 1,
        ));
    }
    let mut text = "<robot name=\"tree\">\n".to_owned();
    for link in 0..links {
        let _ = writeln!(text, "<link name=\"l{link}\"/>");
    }
    while !joints.is_empty() {
        text += &joints.swap_remove(rng.random_range(0..joints.len()));
    }
    text + "</robot>\n"
}

/// A base and some tips, the first of which hangs on it by a joint that moves.
fn some_branches(urdf: &Urdf, links: usize, rng: &mut ChaCha8Rng) -> Option<Chain> {
    let base = format!("l{}", rng.random_range(0..links));
    let hangs = |link: &String| urdf.chain(&base, link).is_ok();
    let behind: Vec<String> = (0..links).map(|link| format!("l{link}")).filter(hangs).collect();
    if behind.is_empty() {
        return None;
    }
    let tips: Vec<&str> =
        (0..rng.random_range(1..=4)).map(|_| behind[rng.random_range(0..behind.len())].as_str()).collect();
    Some(urdf.branches(&base, &tips).expect("they hang on it"))
}

/// The state with every axis a little elsewhere, and readings off.
fn learned(chain: &Chain, rng: &mut ChaCha8Rng) -> State {
    let mut state = chain.state();
    for (joint, correction) in state.joints.iter_mut().zip(&mut state.corrections) {
        let turn = UnitQuaternion::from_scaled_axis(vector(rng, 0.2));
        let turned = |w: &UnitVector3<f64>| UnitVector3::new_normalize(turn * w.into_inner());
        match joint {
            Joint::Revolute(line) => {
                line.direction = turned(&line.direction);
                line.point += vector(rng, 0.05);
                *line = line.slid(rng.random_range(-0.5..0.5));
            }
            Joint::Prismatic(direction) => *direction = turned(direction),
        }
        correction.offset = rng.random_range(-0.1..0.1);
    }
    state
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Along each tip the branches are the chain to it, to the last bit; the first tip's way comes first, and each joint once.
    #[test]
    fn branches_are_chains_that_share_their_beginnings(seed: u64, links in 2_usize..16) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let urdf = Urdf::parse(&random_tree(&mut rng, links)).expect("a URDF");
        let Some(chain) = some_branches(&urdf, links, &mut rng) else { return Ok(()) };
        let names = chain.names();
        for (index, segment) in chain.segments.iter().enumerate() {
            prop_assert!(segment.parent().is_none_or(|parent| parent < index));
            prop_assert!(chain.segments[..index].iter().all(|other| other.name != segment.name));
        }
        let first = urdf.chain(&chain.base, chain.tip()).expect("a chain");
        prop_assert_eq!(&names[..first.names().len()], &first.names()[..]);
        prop_assert!(chain.tips().count() > 1 || first == chain);
        let readings: Vec<f64> = chain.readings.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
        let positions = chain.positions(&readings);
        let (poses, state, frames) = (chain.links(&positions), chain.state(), chain.frames());
        for tip in chain.tips() {
            let alone = urdf.chain(&chain.base, tip).expect("a chain");
            let own = alone.readings.iter().map(|it| {
                readings[chain.readings.iter().position(|other| other.name == it.name).expect("it moves both")]
            });
            let wanted = alone.tip_at(&alone.positions(&own.collect::<Vec<_>>()));
            let index = (0..poses.len()).find(|link| chain.link(*link) == tip).expect("a link");
            prop_assert_eq!(poses[index], wanted);
            let (link, frame) = frames[index];
            let by_model = state.frame_at(Frame::Link(link), &positions) * frame;
            prop_assert!((by_model.to_homogeneous() - wanted.to_homogeneous()).amax() < 1e-12);
            prop_assert_eq!(urdf.fixed_on(&chain, tip), Some((link, frame)));
        }
    }

    /// What is written has every link where the learned state has it, on all branches.
    #[test]
    fn branches_are_written_as_fitted(seed: u64, links in 2_usize..16) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let urdf = Urdf::parse(&random_tree(&mut rng, links)).expect("a URDF");
        let Some(chain) = some_branches(&urdf, links, &mut rng) else { return Ok(()) };
        let state = learned(&chain, &mut rng);
        let fitted = chain.fitted(&state).expect("writable");
        let tips: Vec<&str> = chain.tips().collect();
        let written = Urdf::parse(&urdf.written(&fitted.chain)).expect("a URDF");
        let back = written.branches(&chain.base, &tips).expect("the same branches");
        prop_assert_eq!(back.names(), chain.names());
        for _ in 0..5 {
            let q: Vec<f64> = chain.names().iter().map(|_| rng.random_range(-1.5..1.5)).collect();
            let poses = back.links(&q);
            for (link, body) in chain.bodies().into_iter().enumerate() {
                let wanted = state.frame_at(Frame::Link(link), &q) * fitted.frames[link];
                prop_assert!((poses[body].to_homogeneous() - wanted.to_homogeneous()).amax() < 1e-9, "{}", back.link(body));
            }
        }
        // What was not learned is not touched.
        prop_assert_eq!(urdf.written(&chain.fitted(&chain.state()).expect("writable").chain), urdf.written(&chain));
    }
}

const TORSO: &str = r#"<robot name="torso">
  <link name="floor"/> <link name="base"/> <link name="torso"/> <link name="left"/> <link name="right"/> <link name="eye"/>
  <link name="alone"/> <link name="other"/>
  <joint name="stands" type="fixed"><parent link="floor"/><child link="base"/></joint>
  <joint name="lifts" type="prismatic"><parent link="base"/><child link="torso"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="l" type="continuous"><parent link="torso"/><child link="left"/><axis xyz="0 1 0"/></joint>
  <joint name="r" type="continuous"><parent link="torso"/><child link="right"/><axis xyz="0 1 0"/></joint>
  <joint name="sees" type="fixed"><parent link="left"/><child link="eye"/><origin xyz="0.1 0 0"/></joint>
  <joint name="a" type="continuous"><parent link="alone"/><child link="other"/></joint>
</robot>"#;

#[test]
fn what_does_not_branch_is_told() {
    let urdf = Urdf::parse(TORSO).expect("a URDF");
    for (base, tips, what, hint) in [
        (
            "left",
            &["left", "right"][..],
            "link `right` does not hang on `left`",
            "name as base one of torso, base, floor",
        ),
        ("base", &["left", "other"], "link `other` does not hang on `base`", "no link carries all of `left`, `other`"),
        ("base", &["left", "floor"], "link `floor` does not hang on `base`", "`floor` hangs on nothing"),
        ("base", &["left", "rigth"], "this robot has no link `rigth`", "did you mean `right`?"),
        ("left", &["left", "eye"], "no joint moves between `left` and `left`, `eye`", "name links with a revolute"),
        ("base", &[], "no joint moves between `base` and ", "name links with a revolute"),
    ] {
        let error = urdf.branches(base, tips).expect_err(what).to_string();
        assert!(error.contains(what) && error.contains(hint), "{tips:?}: {error}");
    }
    for (links, wanted) in [
        (&["left", "right"][..], Some("torso")),
        (&["eye", "left"], Some("left")),
        (&["eye", "right", "base"], Some("base")),
        (&["left", "other"], None),
        (&["left", "nowhere"], None),
        (&[], None),
    ] {
        assert_eq!(urdf.ancestor(links), wanted, "{links:?}");
    }
    let chain = urdf.branches("torso", &["right", "left"]).expect("branches");
    assert_eq!((chain.names(), chain.bodies()), (vec!["r".to_owned(), "l".to_owned()], vec![0, 1, 2]));
    assert_eq!(urdf.fixed_on(&chain, "eye").expect("on the left").0, 2);
    assert_eq!((urdf.fixed_on(&chain, "base"), urdf.fixed_on(&chain, "nowhere")), (None, None));
    // A tip names the link of the model that it is on.
    let chain = urdf.branches("base", &["eye", "right"]).expect("branches");
    let named: Vec<&str> = chain.bodies().into_iter().map(|link| chain.link(link)).collect();
    assert_eq!(named, ["base", "torso", "eye", "right"]);
}
