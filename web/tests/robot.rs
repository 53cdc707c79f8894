//! The page on a session with a robot elsewhere: what it is asked to do, and what the visitor says of it.

use body_schema_ask_tell::Outcome;
use body_schema_panel::{Link, host::Command, settings::Tab};
use egui::Key;
use serde_json::json;

use crate::support::{
    Page, Server,
    robot::{ID, Robot, after, follow, opened, pass_on},
};

#[test]
fn a_robot_that_asks_for_nothing_can_be_given_a_movement() {
    let mut robot = Robot::default();
    let mut page = opened("", &mut robot);
    assert!(page.has("Waiting for the robot to ask where to move.") && page.has("Nothing was observed yet."));
    page.click("Suggest a movement");
    assert_eq!(page.commands(), [Command::Suggest { session: ID.to_owned() }]);
    page.click("Suggest a movement");
    assert_eq!(page.commands(), [], "one thing is asked at a time");
    robot.suggest(1);
    page.tell(json!({ "is": "told" }));
    pass_on(&mut page, &mut robot);
    assert!(page.has("Next movement: suggestion 1") && page.has("Waiting for the robot to carry out suggestion 1."));
    assert!(page.has("shoulder") && page.has("elbow") && page.has(" rad") && page.has("Chance to be seen"));
}

#[test]
fn without_a_server_a_robot_is_watched_and_asked_for_nothing() {
    let mut robot = after(2);
    let mut page = Page::open("");
    page.tell(json!({ "is": "begin", "query": format!("session={ID}"), "known": true, "server": false }));
    follow(&mut page, &mut robot);
    assert!(page.has("What was asked and told, up to its last observation.") && page.has("2 observations"));
    for absent in ["Suggest a movement", "Not reachable", "Skip", "Not seen"] {
        assert!(!page.has(absent), "{absent}");
    }
    page.harness.state_mut().settings.tab = Tab::Share;
    page.run();
    assert!(page.has("model.urdf") && page.has("whose events stand beside this page") && !page.has("report.html"));
}

#[test]
fn what_the_visitor_says_of_a_movement_reaches_the_server() {
    let mut robot = after(0);
    let mut page = opened("", &mut robot);
    let session = || ID.to_owned();
    page.click("Not reachable");
    let state = Outcome::Infeasible;
    assert_eq!(page.commands(), [Command::EndSuggestion { session: session(), suggestion: 1, state }]);
    robot.end(1, state);
    robot.suggest(1);
    pass_on(&mut page, &mut robot);
    page.tell(json!({ "is": "told" }));
    page.click("Skip");
    let state = Outcome::Abandoned;
    assert_eq!(page.commands(), [Command::EndSuggestion { session: session(), suggestion: 2, state }]);
    // It was refused: that is told, and can be said again.
    let problem = json!({ "status": 409, "title": "Not pending", "detail": "suggestion 2 is observed" });
    page.tell(json!({ "is": "refused", "asked": "end_suggestion", "problem": problem }));
    assert!(page.has("suggestion 2 is observed"));
    page.click("Not seen");
    let commands = page.commands();
    let [Command::NotSeen { suggestion: 2, configuration, .. }] = &commands[..] else { panic!("{commands:?}") };
    assert_eq!(configuration.keys().map(String::as_str).collect::<Vec<_>>(), ["elbow", "shoulder"]);
    robot.carry_out(false);
    page.tell(json!({ "is": "told" }));
    pass_on(&mut page, &mut robot);
    assert!(page.has("1 observation, 1 of which saw nothing.") && page.has("The last, 1, saw nothing."));
}

#[test]
fn the_page_follows_the_robot_and_makes_no_steps_itself() {
    let mut robot = after(6);
    let mut page = opened("", &mut robot);
    assert_eq!(page.harness.state().cursor, 6, "what has happened is there, and its latest is shown");
    assert!(page.has("Observation 6 of 6") && page.has("6 observations."));
    assert!(page.has("Expected error") && page.has("is wanted"), "how accurate it is");
    for key in [Key::Space, Key::S, Key::ArrowRight, Key::N, Key::T] {
        page.press(key);
    }
    let asked = page.commands();
    assert!(!asked.iter().any(|one| matches!(one, Command::Step { .. } | Command::Open { .. })), "{asked:?}");
    assert!(!page.harness.state().playing && page.harness.state().tour.is_none());
    robot.carry_out(true);
    pass_on(&mut page, &mut robot);
    assert_eq!(page.harness.state().cursor, 7, "it follows");
    page.press(Key::ArrowLeft);
    page.press(Key::ArrowLeft);
    assert!(page.has("Observation 5 of 7."));
    robot.suggest(1);
    robot.carry_out(true);
    pass_on(&mut page, &mut robot);
    assert_eq!(page.harness.state().cursor, 5, "who looks back is left alone");
    page.click("Latest");
    assert_eq!(page.harness.state().cursor, 8);
}

