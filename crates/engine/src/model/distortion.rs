//! The distortion of a camera's lens: from the direction of a point to its normalised place in the picture.
//!
//! A point at (x, y, z) in the camera's frame, z ahead, has the normalised place (x′, y′) and the pixel (fx x′ + cx, fy y′ + cy).
//! Without a lens x′ = a = x/z, y′ = b = y/z. With r² = a² + b² and θ the angle between the point and the camera's axis,
//!
//! ```text
//! Brown–Conrady    x′ = a q(r²) + 2 p1 a b + p2 (r² + 2 a²),    q(u) = (1 + k1 u + k2 u² + k3 u³)/(1 + k4 u + k5 u² + k6 u³)
//!                  y′ = b q(r²) + p1 (r² + 2 b²) + 2 p2 a b
//! equidistant      (x′, y′) = (a, b)/r · d(θ),                  d(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)
//! ```
//!
//! These are OpenCV's `projectPoints` and `fisheye.projectPoints`, with the coefficients in OpenCV's order: k1, k2, p1, p2, k3, k4, k5,
//! k6, and k1, k2, k3, k4.
//!
//! *Beyond the border.* Such a polynomial stands for a lens only inside the picture. With g(r) = r q(r²), it is used up to r*, the first r
//! at which
//!
//! ```text
//! 0.02 + 8 p (1 + r²) ≤ g′(r) ≤ 8,    p = ‖(p1, p2)‖
//! ```
//!
//! ends to hold, and at most to r = 10. From there on each ray goes on linearly: g(r) = g(r*) + g′(r*) (r − r*), and the terms of p1 and
//! p2 likewise. The place and its derivative are continuous. The symmetric part of ∂(x′, y′)/∂(a, b) is positive definite everywhere, so
//! that no two directions have the same place: a point outside never comes back into view. The same holds of d, up to 135 degrees.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::{
    elementary::{atan2, hypot},
    model::polynomial::first_root,
    numeric_range::are_usable,
};

/// How a lens bends light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum DistortionModel {
    /// Radial and tangential (Brown 1966, Conrady 1919), with OpenCV's rational factor.
    BrownConrady,
    /// A fisheye that is nearly equidistant (Kannala and Brandt 2006).
    Equidistant,
}

/// The distortion of a lens: its model and coefficients.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "Stored", into = "Stored")]
pub struct Distortion {
    model: DistortionModel,
    /// In OpenCV's order; those that the model does not have are zero.
    coefficients: [f64; 8],
    border: Border,
}

/// The end of the polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Border {
    /// r* or θ*.
    at: f64,
    /// Which of the conditions ends there.
    reason: Reason,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Reason {
    /// The picture stops growing.
    Flat,
    /// It grows too fast.
    Steep,
    /// It is at the greatest angle.
    Greatest,
}

/// A normalised place in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// (x′, y′).
    pub at: Vector2<f64>,
    /// ∂(x′, y′)/∂(x, y, z), per metre.
    pub by_point: Matrix2x3<f64>,
}

#[derive(serde::Serialize, serde::Deserialize)]
struct Stored(DistortionModel, [f64; 8]);

impl From<Stored> for Distortion {
    fn from(Stored(model, coefficients): Stored) -> Self {
        Self::of(model, coefficients)
    }
}

impl From<Distortion> for Stored {
    fn from(of: Distortion) -> Self {
        Self(of.model, of.coefficients)
    }
}

/// The least and the greatest slope g′ of a lens.
const SLOPES: [f64; 2] = [0.02, 8.0];
/// The margin of the slope, in p (1 + r²).
const TANGENTIAL: f64 = 8.0;
/// The greatest r of a Brown–Conrady lens.
const WIDEST: f64 = 10.0;
/// The greatest θ of a fisheye, radians.
const WIDEST_FISHEYE: f64 = 0.75 * std::f64::consts::PI;
/// The places of k1, k2, k3 and of k4, k5, k6 among the coefficients.
const RADIAL: [[usize; 3]; 2] = [[0, 1, 4], [5, 6, 7]];

