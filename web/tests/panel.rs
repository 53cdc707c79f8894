//! The panel as its visitor meets it: by labels and keys, with a page that the test plays.

use body_schema_panel::{Link, host::Command, settings::Tab};
use egui::{Event, Key, Modifiers, accesskit::Role};
use egui_kittest::kittest::Queryable;
use serde_json::json;

use crate::support::{Page, Server};

fn steps(commands: &[Command]) -> Vec<u64> {
    let counts = commands.iter().filter_map(|command| match command {
        Command::Step { count, .. } => Some(*count),
        _ => None,
    });
    counts.collect()
}

#[test]
fn an_opened_page_asks_for_a_session_and_its_first_step() {
    let mut page = Page::open("?scenario=head-fov&seed=7&learners=random,active");
    assert_eq!(page.commands(), [Command::Scenarios, Command::Robots]);
    page.tell(Server::scenarios());
    let learners = Some(vec!["active".to_owned(), "random".to_owned()]);
    let (scenario, ellipsoids, set) = ("head-fov".to_owned(), "1-sigma".to_owned(), Vec::new());
    let open = Command::Open { scenario, seed: 7, learners, ellipsoids, set, enlarge: 1 };
    assert_eq!(page.commands(), [open]);
    assert!(page.has("Opening a session"));
}

#[test]
fn errors_of_real_robots_are_enlarged_and_those_of_simulated_ones_are_not() {
    let mut page = Page::with_session("?scenario=tiago-mocap&enlarge=20&tab=share");
    assert!(page.has("Errors ×"));
    assert!(page.harness.state().command_line().ends_with(" --enlarge 20"));
    let slider = page.harness.get_by_role_and_label(Role::Slider, "Errors ×").rect();
    page.click_at(slider.lerp_inside(egui::vec2(0.5, 0.5)));
    let times = page.harness.state().settings.enlarge;
    assert!((2..20).contains(&times), "half way of a logarithmic scale, not {times}");
    let commands = page.commands();
    assert!(matches!(commands.last(), Some(Command::Open { enlarge, .. }) if *enlarge == times), "{commands:?}");
    assert!(!Page::with_session("?scenario=arm-6dof&tab=share").has("Errors ×"));
}

#[test]
fn what_an_address_gets_wrong_is_told_and_replaced() {
    let mut page = Page::open("?v=1&scenario=no-such&seed=-3&learners=active,nobody&colour=blue");
    page.tell(Server::scenarios());
    for text in ["seed=-3", "“no-such”", "“nobody”", "“colour”"] {
        assert!(page.has(text), "a notice about {text}");
    }
    let commands = page.commands();
    let Some(Command::Open { scenario, seed, .. }) = commands.last() else { panic!("{commands:?}") };
    assert_eq!((scenario.as_str(), *seed), ("arm-6dof", 1));
    // The server has the last word.
    page.tell(json!({ "is": "refused", "asked": "open",
        "problem": { "status": 422, "title": "Invalid", "detail": "no such learner", "field": "learners" } }));
    assert!(page.has("no such learner"));
    let commands = page.commands();
    assert!(matches!(commands.last(), Some(Command::Open { learners: None, .. })), "{commands:?}");
}

#[test]
fn keys_drive_the_server_but_not_while_typing() {
    let mut page = Page::with_session("");
    assert_eq!(page.harness.state().cursor, 1, "the first step shows what it is about");
    page.press(Key::S);
    assert_eq!(page.make_steps(1), 1);
    page.press(Key::ArrowLeft);
    assert_eq!((page.harness.state().cursor, page.harness.state().history.latest()), (1, 2));
    page.press(Key::ArrowRight);
    assert_eq!(page.harness.state().cursor, 2, "recorded steps are gone through first");
    assert!(steps(&page.commands()).is_empty());
    page.press(Key::ArrowRight);
    assert_eq!(page.make_steps(1), 1);
    page.press(Key::Plus);
    assert_eq!(page.harness.state().settings.speed, 20.0);
    page.press(Key::Minus);
    assert_eq!(page.harness.state().settings.speed, 10.0);
    page.press(Key::Questionmark);
    assert!(page.harness.state().help);
    page.press(Key::Escape);
    assert!(!page.harness.state().help);

    page.click("Seed");
    page.press(Key::S);
    page.press(Key::Space);
    page.press(Key::R);
    assert!(steps(&page.commands()).is_empty() && !page.harness.state().playing, "keys are text now");
}

