//! What measurements leave undetermined, and errors in spite of it.
//!
//! Where no measurement tells two states apart (a base beside axes that are all free, an offset of a joint behind which
//! everything is free) the truth is one of a family, and how far an estimate is from the one that happens to be written
//! down says nothing. So the truth is first moved along the undetermined directions onto the estimate, to the member of its
//! family that is nearest, and errors are taken there.
//!
//! With H the stacked whitened Jacobian over many postures and N an orthonormal basis of its null space, each step moves the
//! truth by N Nᵀ δ, δ being the coordinates of the estimate in the chart at the truth, and then by Gauss and Newton back to
//! where it predicts what it predicted before.

use nalgebra::{DMatrix, DVector};

use body_schema_engine::{
    design::{General, general_movements},
    kinematics::JointBox,
    model::{Layout, State, eigen, null_space},
    sensing::{Head, InView, MeasurementModel},
};

/// What can be told of a problem by its measurements, and what cannot.
#[derive(Clone, Debug)]
pub struct Gauge {
    layout: Layout,
    measurement_model: MeasurementModel,
    /// Whether what is in view is told by the truth, and the head that watches it.
    watched: Option<Option<Head>>,
    limits: JointBox,
    /// The movements that stand for all, and through which channels each is seen.
    movements: Vec<General>,
    undetermined: usize,
}

const STEPS: usize = 30;

impl Gauge {
    /// The gauge at `truth`, judged by movements in general position that are in `view`.
    pub fn new(
        truth: &State,
        layout: &Layout,
        measurement_model: &MeasurementModel,
        view: InView<'_>,
        limits: &JointBox,
    ) -> Self {
        // Noise may be none: what can be told does not depend on it.
        let measurement_model =
            if measurement_model.sigma() > 0.0 { measurement_model.clone() } else { measurement_model.assuming(1.0) };
        let (layout, limits) = (layout.clone(), limits.clone());
        let watched = match view {
            InView::Unknown => None,
            InView::By(head) => Some(head.copied()),
        };
        let mut gauge = Self { layout, measurement_model, watched, limits, movements: Vec::new(), undetermined: 0 };
        gauge.study(truth);
        gauge
    }

    /// Judges another truth.
    pub fn study(&mut self, truth: &State) {
        let view = self.watched.as_ref().map_or(InView::Unknown, |head| InView::By(head.as_ref()));
        self.movements = general_movements(truth, &self.layout, &self.measurement_model, view, &self.limits);
        self.undetermined = self.free(truth).ncols();
    }

    /// Which parameters it is of.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// How many directions of parameter space no measurement determines.
    pub fn undetermined(&self) -> usize {
        self.undetermined
    }

    /// Directions that measurements determine.
    pub fn rank(&self) -> usize {
        self.layout.dimension() - self.undetermined
    }

    /// N at a state (m × k): an orthonormal basis of what no measurement determines.
    pub fn free(&self, state: &State) -> DMatrix<f64> {
        let m = self.layout.dimension();
        let mut information = DMatrix::zeros(m, m);
        for General { measurement_model, posture } in &self.movements {
            let rows = measurement_model.jacobian(state, &self.layout, posture);
            information += &rows * rows.transpose();
        }
        null_space(&information)
    }

    /// The member of the truth's family that is nearest to `estimate`; the truth itself where all is determined, and as near
    /// as it comes where the estimate is out of its chart.
    pub fn aligned(&self, truth: &State, estimate: &State) -> State {
        let mut moved = truth.clone();
        if self.undetermined == 0 {
            return moved;
        }
        for _ in 0..STEPS {
            let Some(delta) = moved.local(&self.layout, estimate) else { break };
            let free = self.free(&moved);
            let mut step = &free * free.tr_mul(&delta);
            let length = step.amax();
            if length < 1e-11 {
                break;
            }
            step *= (0.3 / length).min(1.0);
            moved = self.restored(moved.retract(&self.layout, &step), truth);
        }
        moved
    }

    /// `moved` with its predictions restored to those of the truth, by steps across the undetermined directions.
    fn restored(&self, mut moved: State, truth: &State) -> State {
        let m = self.layout.dimension();
        for _ in 0..3 {
            let (mut information, mut negative_gradient) = (DMatrix::zeros(m, m), DVector::zeros(m));
            for General { measurement_model, posture } in &self.movements {
                let wanted = measurement_model.observe(truth, posture, &vec![0.0; measurement_model.equations()]);
                let equations = measurement_model.equations_of(&moved, &self.layout, posture, &wanted);
                information += &equations.rows * equations.rows.transpose();
                negative_gradient += &equations.rows * &equations.residual;
            }
            let free = self.free(&moved);
            // The undetermined directions are held: there the information is nothing, and so is the step.
            let hold = information.diagonal().amax();
            information += &free * free.transpose() * hold;
            let Some(cholesky) = information.cholesky() else { break };
            let step = cholesky.solve(&negative_gradient);
            moved = moved.retract(&self.layout, &(&step - &free * free.tr_mul(&step)));
        }
        moved
    }

