//! What sessions promise, whatever is asked and told in whatever order.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use proptest::{
    prelude::*,
    test_runner::{Config, TestCaseError},
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use super::*;
use body_schema_engine::{estimation::Belief, kinematics::Joint, model::State};

/// Three joints, short searches, few hypotheses.
pub(super) fn calibration() -> Value {
    let joint = |name: &str, parent: &str, child: &str, xyz: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    let urdf = format!(
        "<robot name=\"three\"><link name=\"base\"/><link name=\"a\"/><link name=\"b\"/><link name=\"tip\"/>{}{}{}</robot>",
        joint("pan", "base", "a", "0 0 0.3", "0 0 1"),
        joint("lift", "a", "b", "0.05 0 0.1", "0 1 0"),
        joint("elbow", "b", "tip", "0.4 0 0", "0 1 0"),
    );
    json!({
        "name": "three",
        "robot": { "urdf": urdf },
        "target": [{ "name": "marker", "at_m": [0.3, 0.0, 0.05], "known": { "to_m": 0.02 } }],
        "base": { "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0] },
        "sensor": { "channel": "position", "target": "marker", "sigma_m": 0.001 },
        "prior": { "direction_rad": 0.05, "point_m": 0.01 },
        "smoother": { "hypotheses": 2, "spawned": 1 },
        "selection": { "evaluations": 30, "ahead": 2 },
        "settled": { "expected_prediction_m": 0.002 },
    })
}

pub(super) fn session(calibration: Value) -> Session {
    Session::open(Setup::new(calibration)).unwrap_or_else(|error| panic!("{error}"))
}

/// The described robot with its axes shifted and its marker elsewhere.
pub(super) fn truth(session: &Session) -> State {
    let mut state = session.scenario().robot.state.clone();
    for (index, joint) in state.joints.iter_mut().enumerate() {
        if let Joint::Revolute(line) = joint {
            line.point += Vector3::new(0.004, -0.003, 0.002) * (index as f64 - 0.7);
        }
    }
    let marker = state.marker();
    state.with_marker(marker + Vector3::new(0.006, 0.004, -0.005))
}

pub(super) fn marker(truth: &State, posture: &BTreeMap<String, f64>, names: &[String]) -> Point3<f64> {
    truth.target_at(0, &names.iter().map(|name| posture[name]).collect::<Vec<_>>())
}

/// An observation of the truth, off by `off` along x.
pub(super) fn seen(session: &Session, id: Option<u64>, posture: BTreeMap<String, f64>, off: f64) -> Observation {
    let at = marker(&truth(session), &posture, &session.scenario().robot.names);
    let measurements = BTreeMap::from([("marker".to_owned(), json!([at.x + off, at.y, at.z]))]);
    Observation { suggestion_id: id, configuration: posture, measurements }
}

/// What can be asked or told.
#[derive(Clone, Debug)]
enum Call {
    Suggest {
        count: u64,
        client: usize,
        replan: bool,
        expires: bool,
    },
    /// A posture that somebody wants, `at` for each joint: within limits and beyond them.
    Want {
        at: f64,
        client: usize,
    },
    /// Of one of the suggestions, where there is one; as executed, which is not quite as suggested.
    Observe {
        which: Option<usize>,
        moved: f64,
        off: f64,
        sees: bool,
    },
    Outcome {
        which: usize,
        infeasible: bool,
    },
    Exclude(usize),
    Include(usize),
    Wrong(usize),
}

fn calls() -> impl Strategy<Value = Vec<Call>> {
    let call = prop_oneof![
        4 => (1..3_u64, 0..3_usize, prop::bool::weighted(0.2), prop::bool::weighted(0.2))
            .prop_map(|(count, client, replan, expires)| Call::Suggest { count, client, replan, expires }),
        2 => (-2.0..2.0, 0..3_usize).prop_map(|(at, client)| Call::Want { at, client }),
        6 => (prop::option::weighted(0.8, 0..8_usize), -0.1..0.1, prop_oneof![5 => -1e-3..1e-3, 1 => 0.1..0.2], prop::bool::weighted(0.85))
            .prop_map(|(which, moved, off, sees)| Call::Observe { which, moved, off, sees }),
        2 => (0..8_usize, any::<bool>()).prop_map(|(which, infeasible)| Call::Outcome { which, infeasible }),
        1 => (0..8_usize).prop_map(Call::Exclude),
        1 => (0..8_usize).prop_map(Call::Include),
        1 => (0..8_usize).prop_map(Call::Wrong),
    ];
    prop::collection::vec(call, 4..16)
}

/// Every joint at the same position.
fn posture(at: f64) -> BTreeMap<String, f64> {
    ["pan", "lift", "elbow"].map(|name| (name.to_owned(), at)).into()
}

const CLIENTS: [Option<&str>; 3] = [None, Some("left"), Some("right")];

fn call(session: &mut Session, call: &Call, now: f64) -> Result<(), Refusal> {
    let count = session.suggestions().len();
    let told = session.observations().len() as u64;
    match *call {
        Call::Suggest { count, client, replan, expires } => {
            let client = CLIENTS[client].map(str::to_owned);
            let ask = Ask { count: Some(count), client, replan, expires_s: expires.then_some(2.5), ..Ask::default() };
            session.suggest(&ask, Some(now)).map(drop)
        }
        Call::Want { at, client } => {
            let client = CLIENTS[client].map(str::to_owned);
            let ask = Ask { client, wanted: vec![posture(at)], ..Ask::default() };
            session.suggest(&ask, Some(now)).map(drop)
        }
        Call::Observe { which, moved, off, sees } => {
            let which = which.filter(|_| count > 0).map(|which| which % count);
            let mut posture = match which {
                Some(index) => session.suggestions()[index].configuration.clone(),
                None => posture(moved),
            };
            posture.values_mut().for_each(|q| *q = (*q + moved).clamp(-1.5, 1.5));
            let id = which.map(|index| session.suggestions()[index].id);
            let mut observation = seen(session, id, posture, off);
            if !sees {
                observation.measurements.values_mut().for_each(|reading| *reading = Value::Null);
            }
            session.observe(observation, Some(now)).map(drop)
        }
        Call::Outcome { which, infeasible } => {
            let state = if infeasible { Outcome::Infeasible } else { Outcome::Abandoned };
            session.outcome((which % count.max(1)) as u64 + 1, state, Some("cable"), Some(now)).map(drop)
        }
        Call::Exclude(which) => session.exclude(which as u64 % told.max(1) + 1, Some(now)),
        Call::Include(which) => session.include(which as u64 % told.max(1) + 1, Some(now)),
        Call::Wrong(which) => wrong(session, which).map(|()| panic!("{which} was accepted")),
    }
}

/// Calls that are refused whatever has happened.
fn wrong(session: &mut Session, which: usize) -> Result<(), Refusal> {
    let observation = seen(session, None, posture(0.1), 0.0);
    let with = |name: &str, reading: Value| Observation {
        measurements: BTreeMap::from([(name.to_owned(), reading)]),
        ..observation.clone()
    };
    match which {
        0 => session.suggest(&Ask { count: Some(0), ..Ask::default() }, None).map(drop),
        1 => session.suggest(&Ask { expires_s: Some(1.0), ..Ask::default() }, None).map(drop),
        2 => session.observe(with("markr", json!([0, 0, 0])), None).map(drop),
        3 => session.observe(with("marker", json!([0, 0])), None).map(drop),
        4 => session.observe(Observation { suggestion_id: Some(999), ..observation }, None).map(drop),
        5 => {
            let configuration = BTreeMap::from([("pan".to_owned(), 0.0)]);
            session.observe(Observation { configuration, ..observation }, None).map(drop)
        }
        6 => session.outcome(0, Outcome::Abandoned, None, None).map(drop),
        _ => session.exclude(0, None),
    }
}

/// Everything that may not differ between a session and the same replayed.
fn standing(session: &Session) -> (State, Option<nalgebra::DMatrix<f64>>, Status, Vec<Suggestion>) {
    let Belief { state, covariance, .. } = session.belief().expect("an agent");
    let suggestions = session.suggestions().iter().map(|it| (**it).clone()).collect();
    (state.clone(), covariance.clone(), session.status(), suggestions)
}

fn next(session: &Session) -> Result<Vec<Suggestion>, String> {
    let ask = Ask { count: Some(2), client: Some("next".to_owned()), ..Ask::default() };
    let prepared = session.prepare_suggest(&ask, None).map_err(|refused| refused.to_string())?;
    Ok(prepared.answer().suggestions.clone())
}

proptest! {
    #![proptest_config(Config { cases: 24, failure_persistence: None, ..Config::default() })]

    /// A session replayed from its JSON stands where it stood, chooses as it would have, and what is refused has changed nothing.
    #[test]
    fn replaying_gives_the_session_again(calls in calls()) {
        let mut session = session(calibration());
        for (at, wanted) in calls.iter().enumerate() {
            let before = (session.events().len(), standing(&session));
            if call(&mut session, wanted, at as f64).is_err() {
                prop_assert_eq!(&before, &(session.events().len(), standing(&session)), "{:?}", wanted);
            }
        }
        let replayed = Session::from_json(&session.to_json()).expect("its own");
        prop_assert_eq!(replayed.events(), session.events());
        prop_assert_eq!(standing(&replayed), standing(&session));
        prop_assert_eq!(replayed.latest(), session.latest());
        let history = replayed.history();
        prop_assert_eq!(history.last(), Some(&session.report()));
        prop_assert_eq!(next(&replayed), next(&session));
    }

    /// What was excluded and is included again was never excluded, as far as is believed.
    #[test]
    fn what_is_included_again_was_never_excluded(calls in calls(), which in 0..16_u64) {
        let mut session = session(calibration());
        for (at, wanted) in calls.iter().enumerate() {
            if !matches!(wanted, Call::Exclude(_) | Call::Include(_)) {
                drop(call(&mut session, wanted, at as f64));
            }
        }
        let count = session.observations().len() as u64;
        if count > 0 {
            let number = which % count + 1;
            let before = standing(&session);
            session.exclude(number, None).expect("there");
            prop_assert_eq!(&session.status().excluded, &vec![number]);
            session.include(number, None).expect("there");
            let after = standing(&session);
            prop_assert_eq!((&before.0, &before.1), (&after.0, &after.1));
        }
    }
}

/// A session replayed with a checkpoint of each of its steps.
fn with_checkpoints(session: &Session) -> Vec<Checkpoint> {
    let mut made = Vec::new();
    let replayed = Session::replay_from(session.setup().clone(), session.events().to_vec(), None, &mut |step| {
        let checkpoint = step.checkpoint().expect("a smoother keeps what it has learned");
        let checkpoint = Checkpoint::from_bytes(&checkpoint.to_bytes()).expect("its own");
        assert_eq!(checkpoint.step(), step.step());
        made.push(checkpoint);
        true
    });
    replayed.expect("it happened");
    made
}

/// The same session from a checkpoint on, and the numbers of the steps that were replayed.
fn from(session: &Session, checkpoint: &Checkpoint) -> (Session, Vec<u64>) {
    let mut steps = Vec::new();
    let (setup, events) = (session.setup().clone(), session.events().to_vec());
    let replayed = Session::replay_from(setup, events, Some(checkpoint), &mut |step| {
        steps.push(step.step());
        true
    });
    (replayed.expect("it serves"), steps)
}

/// Whatever has happened, a session from a checkpoint on is the session, and what is excluded from there on is excluded.
fn goes_on_from(session: &Session, checkpoint: &Checkpoint) -> Result<(), TestCaseError> {
    let last = session.latest().step;
    let (replayed, steps) = from(session, checkpoint);
    prop_assert_eq!(steps, (checkpoint.step() + 1..=last).collect::<Vec<_>>());
    prop_assert_eq!(standing(&replayed), standing(session));
    prop_assert_eq!(replayed.latest(), session.latest());
    prop_assert_eq!(replayed.report(), session.report());
    prop_assert_eq!(next(&replayed), next(session));
    Ok(())
}

proptest! {
    #![proptest_config(Config { cases: 16, failure_persistence: None, ..Config::default() })]

    #[test]
    fn a_session_goes_on_from_a_checkpoint(calls in calls(), which in any::<prop::sample::Index>()) {
        let mut session = session(calibration());
        for (at, wanted) in calls.iter().enumerate() {
            drop(call(&mut session, wanted, at as f64));
        }
        let made = with_checkpoints(&session);
        let serving: Vec<&Checkpoint> = made.iter().filter(|made| made.serves(session.events())).collect();
        // All but those that nothing that counts comes after.
        prop_assert_eq!(serving.len() as u64, session.latest().step);
        if serving.is_empty() {
            return Ok(());
        }
        let checkpoint = which.get(&serving);
        goes_on_from(&session, checkpoint)?;
        // What comes after it can be excluded from there on, what came before cannot.
        let told = session.observations().len() as u64;
        let prepared = session.prepare_mark((told, true), None, &mut |_| Some((*checkpoint).clone()), &mut |_| true);
        let mut other = session.clone();
        other.exclude(told, None).expect("there");
        if let Ok(prepared) = prepared {
            session.commit(prepared).expect("at once");
            prop_assert_eq!(standing(&session), standing(&other));
        } else {
            // Nothing that counts would be left after it.
            prop_assert!(!checkpoint.serves(other.events()));
        }
        let mut early = session.clone();
        early.exclude(1, None).expect("there");
        prop_assert!(made[1..].iter().all(|made| early.events().len() == session.events().len() || !made.serves(early.events())));
    }
}

/// Where measurements have settled, noise is learned, readings are outliers and errors run along the chain.
#[test]
fn a_long_session_goes_on_from_a_checkpoint() {
    let mut unknown = calibration();
    unknown["smoother"]["noise"] = json!("unknown");
    for (case, calibration) in [calibration(), unknown].into_iter().enumerate() {
        let mut session = session(calibration);
        for index in 0..110_u32 {
            let turn = |joint: u32| 1.3 * (f64::from(index * (joint + 2) + joint) * 0.7).sin();
            let names = ["pan", "lift", "elbow"];
            let posture = names.iter().zip(0..).map(|(name, joint)| ((*name).to_owned(), turn(joint))).collect();
            let off = if index % 17 == 5 { 0.2 } else { 1e-3 * (f64::from(index) * 2.3).sin() };
            session.observe(seen(&session, None, posture, off), None).expect("observed");
        }
        let made = with_checkpoints(&session);
        for step in [3, 50, 80, 109] {
            goes_on_from(&session, &made[step]).unwrap_or_else(|error| panic!("case {case}, step {step}: {error}"));
        }
        assert!(made[100].to_bytes().len() < 200_000, "{}", made[100].to_bytes().len());
    }
}

/// A checkpoint of another session, or of another robot, is refused.
#[test]
fn a_foreign_checkpoint_does_not_serve() {
    let observed = |calibration: Value, count: u32| {
        let mut session = session(calibration);
        for index in 0..count {
            let posture = ["pan", "lift", "elbow"].map(|name| (name.to_owned(), 0.1 * f64::from(index))).into();
            session.observe(seen(&session, None, posture, 0.0), None).expect("observed");
        }
        session
    };
    let mut other = calibration();
    other.as_object_mut().expect("keys").remove("base");
    let (long, short) = (observed(calibration(), 8), observed(other, 8));
    let foreign = &with_checkpoints(&short)[5];
    let replayed = Session::replay_from(long.setup().clone(), long.events().to_vec(), Some(foreign), &mut |_| true);
    assert!(matches!(replayed, Err(ReplayError::Event { index: 5, .. })));
    assert!(!foreign.serves(&long.events()[..5]), "nothing comes after it");
    assert!(Checkpoint::from_bytes(&foreign.to_bytes()[..40]).is_none());
}

/// An arm that can reach its own first link.
fn long_arm(clearance: Option<f64>) -> Setup {
    let links = ["base", "a", "b", "c", "tip"];
    let joints: String = (links.windows(2).zip(["0 0 0.2", "0.3 0 0", "0.3 0 0", "0.3 0 0"]).zip(["0 0 1", "0 1 0", "0 1 0", "0 1 0"]))
        .map(|((ends, xyz), axis)| {
            let [parent, child] = [ends[0], ends[1]];
            format!(
                "<joint name=\"to-{child}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
                 <axis xyz=\"{axis}\"/><limit lower=\"-2.7\" upper=\"2.7\" effort=\"1\" velocity=\"1\"/></joint>"
            )
        })
        .collect();
    let links: String = links.iter().map(|link| format!("<link name=\"{link}\"/>")).collect();
    let mut calibration = calibration();
    calibration["robot"]["urdf"] = format!("<robot name=\"long\">{links}{joints}</robot>").into();
    if let Some(clearance) = clearance {
        calibration["constraints"] = json!({ "self_clearance_m": clearance });
    }
    Setup::new(calibration)
}

/// The least distance between the first and the last links in a posture, by points along them.
fn least_apart(session: &Session, posture: &BTreeMap<String, f64>) -> f64 {
    let robot = &session.scenario().robot;
    let bones = robot.state.skeleton(&robot.names.iter().map(|name| posture[name]).collect::<Vec<_>>());
    let along = |link: usize| (0..=50).map(move |k| (link, f64::from(k) / 50.0));
    let at = |(link, share): (usize, f64)| bones[link] + (bones[link + 1] - bones[link]) * share;
    let pairs = (0..bones.len() - 1).flat_map(|one| (one + 2..bones.len() - 1).map(move |other| (one, other)));
    let distances =
        pairs.flat_map(|(one, other)| along(one).flat_map(move |a| along(other).map(move |b| (at(a) - at(b)).norm())));
    distances.fold(f64::INFINITY, f64::min)
}

#[test]
fn no_suggestion_folds_an_arm_onto_itself() {
    let folded = |clearance: Option<f64>, seed: u64| {
        let mut session = Session::open(Setup { seed, ..long_arm(clearance) }).expect("a session");
        let mut least = f64::INFINITY;
        for at in 0..8 {
            let asked = session.suggest(&Ask::default(), Some(f64::from(at))).expect("a suggestion");
            let suggestion = asked.suggestions[0].clone();
            least = least.min(least_apart(&session, &suggestion.configuration));
            let seen = seen(&session, Some(suggestion.id), suggestion.configuration.clone(), 0.0);
            session.observe(seen, Some(f64::from(at))).expect("observed");
        }
        least
    };
    let seeds = 1001..1005;
    let unbound = seeds.clone().map(|seed| folded(Some(0.0), seed)).fold(f64::INFINITY, f64::min);
    assert!(unbound < 0.09, "it would: {unbound} m");
    // The arm is 1.2 m long: 8 % of it, but for how far points along links are apart.
    for seed in seeds {
        let least = folded(None, seed);
        assert!(least > 0.096 - 1e-9, "seed {seed}: {least} m");
    }
}

#[test]
fn a_wanted_posture_that_folds_an_arm_is_refused_with_its_links() {
    let mut session = Session::open(long_arm(None)).expect("a session");
    let posture = [("to-a", 0.1), ("to-b", 1.6), ("to-c", 1.6), ("to-tip", 1.5)];
    let wanted = vec![posture.map(|(name, at)| (name.to_owned(), at)).into()];
    let refused = session.suggest(&Ask { wanted: wanted.clone(), ..Ask::default() }, None).expect_err("it folds");
    let said = refused.to_string();
    assert!(said.contains("wanted[0]") && said.contains("clearance") && said.contains("`marker`"), "{said}");
    // Its owner knows better.
    let mut session = Session::open(long_arm(Some(0.0))).expect("a session");
    session.suggest(&Ask { wanted, ..Ask::default() }, None).expect("allowed");
}

/// That arm with a pedestal and a hand that are thicker than what stands for links without a shape: as `<collision>`s of its description,
/// or as shapes beside it.
fn thick_arm(beside: bool) -> Setup {
    let mut setup = long_arm(None);
    let sides = [("base", [0.3, 0.3, 0.5]), ("tip", [0.2, 0.2, 0.2])];
    if beside {
        let corner = |half: [f64; 3], index: usize| {
            [0, 1, 2].map(|side| if index >> side & 1 == 1 { half[side] } else { -half[side] })
        };
        let hull =
            |sides: [f64; 3]| (0..8).map(|index| corner(sides.map(|side| side / 2.0), index)).collect::<Vec<_>>();
        let hulls: BTreeMap<&str, Vec<Vec<[f64; 3]>>> = sides.map(|(link, sides)| (link, vec![hull(sides)])).into();
        return setup.with_shapes(&json!(hulls).to_string());
    }
    let mut urdf = setup.urdf().to_owned();
    for (link, [x, y, z]) in sides {
        let shape = format!("<collision><geometry><box size=\"{x} {y} {z}\"/></geometry></collision>");
        urdf = urdf.replace(&format!("<link name=\"{link}\"/>"), &format!("<link name=\"{link}\">{shape}</link>"));
    }
    setup.calibration["robot"]["urdf"] = urdf.into();
    setup
}

/// The least distance from the hand's corners, sides and inside, by points of it, to the pedestal, both as [`thick_arm`] has them.
fn hand_to_pedestal(session: &Session, posture: &BTreeMap<String, f64>) -> f64 {
    let robot = &session.scenario().robot;
    let chain = &robot.described.as_ref().expect("a URDF").chain;
    let tip = chain.tip_at(&robot.names.iter().map(|name| posture[name]).collect::<Vec<_>>());
    let steps = || (-5..=5).map(|k| f64::from(k) / 50.0);
    let points = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z])));
    let distances = points.map(|point| {
        let at = tip.transform_point(&point.into());
        let outside = [0.15, 0.15, 0.25].iter().zip(at.iter()).map(|(half, at)| (at.abs() - half).max(0.0).powi(2));
        outside.sum::<f64>().sqrt()
    });
    distances.fold(f64::INFINITY, f64::min)
}

