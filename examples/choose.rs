//! A choice alone: of all postures of an arm the one that is expected to teach most, beside one that is drawn.
//!
//! ```sh
//! cargo run --release --example choose
//! ```

use body_schema::{
    estimation::Belief,
    scenario::builtin,
    selection::{Actions, Active, Criterion, Minimiser, Past, Policy, Situation},
    sensing::MeasurementModel,
};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // An arm of six joints and what is known of it before any movement.
    let scenario = builtin("arm-6dof")?;
    let layout = scenario.robot.layout.clone();
    let deviations = scenario.prior.standard_deviations(&layout);
    let prior = DMatrix::from_diagonal(&deviations.map(|sd| sd * sd));
    let measurement_model = MeasurementModel::tracker(scenario.filter.sigma());
    let belief =
        Belief::new(scenario.robot.state.clone(), layout.into(), measurement_model.into()).with_covariance(prior);

    // The A-criterion, minimised by DIRECT over the joint limits.
    let weights = scenario.weights();
    let policy = Active::new(weights.clone(), Minimiser::Direct(scenario.selection.search));
    let actions = Actions::Box(scenario.robot.limits.clone());
    let history = Past::default();
    let situation = Situation { belief: &belief, actions: &actions, history: &history, constraints: None };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let chosen = policy.select(&situation, &mut rng)?;

    let criterion = Criterion::new(&belief, &weights)?;
    let limits = scenario.robot.limits.joints().iter();
    let drawn: Vec<f64> = limits.map(|(lower, upper)| rng.random_range(*lower..*upper)).collect();
    let drawn = criterion.appraise(&drawn)?;
    println!("before any movement: {:.4}", criterion.before());
    println!("after the chosen one: {:.4}, of {} evaluated", chosen.criterion.ok_or("none")?, chosen.evaluations);
    println!("after a drawn one: {:.4}", drawn.criterion);
    Ok(())
}
