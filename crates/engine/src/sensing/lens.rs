//! The lens of a camera: where a point in the camera's frame is in the picture, and how far inside.

use std::f64::consts::PI;

use nalgebra::{Matrix2x3, Vector3};

use crate::{
    elementary::{asin, atan2, hypot, sin_cos},
    model::{Device, Distortion, DistortionModel, Image},
};

/// c, the cotangent of the angle from its axis up to which a camera has a picture, x² + y² ≤ (z/c)²: 76 degrees of a pinhole.
pub const WIDE: f64 = 0.25;
/// The same of a lens: as far as any of [`Distortion`] holds, 84 degrees.
const WIDE_LENS: f64 = 0.1;
/// κ, which keeps the continued depth from vanishing on the axis behind the camera.
const REAR: f64 = 0.01;
/// The least of √(x² + y² + κ² z²) behind the camera, metres: at the camera itself.
const LEAST: f64 = 1e-12;

/// Intrinsics and distortion of a camera.
pub(super) struct Lens<'a> {
    /// fx, fy, cx, cy, pixels.
    pub intrinsics: [f64; 4],
    /// `None` for a pinhole.
    pub distortion: Option<&'a Distortion>,
}

/// A point in a camera's frame, and its picture.
pub(super) struct Seen {
    /// (x, y, z̄), the point with its depth continued.
    pub at: Vector3<f64>,
    /// ∂z̄/∂(x, y, z) where the depth is continued; elsewhere it is z.
    pub slope: Option<Vector3<f64>>,
    /// The normalised place (x′, y′).
    pub place: [f64; 2],
    /// ∂(x′, y′)/∂(x, y, z) of a lens with distortion.
    pub by_point: Option<Matrix2x3<f64>>,
    /// (u, v), pixels.
    pub picture: [f64; 2],
}

impl<'a> Lens<'a> {
    pub fn of(device: &'a Device) -> Self {
        Self { intrinsics: device.intrinsics.unwrap_or_default(), distortion: device.distortion.as_ref() }
    }

    /// The picture of a point, continued behind the camera.
    pub fn see(&self, at: &Vector3<f64>) -> Seen {
        let [fx, fy, cx, cy] = self.intrinsics;
        // A fisheye goes by the angle, which needs no depth.
        let is_fisheye = self.distortion.is_some_and(|of| of.model() == DistortionModel::Equidistant);
        let continued = if is_fisheye { None } else { continued(at, self.distortion.map_or(WIDE, |_| WIDE_LENS)) };
        let (depth, slope) = continued.map_or((at.z, None), |(depth, slope)| (depth, Some(slope)));
        let at = Vector3::new(at.x, at.y, depth);
        let Some(distortion) = self.distortion else {
            let place = [at.x / depth, at.y / depth];
            let picture = [fx * at.x / depth + cx, fy * at.y / depth + cy];
            return Seen { at, slope, place, by_point: None, picture };
        };
        let Image { at: place, mut by_point } = distortion.image(&at);
        if let Some(slope) = slope {
            let by_depth = by_point.column(2).into_owned();
            by_point.column_mut(2).fill(0.0);
            by_point += by_depth * slope.transpose();
        }
        let place = [place.x, place.y];
        let picture = [fx * place[0] + cx, fy * place[1] + cy];
        Seen { at, slope, place, by_point: Some(by_point), picture }
    }

    /// Whether a point has a picture: in front of the camera, and where its distortion holds.
    pub fn predicts(&self, at: &Vector3<f64>) -> bool {
        self.distortion.map_or_else(|| at.z > 0.0 && continued(at, WIDE).is_none(), |distortion| distortion.holds(at))
    }

    /// The picture of this size, pixels.
    pub fn picture(self, size_px: [f64; 2]) -> Picture<'a> {
        let ([fx, fy, cx, cy], [width, height]) = (self.intrinsics, size_px);
        let planes = [
            Vector3::new(fx, 0.0, cx),
            Vector3::new(-fx, 0.0, width - cx),
            Vector3::new(0.0, fy, cy),
            Vector3::new(0.0, -fy, height - cy),
        ]
        .map(|plane| plane.normalize());
        let corner = hypot(cx.max(width - cx) / fx, cy.max(height - cy) / fy);
        Picture { lens: self, size_px, planes, is_wide: corner * WIDE > 1.0 }
    }
}

