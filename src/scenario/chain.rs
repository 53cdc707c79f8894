//! What is known of the joints of a robot that a URDF describes.

use nalgebra::{DMatrix, DVector, Point3};

use super::{Scenario, WorldSpec};
use crate::model::{Block, ChainErrors, ChainPrior, Layout, State};

impl Scenario {
    /// The prior along the chain, where there is a description that a real robot is to be compared with. A scenario that simulates its
    /// world draws the error of its guess axis by axis, and its prior is so, too.
    ///
    /// A layout without an axis takes the chain for what the description says, and has no such prior.
    pub fn chain_prior(&self, guess: &State, layout: &Layout) -> Option<ChainPrior> {
        let chain = &self.robot.described.as_ref()?.chain;
        let has_axis = layout.blocks().any(|(block, _)| matches!(block, Block::Axis(_)));
        if !has_axis
            || matches!(self.world, WorldSpec::Simulated { .. })
            || chain.moving().count() != guess.joints.len()
        {
            return None;
        }
        let frames = chain.frames();
        let behind = chain.segments.iter().zip(&frames[1..]);
        let moving = behind.filter(|(segment, _)| segment.kind.moves().is_some());
        let origins: Vec<Point3<f64>> = moving.map(|(_, (_, frame))| frame.translation.vector.into()).collect();
        let mut readings = vec![Vec::new(); chain.readings.len()];
        for (joint, segment) in chain.moving().enumerate() {
            if let Some(follows) = segment.follows {
                readings[follows.reading].push((joint, follows.multiplier));
            }
        }
        let prior = &self.prior;
        let (point_m, direction_rad) = (prior.point_m, prior.direction_rad);
        let errors = ChainErrors { point_m, direction_rad, zero_rad: prior.zero_rad, zero_m: prior.zero_m };
        Some(ChainPrior::new(guess, layout, &origins, &readings, errors, &prior.standard_deviations(layout)))
    }

    /// P₀ of the tangent coordinates of a layout, as stated.
    pub fn prior_covariance(&self, guess: &State, layout: &Layout) -> DMatrix<f64> {
        match self.chain_prior(guess, layout) {
            Some(chain) => chain.covariance(&chain.stated()),
            None => DMatrix::from_diagonal(&self.prior.standard_deviations(layout).map(|sd| sd * sd)),
        }
    }

    /// The standard deviation of every tangent coordinate, as stated.
    pub fn deviations(&self, layout: &Layout) -> DVector<f64> {
        let chain = self.chain_prior(&self.robot.state, layout);
        chain.map_or_else(|| self.prior.standard_deviations(layout), |chain| chain.deviations())
    }
}
