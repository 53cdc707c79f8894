//! The best designs of several lengths, to draw beside a run.

use super::Problem;

/// The best design of so many movements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestDesign {
    /// The step of a run after which a learner has made them.
    pub step: u64,
    /// The number of movements: since the start, or since the change of the body.
    pub movements: u64,
    /// tr(W M⁻¹), what these data allow (see [`design`](crate::design)), in the units of the criterion: beside
    /// `bound_trace` of an experiment's metrics.
    pub best_design_trace: f64,
    /// How far that may exceed the optimum, as a fraction of it: the gap of the equivalence theorem.
    pub gap: f64,
    /// The number of parameters that the design determines; a learner of fewer cannot be compared with it.
    pub parameters: usize,
}

impl BestDesign {
    /// The A-efficiency of data whose bound is tr(W F⁻¹): the trace of the last of the best designs as a fraction of it; `None` for data
    /// that teach another number of parameters.
    pub fn efficiency(designs: &[Self], bound_trace: Option<f64>, parameters: usize) -> Option<f64> {
        let best = designs.last().filter(|best| best.parameters == parameters)?;
        Some(best.best_design_trace / bound_trace?)
    }
}

/// Steps of a run during which the body stays the same, and the problem there.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// The problem.
    pub problem: Problem,
    /// The step after which it begins.
    pub from: u64,
    /// Its last step.
    pub to: u64,
}

/// Movements of the shortest design; each further one has twice as many.
const SHORTEST: u64 = 5;
/// Designs are searched until they are certified to be this near to the optimum.
const GAP: f64 = 0.01;

/// The best designs of 5, 10, 20, … movements and of all, stretch by stretch, in the order of steps; none for a sensor
/// without noise. Each takes a core a few hundredths of a second for 6 joints, half a second for 12, some seconds for 20
/// (`docs/speed.md`).
pub fn best_designs(stretches: &[Stretch]) -> Vec<BestDesign> {
    let mut found = Vec::new();
    for Stretch { problem, from, to } in stretches {
        let mut design = None;
        for movements in lengths(to.saturating_sub(*from)) {
            let Some(best) =
                usize::try_from(movements).ok().and_then(|count| problem.best_design_from(count, GAP, design.as_ref()))
            else {
                break;
            };
            let (best_design_trace, gap) = (best.trace, best.gap);
            let parameters = problem.layout.dimension();
            found.push(BestDesign { step: from + movements, movements, best_design_trace, gap, parameters });
            design = Some(best);
        }
    }
    found
}

/// 5, 10, 20, … movements and the whole stretch.
fn lengths(whole: u64) -> impl Iterator<Item = u64> {
    let doubled = std::iter::successors(Some(SHORTEST), |length| length.checked_mul(2));
    doubled.take_while(move |length| *length < whole).chain((whole > 0).then_some(whole))
}
