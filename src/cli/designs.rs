//! Lines on what any learner could reach, beside what the learners reached.

use anyhow::Result;
use body_schema_scenario::{Scenario, WorldSpec};
use body_schema_wire::BestDesign;

use super::{BadInput, output};

/// Refuses to search for best designs where there can be none.
pub fn check(scenario: &Scenario) -> Result<()> {
    let why = match &scenario.world {
        _ if scenario.design_problem().is_some() => return Ok(()),
        WorldSpec::Measured { .. } => "replays recorded data, whose truth and noise are not known",
        WorldSpec::External { .. } => "is about a robot elsewhere, whose truth and noise are not known",
        WorldSpec::Simulated { .. } => "has a sensor without noise, which any movements determine exactly",
    };
    Err(BadInput(format!("--limits: scenario `{}` {why}; leave --limits out", scenario.name)).into())
}

/// Prints the counting yardstick, and, if best designs were asked for, how near each learner's data came to the last
/// one.
pub fn say<'a>(
    movements_by_counting: usize,
    best_designs: &[BestDesign],
    efficiencies: impl Iterator<Item = (&'a str, Option<f64>)>,
) -> Result<()> {
    output::say(format!("as many equations as unknowns: {movements_by_counting} movements"))?;
    let Some(best) = best_designs.last() else { return Ok(()) };
    let reached: Vec<String> =
        efficiencies.filter_map(|(name, efficiency)| Some(format!("{name} {:.0} %", 100.0 * efficiency?))).collect();
    output::say(format!(
        "best possible design of {} movements: trace {:.3e} (optimal to within {:.1} %); of that efficiency, {}",
        best.movements,
        best.best_design_trace,
        // What rounds to nothing is still no proof of the optimum itself.
        (100.0 * best.gap).max(0.1),
        if reached.is_empty() { "nobody's is known".to_owned() } else { reached.join(", ") }
    ))
}
