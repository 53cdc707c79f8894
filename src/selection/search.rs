//! A search of the joint box by DIRECT, and what it leaves for those who ask how it went.

use super::{Partition, Scope, SelectionError};
use crate::{
    kinematics::JointBox,
    optimize::{Direct, Settings},
};

/// How DIRECT searched the joint box, and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// DIRECT's settings.
    pub settings: Settings,
    /// Its rectangles.
    pub partition: Partition,
}

/// Searches `limits`, the box of a scope; `evaluate` returns the criterion of a batch of points of its unit cube, which is not
/// finite where they are not feasible.
pub(super) fn direct(
    scope: &Scope<'_>,
    limits: &JointBox,
    settings: Settings,
    mut evaluate: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
) -> Result<Partition, SelectionError> {
    let mut direct = Direct::new(limits.dimension(), settings).map_err(SelectionError::Search)?;
    while let Some(batch) = direct.ask() {
        let points: Vec<Vec<f64>> = batch.iter().map(<[f64]>::to_vec).collect();
        direct.tell(&evaluate(&points)).map_err(SelectionError::Search)?;
    }
    let partition = Partition::of(&direct);
    Ok(if scope.is_constrained() { partition.within(limits) } else { partition })
}
