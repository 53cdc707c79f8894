//! Measurements with noise in the joints' readings: all readings after one movement err together.
//!
//! With e the errors of the joints at one posture, the cost of its readings is that of r = H δ + J e + v with e left out by
//! integration, `½ rᵀ C⁻¹ r + ½ ln det C`, C = I + J Σ Jᵀ: reading by reading, each given those before it (see [`JointNoise`]).
//! By what that leaves of a reading its loss is told. An outlier then says nothing of e, and spoils no other reading.
//!
//! C changes with the state. A search for a mode takes J from where it stands, so that what a step promises is what it finds,
//! and anew after every step: it ends where `Hᵀ C⁻¹ r` and the prior balance (iterated generalised least squares). The change of
//! C itself pulls nowhere in the mean, since that of `½ ln det C` and that of the squares cancel.
//!
//! Σ is learned by restricted maximum likelihood, as one factor t² of what it is said to be (MacKay's fixed point):
//!
//! ```text
//! t² = (Σ ê_j²/σ_j² + ν t₀² + t₁²/5) / (Σ (1 − V_jj/t²σ_j²) + ν + 1/5),     ν = 4,   t₁ = 0.3
//! ```
//!
//! over all postures and joints, with ê and V what all measurements say of an error, V with what is not known of the state, and
//! t₀ what it was before the latest movement. It is how many errors were determined that counts: where readings tell hardly any,
//! t changes slowly, and neither collapses nor swells. The scale of a sensor's own noise is told by what ê leaves of the
//! residuals.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::{
    Smoother,
    joint_scale::{Joints, Said},
    marginalised::Quadratic,
    mode::Mode,
    posterior::{Fit, Measurement, Posterior},
};
use crate::{
    elementary::ln,
    model::{KinematicData, Layout, Links, State},
    sensing::{Graduated, JointErrors, JointNoise, present},
};

/// ν: the number of errors for which the factor t so far counts.
const SO_FAR: f64 = 4.0;
/// t₁, and how many errors it counts for.
const LIKELY: [f64; 2] = [0.3, 0.2];
/// The multiple of the distance at which a reading may still inform Σ: an outlier by a Σ that is too small would otherwise
/// never show that it is.
const WIDE: f64 = 3.0;
/// The least and the greatest factor of a stated σ.
const FACTORS: [f64; 2] = [1e-3, 1e2];

/// The readings of one posture, whitened together, in assumed σ.
pub(super) struct Posture {
    /// The readings that have a prediction.
    pub readings: Vec<Joined>,
    /// √w L⁻¹ H, transposed, m × d.
    pub rows: DMatrix<f64>,
    /// √w L⁻¹ r.
    pub residual: DVector<f64>,
    /// L⁻¹ r.
    innovation: DVector<f64>,
    /// Hᵀ, r and Jᵀ, whitened by the sensors' noise alone.
    by_sensors: (DMatrix<f64>, DVector<f64>, DMatrix<f64>),
    errors: JointErrors,
    pub cost: f64,
}

/// A reading among those of its posture.
pub(super) struct Joined {
    pub channel: usize,
    pub place: Range<usize>,
    /// Their place among all readings of the observation, of which some may have no prediction.
    pub start: usize,
    /// The number of its equations: of its numbers without the absent ones, whose rows and residuals are zero.
    pub equations: usize,
    pub weight: f64,
}

impl Posture {
    /// r − J ê, H − J B (transposed) and the diagonal of J V Jᵀ: what remains once the joints' errors are as well known as the
    /// readings tell.
    fn left(&self) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
        let (rows, residual, by_joints) = &self.by_sensors;
        let (m, n) = (rows.nrows(), by_joints.nrows());
        let slopes = DMatrix::from_fn(m, n, |k, joint| self.errors.slopes(joint)[k]);
        let covariance = DMatrix::from_fn(n, n, |row, column| self.errors.covariance(row, column));
        let spread = by_joints.column_iter().map(|j| j.dot(&(&covariance * j)));
        let spread = DVector::from_iterator(by_joints.ncols(), spread);
        let mean = DVector::from_column_slice(self.errors.mean());
        (rows - slopes * by_joints, residual - by_joints.tr_mul(&mean), spread)
    }
}

impl Posterior {
    /// J of every measurement at `state`, whitened by the sensors' nominal noise: zero where a reading has no prediction.
    pub fn joint_rows(&self, state: &State) -> Vec<DMatrix<f64>> {
        let Some(joints) = &self.joints else { return Vec::new() };
        let mut data = KinematicData::new(state, joints.noise.layout());
        let of = |seen: &Measurement| self.joint_rows_of(&joints.noise, data.at(&seen.positions), seen);
        self.measurements.iter().map(of).collect()
    }