#[test]
fn keys_pressed_elsewhere_on_the_page_bring_what_is_held_with_them() {
    let mut page = Page::with_session("");
    let mut press = |modifiers| {
        page.commands();
        page.harness.event(Event::Key { key: Key::R, physical_key: None, pressed: true, repeat: false, modifiers });
        page.commands()
    };
    assert_eq!(press(Modifiers::NONE), [Command::RestoreView]);
    assert_eq!(press(Modifiers::CTRL), [], "the browser's own");
    assert!(matches!(press(Modifiers::SHIFT)[..], [Command::Open { .. }]), "the run is reset, not the view");
}

#[test]
fn a_run_stops_at_its_last_step_and_says_why() {
    let mut page = Page::with_session("to=12&speed=100");
    page.click("Play");
    assert!(page.harness.state().playing);
    page.make_steps(100);
    assert_eq!(page.harness.state().history.latest(), 12);
    assert!(!page.harness.state().playing && page.has("Stopped at step 12, the last of this run"));
}

#[test]
fn a_run_stops_when_all_that_judge_themselves_have_settled_and_plays_on() {
    // The gradient keeps no uncertainty, so it never judges itself; the others settle after some fifteen movements.
    let mut page = Page::with_session("learners=gradient,global,smoother:random&speed=50&stop=all");
    page.press(Key::Space);
    page.make_steps(200);
    let latest = page.harness.state().history.latest();
    let settled = |name: &str| page.server.result().learners.iter().find(|one| one.name == name)?.settled_at;
    let last = settled("global").max(settled("smoother:random")).expect("both settle");
    // Steps are made by the dozen where drawing is slow, so that the last of them may overshoot.
    assert!((last..last + 25).contains(&latest), "{last} {latest}");
    assert!(settled("gradient").is_none() && page.has("every learner that judges itself is sure of itself"));
    page.press(Key::Space);
    page.make_steps(20);
    assert!(page.harness.state().history.latest() > latest, "play goes on");
}

#[test]
fn convergence_and_divergence_are_shown() {
    let mut page = Page::open("learners=global,random,gradient&speed=100&to=80&stop=never");
    // A gradient whose steps are far too large.
    page.server.edit("gradient.rate", 1e6);
    page.begin();
    page.press(Key::Space);
    page.make_steps(80);
    let result = page.server.result();
    let global = result.learners.iter().find(|learner| learner.name == "global").expect("chosen");
    let converged = global.converged_at.expect("it converges within 80 movements");
    assert!(page.has(&format!("learned in {converged}")) && page.has("ran away"));
    // Going back undoes the verdict: it is that of the step that is shown.
    page.tell(json!({ "is": "scrubbed", "step": converged + 7 }));
    assert!(page.has(&format!("accurate since {converged}")));
    page.tell(json!({ "is": "scrubbed", "step": 1 }));
    assert!((0..3).all(|learner| page.harness.state().verdict(learner) == "not accurate yet"));
}

#[test]
fn a_link_keeps_the_chart() {
    let mut page = Page::with_session("chart=location-error");
    assert!(page.has("Chart: Location error, mm"));
    page.run();
    assert!(page.harness.state().settings.link().ends_with("&chart=location-error"));
    page.harness.state_mut().chart = "Prediction error";
    page.run();
    assert!(!page.harness.state().settings.link().contains("chart"));
    assert!(Page::with_session("chart=no-such").has("There is no chart “no-such”"));
}

