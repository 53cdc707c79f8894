//! Minimal coordinates of directed lines and of directions.
//!
//! The chart at a line (v, w) uses an orthonormal basis B = [b₁ b₂] of the plane ⟂ w:
//!
//! ```text
//! retract(δ):  v' = v + B a,   w' = cos‖Bd‖ w + sin‖Bd‖ Bd/‖Bd‖      δ = (a, d), metres and radians
//! local(L):    a = Bᵀ(q − v),  d = Bᵀ log_w(w_L)                     q = L ∩ {x : w·(x − v) = 0}
//! ```
//!
//! The pivot v is the origin of the chart; it stays where it is but for the update's own shift ⟂ w. `local` is the
//! inverse of `retract`, on lines whose direction is less than 90 deg from w.
//!
//! After an update the chart sits at the new line (v', w') with its own basis B'. A covariance moves there by
//! `P⁺ = J P Jᵀ`, where J is the derivative of local' ∘ retract at δ:
//!
//! ```text
//! J = diag( B'ᵀB,  B'ᵀ (D exp_w)(Bd) B )
//! ```
//!
//! In the frame of the turn (u = Bd/‖Bd‖ and n = w × u, φ = ‖Bd‖) these are diag(cos φ, 1) and diag(1, sin φ/φ):
//! a tilted line meets the plane ⟂ w' at another distance, and great circles converge.

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Matrix4, Point3, UnitVector3, Vector2, Vector3, Vector4};

use super::Line;

use crate::elementary::{atan2, cos, sin};

/// An orthonormal basis [b₁ b₂] of the plane ⟂ `w`, right-handed with it, a function of `w` alone.
///
/// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. It jumps where w_z changes sign, which
/// is harmless: every covariance is carried between bases explicitly.
pub fn basis(w: &UnitVector3<f64>) -> Matrix3x2<f64> {
    let sign = 1.0_f64.copysign(w.z);
    let a = -1.0 / (sign + w.z);
    let b = w.x * w.y * a;
    Matrix3x2::new(
        1.0 + sign * w.x * w.x * a,
        b, //
        sign * b,
        sign + w.y * w.y * a,
        -sign * w.x,
        -w.y,
    )
}

/// The direction reached from `w` along the great circle that starts as the tangent `B d`, d in radians.
pub fn retract_direction(w: &UnitVector3<f64>, d: &Vector2<f64>) -> UnitVector3<f64> {
    let tangent = basis(w) * d;
    let angle = tangent.norm();
    UnitVector3::new_normalize(w.into_inner() * cos(angle) + tangent * sinc(angle))
}

/// The coordinates d (radians) of the direction `other` in the chart at `w`; `None` for the antipode, where they are
/// not defined.
pub fn local_direction(w: &UnitVector3<f64>, other: &UnitVector3<f64>) -> Option<Vector2<f64>> {
    let cosine = w.dot(other);
    let tangent = other.into_inner() - w.into_inner() * cosine;
    let sine = tangent.norm();
    if sine < 1e-12 {
        return (cosine > 0.0).then(Vector2::zeros);
    }
    Some(basis(w).transpose() * tangent * (atan2(sine, cosine) / sine))
}

/// The line at coordinates δ = (a, d) in the chart at `line`.
pub fn retract_line(line: &Line, delta: &Vector4<f64>) -> Line {
    let shift = basis(&line.direction) * delta.fixed_rows::<2>(0);
    Line {
        point: line.point + shift,
        direction: retract_direction(&line.direction, &delta.fixed_rows::<2>(2).into_owned()),
    }
}

/// The coordinates δ = (a, d) of `other` in the chart at `line`; `None` when the directions are 90 deg or more apart
/// (`other` then does not cross the plane ⟂ w on its way along w).
pub fn local_line(line: &Line, other: &Line) -> Option<Vector4<f64>> {
    let (w, w_other) = (&line.direction, &other.direction);
    let cosine = w.dot(w_other);
    if cosine < 1e-9 {
        return None;
    }
    let along = w.dot(&(line.point - other.point)) / cosine;
    let crossing: Point3<f64> = other.point + w_other.into_inner() * along;
    let a = basis(w).transpose() * (crossing - line.point);
    let d = local_direction(w, w_other)?;
    Some(Vector4::new(a.x, a.y, d.x, d.y))
}

/// The derivative of the change of chart for a direction: from coordinates at `w` to coordinates at `w_new`, taken at
/// `w_new = retract_direction(w, d)`.
pub fn direction_transport(w: &UnitVector3<f64>, d: &Vector2<f64>, w_new: &UnitVector3<f64>) -> Matrix2<f64> {
    let frame = basis(w);
    let tangent = frame * d;
    let angle = tangent.norm();
    let differential = |e: Vector3<f64>| {
        if angle < 1e-12 {
            return e;
        }
        let u = tangent / angle;
        let radial = u.dot(&e);
        (u * cos(angle) - w.into_inner() * sin(angle)) * radial + (e - u * radial) * sinc(angle)
    };
    let columns = [differential(frame.column(0).into_owned()), differential(frame.column(1).into_owned())];
    basis(w_new).transpose() * Matrix3x2::from_columns(&columns)
}

/// The derivative of the change of chart for the point of a line, B'ᵀB.
pub fn point_transport(w: &UnitVector3<f64>, w_new: &UnitVector3<f64>) -> Matrix2<f64> {
    basis(w_new).transpose() * basis(w)
}

/// The derivative (4 × 4) of the change of chart from `line` to `there`, by the coordinates at `there`: that of
/// `local_line(line, L)` as the line L moves away from `there`; `None` outside the chart. With c = w·w', and s the
/// distance (m) along w' from the pivot of `there` to the plane of `line`,
///
/// ```text
/// ∂(a, d)/∂(a', d') = [ E, s E ; 0, T⁻¹ ],     E = Bᵀ (I − w' wᵀ/c) B',   T = direction_transport
/// ```
///
/// so that turning a line whose pivot is not in that plane also shifts it there. `None` outside the chart.
pub fn line_change(line: &Line, there: &Line) -> Option<Matrix4<f64>> {
    let (w, w_there) = (&line.direction, &there.direction);
    let d = local_direction(w, w_there)?;
    let cosine = w.dot(w_there);
    if cosine < 1e-9 {
        return None;
    }
    let along = w.dot(&(line.point - there.point)) / cosine;
    let oblique = Matrix3::identity() - w_there.into_inner() * w.transpose() / cosine;
    let points = basis(w).transpose() * oblique * basis(w_there);
    let mut change = Matrix4::zeros();
    change.fixed_view_mut::<2, 2>(0, 0).copy_from(&points);
    change.fixed_view_mut::<2, 2>(0, 2).copy_from(&(points * along));
    change.fixed_view_mut::<2, 2>(2, 2).copy_from(&direction_transport(w, &d, w_there).try_inverse()?);
    Some(change)
}

/// sin x / x, continuous at 0.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-6 { 1.0 - x * x / 6.0 } else { sin(x) / x }
}
