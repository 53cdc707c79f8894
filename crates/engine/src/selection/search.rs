//! A search of the joint box by DIRECT, and what it leaves for those who ask how it went.

use super::{
    Criterion, Partition, Scope, SelectionError,
    cube::Cube,
    perturbations::{PerturbationBuffers, PerturbedCentres},
};
use crate::{
    kinematics::JointBox,
    optimize::{Direct, Settings},
};

/// How DIRECT searched the joint box, and what came of it.
#[derive(Clone, Debug)]
pub struct Search {
    /// The search, which has ended.
    direct: Box<Direct>,
    /// Which joints it searched.
    cube: Cube,
    /// What it searched, where constraints made that smaller than the joint box.
    limits: Option<JointBox>,
    /// The point of the unit cube that was chosen instead of the best centre.
    chosen: Option<Vec<f64>>,
}

/// Searches `limits`, the box of a scope, on this thread: most batches take less time than to hand them over; `evaluate` returns the criterion of a batch of postures in it (rad or m), which is not
/// finite where they are not feasible. Where it is a single `criterion` that is searched, that may evaluate all perturbations of a centre at once.
pub(super) fn direct(
    scope: &Scope<'_>,
    limits: &JointBox,
    settings: Settings,
    evaluate: &dyn Fn(&[Vec<f64>]) -> Vec<f64>,
    criterion: Option<&Criterion<'_>>,
) -> Result<Search, SelectionError> {
    let cube = Cube::new(scope, limits.dimension());
    let mut direct = Direct::new(cube.free.len(), settings).map_err(SelectionError::Search)?;
    // What is not feasible is left out posture by posture.
    let around = criterion.filter(|_| !scope.is_constrained()).and_then(Criterion::around_centres);
    let (mut centres, mut buffers) = (PerturbedCentres::new(limits.dimension()), PerturbationBuffers::default());
    while let Some(batch) = direct.ask() {
        let values = match &around {
            // The centre of the cube is perturbed, but no perturbation itself.
            Some(around) if batch.perturbations().len() > 0 => {
                centres.clear();
                batch.perturbations().for_each(|one| centres.push(&one, limits));
                around.evaluate(&centres, &mut buffers)
            }
            _ => evaluate(&batch.iter().map(|point| limits.from_unit(&cube.whole(point))).collect::<Vec<Vec<f64>>>()),
        };
        direct.tell(&values).map_err(SelectionError::Search)?;
    }
    let limits = scope.is_constrained().then(|| limits.clone());
    Ok(Search { direct: Box::new(direct), cube, limits, chosen: None })
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
        let partition = Partition::of(&self.direct, &self.cube);
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
    pub(super) fn best(&self) -> Option<(Vec<f64>, f64)> {
        self.direct.best().map(|(point, value)| (self.cube.whole(point), value))
    }

    /// The best `count` centres in the unit cube with their values, the best one first; of equal ones that which came first.
    pub(super) fn best_of_all(&self, count: usize) -> Vec<(f64, Vec<f64>)> {
        let partition = self.direct.partition();
        let valued = partition.iter().filter_map(|leaf| Some((leaf.value?, leaf.centre)));
        let mut valued: Vec<(f64, &[f64])> = valued.collect();
        valued.sort_by(|a, b| a.0.total_cmp(&b.0));
        valued.into_iter().take(count).map(|(value, centre)| (value, self.cube.whole(centre))).collect()
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