impl DistortionModel {
    /// The names of the coefficients, in OpenCV's order.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::BrownConrady => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Equidistant => &["k1", "k2", "k3", "k4"],
        }
    }

    /// Whether so many coefficients are those of a lens: 4, 5 or 8, of a fisheye 4.
    pub fn takes(self, count: usize) -> bool {
        match self {
            Self::BrownConrady => [4, 5, 8].contains(&count),
            Self::Equidistant => count == 4,
        }
    }
}

/// g and its derivatives at r, or d at θ.
struct Radial {
    value: f64,
    slope: f64,
    curvature: f64,
}

impl Distortion {
    /// The distortion with these coefficients, in OpenCV's order; `None` unless their number is [one of the model's](DistortionModel::takes)
    /// and they are numbers that can be computed with.
    pub fn new(model: DistortionModel, coefficients: &[f64]) -> Option<Self> {
        if !model.takes(coefficients.len()) || !are_usable(coefficients) {
            return None;
        }
        let mut all = [0.0; 8];
        all[..coefficients.len()].copy_from_slice(coefficients);
        Some(Self::of(model, all))
    }

    fn of(model: DistortionModel, coefficients: [f64; 8]) -> Self {
        let (slope, steep, most) = match model {
            DistortionModel::BrownConrady => brown_conditions(&coefficients),
            DistortionModel::Equidistant => fisheye_conditions(&coefficients),
        };
        let widest = most * most;
        let flat = first_root(&slope, widest).map_or(widest, |u| u.min(widest));
        let steep = first_root(&steep, widest).map_or(widest, |u| u.min(widest));
        let (u, reason) = match (flat < steep, flat.min(steep) < widest) {
            (true, _) => (flat, Reason::Flat),
            (false, true) => (steep, Reason::Steep),
            (false, false) => (widest, Reason::Greatest),
        };
        Self { model, coefficients, border: Border { at: u.max(0.0).sqrt(), reason } }
    }

    /// The model.
    pub fn model(&self) -> DistortionModel {
        self.model
    }

