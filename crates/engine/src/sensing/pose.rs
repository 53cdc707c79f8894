//! The pose of a target: its position, and its rotation as a rotation vector, six equations.
//!
//! With y = (t, ω), R = exp(\[ω\]×), the residual is taken on the manifold:
//!
//! ```text
//! r = ((t_y − t_h)/σ, log(R_y R_hᵀ)/σ_R)
//! ```
//!
//! A turn of the prediction by exp(\[δ\]×) changes log(R_y R_hᵀ) by −J⁻¹δ, J its left Jacobian. Rows take J for I, as at a
//! small residual: the gradient Hᵀr is exact all the same, since J⁻ᵀ leaves log(R_y R_hᵀ) as it is.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::{Apart, Channel, Equipment, KeyError, Keys, noise::is_all_or_nothing};
use crate::{kinematics::rotation, model::{Frame, Pass, State}};

/// A tracker of a target's pose, in the frame of the measurements: x, y, z in metres, then a rotation vector in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The index of the target, a rigid body.
    pub target: usize,
    /// Standard deviation of the noise of the position per coordinate, metres.
    pub sigma_m: f64,
    /// Standard deviation of the noise of the rotation per axis, radians.
    pub sigma_rad: f64,
}

impl Pose {
    pub(super) fn from_keys(keys: &Keys, equipment: &Equipment) -> Result<Self, KeyError> {
        keys.only(&["target", "sigma_m", "sigma_deg"])?;
        let (target, _) = keys.target(equipment)?;
        let pose = Self { target, sigma_m: keys.sigma_m()?, sigma_rad: keys.sigma_rad()? };
        if !is_all_or_nothing(&pose) {
            let (key, other) =
                if pose.sigma_m > 0.0 { ("sigma_deg", "sigma_m") } else { ("sigma_m", "sigma_deg") };
            let what = format!("it is 0 beside a `{other}` that is not: half of every reading would be known for certain");
            return Err(KeyError::new(key, what, "write a number above 0, or 0 for both: a world without noise"));
        }
        Ok(pose)
    }

    fn write(pose: &Isometry3<f64>, reading: &mut [f64]) {
        reading[..3].copy_from_slice(pose.translation.vector.as_slice());
        reading[3..].copy_from_slice(pose.rotation.scaled_axis().as_slice());
    }

    fn read(reading: &[f64]) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(&reading[3..]));
        Isometry3::from_parts(Translation3::new(reading[0], reading[1], reading[2]), rotation)
    }

    #[cfg(test)]
    pub(super) fn example(rng: &mut rand_chacha::ChaCha8Rng, state: &State) -> Self {
        use rand::RngExt;
        let bodies: Vec<usize> = (0..state.targets.len())
            .filter(|target| matches!(state.targets[*target].place, crate::model::Place::Pose(_)))
            .collect();
        let target = bodies[rng.random_range(0..bodies.len())];
        Self { target, sigma_m: rng.random_range(0.001..0.1), sigma_rad: rng.random_range(0.001..0.1) }
    }
}

impl Channel for Pose {
    fn equations(&self) -> usize {
        6
    }

    fn position(&self, reading: &[f64]) -> Option<(usize, Point3<f64>)> {
        Some((self.target, Point3::from_slice(reading.get(..3)?)))
    }

    fn noises(&self) -> usize {
        2
    }

    fn subject(&self) -> Option<usize> {
        Some(self.target)
    }

    fn sigma(&self) -> f64 {
        self.sigma_m
    }

    fn with_sigma(&self, sigma_m: f64) -> Arc<dyn Channel> {
        // Where there is no noise, what is taken for some is as many radians as metres.
        let sigma_rad = match (self.sigma_m > 0.0, self.sigma_rad == 0.0) {
            (true, _) => self.sigma_rad * (sigma_m / self.sigma_m),
            (false, true) => sigma_m,
            (false, false) => self.sigma_rad,
        };
        Arc::new(Self { target: self.target, sigma_m, sigma_rad })
    }

    fn scaled(&self, factors: &[f64]) -> Arc<dyn Channel> {
        let [of_position, of_rotation] = [0, 1].map(|noise| factors.get(noise).copied().unwrap_or(1.0));
        Arc::new(Self {
            target: self.target,
            sigma_m: self.sigma_m * of_position,
            sigma_rad: self.sigma_rad * of_rotation,
        })
    }

    fn predict(&self, state: &State, positions: &[f64], reading: &mut [f64]) -> bool {
        Self::write(&state.frame_at(Frame::Target(self.target), positions), reading);
        true
    }

    fn difference(&self, y: &[f64], h: &[f64], whitened: &mut [f64]) {
        let (y, h) = (Self::read(y), Self::read(h));
        let shift = (y.translation.vector - h.translation.vector) / self.sigma_m;
        let turn = rotation::between(&h.rotation, &y.rotation) / self.sigma_rad;
        whitened[..3].copy_from_slice(shift.as_slice());
        whitened[3..].copy_from_slice(turn.as_slice());
    }

    fn rows(&self, pass: &Pass<'_>, reading: &mut [f64], rows: &mut [f64]) -> bool {
        let frame = Frame::Target(self.target);
        Self::write(&pass.pose(frame), reading);
        let twists = pass.frame_twists(frame);
        let weights = [self.sigma_m.recip(), self.sigma_rad.recip()];
        for (row, columns) in rows.chunks_exact_mut(twists.ncols().max(1)).enumerate() {
            columns.iter_mut().zip(twists.row(row).iter()).for_each(|(to, x)| *to = x * weights[row / 3]);
        }
        true
    }

    fn nominal(&self, equation: usize) -> (f64, &'static str) {
        if equation < 3 { (self.sigma_m, "m") } else { (self.sigma_rad, "rad") }
    }

    fn apart(&self, y: &[f64], h: &[f64]) -> Apart {
        let turned = Self::read(y).rotation.angle_to(&Self::read(h).rotation);
        Apart { angle_rad: Some(turned), ..Apart::lengths(&y[..3], &h[..3]) }
    }

    fn disturb(&self, reading: &mut [f64], v: &[f64]) {
        let pose = Self::read(reading);
        let shift = Vector3::from_column_slice(&v[..3]) * self.sigma_m;
        let turn = Vector3::from_column_slice(&v[3..]) * self.sigma_rad;
        let rotation = rotation::turned(&pose.rotation, &turn);
        Self::write(&Isometry3::from_parts(Translation3::from(pose.translation.vector + shift), rotation), reading);
    }
}