    /// Normalised estimation error squared in the determined subspace, `(Uᵀe)ᵀ (Uᵀ P U)⁻¹ Uᵀe` with U across the
    /// undetermined directions at the estimate, and its degrees of freedom, the columns of U; `truth` is
    /// [aligned](Self::aligned). `None` out of the chart, and where nothing is determined.
    pub fn nees(&self, estimate: &State, covariance: &DMatrix<f64>, truth: &State) -> Option<(f64, usize)> {
        let error = estimate.local(&self.layout, truth)?;
        if self.undetermined == 0 {
            return Some((error.dot(&covariance.clone().cholesky()?.solve(&error)), error.len()));
        }
        let free = self.free(estimate);
        let m = self.layout.dimension();
        let across = DMatrix::identity(m, m) - &free * free.transpose();
        let eigen = eigen(across)?;
        let determined: Vec<DVector<f64>> =
            (0..m).filter(|k| eigen.eigenvalues[*k] > 0.5).map(|k| eigen.eigenvectors.column(k).into_owned()).collect();
        if determined.is_empty() {
            return None;
        }
        let determined = DMatrix::from_columns(&determined);
        let error = determined.tr_mul(&error);
        let covariance = determined.transpose() * covariance * &determined;
        Some((error.dot(&covariance.cholesky()?.solve(&error)), error.len()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::metrics::{location_m, orientation_deg};
    use body_schema_engine::{
        estimation::{Estimator, HypothesisSettings, Smoother},
        model::{Block, Prior, random::random_arm},
    };

    fn postures(rng: &mut ChaCha8Rng, joints: usize, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|_| (0..joints).map(|_| rng.random_range(-1.5..1.5)).collect()).collect()
    }

    fn limits() -> JointBox {
        JointBox::new(vec![(-1.5, 1.5); 4]).expect("limits")
    }

    /// An arm whose axes and base are both free: six directions are a gauge.
    fn case(seed: u64) -> (State, Layout, Gauge, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = random_arm(&mut rng, 4);
        let layout = Layout::new(&truth, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        let gauge = Gauge::new(&truth, &layout, &MeasurementModel::tracker(0.01), InView::Unknown, &limits());
        (truth, layout, gauge, rng)
    }

    #[test]
    fn where_all_is_determined_the_truth_stays() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let truth = random_arm(&mut rng, 4);
        let layout = Layout::of_arm(&truth, &[], false);
        let gauge = Gauge::new(&truth, &layout, &MeasurementModel::tracker(0.0), InView::Unknown, &limits());
        assert_eq!((gauge.undetermined(), gauge.rank()), (0, layout.dimension()));
        let estimate = truth.retract(&layout, &DVector::from_element(layout.dimension(), 0.1));
        assert_eq!(gauge.aligned(&truth, &estimate), truth);
    }

    /// Another member of the truth's family is no error at all, however far it is.
    #[test]
    fn a_state_that_no_measurement_tells_from_the_truth_is_no_error() {
        for seed in 0..6 {
            let (truth, layout, gauge, mut rng) = case(seed);
            assert!(gauge.undetermined() >= 6, "seed {seed}: {}", gauge.undetermined());
            // The base moved, and the axes moved back.
            let shift = nalgebra::Isometry3::new(
                nalgebra::Vector3::new(0.2, -0.1, 0.3),
                nalgebra::Vector3::from_fn(|_, _| rng.random_range(-0.3..0.3)),
            );
            let mut same = State { base: shift.inverse(), ..truth.clone() }.measured().into_owned();
            same.base = shift;
            let theta = postures(&mut rng, 4, 1).remove(0);
            assert!((same.marker_at(&theta) - truth.marker_at(&theta)).norm() < 1e-9);
            assert!(truth.local(&layout, &same).expect("in the chart").amax() > 0.1);
            let aligned = gauge.aligned(&truth, &same).slid_towards(&same);
            assert!(aligned.local(&layout, &same).expect("near").amax() < 1e-6, "seed {seed}");
            let (a, b) = (aligned.measured(), same.measured());
            assert!(orientation_deg(&b, &a, &layout).is_none_or(|error| error < 1e-4));
            assert!(location_m(&b, &a, &layout).is_none_or(|error| error < 1e-6));
        }
    }

    /// Over many runs the error in the determined subspace is distributed as the smoother's covariance says, which it is
    /// not in the whole space.
    #[test]
    fn nees_is_taken_in_the_determined_subspace() {
        let (mut total, mut freedom) = (0.0, 0);
        for seed in 0..12 {
            let (truth, layout, gauge, mut rng) = case(seed);
            let m = layout.dimension();
            let deviations = DVector::from_element(m, 0.02);
            let delta = DVector::from_fn(m, |_, _| 0.02 * rng.sample::<f64, _>(StandardNormal));
            let guess = truth.retract(&layout, &delta);
            let prior = Prior::with_deviations(guess, &layout, &deviations).expect("a prior");
            let settings = HypothesisSettings { kept: 1, spawned: 0 };
            let measurement_model = MeasurementModel::tracker(0.001);
            let own = ChaCha8Rng::seed_from_u64(7);
            let layout = Arc::new(layout);
            let mut smoother = Smoother::new(prior, layout.clone(), Arc::new(measurement_model.clone()), settings, own);
            for theta in postures(&mut rng, 4, 30) {
                let noise: Vec<f64> = (0..3).map(|_| rng.sample(StandardNormal)).collect();
                smoother.update(&theta, &measurement_model.observe(&truth, &theta, &noise)).expect("an update");
            }
            let belief = smoother.belief();
            let aligned = gauge.aligned(&truth, &belief.state);
            let covariance = belief.covariance.as_ref().expect("kept");
            let (nees, degrees) = gauge.nees(&belief.state, covariance, &aligned).expect("near");
            assert_eq!(degrees, gauge.rank());
            total += nees;
            freedom += degrees;
        }
        let mean = total / freedom as f64;
        assert!((0.7..1.35).contains(&mean), "{mean} per degree of freedom");
    }
}
