//! What cameras with lenses keep, and targets that are partly seen.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{
    Channel, Facing, MeasurementModel, Observation, PartlySeen, Pixels, Refused, Sensor, check_channel, present,
};
use crate::{
    elementary::{atan2, hypot},
    model::{
        Device, Distortion, DistortionModel, Frame, Layout, Links, Place, State, Target,
        random::{all_blocks, branched, random_arm, random_direction, random_state},
    },
};

/// A lens whose border does not hang by a hair: where a condition almost touches its bound, no step is small.
fn random_lens(rng: &mut ChaCha8Rng) -> Distortion {
    loop {
        let k: [f64; 8] = std::array::from_fn(|index| {
            let size = if index == 2 || index == 3 { 0.005 } else { 0.3 };
            rng.random_range(-size..size)
        });
        let fisheye = [0.1 * k[0], 0.1 * k[1], 0.1 * k[2], 0.05 * k[3]];
        let lens = match rng.random_range(0..4) {
            0 => Distortion::new(DistortionModel::Equidistant, &fisheye),
            1 => Distortion::new(DistortionModel::BrownConrady, &k[..4]),
            2 => Distortion::new(DistortionModel::BrownConrady, &k[..5]),
            _ => Distortion::new(DistortionModel::BrownConrady, &k),
        }
        .expect("a lens");
        let moved = |(index, k): (usize, &f64)| (lens.with(index, k + 1e-4).widest() - lens.widest()).abs();
        if lens.coefficients().iter().enumerate().map(moved).all(|moved| moved < 1e-3) {
            return lens;
        }
    }
}

/// Whether what the lens does to a picture changes so fast with a coefficient that no step is small: where its denominator almost vanishes.
fn is_steep(view: &Pixels, state: &State, positions: &[f64]) -> bool {
    let pixels = |lens: &Distortion| {
        let mut state = state.clone();
        state.devices[0].distortion = Some(*lens);
        let mut pixels = vec![0.0; view.subject().equations()];
        view.extended(Links::new(&state).at(positions), &mut pixels);
        pixels
    };
    let lens = state.devices[0].distortion.as_ref().expect("a lens");
    let here = pixels(lens);
    let moved = |(index, k): (usize, &f64)| pixels(&lens.with(index, k + 1e-6));
    let moved =
        lens.coefficients().iter().enumerate().map(moved).flat_map(|there| {
            there.into_iter().zip(&here).map(|(there, here)| (there - here).abs()).collect::<Vec<f64>>()
        });
    moved.fold(0.0, f64::max) > 0.02
}

/// A view of a random body by the first camera.
fn random_view(rng: &mut ChaCha8Rng, state: &State) -> Pixels {
    let count = rng.random_range(2..=5);
    let points: Arc<[Point3<f64>]> =
        (0..count).map(|_| Point3::from(Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2)))).collect();
    let facing = (0..count).map(|_| Facing { direction: random_direction(rng), within: 1.5 }).collect();
    let partly_seen = rng.random_bool(0.5).then(|| PartlySeen {
        least_points: rng.random_range(1..=2),
        facing: if rng.random_bool(0.5) { facing } else { Arc::new([]) },
    });
    let target = rng.random_range(0..state.targets.len());
    Pixels { camera: 0, target, points, size_px: [640.0, 480.0], facing: None, partly_seen }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Rows are the derivative of the prediction, also by the coefficients of the lens; all ways to predict agree.
    #[test]
    fn rows_equal_central_differences(seed: u64, joints in 1_usize..=6) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut state = random_state(&mut rng, joints);
        state.devices[0].distortion = Some(random_lens(&mut rng));
        let state = if seed % 2 == 0 { branched(state, &mut rng) } else { state };
        let layout = Layout::new(&state, all_blocks(&state));
        let positions: Vec<f64> = (0..joints).map(|_| rng.random_range(-2.0..2.0)).collect();
        let view = random_view(&mut rng, &state);
        let place = state.relative(Frame::Target(view.target), Frame::Device(0), &positions);
        // Straight behind a fisheye and at the camera itself all directions meet: no step is small there.
        let meets = |at: Vector3<f64>| at.norm() < 0.2 || at.z < 0.0 && hypot(at.x, at.y) < 0.2;
        prop_assume!(!view.points.iter().any(|point| meets((place * point).coords)));
        prop_assume!(!is_steep(&view, &state, &positions));
        let checked = check_channel(&view, &state, &layout, &positions);
        prop_assert!(checked.is_ok(), "{:?} {view:?}: {checked:?}", state.devices[0]);
    }
}

