//! Stories and their cards: they keep their places, do what they say, and point at what they speak of.

use body_schema_panel::{
    host::Command,
    settings::Tab,
    stories::{STORIES, Spot},
};
use egui::{Key, Pos2, vec2};
use egui_kittest::kittest::Queryable;
use serde_json::json;

use crate::support::Page;

fn frames(commands: &[Command]) -> Option<u64> {
    commands.iter().find_map(|command| match command {
        Command::Step { frames, .. } => Some(*frames),
        _ => None,
    })
}

#[test]
fn a_link_shows_its_own_run_to_newcomers_too() {
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": "?v=1&scenario=arm-6dof&seed=1", "known": false }));
    page.begin();
    assert!(page.has("1 of 5: What is learned"));
    assert_eq!(page.harness.state().description().map(|run| run.seed), Some(1));
    // The cards begin where a run begins; a link to a later step is about that step.
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": "?v=1&scenario=arm-6dof&seed=1&step=13", "known": false }));
    page.begin();
    assert!(!page.has("1 of 5"));
}

#[test]
fn what_a_card_would_do_and_is_done_is_shown_again() {
    let mut page = Page::with_session("speed=100&to=30&stop=never");
    page.press(Key::Space);
    page.make_steps(29);
    page.press(Key::T);
    page.click("Show movement 10");
    assert_eq!(page.harness.state().cursor, 10);
    (0..3).for_each(|_| page.click("Next"));
    page.click("Show the end");
    assert_eq!(page.harness.state().cursor, 30);
}

#[test]
fn every_button_of_a_card_is_on_the_screen() {
    for size in [vec2(486.0, 800.0), vec2(414.0, 560.0)] {
        let mut page = Page::of_size("speed=100&to=5&stop=never", size);
        page.begin();
        page.press(Key::Space);
        page.make_steps(4);
        page.press(Key::T);
        (0..4).for_each(|_| page.click("Next"));
        // The list of stories has a button of the game as well.
        let card = page.place("Close").top();
        for label in ["Run ten more seeds", "Beat the algorithm", "Next story", "Previous"] {
            let mut places = page.harness.query_all_by_label(label).map(|button| button.rect());
            let (Some(place), screen) = (places.find(|place| place.top() >= card), size) else {
                panic!("{label} at {size}")
            };
            let is_inside = place.left() >= 0.0 && place.right() <= screen.x && place.bottom() <= screen.y;
            assert!(is_inside && place.width() > 20.0, "{label} at {size}: {place:?}");
        }
    }
}

#[test]
fn clicking_the_same_place_goes_on_through_all_cards() {
    for size in [vec2(486.0, 800.0), vec2(414.0, 560.0), vec2(360.0, 390.0)] {
        let mut page = Page::of_size("", size);
        page.begin();
        page.press(Key::T);
        let (next, previous) = (page.place("Next"), page.place("Previous"));
        for card in 1..STORIES[0].cards.len() {
            page.click_at(next.center());
            assert_eq!(page.harness.state().tour, Some(card), "{size}");
            assert_eq!((page.place("Next"), page.place("Previous")), (next, previous), "{size}");
        }
        page.click_at(next.center());
        assert_eq!(page.harness.state().tour, Some(4), "the last card stays");
        page.click_at(previous.center());
        assert_eq!(page.harness.state().tour, Some(3));
    }
}

#[test]
fn a_card_covers_nothing_of_what_it_speaks_of() {
    let mut page = Page::of_size("", vec2(486.0, 800.0));
    page.begin();
    page.press(Key::T);
    for card in STORIES[0].cards {
        let top = page.place("Close").top();
        let spoken_of = match card.spot {
            Spot::Transport => Some("Play"),
            Spot::Tabs => Some("Why this posture?"),
            Spot::Chart => Some("Chart: Prediction error, mm"),
            _ => None,
        };
        if let Some(label) = spoken_of {
            let place = page.place(label);
            assert!(place.bottom() < top && place.top() >= 0.0, "{}: {place:?} above {top}", card.title);
        }
        page.harness.run_steps(30);
        page.harness.get_by_label("Next").click();
        page.harness.run_steps(30);
    }
}

#[test]
fn a_card_marks_what_it_speaks_of_in_the_scene() {
    let mut page = Page::with_session("");
    page.press(Key::T);
    page.commands();
    page.click("Next");
    assert_eq!(page.commands(), [Command::Point { at: Some("ellipsoids") }]);
    page.click("Next");
    assert_eq!(page.commands(), [Command::Point { at: None }]);
}

