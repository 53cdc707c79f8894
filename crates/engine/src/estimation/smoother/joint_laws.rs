//! What the smoother promises where joints' readings are off: it finds what a fit with a latent error for each joint and posture
//! finds, its covariance is honest, it learns how far they are off, and an outlier spoils no other reading.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Point3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{HypothesisSettings, Smoother};
use crate::{
    estimation::{Estimator, OverparameterisedRls, Rls, UnscentedRls},
    model::{Layout, Place, Prior, State, Target, random::random_arm},
    sensing::{JointNoise, Loss, MeasurementModel, Observation, Position, Sensor},
};

const JOINTS: usize = 4;

/// A robot with three known points on its hand, each seen by a tracker of its own, a guess that is off by its prior, and what is
/// seen after some movements.
struct Case {
    truth: State,
    guess: State,
    layout: Arc<Layout>,
    prior: DMatrix<f64>,
    measurement_model: Arc<MeasurementModel>,
    seen: Vec<(Vec<f64>, Observation)>,
    rng: ChaCha8Rng,
}

impl Case {
    fn new(seed: u64, count: usize, sigma: f64, play: f64, off: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = random_arm(&mut rng, JOINTS);
        for _ in 0..2 {
            let point = truth.marker() + nalgebra::Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2));
            truth.targets.push(Target { link: JOINTS, place: Place::Point(point) });
        }
        let layout = Layout::of_arm(&truth, &[], false);
        let m = layout.dimension();
        let guess = truth.retract(&layout, &DVector::from_fn(m, |_, _| off * rng.sample::<f64, _>(StandardNormal)));
        let sensors = (0..3).map(|target| Sensor::even(Position { target }, sigma)).collect();
        let noise = JointNoise::new(&truth, vec![play; JOINTS]).map(Arc::new);
        let measurement_model = Arc::new(MeasurementModel::new(sensors).with_joint_noise(noise));
        let mut case = Self {
            truth,
            guess,
            layout: Arc::new(layout),
            prior: DMatrix::from_diagonal_element(m, m, off * off),
            measurement_model,
            seen: Vec::new(),
            rng,
        };
        case.seen = (0..count).map(|_| case.see()).collect();
        case
    }

    /// What is seen where joints stand beside what they read.
    fn see(&mut self) -> (Vec<f64>, Observation) {
        let theta: Vec<f64> = (0..JOINTS).map(|_| self.rng.random_range(-1.5..1.5)).collect();
        let sigmas = self.measurement_model.joint_noise().map_or(vec![0.0; JOINTS], |noise| noise.sigmas().to_vec());
        let stands: Vec<f64> = theta
            .iter()
            .zip(&sigmas)
            .map(|(theta, sigma)| theta + sigma * self.rng.sample::<f64, _>(StandardNormal))
            .collect();
        let v: Vec<f64> = (0..9).map(|_| self.rng.sample(StandardNormal)).collect();
        (theta, self.measurement_model.observe(&self.truth, &stands, &v))
    }

    fn smoother(&self, measurement_model: Arc<MeasurementModel>) -> Smoother {
        self.searching(measurement_model, HypothesisSettings { kept: 1, spawned: 0 })
    }

    fn searching(&self, measurement_model: Arc<MeasurementModel>, settings: HypothesisSettings) -> Smoother {
        let prior = Prior::around(self.guess.clone(), &self.layout, self.prior.clone()).expect("a prior");
        let rng = ChaCha8Rng::seed_from_u64(1);
        Smoother::new(prior, self.layout.clone(), measurement_model, settings, rng).never_forgetting()
    }

    fn absorbed(&self, mut smoother: Smoother) -> Smoother {
        let seen: Vec<_> = self.seen.iter().map(|(theta, it)| (theta.as_slice(), it)).collect();
        smoother.absorb_all(&seen, &[]).expect("absorbed");
        smoother
    }

    /// The state at which `½ δᵀ P⁻¹ δ + ½ Σ ‖y − h(x, θ + e)‖²/σ² + ½ Σ ‖e‖²/play²` is least, by Gauss and Newton over all of it.
    fn latent(&self) -> State {
        let (m, n, sigma) = (self.layout.dimension(), JOINTS, self.measurement_model.sigma());
        let noise = self.measurement_model.joint_noise().expect("off").sigmas()[0];
        let size = m + n * self.seen.len();
        let mut x = DVector::<f64>::zeros(size);
        let read = |state: &State, stands: &[f64]| {
            DVector::from_iterator(9, (0..3).flat_map(|target| state.target_at(target, stands).coords.data.0[0]))
                / sigma
        };
        let at = |x: &DVector<f64>, index: usize| {
            let state = self.guess.retract(&self.layout, &x.rows(0, m).into_owned());
            let stands: Vec<f64> =
                self.seen[index].0.iter().zip(&x.as_slice()[m + index * n..]).map(|(theta, e)| theta + e).collect();
            read(&state, &stands)
        };
        for _ in 0..8 {
            let (mut information, mut negative_gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
            for k in 0..size {
                let precision = if k < m { self.prior[(k, k)].recip() } else { noise.powi(-2) };
                information[(k, k)] = precision;
                negative_gradient[k] = -precision * x[k];
            }
            for (index, (_, seen)) in self.seen.iter().enumerate() {
                let y = DVector::from_iterator(9, seen.readings.iter().flatten().flatten().copied()) / sigma;
                let places: Vec<usize> = (0..m).chain(m + index * n..m + (index + 1) * n).collect();
                let slopes: Vec<DVector<f64>> = (places.iter())
                    .map(|place| {
                        let moved = |step: f64| {
                            let mut moved = x.clone();
                            moved[*place] += step;
                            at(&moved, index)
                        };
                        (moved(1e-5) - moved(-1e-5)) / 2e-5
                    })
                    .collect();
                let jacobian = DMatrix::from_columns(&slopes);
                let (squares, pull) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&(y - at(&x, index))));
                for (a, row) in places.iter().enumerate() {
                    negative_gradient[*row] += pull[a];
                    places.iter().enumerate().for_each(|(b, column)| information[(*row, *column)] += squares[(a, b)]);
                }
            }
            x += information.cholesky().expect("positive").solve(&negative_gradient);
        }
        self.guess.retract(&self.layout, &x.rows(0, m).into_owned())
    }

    /// Normalised estimation error squared.
    fn nees(&self, smoother: &Smoother) -> f64 {
        let belief = smoother.belief();
        let error = belief.state.local(&self.layout, &self.truth.slid_towards(&belief.state)).expect("in the chart");
        let covariance = belief.covariance.clone().expect("kept");
        error.dot(&covariance.cholesky().expect("positive").solve(&error))
    }
}

