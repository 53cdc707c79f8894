//! Beat the algorithm, as its player meets it.

use body_schema_panel::{
    game::{CELLS, ROUNDS},
    host::Command,
};
use egui::{Key, accesskit::Role};
use egui_kittest::kittest::{NodeT, Queryable};

use crate::support::{Page, Server};

/// A game that has just been opened.
fn begin(query: &str) -> Page {
    let mut page = Page::open(query);
    page.tell(Server::scenarios());
    page.open_session();
    page
}

/// A link may ask for the first look, which begins with one robot, and for a game at once.
#[test]
fn the_colour_of_your_posture_is_your_own_whoever_is_seen() {
    let mut page = begin("scenario=arm-6dof&brief=1&learners=global,human");
    page.answer_postures();
    let caption = page.harness.state().caption();
    assert!(page.harness.state().may_move() && caption.learners.len() == 1, "{caption:?}");
    assert!(caption.tried.is_some_and(|tried| tried != caption.learners[0].colour), "{caption:?}");
}

#[test]
fn ten_movements_of_your_own_against_active_and_random() {
    let mut page = Page::with_session("seed=3");
    page.click("Beat the algorithm");
    let commands = page.commands();
    let Some(Command::Open { seed: 3, learners: Some(learners), .. }) = commands.last() else { panic!("{commands:?}") };
    assert_eq!(learners[..], ["active", "random", "human"]);
    page.server.open("arm-6dof", 3, Some(learners));
    page.follow();
    assert!(page.has("movement 1 of 10") && page.harness.state().cursor == 0);
    for round in 1..=ROUNDS {
        assert!(page.answer_posture(), "round {round}: the panel asks what the posture teaches");
        let share = page.harness.state().game.evaluation.as_ref().and_then(|answer| answer.share).expect("a share");
        assert!(page.has(&format!("Your posture teaches {:.0} % of the best.", share * 100.0)));
        let mut values = page.harness.state().game.values.clone();
        values[round as usize % 6] += 0.2;
        page.harness.state_mut().pose(values.clone());
        assert!(page.answer_posture(), "round {round}: another posture");
        // Sliders go by whole degrees.
        let sent = &page.harness.state().game.values;
        assert!(sent.iter().zip(&values).all(|(sent, value)| (sent - value).abs() < 0.01), "{sent:?} {values:?}");
        // The sliders may have rounded it since.
        page.answer_posture();
        page.click("Make this movement");
        assert_eq!(page.make_steps(1), 1, "round {round}");
    }
    let score = page.harness.state().score().expect("a score");
    assert!(page.has(&score.verdict) && score.errors.len() == 3, "{score:?}");
    assert!(page.has("Your movements taught") && !page.has("Make this movement"));
    page.commands();
    page.click("Copy challenge");
    let link = "?v=1&scenario=arm-6dof&seed=3&play=human".to_owned();
    assert_eq!(page.commands(), [Command::Copy { text: link }]);
    page.click("Leave the game");
    let commands = page.commands();
    let learners = Some(["active", "random", "global"].map(str::to_owned).to_vec());
    assert!(
        matches!(commands.last(), Some(Command::Open { learners: opened, .. }) if *opened == learners),
        "{commands:?}"
    );
}

#[test]
fn a_challenge_opens_the_same_game() {
    let mut page = begin("v=1&scenario=arm-6dof&seed=3&play=human");
    assert!(page.has("Beat the algorithm: movement 1 of 10"));
    assert_eq!(page.harness.state().description().map(|one| one.seed), Some(3));
    // Keys make no movement that was not chosen, and playing makes none at all.
    page.press(Key::Space);
    assert!(!page.harness.state().playing && !page.has("Pause"));
}

#[test]
fn a_click_in_the_slice_and_a_slider_change_the_posture() {
    let mut page = begin("play=human");
    assert!(page.answer_posture());
    let before = page.harness.state().game.values.clone();
    page.scroll_to("Slice: click to set both joints");
    let square = page.place("Slice: click to set both joints");
    page.click_at(square.lerp_inside(egui::vec2(0.75, 0.25)));
    let after = page.harness.state().game.values.clone();
    assert!(after[0] > before[0] && after[1] > before[1] && after[2..] == before[2..], "{before:?} {after:?}");
    assert!(page.answer_posture(), "the arm in the scene follows");
    assert_eq!(page.harness.query_all_by_role(Role::Slider).count(), 6 + 1, "a slider per joint, and the scrubber");
    for slider in page.harness.query_all_by_role(Role::Slider) {
        assert!(slider.accesskit_node().label().is_some_and(|label| !label.is_empty()));
    }
}