    /// All coefficients that the model has, 8 or 4.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients[..self.model.names().len()]
    }

    /// The coefficients as they are written: without trailing zeros, as many as the model may have.
    pub fn written(&self) -> &[f64] {
        let all = self.coefficients();
        let used = all.iter().rposition(|k| *k != 0.0).map_or(0, |last| last + 1);
        let count = (used..=all.len()).find(|count| self.model.takes(*count)).unwrap_or(all.len());
        &all[..count]
    }

    /// This distortion with another value of one coefficient, which the model has.
    #[must_use]
    pub fn with(&self, index: usize, value: f64) -> Self {
        let mut coefficients = self.coefficients;
        coefficients[index] = value;
        Self::of(self.model, coefficients)
    }

    /// The greatest angle to the camera's axis at which the model holds, radians.
    pub fn widest(&self) -> f64 {
        match self.model {
            DistortionModel::BrownConrady => atan2(self.border.at, 1.0),
            DistortionModel::Equidistant => self.border.at,
        }
    }

    /// The normalised distance from the centre of the picture at which the model ends.
    pub fn reach(&self) -> f64 {
        self.radial(self.border.at).value
    }

    /// Whether the model holds in the direction of a point: not farther from the axis than [`widest`](Self::widest).
    pub fn holds(&self, at: &Vector3<f64>) -> bool {
        atan2(hypot(at.x, at.y), at.z) <= self.widest()
    }

    fn radial(&self, r: f64) -> Radial {
        let k = &self.coefficients;
        let u = r * r;
        match self.model {
            DistortionModel::BrownConrady => {
                let Factor { q, first, second, .. } = Factor::at(k, u);
                Radial {
                    value: r * q,
                    slope: q + 2.0 * u * first,
                    curvature: 2.0 * r * (3.0 * first + 2.0 * u * second),
                }
            }
            DistortionModel::Equidistant => Radial {
                value: r * (1.0 + u * (k[0] + u * (k[1] + u * (k[2] + u * k[3])))),
                slope: 1.0 + u * (3.0 * k[0] + u * (5.0 * k[1] + u * (7.0 * k[2] + u * 9.0 * k[3]))),
                curvature: r * (6.0 * k[0] + u * (20.0 * k[1] + u * (42.0 * k[2] + u * 72.0 * k[3]))),
            },
        }
    }

    /// The value and slope of the radial part by a coefficient, at r.
    fn radial_by(&self, index: usize, r: f64) -> [f64; 2] {
        let u = r * r;
        match self.model {
            DistortionModel::BrownConrady => Factor::at(&self.coefficients, u)
                .by(index, u)
                .map_or([0.0; 2], |[by, first]| [r * by, by + 2.0 * u * first]),
            DistortionModel::Equidistant => {
                let power = u.powi(index as i32 + 1);
                [r * power, (2 * index + 3) as f64 * power]
            }
        }
    }

    /// g or d, continued beyond the border, and its slope.
    fn continued(&self, r: f64) -> [f64; 2] {
        let border = self.border.at;
        let Radial { value, slope, .. } = self.radial(r.min(border));
        [if r > border { value + slope * (r - border) } else { value }, slope]
    }

    /// By how much g or d, continued, and the border change with a coefficient.
    fn continued_by(&self, index: usize, r: f64) -> [f64; 2] {
        let border = self.border.at;
        if r <= border {
            return [self.radial_by(index, r)[0], 0.0];
        }
        let [value, slope] = self.radial_by(index, border);
        let moved = self.border_by(index);
        [value + (r - border) * (slope + self.radial(border).curvature * moved), moved]
    }

    /// ∂r*/∂k.
    fn border_by(&self, index: usize) -> f64 {
        let Border { at, reason } = self.border;
        let is_brown = self.model == DistortionModel::BrownConrady;
        let p = if is_brown { hypot(self.coefficients[2], self.coefficients[3]) } else { 0.0 };
        let by_slope = self.radial_by(index, at)[1];
        let curvature = self.radial(at).curvature;
        let (by, along) = match reason {
            Reason::Greatest => return 0.0,
            Reason::Steep => (by_slope, curvature),
            Reason::Flat => {
                let own =
                    if is_brown && (index == 2 || index == 3) && p > 0.0 { self.coefficients[index] / p } else { 0.0 };
                (by_slope - TANGENTIAL * (1.0 + at * at) * own, curvature - 2.0 * TANGENTIAL * p * at)
            }
        };
        // Where the two only touch, the border jumps.
        if along.abs() > 1e-9 { -by / along } else { 0.0 }
    }

    /// The normalised place of a point. Of a Brown–Conrady lens the point must be in front of the camera.
    pub fn image(&self, at: &Vector3<f64>) -> Image {
        match self.model {
            DistortionModel::BrownConrady => {
                let ideal = Vector2::new(at.x / at.z, at.y / at.z);
                let (place, by_ideal) = self.bent(&ideal);
                let by_depth = ideal * (-1.0 / at.z);
                let by_point = Matrix2x3::from_columns(&[
                    by_ideal.column(0) / at.z,
                    by_ideal.column(1) / at.z,
                    by_ideal * by_depth,
                ]);
                Image { at: place, by_point }
            }
            DistortionModel::Equidistant => self.fisheye(at),
        }
    }

    /// (x′, y′) and ∂(x′, y′)/∂(a, b).
    fn bent(&self, ideal: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [_, _, p1, p2, ..] = self.coefficients;
        let (r, border) = (hypot(ideal.x, ideal.y), self.border.at);
        if r <= border {
            let Factor { q, first, .. } = Factor::at(&self.coefficients, r * r);
            let [a, b] = [ideal.x, ideal.y];
            let tangential = Vector2::new(
                2.0 * p1 * a * b + p2 * (r * r + 2.0 * a * a),
                p1 * (r * r + 2.0 * b * b) + 2.0 * p2 * a * b,
            );
            let across = 2.0 * p1 * a + 2.0 * p2 * b;
            let by_tangential = Matrix2::new(2.0 * p1 * b + 6.0 * p2 * a, across, across, 6.0 * p1 * b + 2.0 * p2 * a);
            let by_radial = Matrix2::identity() * q + ideal * ideal.transpose() * (2.0 * first);
            return (ideal * q + tangential, by_radial + by_tangential);
        }
        let [value, slope] = self.continued(r);
        let along = ideal / r;
        let side = Vector2::new(-along.y, along.x);
        let [scale, scale_slope] = [border * border + 2.0 * border * (r - border), 2.0 * border];
        let ([t, t_turned], _) = tangential(p1, p2, &along);
        let by_r = along * slope + t * scale_slope;
        let by_turn = (side * value + t_turned * scale) / r;
        (along * value + t * scale, by_r * along.transpose() + by_turn * side.transpose())
    }

    fn fisheye(&self, at: &Vector3<f64>) -> Image {
        let distance = at.norm().max(1e-9);
        let mut rho = hypot(at.x, at.y);
        if rho < 1e-9 * distance && at.z > 0.0 {
            let place = Vector2::new(at.x / at.z, at.y / at.z);
            let by_point = Matrix2x3::new(1.0, 0.0, -place.x, 0.0, 1.0, -place.y) / at.z;
            return Image { at: place, by_point };
        }
        let along = radially(at);
        rho = rho.max(1e-9 * distance);
        let [value, slope] = self.continued(atan2(rho, at.z));
        let squared = distance * distance;
        let outer = along * along.transpose();
        let by_plane = outer * (slope * at.z / squared) + (Matrix2::identity() - outer) * (value / rho);
        let by_depth = along * (-slope * rho / squared);
        let by_point = Matrix2x3::from_columns(&[by_plane.column(0).into(), by_plane.column(1).into(), by_depth]);
        Image { at: along * value, by_point }
    }

    /// ∂(x′, y′)/∂k of the coefficient `index` at a point, as [`image`](Self::image) takes it.
    pub fn by_coefficient(&self, index: usize, at: &Vector3<f64>) -> Vector2<f64> {
        if self.model == DistortionModel::Equidistant {
            let [value, _] = self.continued_by(index, atan2(hypot(at.x, at.y), at.z));
            return radially(at) * value;
        }
        let [_, _, p1, p2, ..] = self.coefficients;
        let ideal = Vector2::new(at.x / at.z, at.y / at.z);
        let (r, border) = (hypot(ideal.x, ideal.y), self.border.at);
        if r == 0.0 {
            return Vector2::zeros();
        }
        let along = ideal / r;
        let [value, moved] = self.continued_by(index, r);
        let ([t, _], [by_p1, by_p2]) = tangential(p1, p2, &along);
        let scale = if r <= border { r * r } else { border * border + 2.0 * border * (r - border) };
        let own = match index {
            2 => by_p1 * scale,
            3 => by_p2 * scale,
            _ => Vector2::zeros(),
        };
        // Where the border moves, so does what goes on from it.
        let by_border = if r <= border { 0.0 } else { 2.0 * (r - border) * moved };
        along * value + own + t * by_border
    }
}

