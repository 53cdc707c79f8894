//! The summary of a scenario, for choosing among scenarios.

use serde::{Deserialize, Serialize};

use super::{Knob, LearnerSpec, Scenario, WorldKind, WorldSpec};
use body_schema_experiment::{JointSetting, SocketSetting};
use body_schema_wire::{JointDescription, LearnerDescription, Thresholds};

/// A scenario in brief.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ScenarioSummary {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub title: String,
    /// Simulated or measured.
    pub world: WorldKind,
    /// The joints, base first.
    pub joints: Vec<JointDescription>,
    /// Number of learned parameters in tangent coordinates.
    pub parameters: usize,
    /// The steps of a run, unless stated otherwise.
    pub steps: u64,
    /// The learners that it offers.
    pub learners: Vec<LearnerDescription>,
    /// The other learners that can be compared: every estimator with every policy that fits it, by names such as
    /// `smoother:random`.
    pub compositions: Vec<LearnerDescription>,
    /// The learners that a page compares unless stated otherwise: those of `active`, `random` and `global` that it has, or
    /// else its defaults. With measured data also the yardstick `nominal`, which leaves the axes as they are described.
    pub explorer: Vec<String>,
    /// The thresholds of `converged_at`.
    pub thresholds: Thresholds,
    /// What is instructive to turn in it.
    #[serde(default)]
    pub knobs: Vec<Knob>,
}

/// The learners that are most instructive side by side, in the order in which a page shows them.
const SHOWN: [&str; 3] = ["active", "random", "global"];
/// The yardstick of measured data.
const YARDSTICK: &str = "nominal";

impl ScenarioSummary {
    /// Every learner that can be compared, the scenario's own first.
    pub fn offered(&self) -> impl Iterator<Item = &LearnerDescription> {
        self.learners.iter().chain(&self.compositions)
    }
}

impl Scenario {
    /// The scenario in brief.
    pub fn summary(&self) -> ScenarioSummary {
        ScenarioSummary {
            name: self.name.clone(),
            title: self.title.clone(),
            world: self.world.kind(),
            joints: self.robot.joint_descriptions(),
            parameters: self.robot.layout.dimension(),
            steps: self.steps,
            learners: self.learners.iter().map(|spec| self.learner_description(spec)).collect(),
            compositions: self.compositions().iter().map(|spec| self.learner_description(spec)).collect(),
            explorer: self.explorer(),
            thresholds: self.thresholds.into(),
            knobs: self.knobs(),
        }
    }

    /// A learner as reports describe it.
    pub fn learner_description(&self, spec: &LearnerSpec) -> LearnerDescription {
        LearnerDescription::from(&self.learner_setting(spec))
    }

    /// See [`ScenarioSummary::explorer`].
    fn explorer(&self) -> Vec<String> {
        let named = |name: &&str| self.learners.iter().any(|spec| spec.name == **name);
        let shown: Vec<String> = SHOWN.iter().filter(|name| named(name)).map(|name| (*name).to_owned()).collect();
        let is_measured = matches!(self.world, WorldSpec::Measured { .. });
        let yardstick = Some(YARDSTICK).filter(|name| is_measured && named(name)).map(str::to_owned);
        if !shown.is_empty() {
            return shown.into_iter().chain(yardstick).collect();
        }
        self.learners.iter().filter(|spec| spec.by_default).map(|spec| spec.name.clone()).collect()
    }
}

impl super::Robot {
    /// The sockets, and where a known truth has them.
    pub(crate) fn socket_settings(&self, is_true: bool) -> Vec<SocketSetting> {
        let of = |socket: &super::SocketSpec, held_out| SocketSetting {
            name: socket.name.clone(),
            place: socket.place.clone(),
            at: is_true.then_some(socket.at),
            held_out,
        };
        let learned = self.sockets.iter().map(|socket| of(socket, false));
        learned.chain(self.held_out_sockets.iter().map(|socket| of(socket, true))).collect()
    }

    /// The descriptions of the joints for the page and recordings.
    pub fn joint_descriptions(&self) -> Vec<JointDescription> {
        self.joint_settings().iter().map(JointDescription::from).collect()
    }

    /// The joints as experiments know them.
    pub(crate) fn joint_settings(&self) -> Vec<JointSetting> {
        (self.names.iter().zip(&self.state.joints).zip(self.limits.joints()).enumerate())
            .map(|(index, ((name, joint), &(lower, upper)))| JointSetting {
                name: name.clone(),
                kind: joint.kind(),
                learned: self.layout.is_learned(index),
                limits: [lower, upper],
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Scenario, builtin};

    /// As a session of theirs describes them.
    #[test]
    fn learners_are_described_as_they_learn() {
        let outliers = builtin("arm-6dof-outliers").unwrap().summary();
        let of = |name: &str| outliers.offered().find(|learner| learner.name == name).expect("offered");
        assert!(of("global").robust && !of("global").stabilised);
        let (plain, stabilised) = (builtin("tiago-mocap").unwrap(), builtin("arm-6dof").unwrap());
        assert_eq!(plain.summary().learners[0].stabilised, plain.filter.stabilising.is_some());
        assert_eq!(stabilised.summary().learners[0].stabilised, stabilised.filter.stabilising.is_some());
    }

    #[test]
    fn a_page_compares_what_tells_most() {
        for (name, shown) in
            [("arm-6dof", &["active", "random", "global"][..]), ("arm-6dof-selectors", &["active", "random"])]
        {
            assert_eq!(builtin(name).unwrap().summary().explorer, shown, "{name}");
        }
        // Whatever is measured is held against the robot as it is described.
        for scenario in crate::BUILTIN.iter().map(|built| builtin(built.name).unwrap().summary()) {
            let is_measured = scenario.world == super::WorldKind::Measured;
            let last = scenario.explorer.last().map(String::as_str);
            assert_eq!(last == Some("nominal"), is_measured, "{}: {:?}", scenario.name, scenario.explorer);
        }
        // Under other names the defaults are all there is to go by.
        let renamed = builtin("arm-6dof").unwrap();
        let text = ["active", "random", "global"].iter().fold(renamed.source, |text, name| {
            text.replace(&format!("name = \"{name}\""), &format!("name = \"my-{name}\""))
        });
        let text = text.split("[promises]").next().unwrap();
        let scenario = Scenario::parse("renamed.toml", text, &|_| Err("has no data".to_owned())).unwrap();
        assert_eq!(scenario.summary().explorer, ["my-active", "my-random", "gradient"]);
    }
}