#[test]
fn scenarios_stand_in_groups() {
    let mut page = Page::with_session("");
    page.click("Scenario");
    for (group, scenario) in
        [("Simulated arms", "arm-6dof-outliers"), ("A head that watches", "head-fov"), ("Real robots", "ur10-camera")]
    {
        assert!(page.has(group) && page.has(scenario), "{group}");
    }
    page.scroll_to("Real robots");
    assert!(page.place("A head that watches").top() < page.place("Real robots").top());
}

#[test]
fn scene_and_panel_move_together() {
    let mut page = Page::with_session("");
    page.press(Key::S);
    page.make_steps(1);
    page.commands();
    page.press(Key::ArrowLeft);
    assert!(page.commands().contains(&Command::Seek { step: 1 }));
    page.tell(json!({ "is": "scrubbed", "step": 0 }));
    assert_eq!(page.harness.state().cursor, 0);
    assert!(!page.commands().iter().any(|command| matches!(command, Command::Seek { .. })), "no echo");
    page.tell(json!({ "is": "scrubbed", "step": 99 }));
    assert_eq!(page.harness.state().cursor, 2, "not beyond the latest");
}

#[test]
fn a_lost_server_loses_nothing() {
    let mut page = Page::with_session("speed=100&to=40&stop=never");
    page.press(Key::Space);
    page.make_steps(100);
    page.tell(json!({ "is": "lost", "seconds": 0.5 }));
    assert!(page.has("The connection is lost") && page.harness.state().history.latest() == 40);
    page.tell(json!({ "is": "connected" }));
    assert_eq!(page.harness.state().link, Link::Connected);
    // Started anew: the session is gone, and computed again.
    page.tell(json!({ "is": "ended", "failure": null, "unseen": true }));
    page.open_session();
    page.make_steps(40);
    assert_eq!((page.harness.state().history.latest(), page.harness.state().cursor), (40, 40));
    // Expired: it waits to be asked.
    page.tell(json!({ "is": "ended", "failure": null, "unseen": false }));
    assert!(page.has("This session has expired"));
    page.click("Restore");
    page.open_session();
    page.make_steps(40);
    assert_eq!(page.harness.state().history.latest(), 40);
}

#[test]
fn a_reload_finds_its_session_or_computes_it_again() {
    let mut page = Page::open("?scenario=head-fov&seed=3&step=5&session=abc");
    page.tell(Server::scenarios());
    assert!(page.commands().contains(&Command::Find { session: "abc".to_owned() }));
    page.tell(json!({ "is": "session", "session": null }));
    assert!(page.has("is gone"));
    page.open_session();
    page.make_steps(5);
    assert_eq!(page.harness.state().cursor, 5);
    page.harness.run_steps(120);
    let query = page.commands().into_iter().rev().find_map(|command| match command {
        Command::Address { query } => Some(query),
        _ => None,
    });
    assert_eq!(
        query.as_deref(),
        Some("v=1&scenario=head-fov&seed=3&learners=active,random,global&step=5&session=head-fov-3")
    );
}

#[test]
fn a_reload_shows_the_step_that_was_shown_not_the_latest() {
    let mut page = Page::open("scenario=arm-6dof&seed=1&step=2&session=arm-6dof-1");
    page.tell(Server::scenarios());
    page.server.open("arm-6dof", 1, None);
    page.server.step(5);
    page.follow();
    assert_eq!((page.harness.state().cursor, page.harness.state().history.latest()), (2, 5));
}