/// z̄ = z₀²/(2 z₀ − z) and ∂z̄/∂(x, y, z) of a point below z₀ = c √(x² + y² + κ² min(z, 0)²); `None` for one above it.
// It is asked of every point, and of few it has to do anything.
#[inline(never)]
fn continued(at: &Vector3<f64>, wide: f64) -> Option<(f64, Vector3<f64>)> {
    let behind = at.z.min(0.0);
    let across = hypot(hypot(at.x, at.y), REAR * behind).max(LEAST);
    let least = wide * across;
    if at.z >= least {
        return None;
    }
    let below = 2.0 * least - at.z;
    let depth = least * least / below;
    let by_least = 2.0 * least * (least - at.z) / (below * below);
    let of_least = Vector3::new(at.x, at.y, REAR * REAR * behind) * (wide / across);
    Some((depth, of_least * by_least + Vector3::z() * (least / below).powi(2)))
}

/// What a camera has in its picture.
pub(super) struct Picture<'a> {
    lens: Lens<'a>,
    size_px: [f64; 2],
    /// The inward normals of the planes that bound the picture of a pinhole.
    planes: [Vector3<f64>; 4],
    /// Whether a pinhole's picture reaches further than it [predicts](Lens::predicts).
    is_wide: bool,
}

impl Picture<'_> {
    /// How far a point is inside the picture, radians: positive exactly where it has a picture and that is inside.
    ///
    /// It is the least angle between the point and the four planes that bound the picture of a pinhole: all four are positive in front of
    /// the camera alone. With a distortion that is the [margin](Self::margin) of the point's place, and at most the angle θ* − θ to
    /// where the distortion ends to hold; beyond, θ* − θ and what the margin is below 0 there, less and less towards the rear, where all
    /// directions meet.
    pub fn clearance(&self, at: &Vector3<f64>) -> f64 {
        let Some(distortion) = self.lens.distortion else {
            let off = || atan2(1.0, WIDE) - atan2(hypot(at.x, at.y), at.z);
            return if self.is_wide { self.inside(at).min(off()) } else { self.inside(at) };
        };
        let (widest, rho) = (distortion.widest(), hypot(at.x, at.y));
        let angle = atan2(rho, at.z);
        let (sine, cosine) = sin_cos(angle.min(widest));
        let [x, y] = if rho > 0.0 { [at.x / rho, at.y / rho] } else { [1.0, 0.0] };
        let margin = self.margin(distortion, &Vector3::new(sine * x, sine * y, cosine));
        let beyond = widest - angle;
        if beyond >= 0.0 { beyond.min(margin) } else { beyond + margin.min(0.0) * (PI - angle) / (PI - widest) }
    }

    /// How far the place of a direction is inside the picture, radians: the angle to the planes of the ray that a pinhole would have there,
    /// or, for a fisheye, the distance to the picture's edge in units of the focal length.
    fn margin(&self, distortion: &Distortion, direction: &Vector3<f64>) -> f64 {
        let place = distortion.image(direction).at;
        if distortion.model() == DistortionModel::BrownConrady {
            return self.inside(&Vector3::new(place.x, place.y, 1.0));
        }
        let ([fx, fy, cx, cy], [width, height]) = (self.lens.intrinsics, self.size_px);
        let edges = [place.x + cx / fx, (width - cx) / fx - place.x, place.y + cy / fy, (height - cy) / fy - place.y];
        edges.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn inside(&self, at: &Vector3<f64>) -> f64 {
        let distance = at.norm().max(1e-9);
        // The least sine is that of the least angle.
        let sines = self.planes.iter().map(|plane| (plane.dot(at) / distance).clamp(-1.0, 1.0));
        asin(sines.fold(1.0, f64::min))
    }
}
