//! The check of which learners fit a scenario, with reasons.

use super::{EstimatorKind, PolicyKind, Robot, WorldKind};
use body_schema_engine::{model::Block, sensing::MeasurementModel};

/// The properties of a scenario that decide which learners fit it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    /// Whether the marker is learned.
    pub learns_marker: bool,
    /// Whether axes are all that is learned.
    pub learns_axes_alone: bool,
    /// Whether recorded rows are replayed.
    pub is_measured: bool,
    /// Whether the robot is elsewhere and asks where to move.
    pub is_external: bool,
    /// Whether targets are held in sockets.
    pub has_sockets: bool,
    /// Whether nothing but the marker's position is measured.
    pub sees_markers_alone: bool,
}

impl Setting {
    /// The setting of a robot whose sensors are known, unless they are wrong themselves.
    pub(super) fn of(robot: &Robot, measurement_model: Option<&MeasurementModel>, world: WorldKind) -> Self {
        let mut sensors = measurement_model.into_iter().flat_map(MeasurementModel::sensors);
        Self {
            learns_marker: robot.layout.marker().is_some(),
            learns_axes_alone: robot.layout.blocks().all(|(block, _)| matches!(block, Block::Axis(_))),
            is_measured: world == WorldKind::Measured,
            is_external: world == WorldKind::External,
            has_sockets: !robot.sockets.is_empty(),
            sees_markers_alone: sensors.all(|sensor| sensor.subject().point() == Some(0)),
        }
    }
}

/// The part of a learner that does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Estimator,
    Policy,
}

/// The reason why an estimator cannot learn by a policy, or not in this scenario.
#[derive(Clone, Debug)]
pub(super) struct Misfit {
    pub fault: Fault,
    pub what: String,
    /// The pair with the fault corrected.
    pub instead: (EstimatorKind, PolicyKind),
}

/// The misfit of an estimator and a policy in such a scenario, if there is one.
pub(super) fn misfit(estimator: EstimatorKind, policy: PolicyKind, setting: Setting) -> Option<Misfit> {
    if policy != PolicyKind::Random && !estimator.keeps_covariance() {
        let what = format!("`{}` keeps no covariance to choose by", estimator.name());
        return Some(Misfit { fault: Fault::Policy, what, instead: (estimator, PolicyKind::Random) });
    }
    if estimator == EstimatorKind::OverparameterisedRls && setting.learns_marker {
        let what = "six numbers per joint leave no place for a learned marker".to_owned();
        return Some(Misfit { fault: Fault::Estimator, what, instead: (EstimatorKind::Rls, policy) });
    }
    if estimator == EstimatorKind::OverparameterisedRls && !setting.sees_markers_alone {
        let what = "six numbers per joint read nothing but the marker's position".to_owned();
        return Some(Misfit { fault: Fault::Estimator, what, instead: (EstimatorKind::Rls, policy) });
    }
    if setting.is_measured && policy == PolicyKind::Human {
        let what = "nobody moves a robot of which there are only recorded rows".to_owned();
        return Some(Misfit { fault: Fault::Policy, what, instead: (estimator, PolicyKind::Active) });
    }
    if setting.is_external && policy == PolicyKind::Human {
        let what = "a robot elsewhere asks where to move, and a person does not answer".to_owned();
        return Some(Misfit { fault: Fault::Policy, what, instead: (estimator, PolicyKind::Active) });
    }
    if setting.has_sockets && policy.varies_the_search() {
        let what =
            format!("`{}` searches the joint box, and sockets leave a part of it without a volume", policy.name());
        return Some(Misfit { fault: Fault::Policy, what, instead: (estimator, PolicyKind::Active) });
    }
    if setting.is_measured && policy.varies_the_search() {
        let what = format!("over recorded rows `{}` has nothing to search: every row is tried", policy.name());
        return Some(Misfit { fault: Fault::Policy, what, instead: (estimator, PolicyKind::Active) });
    }
    None
}