#[test]
fn what_links_are_made_of_is_held_apart() {
    let setups = [thick_arm(false), thick_arm(true)];
    let sessions = setups.map(|setup| Session::open(setup).expect("a session"));
    let bare = Session::open(long_arm(None)).expect("a session");
    let allows = |session: &Session, posture: &[f64]| {
        session.scenario().constraints.as_ref().expect("held apart").allow(None, posture)
    };
    let (mut met, mut missed, mut free) = (0, 0, 0);
    let mut rng = ChaCha8Rng::seed_from_u64(1001);
    for _ in 0..400 {
        let posture = sessions[0].scenario().robot.limits.draw(&mut rng);
        let is_allowed = allows(&sessions[0], &posture);
        assert_eq!(is_allowed, allows(&sessions[1], &posture), "as in the description, so beside it");
        let named = sessions[0].scenario().robot.names.iter().cloned().zip(posture.iter().copied()).collect();
        if hand_to_pedestal(&sessions[0], &named) < 0.01 {
            (met, missed) = (met + 1, missed + usize::from(allows(&bare, &posture)));
            assert!(!is_allowed, "{posture:?}");
        } else {
            free += usize::from(is_allowed);
        }
    }
    assert!(
        met > 20 && missed > 10 && free > 200,
        "{met} meet, of which {missed} do so for thin links, and {free} are free"
    );
}

