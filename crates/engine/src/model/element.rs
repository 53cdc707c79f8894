//! The values that blocks of parameters take, and their minimal coordinates.
//!
//! Every element x has a chart, with the origin at x:
//!
//! ```text
//! retract(x, δ)       the element at coordinates δ
//! local(x, y)         the coordinates of y, the inverse of retract; none where the chart ends
//! transport(x, δ)     ∂ local(x′, retract(x, δ)) / ∂δ with x′ = retract(x, δ) held: carries covariances to the new chart
//! ```
//!
//! | element | coordinates | retraction |
//! |---|---|---|
//! | line (revolute axis) | 2 of its point ⟂ w (m), 2 of its direction (rad) | [`chart`] |
//! | direction (prismatic axis) | 2 (rad) | [`chart`] |
//! | point | 3 (m) | t + δ |
//! | pose | 3 of its origin (m), 3 of its rotation (rad) | (t + ν, exp(\[ω\]×) R) |
//! | numbers | as many | x + δ |

use nalgebra::{
    DMatrix, DVector, DVectorView, Isometry3, Matrix2, Matrix3, Matrix3x2, Matrix4, Point3, Translation3, UnitVector3,
    Vector2, Vector3, Vector4,
};

use crate::{
    elementary::{hypot, sin},
    kinematics::{Joint, Line, chart, rotation},
};

/// A value of one block of parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// The axis of a joint: a line or a direction.
    Axis(Joint),
    /// A point, metres.
    Point(Point3<f64>),
    /// A rigid placement.
    Pose(Isometry3<f64>),
    /// Plain numbers.
    Numbers(DVector<f64>),
}

/// How far an element is from a guess, in coordinates that are defined everywhere, not only inside the chart at the
/// guess.
#[derive(Clone, Debug)]
pub struct Displacement {
    /// r, zero at the guess, and to first order the tangent coordinates there.
    pub value: DVector<f64>,
    /// ∂r/∂δ in the chart at the element.
    pub derivative: DMatrix<f64>,
    /// ∂r/∂δ without the curvature of the sphere, which grows without bound towards the antipode of a direction; for the
    /// Gauss–Newton approximation.
    pub slope: DMatrix<f64>,
}

impl Element {
    /// Number of minimal coordinates.
    pub fn dimension(&self) -> usize {
        match self {
            Self::Axis(joint) => joint.degrees_of_freedom(),
            Self::Point(_) => 3,
            Self::Pose(_) => 6,
            Self::Numbers(numbers) => numbers.len(),
        }
    }

    /// The element at coordinates δ.
    pub fn retract(&self, delta: &DVectorView<'_, f64>) -> Self {
        match self {
            Self::Axis(Joint::Revolute(line)) => {
                Self::Axis(Joint::Revolute(chart::retract_line(line, &delta.fixed_rows::<4>(0).into_owned())))
            }
            Self::Axis(Joint::Prismatic(w)) => {
                Self::Axis(Joint::Prismatic(chart::retract_direction(w, &delta.fixed_rows::<2>(0).into_owned())))
            }
            Self::Point(point) => Self::Point(point + delta.fixed_rows::<3>(0)),
            Self::Pose(pose) => Self::Pose(Isometry3::from_parts(
                Translation3::from(pose.translation.vector + delta.fixed_rows::<3>(0)),
                rotation::exp(&pose.rotation, &delta.fixed_rows::<3>(3).into_owned()),
            )),
            Self::Numbers(numbers) => Self::Numbers(numbers + delta),
        }
    }

    /// The coordinates of `other` in the chart at `self`; `None` outside the chart (directions of lines 90 deg or more
    /// apart, opposite directions) and for an element of another kind.
    pub fn local(&self, other: &Self) -> Option<DVector<f64>> {
        Some(match (self, other) {
            (Self::Axis(Joint::Revolute(line)), Self::Axis(Joint::Revolute(other))) => {
                DVector::from_column_slice(chart::local_line(line, other)?.as_slice())
            }
            (Self::Axis(Joint::Prismatic(w)), Self::Axis(Joint::Prismatic(other))) => {
                DVector::from_column_slice(chart::local_direction(w, other)?.as_slice())
            }
            (Self::Point(point), Self::Point(other)) => DVector::from_column_slice((other - point).as_slice()),
            (Self::Pose(pose), Self::Pose(other)) => {
                let shift = other.translation.vector - pose.translation.vector;
                let turn = rotation::log(&pose.rotation, &other.rotation);
                DVector::from_iterator(6, shift.iter().chain(turn.iter()).copied())
            }
            (Self::Numbers(numbers), Self::Numbers(other)) if numbers.len() == other.len() => other - numbers,
            _ => return None,
        })
    }

