//! What the joints of a reported chain bear.

use nalgebra::{UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::array;
use body_schema_engine::{
    kinematics::{Joint, Line, Tree},
    model::{Load, Loads, Mass},
};

/// The robot as it is described, by whose postures gravity pulls, and the masses of 1 kg at which it does. The torque about joint
/// i is −9.81 ∂h/∂qᵢ with h the height of a mass along `up`; all in the frame of the robot's base at θ = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LoadsReport {
    /// Away from the ground.
    pub up: [f64; 3],
    /// The axes, base first.
    pub axes: Vec<AxisReport>,
    /// The masses at the target and at the elbow.
    pub masses: Vec<MassReport>,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AxisReport {
    /// Its unit direction.
    pub axis: [f64; 3],
    /// A point on it, metres; null for a prismatic joint.
    pub point_m: Option<[f64; 3]>,
}

/// A mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MassReport {
    /// The link that carries it: 0 is the base, i what moves with the i-th joint.
    pub link: usize,
    /// Its place, metres.
    pub position_m: [f64; 3],
}

impl LoadsReport {
    pub(super) fn of(loads: &Loads) -> Self {
        let axis = |joint: &Joint| AxisReport {
            axis: array(&joint.direction()),
            point_m: joint.line().map(|line| array(&line.point.coords)),
        };
        let mass = |mass: &Mass| MassReport { link: mass.link, position_m: array(&mass.place.coords) };
        Self {
            up: array(&loads.up),
            axes: loads.joints.iter().map(axis).collect(),
            masses: loads.masses.iter().map(mass).collect(),
        }
    }

    /// `None` if a number in it is not finite, or it is not of `joints` joints.
    pub(super) fn loads(&self, joints: usize) -> Option<Loads> {
        let vector = |numbers: [f64; 3]| Some(Vector3::from(numbers)).filter(|v| v.iter().all(|x| x.is_finite()));
        let unit = |numbers| UnitVector3::try_new(vector(numbers)?, 0.0);
        let joint = |report: &AxisReport| {
            let direction = unit(report.axis)?;
            Some(match report.point_m {
                Some(point) => Joint::Revolute(Line { point: vector(point)?.into(), direction }),
                None => Joint::Prismatic(direction),
            })
        };
        let mass = |load: Load| {
            let report = self.masses.get(load as usize).filter(|report| report.link <= joints)?;
            Some(Mass { link: report.link, place: vector(report.position_m)?.into() })
        };
        let axes = self.axes.iter().map(joint).collect::<Option<Vec<_>>>().filter(|axes| axes.len() == joints)?;
        let masses = [mass(Load::Target)?, mass(Load::Elbow)?];
        Some(Loads { joints: axes, tree: Tree::default(), up: unit(self.up)?, masses })
    }
}