#[test]
fn learners_and_seeds_are_chosen() {
    let mut page = Page::with_session("");
    page.click("New seed");
    let commands = page.commands();
    assert!(matches!(commands.last(), Some(Command::Open { seed, .. }) if *seed != 1), "{commands:?}");
    page.server.open("arm-6dof", 5, None);
    page.follow();
    page.click("Reset");
    assert!(matches!(page.commands().last(), Some(Command::Open { seed: 5, .. })));
    let compared = |page: &mut Page, toggled: Option<&str>| {
        toggled.into_iter().for_each(|label| page.toggle(label));
        let commands = page.commands();
        let Some(Command::Open { learners: Some(learners), .. }) = commands.last() else { panic!("{commands:?}") };
        let learners = learners.clone();
        page.server.open("arm-6dof", 5, Some(&learners));
        page.follow();
        learners
    };
    assert_eq!(compared(&mut page, Some("gradient")), ["active", "random"]);
    // Any estimator with any policy.
    page.click("Add a learner…");
    let in_words = "Weighs all movements together; moves at random\nsmoother:random";
    page.scroll_to(in_words);
    page.click(in_words);
    assert_eq!(compared(&mut page, None), ["active", "random", "smoother:random"]);
    assert_eq!(compared(&mut page, Some("active")), ["random", "smoother:random"]);
}

#[test]
fn escape_ends_the_tour_for_good() {
    let mut page = Page::with_session("");
    page.press(Key::T);
    assert!(page.harness.state().tour.is_some());
    page.press(Key::Escape);
    assert!(page.harness.state().tour.is_none() && page.commands().contains(&Command::Known));
}

#[test]
fn the_choice_is_explained_and_challenged() {
    let mut page = Page::with_session("tab=why");
    let commands = page.commands();
    let asked = |commands: &[Command]| commands.iter().any(|command| matches!(command, Command::Select { .. }));
    assert!(asked(&commands) || page.has("Asking the server"), "{commands:?}");
    page.tell(page.server.selection("active"));
    let choice = page.server.choice("active");
    assert!(page.has("How active chose movement 1"));
    assert!(page.has(&format!("DIRECT-L tried {} postures", choice.evaluations)));
    let [expected, realised] =
        [choice.chosen.predicted_gain, choice.chosen.realised_gain].map(|gain| gain.expect("a gain"));
    assert!(page.has(&format!("expected to fall by {expected:.3}")) && page.has(&format!("fell by {realised:.3}")));
    let panel = page.harness.state_mut();
    assert_eq!(panel.settings.tab, Tab::Why);
    let posture = vec![0.0; choice.joints.len()];
    panel.propose(posture.clone());
    let commands = page.commands();
    assert!(matches!(&commands[..], [Command::Evaluate { learner, .. }] if learner == "active"), "{commands:?}");
    page.tell(page.server.evaluation("active", &posture));
    let gain = page.server.experiment().appraise("active", &posture).expect("an appraisal").appraisal.gain;
    let share = gain / expected * 100.0;
    assert!(gain < expected && page.has(&format!("by {gain:.3}, {share:.0} % of what DIRECT found")));
    assert!(page.has("chance of being seen 100 %"));
    page.tell(json!({ "is": "refused", "asked": "select",
        "problem": { "status": 409, "title": "Not by DIRECT", "detail": "a random movement" } }));
    assert!(page.has("a random movement"));
}