    /// The derivative of the change of chart from `self` to `self.retract(δ)`, at δ.
    pub fn transport(&self, delta: &DVectorView<'_, f64>) -> DMatrix<f64> {
        let mut transport = DMatrix::identity(self.dimension(), self.dimension());
        let mut turn = |start: usize, w: &UnitVector3<f64>| {
            let d = delta.fixed_rows::<2>(start).into_owned();
            let w_new = chart::retract_direction(w, &d);
            transport.fixed_view_mut::<2, 2>(start, start).copy_from(&chart::direction_transport(w, &d, &w_new));
            w_new
        };
        match self {
            Self::Axis(Joint::Revolute(line)) => {
                let w_new = turn(2, &line.direction);
                transport.fixed_view_mut::<2, 2>(0, 0).copy_from(&chart::point_transport(&line.direction, &w_new));
            }
            Self::Axis(Joint::Prismatic(w)) => {
                turn(0, w);
            }
            Self::Pose(_) => {
                let jacobian = rotation::left_jacobian(&delta.fixed_rows::<3>(3).into_owned());
                transport.fixed_view_mut::<3, 3>(3, 3).copy_from(&jacobian);
            }
            Self::Point(_) | Self::Numbers(_) => {}
        }
        transport
    }

    /// The derivative of the change of chart from `self` to `there`, by the coordinates at `there`: of
    /// `self.local(there.retract(ε))` at ε = 0. `None` outside the chart. Where `there` is `self.retract(δ)` it is the
    /// inverse of the transport at δ; but a line may be written with another pivot.
    pub fn change_of_chart(&self, there: &Self) -> Option<DMatrix<f64>> {
        if let (Self::Axis(Joint::Revolute(line)), Self::Axis(Joint::Revolute(there))) = (self, there) {
            let change = chart::line_change(line, there)?;
            return Some(DMatrix::from_column_slice(4, 4, change.as_slice()));
        }
        let delta = self.local(there)?;
        self.transport(&delta.rows(0, delta.len())).try_inverse()
    }

    /// The displacement of `other` from the guess `self`. For a line it is measured from the line's own pivot; write
    /// the line with the pivot nearest to the guess's first.
    ///
    /// For a line (v, w) and the guess (v₀, w₀), Q the parallel transport from w to w₀ along their great circle and B₀
    /// the basis at w₀,
    ///
    /// ```text
    /// r = ( B₀ᵀ Q (I − wwᵀ)(v − v₀),   local(w₀, w) )
    /// ```
    ///
    /// whose two norms are the distance of v₀ from the line and the angle to the guessed direction.
    pub fn displacement(&self, other: &Self) -> Option<Displacement> {
        match (self, other) {
            (Self::Axis(guess), Self::Axis(joint)) if guess.kind() == joint.kind() => Some(axis(guess, joint)),
            (Self::Pose(guess), Self::Pose(pose)) => {
                let value = self.local(other)?;
                let turn = rotation::log(&guess.rotation, &pose.rotation);
                let mut derivative = DMatrix::identity(6, 6);
                let inverse = rotation::left_jacobian(&turn).try_inverse()?;
                derivative.fixed_view_mut::<3, 3>(3, 3).copy_from(&inverse);
                let mut slope = DMatrix::identity(6, 6);
                let parallel = half_turned(&turn);
                slope.fixed_view_mut::<3, 3>(3, 3).copy_from(&parallel);
                Some(Displacement { value, derivative, slope })
            }
            _ => {
                let value = self.local(other)?;
                let identity = DMatrix::identity(value.len(), value.len());
                Some(Displacement { value, derivative: identity.clone(), slope: identity })
            }
        }
    }
}

impl Element {
    /// r of the [displacement](Self::displacement) alone.
    pub(crate) fn displaced(&self, other: &Self) -> Option<DVector<f64>> {
        match (self, other) {
            (Self::Axis(guess), Self::Axis(joint)) if guess.kind() == joint.kind() => {
                Some(axis_displaced(guess, joint))
            }
            _ => self.local(other),
        }
    }
}

/// The orthogonal part of the inverse left Jacobian: exp(−\[ω\]×/2).
fn half_turned(omega: &Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::from_scaled_axis(-0.5 * omega).into_inner()
}

/// The signed coordinates of the rotation from one direction to another. Opposite directions are π apart, along an
/// arbitrary great circle.
fn turned(w0: &UnitVector3<f64>, w: &UnitVector3<f64>) -> Vector2<f64> {
    chart::local_direction(w0, w).unwrap_or_else(|| Vector2::new(std::f64::consts::PI, 0.0))
}

/// r of an axis.
fn axis_displaced(guess: &Joint, joint: &Joint) -> DVector<f64> {
    match (guess, joint) {
        (Joint::Revolute(guess), Joint::Revolute(line)) => {
            DVector::from_column_slice(line_displaced(guess, line).as_slice())
        }
        _ => DVector::from_column_slice(turned(&guess.direction(), &joint.direction()).as_slice()),
    }
}

/// r of a line.
pub(super) fn line_displaced(guess: &Line, line: &Line) -> Vector4<f64> {
    let parallel = Parallel::new(&line.direction, &guess.direction);
    displaced_by(guess, line, &parallel)
}

