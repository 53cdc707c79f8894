//! The derivative of the marker position in minimal tangent coordinates.
//!
//! With `Aᵢ₋₁` the rotation of e^{ξ₁θ₁} … e^{ξᵢ₋₁θᵢ₋₁}, `x` the marker as moved by the joints behind joint i, and
//! r = x − vᵢ, the blocks of H = ∂p/∂δ at δ = 0 are, with R = e^{wθ}, s = sin θ, c = cos θ:
//!
//! ```text
//! revolute, point      Aᵢ₋₁ (I − R) b                                            b = b₁, b₂
//! revolute, direction  Aᵢ₋₁ [ s b × r + (1 − c)((b·r) w + (w·r) b) ]
//! prismatic            Aᵢ₋₁ θ b
//! marker               A_n e                                                     e = e₁, e₂, e₃
//! ```

use nalgebra::{Matrix3, Matrix3xX, MatrixViewMut, Point3, U3, Vector3};

use super::{Chain, Joint, TangentLayout, chart};

/// The marker position p(θ) and its Jacobian H (3 × m; metres per metre or metres per radian).
pub fn jacobian(chain: &Chain, layout: &TangentLayout, positions: &[f64]) -> (Point3<f64>, Matrix3xX<f64>) {
    let mut h = Matrix3xX::zeros(layout.dimension());
    let marker = columns(chain, layout, positions, |index, column| h.set_column(index, &column));
    (marker, h)
}

/// As [`jacobian`], written transposed (m × 3) into a slice of a larger matrix: candidates stack side by side.
pub fn jacobian_transposed_into(
    chain: &Chain,
    layout: &TangentLayout,
    positions: &[f64],
    mut target: MatrixViewMut<'_, f64, nalgebra::Dyn, U3, nalgebra::U1, nalgebra::Dyn>,
) -> Point3<f64> {
    columns(chain, layout, positions, |index, column| target.set_row(index, &column.transpose()))
}

/// Walks the chain once each way and hands every column of H to `column`; returns the marker position.
fn columns(
    chain: &Chain,
    layout: &TangentLayout,
    positions: &[f64],
    mut column: impl FnMut(usize, Vector3<f64>),
) -> Point3<f64> {
    let (marker, turn) = walk(chain, positions, |index, derivative| {
        let Some(directions) = layout.direction(index) else { return };
        let frame = chart::basis(&derivative.joint.direction());
        for k in 0..2 {
            let b: Vector3<f64> = frame.column(k).into_owned();
            if let Some(points) = layout.point(index) {
                column(points.start + k, derivative.point(&b));
            }
            column(directions.start + k, derivative.direction(&b));
        }
    });
    for (k, index) in layout.marker().unwrap_or(0..0).enumerate() {
        column(index, turn.column(k).into_owned());
    }
    marker
}

/// How the marker moves with one joint's axis, all else held.
pub(crate) struct JointDerivative<'a> {
    /// The joint.
    pub joint: &'a Joint,
    /// Aᵢ₋₁.
    before: &'a Matrix3<f64>,
    /// e^{wθ}.
    rotation: &'a Matrix3<f64>,
    /// r, the marker as moved by the joints behind, from the axis point.
    arm: Vector3<f64>,
    position: f64,
}

impl JointDerivative<'_> {
    /// The derivative along a shift `b` of the axis point; zero for a prismatic joint.
    pub fn point(&self, b: &Vector3<f64>) -> Vector3<f64> {
        self.before * (b - self.rotation * b)
    }

    /// The derivative along a change `b` of the direction.
    pub fn direction(&self, b: &Vector3<f64>) -> Vector3<f64> {
        let (w, r) = (self.joint.direction().into_inner(), &self.arm);
        match self.joint {
            Joint::Revolute(_) => {
                let (sin, cos) = self.position.sin_cos();
                self.before * (b.cross(r) * sin + (w * b.dot(r) + b * w.dot(r)) * (1.0 - cos))
            }
            Joint::Prismatic(_) => self.before * b * self.position,
        }
    }
}

/// Walks the chain once each way and shows every joint's derivative to `visit`; returns the marker position and A_n.
pub(crate) fn walk(
    chain: &Chain,
    positions: &[f64],
    mut visit: impl FnMut(usize, &JointDerivative<'_>),
) -> (Point3<f64>, Matrix3<f64>) {
    debug_assert_eq!(positions.len(), chain.joints.len());
    // Backwards: the marker as moved by the joints behind each joint.
    let rotations: Vec<Matrix3<f64>> =
        chain.joints.iter().zip(positions).map(|(joint, &theta)| joint.rotation(theta)).collect();
    let mut arms = vec![Vector3::zeros(); chain.joints.len()];
    let mut x = chain.marker.coords;
    for (index, joint) in chain.joints.iter().enumerate().rev() {
        match joint {
            Joint::Revolute(line) => {
                arms[index] = x - line.point.coords;
                x = rotations[index] * arms[index] + line.point.coords;
            }
            Joint::Prismatic(w) => x += w.into_inner() * positions[index],
        }
    }
    // Forwards: the rotation of the joints before each joint.
    let mut before = Matrix3::identity();
    for (index, joint) in chain.joints.iter().enumerate() {
        let (rotation, arm, position) = (&rotations[index], arms[index], positions[index]);
        visit(index, &JointDerivative { joint, before: &before, rotation, arm, position });
        before *= rotation;
    }
    (Point3::from(x), before)
}
