//! Observability: what a chain, its sensors, its limits and constraints can determine, computed before any measurement.
//!
//! Everything is linearised at one state, the robot as it is described. With H the whitened rows of a movement there and Λ = Σ HᵀH the
//! information of some movements,
//!
//! ```text
//! P = D (I + D Λ D)⁻¹ D,    D = diag(σ₀)
//! ```
//!
//! is the covariance that they leave of the prior's D². What no movement determines is the null space of the Λ of many movements in
//! general position that the constraints allow ([`null_space`]). *Best* movements are those that the planner chooses one after the
//! other, by the scenario's criterion, as if each had been made and had shown what was expected; *random* ones are drawn as the random
//! policy draws them, several times, and medians of them are reported. Both keep to the constraints, and neither learns from what is
//! out of view. The error of predictions is the mean over a workspace of √(tr(H P Hᵀ)), with postures that were not chosen by.
//!
//! The description itself is not tested: where it is far off, the first movements teach less than is said here.

mod course;
mod indices;
mod needed;
mod outcome;
mod summary;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::{
    kinematics::JointBox,
    model::{Layout, State, Workspace, eigen, null_space},
    optimize::Settings,
    selection::{Actions, Constraints, CriterionUnits, Planner, Planning, Random, SelectionError, Watch, Weights},
    sensing::MeasurementModel,
};

use course::Course;
pub use indices::Indices;
pub use needed::Needed;
pub use outcome::{Accuracy, Deviation, ErrorPoint, IndexTable, Observability, Weak};

/// A calibration that is planned: what is to be learned, with which sensors and movements.
#[derive(Clone, Debug)]
pub struct Prospect {
    /// The robot as it is described.
    pub state: State,
    /// Which of its parameters are learned.
    pub layout: Arc<Layout>,
    /// The sensors, whitened by their nominal noise.
    pub measurement_model: Arc<MeasurementModel>,
    /// Joint limits.
    pub limits: JointBox,
    /// The available movements.
    pub actions: Actions,
    /// The constraints on movements.
    pub constraints: Option<Constraints>,
    /// The head that watches, or a posture in view, where some postures are out of view.
    pub watch: Option<Watch>,
    /// σ₀: the prior standard deviation of each tangent coordinate.
    pub deviations: DVector<f64>,
    /// D P₀⁻¹ D, with D of these deviations: the identity where the errors of coordinates are independent.
    pub known: DMatrix<f64>,
    /// The units of the criterion.
    pub units: CriterionUnits,
    /// How the joint box is searched.
    pub search: Settings,
    /// How movements are planned.
    pub planning: Planning,
    /// Whether predictions are judged after the rigid motion that fits best.
    pub up_to_motion: bool,
}

/// The number of random courses of which medians are reported.
pub const DRAWS: usize = 20;
/// The numbers of postures by which the planner chooses, and of others over which its errors are reported.
const CHOSEN_OVER: usize = 64;
const TOLD_OVER: usize = 200;
/// The share of the prior deviation above which a direction is called weak, and the most directions that are named.
const WEAK: f64 = 0.5;
const WEAKEST: usize = 4;

impl Prospect {
    /// Computes what can be determined, and how well, with `count` movements, and how many an error of `wanted_m` metres takes;
    /// `tick` is called after every movement of [`steps`](Self::steps).
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if no movement can be chosen, for example because the constraints leave none within reach.
    pub fn observability(
        &self,
        count: usize,
        wanted_m: f64,
        tick: &(dyn Fn() + Sync),
    ) -> Result<Observability, SelectionError> {
        let weights = Weights::new(self.units, &self.layout, &self.deviations);
        let random = Random::new(weights.clone(), self.watch.clone());
        let general = self.course(&random, self.general(), 0, None, tick)?;
        let free = null_space(&general.information);
        let told_over = self.workspace(TOLD_OVER, 1).jacobian(&self.state, &self.layout);
        let planner = Planner::new(weights, self.search, self.planning, self.workspace(CHOSEN_OVER, 2));
        let planner = match &self.watch {
            Some(watch) => planner.watched(watch.clone()),
            None => planner,
        };
        let best = self.course(&planner, count, 0, Some(&told_over), tick)?;
        let drawn = (1..=DRAWS as u64).map(|draw| self.course(&random, count, draw, Some(&told_over), tick));
        let drawn = drawn.collect::<Result<Vec<Course>, _>>()?;
        // With no end of movements nothing is left but what none tells.
        let floor_m = course::mean_error(&told_over, &self.left_of_prior(&free));
        Ok(self.summary(free, best, &drawn, floor_m, wanted_m))
    }

    /// The number of movements that [`observability`](Self::observability) looks at.
    pub fn steps(&self, count: usize) -> usize {
        self.general() + (1 + DRAWS) * count
    }

    /// Movements that stand for all: each brings an equation at least where it is seen, and one in four is.
    fn general(&self) -> usize {
        4 * (self.layout.dimension() + 20)
    }

    fn workspace(&self, count: usize, stream: u64) -> Workspace {
        let mut rng = course::rng(u64::MAX, stream);
        let configurations = (0..count).map(|_| self.limits.draw(&mut rng)).collect();
        Workspace { configurations, up_to_motion: self.up_to_motion, ..Workspace::default() }
    }

    /// P when everything else is known: N (Nᵀ P₀⁻¹ N)⁻¹ Nᵀ.
    fn left_of_prior(&self, free: &DMatrix<f64>) -> DMatrix<f64> {
        let m = self.layout.dimension();
        let inverse = self.deviations.map(f64::recip);
        let known = self.known.component_mul(&(&inverse * inverse.transpose()));
        let within = (free.transpose() * known * free).cholesky();
        within.map_or_else(|| DMatrix::zeros(m, m), |within| free * within.inverse() * free.transpose())
    }

    /// D Λ D: the information in units of the prior.
    fn scaled(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        information.component_mul(&(&self.deviations * self.deviations.transpose()))
    }

    /// The directions of parameter space, in units of the prior, that some movements tell little of though others could, and what
    /// is left of their deviation; the weakest first. The first `undetermined` eigenvectors are those that nothing tells.
    fn weakest(&self, information: &DMatrix<f64>, undetermined: usize) -> Vec<(f64, DVector<f64>)> {
        let Some(eigen) = eigen(self.scaled(information)) else { return Vec::new() };
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let left = |k: usize| (1.0 + eigen.eigenvalues[k].max(0.0)).sqrt().recip();
        let weak = order.into_iter().skip(undetermined).map(|k| (left(k), eigen.eigenvectors.column(k).into_owned()));
        weak.take_while(|(left, _)| *left > WEAK).take(WEAKEST).collect()
    }
}

#[cfg(test)]
mod laws;
