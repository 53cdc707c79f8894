//! The best designs of the engine's module `design`, as they are told.

use serde::{Deserialize, Serialize};

use body_schema_engine::design;

/// The best design of so many movements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BestDesign {
    /// The step of a run after which a learner has made them.
    pub step: u64,
    /// Its movements: since the start, or since the change of the body.
    pub movements: u64,
    /// tr(W M⁻¹), what these data allow (see [`design`](crate::design)), in the units of the criterion: beside
    /// `bound_trace` of an experiment's metrics.
    pub best_design_trace: f64,
    /// By how much that may exceed the optimum, as a fraction of it: the gap of the equivalence theorem.
    pub gap: f64,
    /// How many parameters it is for: who learns fewer cannot be compared with it.
    #[serde(default)]
    pub parameters: usize,
}

impl From<design::BestDesign> for BestDesign {
    fn from(best: design::BestDesign) -> Self {
        let design::BestDesign { step, movements, best_design_trace, gap, parameters } = best;
        Self { step, movements, best_design_trace, gap, parameters }
    }
}
