//! What every channel in the list must keep.

use nalgebra::DMatrix;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{
    CHANNELS, MeasurementModel, NoiseModel, Observation, Position, Sensor, Socket, Spacing, check_channel, examples,
};
use crate::model::{
    KinematicData, Layout, Links,
    random::{all_blocks, branched, random_state},
};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Rows are the derivative of the prediction, in every block of the model; both ways of predicting agree.
    #[test]
    fn rows_equal_central_differences(seed: u64, joints in 1_usize..=12) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_state(&mut rng, joints);
        let state = if seed % 2 == 0 { branched(state, &mut rng) } else { state };
        let layout = Layout::new(&state, all_blocks(&state));
        let positions: Vec<f64> = (0..joints).map(|_| rng.random_range(-2.0..2.0)).collect();
        for sensor in examples(&mut rng, &state) {
            let checked = check_channel(sensor.channel().as_ref(), &state, &layout, &positions);
            prop_assert!(checked.is_ok(), "{sensor:?}: {checked:?}");
        }
    }

    /// Noise put on a reading and taken off again is standard normal once whitened.
    #[test]
    fn whitening_undoes_the_noise(seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_state(&mut rng, 4);
        let positions: Vec<f64> = (0..4).map(|_| rng.random_range(-2.0..2.0)).collect();
        for sensor in examples(&mut rng, &state) {
            let d = sensor.equations();
            let mut reading = vec![0.0; d];
            if !sensor.channel().extended(Links::new(&state).at(&positions), &mut reading) {
                continue;
            }
            let v: Vec<f64> = (0..d).map(|_| rng.sample(StandardNormal)).collect();
            let mut measured = reading.clone();
            sensor.disturb(&mut measured, &v);
            let mut whitened = vec![0.0; d];
            sensor.difference(&measured, &reading, &mut whitened);
            prop_assert!(whitened.iter().zip(&v).all(|(found, v)| (found - v).abs() < 1e-6), "{sensor:?}");
            let doubled = sensor.with_sigma(sensor.sigma() * 2.0);
            let mut halved = vec![0.0; d];
            doubled.difference(&measured, &reading, &mut halved);
            prop_assert!(halved.iter().zip(&v).all(|(found, v)| (2.0 * found - v).abs() < 1e-6));
        }
    }

    /// Rows are whitened as residuals are: a sensor's rows are the derivative of its whitened prediction.
    #[test]
    fn rows_are_whitened_as_residuals_are(seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let state = random_state(&mut rng, 4);
        let layout = Layout::new(&state, all_blocks(&state));
        let positions: Vec<f64> = (0..4).map(|_| rng.random_range(-2.0..2.0)).collect();
        let (mut data, m) = (KinematicData::new(&state, &layout), layout.dimension());
        let mut sensors = examples(&mut rng, &state);
        // Full covariances of them all, too.
        let full = |sensor: &Sensor| {
            let d = sensor.equations();
            let covariance = DMatrix::from_fn(d, d, |row, column| 0.01 / (1 + row.abs_diff(column)) as f64);
            sensor.with_noise(NoiseModel::covariance(&covariance).expect("positive")).expect("it fits")
        };
        sensors.extend(sensors.iter().map(full).collect::<Vec<_>>());
        for sensor in sensors {
            let d = sensor.equations();
            let [mut plain, mut whitened] = [vec![0.0; d * m], vec![0.0; d * m]];
            let mut reading = vec![0.0; d];
            if sensor.channel().rows(data.at(&positions), &mut reading, &mut plain) {
                sensor.subject().divide_norms(&reading, &mut plain);
            }
            sensor.rows(data.at(&positions), &mut reading, &mut whitened);
            for coordinate in 0..m {
                let of = |rows: &[f64]| (0..d).map(|k| rows[k * m + coordinate]).collect::<Vec<f64>>();
                // A small step along a column, so small that a rotation is as good as a vector.
                let mut moved = reading.clone();
                sensor.channel().add(&mut moved, &of(&plain).iter().map(|x| 1e-6 * x).collect::<Vec<f64>>());
                let mut wanted = vec![0.0; d];
                sensor.difference(&moved, &reading, &mut wanted);
                let scale = whitened.iter().fold(1.0 / sensor.sigma(), |most: f64, x| most.max(x.abs()));
                let is_near = |(found, wanted): (f64, &f64)| (found - wanted / 1e-6).abs() < 1e-5 * scale;
                prop_assert!(of(&whitened).into_iter().zip(&wanted).all(is_near), "{sensor:?} {coordinate}");
            }
        }
    }
}

