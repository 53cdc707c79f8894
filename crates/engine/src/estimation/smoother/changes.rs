//! What the smoother promises over long runs: that old measurements are compressed without loss, that a change of the body
//! is noticed and what no longer holds is dropped, and that a miss says nothing.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{HypothesisSettings, KEPT, STABLE, Smoother, mode::StoppingCriteria};
use crate::{
    estimation::{Belief, Estimator, Update},
    kinematics::{Joint, Line},
    model::{Layout, Prior, State, random::random_arm},
    sensing::{Loss, MeasurementModel, Observation},
};

const JOINTS: usize = 4;
const SIGMA: f64 = 0.01;
const THOROUGH: StoppingCriteria<'_> =
    StoppingCriteria { steps: 200, tolerance: 1e-14, hopeless: f64::INFINITY, known: &[] };

/// A robot, and a smoother that began with a guess near it.
struct Run {
    truth: State,
    smoother: Smoother,
    rng: ChaCha8Rng,
}

impl Run {
    fn new(seed: u64) -> Self {
        Self::with(seed, None)
    }

    /// With a guess near the truth, or with none: axes anywhere `within` so many metres.
    fn with(seed: u64, within: Option<f64>) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = random_arm(&mut rng, JOINTS);
        // Of which the last joint turns the marker by a lever of 30 cm.
        let direction = truth.joints[JOINTS - 1].direction();
        let across = direction.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
        let point = truth.marker() - across * 0.3;
        truth.joints[JOINTS - 1] = Joint::Revolute(Line { point, direction });
        let layout = Layout::of_arm(&truth, &[], false);
        let guess = truth.retract(&layout, &DVector::from_fn(layout.dimension(), |_, _| rng.random_range(-0.1..0.1)));
        let covariance = DMatrix::identity(layout.dimension(), layout.dimension()) * 0.04;
        let prior = Prior::new(guess, &layout, covariance, |_| within).expect("a prior");
        let count = if within.is_some() { 8 } else { 2 };
        let settings = HypothesisSettings { kept: count, spawned: count };
        let (measurement_model, rng_of_search) =
            (Arc::new(MeasurementModel::tracker(SIGMA)), ChaCha8Rng::seed_from_u64(9));
        Self {
            truth,
            smoother: Smoother::new(prior, Arc::new(layout), measurement_model, settings, rng_of_search),
            rng,
        }
    }

    fn posture(&mut self) -> Vec<f64> {
        (0..JOINTS).map(|_| self.rng.random_range(-1.5..1.5)).collect()
    }

    /// A movement to `theta`, seen with noise.
    fn to(&mut self, theta: &[f64]) -> Update {
        let noise = Vector3::from_fn(|_, _| SIGMA * self.rng.sample::<f64, _>(StandardNormal));
        let seen = Observation::seen(self.truth.marker_at(theta) + noise);
        self.smoother.update(theta, &seen).expect("an update")
    }

    fn step(&mut self) -> Update {
        let theta = self.posture();
        self.to(&theta)
    }

    /// The greatest error of predicted markers over some postures, in expected errors.
    fn error(&mut self) -> f64 {
        let belief = self.smoother.belief().clone();
        let relative = |theta: Vec<f64>| {
            let error = (belief.state.marker_at(&theta) - self.truth.marker_at(&theta)).norm();
            error / belief.marker_covariance(&theta).expect("kept").trace().sqrt()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let postures = (0..20).map(|_| (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect());
        postures.map(relative).fold(0.0, f64::max)
    }

    /// The last joint's axis tilts by `angle` radians about the marker's lever, which leaves the marker of a posture alone
    /// in which that joint is at 0.
    fn tilt(&mut self, angle: f64) {
        let Joint::Revolute(line) = &mut self.truth.joints[JOINTS - 1] else { panic!("revolute") };
        let lever = nalgebra::Unit::new_normalize(self.truth.targets[0].place.origin() - line.point);
        line.direction = nalgebra::Rotation3::from_axis_angle(&lever, angle) * line.direction;
    }
}

/// The mode of all measurements, none of them compressed, is where the smoother is that compressed half of them twice, with
/// the same covariance.
#[test]
fn compression_keeps_the_answer() {
    for seed in 0..3 {
        let mut run = Run::new(seed);
        let mut whole = run.smoother.posterior.clone();
        for _ in 0..100 {
            run.step();
            whole.measurements.extend(run.smoother.posterior.measurements.last().cloned());
        }
        let posterior = &run.smoother.posterior;
        assert_eq!((posterior.count(), whole.count()), (100, 100));
        assert!(posterior.measurements.len() <= KEPT && posterior.marginalised.is_some(), "compressed");
        let belief = run.smoother.belief();
        let mode = whole.mode(&belief.state, &belief.layout, THOROUGH).expect("a mode");
        let moved = mode.state.local(&belief.layout, &belief.state).expect("near");
        // A fifth of a standard deviation.
        assert!(moved.dot(&(&mode.information * &moved)) < 0.04, "seed {seed}");
        let whitened: DMatrix<f64> = belief.covariance.as_ref().expect("kept") * &mode.information;
        assert!((whitened.trace() / whitened.nrows() as f64 - 1.0).abs() < 0.02, "seed {seed}");
        assert!(run.error() < 6.0, "seed {seed}: {}", run.error());
    }
}

/// However many outliers there were, the readings that are looked at one by one stay few, and no other hypothesis is searched
/// for any more.
#[test]
fn outliers_do_not_pile_up() {
    for seed in 1001..1004 {
        let mut run = Run::new(seed);
        run.smoother = run.smoother.with_loss(Loss::MIXTURE);
        for index in 0..500 {
            let theta = run.posture();
            let sigma = if index % 5 == 4 { 50.0 * SIGMA } else { SIGMA };
            let noise = Vector3::from_fn(|_, _| sigma * run.rng.sample::<f64, _>(StandardNormal));
            let seen = Observation::seen(run.truth.marker_at(&theta) + noise);
            let update = run.smoother.update(&theta, &seen).expect("an update");
            if index >= 100 {
                let kept = run.smoother.posterior.measurements.len();
                assert!(!update.change_noticed && kept <= KEPT, "seed {seed}: {kept} after {index}");
                assert!(run.smoother.hypotheses.stable_steps >= STABLE, "seed {seed}: searched anew after {index}");
            }
        }
        assert!(run.error() < 6.0, "seed {seed}: {}", run.error());
    }
}

#[test]
fn chance_alone_is_no_change() {
    for seed in 0..3 {
        let mut run = Run::new(seed);
        assert!((0..150).all(|_| !run.step().change_noticed), "seed {seed}");
        assert_eq!(run.smoother.posterior.count(), 150, "nothing was forgotten");
    }
}

/// While the belief is not settled its innovations are large, and say nothing of the body.
#[test]
fn having_no_guess_is_no_change() {
    for seed in 0..3 {
        let mut run = Run::with(seed, Some(1.0));
        assert!((0..25).all(|_| !run.step().change_noticed), "seed {seed}");
    }
}

/// Within a few movements, and soon the estimate is as good again as it says that it is.
#[test]
fn a_change_of_the_body_is_noticed_and_learned() {
    for seed in 0..3 {
        // Before and after measurements were compressed.
        for before in [40, 100] {
            let mut run = Run::new(seed);
            (0..before).for_each(|_| assert!(!run.step().change_noticed));
            run.tilt(0.4);
            assert!(run.error() > 6.0, "the old estimate does not do");
            let noticed = (1..=5).find(|_| run.step().change_noticed);
            let movements = noticed.unwrap_or_else(|| panic!("seed {seed}: not noticed"));
            // But for what fits the new one as well.
            assert!(run.smoother.posterior.count() <= movements + 1, "nothing of the old body is kept");
            (0..25).for_each(|_| assert!(!run.step().change_noticed, "seed {seed}: once"));
            assert!(run.error() < 6.0, "seed {seed}: {}", run.error());
            let spread = run.smoother.belief().marker_covariance(&[0.5; JOINTS]).expect("kept").trace().sqrt();
            assert!(spread < SIGMA, "{spread}");
        }
    }
}

/// One reading that does not fit may be an outlier; two that agree are a change. Nothing that was measured before it is kept as it
/// was, and what it says of the joints that have not changed is.
#[test]
fn a_change_needs_readings_that_agree() {
    let mut run = Run::new(1);
    for _ in 0..40 {
        run.step();
    }
    let before = run.smoother.belief().clone();
    run.tilt(0.4);
    let (mut hidden, mut shown, mut again) = (run.posture(), run.posture(), run.posture());
    (hidden[JOINTS - 1], shown[JOINTS - 1], again[JOINTS - 1]) = (0.0, 1.5, -1.5);
    assert!(!run.to(&hidden).change_noticed, "nothing is to be seen there");
    assert!(!run.to(&shown).change_noticed, "one reading may be an outlier");
    assert!(run.smoother.misfit().is_some(), "but it does not fit");
    assert!(run.to(&again).change_noticed);
    assert!(run.smoother.posterior.measurements.iter().all(|seen| seen.movement > 40));
    assert!(run.smoother.posterior.marginalised.is_none());
    let belief = run.smoother.belief();
    let spread = |belief: &Belief, joint: usize| belief.direction_covariance(joint).expect("kept").trace();
    assert!(spread(belief, 0) < 2.0 * spread(&before, 0), "the first joint is known as before");
    assert!(spread(belief, JOINTS - 1) > 4.0 * spread(&before, JOINTS - 1), "the last one is to be learned anew");
}

/// A single outlier, however far off, is no change, though no loss looks for outliers.
#[test]
fn an_outlier_is_no_change() {
    for (seed, away) in [(1001, 0.1), (1002, 0.3), (1003, 3.0)] {
        let mut run = Run::new(seed);
        (0..40).for_each(|_| _ = run.step());
        let theta = run.posture();
        let place = run.truth.marker_at(&theta) + Vector3::new(away, -away, 0.0);
        assert!(!run.smoother.update(&theta, &Observation::seen(place)).expect("an update").change_noticed, "{away}");
        // By least squares one of 3 m draws the estimate along, whatever follows.
        assert!(away > 1.0 || (0..10).all(|_| !run.step().change_noticed), "seed {seed}: {away}");
    }
}

/// However often.
#[test]
fn a_miss_changes_nothing() {
    for movements in [0, 5, 80] {
        let (mut run, mut other) = (Run::new(2), Run::new(2));
        for run in [&mut run, &mut other] {
            for _ in 0..movements {
                run.step();
            }
        }
        for _ in 0..10 {
            let update = run.smoother.update(&[0.3; JOINTS], &Observation::missed(1)).expect("an update");
            assert_eq!(update, Update::default());
        }
        // Nor what is made of the movements that follow, and of a change.
        for _ in 0..2 {
            (0..3).for_each(|_| assert_eq!(run.step(), other.step()));
            run.tilt(0.4);
            other.tilt(0.4);
        }
        let [a, b] = [run, other].map(|run| run.smoother.belief().clone());
        assert_eq!((a.state, a.covariance, a.alternatives.len()), (b.state, b.covariance, b.alternatives.len()));
    }
}
