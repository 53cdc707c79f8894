//! Small rotations: the exponential coordinates of SO(3) and their derivative.
//!
//! A rotation near R is `exp([ω]×) R`, ω in radians, in the frame that R leads to. With φ = ‖ω‖ the left Jacobian tells
//! what a change of ω does to the rotation,
//!
//! ```text
//! exp(ω + dω) ≈ exp(J(ω) dω) exp(ω),   J(ω) = I + (1 − cos φ)/φ² [ω]× + (φ − sin φ)/φ³ [ω]×²
//! ```
//!
//! (Chirikjian, *Stochastic Models, Information Theory, and Lie Groups*, vol. 2, 2012, §10.3).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::elementary::{cos, sin};

/// The left Jacobian J(ω) (3 × 3), ω in radians.
pub fn left_jacobian(omega: &Vector3<f64>) -> Matrix3<f64> {
    let squared = omega.norm_squared();
    let cross = omega.cross_matrix();
    let (first, second) = if squared < 1e-8 {
        (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        let angle = squared.sqrt();
        ((1.0 - cos(angle)) / squared, (angle - sin(angle)) / (squared * angle))
    };
    Matrix3::identity() + cross * first + cross * cross * second
}

/// The ω of length at most π for which `exp([ω]×) from = to`.
pub fn log(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    (to * from.inverse()).scaled_axis()
}

/// `exp([ω]×)` applied from the left.
pub fn exp(rotation: &UnitQuaternion<f64>, omega: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(*omega) * rotation
}
