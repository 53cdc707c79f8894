//! Turning what can be turned: the same scenario anew, in the address and in the command that repeats it.

use body_schema_panel::host::Command;
use body_schema_scenario::{Knob, Replacement, builtin};
use egui::Key;
use egui_kittest::kittest::Queryable;

use crate::support::Page;

fn opened(commands: &[Command]) -> Option<(Vec<String>, u64)> {
    commands.iter().rev().find_map(|command| match command {
        Command::Open { set, seed, .. } => Some((set.clone(), *seed)),
        _ => None,
    })
}

fn knob(page: &Page, name: &str) -> Knob {
    let knobs = &page.harness.state().scenario().expect("a scenario").knobs;
    knobs.iter().find(|knob| knob.name.contains(name)).expect("a knob").clone()
}

#[test]
fn a_turned_knob_runs_the_same_seed_anew_to_the_same_step() {
    let mut page = Page::with_session("speed=100&to=9&stop=never&seed=5");
    page.press(Key::Space);
    page.make_steps(8);
    page.press(Key::ArrowLeft);
    let noise = knob(&page, "Noise");
    page.harness.state_mut().turn(&noise, 0.002);
    // The page answers as the server does: what was turned is told in the run's description.
    let commands = page.commands();
    assert_eq!(opened(&commands), Some((vec!["sensor.sigma_m=0.002".to_owned()], 5)));
    page.server.replace(&["sensor.sigma_m=0.002".to_owned()]);
    page.server.open("arm-6dof", 5, None);
    page.follow();
    page.make_steps(8);
    let panel = page.harness.state();
    assert_eq!((panel.cursor, panel.history.latest()), (8, 8));
    assert_eq!(panel.description().map(|run| run.set.clone()), Some(vec!["sensor.sigma_m=0.002".to_owned()]));
    assert!(panel.settings.link().contains("&set=sensor.sigma_m%3D0.002&seed=5"), "{}", panel.settings.link());
    assert!(panel.command_line().contains("run arm-6dof --set sensor.sigma_m=0.002 --seed 5"));
    assert!(panel.caption().title.contains("arm-6dof with sensor.sigma_m=0.002"));
    page.click("As in the scenario");
    assert_eq!(opened(&page.commands()), Some((Vec::new(), 5)));
}

#[test]
fn an_address_turns_too_and_what_belongs_together_turns_together() {
    let mut page = Page::with_session("scenario=arm-6dof&set=sensor.sigma_m%3D0.003");
    assert_eq!(page.harness.state().settings.set, ["sensor.sigma_m=0.003"]);
    assert!((page.server.experiment().setting().replaced).contains(&"sensor.sigma_m=0.003".to_owned()));
    let guess = knob(&page, "first guess");
    page.harness.state_mut().turn(&guess, 90.0);
    let (set, _) = opened(&page.commands()).expect("a session");
    let expected = [
        "sensor.sigma_m=0.003",
        "initial_error.angle_deg=90.0",
        "initial_error.point_m=0.8",
        "prior.direction_rad=1.2",
        "prior.point_m=0.8",
    ];
    assert_eq!(set, expected);
    // As it was: nothing is left of it.
    page.harness.state_mut().turn(&guess, 45.0);
    assert_eq!(page.harness.state().settings.set, ["sensor.sigma_m=0.003"]);
}

#[test]
fn an_arm_can_have_fewer_joints() {
    let mut page = Page::with_session("speed=100&to=9&stop=never");
    let joints = knob(&page, "Number of joints");
    page.harness.state_mut().turn(&joints, 3.2);
    let (set, seed) = opened(&page.commands()).expect("a session");
    assert_eq!(set, ["robot.first_joints=3"]);
    page.server.replace(&set);
    page.server.open("arm-6dof", seed, None);
    page.follow();
    page.press(Key::Space);
    page.make_steps(8);
    let panel = page.harness.state();
    let names: Vec<_> = panel.description().expect("a run").joints.iter().map(|joint| joint.name.clone()).collect();
    assert_eq!(names, ["shoulder_yaw", "shoulder_pitch", "shoulder_roll"]);
    assert_eq!(panel.breakable(), names);
    page.harness.state_mut().turn(&joints, 6.0);
    assert_eq!(opened(&page.commands()).map(|(set, _)| set), Some(Vec::new()));
}

#[test]
fn sliders_open_a_session_when_they_come_to_rest() {
    let mut page = Page::with_session("");
    page.harness.get_by_role_and_label(egui::accesskit::Role::Slider, "Noise of the marker").scroll_to_me();
    page.harness.run_steps(30);
    let slider = page.harness.get_by_role_and_label(egui::accesskit::Role::Slider, "Noise of the marker").rect();
    page.click_at(egui::pos2(slider.left() + 20.0, slider.center().y));
    let commands = page.commands();
    let (set, _) = opened(&commands).expect("a session");
    let [turned] = &set[..] else { panic!("{set:?}") };
    let replacement: Replacement = turned.parse().expect("a replacement");
    let value = replacement.value.as_float().expect("a number");
    assert!(replacement.key == "sensor.sigma_m" && (0.0005..0.01).contains(&value), "{turned}");
    let opened = commands.iter().filter(|command| matches!(command, Command::Open { .. })).count();
    assert_eq!(opened, 1, "one run, not one for every value on the way");
}

#[test]
fn a_joint_breaks_now_and_the_run_goes_on() {
    let mut page = Page::with_session("speed=100&to=400&stop=never");
    page.press(Key::Space);
    page.make_steps(30);
    page.press(Key::Space);
    let latest = page.harness.state().history.latest();
    page.scroll_to("Break it now");
    page.click("Break it now");
    let (set, seed) = opened(&page.commands()).expect("a session");
    let [change] = &set[..] else { panic!("{set:?}") };
    assert!(change.starts_with(&format!("change={{ step = {latest}, tilt = {{ joint = \"elbow\"")), "{change}");
    assert!(page.harness.state().command_line().contains("--set 'change="));
    page.server.replace(&set);
    page.server.open("arm-6dof", seed, None);
    page.follow();
    page.make_steps(latest);
    page.run();
    let panel = page.harness.state();
    assert!(panel.playing && panel.history.latest() >= latest, "it goes on by itself");
    assert_eq!(panel.description().and_then(|run| run.change_at), Some(latest));
    page.make_steps(20);
    assert!(page.has(&format!("body changes after {latest}")) || page.harness.state().history.latest() > latest);
}

#[test]
fn what_breaks_is_simulated_and_does_not_change_anyway() {
    for (scenario, breaks) in [("arm-6dof", true), ("body-change", false), ("tiago-mocap", false)] {
        let page = Page::with_session(&format!("scenario={scenario}"));
        assert_eq!(page.has("Break it now"), breaks, "{scenario}");
    }
    assert!(builtin("tiago-mocap").expect("built in").knobs().iter().all(|knob| !knob.name.contains("guess")));
}
