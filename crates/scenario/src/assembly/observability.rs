//! The observability problem of a scenario: its robot before anything is measured.

use std::sync::Arc;

use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{Known, Scenario, ScenarioError, WorldSpec};
use body_schema_engine::{
    design::observability::Prospect,
    model::{Block, Place, State},
    selection::{Constraints, Watch},
};
use body_schema_robot::Segment;

/// The number of postures drawn before the search for one with something in view ends.
const PATIENCE: usize = 20_000;

impl Scenario {
    /// What the robot is bound to. One that was measured is not to fold onto itself, but for what it has done; of one elsewhere the file's
    /// constraints say so already.
    pub fn bounds(&self) -> Option<Constraints> {
        match &self.world {
            WorldSpec::Measured { measurements, .. } => {
                self.robot.held_apart(self.constraints.clone(), &measurements.configurations)
            }
            WorldSpec::Simulated { .. } | WorldSpec::External { .. } => self.constraints.clone(),
        }
    }

    /// The robot as the file describes it, with its sensors, limits and constraints. Of recorded measurements only where the robot was is
    /// used: somebody's robot is not to fold onto itself, but for what it has done.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Follows`] if a joint follows others: postures are looked for joint by joint.
    pub fn prospect(&self) -> Result<Prospect, ScenarioError> {
        let chain = self.robot.described.as_deref().map(|described| &described.chain);
        let follower = chain.filter(|chain| chain.readings.len() < chain.moving().count()).and_then(|chain| {
            let is_read = |segment: &&Segment| chain.readings.iter().any(|reading| reading.name == segment.name);
            chain.moving().find(|segment| !is_read(segment))
        });
        if let Some(segment) = follower {
            return Err(ScenarioError::Follows { joint: segment.name.clone() });
        }
        let layout = self.robot.layout.clone();
        let mut state = self.robot.state.clone();
        if !matches!(self.world, WorldSpec::Simulated { .. }) {
            self.unline(&mut state);
        }
        let constraints = self.bounds();
        let watch = self.watch(&state, constraints.as_ref());
        let chain = self.chain_prior(&self.robot.state, &layout);
        let deviations =
            chain.as_ref().map_or_else(|| self.prior.standard_deviations(&layout), |chain| chain.deviations());
        let m = layout.dimension();
        let known = chain.and_then(|chain| {
            let inverse = deviations.map(f64::recip);
            let correlations = chain.covariance(&chain.stated()).component_mul(&(&inverse * inverse.transpose()));
            Some(correlations.cholesky()?.inverse())
        });
        Ok(Prospect {
            state,
            measurement_model: Arc::new(self.measurement_model.assuming(self.smoother.sigma)),
            limits: self.robot.limits.clone(),
            actions: self.actions(),
            constraints,
            watch,
            known: known.unwrap_or_else(|| DMatrix::identity(m, m)),
            deviations,
            units: self.selection.units,
            search: self.selection.search,
            planning: self.selection.planning,
            up_to_motion: self.robot.up_to_motion,
            layout: Arc::new(layout),
        })
    }

    /// Moves targets of unknown place away from where the file has them, which is often the origin of the flange and so the axis of
    /// the last joint, an axis that could then not be determined. They move by half of their prior deviation, in a direction that no
    /// axis is likely to have. Sockets without a guess follow.
    fn unline(&self, state: &mut State) {
        for (block, _) in self.robot.layout.blocks() {
            let (Block::Target(index), Some(Known::Within { length_m, .. })) = (block, self.prior.of(block)) else {
                continue;
            };
            let shift = Vector3::new(0.36, 0.48, 0.8) * (0.5 * length_m);
            match &mut state.targets[index].place {
                Place::Point(point) => *point += shift,
                Place::Pose(pose) => pose.translation.vector += shift,
            }
        }
        for (index, socket) in self.robot.sockets.iter().enumerate().filter(|(_, socket)| !socket.is_guessed) {
            state.sockets[index] = state.target_at(socket.target, &socket.posture);
        }
    }

    /// The head that watches; where sensors see some postures only and the file names none in view, a posture at which
    /// something is seen.
    fn watch(&self, state: &State, constraints: Option<&Constraints>) -> Option<Watch> {
        if let WorldSpec::Simulated { watch: Some(watch), .. } | WorldSpec::External { watch: Some(watch), .. } =
            &self.world
        {
            return Some(watch.clone());
        }
        let noise = vec![0.0; self.measurement_model.equations()];
        let is_seen = |posture: &Vec<f64>| !self.measurement_model.observe(state, posture, &noise).is_miss();
        let is_feasible = |posture: &Vec<f64>| {
            constraints.is_none_or(|constraints| constraints.allow(constraints.start.as_deref(), posture))
        };
        // Whatever is drawn, it is always the same.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let patience = if self.measurement_model.has_view() { PATIENCE } else { 0 };
        let mut draws = std::iter::repeat_with(|| self.robot.limits.draw(&mut rng)).take(patience);
        draws
            .find(|posture| is_feasible(posture) && is_seen(posture))
            .map(|visible_pose| Watch { head: None, visible_pose })
    }
}
