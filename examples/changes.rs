//! How soon `global` notices that an arm's elbow has tilted by 10 degrees, and how well it predicts later.
//!
//! ```sh
//! cargo run --release --no-default-features --example changes -- 20 80 1001 1100    # change after 20 of 80 movements, seeds
//! cargo run --release --no-default-features --example changes -- 0 200 1001 1100    # no change: false alarms
//! cargo run --release --no-default-features --example changes -- 0 200 1001 1100 2  # the same, with noise twice as large as stated
//! ```

use body_schema::{
    experiment::Executed,
    kinematics::{Joint, Line},
    model::State,
    scenario::{Scenario, builtin},
};
use nalgebra::{Rotation3, Unit, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const TILT_DEG: f64 = 10.0;
const POSTURES: usize = 200;

/// Tilts an axis upwards.
fn tilt(state: &mut State, joint: usize) {
    if let Joint::Revolute(line) = state.joints[joint] {
        let about = Unit::new_normalize(line.direction.cross(&Vector3::z()));
        let direction = Rotation3::from_axis_angle(&about, TILT_DEG.to_radians()) * line.direction;
        state.joints[joint] = Joint::Revolute(Line { direction, ..line });
    }
}

/// The movements at which it noticed a change, and the mean prediction error at the end, millimetres.
fn run(scenario: &Scenario, noise_factor: f64, seed: u64, change: u64, movements: u64) -> (Vec<u64>, f64) {
    let learner = scenario.chosen(Some(&["global".to_owned()])).expect("a learner").remove(0);
    let mut agent = scenario.agent(&learner, seed).expect("an agent");
    let mut truth = scenario.robot.state.clone();
    let elbow = scenario.robot.names.iter().position(|name| name == "elbow").expect("an elbow");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noticed = Vec::new();
    for movement in 1..=movements {
        if change > 0 && movement == change + 1 {
            tilt(&mut truth, elbow);
        }
        let proposal = agent.propose(1).expect("chosen")[0].clone();
        let draw = |_| noise_factor * rng.sample::<f64, _>(StandardNormal);
        let noise: Vec<f64> = (0..scenario.rig.equations()).map(draw).collect();
        let moved = proposal.selection.movement;
        let observation = scenario.rig.observe(&truth, &moved.configuration, &noise);
        let executed = Executed { proposal: Some(proposal.id), movement: moved, observation };
        if agent.absorb(&[executed]).expect("absorbed")[0].change_noticed {
            noticed.push(movement);
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1);
    let error = |_| {
        let posture = scenario.robot.limits.draw(&mut rng);
        (agent.belief().state.marker_at(&posture) - truth.marker_at(&posture)).norm()
    };
    let error = (0..POSTURES).map(error).sum::<f64>() / POSTURES as f64;
    (noticed, 1e3 * error)
}

fn main() {
    let given: Vec<f64> = std::env::args().skip(1).filter_map(|number| number.parse().ok()).collect();
    let (whole, noise_factor) = match given.as_slice() {
        [whole @ .., factor] if whole.len() == 4 => (whole, *factor),
        whole => (whole, 1.0),
    };
    let &[change, movements, first, last] = whole else {
        eprintln!(
            "changes CHANGE MOVEMENTS FIRST_SEED LAST_SEED [NOISE]: four whole numbers, CHANGE 0 is none; and by how much"
        );
        eprintln!("the noise is larger than is stated, 1 if not given");
        std::process::exit(2);
    };
    let [change, movements, first, last] = [change, movements, first, last].map(|number| number as u64);
    let scenario = builtin("arm-6dof").expect("built in");
    let runs: Vec<_> = (first..=last).map(|seed| run(&scenario, noise_factor, seed, change, movements)).collect();
    let within = |most: u64| {
        let is_soon = |at: &u64| change > 0 && *at > change && *at <= change + most;
        runs.iter().filter(|(noticed, _)| noticed.iter().any(is_soon)).count()
    };
    let is_false = |at: &u64| change == 0 || *at <= change;
    let alarms = runs.iter().filter(|(noticed, _)| noticed.iter().any(is_false)).count();
    let mut errors: Vec<f64> = runs.iter().map(|(_, error)| *error).collect();
    errors.sort_by(f64::total_cmp);
    let (soon, later, median) = (within(8), within(20), errors[errors.len() / 2]);
    println!("{} runs: noticed within 8 movements {soon}, within 20 {later}; false alarms {alarms}", runs.len());
    println!("median prediction error after {movements} movements: {median:.2} mm");
}
