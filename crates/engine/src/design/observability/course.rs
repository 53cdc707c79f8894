//! Movements one after the other, and what they would teach.

use nalgebra::{Cholesky, DMatrix};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Prospect;
use crate::{
    estimation::Belief,
    selection::{Movement, Past, Policy, SelectionError, Situation},
    sensing::Observation,
};

/// A sequence of movements, and what is known after them.
pub(super) struct Course {
    pub movements: Vec<Movement>,
    /// Λ: the information of the movements and of what is known beforehand.
    pub information: DMatrix<f64>,
    /// P at the end.
    pub covariance: DMatrix<f64>,
    /// The expected error of predictions after each, metres; empty where none was asked for.
    pub errors_m: Vec<f64>,
}

/// The random numbers of a draw. They depend on no seed, so that a report about a robot does not either.
pub(super) fn rng(draw: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(draw);
    rng.set_stream(stream);
    rng
}

impl Prospect {
    /// Chooses `count` movements by `policy`, each as if those before it had shown what was expected; with errors over the
    /// postures whose stacked Jacobians `told_over` holds (3 rows each).
    pub(super) fn course(
        &self,
        policy: &dyn Policy,
        count: usize,
        draw: u64,
        told_over: Option<&DMatrix<f64>>,
        tick: &(dyn Fn() + Sync),
    ) -> Result<Course, SelectionError> {
        let mut rng = rng(draw, 0);
        let (mut actions, mut history) = (self.actions.clone(), Past::default());
        let mut information = self.known_beforehand();
        let covariance = self.covariance(&information)?;
        let mut belief = Belief::new(self.state.clone(), self.layout.clone(), self.measurement_model.clone())
            .with_covariance(covariance.clone());
        let mut course =
            Course { movements: Vec::new(), information: information.clone(), covariance, errors_m: vec![] };
        while course.movements.len() < count {
            let constraints = self.constraints.as_ref();
            let situation = Situation { belief: &belief, actions: &actions, history: &history, constraints };
            let selection = policy.select(&situation, &mut rng)?;
            let seen = self.seen(&selection.movement);
            let rows = self
                .measurement_model
                .equations_of(&self.state, &self.layout, &selection.movement.configuration, &seen)
                .rows;
            information += &rows * rows.transpose();
            history.proposed(selection.plan.as_ref());
            history.moved(&selection.movement, &actions, &seen);
            actions.use_up(&selection.movement);
            course.movements.push(selection.movement);
            course.covariance = self.covariance(&information)?;
            belief.covariance = Some(course.covariance.clone());
            course.errors_m.extend(told_over.map(|jacobian| mean_error(jacobian, &course.covariance)));
            tick();
        }
        course.information = information;
        Ok(course)
    }

    /// The predicted observation after a movement of the described robot; empty where the head does not see the marker.
    fn seen(&self, movement: &Movement) -> Observation {
        let noise = vec![0.0; self.measurement_model.equations()];
        let head = self.watch.as_ref().and_then(|watch| watch.head.as_ref());
        self.measurement_model.observe_watched(head, movement.socket, &self.state, &movement.configuration, &noise)
    }

    fn known_beforehand(&self) -> DMatrix<f64> {
        let m = self.layout.dimension();
        let noise = vec![0.0; self.measurement_model.equations()];
        let Some(known) = self.measurement_model.beforehand(&self.state, &noise) else { return DMatrix::zeros(m, m) };
        let anywhere = vec![0.0; self.state.joints.len()];
        let rows = self.measurement_model.equations_of(&self.state, &self.layout, &anywhere, &known).rows;
        &rows * rows.transpose()
    }

    /// P = D (I + D Λ D)⁻¹ D.
    fn covariance(&self, information: &DMatrix<f64>) -> Result<DMatrix<f64>, SelectionError> {
        let scaled = &self.known + self.scaled(information);
        let inverse = Cholesky::new(scaled).ok_or(SelectionError::NoFiniteCriterion)?.inverse();
        Ok(self.scaled(&inverse))
    }
}

/// The mean of √(tr(H P Hᵀ)) over postures whose Jacobians are stacked, 3 rows each; metres.
pub(super) fn mean_error(jacobian: &DMatrix<f64>, covariance: &DMatrix<f64>) -> f64 {
    let spread = jacobian * covariance;
    let count = jacobian.nrows() / 3;
    let of = |index: usize| (3 * index..3 * index + 3).map(|row| spread.row(row).dot(&jacobian.row(row))).sum::<f64>();
    (0..count).map(|index| of(index).max(0.0).sqrt()).sum::<f64>() / count.max(1) as f64
}
