//! The prior of the joints of a robot that a URDF describes.

use nalgebra::Point3;

use super::{Scenario, WorldSpec};
use body_schema_engine::model::{Block, ChainErrors, ChainPrior, Layout, State};

impl Scenario {
    /// The prior along the chain, if a real robot is compared with a description. A scenario that simulates its world draws the error
    /// of its guess axis by axis, and so is its prior.
    ///
    /// A layout without an axis takes the chain from the description, and has no such prior.
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
            for (reading, multiplier) in segment.follows.iter().flat_map(|follows| &follows.terms) {
                readings[*reading].push((joint, *multiplier));
            }
        }
        let prior = &self.prior;
        let (point_m, direction_rad) = (prior.point_m, prior.direction_rad);
        let errors = ChainErrors { point_m, direction_rad, zero_rad: prior.zero_rad, zero_m: prior.zero_m };
        Some(ChainPrior::new(guess, layout, &origins, &readings, errors, &prior.standard_deviations(layout)))
    }
}