#[test]
fn a_wanted_posture_in_which_shapes_meet_is_refused_with_their_links() {
    let mut session = Session::open(thick_arm(true)).expect("a session");
    let posture = [("to-a", 0.0), ("to-b", 0.74), ("to-c", 1.73), ("to-tip", -0.37)];
    let posture: BTreeMap<String, f64> = posture.map(|(name, at)| (name.to_owned(), at)).into();
    assert!(hand_to_pedestal(&session, &posture) < 0.01);
    let refused =
        session.suggest(&Ask { wanted: vec![posture], ..Ask::default() }, None).expect_err("it hits").to_string();
    assert!(
        refused.contains("`base` and `tip` would be 0.000 m apart, nearer than the clearance of 0.009 m"),
        "{refused}"
    );
}

#[test]
fn shapes_that_are_none_are_refused() {
    for (shapes, said) in [
        ("{\"base\": [[[0, 0]]]}", "shapes.json is no file of shapes: invalid length 2"),
        ("{\"hand\": [[[0, 0, 0]]]}", "shapes.json has shapes of `hand`, which is no link"),
    ] {
        let refused = Session::open(long_arm(None).with_shapes(shapes)).map(|_| ()).expect_err(said).to_string();
        assert!(refused.contains("robot.shapes") && refused.contains(said), "{refused}");
    }
}

