//! A search of the joint box by DIRECT, and what it leaves for those who ask how it went.

use super::{Partition, SelectionError};
use crate::optimize::{Direct, Settings};

/// How DIRECT searched the joint box, and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// DIRECT's settings.
    pub settings: Settings,
    /// Its rectangles.
    pub partition: Partition,
}

/// Searches the unit cube of so many joints; `evaluate` returns the criterion of a batch of points.
pub(super) fn direct(
    joints: usize,
    settings: Settings,
    mut evaluate: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
) -> Result<Partition, SelectionError> {
    let mut direct = Direct::new(joints, settings).map_err(SelectionError::Search)?;
    while let Some(batch) = direct.ask() {
        let points: Vec<Vec<f64>> = batch.iter().map(<[f64]>::to_vec).collect();
        direct.tell(&evaluate(&points)).map_err(SelectionError::Search)?;
    }
    Ok(Partition::of(&direct))
}
