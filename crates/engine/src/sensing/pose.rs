//! The pose of a target: its position, and its rotation as a rotation vector, six equations.
//!
//! With y = (t, ω), R = exp(\[ω\]×), the residual is taken on the manifold:
//!
//! ```text
//! y ⊖ h = (t_y − t_h, log(R_y R_hᵀ))
//! ```
//!
//! A turn of the prediction by exp(\[δ\]×) changes log(R_y R_hᵀ) by −J⁻¹δ, J its left Jacobian. Rows take J for I, as at a
//! small residual: the gradient Hᵀr is exact all the same, since J⁻ᵀ leaves log(R_y R_hᵀ) as it is.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Channel, Equipment, KeyError, Keys, NoiseModel, Part, Relative, Sensor, Subject};
use crate::{kinematics::rotation, model::{Frame, KinematicData, Links}};

/// A tracker of a target's pose, in the frame of the measurements: x, y, z in metres, then a rotation vector in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The index of the target, a rigid body.
    pub target: usize,
}

impl Pose {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Sensor, KeyError> {
        keys.only(&["target", "in", "sigma_m", "sigma_deg", "covariance"])?;
        let (target, _) = keys.target(equipment)?;
        let relative = Relative::from_keys(keys, equipment, true)?;
        let with = |noise: NoiseModel| match relative {
            Some(relative) => Sensor::new(relative, noise),
            None => Sensor::new(Self { target }, noise),
        };
        if let Some(noise) = keys.covariance()? {
            return with(noise).map_err(|unfit| KeyError::new("covariance", unfit.to_string(), "write 6 × 6"));
        }
        let sigmas = [keys.sigma_m()?, keys.sigma_rad()?];
        let noise = NoiseModel::parts(sigmas);
        let (key, other) = if sigmas[0] > 0.0 { ("sigma_deg", "sigma_m") } else { ("sigma_m", "sigma_deg") };
        if !noise.is_all_or_nothing() {
            let what = format!("it is 0 beside a `{other}` that is not: half of every reading would be known for certain");
            return Err(KeyError::new(key, what, "write a number above 0, or 0 for both: a world without noise"));
        }
        with(noise).map_err(|unfit| KeyError::new(key, unfit.to_string(), "write both"))
    }

    /// Writes a position, and the rotation vector where the reading has room for one.
    pub(super) fn write(pose: &Isometry3<f64>, reading: &mut [f64]) {
        let (position, rotation) = reading.split_at_mut(3);
        position.copy_from_slice(pose.translation.vector.as_slice());
        if !rotation.is_empty() {
            rotation.copy_from_slice(pose.rotation.scaled_axis().as_slice());
        }
    }

    /// Writes y ⊖ h, of positions alone where there are no rotations.
    pub(super) fn residual(y: &[f64], h: &[f64], residual: &mut [f64]) {
        (0..3).for_each(|k| residual[k] = y[k] - h[k]);
        if y.len() > 3 {
            let [y, h] = [y, h].map(|pose| Self::read(pose).rotation);
            residual[3..].copy_from_slice(rotation::log(&h, &y).as_slice());
        }
    }

    /// Turns h into h ⊕ v, of positions alone where there are no rotations.
    pub(super) fn add_to(reading: &mut [f64], v: &[f64]) {
        (0..3).for_each(|k| reading[k] += v[k]);
        if reading.len() > 3 {
            let turned = rotation::exp(&Self::read(reading).rotation, &Vector3::from_column_slice(&v[3..]));
            reading[3..].copy_from_slice(turned.scaled_axis().as_slice());
        }
    }

    fn read(reading: &[f64]) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(&reading[3..]));
        Isometry3::from_parts(Translation3::new(reading[0], reading[1], reading[2]), rotation)
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &crate::model::State) -> Sensor {
        use rand::RngExt;
        let bodies: Vec<usize> = (0..state.targets.len())
            .filter(|target| matches!(state.targets[*target].place, crate::model::Place::Pose(_)))
            .collect();
        let target = bodies[rng.random_range(0..bodies.len())];
        let sigmas = [rng.random_range(0.001..0.1), rng.random_range(0.001..0.1)];
        if rng.random() {
            return Sensor::new(Relative::any(rng, state, true), NoiseModel::parts(sigmas)).expect("two parts");
        }
        Sensor::new(Self { target }, NoiseModel::parts(sigmas)).expect("two parts")
    }
}

impl Channel for Pose {
    fn subject(&self) -> Subject {
        Subject { target: Some(self.target), parts: vec![Part::Position, Part::Rotation], ..Subject::default() }
    }

    fn predict(&self, links: &Links<'_>, reading: &mut [f64]) -> bool {
        Self::write(&links.pose(Frame::Target(self.target)), reading);
        true
    }

    fn difference(&self, y: &[f64], h: &[f64], residual: &mut [f64]) {
        Self::residual(y, h, residual);
    }

    fn rows(&self, data: &KinematicData<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let frame = Frame::Target(self.target);
        Self::write(&data.pose(frame), reading);
        let twists = data.frame_twists(frame);
        for (row, columns) in rows.chunks_exact_mut(twists.ncols().max(1)).enumerate() {
            columns.iter_mut().zip(twists.row(row).iter()).for_each(|(to, x)| *to = *x);
        }
        true
    }

    fn add(&self, reading: &mut [f64], v: &[f64]) {
        Self::add_to(reading, v);
    }
}