fn displaced_by(guess: &Line, line: &Line, parallel: &Parallel) -> Vector4<f64> {
    let offset = line.point - guess.point;
    let across = offset - line.direction.into_inner() * line.direction.dot(&offset);
    let shift = chart::basis(&guess.direction).transpose() * parallel.carry(&across);
    let angle = turned(&guess.direction, &line.direction);
    Vector4::new(shift.x, shift.y, angle.x, angle.y)
}

/// The displacement of a line: its value, derivative and slope.
pub(super) fn line_displacement(guess: &Line, line: &Line) -> (Vector4<f64>, Matrix4<f64>, Matrix4<f64>) {
    let (w0, w) = (guess.direction, line.direction);
    let bases = (chart::basis(&w0), chart::basis(&w));
    let parallel = Parallel::new(&w, &w0);
    let value = displaced_by(guess, line, &parallel);
    let (carried, exact) = parallel.directions((&bases.0, &bases.1), hypot(value[2], value[3]));
    let offset = line.point - guess.point;
    let along = w.dot(&offset);
    let across = offset - w.into_inner() * along;
    let mut slope = Matrix4::zeros();
    // ∂a/∂(a, d) = [I, −(w·offset) I]: turning the line about its pivot carries it past the guess.
    slope.fixed_view_mut::<2, 2>(0, 0).copy_from(&carried);
    slope.fixed_view_mut::<2, 2>(0, 2).copy_from(&(carried * -along));
    let mut derivative = slope;
    slope.fixed_view_mut::<2, 2>(2, 2).copy_from(&carried);
    derivative.fixed_view_mut::<2, 2>(2, 2).copy_from(&exact);
    for k in 0..2 {
        // The parallel transport turns as well.
        let column = bases.0.transpose() * parallel.along(&bases.1.column(k).into_owned(), &across);
        for row in 0..2 {
            derivative[(row, 2 + k)] += column[row];
        }
    }
    (value, derivative, slope)
}

/// The displacement of an axis.
fn axis(guess: &Joint, joint: &Joint) -> Displacement {
    let dynamic = |matrix: &[f64]| {
        let n = matrix.len().isqrt();
        DMatrix::from_column_slice(n, n, matrix)
    };
    let value = axis_displaced(guess, joint);
    let (derivative, slope) = match (guess, joint) {
        (Joint::Revolute(guess), Joint::Revolute(line)) => {
            let (_, derivative, slope) = line_displacement(guess, line);
            (dynamic(derivative.as_slice()), dynamic(slope.as_slice()))
        }
        _ => {
            let (w0, w) = (guess.direction(), joint.direction());
            let bases = (&chart::basis(&w0), &chart::basis(&w));
            let (carried, exact) = Parallel::new(&w, &w0).directions(bases, turned(&w0, &w).norm());
            (dynamic(exact.as_slice()), dynamic(carried.as_slice()))
        }
    };
    Displacement { value, derivative, slope }
}

/// The smallest rotation that carries w into w₀, `Q x = x + k × x + k × (k × x)/(1 + c)` with k = w × w₀, c = w·w₀.
struct Parallel {
    to: Vector3<f64>,
    cross: Vector3<f64>,
    cosine: f64,
}

impl Parallel {
    fn new(from: &UnitVector3<f64>, to: &UnitVector3<f64>) -> Self {
        Self { to: to.into_inner(), cross: from.cross(to), cosine: from.dot(to).max(-1.0 + 1e-12) }
    }

    fn carry(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let swept = self.cross.cross(x);
        x + swept + self.cross.cross(&swept) / (1.0 + self.cosine)
    }

    /// The derivative of Q x as w moves by `e` ⟂ w.
    fn along(&self, e: &Vector3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
        let (change, swept) = (e.cross(&self.to), self.cross.cross(x));
        let rest = 1.0 + self.cosine;
        let twice = change.cross(&swept) + self.cross.cross(&change.cross(x));
        change.cross(x) + twice / rest - self.cross.cross(&swept) * (e.dot(&self.to) / (rest * rest))
    }

    /// How the angle φ from w₀ to w changes with w, by its coordinates in the bases B₀ and B: carried along in parallel, B₀ᵀ Q B,
    /// and exactly, where that is finite: great circles diverge, so that what moves w along k turns the circle by φ/sin φ as much.
    fn directions(
        &self,
        (basis0, basis): (&Matrix3x2<f64>, &Matrix3x2<f64>),
        angle: f64,
    ) -> (Matrix2<f64>, Matrix2<f64>) {
        let column = |k: usize| basis0.transpose() * self.carry(&basis.column(k).into_owned());
        let carried = Matrix2::from_columns(&[column(0), column(1)]);
        // k has the length sin φ.
        let diverging = match angle {
            small if small < 1e-3 => 1.0 / 6.0 + 0.075 * small * small,
            angle => (angle / sin(angle) - 1.0) / self.cross.norm_squared(),
        };
        let exact = carried + basis0.transpose() * self.cross * (self.cross.transpose() * basis) * diverging;
        (carried, if exact.iter().all(|x| x.is_finite()) { exact } else { carried })
    }
}
