//! Random arms over seeds: is the structure right, and how good is the robot on postures that it has not seen?
//!
//! `cargo run --release -p body-schema-discover --example seeds -- [--joints 5] [--movements 40] [--seeds 1..20] [--noise-mm 2]
//! [--measured pose|markers3|markers1] [--random] [--turns-only]`

use std::time::Instant;

use body_schema_discover::{
    Data, Effort, advance, answer, discover, fit, next,
    simulated::{Arm, Measured},
};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str, default: &str| -> String {
        let at = arguments.iter().position(|argument| argument == name);
        at.and_then(|at| arguments.get(at + 1)).cloned().unwrap_or_else(|| default.to_owned())
    };
    let has = |name: &str| arguments.iter().any(|argument| argument == name);
    let joints: usize = value("--joints", "5").parse().expect("a number");
    let movements: usize = value("--movements", "40").parse().expect("a number");
    let noise_m = 1e-3 * value("--noise-mm", "2").parse::<f64>().expect("a number");
    let seeds = value("--seeds", "1..20");
    let (first, last) = seeds.split_once("..").expect("A..B");
    let measured = match value("--measured", "markers3").as_str() {
        "pose" => Measured::Pose(0.005),
        "markers1" => Measured::Markers(1),
        "markers2" => Measured::Markers(2),
        _ => Measured::Markers(3),
    };
    let (mut right, mut all, mut ratios, mut sure, mut silently_wrong) = (0, 0, Vec::new(), 0, 0);
    for seed in first.parse::<u64>().expect("a seed")..=last.parse::<u64>().expect("a seed") {
        let start = Instant::now();
        let mut arm = Arm::random(seed, joints, !has("--turns-only"), measured, noise_m);
        let mut data = arm.blank.clone();
        let mut found = None;
        let mut doubts = 0;
        for movement in 0..movements {
            let positions = if has("--random") {
                arm.draw()
            } else {
                let asked = next(&data, &arm.limits, found.as_ref());
                doubts += usize::from(asked.reason == body_schema_discover::Reason::Diagnostic);
                asked.positions
            };
            let row = arm.measure(&positions);
            data.rows.push(row);
            if !has("--random") && data.rows.len() > joints {
                let effort = if movement % 8 == 0 { Effort::Whole } else { Effort::Update };
                found = advance(&data, found.as_ref(), effort).ok();
            }
        }
        let found = discover(&data).expect("a robot");
        let told = answer(&data, &found);
        let is_right = arm.has_structure_of(&found.fit.robot);
        let truth = fit(&data, &arm.robot.rebased(&data.middle()), 60);
        let [ours, theirs] = [&found.fit.robot, &truth.robot].map(|robot| held_out(&arm, robot));
        let ratio = ours / theirs;
        silently_wrong += usize::from(told.sure && !is_right);
        sure += usize::from(told.sure);
        println!(
            "seed {seed}: {} ({}) p {:.3}, held out {:.3} mm, true structure {:.3} mm, ratio {ratio:.3}, {doubts} by doubt, {:.1} s{}",
            if is_right { "right" } else { "WRONG" },
            if told.sure {
                "sure"
            } else if told.explains {
                "in doubt"
            } else {
                "not explained"
            },
            told.probability,
            ours * 1e3,
            theirs * 1e3,
            start.elapsed().as_secs_f64(),
            if is_right { String::new() } else { difference(&arm, &data, &found.fit.robot, &truth, &found.fit) },
        );
        right += usize::from(is_right);
        all += 1;
        ratios.push(ratio);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "{right} of {all} right; sure of {sure}, {silently_wrong} of these wrong; ratio median {:.3}, worst {:.3}",
        ratios[all / 2],
        ratios[all - 1]
    );
    // What is promised of forty chosen movements and more.
    let is_promised = movements >= 40 && !has("--random");
    assert!(!is_promised || 20 * right >= 19 * all, "19 of 20 structures must be right");
}

/// The mean distance of predictions from where the targets are without noise, m.
fn held_out(arm: &Arm, robot: &body_schema_discover::Robot) -> f64 {
    let mut arm = arm.clone();
    let (mut sum, mut count) = (0.0, 0);
    for _ in 0..200 {
        let positions = arm.draw();
        let row = arm.exact(&positions);
        for (found, reading) in robot.predict(&row.positions).iter().zip(&row.readings) {
            let Some(reading) = reading else { continue };
            sum += (found.translation.vector - reading.point().coords).norm();
            count += 1;
        }
    }
    sum / f64::from(count)
}

fn difference(
    arm: &Arm,
    data: &Data,
    robot: &body_schema_discover::Robot,
    truth: &body_schema_discover::Fit,
    found: &body_schema_discover::Fit,
) -> String {
    let word = |robot: &body_schema_discover::Robot| {
        let joint = |joint: &body_schema_discover::Driven| {
            let drives: Vec<String> = joint
                .drives
                .iter()
                .map(|drive| format!("{}*{:.2}", data.columns[drive.column].title, drive.ratio))
                .collect();
            format!("{}:{:?}", drives.join("+"), joint.axis.kind())
        };
        robot.joints.iter().map(joint).collect::<Vec<_>>().join(" ")
    };
    format!("\n  true  {} ({:.1})\n  found {} ({:.1})", word(&arm.robot), truth.evidence, word(robot), found.evidence)
}
