//! The keys of a sensor in a scenario.

use nalgebra::{DMatrix, Point3};
use serde::{Deserialize, Serialize};

use super::{Facing, NoiseModel, PartlySeen};
use crate::{
    model::Hand,
    numeric_range::{are_usable, is_not_negative},
};

/// The keys of a sensor. A channel takes those that it knows and refuses the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keys {
    /// The channel's name; `position` unless stated otherwise.
    pub channel: Option<String>,
    /// The name of the target that is measured; the first unless told otherwise.
    pub target: Option<String>,
    /// The name of the camera that measures; the first unless told otherwise.
    pub camera: Option<String>,
    /// Standard deviation of the noise per coordinate, metres.
    pub sigma_m: Option<f64>,
    /// Standard deviation of the noise of a rotation, degrees per axis.
    pub sigma_deg: Option<f64>,
    /// Standard deviation of the noise per coordinate, pixels.
    pub sigma_px: Option<f64>,
    /// The covariance of the noise of a position, 3 × 3, m².
    pub covariance_m2: Option<Vec<Vec<f64>>>,
    /// The covariance of the noise of a pose, 6 × 6: position before rotation vector, m², m rad and rad².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Vec<Vec<f64>>>,
    /// Where recorded measurements are a table, the titles of its columns, unless they begin with the target's name.
    pub columns: Option<Vec<String>>,
    /// A fixed point in the frame of the measurements, three coordinates in metres.
    pub to_m: Option<Vec<f64>>,
    /// The name of the camera or target in whose frame a target is measured; without it that is the frame of the measurements.
    #[serde(rename = "in", default, skip_serializing_if = "Option::is_none")]
    pub seen_in: Option<String>,
    /// The name of the target from which a distance is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
}

/// What sensors can name: targets and cameras, in the order of the [`State`](crate::model::State) they belong to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Equipment {
    /// The targets that can be measured.
    pub targets: Vec<TargetKind>,
    /// The cameras that can measure.
    pub cameras: Vec<CameraKind>,
}

impl Equipment {
    /// The name of a target or a camera.
    pub fn name(&self, of: Hand) -> Option<&str> {
        match of {
            Hand::Target(target) => self.targets.get(target).map(|target| target.name.as_str()),
            Hand::Device(camera) => self.cameras.get(camera).map(|camera| camera.name.as_str()),
        }
    }
}

/// What is known of a target besides its place.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetKind {
    /// Its name.
    pub name: String,
    /// The known points of a rigid body in its own frame, metres; the origin alone for a point.
    pub points: Vec<Point3<f64>>,
    /// The directions from which it can be seen; any if absent.
    pub facing: Option<Facing>,
    /// How it is seen in pictures point by point; `None` where it is seen whole or not at all.
    pub partly_seen: Option<PartlySeen>,
}

/// What is known of a camera besides its place and its lens.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraKind {
    /// Its name.
    pub name: String,
    /// Width and height of its picture, pixels.
    pub size_px: [f64; 2],
}

/// A sensor key that is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}`: {what}")]
pub struct KeyError {
    /// The key.
    pub key: String,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

impl KeyError {
    pub(super) fn new(key: &str, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { key: key.to_owned(), what: what.into(), hint: hint.into() }
    }
}

impl Keys {
    pub(super) fn sigma_m(&self) -> Result<f64, KeyError> {
        sigma("sigma_m", self.sigma_m, "metres", 100.0)
    }

    /// Radians.
    pub(super) fn sigma_rad(&self) -> Result<f64, KeyError> {
        sigma("sigma_deg", self.sigma_deg, "degrees", 180.0).map(f64::to_radians)
    }

    pub(super) fn sigma_px(&self) -> Result<f64, KeyError> {
        sigma("sigma_px", self.sigma_px, "pixels", 1e4)
    }

    pub(super) fn to_m(&self) -> Result<Point3<f64>, KeyError> {
        let given = self.to_m.as_deref().unwrap_or_default();
        let is_point = given.len() == 3 && are_usable(given);
        let what = self.to_m.as_ref().map_or("missing".to_owned(), |given| format!("{given:?} is no point"));
        let hint = "write `to_m = [x, y, z]`, in metres, in the frame of the measurements";
        is_point.then(|| Point3::from_slice(given)).ok_or_else(|| KeyError::new("to_m", what, hint))
    }

    /// The noise of the full covariance of a position, if there is one.
    pub(super) fn covariance_m2(&self) -> Result<Option<NoiseModel>, KeyError> {
        let hint = "write three rows of three numbers, symmetric and positive, in square metres";
        full("covariance_m2", self.covariance_m2.as_deref(), 3, hint, &[("sigma_m", self.sigma_m)])
    }

    /// The noise of the full covariance of a pose, if there is one.
    pub(super) fn covariance(&self) -> Result<Option<NoiseModel>, KeyError> {
        let hint = "write six rows of six numbers, symmetric and positive: x, y, z in metres, then the rotation vector in radians";
        let sigmas = [("sigma_m", self.sigma_m), ("sigma_deg", self.sigma_deg)];
        full("covariance", self.covariance.as_deref(), 6, hint, &sigmas)
    }

    /// The target that the keys name, with what is known of it.
    pub(super) fn target<'a>(&self, equipment: &'a Equipment) -> Result<(usize, &'a TargetKind), KeyError> {
        let names = equipment.targets.iter().map(|target| target.name.as_str());
        let index = named("target", self.target.as_deref(), names)?;
        Ok((index, &equipment.targets[index]))
    }

