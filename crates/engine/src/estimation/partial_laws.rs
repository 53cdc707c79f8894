//! Absent points say nothing: to every estimator a body of which some points are absent is the body of the others.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{Estimator, Gradient, HypothesisSettings, Rls, Smoother, UnscentedRls};
use crate::{
    estimation::Belief,
    model::{
        Block, Device, Distortion, DistortionModel, Layout, Links, Place, Prior, State, Target, random::random_arm,
    },
    sensing::{JointNoise, Loss, MeasurementModel, Observation, PartlySeen, Pixels, Position, Sensor},
};

const JOINTS: usize = 3;
/// The points that are present.
const PRESENT: [usize; 3] = [0, 2, 3];

struct Case {
    guess: State,
    layout: Arc<Layout>,
    /// Of a body of five points of which two are always absent, and of the body of the other three.
    measurement_models: [Arc<MeasurementModel>; 2],
    seen: Vec<(Vec<f64>, [Observation; 2])>,
}

impl Case {
    fn new(seed: u64, play: f64, with_outlier: bool) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = random_arm(&mut rng, JOINTS);
        truth.targets.push(Target { link: JOINTS, place: Place::Pose(Isometry3::translation(0.3, 0.1, 0.2)) });
        let eye = Isometry3::face_towards(&Point3::new(4.0, 0.5, 0.3), &Point3::origin(), &Vector3::z());
        // It looks along its own z.
        let pose = Isometry3::from_parts(eye.translation, eye.rotation);
        let distortion = Distortion::new(DistortionModel::BrownConrady, &[-0.2, 0.05, 0.0, 0.0]);
        let intrinsics = Some([500.0, 500.0, 320.0, 240.0]);
        truth.devices.push(Device { link: None, pose, intrinsics, distortion });
        let blocks = (0..JOINTS).map(Block::Axis).chain([Block::Device(0), Block::Distortion(0, 0)]);
        let layout = Layout::new(&truth, blocks);
        let m = layout.dimension();
        let guess = truth.retract(&layout, &DVector::from_fn(m, |_, _| 0.02 * rng.sample::<f64, _>(StandardNormal)));
        let points: Vec<Point3<f64>> =
            (0..5).map(|_| Point3::from(Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2)))).collect();
        let fewer: Vec<Point3<f64>> = PRESENT.map(|index| points[index]).to_vec();
        let noise = JointNoise::new(&truth, vec![play; JOINTS]).map(Arc::new);
        let measurement_models = [points, fewer].map(|points| {
            let partly_seen = Some(PartlySeen { least_points: 1, facing: Arc::new([]) });
            let size_px = [640.0, 480.0];
            let view = Pixels { camera: 0, target: 1, points: points.into(), size_px, facing: None, partly_seen };
            let tracker = Sensor::even(Position { target: 0 }, 0.01);
            let sensors = vec![tracker, Sensor::even(view, 1.0)];
            Arc::new(MeasurementModel::new(sensors).with_joint_noise(noise.clone().filter(|_| play > 0.0)))
        });
        let seen = (0..14).map(|movement| {
            let theta: Vec<f64> = (0..JOINTS).map(|_| rng.random_range(-1.5..1.5)).collect();
            let stands: Vec<f64> =
                theta.iter().map(|theta| theta + play * rng.sample::<f64, _>(StandardNormal)).collect();
            let read = |measurement_model: &MeasurementModel, channel: usize| {
                let mut reading = vec![0.0; measurement_model.sensors()[channel].equations()];
                measurement_model.sensors()[channel].channel().extended(Links::new(&truth).at(&stands), &mut reading);
                reading
            };
            let mut whole = read(&measurement_models[0], 1);
            let off = if with_outlier && movement == 6 { 60.0 } else { 0.0 };
            whole.iter_mut().for_each(|x| *x += off + rng.sample::<f64, _>(StandardNormal));
            let fewer = PRESENT.iter().flat_map(|point| whole[2 * point..2 * point + 2].to_vec()).collect();
            for point in (0..5).filter(|point| !PRESENT.contains(point)) {
                whole[2 * point..2 * point + 2].fill(f64::NAN);
            }
            // Now and then the camera sees nothing.
            let pictures = if movement % 5 == 4 { [None, None] } else { [Some(whole), Some(fewer)] };
            let marker: Vec<f64> = read(&measurement_models[0], 0)
                .iter()
                .map(|x| x + 0.01 * rng.sample::<f64, _>(StandardNormal))
                .collect();
            let of = |picture| Observation { readings: vec![Some(marker.clone()), picture] };
            (theta, pictures.map(of))
        });
        let seen = seen.collect();
        Self { guess, layout: Arc::new(layout), measurement_models, seen }
    }

    fn covariance(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal_element(self.layout.dimension(), self.layout.dimension(), 0.02 * 0.02)
    }

    fn smoother(&self, which: usize) -> Smoother {
        let prior = Prior::around(self.guess.clone(), &self.layout, self.covariance()).expect("a prior");
        let (settings, rng) = (HypothesisSettings { kept: 1, spawned: 0 }, ChaCha8Rng::seed_from_u64(1));
        Smoother::new(prior, self.layout.clone(), self.measurement_models[which].clone(), settings, rng)
    }

    /// Has two estimators learn from the two.
    fn agree(&self, name: &str, estimator: impl Fn(usize) -> Box<dyn Estimator>) {
        let mut both = [estimator(0), estimator(1)];
        let mut updates = [0.0; 2];
        for (theta, observations) in &self.seen {
            for (which, observation) in observations.iter().enumerate() {
                let update = both[which].update(theta, observation).expect("absorbed");
                updates[which] = update.nis.map_or(0.0, |(nis, d)| nis + d as f64);
            }
            assert!((updates[0] - updates[1]).abs() < 1e-6 * (1.0 + updates[1]), "{name}: {updates:?}");
        }
        let [a, b] = both.each_ref().map(|estimator| estimator.belief());
        let apart = a.state.local(&self.layout, &b.state).expect("near").amax();
        assert!(apart < 1e-7, "{name}: {apart}");
        if let (Some(a), Some(b)) = (&a.covariance, &b.covariance) {
            assert!((a - b).amax() < 1e-6 * b.amax(), "{name}");
        }
        let [read, other] = both.each_ref().map(|estimator| estimator.readings());
        assert_eq!(read.len(), other.len());
        for (a, b) in read.iter().zip(&other) {
            assert_eq!((a.equations, a.channel, a.movement), (b.equations, b.channel, b.movement));
            assert!(
                (a.residual_sigmas - b.residual_sigmas).abs() < 1e-5 && (a.weight - b.weight).abs() < 1e-5,
                "{name}"
            );
        }
        let [noise, other] = both.each_ref().map(|estimator| estimator.noise());
        assert!(noise.iter().zip(&other).all(|(a, b)| (a.scale - b.scale).abs() < 1e-5), "{name}: {noise:?} {other:?}");
        let sigmas = both.each_ref().map(|estimator| estimator.reading_sigmas());
        assert!(sigmas[0].iter().zip(&sigmas[1]).all(|(a, b)| (a - b).abs() < 1e-6), "{name}: {sigmas:?}");
        assert!((a.model_error_m - b.model_error_m).abs() < 1e-6, "{name}");
    }
}