/// The direction of a point in the picture; to the right where it has none.
fn radially(at: &Vector3<f64>) -> Vector2<f64> {
    let rho = hypot(at.x, at.y);
    if rho > 0.0 { Vector2::new(at.x / rho, at.y / rho) } else { Vector2::x() }
}

/// Of the tangential terms at r = 1 in the direction (cos φ, sin φ): t and ∂t/∂φ; then ∂t/∂p1 and ∂t/∂p2.
fn tangential(p1: f64, p2: f64, along: &Vector2<f64>) -> ([Vector2<f64>; 2], [Vector2<f64>; 2]) {
    let [a, b] = [along.x, along.y];
    let by_p1 = Vector2::new(2.0 * a * b, 1.0 + 2.0 * b * b);
    let by_p2 = Vector2::new(1.0 + 2.0 * a * a, 2.0 * a * b);
    let turned_p1 = Vector2::new(2.0 * (a * a - b * b), 4.0 * a * b);
    let turned_p2 = Vector2::new(-4.0 * a * b, 2.0 * (a * a - b * b));
    ([by_p1 * p1 + by_p2 * p2, turned_p1 * p1 + turned_p2 * p2], [by_p1, by_p2])
}

/// q and its derivatives by u.
struct Factor {
    q: f64,
    first: f64,
    second: f64,
    /// The denominator and its derivative.
    below: [f64; 2],
}

