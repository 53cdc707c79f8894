//! Written descriptions are the models that were fitted, and differ from what was read in joints' origins only.

use body_schema::{
    kinematics::Joint,
    model::{Frame, State},
    robot::{Chain, Fitted, Unwritable, Urdf},
};
use nalgebra::{Isometry3, UnitVector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{
    ROBOTS,
    random::{description, learned, posture},
};

/// The text without what may differ: the `<origin>`s of joints that hold nothing but what may be learned, the values in
/// others, and white space.
fn masked(text: &str) -> String {
    let mut masked = String::new();
    let mut in_joint = false;
    for (index, piece) in text.split('<').enumerate() {
        in_joint = (in_joint || piece.starts_with("joint")) && !piece.starts_with("/joint");
        let (tag, rest) = piece.split_once('>').unwrap_or((piece, ""));
        let is_direct = in_joint && piece.starts_with("origin") && !text_before(text, index).ends_with("-- ");
        let is_direct = is_direct && !text_before(text, index).contains("unknown:tag xmlns");
        if !is_direct {
            masked += "<";
            masked += piece;
            continue;
        }
        let mut kept = tag.trim_end_matches('/').replace(" =", "=").replace("= ", "=");
        for name in ["xyz=", "rpy=", "quat_xyzw="] {
            if let Some(at) = kept.find(name) {
                let quote = &kept[at + name.len()..][..1];
                let end = at + name.len() + 1 + kept[at + name.len() + 1..].find(quote).expect("a closing quote") + 1;
                kept.replace_range(at..end, "");
            }
        }
        masked += kept.trim_start_matches("origin");
        masked += rest;
    }
    masked.replace("</origin>", "").split_whitespace().collect()
}

/// What stands before the piece of that index, back to the piece before.
fn text_before(text: &str, index: usize) -> &str {
    text.split('<').nth(index.saturating_sub(1)).unwrap_or_default()
}

#[test]
fn the_mask_hides_origins_of_joints_alone() {
    let text = "<link><visual><origin xyz=\"1 2 3\"/></visual></link><joint><origin xyz='1' b=\"2\"/><axis xyz=\"0\"/></joint>";
    assert_eq!(masked(text), masked(&text.replace("'1'", "\"1.5\" rpy=\"0\"")));
    for (from, to) in [("1 2 3", "1 2 4"), ("b=\"2\"", "b=\"3\""), ("axis xyz=\"0", "axis xyz=\"1")] {
        assert_ne!(masked(text), masked(&text.replace(from, to)), "{from}");
    }
}

/// Writes `state` into the description, reads it back, and compares all that moves over so many postures.
fn check(text: &str, chain: &Chain, state: &State, postures: usize, rng: &mut ChaCha8Rng) -> Fitted {
    let urdf = Urdf::parse(text).expect("read before");
    let fitted = chain.fitted(state).expect("writable");
    let written = urdf.written(&fitted.chain);
    assert_eq!(masked(text), masked(&written), "{text}\n{written}");
    let back = Urdf::parse(&written).expect("a URDF again").chain(&chain.base, chain.tip()).expect("the same chain");
    assert_eq!(back.names(), chain.names());
    for _ in 0..postures {
        let q = posture(chain, rng);
        let wanted = state.base.inverse()
            * state.frame_at(Frame::Link(state.joints.len()), &q)
            * fitted.frames[state.joints.len()];
        let found = back.tip_at(&q);
        let apart = (found.translation.vector - wanted.translation.vector).norm();
        let turned = found.rotation.angle_to(&wanted.rotation);
        assert!(apart < 1e-9 && turned < 1e-9, "{apart} m, {turned} rad\n{written}");
    }
    assert_eq!(urdf.written(&back_origins(&fitted.chain, &back)), written, "numbers read back exactly");
    fitted
}

/// `chain` with the origins that were read back.
fn back_origins(chain: &Chain, back: &Chain) -> Chain {
    let mut chain = chain.clone();
    for (segment, read) in chain.segments.iter_mut().zip(&back.segments) {
        assert!((segment.origin.translation.vector - read.origin.translation.vector).norm() == 0.0);
        segment.origin.translation = read.origin.translation;
    }
    chain
}

#[test]
fn robots_are_written_as_fitted() {
    for (name, text, base, tip, joints) in ROBOTS {
        let chain = Urdf::parse(text).and_then(|urdf| urdf.chain(base, tip)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(chain.moving().count(), joints, "{name}");
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for offsets in [false, true] {
            let state = learned(&chain, 0.02, 0.005, offsets, &mut rng);
            check(text, &chain, &state, 1000, &mut rng);
        }
    }
}

#[test]
fn what_was_not_learned_is_not_touched() {
    for (name, text, base, tip, _) in ROBOTS {
        let urdf = Urdf::parse(text).expect(name);
        let chain = urdf.chain(base, tip).expect(name);
        assert_eq!(urdf.written(&chain.fitted(&chain.state()).expect("writable").chain), text, "{name}");
        // An axis that moves takes its joint's origin and that of the next along, and no other.
        let mut state = chain.state();
        let Joint::Revolute(line) = &mut state.joints[2] else { panic!("{name}: revolute") };
        line.point += line.direction.cross(&nalgebra::Vector3::new(0.3, 0.2, 0.1)) * 0.01;
        let fitted = chain.fitted(&state).expect("writable").chain;
        let changed: Vec<bool> = fitted.moving().zip(chain.moving()).map(|(a, b)| a.origin != b.origin).collect();
        let wanted: Vec<bool> = (0..changed.len()).map(|joint| (2..4).contains(&joint)).collect();
        assert_eq!(changed, wanted, "{name}");
        assert!(fitted.moving().zip(chain.moving()).all(|(a, b)| a.origin.rotation == b.origin.rotation), "{name}");
    }
}

#[test]
fn what_a_urdf_cannot_hold_is_refused() {
    let (_, text, base, tip, _) = ROBOTS[0];
    let chain = Urdf::parse(text).and_then(|urdf| urdf.chain(base, tip)).expect("a chain");
    let refused = |change: &dyn Fn(&mut State)| {
        let mut state = chain.state();
        change(&mut state);
        chain.fitted(&state).expect_err("unwritable")
    };
    let joint = "panda_joint2".to_owned();
    assert_eq!(refused(&|state| state.corrections[1].ratio = 1.01), Unwritable::Correction { joint: joint.clone() });
    assert_eq!(refused(&|state| state.corrections[1].sine = 0.01), Unwritable::Correction { joint });
    assert_eq!(refused(&|state| state.joints.truncate(6)), Unwritable::Joints { found: 6, wanted: 7 });
    let turned = refused(&|state| {
        let Joint::Revolute(line) = &mut state.joints[3] else { return };
        line.direction = UnitVector3::new_normalize(-line.direction.into_inner());
    });
    assert!(turned.to_string().contains("`panda_joint4` has turned by 180 deg"), "{turned}");
}

#[test]
fn kinematics_are_written_for_templates() {
    let (_, text, base, tip, _) = ROBOTS[2];
    let chain = Urdf::parse(text).and_then(|urdf| urdf.chain(base, tip)).expect("a chain");
    let yaml = chain.kinematics_yaml();
    let shoulder = "kinematics:\n  shoulder_pan_joint:\n    x: 0\n    y: 0\n    z: 0.1273\n    roll: 0\n    pitch: 0\n    \
                    yaw: 0\n  shoulder_lift_joint:\n    x: 0\n    y: 0.220941\n";
    assert!(yaml.starts_with(shoulder), "{yaml}");
    assert_eq!(yaml.lines().count(), 1 + 6 * 7, "moving joints only\n{yaml}");
    let named = text.replace("\"shoulder_pan_joint\"", "\"no\"").replace("\"elbow_joint\"", "\"el: bow\"");
    let yaml = Urdf::parse(&named).and_then(|urdf| urdf.chain(base, tip)).expect("a chain").kinematics_yaml();
    assert!(yaml.contains("\n  \"no\":\n") && yaml.contains("\n  \"el: bow\":\n"), "{yaml}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_robots_are_written_as_fitted(seed: u64, angle in 0.0..1.0, length in 0.0..0.3, offsets: bool) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let text = description(&mut rng);
        let chain = Urdf::parse(&text).and_then(|urdf| urdf.chain("base", "tip")).map_err(|error| {
            TestCaseError::fail(format!("{error}\n{text}"))
        })?;
        let mut state = learned(&chain, angle, length, offsets, &mut rng);
        state.base = Isometry3::translation(1.0, 2.0, 3.0);
        let nominal = chain.state();
        let fitted = check(&text, &chain, &state, 20, &mut rng);
        // The gauge: nothing along or about the axes.
        for (index, (learned, described)) in state.joints.iter().zip(&nominal.joints).enumerate() {
            let described_frame = chain.fitted(&nominal).expect("writable").frames[index + 1];
            let motion = fitted.frames[index + 1] * described_frame.inverse();
            let (w, w0) = (learned.direction(), described.direction());
            prop_assert!((motion * w0.into_inner() - w.into_inner()).norm() < 1e-9);
            prop_assert!((motion.rotation.angle() - w0.angle(&w)).abs() < 1e-6, "no turn about the axis");
            if let (Some(line), Some(old)) = (learned.line(), described.line()) {
                let moved = motion * old.point;
                prop_assert!(line.distance_to(&moved) < 1e-9);
                prop_assert!((moved - old.point).dot(&w).abs() < 1e-9, "no shift along the axis");
            }
        }
    }
}
