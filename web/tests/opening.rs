//! What a newcomer sees first, without touching anything.

use body_schema_panel::{host::Command, outcome::Outcome, settings::Tab, stories::STORIES};
use egui_kittest::kittest::Queryable;
use serde_json::json;

use crate::support::{Page, Server};

/// How long the test lets pass from one look to the next, s: eight frames.
const LOOK: f64 = 2.0;

/// A newcomer's page whose first step stands, and is not drawn yet.
fn arrived(still: bool) -> Page {
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": "", "known": false, "fresh": true, "still": still }));
    page.tell(Server::scenarios());
    page.open_session();
    answer(&mut page, false);
    page
}

/// Makes the steps that are asked for, and draws them or does not.
fn answer(page: &mut Page, drawn: bool) {
    for command in page.commands() {
        let Command::Step { count, expected_step, session, .. } = command else { continue };
        page.server.step(count);
        let mut events: Vec<_> = (page.server.news().into_iter())
            .map(|report| json!({ "is": "live", "message": { "type": "step", "data": report } }))
            .collect();
        let step = expected_step + count;
        events.push(json!({ "is": "stepped", "session": session, "step": step }));
        events.extend(drawn.then(|| json!({ "is": "shown", "step": step })));
        for event in events {
            page.harness.state_mut().receive(serde_json::from_value(event).expect("an event"));
        }
    }
    page.run();
}

/// Lets the page be for so many seconds at most, with a server that answers at once; how long it played.
fn watch(page: &mut Page, seconds: f64) -> f64 {
    let mut watched = 0.0;
    while watched < seconds && page.harness.state().playing {
        answer(page, true);
        watched += LOOK;
    }
    watched
}

/// A folder without a server begins as a server's page does.
#[test]
fn without_a_server_the_first_story_is_told_on_its_seed() {
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": "", "known": false, "fresh": true, "still": false, "server": false }));
    page.tell(Server::scenarios());
    let asked = page.commands();
    let of_story = |command: &&Command| matches!(command, Command::Open { seed, .. } if *seed == STORIES[0].seed);
    assert!(asked.iter().any(|command| of_story(&command)), "{asked:?}");
}

#[test]
fn the_first_story_plays_by_itself_and_stops_at_its_figures_within_half_a_minute() {
    let mut page = arrived(false);
    let shown = page.harness.state().description().map(|run| (run.scenario.clone(), run.seed));
    assert_eq!(shown, Some((STORIES[0].scenario.to_owned(), STORIES[0].seed)));
    assert!(!page.harness.state().playing, "there is nothing to be seen yet");
    page.tell(json!({ "is": "shown", "step": 1 }));
    assert!(page.harness.state().playing && page.has("Running, 2.5 movements a second."));
    let walked = watch(&mut page, 3.0);
    assert!((4..=14).contains(&page.harness.state().history.latest()), "slow enough to follow");
    assert!(page.has("it mispredicts where the hand is by "));
    let played = walked + watch(&mut page, 60.0);
    assert!(played < 30.0, "{played} s");
    let panel = page.harness.state();
    assert!(panel.is_told() && !panel.playing && panel.tour.is_none(), "{:?}", panel.stopped);
    let ending = panel.ending().expect("an ending");
    assert!(matches!(ending.outcomes[0], (2, Outcome::After(movements)) if movements <= 10), "{ending:?}");
    page.run();
    assert!(page.has(&ending.sentence) && page.has("Why?"));

    // The answer: what it chose between, with the card that says so.
    page.click("Why?");
    assert!(page.has("3 of 5: Why this posture?") && page.harness.state().settings.tab == Tab::Why);
    assert!(page.commands().contains(&Command::Known), "the visitor has seen it");
}

/// The engine is on its way, and all that was stored has been played: no pace is said that nothing keeps.
#[test]
fn a_movement_that_does_not_come_is_said_to_be_computed() {
    let mut page = arrived(false);
    page.tell(json!({ "is": "shown", "step": 1 }));
    assert!(page.has("Running, 2.5 movements a second."));
    for _ in 0..8 {
        page.run();
    }
    let latest = page.harness.state().history.latest();
    assert!(page.has(&format!("Computing movement {}…", latest + 1)));
    answer(&mut page, true);
    assert!(page.has("Running, 2.5 movements a second.") && page.harness.state().history.latest() > latest);
}