/// How much the usual clearance of two robots is, and how many of their postures it excludes: the first has a box at its end.
#[test]
fn the_usual_clearance_leaves_most_postures() {
    let robots = [
        (include_str!("../../../scenarios/ur10.urdf"), "base_link", "tool0", 0.0175, 0.124),
        (include_str!("../../../scenarios/panda.urdf"), "panda_link0", "panda_link8", 0.079, 0.0385),
    ];
    for (urdf, base, tip, clearance, excluded) in robots {
        let session = Session::open(Setup::from_urdf(urdf, Some(base), Some(tip))).expect("a session");
        let constraints = session.scenario().constraints.as_ref().expect("held apart");
        let least = constraints.clearance.as_ref().expect("held apart").least();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let draws = (0..2000).map(|_| session.scenario().robot.limits.draw(&mut rng));
        let share = draws.filter(|posture| !constraints.allow(None, posture)).count() as f64 / 2000.0;
        assert!((least - clearance).abs() < 1e-3 && (share - excluded).abs() < 0.02, "{least} m, {share}");
    }
}

/// A session on a robot whose joints branch has the joints that a calibration of the same file has: those that move what is measured.
#[test]
fn branches_are_carried_as_in_a_calibration() {
    let urdf = include_str!("../../calibration/src/laws/two_arms.urdf");
    let target = |name: &str, link: &str| json!({ "name": name, "link": link, "at_m": [0.0, 0.0, 0.05], "rpy_deg": [0.0, 0.0, 0.0] });
    let setup = Setup::new(json!({
        "robot": { "urdf": urdf }, "target": [target("tag", "left_hand"), target("plate", "head")],
        "sensor": [{ "channel": "position", "target": "tag", "in": "plate" }],
    }));
    let names = setup.scenario().expect("valid").robot.names;
    assert!(!names.contains(&"torso_lift".to_owned()) && names.contains(&"head_pan".to_owned()), "{names:?}");
    // One that carries the other says nothing of where to begin: the root does, as ever.
    let setup = Setup::new(json!({
        "robot": { "urdf": urdf },
        "target": [target("tag", "left_hand"), target("shoulder", "left_shoulder")],
    }));
    assert!(setup.scenario().expect("valid").robot.names.contains(&"torso_lift".to_owned()));
}