#[test]
fn absent_points_say_nothing() {
    for seed in 1001..1006 {
        let case = Case::new(seed, 0.0, false);
        let belief =
            |which: usize| Belief::new(case.guess.clone(), case.layout.clone(), case.measurement_models[which].clone());
        case.agree("rls", |which| Box::new(Rls::new(belief(which), case.covariance(), None)));
        case.agree("unscented", |which| Box::new(UnscentedRls::new(belief(which), case.covariance(), None)));
        case.agree("gradient", |which| Box::new(Gradient::new(belief(which), 1e-7)));
        case.agree("smoother", |which| Box::new(case.smoother(which)));
        case.agree("unknown noise", |which| Box::new(case.smoother(which).with_unknown_noise(vec![true; 2])));
        let outlier = Case::new(seed, 0.0, true);
        outlier.agree("mixture", |which| Box::new(outlier.smoother(which).with_loss(Loss::MIXTURE)));
        outlier.agree("mixture, unknown noise", |which| {
            Box::new(outlier.smoother(which).with_loss(Loss::MIXTURE).with_unknown_noise(vec![true; 2]))
        });
        let playing = Case::new(seed, 0.01, false);
        playing.agree("play", |which| Box::new(playing.smoother(which).with_unknown_joint_noise(true)));
        let both = Case::new(seed, 0.01, true);
        both.agree("play and outlier", |which| Box::new(both.smoother(which).with_loss(Loss::MIXTURE)));
        let belief =
            |which: usize| Belief::new(both.guess.clone(), both.layout.clone(), both.measurement_models[which].clone());
        both.agree("rls, play", |which| Box::new(Rls::new(belief(which), both.covariance(), None)));
    }
}
