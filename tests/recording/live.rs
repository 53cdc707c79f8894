//! Recordings that are followed while they grow.

use std::fs;

use body_schema::recording::{LiveLog, Recorder, Target, Theme};
use futures_util::FutureExt;

use crate::recording::{
    checks::check,
    path,
    reading::{self, Reading},
    record, run,
};

#[test]
fn a_page_with_curves_of_its_own_takes_the_scene_alone() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    record(&description, &reports, Target::live(live.clone()));
    let (whole, scene) = (live.parts_from(0), live.scene_parts_from(0));
    assert_eq!(whole.len(), scene.len());
    let differing: Vec<usize> = (0..whole.len()).filter(|index| whole[*index] != scene[*index]).collect();
    assert_eq!(differing.len(), 1, "only the arrangement differs");
    let place = differing[0];
    let views = |part: &bytes::Bytes| {
        let messages = reading::messages(&[live.header(), part.clone()].concat());
        assert!(messages.iter().all(|message| message.store_id().is_blueprint()));
        format!("{messages:?}").matches("TimeSeries").count()
    };
    assert!(views(&whole[place]) > 0 && views(&scene[place]) == 0);
    assert_eq!(live.scene_parts_from(place)[0], scene[place]);
    assert_eq!(live.scene_parts_from(place + 1), live.parts_from(place + 1));
}

#[test]
fn steps_wait_as_long_as_nobody_follows() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    recorder.log(&reports[0]).unwrap();
    assert!(!live.is_behind() && live.may_wait() && live.is_behind());
    // Whoever comes now waits until it has caught up.
    let follower = live.subscribe();
    assert_eq!(live.caught_up().now_or_never(), None);
    // Also while it is being brought up to date, and when a part of what waits was written.
    assert!(!live.may_wait(), "somebody follows");
    live.append(&[]).unwrap();
    assert_eq!(live.caught_up().now_or_never(), None);
    recorder.flush_shown().unwrap();
    assert_eq!(live.caught_up().now_or_never(), Some(()));
    assert!(!live.may_wait(), "somebody follows");
    drop(follower);
    assert!(live.may_wait());
    // What is closed has all that it will ever have.
    drop(recorder);
    assert_eq!(live.caught_up().now_or_never(), Some(()));
}

#[test]
fn a_live_log_is_followed_part_by_part() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    let woken = live.subscribe();
    assert_eq!((live.len(), live.header().len(), *woken.borrow()), (1, 12, 1));
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    recorder.log(&reports[0]).unwrap();
    recorder.flush().unwrap();
    assert!(woken.has_changed().unwrap());
    let seen = live.len();
    recorder.log(&reports[1]).unwrap();
    assert_eq!(live.len(), seen, "steps wait for the flush");
    recorder.flush().unwrap();
    let new = live.parts_from(seen);
    assert_eq!(new.len(), live.len() - seen);
    // Each part can be sent alone, behind the header.
    for part in &new {
        assert_eq!(reading::messages(&[live.header(), part.clone()].concat()).len(), 1);
    }
    assert!(live.parts_from(live.len()).is_empty() && live.parts_from(usize::MAX).is_empty());
    assert_eq!(live.bytes(), live.parts_from(0).concat().len());
    assert!(!live.is_closed());
    drop(recorder);
    assert!(live.is_closed());
    let length = live.len();
    live.append(&reading::messages(&live.parts_from(0).concat())).unwrap();
    assert_eq!(live.len(), length, "nothing is appended to a closed log");
}

#[test]
fn what_no_view_shows_can_wait() {
    let (description, reports) = run("arm-6dof", 2);
    let live = LiveLog::new();
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    for report in &reports {
        recorder.log(report).unwrap();
        recorder.flush_shown().unwrap();
    }
    let shown = Reading::of(&live.complete().unwrap());
    let leaves = "/active/direct/leaves";
    assert_eq!(shown.steps("/random/metrics/location_m"), [i64::MIN, 0, 1, 2], "static, then every step");
    assert!(shown.steps(leaves).is_empty() && shown.steps("/random/metrics/nis").is_empty());
    recorder.flush().unwrap();
    check(&Reading::of(&live.complete().unwrap()), &description, &reports);
}

