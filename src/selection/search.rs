//! A search of the joint box by DIRECT, and what it leaves for those who ask how it went.

use super::{Partition, Scope, SelectionError};
use crate::{
    kinematics::JointBox,
    optimize::{Direct, Settings},
    parallel::{Batches, shared},
};

/// How DIRECT searched the joint box, and what came of it.
#[derive(Clone, Debug)]
pub struct Search {
    /// The search, which has ended.
    direct: Box<Direct>,
    /// What it searched, where constraints made that smaller than the joint box.
    limits: Option<JointBox>,
    /// The point of the unit cube that was chosen instead of the best centre.
    chosen: Option<Vec<f64>>,
}

/// Searches `limits`, the box of a scope; `evaluate` returns the criterion of a batch of postures in it (rad or m), which is not
/// finite where they are not feasible.
pub(super) fn direct(
    scope: &Scope<'_>,
    limits: &JointBox,
    settings: Settings,
    evaluate: &(dyn Fn(&[Vec<f64>]) -> Vec<f64> + Sync),
) -> Result<Search, SelectionError> {
    let mut direct = Direct::new(limits.dimension(), settings).map_err(SelectionError::Search)?;
    let search = |batches: &mut Batches<'_, Vec<f64>>| {
        // One batch after the other is written to the same place.
        let (mut postures, mut spare): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        while let Some(batch) = direct.ask() {
            spare.extend(postures.drain(batch.len().min(postures.len())..));
            postures.resize_with(batch.len(), || spare.pop().unwrap_or_else(|| vec![0.0; limits.dimension()]));
            postures.iter_mut().zip(batch).for_each(|(posture, point)| limits.write_from_unit(point, posture));
            direct.tell(&batches.evaluate(&mut postures))?;
        }
        Ok(())
    };
    shared(evaluate, settings.max_evaluations, search).map_err(SelectionError::Search)?;
    Ok(Search { direct: Box::new(direct), limits: scope.is_constrained().then(|| limits.clone()), chosen: None })
}

impl Search {
    /// DIRECT's settings.
    pub fn settings(&self) -> Settings {
        *self.direct.settings()
    }

    /// How many values of the criterion it took.
    pub fn evaluations(&self) -> usize {
        self.direct.evaluations()
    }

    /// DIRECT's rectangles.
    pub fn partition(&self) -> Partition {
        let partition = Partition::of(&self.direct);
        let partition = match &self.limits {
            Some(limits) => partition.within(limits),
            None => partition,
        };
        match &self.chosen {
            Some(point) => partition.choosing(point),
            None => partition,
        }
    }

    /// The best centre in the unit cube, and its value; none where nothing was feasible.
    pub(super) fn best(&self) -> Option<(&[f64], f64)> {
        self.direct.best()
    }

    /// The best `count` centres in the unit cube with their values, the best one first; of equal ones that which came first.
    pub(super) fn best_of_all(&self, count: usize) -> Vec<(f64, Vec<f64>)> {
        let partition = self.direct.partition();
        let valued = partition.iter().filter_map(|leaf| Some((leaf.value?, leaf.centre)));
        let mut valued: Vec<(f64, &[f64])> = valued.collect();
        valued.sort_by(|a, b| a.0.total_cmp(&b.0));
        valued.into_iter().take(count).map(|(value, centre)| (value, centre.to_vec())).collect()
    }

    /// The same where another point of the unit cube was chosen.
    pub(super) fn choosing(self, point: Vec<f64>) -> Self {
        Self { chosen: Some(point), ..self }
    }
}

impl PartialEq for Search {
    fn eq(&self, other: &Self) -> bool {
        self.settings() == other.settings() && self.partition() == other.partition()
    }
}