impl Factor {
    fn at(k: &[f64; 8], u: f64) -> Self {
        let [above, below] = RADIAL.map(|[one, two, three]| {
            let [one, two, three] = [k[one], k[two], k[three]];
            [
                1.0 + u * (one + u * (two + u * three)),
                one + u * (2.0 * two + u * 3.0 * three),
                2.0 * two + 6.0 * three * u,
            ]
        });
        let q = above[0] / below[0];
        let first = (above[1] - q * below[1]) / below[0];
        let second = (above[2] - 2.0 * first * below[1] - q * below[2]) / below[0];
        Self { q, first, second, below: [below[0], below[1]] }
    }

    /// ∂q/∂k and its derivative by u; `None` of p1 and p2.
    fn by(&self, index: usize, u: f64) -> Option<[f64; 2]> {
        let [below, below_first] = self.below;
        let power = |list: &[usize; 3]| list.iter().position(|place| *place == index).map(|power| power as i32 + 1);
        if let Some(power) = power(&RADIAL[0]) {
            let by = u.powi(power) / below;
            return Some([by, (f64::from(power) * u.powi(power - 1) - by * below_first) / below]);
        }
        let power = power(&RADIAL[1])?;
        let by = -self.q * u.powi(power) / below;
        let above = -self.first * u.powi(power) - self.q * f64::from(power) * u.powi(power - 1);
        Some([by, (above - by * below_first) / below])
    }
}

/// The polynomials in u = r² that are positive where a Brown–Conrady lens is not too flat and not too steep, and the greatest r.
fn brown_conditions(k: &[f64; 8]) -> ([f64; 8], [f64; 8], f64) {
    let [above, below] = RADIAL.map(|[one, two, three]| [1.0, k[one], k[two], k[three]]);
    let [mut growth, mut square] = [[0.0; 8]; 2];
    for i in 0..4 {
        for j in 0..4 {
            // N D + 2 u (N′ D − N D′), and D².
            growth[i + j] += above[i] * below[j] * (1.0 + 2.0 * i as f64 - 2.0 * j as f64);
            square[i + j] += below[i] * below[j];
        }
    }
    let margin = TANGENTIAL * hypot(k[2], k[3]);
    let before = |i: usize| if i > 0 { square[i - 1] } else { 0.0 };
    let flat = std::array::from_fn(|i| growth[i] - (SLOPES[0] + margin) * square[i] - margin * before(i));
    let steep = std::array::from_fn(|i| SLOPES[1] * square[i] - growth[i]);
    (flat, steep, WIDEST)
}