#[test]
fn those_who_watch_live_see_the_way_from_step_to_step() {
    let (description, reports) = run("arm-6dof", 2);
    let (file, live) = (path("moving.rrd"), LiveLog::new());
    let mut recorder = Recorder::new(&description, Target::live(live.clone()).and_file(&file)).unwrap();
    for report in &reports {
        recorder.log_moving(report, 3).unwrap();
    }
    recorder.finish().unwrap();
    let moving = Reading::of(&live.parts_from(0).concat());
    assert_eq!(moving.times("/active/arm/estimate", "motion"), [0, 8, 16, 24, 32, 40, 48, 56, 64]);
    assert_eq!(moving.times("/active/point_ellipsoids", "motion"), [0, 8, 16, 24, 32, 40, 48, 56, 64]);
    // What was seen after a movement is gone as soon as the next begins.
    assert_eq!(moving.times("/active/marker/error", "motion"), [0, 1, 32, 33, 64]);
    check(&moving, &description, &reports);
    for steps in [Reading::of(&fs::read(&file).unwrap()), Reading::of(&live.complete().unwrap())] {
        assert_eq!(steps.timelines(), ["step"]);
        assert_eq!(steps.steps("/active/arm/estimate"), [0, 1, 2]);
        check(&steps, &description, &reports);
    }
}

#[test]
fn a_step_is_said_to_be_complete_when_all_of_it_has_come() {
    let (description, reports) = run("arm-6dof", 3);
    let live = LiveLog::new();
    let mut recorder = Recorder::new(&description, Target::live(live.clone())).unwrap();
    let mut seen = live.len();
    let follow = |parts: &[bytes::Bytes]| Reading::of(&[live.header(), parts.concat().into()].concat());
    for report in &reports {
        recorder.log_moving(report, 2).unwrap();
        recorder.flush_shown().unwrap();
        let new = live.parts_from(seen);
        seen = live.len();
        let step = report.step as i64;
        let (before, last) = new.split_at(new.len() - 1);
        assert!(follow(before).times("/complete", "complete").is_empty(), "nothing says so earlier");
        assert_eq!(follow(last).times("/complete", "complete"), [step]);
        for learner in &description.learners {
            assert!(follow(before).steps(&format!("/{}/arm/estimate", learner.name)).contains(&step));
        }
    }
    // So it is for those who take many parts at once.
    let together = live.put_together(&live.parts_from(1)).unwrap();
    let entities: Vec<String> = reading::entities_in_order(&[vec![live.header()], together].concat().concat());
    assert_eq!(entities.iter().position(|entity| entity == "/complete"), Some(entities.len() - 1));
}

#[test]
fn a_posture_that_is_tried_out_stays_until_the_next_step() {
    let (description, reports) = run("arm-6dof", 2);
    let (file, live) = (path("ghost.rrd"), LiveLog::new());
    let mut recorder = Recorder::new(&description, Target::live(live.clone()).and_file(&file)).unwrap();
    recorder.log(&reports[0]).unwrap();
    recorder.log(&reports[1]).unwrap();
    let skeleton = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0]];
    let before = live.len();
    recorder.log_ghost(1, 1, Some(&[skeleton.to_vec()])).unwrap();
    let shown = Reading::of(&[live.header(), live.parts_from(before).concat().into()].concat());
    assert_eq!(shown.times("/random/arm/ghost", "motion"), [32], "it is there at once");
    recorder.log(&reports[2]).unwrap();
    recorder.finish().unwrap();
    let whole = Reading::of(&live.parts_from(0).concat());
    assert_eq!(whole.times("/random/arm/ghost", "motion"), [32, 33], "drawn after step 1, and cleared on the way to 2");
    assert!(whole.times("/active/arm/ghost", "motion").is_empty());
    for steps in [Reading::of(&fs::read(&file).unwrap()), Reading::of(&live.complete().unwrap())] {
        assert!(!steps.entities().iter().any(|entity| entity.ends_with("ghost")));
    }
}

#[test]
fn an_arrangement_can_be_had_anew_for_any_shape_and_colours() {
    let (description, reports) = run("arm-6dof", 1);
    let live = LiveLog::new();
    assert!(live.blueprint(Theme::Dark, 1.0, None).unwrap().is_none(), "nothing is arranged before step 0");
    record(&description, &reports, Target::live(live.clone()));
    let [light, dark] =
        [Theme::Light, Theme::Dark].map(|theme| Reading::of(&live.blueprint(theme, 1.0, None).unwrap().unwrap()));
    for reading in [&light, &dark] {
        assert!(reading.activated && reading.entities().is_empty());
        assert_eq!(reading.views, ["Scene"]);
    }
    assert_ne!(light.background, dark.background);
    // One learner alone, by its place; where there is none at that place, all.
    let roots = |alone| {
        let reading = Reading::of(&live.blueprint(Theme::Light, 1.0, alone).unwrap().unwrap());
        let shown = reading.contents.iter().flat_map(|rules| rules.lines()).map(str::trim);
        let shown = shown.filter_map(|rule| rule.strip_prefix("+ /")?.strip_suffix("/**")).map(str::to_owned);
        shown.collect::<Vec<String>>()
    };
    let names: Vec<String> = description.learners.iter().map(|learner| learner.name.clone()).collect();
    assert_eq!(roots(None), names);
    assert_eq!(roots(Some(1)), names[1..2]);
    assert_eq!(roots(Some(9)), names);
}