/// A measurement model stacks its channels; a reading that is missing leaves its equations out.
#[test]
fn a_rig_stacks_its_channels() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let state = random_state(&mut rng, 5);
    let layout = Layout::new(&state, all_blocks(&state));
    let mut sensors = examples(&mut rng, &state);
    sensors.extend(examples(&mut rng, &state));
    let measurement_model = MeasurementModel::new(sensors);
    let positions = [0.3, -0.2, 0.9, 1.1, -0.4];
    let v: Vec<f64> = (0..measurement_model.equations()).map(|_| rng.sample(StandardNormal)).collect();
    // Of what is in view and of what is not: readings are made by hand.
    let mut start = 0;
    let readings = measurement_model.sensors().iter().map(|sensor| {
        let mut reading = vec![0.0; sensor.equations()];
        assert!(sensor.channel().extended(Links::new(&state).at(&positions), &mut reading));
        sensor.disturb(&mut reading, &v[start..start + sensor.equations()]);
        start += sensor.equations();
        Some(reading)
    });
    let mut observation = Observation { readings: readings.collect() };
    let mut clearances = vec![0.0; measurement_model.sensors().len()];
    measurement_model.clearances(None, &Links::of(&state, &positions), &mut clearances);
    for (reading, clearance) in measurement_model.observe(&state, &positions, &v).readings.iter().zip(&clearances) {
        assert_eq!(reading.is_some(), *clearance >= 0.0, "what is in view is seen");
    }
    let equations = measurement_model.equations_of(&state, &layout, &positions, &observation);
    assert_eq!(equations.rows.shape(), (layout.dimension(), measurement_model.equations()));
    assert!(equations.residual.iter().zip(&v).all(|(found, v)| (found - v).abs() < 1e-6));
    let squared: f64 = v.iter().map(|v| v * v).sum();
    assert!(
        (measurement_model.squared_error(Links::new(&state).at(&positions), &observation) - squared).abs()
            < 1e-6 * squared
    );
    observation.readings[0] = None;
    let fewer = measurement_model.equations_of(&state, &layout, &positions, &observation);
    let missing = measurement_model.sensors()[0].equations();
    assert_eq!(fewer.residual.len(), measurement_model.equations() - missing);
    assert_eq!(fewer.rows, equations.rows.columns(missing, measurement_model.equations() - missing));
    assert_eq!(
        (CHANNELS.len() + 3) * 2,
        measurement_model.sensors().len(),
        "those of sensors, of sockets and of cameras"
    );
}

/// Sockets are read when something is held in them, and what is known beforehand is read then alone.
#[test]
fn a_rig_reads_what_there_is_an_occasion_for() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let state = random_state(&mut rng, 5);
    let socket = |socket, target| Sensor::even(Socket { target, socket }, 0.01);
    let spacing = Sensor::even(Spacing { sockets: [0, 1] }, 0.001);
    let tracker = Sensor::even(Position { target: 1 }, 0.02);
    let measurement_model = MeasurementModel::new(vec![tracker, socket(0, 2), socket(1, 0), spacing]);
    let (positions, v) = ([0.3, -0.2, 0.9, 1.1, -0.4], [0.5; 10]);
    for (held, equations) in [(None, [true, false, false, false]), (Some(1), [true, false, true, false])] {
        let observation = measurement_model.observe_in(held, &state, &positions, &v);
        assert_eq!(observation.readings.iter().map(Option::is_some).collect::<Vec<_>>(), equations);
        assert!(held.is_none() || observation.readings[2] == Some(vec![0.0; 3]), "it is there");
        assert_eq!(measurement_model.held_in(held).equations(), observation.equations());
    }
    assert_eq!(measurement_model.holds(1), Some((2, 0)));
    assert_eq!(measurement_model.holds(2), None);
    let known = measurement_model.beforehand(&state, &v).expect("a spacing");
    let apart = (state.sockets[0] - state.sockets[1]).norm();
    assert_eq!(known.readings[3], Some(vec![apart + 0.001 * 0.5]));
    assert_eq!(known.equations(), 1);
    assert_eq!(MeasurementModel::tracker(0.1).beforehand(&state, &v), None);
}