#[test]
fn its_address_is_its_session() {
    let mut robot = after(4);
    let mut page = opened("", &mut robot);
    assert_eq!(page.harness.state().settings.query(), format!("v=1&session={ID}"));
    page.press(Key::ArrowLeft);
    page.harness.run_steps(80);
    let query = format!("v=1&step=3&session={ID}");
    assert!(page.commands().contains(&Command::Address { query }));
    let page = opened("&step=2", &mut after(4));
    assert_eq!(page.harness.state().cursor, 2, "whoever opens it sees what was shown");
}

#[test]
fn all_results_can_be_taken_away() {
    let mut robot = after(3);
    let mut page = opened("&tab=share", &mut robot);
    assert_eq!(page.harness.state().settings.tab, Tab::Share);
    for file in ["model.urdf", "kinematics.yaml", "report.html", "report.json", "observations.csv", "calibration.toml"]
    {
        page.click(file);
        let path = format!("/v1/sessions/{ID}/{file}");
        let commands = page.commands();
        assert!(matches!(&commands[..], [Command::Download { path: found, .. }] if *found == path), "{commands:?}");
    }
    assert!(!page.has("scenario.toml") && !page.has("body-schema run"), "it is no scenario");
}

#[test]
fn a_session_that_was_deleted_is_left_for_the_explorer() {
    let mut robot = after(2);
    let mut page = opened("", &mut robot);
    page.tell(json!({ "is": "ended", "failure": null, "unseen": true }));
    assert_eq!(page.harness.state().link, Link::Expired);
    assert!(page.has("This session was deleted.") && !page.has("Restore"));
    page.commands();
    page.click("Explorer");
    let commands = page.commands();
    assert!(matches!(&commands[..], [Command::Open { scenario, .. }] if scenario == "arm-6dof"), "{commands:?}");

    let mut page = Page::open(&format!("?v=1&session={ID}"));
    page.tell(Server::scenarios());
    page.tell(json!({ "is": "session", "session": null }));
    assert!(page.has("This server has no session of that address"));
}

/// What cannot be shown leaves what is shown alone.
#[test]
fn another_session_that_cannot_be_had_changes_nothing() {
    let mut robot = after(4);
    let mut page = opened("", &mut robot);
    let full = json!({ "status": 503, "title": "Full", "detail": "as many sessions are watched as there may be" });
    page.click("Explorer");
    page.tell(json!({ "is": "refused", "asked": "open", "problem": full }));
    assert!(page.has("No new session: as many sessions are watched"));
    let still = |page: &mut Page, robot: &mut Robot, cursor: u64| {
        robot.suggest(1);
        robot.carry_out(true);
        pass_on(page, robot);
        let panel = page.harness.state();
        assert!(panel.is_external() && panel.is_ready() && panel.cursor == cursor, "it follows: {}", panel.cursor);
        assert_eq!(panel.settings.query(), format!("v=1&session={ID}"));
        let asked = page.commands();
        assert!(!asked.iter().any(|one| matches!(one, Command::Step { .. })), "{asked:?}");
    };
    still(&mut page, &mut robot, 5);
    let mut other = robot.resource();
    other["id"] = json!("another");
    page.tell(json!({ "is": "robots", "sessions": [other] }));
    for answer in
        [json!({ "is": "refused", "asked": "find", "problem": full }), json!({ "is": "session", "session": null })]
    {
        page.scroll_to("Robot");
        page.click("Robot");
        page.click("two-joints\n2 joints · 5 observations · session another");
        assert!(page.commands().contains(&Command::Find { session: "another".to_owned() }));
        page.tell(answer);
        let cursor = page.harness.state().cursor + 1;
        still(&mut page, &mut robot, cursor);
    }
    assert!(page.has("That session cannot be shown") && page.has("That session is gone"));
}

#[test]
fn a_session_that_could_not_be_had_is_asked_for_again() {
    let mut page = Page::open(&format!("?v=1&session={ID}"));
    page.tell(Server::scenarios());
    page.commands();
    let full = json!({ "status": 503, "title": "Full", "detail": "the server's memory is full" });
    page.tell(json!({ "is": "refused", "asked": "find", "problem": full }));
    assert!(page.has("the server's memory is full"));
    page.click("Reset");
    assert_eq!(page.commands(), [Command::Find { session: ID.to_owned() }]);
}

#[test]
fn robots_are_offered_beside_the_scenarios() {
    let mut robot = after(2);
    let mut page = Page::with_session("");
    assert!(!page.has("Robots elsewhere"));
    page.tell(json!({ "is": "robots", "sessions": [robot.resource()] }));
    page.scroll_to("Robot");
    page.commands();
    page.click("Robot");
    page.click(&format!("two-joints\n2 joints · 2 observations · session {}", &ID[..8]));
    assert_eq!(page.commands().last(), Some(&Command::Find { session: ID.to_owned() }));
    page.tell(robot.session());
    page.tell(json!({ "is": "connected" }));
    pass_on(&mut page, &mut robot);
    assert!(page.has("Next movement: suggestion 3"));
    // And back again, by the browser's button.
    page.tell(json!({ "is": "navigated", "query": "?v=1&scenario=arm-6dof&seed=1&step=1&session=gone" }));
    assert!(
        page.commands()
            .iter()
            .any(|command| matches!(command, Command::Open { scenario, .. } if scenario == "arm-6dof"))
    );
}
