//! Sessions with a robot elsewhere, through what they offer to everybody.

mod branches;
mod channels;
mod convergence;
mod refusals;
pub mod robot;

use std::collections::BTreeMap;

use body_schema::{
    ask_tell::{Ask, Event, Happened, Outcome, Refusal, Session, Status, Suggestion, SuggestionState, Why},
    calibration::{Options, Silent, Use},
};
use robot::{Robot, open, quick};
use serde_json::{Value, json};

fn ask(session: &mut Session, client: &str, count: u64) -> Vec<Suggestion> {
    let client = (!client.is_empty()).then(|| client.to_owned());
    let ask = Ask { count: Some(count), client, ..Ask::default() };
    session.suggest(&ask, None).expect("suggestions").suggestions
}

fn apart(a: &BTreeMap<String, f64>, b: &BTreeMap<String, f64>) -> f64 {
    a.iter().map(|(name, q)| (q - b[name]).abs()).fold(0.0, f64::max)
}

fn state(session: &Session, id: u64) -> SuggestionState {
    session.suggestions()[id as usize - 1].state
}

/// Asking twice gives the same; each client has its own; no two are the same posture; all of it is in the events.
#[test]
fn clients_have_suggestions_of_their_own() {
    let mut session = open(quick());
    let left = ask(&mut session, "left", 2);
    let right = ask(&mut session, "right", 1);
    let before = session.events().len();
    assert_eq!((ask(&mut session, "left", 2), ask(&mut session, "left", 1)), (left.clone(), left.clone()));
    assert_eq!(session.events().len(), before, "asking again changes nothing");
    let all: Vec<&Suggestion> = left.iter().chain(&right).collect();
    for (index, one) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|other| apart(&one.configuration, &other.configuration) > 0.05));
        assert_eq!((one.id, one.revision), (index as u64 + 1, index as u64));
        assert!(one.expected_gain.is_some_and(|gain| gain > 0.0) && one.chance_seen == 1.0);
    }
    let expected: Vec<f64> = all.iter().filter_map(|one| one.expected_error_mm_after).collect();
    assert!(expected.len() == 3 && expected.windows(2).all(|pair| pair[1] < pair[0]), "{expected:?}");
    assert_eq!((all[0].travel_rad, all[1].travel_rad.is_some()), (None, true), "nobody knows where it stands at first");
}

/// What was prepared and not committed has not happened, and what was overtaken is refused.
#[test]
fn what_is_prepared_is_not_done() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 5);
    let prepared = session.prepare_suggest(&Ask::default(), None).expect("suggestions");
    assert_eq!((prepared.events().len(), prepared.revision(), session.events().len()), (1, 0, 0));
    let told = robot.sees(&session.suggest(&Ask::default(), None).expect("the same").suggestions[0], 0.0);
    assert!(matches!(session.commit(prepared), Err(Refusal::Stale)));
    let prepared = session.prepare_observe(told.clone(), None).expect("an observation");
    let answer = prepared.answer().clone();
    let Happened::Observed { told: written, answer: stored } = &prepared.events()[0].happened else { panic!("told") };
    assert_eq!((written, stored), (&told, &answer));
    assert_eq!(session.observations().len(), 0);
    assert_eq!(session.commit(prepared).expect("fresh"), answer);
    assert_eq!(session.observations()[0].answer, answer);
}

