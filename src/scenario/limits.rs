//! What the limits of a scenario are computed from.

use super::{Scenario, WorldSpec};
use crate::{
    experiment::{Limits, Stretch},
    selection::Weights,
};

impl Scenario {
    /// What the limits of this scenario are computed from; `None` where no truth is known or the sensor has no noise.
    pub fn limits(&self) -> Option<Limits> {
        let WorldSpec::Simulated { sigma_m, watch, .. } = &self.world else { return None };
        let (sigma_m, head) = (*sigma_m, watch.as_ref().map(|watch| watch.head));
        let layout = self.robot.layout.clone();
        let prior_sd = self.prior.standard_deviations(&layout);
        let weights = Weights::new(self.selection.units, &layout, &prior_sd);
        let (truth, limits) = (self.robot.chain.clone(), self.robot.limits.clone());
        (sigma_m > 0.0).then_some(Limits { truth, layout, limits, head, prior_sd, sigma_m, weights })
    }

    /// The limits along a run of so many steps, one stretch before a change of the body and one after it; empty where
    /// no truth is known or the sensor has no noise.
    pub fn limits_along(&self, steps: u64) -> Vec<Stretch> {
        let Some(limits) = self.limits() else { return Vec::new() };
        let change = match &self.world {
            WorldSpec::Simulated { change: Some(change), .. } if change.step < steps => change,
            _ => return vec![Stretch { limits, from: 0, to: steps }],
        };
        let changed = Limits { truth: change.truth.clone(), ..limits.clone() };
        vec![Stretch { limits, from: 0, to: change.step }, Stretch { limits: changed, from: change.step, to: steps }]
    }
}
