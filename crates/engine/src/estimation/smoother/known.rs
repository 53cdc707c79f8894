//! Tests of prior observations: what is known before any movement is part of the prior, outlives compression and changes of the
//! body, and is listed once.

use std::{collections::HashMap, sync::Arc};

use nalgebra::{DMatrix, Point3, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{HypothesisSettings, KEPT, Smoother};
use crate::{
    estimation::Estimator,
    kinematics::{Joint, Line},
    model::{Block, Layout, Prior, State},
    sensing::{Loss, MeasurementModel, Observation, Position, Sensor, Spacing},
};

const SIGMA: f64 = 0.01;
const SPACING_SIGMA: f64 = 1e-4;

/// Two joints and two sockets of which nothing but their distance is ever told; and how well the distance is believed to be known.
struct Run {
    truth: State,
    smoother: Smoother,
    rng: ChaCha8Rng,
    movements: u64,
}

impl Run {
    fn new(seed: u64, loss: Loss) -> Self {
        let joint = |direction: Vector3<f64>, x: f64| {
            let direction = UnitVector3::new_normalize(direction);
            Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.1), direction })
        };
        let joints = vec![joint(Vector3::new(0.1, 0.2, 1.0), 0.0), joint(Vector3::new(0.1, 1.0, 0.2), 0.4)];
        let mut truth = State::arm(joints, Point3::new(0.8, 0.1, 0.2));
        truth.sockets = vec![Point3::new(0.3, 0.5, 0.0), Point3::new(0.5, -0.2, 0.1)];
        let layout = Layout::new(&truth, [Block::Axis(0), Block::Axis(1), Block::Socket(0), Block::Socket(1)]);
        let m = layout.dimension();
        let mut covariance = DMatrix::identity(m, m) * 0.01;
        // So near that the distance is as good as linear.
        layout.blocks().filter(|(block, _)| matches!(block, Block::Socket(_))).for_each(|(_, place)| {
            place.for_each(|at| covariance[(at, at)] = 1e-4);
        });
        let prior = Prior::around(truth.clone(), &layout, covariance).expect("a prior");
        let spacing = Sensor::even(Spacing { sockets: [0, 1] }, SPACING_SIGMA);
        let measurement_model =
            Arc::new(MeasurementModel::new(vec![Sensor::even(Position { target: 0 }, SIGMA), spacing]));
        let known = measurement_model.beforehand(&truth, &[0.0; 4]).expect("a distance");
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let settings = HypothesisSettings { kept: 2, spawned: 2 };
        let smoother = Smoother::new(prior, Arc::new(layout), measurement_model, settings, rng.clone());
        let smoother = smoother.with_loss(loss).with_unknown_noise(vec![true, false]).with_prior_observation(known);
        Self { truth, smoother, rng, movements: 0 }
    }

    /// Whether it has noticed a change.
    fn step(&mut self) -> bool {
        let theta: Vec<f64> = (0..2).map(|_| self.rng.random_range(-1.5..1.5)).collect();
        let noise = Vector3::from_fn(|_, _| SIGMA * self.rng.sample::<f64, _>(StandardNormal));
        let marker = self.truth.marker_at(&theta) + noise;
        let seen = Observation { readings: vec![Some(marker.coords.as_slice().to_vec()), None] };
        let noticed = self.smoother.update(&theta, &seen).expect("an update").change_noticed;
        self.movements += 1;
        let latest = self.smoother.latest_readings(self.movements);
        let all = self.smoother.readings().into_iter();
        assert_eq!(latest, all.filter(|reading| reading.movement == self.movements).collect::<Vec<_>>());
        noticed
    }

    /// The standard deviation of the distance between the two sockets, metres.
    fn deviation(&self) -> f64 {
        let belief = self.smoother.belief();
        let direction = (belief.state.sockets[0] - belief.state.sockets[1]).normalize();
        let covariance = belief.covariance.as_ref().expect("kept");
        let mut slope = nalgebra::DVector::zeros(covariance.nrows());
        for (socket, sign) in [(0, 1.0), (1, -1.0)] {
            let place = belief.layout.block(Block::Socket(socket)).expect("learned");
            place.enumerate().for_each(|(k, at)| slope[at] = sign * direction[k]);
        }
        slope.dot(&(covariance * &slope)).sqrt()
    }
}

#[test]
fn what_is_known_beforehand_outlives_compression_and_changes() {
    for loss in [Loss::None, Loss::MIXTURE] {
        let mut run = Run::new(1001, loss);
        (0..KEPT + 20).for_each(|_| assert!(!run.step(), "nothing has changed"));
        assert!(run.smoother.posterior.marginalised.is_some(), "compressed");
        assert!((run.deviation() / SPACING_SIGMA - 1.0).abs() < 0.05, "{}", run.deviation());
        for change in 1..=2 {
            let Joint::Revolute(line) = &mut run.truth.joints[1] else { panic!("revolute") };
            line.point.x += 0.2;
            assert!((0..30).any(|_| run.step()), "{loss:?}: change {change} is noticed");
            assert!((run.deviation() / SPACING_SIGMA - 1.0).abs() < 0.05, "after {change}: {}", run.deviation());
            (0..KEPT + 20).for_each(|_| _ = run.step());
            assert!((run.deviation() / SPACING_SIGMA - 1.0).abs() < 0.05, "after {change}: {}", run.deviation());
        }
        // And one may tell what became of every reading: of none twice.
        let mut listed = HashMap::new();
        for reading in run.smoother.readings() {
            *listed.entry((reading.movement, reading.channel)).or_insert(0) += 1;
        }
        assert!(listed.values().all(|times| *times == 1), "{loss:?}: {listed:?}");
        assert_eq!(listed.get(&(0, 1)).copied().unwrap_or(0), i32::from(loss.is_robust()), "what is known is listed");
    }
}