/// Each outcome leaves the trace that is documented.
#[test]
fn outcomes_and_the_next_choice() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 6);
    for _ in 0..6 {
        let next = ask(&mut session, "", 1).remove(0);
        session.observe(robot.sees(&next, 0.0), None).expect("seen");
    }
    let untouched = session.clone();
    let first = ask(&mut session, "", 1).remove(0);

    // Nobody goes there: what is chosen next does not know of it.
    let mut abandoned = session.clone();
    abandoned.outcome(first.id, Outcome::Abandoned, Some("lunch"), None).expect("pending");
    let anew = ask(&mut abandoned, "", 1).remove(0);
    assert!(apart(&anew.configuration, &first.configuration) < 1e-3, "{anew:?}");
    assert!(matches!(
        abandoned.outcome(first.id, Outcome::Infeasible, None, None),
        Err(Refusal::NotPending { id: 7, state: SuggestionState::Abandoned })
    ));

    // The robot cannot: elsewhere, and farther away the more often it says so.
    let mut refused = session.clone();
    let mut away = Vec::new();
    for _ in 0..8 {
        let next = ask(&mut refused, "", 1).remove(0);
        away.push(apart(&next.configuration, &first.configuration));
        refused.outcome(next.id, Outcome::Infeasible, None, None).expect("pending");
    }
    assert!(away[1] > 0.05 && away.iter().any(|away| *away > 0.4), "{away:?}");

    // Nothing was seen: the surroundings are avoided, and nothing is learned.
    let mut unseen = session.clone();
    let mut told = robot.sees(&first, 0.0);
    told.measurements.insert("marker".to_owned(), Value::Null);
    let answer = unseen.observe(told, None).expect("a miss");
    assert_eq!(
        (answer.seen, answer.innovation_sigmas, state(&unseen, first.id)),
        (false, None, SuggestionState::NotSeen)
    );
    let next = ask(&mut unseen, "", 1).remove(0);
    assert!(apart(&next.configuration, &first.configuration) > 0.1 && next.chance_seen < 1.0, "{next:?}");
    assert_eq!(unseen.belief().map(|it| &it.state), untouched.belief().map(|it| &it.state));

    // The same client asks for others.
    let mut replanned = session;
    let other = ask(&mut replanned, "other", 1).remove(0);
    let anew = replanned.suggest(&Ask { client: Some(String::from("other")), replan: true, ..Ask::default() }, None);
    assert_ne!(anew.expect("another").suggestions[0].id, other.id);
    assert_eq!(
        (state(&replanned, first.id), state(&replanned, other.id)),
        (SuggestionState::Pending, SuggestionState::Superseded)
    );
}

/// Only what was given a time expires, and what comes late is welcome.
#[test]
fn what_expires_can_still_be_observed() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 7);
    let lasting = session.suggest(&Ask::default(), Some(100.0)).expect("one").suggestions.remove(0);
    let brief = Ask { client: Some("brief".to_owned()), expires_s: Some(10.0), ..Ask::default() };
    let brief = session.suggest(&brief, Some(100.0)).expect("one").suggestions.remove(0);
    assert_eq!(brief.expires_at_s, Some(110.0));
    let prepared = session.prepare_expire(109.0).expect("a time");
    assert!(prepared.events().is_empty());
    session.commit(prepared).expect("nothing to do");
    let prepared = session.prepare_expire(1e9).expect("a time");
    session.commit(prepared).expect("fresh");
    assert_eq!(
        (state(&session, lasting.id), state(&session, brief.id)),
        (SuggestionState::Pending, SuggestionState::Expired)
    );
    session.observe(robot.sees(&brief, 0.0), None).expect("late");
    assert_eq!(state(&session, brief.id), SuggestionState::Observed);
    assert_eq!(session.status().observations, 1);
}

/// A session of a start posture and a greatest travel asks for nothing that is out of reach, and drops what has come out of it.
#[test]
fn start_and_greatest_travel_are_respected() {
    let mut calibration = quick();
    calibration["constraints"] = json!({ "start_deg": [0, 10, 20], "greatest_travel_deg": 25 });
    let mut session = open(calibration);
    let robot = Robot::of(&session, 8);
    let most = 25_f64.to_radians() + 1e-9;
    let mut stands = BTreeMap::from(
        [("pan", 0.0), ("lift", 10.0), ("elbow", 20.0)].map(|(name, deg)| (name.to_owned(), f64::to_radians(deg))),
    );
    for _ in 0..6 {
        let next = ask(&mut session, "", 1).remove(0);
        let travel = apart(&next.configuration, &stands);
        assert!(travel <= most && (next.travel_rad.expect("known") - travel).abs() < 1e-9, "{travel}");
        session.observe(robot.sees(&next, 0.0), None).expect("seen");
        stands = next.configuration;
    }
    let pending = ask(&mut session, "", 2);
    let elsewhere: BTreeMap<String, f64> =
        stands.iter().map(|(name, q)| (name.clone(), if *q > 0.0 { q - 1.4 } else { q + 1.4 })).collect();
    session.observe(robot.observation(None, elsewhere.clone(), 0.0), None).expect("measured elsewhere");
    assert!(pending.iter().all(|it| state(&session, it.id) == SuggestionState::Superseded), "out of reach from there");
    assert!(matches!(
        session.events().last(),
        Some(Event { happened: Happened::Superseded { why: Why::Constraints, .. }, .. })
    ));
    let next = ask(&mut session, "", 1).remove(0);
    assert!(apart(&next.configuration, &elsewhere) <= most);
}