#[test]
fn integrated_errors_are_those_of_a_latent_fit() {
    for seed in 0..12 {
        let case = Case::new(seed, 25, 1e-4, 2e-4, 0.01);
        let found = case.absorbed(case.smoother(case.measurement_model.clone()));
        let state = case.latent();
        let apart = found.belief().state.local(&case.layout, &state.slid_towards(&found.belief().state));
        let apart = apart.expect("in the chart").amax();
        assert!(apart < 1e-6, "seed {seed}: {apart}");
        // It is another state than where joints are taken to be exact.
        let exact =
            case.absorbed(case.smoother(Arc::new(case.measurement_model.as_ref().clone().with_joint_noise(None))));
        let apart = exact.belief().state.local(&case.layout, &state.slid_towards(&exact.belief().state));
        assert!(apart.expect("in the chart").amax() > 1e-5, "seed {seed}");
    }
}

#[test]
fn the_covariance_is_honest() {
    let (mut sum, mut exact, mut count) = (0.0, 0.0, 0.0);
    for seed in 100..150 {
        let case = Case::new(seed, 12, 1e-3, 5e-3, 0.02);
        sum += case.nees(&case.absorbed(case.smoother(case.measurement_model.clone())));
        let measurement_model = Arc::new(case.measurement_model.as_ref().clone().with_joint_noise(None));
        exact += case.nees(&case.absorbed(case.smoother(measurement_model)));
        count += case.layout.dimension() as f64;
    }
    assert!((0.85..1.15).contains(&(sum / count)), "{}", sum / count);
    assert!(exact / count > 3.0, "joints taken to be exact: {}", exact / count);
}

