//! What stands beside the arm, and what stands between a reading and a position.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::array;
use body_schema_engine::model::{Correction, Device, Distortion, DistortionModel, Place, State, Target};

/// Where a camera or a target is at θ = 0: its frame, of a camera x to the right of the picture, y down and z ahead.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlaceReport {
    /// What carries it: 0 is the robot's base, i what moves with the i-th joint. Null for what stands beside the robot.
    pub link: Option<usize>,
    /// Its origin, metres.
    pub position_m: [f64; 3],
    /// Its rotation as a unit quaternion x, y, z, w.
    pub quaternion: [f64; 4],
    /// Of a camera, focal lengths and principal point (fx, fy, cx, cy), pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics_px: Option<[f64; 4]>,
    /// Of a camera whose lens bends light, the coefficients of its distortion in OpenCV's order; four are those of a fisheye if
    /// `is_fisheye`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Vec<f64>>,
    /// Whether the distortion is that of an equidistant fisheye.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_fisheye: bool,
}

/// What makes a joint's position θ of its reading q: `θ = offset + ratio q + sine sin q + cosine cos q + compliance·τ`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CorrectionReport {
    /// Rad or m.
    pub offset: f64,
    /// Without a unit.
    pub ratio: f64,
    /// Rad or m.
    pub sine: f64,
    /// Rad or m.
    pub cosine: f64,
    /// How much the joint gives way to the loads at the target and at the elbow, rad per N·m with which gravity pulls at 1 kg.
    #[serde(default, skip_serializing_if = "is_stiff")]
    pub compliance: [f64; 2],
}

impl PlaceReport {
    fn of(link: Option<usize>, frame: &Isometry3<f64>, intrinsics_px: Option<[f64; 4]>) -> Self {
        let quaternion = frame.rotation.coords.into();
        Self {
            link,
            position_m: array(&frame.translation.vector),
            quaternion,
            intrinsics_px,
            distortion: None,
            is_fisheye: false,
        }
    }

    /// The base of a state; `None` if it stands where the frame of the measurements does.
    pub(super) fn of_base(state: &State) -> Option<Self> {
        (state.base != Isometry3::identity()).then(|| Self::of(None, &state.base, None))
    }

    /// The cameras of a state, in the frame of the measurements.
    pub(super) fn of_cameras(state: &State) -> Vec<Self> {
        let of = |device: &Device| {
            let distortion = device.distortion.as_ref();
            Self {
                distortion: distortion.map(|of| of.written().to_vec()),
                is_fisheye: distortion.is_some_and(|of| of.model() == DistortionModel::Equidistant),
                ..Self::of(device.link, &device.pose, device.intrinsics)
            }
        };
        state.devices.iter().map(of).collect()
    }

    /// Its targets, in the frame of the measurements; none if the marker, a point, is all there is.
    pub(super) fn of_targets(state: &State) -> Vec<Self> {
        match state.targets.as_slice() {
            [Target { place: Place::Point(_), .. }] => Vec::new(),
            targets => targets.iter().map(|target| Self::of(Some(target.link), &target.place.frame(), None)).collect(),
        }
    }

    /// Its frame; `None` if a number in it is not finite.
    pub fn frame(&self) -> Option<Isometry3<f64>> {
        let [x, y, z, w] = self.quaternion;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0)?;
        let frame = Isometry3::from_parts(Translation3::from(self.position_m), rotation);
        (frame.translation.vector.iter().chain(frame.rotation.coords.iter()).all(|x| x.is_finite())).then_some(frame)
    }

    pub(super) fn device(&self) -> Option<Device> {
        let model = if self.is_fisheye { DistortionModel::Equidistant } else { DistortionModel::BrownConrady };
        let distortion = match &self.distortion {
            Some(coefficients) => Some(Distortion::new(model, coefficients)?),
            None => None,
        };
        Some(Device { link: self.link, pose: self.frame()?, intrinsics: self.intrinsics_px, distortion })
    }

    pub(super) fn target(&self) -> Option<Target> {
        Some(Target { link: self.link.unwrap_or(0), place: Place::Pose(self.frame()?) })
    }
}

fn is_stiff(compliance: &[f64; 2]) -> bool {
    *compliance == [0.0; 2]
}

impl CorrectionReport {
    /// `None` where readings are taken for what they say.
    pub(super) fn of(correction: &Correction) -> Option<Self> {
        let Correction { offset, ratio, sine, cosine, compliance } = *correction;
        (*correction != Correction::default()).then_some(Self { offset, ratio, sine, cosine, compliance })
    }

    pub(super) fn correction(&self) -> Correction {
        let Self { offset, ratio, sine, cosine, compliance } = *self;
        Correction { offset, ratio, sine, cosine, compliance }
    }
}