/// The same of a fisheye, in θ².
fn fisheye_conditions(k: &[f64; 8]) -> ([f64; 8], [f64; 8], f64) {
    let slope = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3], 0.0, 0.0, 0.0];
    let (mut flat, mut steep) = (slope, slope.map(|x| -x));
    flat[0] -= SLOPES[0];
    steep[0] += SLOPES[1];
    (flat, steep, WIDEST_FISHEYE)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn brown() -> impl Strategy<Value = Distortion> {
        let k = || -0.6..0.6_f64;
        let p = || -0.01..0.01_f64;
        let of = |(k1, k2, p1, p2, k3, rational, below): (f64, f64, f64, f64, f64, bool, [f64; 3])| {
            let below = if rational { below } else { [0.0; 3] };
            let [k4, k5, k6] = below;
            Distortion::new(DistortionModel::BrownConrady, &[k1, k2, p1, p2, k3, k4, k5, k6]).expect("a lens")
        };
        (k(), k(), p(), p(), k(), any::<bool>(), [k(), k(), k()]).prop_map(of)
    }

    fn fisheye() -> impl Strategy<Value = Distortion> {
        [-0.2..0.2_f64, -0.1..0.1_f64, -0.05..0.05_f64, -0.02..0.02_f64]
            .prop_map(|k| Distortion::new(DistortionModel::Equidistant, &k).expect("a lens"))
    }

    fn ahead() -> impl Strategy<Value = Vector3<f64>> {
        (-3.0..3.0_f64, -3.0..3.0_f64, 0.05..2.0_f64).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    /// Derivatives by point and by coefficient equal central differences, inside the border and beyond.
    fn derivatives_are_right(lens: &Distortion, at: &Vector3<f64>) -> Result<(), TestCaseError> {
        // Not across the border, where curvatures jump.
        let off = lens.widest() - atan2(hypot(at.x, at.y), at.z);
        prop_assume!(off.abs() > 1e-3);
        let Image { by_point, .. } = lens.image(at);
        let scale = 1.0 + by_point.amax();
        for axis in 0..3 {
            let moved = |step: f64| {
                let mut moved = *at;
                moved[axis] += step;
                lens.image(&moved).at
            };
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            prop_assert!((slope - by_point.column(axis)).amax() < 1e-6 * scale, "{axis}: {slope} {by_point}");
        }
        for index in 0..lens.coefficients().len() {
            let moved = |step: f64| lens.with(index, lens.coefficients()[index] + step).image(at).at;
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            let found = lens.by_coefficient(index, at);
            // Where a condition only touches its bound, the border jumps.
            let border = |step: f64| lens.with(index, lens.coefficients()[index] + step).border.at;
            prop_assume!((border(1e-6) - border(-1e-6)).abs() < 1e-4);
            let scale = 1.0 + slope.amax();
            prop_assert!((slope - found).amax() < 1e-4 * scale, "{index}: {slope} {found} {lens:?}");
        }
        Ok(())
    }

    /// Two points are farther apart along the line between them, by at least a share of what they are without a lens.
    fn grows(lens: &Distortion, from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let place = |ideal: &Vector2<f64>| lens.image(&Vector3::new(ideal.x, ideal.y, 1.0)).at;
        let between = to - from;
        (place(to) - place(from)).dot(&between) > 1e-3 * between.norm_squared()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn derivatives_of_brown_conrady_are_right(lens in brown(), at in ahead()) {
            derivatives_are_right(&lens, &at)?;
        }

        #[test]
        fn derivatives_of_a_fisheye_are_right(lens in fisheye(), at in ahead(), behind: bool) {
            let at = if behind { Vector3::new(at.x, at.y, -at.z) } else { at };
            prop_assume!(hypot(at.x, at.y) > 1e-2);
            derivatives_are_right(&lens, &at)?;
        }

        /// No two directions have the same place, wherever they are; and there is a place everywhere.
        #[test]
        fn nothing_comes_back_into_view(lens in brown(), ends in proptest::array::uniform4(-30.0..30.0_f64), near: bool) {
            let [from, to] = [Vector2::new(ends[0], ends[1]), Vector2::new(ends[2], ends[3])];
            let scale = if near { 0.05 } else { 1.0 };
            prop_assume!((to - from).norm() > 1e-3);
            prop_assert!(grows(&lens, &(from * scale), &(to * scale)), "{lens:?}");
        }

        /// A fisheye's place goes out with the angle, past 90 degrees too.
        #[test]
        fn a_fisheye_grows_with_the_angle(lens in fisheye(), turn in 0.0..6.2_f64) {
            let mut before = -1.0;
            for step in 0..180 {
                let angle = f64::from(step).to_radians();
                let (sine, cosine) = crate::elementary::sin_cos(angle);
                let (across, along) = crate::elementary::sin_cos(turn);
                let Image { at, by_point } = lens.image(&(Vector3::new(sine * along, sine * across, cosine) * 0.7));
                prop_assert!(at.norm() > before && by_point.iter().all(|x| x.is_finite()));
                before = at.norm();
            }
        }
    }

    /// Worked by hand: k1 = −0.3 stops growing to a fiftieth where 1 − 0.9 r² = 0.02; k1 = 0.3 grows eightfold at 0.9 r² = 7.
    #[test]
    fn the_border_is_where_the_picture_stops_growing() {
        let lens = |k1: f64| Distortion::new(DistortionModel::BrownConrady, &[k1, 0.0, 0.0, 0.0]).expect("a lens");
        assert!((lens(-0.3).border.at - (0.98 / 0.9_f64).sqrt()).abs() < 1e-12);
        assert!((lens(0.3).border.at - (7.0 / 0.9_f64).sqrt()).abs() < 1e-12);
        assert!((lens(0.0).border.at - WIDEST).abs() < 1e-12);
        assert!((lens(-0.3).reach() - 1.0435 * (1.0 - 0.3 * 0.98 / 0.9)).abs() < 1e-3);
    }

    /// Beside a pole of the rational factor, with coefficients out of all proportion, and far behind the camera.
    #[test]
    fn a_place_is_a_number_whatever_the_coefficients() {
        let wild = [-1e12, -3.0, -0.5, 0.0, 0.5, 3.0, 1e12];
        let points = [Vector3::new(0.0, 0.0, 0.3), Vector3::new(1e6, -1e6, 1e-6), Vector3::new(0.3, 0.2, 0.5)];
        for k1 in wild {
            for other in wild {
                let brown = [k1, other, 0.1 * other, -0.1 * k1, other, other, k1, -other];
                let lenses = [
                    Distortion::new(DistortionModel::BrownConrady, &brown),
                    Distortion::new(DistortionModel::Equidistant, &[k1, other, -k1, -other]),
                ];
                for lens in lenses.into_iter().flatten() {
                    for at in points {
                        let Image { at: place, by_point } = lens.image(&at);
                        assert!(place.iter().chain(by_point.iter()).all(|x| x.is_finite()), "{lens:?} {at}");
                        let by = (0..4).map(|index| lens.by_coefficient(index, &at));
                        assert!(by.into_iter().all(|by| by.iter().all(|x| x.is_finite())), "{lens:?} {at}");
                    }
                }
            }
        }
        assert_eq!(Distortion::new(DistortionModel::BrownConrady, &[0.1; 6]), None);
        assert_eq!(Distortion::new(DistortionModel::Equidistant, &[f64::NAN; 4]), None);
    }

    #[test]
    fn coefficients_are_written_as_many_as_are_needed() {
        let written = |k: &[f64]| Distortion::new(DistortionModel::BrownConrady, k).expect("a lens").written().len();
        assert_eq!([written(&[0.0; 4]), written(&[0.1; 5]), written(&[0.1; 8])], [4, 5, 8]);
        assert_eq!(written(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0]), 8);
    }

    /// What is stored comes back with its border.
    #[test]
    fn a_distortion_is_stored_by_its_coefficients() {
        let lens = Distortion::new(DistortionModel::BrownConrady, &[-0.3, 0.1, 0.001, 0.0, 0.02]).expect("a lens");
        let bytes = postcard::to_allocvec(&lens).expect("bytes");
        assert_eq!(postcard::from_bytes::<Distortion>(&bytes), Ok(lens));
    }
}
