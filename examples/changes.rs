//! How soon `global` notices that an arm's elbow has tilted by 10 degrees, and how well it predicts later.
//!
//! ```sh
//! cargo run --release --example changes -- 20 80 1001 1100    # change after 20 of 80 movements, seeds
//! cargo run --release --example changes -- 0 200 1001 1100    # no change: false alarms
//! cargo run --release --example changes -- 0 200 1001 1100 2  # the same, with noise twice as large as stated
//! cargo run --release --example changes -- 60 308 1001 1100 1 5    # the fifth of five changes
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

/// Tilts an axis upwards by so many degrees.
fn tilt(state: &mut State, joint: usize, degrees: f64) {
    if let Joint::Revolute(line) = state.joints[joint] {
        let about = Unit::new_normalize(line.direction.cross(&Vector3::z()));
        let direction = Rotation3::from_axis_angle(&about, degrees.to_radians()) * line.direction;
        state.joints[joint] = Joint::Revolute(Line { direction, ..line });
    }
}

/// What becomes of the arm and its readings.
struct Course {
    /// Movements before its elbow tilts, and between that and the next time; 0 if it never does.
    change: u64,
    /// How often it tilts, up and down in turn.
    times: u64,
    movements: u64,
    /// By how much the noise is larger than is stated.
    noise: f64,
}

impl Course {
    /// The last movement before the last change.
    fn last(&self) -> u64 {
        self.change * self.times
    }
}

/// The movements at which it noticed a change, and the mean prediction error at the end, millimetres.
fn run(scenario: &Scenario, course: &Course, seed: u64) -> (Vec<u64>, f64) {
    let learner = scenario.chosen(Some(&["global".to_owned()])).expect("a learner").remove(0);
    let mut agent = scenario.agent(&learner, seed).expect("an agent");
    let mut truth = scenario.robot.state.clone();
    let elbow = scenario.robot.names.iter().position(|name| name == "elbow").expect("an elbow");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noticed = Vec::new();
    for movement in 1..=course.movements {
        let before = movement - 1;
        if course.change > 0 && before > 0 && before <= course.last() && before % course.change == 0 {
            let up = if (before / course.change) % 2 == 1 { 1.0 } else { -1.0 };
            tilt(&mut truth, elbow, up * TILT_DEG);
        }
        let proposal = agent.propose(1).expect("chosen")[0].clone();
        let draw = |_| course.noise * rng.sample::<f64, _>(StandardNormal);
        let noise: Vec<f64> = (0..scenario.measurement_model.equations()).map(draw).collect();
        let moved = proposal.selection.movement;
        let observation = scenario.measurement_model.observe(&truth, &moved.configuration, &noise);
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
    let (noise, times) = (given.get(4).copied().unwrap_or(1.0), given.get(5).map_or(1, |times| *times as u64));
    let &[change, movements, first, last, ..] = given.as_slice() else {
        eprintln!("changes CHANGE MOVEMENTS FIRST_SEED LAST_SEED [NOISE [TIMES]]");
        eprintln!("  CHANGE  movements before the elbow tilts, and between that and the next time; 0 if it never does");
        eprintln!("  NOISE   by how much noise is larger than is stated (1)");
        eprintln!("  TIMES   how often the elbow tilts, up and down in turn (1); the last time is what is reported");
        std::process::exit(2);
    };
    let [change, movements, first, last] = [change, movements, first, last].map(|number| number as u64);
    let course = Course { change, times, movements, noise };
    let scenario = builtin("arm-6dof").expect("built in");
    let runs: Vec<_> = (first..=last).map(|seed| run(&scenario, &course, seed)).collect();
    let within = |most: u64| {
        let is_soon = |at: &u64| change > 0 && *at > course.last() && *at <= course.last() + most;
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