    fn joint_rows_of(&self, noise: &JointNoise, data: &KinematicData<'_>, seen: &Measurement) -> DMatrix<f64> {
        let (n, d) = (seen.positions.len(), seen.observation.numbers());
        let mut rows = DMatrix::zeros(n, d);
        let mut at = 0;
        for (channel, reading) in seen.observation.readings.iter().enumerate() {
            let Some(reading) = reading else { continue };
            let end = at + reading.len();
            self.measurement_model.joint_rows_in(
                noise,
                data,
                (channel, reading),
                &mut rows.as_mut_slice()[at * n..end * n],
            );
            at = end;
        }
        rows
    }

    /// The readings of a measurement at the posture of `data`, whitened together by J = `by_joints`, or by J at that
    /// posture.
    pub fn posture(
        &self,
        noise: &JointNoise,
        loss: Graduated,
        data: &KinematicData<'_>,
        seen: &Measurement,
        by_joints: Option<&DMatrix<f64>>,
    ) -> Posture {
        let (m, d, n) = (data.layout().dimension(), seen.observation.numbers(), seen.positions.len());
        let (mut rows, mut residual) = (DMatrix::zeros(m, d), DVector::zeros(d));
        let mut by_joints = match by_joints {
            Some(rows) => rows.clone(),
            None => {
                let mut there = KinematicData::new(data.state(), noise.layout());
                self.joint_rows_of(noise, there.at(&seen.positions), seen)
            }
        };
        let (mut readings, mut at, mut start) = (Vec::new(), 0, 0);
        for (channel, reading) in seen.observation.readings.iter().enumerate() {
            let Some(reading) = reading else { continue };
            let (count, end) = (reading.len(), at + reading.len());
            let (rows, residual) = (rows.as_mut_slice(), residual.as_mut_slice());
            if self.measurement_model.linearise_reading(
                data,
                channel,
                reading,
                &mut rows[at * m..end * m],
                &mut residual[at..end],
            ) {
                // Those of what has no prediction make room.
                (0..count).for_each(|row| by_joints.swap_columns(at + row, start + row));
                readings.push(Joined { channel, place: at..end, start, equations: present(reading), weight: 1.0 });
                at = end;
            }
            start += count;
        }
        let found = at;
        let (mut rows, mut residual) = (rows.resize_horizontally(found, 0.0), residual.resize_vertically(found, 0.0));
        let mut by_joints = by_joints.resize_horizontally(found, 0.0);
        for reading in &readings {
            for (noise, part) in self.noises(reading.channel) {
                let scale = self.scales[noise].recip();
                if scale != 1.0 {
                    let (first, count) = (reading.place.start + part.start, part.len());
                    rows.columns_mut(first, count).scale_mut(scale);
                    residual.rows_mut(first, count).scale_mut(scale);
                    by_joints.columns_mut(first, count).scale_mut(scale);
                }
            }
        }
        let by_sensors = (rows.clone(), residual.clone(), by_joints);
        let mut innovation = DVector::zeros(found);
        let (mut errors, mut cost) = (JointErrors::new(noise.sigmas(), m), 0.0);
        for reading in &mut readings {
            let (place, count) = (reading.place.clone(), reading.equations);
            let of_rows = place.start * m..place.end * m;
            let j = &by_sensors.2.as_slice()[place.start * n..place.end * n];
            let before = loss.loss.is_robust().then(|| errors.clone());
            let own = &mut rows.as_mut_slice()[of_rows.clone()];
            let left = &mut residual.as_mut_slice()[place.clone()];
            let log_determinant = errors.whiten(j, own, left);
            innovation.as_mut_slice()[place.clone()].copy_from_slice(left);
            let squared: f64 = left.iter().map(|x| x * x).sum();
            cost += loss.cost(squared, count) + 0.5 * log_determinant;
            reading.weight = loss.weight(squared, count);
            if let Some(before) = before.filter(|_| reading.weight < 1.0) {
                errors = before;
                // What is left of an outlier's weight would still pull: it says nothing of e.
                let weight = loss.normal(squared, count);
                errors.weigh(weight, j, &by_sensors.0.as_slice()[of_rows], &by_sensors.1.as_slice()[place]);
                let root = reading.weight.sqrt();
                own.iter_mut().chain(left).for_each(|x| *x *= root);
            }
        }
        Posture { readings, rows, residual, innovation, by_sensors, errors, cost }
    }