/// A camera at the origin with this lens, and a body at a place in its frame.
fn placed(rng: &mut ChaCha8Rng, distortion: Option<Distortion>, at: Isometry3<f64>) -> State {
    let mut state = random_arm(rng, 2);
    let intrinsics = Some([400.0, 420.0, 300.0, 250.0]);
    state.devices.push(Device { link: None, pose: Isometry3::identity(), intrinsics, distortion });
    state.targets.push(Target { link: 0, place: Place::Pose(at) });
    state
}

/// A point is in view exactly where its own pixel is in the picture, it is not beyond where the lens holds, and it faces the camera; and
/// the clearance does not jump on the way.
#[test]
fn the_clearance_has_the_sign_that_pixels_say_and_does_not_jump() {
    let mut rng = ChaCha8Rng::seed_from_u64(1002);
    let mut seen = [0; 2];
    for _ in 0..400 {
        let lens = random_lens(&mut rng);
        let way = random_direction(&mut rng);
        let start = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)) + Vector3::z() * 0.6;
        let view = Pixels {
            camera: 0,
            target: 1,
            points: [Point3::origin()].into(),
            size_px: [640.0, 480.0],
            facing: None,
            partly_seen: None,
        };
        let mut before: Option<(f64, Vector3<f64>)> = None;
        for step in 0..400 {
            let at = start + way.into_inner() * (0.005 * f64::from(step));
            // At the camera itself no angle is continuous.
            if at.norm() < 0.1 {
                before = None;
                continue;
            }
            let state = placed(&mut rng, Some(lens), Isometry3::from_parts(at.into(), UnitQuaternion::identity()));
            let clearance = view.clearance(Links::new(&state).at(&[0.0; 2])).expect("a view");
            let angle = atan2(hypot(at.x, at.y), at.z);
            let is_seen = angle <= lens.widest() && {
                let depth = if lens.model() == DistortionModel::BrownConrady { at / at.z } else { at };
                let place = lens.image(&depth).at;
                let (u, v) = (400.0 * place.x + 300.0, 420.0 * place.y + 250.0);
                (0.0..=640.0).contains(&u) && (0.0..=480.0).contains(&v)
            };
            assert_eq!(clearance >= 0.0, is_seen, "{lens:?} {at}: {clearance}");
            seen[usize::from(is_seen)] += 1;
            if let Some((other, there)) = before {
                // A lens may spread rays; at most eightfold.
                let turned = there.angle(&at);
                assert!(
                    (clearance - other).abs() < 10.0 * turned + 1e-9,
                    "{lens:?} {at}: {other} {clearance} {turned}"
                );
            }
            before = Some((clearance, at));
        }
    }
    assert!(seen.iter().all(|count| *count > 10_000), "{seen:?}");
}

