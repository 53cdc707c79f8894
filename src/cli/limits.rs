//! What any learner could reach, beside what the learners did, in lines to read.

use anyhow::Result;
use body_schema::experiment::BestDesign;

use super::output;

/// Prints the counting yardstick, and where best designs were asked for how near each learner's data came to the last.
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