    /// Passes every residual to `each`, as [`MeasurementModel::residuals`](crate::sensing::MeasurementModel::residuals) does, in nominal σ: readings
    /// that err together are taken given those before them, none given outliers.
    pub fn residuals(&self, links: &Links<'_>, seen: &Measurement, mut each: impl FnMut(usize, &[f64])) {
        let Some(joints) = &self.joints else {
            self.measurement_model.residuals(links, &seen.observation, each);
            return;
        };
        let state = links.state();
        let layout = Layout::new(state, []);
        let mut data = KinematicData::new(state, &layout);
        let posture = self.posture(&joints.noise, self.loss.into(), data.at(&seen.positions), seen, None);
        for reading in &posture.readings {
            let mut whitened = posture.innovation.as_slice()[reading.place.clone()].to_vec();
            for (noise, part) in self.noises(reading.channel) {
                whitened[part].iter_mut().for_each(|x| *x *= self.scales[noise]);
            }
            if let Some(Some(measured)) = seen.observation.readings.get(reading.channel) {
                let absent = whitened.iter_mut().zip(measured).filter(|(_, measured)| measured.is_nan());
                absent.for_each(|(whitened, _)| *whitened = f64::NAN);
            }
            each(reading.channel, &whitened);
        }
    }

    /// The fit of the measurements that were not marginalised, by kind of noise, when the joints' errors take their share.
    pub fn joint_fit(&self, noise: &JointNoise, state: &State) -> Vec<Fit> {
        let layout = Layout::new(state, []);
        let mut data = KinematicData::new(state, &layout);
        let mut fits = vec![Fit::default(); self.scales.len()];
        for seen in &self.measurements {
            let posture = self.posture(noise, self.loss.into(), data.at(&seen.positions), seen, None);
            let (_, left, _) = posture.left();
            for reading in &posture.readings {
                for (noise, part) in self.noises(reading.channel) {
                    let own = left.rows(reading.place.start + part.start, part.len());
                    fits[noise].squared += reading.weight * own.norm_squared() * self.scales[noise].powi(2);
                    let measured = seen.observation.readings.get(reading.channel).and_then(Option::as_ref);
                    let equations = measured.map_or(part.len(), |measured| present(&measured[part]));
                    fits[noise].equations += reading.weight * equations as f64;
                }
            }
        }
        fits
    }

    /// By kind of noise, the number of equations of the remaining measurements that parameters and joints' errors absorb, and
    /// what these say of Σ.
    pub fn joint_shares(&self, loss: Graduated, joints: &Joints, mode: &Mode, layout: &Layout) -> (Vec<f64>, Said) {
        let (mut absorbed, mut said) = (vec![0.0; self.scales.len()], Said::default());
        let covariance = mode.covariance();
        let mut data = KinematicData::new(&mode.state, layout);
        for seen in &self.measurements {
            let posture = self.posture(&joints.noise, loss, data.at(&seen.positions), seen, None);
            let (rows, _, spread) = posture.left();
            let gains = &covariance * &rows;
            for reading in &posture.readings {
                for (noise, part) in self.noises(reading.channel) {
                    let own = reading.place.start + part.start..reading.place.start + part.end;
                    let share: f64 = own.map(|row| gains.column(row).dot(&rows.column(row)) + spread[row]).sum();
                    absorbed[noise] += reading.weight * share;
                }
            }
            said.add(said_by(joints, &posture.errors, &covariance));
        }
        (absorbed, said)
    }

    /// Adds what the oldest `count` measurements say of Σ to the marginalised statistics, before they are marginalised.
    pub fn settle_joints(&mut self, count: usize, mode: &Mode, layout: &Layout) {
        let Some(mut joints) = self.joints.take() else { return };
        let covariance = mode.covariance();
        let mut data = KinematicData::new(&mode.state, layout);
        for seen in self.measurements.iter().take(count) {
            let posture = self.posture(&joints.noise, self.loss.into(), data.at(&seen.positions), seen, None);
            let said = said_by(&joints, &posture.errors, &covariance);
            joints.marginalised.add(said);
        }
        self.joints = Some(joints);
    }