#[test]
fn the_first_story_runs_by_its_cards() {
    let mut page = Page::with_session("");
    page.press(Key::T);
    page.click("Play to movement 10");
    assert_eq!(page.harness.state().settings.speed, 2.0);
    // Slow enough to be followed: the scene moves from posture to posture.
    page.harness.run_steps(40);
    let commands = page.commands();
    assert_eq!(frames(&commands), Some(12), "{commands:?}");
    page.server.step(1);
    page.catch_up();
    for event in
        [json!({ "is": "stepped", "session": page.server.id(), "step": 2 }), json!({ "is": "shown", "step": 2 })]
    {
        page.tell(event);
    }
    page.make_steps(20);
    assert!(page.harness.state().history.latest() == 10 && !page.harness.state().playing);
    assert!(page.has("Paused after movement 10."));
    page.click("Next");
    page.click("Show “Uncertainty”");
    assert!(page.has("The uncertainty of active and random stays above that on purpose"));
    page.click("Next");
    page.click("Show the search");
    assert_eq!(page.harness.state().settings.tab, Tab::Why);
    page.click("Next");
    page.click("Play to the end");
    page.make_steps(1000);
    let panel = page.harness.state();
    assert!(panel.is_told() && !panel.playing, "{:?}", panel.stopped);
    let ending = panel.ending().expect("an ending");
    page.click("Next");
    assert!(page.has("Was it luck?") && page.has(&ending.sentence));
    page.click("Next story");
    let commands = page.commands();
    assert!(
        matches!(commands.last(), Some(Command::Open { scenario, .. }) if scenario == "humanoid-eyes"),
        "{commands:?}"
    );
}

#[test]
fn what_has_not_ended_is_not_spoken_of() {
    let mut page = Page::with_session("");
    page.press(Key::T);
    (0..4).for_each(|_| page.click("Next"));
    assert!(page.has("The run is not over yet") && page.has("Play to the end"));
}

#[test]
fn stories_stand_first_and_all_scenarios_one_click_further() {
    let mut page = Page::with_session("");
    for story in &STORIES {
        page.click(story.title);
        let commands = page.commands();
        let Some(Command::Open { scenario, seed, .. }) = commands.last() else {
            panic!("{}: {commands:?}", story.title)
        };
        assert_eq!((scenario.as_str(), *seed), (story.scenario, story.seed));
        page.server.open(story.scenario, story.seed, None);
        page.follow();
        assert!(page.has(story.cards[0].title));
    }
    let stories = page.place(STORIES[0].title).top();
    page.press(Key::Escape);
    assert!(stories < page.place("Scenario").top());
}

#[test]
fn notices_push_nothing_down() {
    let mut page = Page::with_session("");
    let before = ["Play", "Seed", "Charts"].map(|label| page.place(label));
    page.tell(json!({ "is": "refused", "asked": "step", "problem": { "status": 500, "detail": "it is tired" } }));
    assert!(page.has("it is tired"));
    assert_eq!(["Play", "Seed", "Charts"].map(|label| page.place(label)), before);
}

#[test]
fn a_swipe_on_a_chart_scrolls_the_panel() {
    for on_pinned in [false, true] {
        let mut page = Page::of_size("", vec2(400.0, 1100.0));
        page.begin();
        let before = page.place("Charts").top();
        let pinned: Pos2 = page.harness.get_by_label_contains("Prediction error at step 1").rect().center();
        let chart = page.place("Charts").left_bottom() + vec2(60.0, 80.0);
        page.swipe_up(if on_pinned { pinned } else { chart }, 120.0);
        let after = page.place("Charts").top();
        assert!(after < before - 60.0, "{before} {after}, pinned: {on_pinned}");
        assert_eq!(page.harness.state().cursor, 1, "no step was chosen");
    }
}

#[test]
fn within_another_page_there_are_transport_and_one_chart() {
    let mut page = Page::open("embed=1");
    page.tell(json!({ "is": "begin", "query": "embed=1", "known": false }));
    page.begin();
    for label in ["Play", "Back", "Step", "Reset", "Prediction error"] {
        assert!(page.has(label), "{label}");
    }
    for label in ["Tour", "Try this", "Scenario", "Charts", "What is learned"] {
        assert!(!page.has(label), "{label}");
    }
}

#[test]
fn the_search_that_a_card_shows_is_brought_into_view() {
    let mut page = Page::of_size("speed=100&to=10&stop=never", vec2(400.0, 700.0));
    page.begin();
    page.press(Key::T);
    (0..2).for_each(|_| page.click("Next"));
    page.click("Show the search");
    // The answer comes later than the room for it is needed.
    page.harness.run_steps(30);
    page.tell(page.server.selection("active"));
    page.harness.run_steps(30);
    let (tabs, chart) = (page.place("Share").top(), page.harness.get_by_label_contains("Prediction error at").rect());
    assert!(tabs - chart.bottom() < 60.0, "the tabs at {tabs} stand below the chart that ends at {}", chart.bottom());
}