#[test]
fn the_search_is_watched_sentence_by_sentence_beside_its_best_posture() {
    let mut page = Page::with_session("tab=why&stop=never");
    page.tell(page.server.selection("active"));
    page.commands();
    assert!(page.has("A box is a range of every joint") && page.has("The search ends with"));
    page.scroll_to("Watch it search");
    page.click("Watch it search");
    let evaluated = |commands: &[Command]| -> Vec<Vec<f64>> {
        let asked = commands.iter().filter_map(|command| match command {
            Command::Evaluate { configuration, .. } => Some(configuration.clone()),
            _ => None,
        });
        asked.collect()
    };
    let (mut shown, mut sentences) = (Vec::new(), Vec::new());
    for _ in 0..600 {
        page.harness.run_steps(1);
        for posture in evaluated(&page.commands()) {
            page.tell(page.server.evaluation("active", &posture));
            shown.push(posture);
        }
        let panel = page.harness.state();
        let (search, iteration) = (panel.why.search.as_ref().expect("a search"), panel.why.iteration);
        let sentence = search.next(iteration.unwrap_or(search.last()));
        if sentences.last() != Some(&sentence) {
            assert!(page.has(&sentence), "{sentence}");
            sentences.push(sentence);
        }
        if iteration.is_none() && !panel.why.evaluating && shown.len() > 1 {
            break;
        }
    }
    assert!(sentences.len() > 3, "{sentences:?}");
    let search = page.harness.state().why.search.clone().expect("a search");
    assert!(search.next(0).starts_with("At first all postures are one box"), "{}", search.next(0));
    assert!(sentences.iter().any(|sentence| sentence.contains("in which the least is known")), "{sentences:?}");
    assert!(
        sentences.last().is_some_and(|sentence| sentence.ends_with("is the movement that was made.")),
        "{sentences:?}"
    );
    // The first box's centre is the middle of every joint, the best of all the movement that was made.
    let choice = page.server.choice("active");
    let middle: Vec<f64> = choice.joints.iter().map(|joint| (joint.limits[0] + joint.limits[1]) / 2.0).collect();
    let apart = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(search.best(0).is_some_and(|first| apart(&first, &middle) < 1e-9), "{:?}", search.best(0));
    assert!(shown.len() > 1, "{shown:?}");
    assert!(page.has("The best centre so far"));
    let best = search.best(search.last()).expect("a best");
    assert!(shown.iter().any(|posture| apart(posture, &best) < 1e-9), "{shown:?}");
    assert!(apart(&best, &choice.chosen.configuration) < 1e-9, "{best:?} {:?}", choice.chosen.configuration);
}

#[test]
fn a_selection_that_does_not_hold_together_is_not_drawn() {
    let mut page = Page::with_session("tab=why");
    for (path, wrong) in [
        ("/chosen/box", json!(9999)),
        ("/iterations", json!([])),
        ("/iterations/0/hull", json!([9999])),
        ("/boxes/0/shapes", json!([])),
        ("/boxes/0/shapes/0/levels", json!([0])),
        ("/boxes/0/shapes/0/levels/0", json!(31)),
        ("/variant", json!("simplex")),
    ] {
        let mut broken = page.server.selection("active");
        *broken["selection"].pointer_mut(path).expect("a member") = wrong;
        page.tell(broken);
        assert!(page.has("was not chosen by DIRECT"), "{path}");
    }
}

#[test]
fn other_seeds_run_in_the_background_and_can_be_cancelled() {
    let mut page = Page::with_session("");
    page.scroll_to("Luck? Run ten more seeds");
    page.click("Luck? Run ten more seeds");
    let commands = page.commands();
    let asked = |command: &Command| matches!(command, Command::Seeds { seeds, .. } if seeds.len() == 10);
    assert!(commands.iter().any(asked), "{commands:?}");
    assert!(page.has("0 of 10 seeds"));
    // As the page hears of them: from step 1 on.
    for seed in 2..=5 {
        page.tell(page.server.other_seed(seed, 8));
    }
    assert!(page.has("4 of 10 seeds"));
    let band = page.harness.state().band(0, |row| row.orientation_deg).expect("enough seeds");
    assert_eq!(band.steps, (1..=8).map(f64::from).collect::<Vec<_>>());
    page.click("Cancel");
    assert_eq!(page.commands(), [Command::CancelSeeds]);
    assert!(page.has("bands in the charts: the middle 80 % of 4 seeds"));
}