#[test]
fn how_far_joints_are_off_is_learned() {
    for (sigma, play, noise_unknown) in [(1e-3, 0.01, false), (1e-3, 0.03, false), (2e-3, 0.005, true)] {
        let (mut factors, mut scales) = (Vec::new(), Vec::new());
        for seed in 200..221 {
            let case = Case::new(seed, 25, sigma, play, 0.02);
            let noise = JointNoise::new(&case.truth, vec![0.0175; JOINTS]).map(Arc::new);
            let measurement_model = Arc::new(case.measurement_model.assuming(1e-3).with_joint_noise(noise));
            let smoother = case.smoother(measurement_model).with_loss(Loss::MIXTURE).with_unknown_joint_noise(true);
            let found = case.absorbed(smoother.with_unknown_noise(vec![noise_unknown; 3]));
            factors.push(found.reading_sigmas()[0] / play);
            scales.extend(found.noise().iter().map(|noise| noise.scale));
            assert!(found.readings().iter().all(|reading| reading.weight > 0.5), "seed {seed}: none is an outlier");
        }
        let median = |mut numbers: Vec<f64>| {
            numbers.sort_by(f64::total_cmp);
            numbers[numbers.len() / 2]
        };
        let factor = median(factors);
        assert!((0.75..1.25).contains(&factor), "{sigma} {play}: {factor}");
        if noise_unknown {
            let scale = median(scales);
            assert!((1.6..2.4).contains(&scale), "the sensors' noise is told apart: {scale}");
        }
    }
}

/// Movement by movement, as a session does, and while there are fewer equations than unknowns.
#[test]
fn what_is_learned_neither_collapses_nor_swells_at_first() {
    for seed in 300..306 {
        let case = Case::new(seed, 8, 1e-3, 0.01, 0.05);
        let noise = JointNoise::new(&case.truth, vec![0.0175; JOINTS]).map(Arc::new);
        let measurement_model = Arc::new(case.measurement_model.as_ref().clone().with_joint_noise(noise));
        let smoother = case.searching(measurement_model, HypothesisSettings { kept: 8, spawned: 8 });
        let mut smoother = smoother.with_loss(Loss::MIXTURE).with_unknown_joint_noise(true);
        for (theta, observation) in &case.seen {
            smoother.update(theta, observation).expect("absorbed");
            let sigma = smoother.reading_sigmas()[0];
            assert!((0.003..0.03).contains(&sigma), "seed {seed}: {sigma}");
        }
    }
}

/// One reading of a posture is far off: it counts for nothing, and the other readings of that posture count as ever.
#[test]
fn an_outlier_spoils_no_other_reading() {
    for (seed, channel) in [(1, 0), (2, 1), (3, 2)] {
        let mut case = Case::new(400 + seed, 20, 1e-3, 5e-3, 0.02);
        case.seen[7].1.readings[channel] = None;
        let without = case.absorbed(case.smoother(case.measurement_model.clone()).with_loss(Loss::MIXTURE));
        case.seen[7].1.readings[channel] = Some(vec![3.0, -2.0, 4.0]);
        let found = case.absorbed(case.smoother(case.measurement_model.clone()).with_loss(Loss::MIXTURE));
        let outliers: Vec<(u64, usize)> =
            found.readings().iter().filter(|it| it.weight < 0.5).map(|it| (it.movement, it.channel)).collect();
        assert_eq!(outliers, [(8, channel)], "seed {seed}");
        let (a, b) = (&found.belief().state, &without.belief().state);
        let apart = a.local(&case.layout, &b.slid_towards(a)).expect("in the chart");
        // A weight of 1/2500 is all that is left of it.
        let covariance = without.belief().covariance.clone().expect("kept");
        let deviations = covariance.diagonal().map(f64::sqrt);
        assert!(apart.component_div(&deviations).amax() < 0.5, "seed {seed}: {apart}");
    }
}

