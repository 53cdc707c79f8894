//! What stands beside the arm in a report, cameras and the targets that they see, and what each reading was like.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::{report::array, world::World};
use body_schema_engine::{
    estimation::{Belief, ReadingReport},
    model::{Correction, Device, Place, State, Target},
    sensing::{Equipment, Observation, Rig},
};

/// A camera, as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CameraDescription {
    /// Its name.
    pub name: String,
    /// Width and height of its picture, pixels.
    pub size_px: [f64; 2],
}

/// A target, as the scenario describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TargetDescription {
    /// Its name.
    pub name: String,
    /// Its known points in its own frame, metres; the origin alone for a point.
    pub points_m: Vec<[f64; 3]>,
}

/// What is read after every movement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChannelDescription {
    /// What it is called.
    pub name: String,
    /// Its equations.
    pub equations: usize,
    /// The parts of a reading, equal in equations: the points of a target in a picture, the position and the rotation of a pose.
    /// One part is the whole.
    pub parts: Vec<String>,
    /// The camera, by its number; null for what is read without one.
    pub camera: Option<usize>,
    /// What the camera sees, by the number of the target; null without a camera.
    pub target: Option<usize>,
}

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

/// A reading of the present movement beside what the estimate after the update says of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ChannelReading {
    /// The channel, counted from 0.
    pub channel: usize,
    /// ‖L⁻¹ (y ⊖ h)‖/√d, the root mean square over its d equations in standard deviations of the sensor's noise: about 1
    /// where noise is all that is left. Null for a miss.
    pub residual_sigmas: Option<f64>,
    /// The same of each part; empty for a miss.
    pub parts_sigmas: Vec<f64>,
    /// The weight that a robust loss gives its equations; null for an estimator without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// The probability that it is an outlier; null for an estimator whose loss knows of none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outlier_probability: Option<f64>,
}

impl ChannelReading {
    /// From this probability on a reading is called an outlier.
    pub const OUTLIER: f64 = 0.5;

    /// Whether it rather is an outlier than not.
    pub fn is_outlier(&self) -> bool {
        self.outlier_probability.is_some_and(|probability| probability > Self::OUTLIER)
    }
}

/// What there is to see with, and what is seen.
pub fn described(equipment: &Equipment) -> (Vec<CameraDescription>, Vec<TargetDescription>) {
    let cameras = equipment.cameras.iter();
    let cameras = cameras.map(|camera| CameraDescription { name: camera.name.clone(), size_px: camera.size_px });
    let targets = equipment.targets.iter().map(|target| TargetDescription {
        name: target.name.clone(),
        points_m: target.points.iter().map(|point| array(&point.coords)).collect(),
    });
    (cameras.collect(), targets.collect())
}

/// The channels of a rig, with the names of what they see.
pub fn channels(rig: &Rig, equipment: &Equipment) -> Vec<ChannelDescription> {
    let describe = |(index, channel): (usize, &std::sync::Arc<dyn body_schema_engine::sensing::Channel>)| {
        let target = |target: usize| equipment.targets.get(target).map_or("marker", |target| target.name.as_str());
        let sight = channel.sight();
        let name = match (sight, channel.target()) {
            (Some((camera, seen)), _) => {
                let camera = equipment.cameras.get(camera).map_or("camera", |camera| camera.name.as_str());
                format!("{} seen by {camera}", target(seen))
            }
            (None, Some(measured)) => target(measured).to_owned(),
            (None, None) if channel.noises() > 1 => "pose".to_owned(),
            (None, None) => format!("reading {}", index + 1),
        };
        let points = sight.and_then(|(_, seen)| Some(equipment.targets.get(seen)?.points.len()));
        let parts = match (points, channel.noises()) {
            (Some(points), _) => (1..=points).map(|point| format!("point {point}")).collect(),
            (None, 2) => ["position", "rotation"].map(str::to_owned).into(),
            _ => vec![name.clone()],
        };
        let (camera, target) = sight.unzip();
        ChannelDescription { name, equations: channel.equations(), parts, camera, target }
    };
    rig.channels().iter().enumerate().map(describe).collect()
}

/// What there is of a movement's readings in a world, beside what is believed after it: by the noise of the sensors themselves,
/// or where nobody knows that, by the noise that is believed. `weighed` are those of an estimator that weighs them.
pub(super) fn readings(
    world: &World,
    belief: &Belief,
    configuration: &[f64],
    observation: &Observation,
    channels: &[ChannelDescription],
    weighed: &[ReadingReport],
) -> Vec<ChannelReading> {
    let miss = |channel| ChannelReading {
        channel,
        residual_sigmas: None,
        parts_sigmas: Vec::new(),
        weight: None,
        outlier_probability: None,
    };
    let mut readings: Vec<ChannelReading> = (0..observation.readings.len()).map(miss).collect();
    let rig = match world {
        World::Simulated { rig, .. } => rig,
        World::Measured { .. } | World::Outside => &belief.rig,
    };
    let root_mean_square = |part: &[f64]| (part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64).sqrt();
    rig.residuals(&belief.state, configuration, observation, |channel, whitened| {
        let parts = channels.get(channel).map_or(1, |channel| channel.parts.len()).max(1);
        let reading = &mut readings[channel];
        reading.residual_sigmas = Some(root_mean_square(whitened));
        reading.parts_sigmas = whitened.chunks(whitened.len().div_ceil(parts)).map(root_mean_square).collect();
    });
    for report in weighed {
        if let Some(reading) = readings.get_mut(report.channel) {
            (reading.weight, reading.outlier_probability) = (Some(report.weight), report.outlier_probability);
        }
    }
    readings
}

impl PlaceReport {
    fn of(link: Option<usize>, frame: &Isometry3<f64>, intrinsics_px: Option<[f64; 4]>) -> Self {
        let quaternion = frame.rotation.coords.into();
        Self { link, position_m: array(&frame.translation.vector), quaternion, intrinsics_px }
    }

    /// The base of a state; `None` if it stands where the frame of the measurements does.
    pub(super) fn of_base(state: &State) -> Option<Self> {
        (state.base != Isometry3::identity()).then(|| Self::of(None, &state.base, None))
    }

    /// The cameras of a state, in the frame of the measurements.
    pub(super) fn of_cameras(state: &State) -> Vec<Self> {
        state.devices.iter().map(|device| Self::of(device.link, &device.pose, device.intrinsics)).collect()
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
        Some(Device { link: self.link, pose: self.frame()?, intrinsics: self.intrinsics_px })
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