#[test]
fn everything_can_be_taken_away() {
    let mut page = Page::with_session("tab=share&learners=active,random");
    assert!(page.has("body-schema run arm-6dof --seed 1 --steps 1 --learner active --learner random"));
    page.commands();
    for file in ["recording.rrd", "steps.csv", "result.json", "scenario.toml"] {
        let extension = file.rsplit('.').next().expect("an extension");
        page.click(file);
        assert!(
            matches!(&page.commands()[..], [Command::Download { name, .. }] if name.ends_with(extension)),
            "{file}"
        );
    }
    page.click("Copy link");
    let commands = page.commands();
    let Some(Command::Copy { text }) = commands.last() else { panic!("{commands:?}") };
    assert!(text.starts_with("?v=1") && !text.contains("session="), "{text}");
}

#[test]
fn without_a_server_the_same_is_offered_but_for_its_interface() {
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": "?scenario=arm-6dof&seed=2&learners=active,random&tab=share",
        "known": true, "server": false }));
    page.begin();
    for offered in ["New seed", "Beat the algorithm", "Copy link"] {
        assert!(page.has(offered), "{offered}");
    }
    assert!(!page.has("The HTTP interface that this page uses"));
}

#[test]
fn the_page_that_holds_this_one_drives_it_and_hears_how_it_goes() {
    let mut page = Page::with_session("?v=1&scenario=arm-6dof&seed=1&embed=1");
    let first = page.mirror.clone();
    assert_eq!((first.scenario.as_str(), first.seed, &first.stopped), ("arm-6dof", 1, &None));
    assert_eq!(first.errors.len(), 3);
    assert!(first.errors.iter().all(|of| of.orientation_deg > Some(0.0) && of.location_m > Some(0.0)));
    page.tell(json!({ "is": "forward" }));
    assert_eq!(page.make_steps(1), 1);
    let second = &page.mirror;
    assert!(second.step == 2 && second.errors != first.errors);
    page.tell(json!({ "is": "play" }));
    assert!(page.harness.state().playing);
    page.tell(json!({ "is": "pause" }));
    assert!(!page.harness.state().playing);

    // Another seed keeps the learners, another scenario has its own.
    page.commands();
    page.tell(json!({ "is": "choose", "scenario": null, "seed": 4711 }));
    let asked = page.commands();
    assert!(
        asked.iter().any(|one| matches!(one, Command::Open { scenario, seed: 4711, .. } if scenario == "arm-6dof")),
        "{asked:?}"
    );
    page.tell(json!({ "is": "choose", "scenario": "head-fov", "seed": null }));
    let asked = page.commands();
    assert!(
        asked.iter().any(|one| matches!(one, Command::Open { scenario, seed: 4711, .. } if scenario == "head-fov")),
        "{asked:?}"
    );
}

#[test]
fn a_link_keeps_chart_step_and_bands() {
    let mut page = Page::with_session("?seed=3&chart=location-error");
    page.make_steps(1);
    assert!(!page.harness.state().settings.link().contains("bands"));
    page.scroll_to("Luck? Run ten more seeds");
    page.click("Luck? Run ten more seeds");
    page.harness.run_steps(12);
    let link = page.harness.state().settings.link();
    for part in ["&step=1", "&chart=location-error", "&bands=1"] {
        assert!(link.contains(part), "{link}");
    }
    // Whoever opens it gets the same, bands once the run is there.
    let mut page = Page::open(&link);
    page.tell(Server::scenarios());
    page.open_session();
    let seeds = |commands: &[Command]| commands.iter().any(|command| matches!(command, Command::Seeds { .. }));
    let before = page.commands();
    assert!(!seeds(&before), "the run comes first");
    page.server.step(1);
    page.catch_up();
    page.tell(json!({ "is": "stepped", "session": page.server.session()["session"]["id"], "step": 1 }));
    assert!(seeds(&page.commands()));
    page.harness.run_steps(12);
    assert!(
        page.harness.state().chart == "Location error" && page.harness.state().settings.link().contains("&bands=1")
    );
    assert!(!seeds(&page.commands()), "once");
}
