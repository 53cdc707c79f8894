//! What may stay unseen, and how the criterion counts it.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix3, Point3};

use super::{Visibility, views::Views};
use crate::{
    kinematics::JointBox,
    model::{Layout, State},
    sensing::MeasurementModel,
};

/// How it enters the criterion that not everything is seen.
#[derive(Clone, Copy, Debug)]
pub enum Sight<'a> {
    /// The gain times the chance of being seen, by a head that watches or by the sensors themselves; not finite where that is
    /// certainly 0.
    Chance(Visibility<'a>, &'a JointBox),
    /// The naive form, for comparison: the plain criterion of what is *predicted* to be in view, not finite where nothing is.
    Predicted(Visibility<'a>),
}

impl Sight<'_> {
    /// What states drawn from a belief would see, where the sensors do not see everything.
    pub(super) fn views(
        &self,
        state: &State,
        layout: &Layout,
        covariance: &DMatrix<f64>,
        measurement_model: &MeasurementModel,
    ) -> Option<Arc<Views>> {
        let views = || match self {
            Self::Predicted(_) => Views::of_estimate(state),
            Self::Chance(visibility, limits) => {
                let misses = visibility.misses().map(|miss| limits.from_unit(miss));
                Views::new(state, layout, covariance, measurement_model, misses)
            }
        };
        measurement_model.has_view().then(|| Arc::new(views()))
    }

    /// p(θ), given the distribution of the predicted marker.
    pub(super) fn chance(&self, candidate: &[f64], marker: &Point3<f64>, spread: &Matrix3<f64>) -> f64 {
        match self {
            Self::Predicted(visibility) => f64::from(visibility.head().is_none_or(|head| head.sees(marker))),
            Self::Chance(visibility, limits) => visibility.chance(&limits.to_unit(candidate), marker, spread),
        }
    }
}
