//! How runs stop, how they ended, and whether that was luck.

use body_schema_panel::{host::Command, outcome::Outcome, play::SPEEDS};
use egui::Key;
use serde_json::{Value, json};

use crate::support::Page;

use Outcome::HeldOut;

fn steps(commands: &[Command]) -> Option<(u64, u64)> {
    commands.iter().find_map(|command| match command {
        Command::Step { count, frames, .. } => Some((*count, *frames)),
        _ => None,
    })
}

#[test]
fn a_run_stops_when_its_story_is_told_and_says_who_needed_what() {
    let mut page = Page::with_session("speed=50");
    page.press(Key::Space);
    page.make_steps(1000);
    let result = page.server.result();
    let converged = |name: &str| {
        let learner = result.learners.iter().find(|learner| learner.name == name);
        learner.and_then(|learner| learner.converged_at).expect("it converges")
    };
    let (active, random, global) = (converged("active"), converged("random"), converged("global"));
    let latest = page.harness.state().history.latest();
    // Confirmed by twenty movements; made by the dozen where drawing is slow.
    let last = active.max(random).max(global);
    assert!((last + 20..=last + 45).contains(&latest), "{last} {latest}");
    let ending = page.harness.state().ending().expect("an ending");
    assert_eq!(ending.sentence, format!("global needed {global} movements, active {active}, random {random}."));
    assert!(page.has(&ending.sentence) && page.has("accurate: axes within 5° and 20 mm"));
    assert!(page.has(&format!("The end, after movement {latest}: all have learned the arm.")));
    assert_eq!(ending.outcomes[0], (2, Outcome::After(global)), "the best stands first");
    page.click("Luck? Run ten more seeds");
    let asked = page.commands();
    assert!(asked.iter().any(|command| matches!(command, Command::Seeds { seeds, .. } if seeds.len() == 10)));
}

#[test]
fn other_seeds_are_drawn_and_stop_when_they_are_told() {
    let mut page = Page::with_session("learners=global,random&speed=100&to=12&stop=never");
    page.press(Key::Space);
    page.make_steps(12);
    page.scroll_to("Luck? Run ten more seeds");
    page.click("Luck? Run ten more seeds");
    for seed in 2..=11 {
        page.tell(page.server.other_seed(seed, 12));
    }
    assert!(!page.harness.state().other_seeds().expect("seeds").running);
    assert!(page.has("Movements until accurate over other seeds.") && page.has("random: median > 12"));
}

#[test]
fn who_sees_nothing_any_more_keeps_nobody_waiting() {
    let mut page = Page::with_session("scenario=head-fov&learners=active,naive&speed=100");
    page.press(Key::Space);
    let made = page.make_steps(2000);
    assert!(made < 400 && page.harness.state().is_told(), "{made}");
    let ending = page.harness.state().ending().expect("an ending");
    assert!(ending.sentence.contains("were not enough for naive"), "{}", ending.sentence);
}

#[test]
fn time_runs_faster_while_only_one_is_left() {
    let mut page = Page::with_session("learners=global,random&speed=1");
    page.press(Key::Space);
    page.harness.state_mut().settings.speed = 100.0;
    page.make_steps(40);
    page.harness.state_mut().settings.speed = 1.0;
    page.harness.run_steps(2);
    assert!(page.has("Fast-forward, waiting for random"));
}

#[test]
fn slow_steps_and_single_ones_show_the_way() {
    let mut page = Page::with_session("");
    for (speed, frames) in SPEEDS.into_iter().map(|speed| (speed, if speed <= 4.0 { 12 } else { 0 })) {
        let mut page = Page::with_session(&format!("speed={speed}"));
        page.press(Key::Space);
        page.harness.run_steps(4 + (80.0 / speed) as usize);
        assert_eq!(steps(&page.commands()).map(|(_, frames)| frames), Some(frames), "{speed}");
    }
    page.press(Key::S);
    assert_eq!(steps(&page.commands()), Some((1, 12)));
}

#[test]
fn playing_waits_until_the_scene_shows_the_step() {
    let mut page = Page::with_session("speed=5");
    page.press(Key::Space);
    let (count, _) = steps(&page.commands()).expect("steps");
    page.server.step(count);
    // At once: where there is no answer for some seconds, playing goes on.
    let mut events: Vec<Value> = (page.server.news().into_iter())
        .map(|report| json!({ "is": "live", "message": { "type": "step", "data": report } }))
        .collect();
    events.push(json!({ "is": "stepped", "session": page.server.id(), "step": 1 + count }));
    for event in events {
        page.harness.state_mut().receive(serde_json::from_value(event).expect("an event"));
    }
    let commands = page.commands();
    assert!(steps(&commands).is_none() && commands.contains(&Command::Seek { step: 1 + count }), "{commands:?}");
    page.tell(json!({ "is": "shown", "step": 1 + count }));
    page.harness.run_steps(4);
    assert!(steps(&page.commands()).is_some());
}

#[test]
fn the_change_of_the_body_is_marked_and_recovering_is_counted_from_there() {
    let mut page = Page::with_session("scenario=body-change&learners=active,random&speed=100");
    page.press(Key::Space);
    page.make_steps(1000);
    let result = page.server.result();
    let mut needed = Vec::new();
    for learner in &result.learners {
        let movements = learner.recovered_at.expect("it recovers");
        assert!(page.has(&format!("recovered in {movements}")), "{}", learner.name);
        needed.push((movements, learner.name.as_str()));
    }
    needed.sort_unstable();
    let [(few, first), (many, last)] = needed[..] else { panic!("{needed:?}") };
    assert!(page.has(&format!("After the body changed, {first} needed {few} movements, {last} {many}.")));
}

#[test]
fn measured_runs_are_judged_by_their_end_and_by_the_movements_until_then() {
    let mut page = Page::with_session("scenario=panda-sockets&seed=1&learners=global,random,nominal&speed=100");
    page.press(Key::Space);
    page.make_steps(1000);
    let ending = page.harness.state().ending().expect("an ending");
    // Those that learn end alike, and nominal far off: the order is that of the movements until there.
    let outcomes: Vec<Outcome> = ending.outcomes.iter().map(|(_, outcome)| *outcome).collect();
    let [HeldOut { last: a, near: Some(soon) }, HeldOut { last: b, near: Some(late) }, HeldOut { last: c, near: None }] =
        outcomes[..]
    else {
        panic!("{outcomes:?}")
    };
    assert!(soon <= late && (a - b).abs() < 0.05 * a && c > 10.0 * a, "{outcomes:?}");
    let named = |place: usize| {
        page.harness.state().description().expect("a run").learners[ending.outcomes[place].0].name.clone()
    };
    let sentence = &ending.sentence;
    assert!(sentence.starts_with(&format!("{} came within 10 % of the best error, ", named(0))), "{sentence}");
    assert!(sentence.contains(&format!("after {soon} movements, {} after {late};", named(1))), "{sentence}");
    assert!(sentence.contains("nominal ends at 8.17 mm.") && page.has(sentence), "{sentence}");
}
