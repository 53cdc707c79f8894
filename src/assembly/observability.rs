//! What there is to know of a scenario's robot before anything is measured.

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{
    design::observability::Prospect,
    scenario::{Scenario, WorldSpec},
    selection::Watch,
};

/// Postures drawn before it is given up to find one in which something is in view.
const PATIENCE: usize = 20_000;

impl Scenario {
    /// The robot as the file describes it, with its sensors, limits and constraints: what was recorded does not count.
    pub fn prospect(&self) -> Prospect {
        let layout = self.robot.layout.clone();
        Prospect {
            scenario: self.name.clone(),
            title: self.title.clone(),
            names: self.robot.called(),
            state: self.robot.state.clone(),
            rig: Arc::new(self.rig.assuming(self.smoother.sigma)),
            limits: self.robot.limits.clone(),
            actions: self.actions(),
            constraints: self.constraints.clone(),
            watch: self.watch(),
            deviations: self.prior.standard_deviations(&layout),
            units: self.selection.units,
            search: self.selection.search,
            planning: self.selection.planning,
            up_to_motion: self.robot.up_to_motion,
            layout: Arc::new(layout),
        }
    }

    /// Who watches; where sensors see some postures only and the file names none in view, one in which something is.
    fn watch(&self) -> Option<Watch> {
        if let WorldSpec::Simulated { watch: Some(watch), .. } | WorldSpec::Outside { watch: Some(watch), .. } = &self.world {
            return Some(watch.clone());
        }
        let noise = vec![0.0; self.rig.equations()];
        let is_seen = |posture: &Vec<f64>| !self.rig.observe(&self.robot.state, posture, &noise).is_miss();
        let is_feasible = |posture: &Vec<f64>| {
            self.constraints.as_ref().is_none_or(|constraints| constraints.allow(constraints.start.as_deref(), posture))
        };
        // Whatever is drawn, it is always the same.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let patience = if self.rig.has_view() { PATIENCE } else { 0 };
        let mut draws = std::iter::repeat_with(|| self.robot.limits.draw(&mut rng)).take(patience);
        draws
            .find(|posture| is_feasible(posture) && is_seen(posture))
            .map(|visible_pose| Watch { head: None, visible_pose })
    }
}