/// Once it expects to be as good as is wanted it says so, and goes on if it is asked; a single reading that is far off is told to
/// be an outlier, and named; excluded, it is gone.
#[test]
fn enough_is_said_and_outliers_are_named() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 9);
    let step = |session: &mut Session, off: f64| {
        let next = ask(session, "", 1).remove(0);
        session.observe(robot.sees(&next, off), None).expect("seen")
    };
    assert_eq!((session.enough(), session.status().movements_left), (None, None));
    for _ in 0..20 {
        step(&mut session, 0.0);
        let Status { movements_left, enough, expected_error_mm, .. } = session.status();
        assert_eq!(movements_left == Some(0), enough.is_some());
        assert!(movements_left.is_none_or(|left| left < 60), "{movements_left:?} at {expected_error_mm:?} mm");
    }
    let enough = session.suggest(&Ask::default(), None).expect("one").enough.expect("settled");
    assert!(enough.expected_error_mm < enough.wanted_mm && (enough.wanted_mm, enough.observations) == (2.0, 20));
    let answer = step(&mut session, 0.1);
    assert!(
        answer.outlier_probability.is_some_and(|p| p > 0.9) && answer.innovation_sigmas.is_some_and(|s| s > 10.0),
        "{answer:?}"
    );
    assert!(!answer.body_seems_changed);
    let usual = step(&mut session, 0.0);
    assert!(
        usual.outlier_probability.is_some_and(|p| p < 0.5) && usual.innovation_sigmas.is_some_and(|s| s < 4.0),
        "{usual:?}"
    );
    assert_eq!(session.status().outliers, [21]);
    session.exclude(21, None).expect("there");
    let status = session.status();
    assert_eq!((status.excluded, status.outliers, status.observations), (vec![21], vec![], 22));
    assert!(matches!(session.exclude(23, None), Err(Refusal::UnknownObservation { number: 23, count: 22 })));
}

/// A body that has changed is noticed; what was pending is superseded, and the new body is learned.
#[test]
fn a_changed_body_supersedes_what_is_pending() {
    let mut session = open(quick());
    let mut robot = Robot::of(&session, 10);
    for _ in 0..20 {
        let next = ask(&mut session, "", 1).remove(0);
        session.observe(robot.sees(&next, 0.0), None).expect("seen");
    }
    robot.bend(0.1);
    let waiting = ask(&mut session, "waiting", 1).remove(0);
    let noticed = (0..15).find(|_| {
        let next = ask(&mut session, "", 1).remove(0);
        session.observe(robot.sees(&next, 0.0), None).expect("seen").body_seems_changed
    });
    assert!(noticed.is_some(), "{:?}", session.status());
    assert_eq!(state(&session, waiting.id), SuggestionState::Superseded);
    for _ in 0..15 {
        let next = ask(&mut session, "", 1).remove(0);
        session.observe(robot.sees(&next, 0.0), None).expect("seen");
    }
    assert!(robot.mean_error_mm(&session) < 3.0, "{}", robot.mean_error_mm(&session));
    // Its files are of the body as it is now, too: a table of both bodies gives one that is neither.
    let noticed_at = 20 + noticed.map_or(0, |index| index + 1);
    let rows = session.observations().len() + 1 - noticed_at;
    assert_eq!(session.observations_csv().lines().count(), 1 + rows);
    let found = session.results().expect("a table").case().map(|case| case.rows.len());
    assert_eq!(found.ok(), Some(rows));
    let replayed = Session::from_json(&session.to_json()).expect("its own");
    assert_eq!(replayed.belief().map(|it| &it.state), session.belief().map(|it| &it.state));
}

/// Millimetres told as metres: what was found is no robot that a URDF can hold, and the report says so all the same.
#[test]
fn a_report_says_what_is_wrong_where_no_description_can_be_written() {
    let mut session = open(quick());
    let robot = Robot::of(&session, 12);
    for _ in 0..20 {
        let next = ask(&mut session, "", 1).remove(0);
        let mut told = robot.sees(&next, 0.0);
        for value in told.measurements.values_mut().filter_map(Value::as_array_mut).flatten() {
            *value = json!(1e3 * value.as_f64().expect("a number"));
        }
        session.observe(told, None).expect("seen");
    }
    let results = session.results().expect("a table");
    let report = results.judged(&Options::default(), &Silent).expect("a report").report;
    assert_eq!(report.verdict.r#use, Use::No);
    assert!(report.doubts.iter().any(|doubt| doubt.contains("millimetres")), "{:?}", report.doubts);
}