#[test]
fn the_slice_shows_what_its_postures_would_teach() {
    let mut page = begin("play=human");
    assert!(
        page.has("slice across: shoulder yaw") && page.has("slice up: shoulder pitch"),
        "names as people write them"
    );
    assert!(page.answer_posture() && page.harness.state().game.map().is_empty());
    let survey = |page: &mut Page| {
        page.harness.run_steps(20);
        page.commands().into_iter().find_map(|command| match command {
            Command::Survey { configurations, session, .. } => Some((configurations, session)),
            _ => None,
        })
    };
    // Cell by cell: two joints over all their limits, the others where they are.
    let (postures, session) = survey(&mut page).expect("the map is asked for");
    assert_eq!(postures.len(), CELLS * CELLS);
    let (values, limits) =
        (page.harness.state().game.values.clone(), page.server.experiment().setting().joints.clone());
    for (cell, posture) in postures.iter().enumerate() {
        assert_eq!(posture[2..], values[2..]);
        let [across, up] = [0, 1].map(|joint| {
            let [low, high] = limits[joint].limits;
            (posture[joint] - low) / (high - low) * CELLS as f64
        });
        assert!((across - (cell % CELLS) as f64 - 0.5).abs() < 1e-9 && (up - (cell / CELLS) as f64 - 0.5).abs() < 1e-9);
    }
    assert!(survey(&mut page).is_none(), "once");
    let best = page.harness.state().game.evaluation.as_ref().and_then(|one| one.best_gain).expect("a best");
    let gains: Vec<f64> = (0..CELLS * CELLS).map(|cell| best * cell as f64 / 100.0).collect();
    page.tell(serde_json::json!({ "is": "surveyed", "session": session, "gains": gains }));
    assert!((page.harness.state().game.map()[50] - 0.5).abs() < 1e-9, "{:?}", page.harness.state().game.map());

    // Other postures of these two joints lie in the same slice; another elbow makes another.
    let mut values = page.harness.state().game.values.clone();
    // Whole degrees, which sliders leave as they are.
    values[0] = 20_f64.to_radians();
    page.harness.state_mut().pose(values.clone());
    assert!(page.answer_posture() && survey(&mut page).is_none() && !page.harness.state().game.map().is_empty());
    values[3] = -40_f64.to_radians();
    page.harness.state_mut().pose(values);
    assert!(page.answer_posture() && page.harness.state().game.map().is_empty());
    assert!(survey(&mut page).is_some());
    // Where it cannot be had the game goes on without it.
    page.tell(serde_json::json!({ "is": "surveyed", "session": session, "gains": [] }));
    assert!(page.harness.state().game.map().is_empty());
    page.click("Make this movement");
    assert_eq!(page.make_steps(1), 1);
}

#[test]
fn the_ghost_is_in_the_legend_and_no_card_covers_a_game() {
    let mut page = Page::open("");
    page.tell(serde_json::json!({ "is": "begin", "query": "play=human", "known": false }));
    page.tell(Server::scenarios());
    page.open_session();
    assert!(!page.has("1 of 5"), "the cards speak of another run");
    let caption = page.harness.state().caption();
    assert_eq!(caption.tried, Some(caption.learners[2].colour), "the ghost has the colour of the visitor's learner");
    assert_eq!(Page::with_session("").harness.state().caption().tried, None);
}

#[test]
fn a_posture_that_is_refused_is_told_and_another_can_be_chosen() {
    let mut page = begin("play=human");
    page.harness.run_steps(20);
    assert!(page.commands().iter().any(|command| matches!(command, Command::Configure { .. })));
    page.tell(serde_json::json!({ "is": "refused", "asked": "configure",
        "problem": { "status": 422, "title": "Invalid", "detail": "too far" } }));
    assert!(page.has("This posture cannot be taken: too far"));
    let values = page.harness.state().game.values.iter().map(|value| value + 0.1).collect();
    page.harness.state_mut().pose(values);
    assert!(page.answer_posture());
}