/// A cube of whose corners each faces outwards: what is seen, what its rows are, and from how many points on it is read.
#[test]
fn points_are_seen_one_by_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(1003);
    let corners: Vec<Point3<f64>> = (0..8)
        .map(|index| Point3::from(Vector3::from_fn(|axis, _| if index >> axis & 1 == 1 { 0.05 } else { -0.05 })))
        .collect();
    let facing = corners
        .iter()
        .map(|corner| Facing { direction: UnitVector3::new_normalize(corner.coords), within: 1.6 })
        .collect();
    let partly_seen = Some(PartlySeen { least_points: 4, facing });
    let view = Pixels {
        camera: 0,
        target: 1,
        points: corners.clone().into(),
        size_px: [640.0, 480.0],
        facing: None,
        partly_seen,
    };
    let measurement_model = MeasurementModel::new(vec![Sensor::even(view, 0.5)]);
    let lens = Distortion::new(DistortionModel::BrownConrady, &[-0.3, 0.05, 0.001, 0.0]).expect("a lens");
    let mut counts = [0; 9];
    for _ in 0..600 {
        let place = Isometry3::from_parts(
            Vector3::new(rng.random_range(-0.3..0.3), rng.random_range(-0.2..0.2), rng.random_range(-0.1..0.6)).into(),
            UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0))),
        );
        let state = placed(&mut rng, Some(lens), place);
        let theta = [0.3, -0.2];
        let body = state.frame_at(Frame::Target(1), &theta);
        let is_seen = |corner: &Point3<f64>| {
            let at = (body * corner).coords;
            let faces = (body.rotation * corner.coords).angle(&-at) <= 1.6;
            let place = lens.image(&(at / at.z)).at;
            let (u, v) = (400.0 * place.x + 300.0, 420.0 * place.y + 250.0);
            let inside = lens.holds(&at) && (0.0..=640.0).contains(&u) && (0.0..=480.0).contains(&v);
            faces && inside
        };
        let wanted: Vec<bool> = corners.iter().map(is_seen).collect();
        let count = wanted.iter().filter(|seen| **seen).count();
        let v: Vec<f64> = (0..16).map(|_| rng.sample(StandardNormal)).collect();
        let observation = measurement_model.observe(&state, &theta, &v);
        assert_eq!(observation.is_miss(), count < 4, "{count}");
        counts[count] += 1;
        let Some(reading) = &observation.readings[0] else { continue };
        assert_eq!(observation.check(&measurement_model, 2, &theta), Ok(()));
        assert_eq!(reading.iter().map(|x| !x.is_nan()).step_by(2).collect::<Vec<_>>(), wanted);
        assert_eq!((present(reading), observation.equations(), observation.numbers()), (2 * count, 2 * count, 16));
        // Noise of one is one whatever is absent.
        let squared: f64 = v.iter().zip(reading).filter(|(_, x)| !x.is_nan()).map(|(v, _)| v * v).sum();
        assert!(
            (measurement_model.squared_error(Links::new(&state).at(&theta), &observation) - squared).abs()
                < 1e-6 * squared
        );
        let layout = Layout::new(&state, all_blocks(&state));
        let equations = measurement_model.equations_of(&state, &layout, &theta, &observation);
        assert_eq!(equations.residual.len(), 2 * count);
        // What a choice expects of this posture are these equations.
        let rows = measurement_model.visible_jacobian(None, &state, &layout, &theta).expect("seen");
        let shown: Vec<usize> = (0..16).filter(|row| wanted[row / 2]).collect();
        assert_eq!(rows.select_columns(&shown), equations.rows);
        assert!((0..16).filter(|row| !wanted[row / 2]).all(|row| rows.column(row).iter().all(|x| *x == 0.0)));
        // Half a point, and too few of them, are refused.
        let point = wanted.iter().position(|seen| *seen).expect("some");
        let mut half = observation.clone();
        half.readings[0].as_mut().expect("read")[2 * point] = f64::NAN;
        assert_eq!(half.check(&measurement_model, 2, &theta), Err(Refused::HalfPoint { channel: 0, point }));
        let mut few = observation.clone();
        let reading = few.readings[0].as_mut().expect("read");
        for point in shown.iter().skip(6) {
            reading[*point] = f64::NAN;
        }
        assert_eq!(few.check(&measurement_model, 2, &theta), Err(Refused::Points { channel: 0, found: 3, wanted: 4 }));
    }
    assert!(counts.iter().sum::<i32>() == 600 && counts[4..8].iter().sum::<i32>() > 50, "{counts:?}");
    // Of a target that is seen whole nothing may be absent.
    let whole = Pixels {
        camera: 0,
        target: 1,
        points: corners.into(),
        size_px: [640.0, 480.0],
        facing: None,
        partly_seen: None,
    };
    let measurement_model = MeasurementModel::new(vec![Sensor::even(whole, 0.5)]);
    let found = Observation::of([f64::NAN; 16]).check(&measurement_model, 2, &[0.0; 2]);
    assert!(matches!(found, Err(Refused::Reading { channel: 0, .. })), "{found:?}");
}