    /// √w L⁻¹ Hᵀ and √w L⁻¹ r of some measurements, side by side, and their cost; `by_joints` is J of each.
    pub fn stacked_jointly(
        &self,
        (noise, loss): (&JointNoise, Graduated),
        state: &State,
        layout: &Layout,
        measurements: &[Measurement],
        by_joints: Option<&[DMatrix<f64>]>,
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        let equations = measurements.iter().map(|seen| seen.observation.numbers()).sum();
        let mut stacked = DMatrix::zeros(layout.dimension(), equations);
        let mut residuals = DVector::zeros(equations);
        let mut data = KinematicData::new(state, layout);
        let (mut at, mut cost) = (0, 0.0);
        for (index, seen) in measurements.iter().enumerate() {
            let by_joints = by_joints.map(|all| &all[index]);
            let posture = self.posture(noise, loss, data.at(&seen.positions), seen, by_joints);
            for Joined { place, start, .. } in &posture.readings {
                let (from, to, count) = (place.start, at + start, place.len());
                stacked.columns_mut(to, count).copy_from(&posture.rows.columns(from, count));
                residuals.rows_mut(to, count).copy_from(&posture.residual.rows(from, count));
            }
            cost += posture.cost;
            at += seen.observation.numbers();
        }
        (stacked, residuals, cost)
    }

    /// The marginalised measurements' part of the shares of the parameters, by kind of noise.
    pub fn marginalised_shares(&self, mode: &Mode, layout: &Layout) -> Option<Vec<f64>> {
        let Some(marginalised) = &self.marginalised else { return Some(vec![0.0; self.scales.len()]) };
        let (carried, _) = marginalised.carried(&mode.state, layout)?;
        let covariance = mode.covariance();
        let of = |(noise, scale): (&Quadratic, &f64)| noise.information.dot(&covariance) / (scale * scale);
        Some(carried.iter().zip(&self.scales).map(of).collect())
    }
}

/// The statistics of t from one posture.
fn said_by(joints: &Joints, errors: &JointErrors, covariance: &DMatrix<f64>) -> Said {
    let mut said = Said::default();
    let sigmas = joints.stated.sigmas().iter().enumerate();
    for (joint, stated) in sigmas.filter(|(_, stated)| **stated > 0.0) {
        let slopes = DVector::from_column_slice(errors.slopes(joint));
        let variance = errors.covariance(joint, joint) + slopes.dot(&(covariance * &slopes));
        let square = stated * stated;
        said.squares += errors.mean()[joint].powi(2) / square;
        said.determined += (1.0 - variance / (square * joints.factor * joints.factor)).max(0.0);
    }
    said
}

impl Smoother {
    /// This smoother with joint noise of unknown size: the measurement model's value is where learning begins, for all joints in proportion.
    /// Nothing changes if the measurement model says that joints are exact.
    pub fn with_unknown_joint_noise(mut self, unknown: bool) -> Self {
        if let Some(joints) = &mut self.posterior.joints {
            joints.unknown = unknown;
        }
        self
    }

    /// Whether any scale is learned, of a sensor's noise or of the joints'.
    pub(super) fn learns_noise(&self) -> bool {
        self.unknown.contains(&true) || self.posterior.joints.as_ref().is_some_and(|joints| joints.unknown)
    }

    /// t; 1 where joints are exact.
    pub(super) fn joint_factor(&self) -> f64 {
        self.posterior.joints.as_ref().map_or(1.0, |joints| joints.factor)
    }

    /// Learns Σ at the heaviest mode, with t₀ = `before`, and returns by how much it has changed.
    pub(super) fn learn_joint_noise(&mut self, before: f64) -> f64 {
        let layout = self.belief.layout.clone();
        let Some(mode) = self.hypotheses.modes.first() else { return 0.0 };
        let Some(joints) = self.posterior.joints.as_ref().filter(|joints| joints.unknown) else { return 0.0 };
        let wide = Graduated { loss: self.posterior.loss, width: WIDE };
        let (_, mut said) = self.posterior.joint_shares(wide, joints, mode, &layout);
        said.add(joints.marginalised);
        // With enough of them it may change as often as the modes follow.
        let before = if said.determined > SO_FAR { joints.factor } else { before };
        let [likely, weight] = LIKELY;
        let square =
            (said.squares + SO_FAR * before * before + weight * likely * likely) / (said.determined + SO_FAR + weight);
        let factor = square.sqrt().clamp(FACTORS[0], FACTORS[1]);
        let change = ln(factor / joints.factor).abs();
        if !change.is_finite() {
            return 0.0;
        }
        let noise = joints.stated.scaled(factor);
        if let Some(joints) = &mut self.posterior.joints {
            (joints.noise, joints.factor) = (noise, factor);
        }
        change
    }
}