    /// The camera that the keys name, with what is known of it.
    pub(super) fn camera<'a>(&self, equipment: &'a Equipment) -> Result<(usize, &'a CameraKind), KeyError> {
        let names = equipment.cameras.iter().map(|camera| camera.name.as_str());
        let index = named("camera", self.camera.as_deref(), names)?;
        Ok((index, &equipment.cameras[index]))
    }

    /// The camera or target that `in` names.
    pub(super) fn seen_from(&self, equipment: &Equipment) -> Result<Option<Hand>, KeyError> {
        let Some(name) = &self.seen_in else { return Ok(None) };
        let camera = equipment.cameras.iter().position(|camera| camera.name == *name).map(Hand::Device);
        let found =
            camera.or_else(|| equipment.targets.iter().position(|target| target.name == *name).map(Hand::Target));
        found.map(Some).ok_or_else(|| {
            let cameras = equipment.cameras.iter().map(|camera| camera.name.as_str());
            let known: Vec<&str> = cameras.chain(equipment.targets.iter().map(|target| target.name.as_str())).collect();
            let hint = format!("write one of {}; leave `in` out for the frame of the measurements", known.join(", "));
            KeyError::new("in", format!("there is no camera or target `{name}`"), hint)
        })
    }

    /// The part of the robot from which a target is measured: the camera that pictures it or tells its depth, or what `in` or `to` names.
    /// `None` for the frame of the measurements, and where there is no such part.
    pub fn observer(&self, equipment: &Equipment) -> Option<Hand> {
        match (self.channel.as_deref(), &self.seen_in) {
            (Some("pixels"), _) | (Some("depth"), None) => Some(Hand::Device(self.camera(equipment).ok()?.0)),
            _ => self.seen_from(equipment).ok()?.or(self.to(equipment).ok()?.map(Hand::Target)),
        }
    }

    /// The target that `to` names.
    pub(super) fn to(&self, equipment: &Equipment) -> Result<Option<usize>, KeyError> {
        let names = equipment.targets.iter().map(|target| target.name.as_str());
        self.to.as_deref().map(|name| named("to", Some(name), names)).transpose()
    }

    /// Refuses keys that a channel has no use for.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), KeyError> {
        let given = serde_json::to_value(self).unwrap_or_default();
        let given = given.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
        let unknown = given
            .map(|(key, _)| key)
            .find(|key| !["channel", "columns"].contains(&key.as_str()) && !known.contains(&key.as_str()));
        unknown.map_or(Ok(()), |key| {
            let hint = format!("remove it; the keys here are {}", known.join(", "));
            Err(KeyError::new(key, "this channel has no use for it", hint))
        })
    }
}

/// The noise of a covariance of `size` rows, beside which no σ stands.
fn full(
    key: &str,
    given: Option<&[Vec<f64>]>,
    size: usize,
    hint: &str,
    sigmas: &[(&str, Option<f64>)],
) -> Result<Option<NoiseModel>, KeyError> {
    let Some(given) = given else { return Ok(None) };
    let matrix = square(key, given, size, hint)?;
    if let Some((sigma, _)) = sigmas.iter().find(|(_, given)| given.is_some()) {
        let what = "the covariance says how much noise there is";
        return Err(KeyError::new(sigma, what, format!("remove `{sigma}` or `{key}`")));
    }
    let error = || KeyError::new(key, "it is not positive", "write a symmetric, positive matrix");
    NoiseModel::covariance(&matrix).map(Some).ok_or_else(error)
}

/// A symmetric matrix of `size` rows.
fn square(key: &str, given: &[Vec<f64>], size: usize, hint: &str) -> Result<DMatrix<f64>, KeyError> {
    if given.len() != size || given.iter().any(|row| row.len() != size) {
        return Err(KeyError::new(key, format!("it is not {size} × {size}"), hint));
    }
    let matrix = DMatrix::from_fn(size, size, |row, column| given[row][column]);
    let is_symmetric = are_usable(&matrix) && (&matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
    if is_symmetric { Ok(matrix) } else { Err(KeyError::new(key, "it is not symmetric", hint)) }
}

/// A standard deviation up to `most`, beyond which a sensor would tell nothing.
fn sigma(key: &str, given: Option<f64>, unit: &str, most: f64) -> Result<f64, KeyError> {
    let sigma = given.ok_or_else(|| KeyError::new(key, "missing", format!("add `{key} = …`, in {unit}")))?;
    let holds = is_not_negative(sigma) && sigma <= most;
    let error = || {
        let hint = format!("write a number of {unit} from 0 to {most}");
        KeyError::new(key, format!("{sigma} is out of range"), hint)
    };
    holds.then_some(sigma).ok_or_else(error)
}

/// The index of the named thing; of the first if no name is given.
fn named<'a>(key: &str, name: Option<&str>, names: impl Iterator<Item = &'a str> + Clone) -> Result<usize, KeyError> {
    let found = match name {
        Some(name) => names.clone().position(|known| known == name),
        None => names.clone().next().map(|_| 0),
    };
    found.ok_or_else(|| {
        let known: Vec<&str> = names.collect();
        match (name, known.is_empty()) {
            (_, true) => KeyError::new(key, format!("there is no {key}"), format!("add a `[[{key}]]`")),
            (Some(name), false) => {
                KeyError::new(key, format!("there is no {key} `{name}`"), format!("write one of {}", known.join(", ")))
            }
            (None, false) => KeyError::new(key, "missing", format!("write one of {}", known.join(", "))),
        }
    })
}