#[test]
fn joints_that_are_off_by_nothing_change_no_bit() {
    let case = Case::new(5, 6, 1e-3, 0.0, 0.05);
    assert!(case.measurement_model.joint_noise().is_none());
    assert!(JointNoise::new(&case.truth, vec![-1.0; JOINTS]).is_none());
    assert!(JointNoise::new(&case.truth, vec![0.1; JOINTS + 1]).is_none());
    let plain = Arc::new(MeasurementModel::new(case.measurement_model.sensors().to_vec()));
    let [mut a, mut b] = [case.measurement_model.clone(), plain]
        .map(|measurement_model| case.smoother(measurement_model).with_unknown_joint_noise(true));
    for (theta, observation) in &case.seen {
        a.update(theta, observation).expect("absorbed");
        b.update(theta, observation).expect("absorbed");
        assert_eq!(a.belief().state, b.belief().state);
        assert_eq!(a.belief().covariance, b.belief().covariance);
    }
}

/// One update of every filter against (P⁻¹ + Hᵀ C⁻¹ H)⁻¹ and rᵀ (H P Hᵀ + C)⁻¹ r, C built as a matrix.
#[test]
fn filters_whiten_readings_together() {
    for seed in 500..510 {
        let mut case = Case::new(seed, 1, 1e-3, 5e-3, 1e-4);
        let (theta, observation) = case.seen.remove(0);
        let apart = case.measurement_model.as_ref().clone().with_joint_noise(None);
        let equations = apart.equations_of(&case.guess, &case.layout, &theta, &observation);
        let noise = case.measurement_model.joint_noise().expect("off").clone();
        let j = case.measurement_model.joint_rows_of(&noise, &case.guess, &theta, &observation);
        let j = DMatrix::from_column_slice(JOINTS, 9, &j);
        let c = j.tr_mul(&j) * 2.5e-5 + DMatrix::identity(9, 9);
        let s = equations.rows.tr_mul(&(&case.prior * &equations.rows)) + &c;
        let nis = equations.residual.dot(&s.clone().cholesky().expect("positive").solve(&equations.residual));
        let gain = &case.prior * &equations.rows;
        let posterior = &case.prior - &gain * s.cholesky().expect("positive").solve(&gain.transpose());
        let belief =
            crate::estimation::Belief::new(case.guess.clone(), case.layout.clone(), case.measurement_model.clone());
        let filters: [Box<dyn Estimator>; 2] = [
            Box::new(Rls::new(belief.clone(), case.prior.clone(), None)),
            Box::new(UnscentedRls::new(belief.clone(), case.prior.clone(), None)),
        ];
        for mut filter in filters {
            let update = filter.update(&theta, &observation).expect("absorbed");
            let found = update.nis.expect("seen");
            assert!((found.0 / nis - 1.0).abs() < 1e-3 && found.1 == 9, "seed {seed}: {found:?} {nis}");
            let covariance = filter.belief().covariance.clone().expect("kept");
            assert!((covariance - &posterior).amax() < 1e-3 * case.prior.amax(), "seed {seed}");
        }
        // The smoother tells the same of an innovation.
        let told = case
            .smoother(case.measurement_model.clone())
            .update(&theta, &observation)
            .expect("absorbed")
            .nis
            .expect("seen");
        assert!((told.0 / nis - 1.0).abs() < 1e-9, "{told:?} {nis}");
    }
    // In six numbers per joint, of the marker alone.
    let case = Case::new(520, 1, 1e-3, 5e-3, 0.01);
    let (theta, observation) = &case.seen[0];
    let nis = |measurement_model: &MeasurementModel| {
        let belief = crate::estimation::Belief::new(
            case.guess.clone(),
            case.layout.clone(),
            Arc::new(measurement_model.clone()),
        );
        OverparameterisedRls::new(belief, 1e-6, 1e-6, None)
            .update(theta, observation)
            .expect("absorbed")
            .nis
            .expect("seen")
            .0
    };
    let reading = observation.readings[0].as_ref().expect("seen");
    let marker = MeasurementModel::new(case.measurement_model.sensors()[..1].to_vec())
        .with_joint_noise(case.measurement_model.joint_noise().cloned());
    let residual = marker.residual(&case.guess, theta, &Observation::seen(Point3::from_slice(reading)));
    assert!(
        (nis(&case.measurement_model) / residual.norm_squared() - 1.0).abs() < 1e-3,
        "known axes leave the joints' errors"
    );
}
