//! The measurement model: all sensors of a robot together.

use std::{borrow::Cow, ops::Range, sync::Arc};

use nalgebra::{DMatrix, DVector, Matrix3};

use super::{
    JointErrors, JointNoise, Observation, Occasion, Position, Sensor, Servo, UnusableNoise, observation::present,
    sensor::unusable,
};
use crate::model::{KinematicData, Layout, Links, State, Whitening};

/// All sensors by which a robot is observed: channels in an order, each with its noise. All equations that it returns are
/// whitened: R = I.
#[derive(Clone, Debug)]
pub struct MeasurementModel {
    sensors: Vec<Sensor>,
    /// The range of each channel's equations among all.
    places: Vec<Range<usize>>,
    /// All kinds of noise, channel by channel.
    noises: Vec<Noise>,
    marker: Option<usize>,
    /// What was found when noises were checked.
    unusable: Option<UnusableNoise>,
    /// The noise of the joints' readings; `None` where they are exact.
    joints: Option<Arc<JointNoise>>,
    /// The joints that aim a camera, where the robot does so by itself.
    servo: Option<Arc<Servo>>,
}

/// One kind of noise of a channel, shared by a range of its equations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Noise {
    /// The channel.
    pub channel: usize,
    /// The range of its equations among those of the channel.
    pub part: Range<usize>,
}

/// An observation linearised at a state: `residual ≈ H δ + v`, `v ~ N(0, I)`.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Hᵀ (m × d), whitened; d equations of the readings that are present.
    pub rows: DMatrix<f64>,
    /// L⁻¹ (y ⊖ h), d numbers.
    pub residual: DVector<f64>,
}

impl MeasurementModel {
    /// A measurement model of these sensors. Their noises are checked here, once: [`check_noise`](Self::check_noise) tells what was found.
    pub fn new(sensors: Vec<Sensor>) -> Self {
        let mut places = Vec::with_capacity(sensors.len());
        let mut start = 0;
        for sensor in &sensors {
            places.push(start..start + sensor.equations());
            start += sensor.equations();
        }
        let marker = sensors.iter().position(|sensor| sensor.subject().point() == Some(0));
        let noises = sensors
            .iter()
            .enumerate()
            .flat_map(|(channel, sensor)| sensor.kinds().into_iter().map(move |part| Noise { channel, part }));
        let (noises, unusable) = (noises.collect(), unusable(&sensors));
        Self { sensors, places, noises, marker, unusable, joints: None, servo: None }
    }

    /// This measurement model with joints' readings that err by `joints`: all readings after one movement err together, and are
    /// whitened by `I + J Σ Jᵀ`. See [`JointNoise`].
    pub fn with_joint_noise(self, joints: Option<Arc<JointNoise>>) -> Self {
        Self { joints, ..self }
    }

    /// This measurement model of a robot that aims a camera by itself: in every posture the servo joints follow from the others.
    pub fn with_servo(self, servo: Option<Arc<Servo>>) -> Self {
        Self { servo, ..self }
    }

    /// The joints that aim a camera; `None` where no joint does so by itself.
    pub fn servo(&self) -> Option<&Servo> {
        self.servo.as_deref()
    }