#[test]
fn a_newcomer_sees_transport_one_chart_and_three_sentences_and_the_rest_unfolds() {
    let mut page = arrived(true);
    for label in
        ["Play", "Chart: Prediction error, mm", "A robot moves its arm", "its true arm is grey", "After 1 movement"]
    {
        assert!(page.has(label), "{label}");
    }
    let rest = ["Scenario", "Learner", "Try this", "Charts", "Compare", "1 of 5"];
    for label in rest {
        assert!(!page.has(label), "{label}");
    }
    let images = page.harness.query_all_by_role(egui::accesskit::Role::Image).count();
    assert_eq!(images, 1, "one chart");
    let address = |commands: Vec<Command>| {
        commands.into_iter().rev().find_map(|command| match command {
            Command::Address { query } => Some(query),
            _ => None,
        })
    };
    page.harness.run_steps(12);
    assert!(address(page.commands()).expect("an address").contains("&brief=1"), "a reload keeps it");
    assert!(!page.harness.state().settings.link().contains("brief"), "a link is for others");
    page.click("Show everything");
    for label in &rest[..5] {
        assert!(page.has(label), "{label}");
    }
    assert!(page.commands().contains(&Command::Known));
}

#[test]
fn one_robot_is_seen_first_and_the_others_join_when_it_has_learned_its_arm() {
    let mut page = arrived(false);
    let alone = |commands: Vec<Command>| -> Vec<Option<String>> {
        let asked = commands.into_iter().filter_map(|command| match command {
            Command::Alone { learner } => Some(learner),
            _ => None,
        });
        asked.collect()
    };
    assert_eq!(page.harness.state().caption().learners.len(), 1);
    page.tell(json!({ "is": "shown", "step": 1 }));
    assert!(page.has("its true arm is grey") && page.has("it mispredicts where the hand is by "));
    assert!(!page.has("moves at random"), "neither the legend nor the chart has the others");
    let mut asked = Vec::new();
    while page.harness.state().history.latest() <= 10 {
        let panel = page.harness.state();
        assert_eq!(panel.caption().learners[0].name, "global", "after {}", panel.history.latest());
        answer(&mut page, true);
    }
    page.run();
    asked.extend(alone(page.commands()));
    assert_eq!(asked, [None], "all of them, once");
    assert_eq!(page.harness.state().caption().learners.len(), 3);
    assert!(page.has("moves at random") && page.has("All have made the same number"));
    assert!(page.has("they mispredict where the hand is: global by "));

    // Whoever wants to see everything sees all.
    let mut page = arrived(true);
    page.click("Show everything");
    page.run();
    assert_eq!(page.harness.state().caption().learners.len(), 3);
    assert_eq!(alone(page.commands()), [None]);
}

#[test]
fn nothing_moves_by_itself_for_who_wants_no_motion_or_has_been_here() {
    let mut page = arrived(true);
    page.tell(json!({ "is": "shown", "step": 1 }));
    assert!(!page.harness.state().playing);
    page.click("Play");
    assert!(page.harness.state().playing, "by a click it does");

    for (known, fresh) in [(true, true), (false, false)] {
        let mut page = Page::open("");
        page.tell(json!({ "is": "begin", "query": "", "known": known, "fresh": fresh }));
        page.begin();
        page.tell(json!({ "is": "shown", "step": 1 }));
        assert!(!page.harness.state().playing && page.has("Scenario"));
    }
}

#[test]
fn a_click_stops_what_plays_by_itself() {
    let mut page = arrived(false);
    page.tell(json!({ "is": "shown", "step": 1 }));
    page.click("Pause");
    assert!(!page.harness.state().playing);
    page.run();
    assert!(!page.harness.state().playing, "it does not begin again");
}

#[test]
fn a_click_on_an_arm_shows_what_it_chooses_between_as_it_chooses() {
    let mut page = arrived(false);
    page.tell(json!({ "is": "picked", "learner": "global" }));
    assert_eq!(page.harness.state().settings.tab, Tab::Why);
    let asked = |command: &Command| matches!(command, Command::Select { learner, .. } if learner == "global");
    assert!(page.commands().iter().any(asked));
    let selection = page.server.selection("global");
    page.harness.state_mut().receive(serde_json::from_value(selection).expect("an event"));
    page.harness.run_steps(2);
    let iteration = |page: &Page| page.harness.state().why.iteration;
    let early = iteration(&page).expect("it has only begun");
    page.harness.run_steps(3);
    assert!(iteration(&page).is_some_and(|later| later > early), "it grows: {early} {:?}", iteration(&page));
    page.harness.run_steps(8);
    assert_eq!(iteration(&page), None, "to its end");
    page.tell(json!({ "is": "picked", "learner": "nobody" }));
    assert_eq!(page.harness.state().settings.learner.as_deref(), Some("global"));
}
