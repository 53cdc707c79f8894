//! Where a planner searches.

use crate::{
    kinematics::JointBox,
    optimize::{Differences, Polish, Settings, Slopes, descend, polish},
    selection::{MixtureCriterion, Scope, Search, SelectionError, Situation, cube::Cube, search::direct},
};

/// Of more joints than this differences are taken to one side.
const MANY: usize = 8;

/// Where the movements of a plan are sought.
pub(super) struct SearchDomain<'a> {
    pub scope: &'a Scope<'a>,
    /// The box to search.
    pub searched: &'a JointBox,
    /// Its joints that do not follow from others.
    cube: Cube,
    /// Postures in view, scaled to the unit cube of that box, where the sensors see some only.
    pub familiar: Vec<Vec<f64>>,
    /// Evaluations of the criterion so far.
    pub evaluations: usize,
    /// What DIRECT's first search left.
    pub search: Option<Search>,
}

impl<'a> SearchDomain<'a> {
    /// `familiar` tells how many postures in view are begun from.
    pub fn new(
        situation: &Situation<'_>,
        limits: &JointBox,
        scope: &'a Scope<'a>,
        searched: &'a JointBox,
        familiar: usize,
    ) -> Self {
        let scaled = |point: &Vec<f64>| match scope.is_constrained() {
            true => searched.to_unit(&limits.from_unit(point)),
            false => point.clone(),
        };
        let familiar = match situation.belief.measurement_model.has_view() {
            true => situation.history.seen().iter().rev().take(familiar).map(scaled).collect(),
            false => Vec::new(),
        };
        let cube = Cube::new(scope, searched.dimension());
        Self { scope, searched, cube, familiar, evaluations: 0, search: None }
    }

    /// The criterion at points of the unit cube, beside the `poses` of a plan.
    fn evaluate(&mut self, mixture: &MixtureCriterion<'_>, poses: &[Vec<f64>], points: &[Vec<f64>]) -> Vec<f64> {
        let postures: Vec<Vec<f64>> = points.iter().map(|point| self.searched.from_unit(point)).collect();
        self.evaluations += postures.len();
        self.scope.evaluate_beside(poses, &postures, |feasible| mixture.evaluate(feasible))
    }

    /// Descends by the criterion from a point of the unit cube, beside the `poses` of a plan.
    pub fn polish(
        &mut self,
        mixture: &MixtureCriterion<'_>,
        poses: &[Vec<f64>],
        start: &[f64],
        how: Polish,
    ) -> (Vec<f64>, f64) {
        let searched = self.searched;
        let slope = |point: &[f64]| {
            let (value, mut slope) = mixture.slope(&searched.from_unit(point))?;
            slope.iter_mut().zip(searched.joints()).for_each(|(slope, (lower, upper))| *slope *= upper - lower);
            Some((value, slope))
        };
        // What is not feasible, and what travel costs, only differences tell.
        if self.scope.is_constrained() || !mixture.has_slope() {
            let is_dear = self.scope.following().next().is_some() || searched.dimension() > MANY;
            let differences = if is_dear { Differences::OneSided } else { Differences::Central };
            let (point, value) = polish(&self.cube.free_of(start), how, differences, |points| {
                let points: Vec<Vec<f64>> = points.iter().map(|point| self.cube.whole(point)).collect();
                self.evaluate(mixture, poses, &points)
            });
            return (self.cube.whole(&point), value);
        }
        let slopes = |points: &[Vec<f64>]| {
            let nothing = || (f64::INFINITY, vec![0.0; searched.dimension()]);
            let (values, gradients): (Vec<f64>, Vec<Vec<f64>>) =
                points.iter().map(|point| slope(point).unwrap_or_else(nothing)).unzip();
            self.evaluations += points.len();
            Slopes { values, gradients: gradients.concat() }
        };
        descend(vec![start.to_vec()], how, slopes).pop().unwrap_or_else(|| (start.to_vec(), f64::INFINITY))
    }

    /// DIRECT over the box by the criterion, beside the `poses` of a plan.
    pub fn search(
        &mut self,
        mixture: &MixtureCriterion<'_>,
        poses: &[Vec<f64>],
        settings: Settings,
    ) -> Result<Search, SelectionError> {
        let at = |postures: &[Vec<f64>]| {
            self.scope.evaluate_beside(poses, postures, |feasible| mixture.evaluate_here(feasible))
        };
        let search = direct(self.scope, self.searched, settings, &at, None)?;
        self.evaluations += search.evaluations();
        Ok(search)
    }
}