    /// The posture `positions` with the servo joints, if there are any, as they aim their camera in a robot that is as `state` says.
    pub fn aimed<'a>(&self, state: &State, positions: &'a [f64]) -> Cow<'a, [f64]> {
        self.servo.as_ref().map_or(Cow::Borrowed(positions), |servo| Cow::Owned(servo.aimed(state, positions)))
    }

    /// The same from a posture in which they aim already, as another state has it: as exactly as visibility needs it, to a thousandth
    /// of a radian: what is left after a Gauss–Newton step of a hundredth.
    pub fn aimed_from<'a>(&self, state: &State, posture: &'a [f64]) -> Cow<'a, [f64]> {
        self.servo.as_ref().map_or(Cow::Borrowed(posture), |servo| Cow::Owned(servo.aim(state, posture.to_vec(), 1e-2)))
    }

    /// Other sensors of the same robot.
    fn of_the_same_robot(&self, sensors: Vec<Sensor>) -> Self {
        Self { joints: self.joints.clone(), servo: self.servo.clone(), ..Self::new(sensors) }
    }

    /// The noise of the joints' readings; `None` where they are exact.
    pub fn joint_noise(&self) -> Option<&Arc<JointNoise>> {
        self.joints.as_ref()
    }

    /// A measurement model with one tracker of the marker, with noise of `sigma_m` per coordinate (metres).
    pub fn tracker(sigma_m: f64) -> Self {
        Self::new(vec![Sensor::even(Position { target: 0 }, sigma_m)])
    }

    /// The sensors in order, one for each channel.
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Whether every σ is a number above 0 by which readings can be divided, as was checked when the measurement model was made.
    ///
    /// # Errors
    ///
    /// [`UnusableNoise`] with the first σ that is not.
    pub fn check_noise(&self) -> Result<(), UnusableNoise> {
        self.unusable.map_or(Ok(()), Err)
    }

    /// The sensors that read after a movement that holds a target in `socket`, or in none.
    pub fn held_in(&self, socket: Option<usize>) -> Self {
        let reads = |sensor: &&Sensor| match sensor.subject().occasion {
            Occasion::Always => true,
            Occasion::Held { socket: other, .. } => socket == Some(other),
            Occasion::Beforehand => false,
        };
        self.of_the_same_robot(self.sensors.iter().filter(reads).cloned().collect())
    }

    /// The channel that reads while a target is held in `socket`, and that target.
    pub fn holds(&self, socket: usize) -> Option<(usize, usize)> {
        self.sensors.iter().enumerate().find_map(|(index, sensor)| match sensor.subject().occasion {
            Occasion::Held { socket: other, target } if other == socket => Some((index, target)),
            _ => None,
        })
    }

    /// The sensors that read before any movement; `None` if there are none.
    pub fn known_beforehand(&self) -> Option<Self> {
        let reads = |sensor: &&Sensor| sensor.subject().occasion == Occasion::Beforehand;
        let sensors: Vec<_> = self.sensors.iter().filter(reads).cloned().collect();
        (!sensors.is_empty()).then(|| Self::new(sensors))
    }

    /// An observation of what is known before any movement, for a robot whose equipment is as `state` says, with `v` (d
    /// standard normal numbers) as noise; `None` if nothing is known.
    pub fn beforehand(&self, state: &State, v: &[f64]) -> Option<Observation> {
        // It has nothing to do with the robot's posture.
        let anywhere = vec![0.0; state.joints.len()];
        let mut known = self.observe(state, &anywhere, v);
        for (sensor, reading) in self.sensors.iter().zip(&mut known.readings) {
            if sensor.subject().occasion != Occasion::Beforehand {
                *reading = None;
            }
        }
        (!known.is_miss()).then_some(known)
    }

    /// A channel's part of `v`, one number per equation of all.
    pub fn part<'a>(&self, channel: usize, v: &'a [f64]) -> &'a [f64] {
        &v[self.places[channel].clone()]
    }

    /// All kinds of noise, channel by channel.
    pub fn noises(&self) -> &[Noise] {
        &self.noises
    }

    /// This measurement model with each kind of noise multiplied by its factor.
    pub fn scaled(&self, factors: &[f64]) -> Self {
        let of = |index: usize| {
            let of_channel = self.noises.iter().zip(factors).filter(|(noise, _)| noise.channel == index);
            of_channel.map(|(_, factor)| *factor).collect::<Vec<f64>>()
        };
        let scaled = self.sensors.iter().enumerate().map(|(index, sensor)| sensor.scaled(&of(index)));
        self.of_the_same_robot(scaled.collect())
    }

    /// Whether any channel sees some postures only.
    pub fn has_view(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.subject().has_view)
    }

    /// d, the number of equations of a movement with all readings.
    pub fn equations(&self) -> usize {
        self.places.last().map_or(0, |place| place.end)
    }

    /// The points that are measured, if nothing else is measured (see [`Sensor::point`]) and their errors are
    /// independent.
    pub fn points(&self) -> Option<Vec<(usize, Whitening)>> {
        if self.joints.is_some() {
            return None;
        }
        self.sensors.iter().map(Sensor::point).collect()
    }

    /// The channel that measures the marker's position.
    pub fn marker_channel(&self) -> Option<usize> {
        self.marker
    }

    /// σ of the channel that measures the marker's position, metres; NaN if there is none.
    pub fn marker_sigma(&self) -> f64 {
        self.marker.map_or(f64::NAN, |channel| self.sensors[channel].sigma())
    }

    /// σ of the first channel, in its own unit.
    pub fn sigma(&self) -> f64 {
        self.sensors.first().map_or(0.0, Sensor::sigma)
    }

    /// This measurement model with σ of the first channel as `sigma`, and those of the others changed in proportion.
    pub fn assuming(&self, sigma: f64) -> Self {
        // Sensors without noise are all alike.
        let factor = if self.sigma() > 0.0 { sigma / self.sigma() } else { f64::INFINITY };
        let scaled = self.sensors.iter().enumerate().map(|(index, sensor)| {
            // Not by the factor: σ is to be `sigma` to the last bit, also where it was 0.
            sensor.with_sigma(if index == 0 || factor.is_infinite() { sigma } else { sensor.sigma() * factor })
        });
        self.of_the_same_robot(scaled.collect())
    }

    /// H P Hᵀ of the marker's position (m²), computed from the whitened spread of all equations; `None` if no channel
    /// measures it.
    pub fn marker_spread(&self, spread: impl Fn(usize, usize) -> f64) -> Option<Matrix3<f64>> {
        let channel = self.marker?;
        let (start, variance) = (self.places[channel].start, self.sensors[channel].sigma().powi(2));
        Some(Matrix3::from_fn(|row, column| spread(start + row, start + column) * variance))
    }

    /// Whitens the marker's three equations, whitened already by the sensor's noise, by the noise of the joints; exact joints
    /// change nothing.
    pub fn whiten_marker(&self, state: &State, positions: &[f64], rows: &mut [f64], residual: &mut [f64]) {
        if let (Some(joints), Some(place)) = (&self.joints, self.marker_place()) {
            let by_joints = self.joint_rows(joints, &[], state, positions);
            let n = positions.len();
            joints.whiten(&by_joints[place.start * n..place.end * n], rows, residual);
        }
    }

    /// The range of the marker's predicted position among all predicted readings.
    pub fn marker_place(&self) -> Option<Range<usize>> {
        Some(self.places[self.marker?].clone())
    }

    /// All predicted readings at one posture (d numbers; NaN where there is none) and their whitened rows, transposed:
    /// d columns of m numbers in `rows`, which are all zero at first. Points that the state of `data` would not show there have no reading,
    /// and their rows are zero (see [`unseen`](Self::unseen)).
    #[inline]
    pub fn rows(&self, data: &KinematicData<'_>, readings: &mut [f64], rows: &mut [f64]) {
        self.rows_without(&self.unseen(data.links()), data, readings, rows);
    }

    /// Like [`rows`](Self::rows), with these ranges of equations taken to be absent.
    pub fn rows_without(
        &self,
        unseen: &[Range<usize>],
        data: &KinematicData<'_>,
        readings: &mut [f64],
        rows: &mut [f64],
    ) {
        self.rows_apart(unseen, data, readings, rows);
        if let Some(joints) = &self.joints {
            joints.whiten(&self.joint_rows(joints, unseen, data.state(), data.positions()), rows, &mut []);
        }
    }

    /// J = ∂h/∂q by the joints' readings at one posture, whitened by the sensors' noise, transposed: d columns of n numbers, zero
    /// of the equations that are `unseen`.
    pub fn joint_rows(
        &self,
        joints: &JointNoise,
        unseen: &[Range<usize>],
        state: &State,
        positions: &[f64],
    ) -> Vec<f64> {
        let (d, n) = (self.equations(), positions.len());
        let mut data = KinematicData::new(state, joints.layout());
        let mut rows = vec![0.0; d * n];
        self.rows_apart(unseen, data.at(positions), &mut vec![0.0; d], &mut rows);
        joints.by_readings(state, positions, &mut rows);
        rows
    }

    /// Like [`rows_without`](Self::rows_without), but whitened by the sensors' noise alone.
    #[inline]
    pub fn rows_apart(
        &self,
        unseen: &[Range<usize>],
        data: &KinematicData<'_>,
        readings: &mut [f64],
        rows: &mut [f64],
    ) {
        let m = rows.len() / readings.len().max(1);
        for (sensor, place) in self.sensors.iter().zip(&self.places) {
            let reading = &mut readings[place.clone()];
            if !sensor.rows(data, reading, &mut rows[place.start * m..place.end * m]) {
                reading.fill(f64::NAN);
            }
        }
        for absent in unseen {
            rows[absent.start * m..absent.end * m].fill(0.0);
            readings[absent.clone()].fill(f64::NAN);
        }
    }

    /// Hᵀ (m × d), whitened, of a movement with all readings; zero where a channel has no prediction.
    pub fn jacobian(&self, state: &State, layout: &Layout, positions: &[f64]) -> DMatrix<f64> {
        let mut data = KinematicData::new(state, layout);
        let mut rows = DMatrix::zeros(layout.dimension(), self.equations());
        self.rows(data.at(positions), &mut vec![0.0; self.equations()], rows.as_mut_slice());
        rows
    }

    /// L⁻¹ (y ⊖ h) of all equations; 0 where either has no reading, or not that number of it.
    pub fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]) {
        for (sensor, place) in self.sensors.iter().zip(&self.places) {
            let (y, h, whitened) = (&y[place.clone()], &h[place.clone()], &mut whitened[place.clone()]);
            let is_partial = sensor.subject().least_points.is_some();
            if !is_partial && y.iter().chain(h).any(|x| x.is_nan()) {
                whitened.fill(0.0);
            } else {
                sensor.difference(y, h, whitened);
            }
            if is_partial {
                whitened.iter_mut().filter(|x| x.is_nan()).for_each(|x| *x = 0.0);
            }
        }
    }

    /// The equations of an observation, linearised at a state. A reading without a prediction and an absent number contribute none.
    pub fn equations_of(
        &self,
        state: &State,
        layout: &Layout,
        positions: &[f64],
        observation: &Observation,
    ) -> Equations {
        let mut data = KinematicData::new(state, layout);
        data.at(positions);
        let mut rows = DMatrix::zeros(layout.dimension(), observation.numbers());
        let mut residual = DVector::zeros(observation.numbers());
        let found = self.linearise(&data, observation, rows.as_mut_slice(), residual.as_mut_slice());
        if found == observation.equations() && found == residual.len() {
            return Equations { rows, residual };
        }
        let numbers = observation.readings.iter().flatten().flatten().enumerate();
        let told = numbers.filter(|(row, x)| !residual[*row].is_nan() && !x.is_nan());
        let told: Vec<usize> = told.map(|(row, _)| row).collect();
        Equations { rows: rows.select_columns(&told), residual: residual.select_rows(&told) }
    }

    /// Writes Hᵀ (columns of m numbers, all zero at first) and the residual of an observation at the posture of `data`, and returns
    /// the number of numbers that have a prediction. A reading without a prediction contributes nothing: its rows stay zero, and its
    /// residual is NaN. Nor does an absent number: its row and residual are zero.
    pub fn linearise(
        &self,
        data: &KinematicData<'_>,
        observation: &Observation,
        rows: &mut [f64],
        residual: &mut [f64],
    ) -> usize {
        let found = self.linearise_by_sensors(data, observation, rows, residual);
        if let Some(joints) = &self.joints {
            let m = data.layout().dimension();
            let by_joints = self.joint_rows_of(joints, data.state(), data.positions(), observation);
            joints.whiten(&by_joints, &mut rows[..found * m], &mut residual[..found]);
        }
        found
    }

    /// J of those readings of an observation that have a prediction, laid out as in [`joint_rows`](Self::joint_rows).
    pub fn joint_rows_of(
        &self,
        joints: &JointNoise,
        state: &State,
        positions: &[f64],
        observation: &Observation,
    ) -> Vec<f64> {
        let (d, n) = (observation.numbers(), positions.len());
        let mut data = KinematicData::new(state, joints.layout());
        let mut rows = vec![0.0; d * n];
        let found = self.linearise_by_sensors(data.at(positions), observation, &mut rows, &mut vec![0.0; d]);
        rows.truncate(found * n);
        joints.by_readings(state, positions, &mut rows);
        rows
    }

    /// Writes J of one channel's reading (columns of n numbers, all zero at first), laid out as in
    /// [`joint_rows`](Self::joint_rows), at the posture of `data` in the layout of `joints`; the columns stay zero where there
    /// is no prediction, or no number of the reading.
    pub fn joint_rows_in(
        &self,
        joints: &JointNoise,
        data: &KinematicData<'_>,
        (channel, reading): (usize, &[f64]),
        rows: &mut [f64],
    ) {
        let (sensor, mut scratch) = (&self.sensors[channel], Scratch::default());
        sensor.rows(data, scratch.take(sensor.equations()), rows);
        leave_out_absent(reading, rows, &mut []);
        joints.by_readings(data.state(), data.positions(), rows);
    }

    /// Linearises one channel's reading, as [`linearise_by_sensors`](Self::linearise_by_sensors) does; false where it has no
    /// prediction.
    pub fn linearise_reading(
        &self,
        data: &KinematicData<'_>,
        channel: usize,
        reading: &[f64],
        rows: &mut [f64],
        residual: &mut [f64],
    ) -> bool {
        let mut scratch = Scratch::default();
        let (sensor, predicted) = (&self.sensors[channel], scratch.take(reading.len()));
        let is_predicted = sensor.rows(data, predicted, rows);
        if is_predicted {
            sensor.difference(reading, predicted, residual);
            leave_out_absent(reading, rows, residual);
        }
        is_predicted
    }

    /// Like [`linearise`](Self::linearise), but whitened by the sensors' noise alone.
    pub fn linearise_by_sensors(
        &self,
        data: &KinematicData<'_>,
        observation: &Observation,
        rows: &mut [f64],
        residual: &mut [f64],
    ) -> usize {
        let m = data.layout().dimension();
        let mut scratch = Scratch::default();
        let (mut at, mut found) = (0, 0);
        for (sensor, reading) in self.sensors.iter().zip(&observation.readings) {
            let Some(reading) = reading else { continue };
            let end = at + reading.len();
            let predicted = scratch.take(reading.len());
            if sensor.rows(data, predicted, &mut rows[at * m..end * m]) {
                sensor.difference(reading, predicted, &mut residual[at..end]);
                leave_out_absent(reading, &mut rows[at * m..end * m], &mut residual[at..end]);
                found += reading.len();
            } else {
                residual[at..end].fill(f64::NAN);
            }
            at = end;
        }
        found
    }

    /// L⁻¹ (y ⊖ h) of an observation, of those readings that have a prediction; absent numbers are left out.
    pub fn residual(&self, state: &State, positions: &[f64], observation: &Observation) -> DVector<f64> {
        self.residual_near(state, state, positions, observation)
    }

    /// L⁻¹ (y ⊖ h) of an observation, with L taken at another state near this one, such as the centre of several.
    pub fn residual_near(
        &self,
        centre: &State,
        state: &State,
        positions: &[f64],
        observation: &Observation,
    ) -> DVector<f64> {
        let (mut residual, is_absent) = self.stacked_residual(state, positions, observation);
        if let Some(joints) = &self.joints {
            let by_joints = self.joint_rows_of(joints, centre, positions, observation);
            // Where the two see different readings, none of them is whitened by the other's.
            if by_joints.len() == residual.len() * positions.len() {
                joints.whiten(&by_joints, &mut [], &mut residual);
            }
        }
        let mut absent = is_absent.into_iter();
        residual.retain(|_| !absent.next().unwrap_or_default());
        DVector::from_vec(residual)
    }

    /// L⁻¹ (y ⊖ h) of the readings that have a prediction, whitened by the sensors' noise alone, and which of its numbers are absent:
    /// these are zero.
    fn stacked_residual(&self, state: &State, positions: &[f64], observation: &Observation) -> (Vec<f64>, Vec<bool>) {
        let (mut residual, mut is_absent) = (Vec::with_capacity(observation.numbers()), Vec::new());
        let links = Links::of(state, positions);
        for (sensor, reading) in self.sensors.iter().zip(&observation.readings) {
            let Some(reading) = reading else { continue };
            let mut predicted = vec![0.0; reading.len()];
            if sensor.channel().extended(&links, &mut predicted) {
                let start = residual.len();
                residual.resize(start + reading.len(), 0.0);
                sensor.difference(reading, &predicted, &mut residual[start..]);
                leave_out_absent(reading, &mut [], &mut residual[start..]);
                is_absent.extend(reading.iter().map(|x| x.is_nan()));
            }
        }
        (residual, is_absent)
    }

    /// ‖L⁻¹ (y ⊖ h)‖² of an observation.
    pub fn squared_error(&self, links: &Links<'_>, observation: &Observation) -> f64 {
        let mut sum = 0.0;
        self.residuals(links, observation, |_, whitened| {
            sum += whitened.iter().filter(|x| !x.is_nan()).map(|x| x * x).sum::<f64>();
        });
        sum
    }

    /// Passes L⁻¹ (y ⊖ h) of every reading that is present to `each`, with its channel; given the readings before it, where
    /// they err together. Absent numbers are NaN.
    pub fn residuals(&self, links: &Links<'_>, observation: &Observation, mut each: impl FnMut(usize, &[f64])) {
        let Some(joints) = &self.joints else {
            self.residuals_by_channel(links, observation, each);
            return;
        };
        let n = links.positions().len();
        let by_joints = self.joint_rows_of(joints, links.state(), links.positions(), observation);
        let (mut errors, mut at) = (JointErrors::new(joints.sigmas(), 0), 0);
        self.residuals_by_channel(links, observation, |channel, whitened| {
            let mut whitened = whitened.to_vec();
            let place = at * n..(at + whitened.len()) * n;
            // A reading that is predicted has its rows.
            if let Some(by_joints) = by_joints.get(place) {
                let absent: Vec<usize> = (0..whitened.len()).filter(|index| whitened[*index].is_nan()).collect();
                absent.iter().for_each(|index| whitened[*index] = 0.0);
                errors.whiten(by_joints, &mut [], &mut whitened);
                absent.iter().for_each(|index| whitened[*index] = f64::NAN);
            }
            at += whitened.len();
            each(channel, &whitened);
        });
    }

    /// The [residuals](Self::residuals) of an observation, whitened by the sensors' noise alone.
    pub fn residuals_by_channel(
        &self,
        links: &Links<'_>,
        observation: &Observation,
        mut each: impl FnMut(usize, &[f64]),
    ) {
        let (mut predicted, mut whitened) = (Scratch::default(), Scratch::default());
        for (index, (sensor, reading)) in self.sensors.iter().zip(&observation.readings).enumerate() {
            let Some(reading) = reading else { continue };
            let (predicted, whitened) = (predicted.take(reading.len()), whitened.take(reading.len()));
            if sensor.channel().extended(links, predicted) {
                sensor.difference(reading, predicted, whitened);
                each(index, whitened);
            }
        }
    }

    /// The [residuals](Self::residuals_by_channel) of an observation from predicted readings (d numbers, as
    /// [`rows`](Self::rows) writes them), none of which is missing.
    pub fn residuals_of(&self, predicted: &[f64], observation: &Observation, mut each: impl FnMut(usize, &[f64])) {
        let mut whitened = Scratch::default();
        for (index, (sensor, reading)) in self.sensors.iter().zip(&observation.readings).enumerate() {
            let Some(reading) = reading else { continue };
            let whitened = whitened.take(reading.len());
            sensor.difference(reading, &predicted[self.places[index].clone()], whitened);
            each(index, whitened);
        }
    }

    /// Simulates the observation at `positions` of a robot that is as `state` says: readings of what is in view, with `v` (d standard
    /// normal numbers) as noise.
    pub fn observe(&self, state: &State, positions: &[f64], v: &[f64]) -> Observation {
        let links = Links::of(state, positions);
        let visible = self.visible_where(None, &links);
        let reading = |((sensor, place), visible): ((&Sensor, &Range<usize>), bool)| {
            let mut reading = vec![0.0; sensor.equations()];
            (visible && sensor.channel().predict(&links, &mut reading)).then(|| {
                sensor.disturb(&mut reading, &v[place.clone()]);
                let unseen = sensor.channel().unseen(&links);
                unseen.into_iter().for_each(|absent| reading[absent].fill(f64::NAN));
                reading
            })
        };
        Observation { readings: self.sensors.iter().zip(&self.places).zip(visible).map(reading).collect() }
    }

    /// Simulates the observation after a movement that holds a target in `socket`, or in none, like [`observe`](Self::observe):
    /// the contact is read for that socket, and for no other.
    pub fn observe_in(&self, socket: Option<usize>, state: &State, positions: &[f64], v: &[f64]) -> Observation {
        let mut observation = self.observe(state, positions, v);
        for (sensor, reading) in self.sensors.iter().zip(&mut observation.readings) {
            match sensor.subject().occasion {
                Occasion::Always => {}
                Occasion::Held { socket: other, .. } => {
                    *reading = (socket == Some(other)).then(|| vec![0.0; sensor.equations()]);
                }
                Occasion::Beforehand => *reading = None,
            }
        }
        observation
    }
}

/// Zeroes the rows (d columns of some numbers, or none) and the residuals of what is absent in a reading of d numbers.
fn leave_out_absent(reading: &[f64], rows: &mut [f64], residual: &mut [f64]) {
    if present(reading) == reading.len() {
        return;
    }
    let m = rows.len() / reading.len();
    for (index, _) in reading.iter().enumerate().filter(|(_, x)| x.is_nan()) {
        rows[index * m..(index + 1) * m].fill(0.0);
        if let Some(residual) = residual.get_mut(index) {
            *residual = 0.0;
        }
    }
}

/// Room for the numbers of one reading, on the stack where they are few.
#[derive(Default)]
struct Scratch {
    few: [f64; 12],
    many: Vec<f64>,
}

impl Scratch {
    fn take(&mut self, count: usize) -> &mut [f64] {
        if count <= self.few.len() {
            return &mut self.few[..count];
        }
        self.many.resize(count, 0.0);
        &mut self.many
    }
}
