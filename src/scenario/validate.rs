//! From the keys of a file to values that can be relied on.

use std::{collections::BTreeMap, ops::Range};

use nalgebra::{Point3, UnitVector3, Vector3};
use toml::Spanned;

use super::{
    Filter, InitialError, LearnerSpec, PolicyKind, Prior, Recording, Robot, Scenario, SelectionSpec, WorldSpec,
    error::{Problem, ScenarioError, similar},
    raw,
};
use crate::{
    estimation::StabilisingNoise,
    experiment::Thresholds,
    kinematics::{Chain, Joint, JointKind, Line, TangentLayout},
    optimize::{Settings, Variant},
    selection::CriterionUnits,
};

/// How far from 1 the length of an axis may be: what is lost by writing six digits.
const UNIT_TOLERANCE: f64 = 1e-5;

impl Scenario {
    /// Reads a scenario from `text`. `file` is how errors name it; `open` returns the text of a data file that the
    /// scenario names, or says why it cannot.
    pub fn parse(file: &str, text: &str, open: &dyn Fn(&str) -> Result<String, String>) -> Result<Self, ScenarioError> {
        let invalid = |problems| ScenarioError::Invalid { file: file.to_owned(), problems };
        let raw = raw::read(text).map_err(|problem| invalid(vec![problem]))?;
        let mut check = Check { text, data: None, problems: Vec::new() };
        let scenario = check.scenario(&raw, open);
        match scenario {
            Some(scenario) if check.problems.is_empty() => Ok(scenario),
            _ => Err(invalid(check.problems)),
        }
    }
}

/// Collects problems while it converts. A value that cannot be converted is `None` and has left a problem behind.
struct Check<'a> {
    text: &'a str,
    data: Option<(String, String)>,
    problems: Vec<Problem>,
}

impl Check<'_> {
    fn problem(
        &mut self,
        span: Range<usize>,
        key: impl Into<String>,
        what: impl Into<String>,
        mend: impl Into<String>,
    ) {
        let line = raw::line_of(self.text, span.start);
        self.problems.push(Problem { line, key: key.into(), what: what.into(), mend: mend.into() });
    }

    /// A number that satisfies `holds`; NaN satisfies nothing.
    fn number(&mut self, key: &str, value: &Spanned<f64>, holds: impl Fn(f64) -> bool, mend: &str) -> f64 {
        let number = *value.get_ref();
        if !number.is_finite() || !holds(number) {
            self.problem(value.span(), key, format!("{number} is out of range"), format!("write {mend}"));
        }
        number
    }

    fn positive(&mut self, key: &str, value: &Spanned<f64>) -> f64 {
        self.number(key, value, |number| number > 0.0, "a number above 0")
    }

    fn not_negative(&mut self, key: &str, value: &Spanned<f64>) -> f64 {
        self.number(key, value, |number| number >= 0.0, "a number that is 0 or more")
    }

    fn at_least_one(&mut self, key: &str, value: &Spanned<u64>) -> u64 {
        if *value.get_ref() == 0 {
            self.problem(value.span(), key, "0 is out of range", "write a whole number of at least 1");
        }
        *value.get_ref()
    }

    fn point(&mut self, key: &str, value: &Spanned<[f64; 3]>) -> Point3<f64> {
        if !value.get_ref().iter().all(|x| x.is_finite()) {
            self.problem(value.span(), key, "a coordinate is not finite", "write three finite numbers, in metres");
        }
        Point3::from(*value.get_ref())
    }

    fn scenario(&mut self, raw: &raw::Scenario, open: &dyn Fn(&str) -> Result<String, String>) -> Option<Scenario> {
        let name = raw.name.get_ref();
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)) {
            let mend = "use letters, digits, '-', '_' and '.'; the name becomes part of file names and addresses";
            self.problem(raw.name.span(), "name", format!("{name:?} cannot be a name"), mend);
        }
        let robot = self.robot(&raw.robot)?;
        let world = self.world(raw, open);
        let learners = self.learners(&raw.learners);
        Some(Scenario {
            name: name.clone(),
            title: raw.title.clone(),
            steps: self.at_least_one("steps", &raw.steps),
            prior: self.prior(raw),
            filter: self.filter(&raw.filter),
            gradient_rate: self.positive("gradient.rate", &raw.gradient.rate),
            selection: self.selection(&raw.selection),
            thresholds: Thresholds {
                orientation_deg: self.positive("thresholds.orientation_deg", &raw.thresholds.orientation_deg),
                location_m: self.positive("thresholds.location_m", &raw.thresholds.location_m),
            },
            settled_below_m: self.positive("settled.expected_prediction_m", &raw.settled.expected_prediction_m),
            promises: self.promises(&raw.promises, &learners),
            learners,
            robot,
            world: world?,
            source: self.text.to_owned(),
            data: self.data.take(),
        })
    }

    fn robot(&mut self, raw: &raw::Robot) -> Option<Robot> {
        let marker = self.point("robot.marker_m", &raw.marker_m);
        let mut names: Vec<String> = Vec::new();
        let (mut joints, mut limits, mut learned) = (Vec::new(), Vec::new(), Vec::new());
        for (index, spanned) in raw.joints.get_ref().iter().enumerate() {
            let joint = spanned.get_ref();
            let name = joint.name.get_ref();
            let key = |field: &str| format!("robot.joint[{index}].{field}");
            if name.is_empty() || names.contains(name) {
                let mend = "give each joint a name of its own";
                self.problem(joint.name.span(), key("name"), format!("{name:?} is empty or taken"), mend);
            }
            names.push(name.clone());
            learned.push(joint.learned);
            joints.extend(self.joint(joint, spanned.span(), &key));
            limits.extend(self.limits(joint, spanned.span(), &key));
        }
        if names.is_empty() {
            self.problem(raw.joints.span(), "robot.joint", "there is no joint", "add a [[robot.joint]]");
        }
        let layout = TangentLayout::new(&joints, &learned, raw.learn_marker);
        if layout.dimension() == 0 {
            let mend = "set `learned = true` on a joint, or `learn_marker = true`";
            self.problem(raw.joints.span(), "robot.joint", "nothing is to be learned", mend);
        }
        let complete = joints.len() == names.len() && limits.len() == names.len() && !names.is_empty();
        complete.then_some(Robot { names, chain: Chain { joints, marker }, layout, limits })
    }

    fn joint(&mut self, raw: &raw::Joint, span: Range<usize>, key: &dyn Fn(&str) -> String) -> Option<Joint> {
        let axis = Vector3::from(*raw.axis.get_ref());
        let length = axis.norm();
        // A NaN fails this comparison as well.
        let is_unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
        if !is_unit {
            let mend = if length.is_finite() && length > 0.0 {
                let unit = axis / length;
                format!("write the unit vector [{:.6}, {:.6}, {:.6}]", unit.x, unit.y, unit.z)
            } else {
                "write a unit vector, such as [0.0, 0.0, 1.0]".to_owned()
            };
            self.problem(raw.axis.span(), key("axis"), format!("its length is {length}, not 1"), mend);
        }
        let direction = UnitVector3::new_normalize(axis);
        match (raw.kind, &raw.point_m) {
            (JointKind::Revolute, Some(point)) => {
                let point = self.point(&key("point_m"), point);
                is_unit.then_some(Joint::Revolute(Line { point, direction }))
            }
            (JointKind::Revolute, None) => {
                let mend = "add `point_m = [x, y, z]`, any point on the axis at θ = 0, in metres";
                self.problem(span, key("point_m"), "a revolute joint needs it", mend);
                None
            }
            (JointKind::Prismatic, None) => is_unit.then_some(Joint::Prismatic(direction)),
            (JointKind::Prismatic, Some(point)) => {
                self.problem(point.span(), key("point_m"), "a prismatic joint has only a direction", "remove it");
                None
            }
        }
    }

    fn limits(&mut self, raw: &raw::Joint, span: Range<usize>, key: &dyn Fn(&str) -> String) -> Option<(f64, f64)> {
        let (wanted, given, other, unit) = match raw.kind {
            JointKind::Revolute => ("limits_deg", &raw.limits_deg, &raw.limits_m, "degrees"),
            JointKind::Prismatic => ("limits_m", &raw.limits_m, &raw.limits_deg, "metres"),
        };
        if let Some(other) = other {
            let mend = format!("write `{wanted}`, in {unit}");
            self.problem(other.span(), key("limits"), "this unit does not fit the kind of joint", mend);
            return None;
        }
        let Some(given) = given else {
            let mend = format!("add `{wanted} = [lower, upper]`, in {unit}");
            self.problem(span, key(wanted), "missing", mend);
            return None;
        };
        let [lower, upper] = *given.get_ref();
        if !(lower.is_finite() && upper.is_finite()) {
            self.problem(given.span(), key(wanted), "a limit is not finite", format!("write two numbers, in {unit}"));
            return None;
        }
        if lower >= upper {
            let what = format!("the lower limit {lower} is not below the upper {upper}");
            let mend = if lower > upper {
                format!("write [{upper:?}, {lower:?}]")
            } else {
                "give the joint a range; a joint that cannot move teaches nothing".to_owned()
            };
            self.problem(given.span(), key(wanted), what, mend);
            return None;
        }
        Some(match raw.kind {
            JointKind::Revolute => (lower.to_radians(), upper.to_radians()),
            JointKind::Prismatic => (lower, upper),
        })
    }

    fn world(&mut self, raw: &raw::Scenario, open: &dyn Fn(&str) -> Result<String, String>) -> Option<WorldSpec> {
        match (&raw.sensor, &raw.initial_error, &raw.measurements) {
            (Some(sensor), Some(error), None) => {
                let marker_m = error.get_ref().marker_m.as_ref();
                if raw.robot.learn_marker && marker_m.is_none() {
                    let mend = "add `marker_m = …`, or set `learn_marker = false`";
                    self.problem(error.span(), "initial_error.marker_m", "the marker is learned", mend);
                }
                let error = error.get_ref();
                let angle = self.number(
                    "initial_error.angle_deg",
                    &error.angle_deg,
                    |angle| (0.0..=180.0).contains(&angle),
                    "an angle from 0 to 180 degrees",
                );
                Some(WorldSpec::Simulated {
                    sigma_m: self.not_negative("sensor.sigma_m", &sensor.get_ref().sigma_m),
                    initial_error: InitialError {
                        draw: error.draw,
                        angle_rad: angle.to_radians(),
                        point_m: self.not_negative("initial_error.point_m", &error.point_m),
                        marker_m: marker_m.map_or(0.0, |size| self.not_negative("initial_error.marker_m", size)),
                    },
                })
            }
            (None, None, Some(measurements)) => self.measured(raw, measurements.get_ref(), open),
            (sensor, error, measurements) => {
                let span = [sensor.as_ref().map(Spanned::span), error.as_ref().map(Spanned::span)]
                    .into_iter()
                    .chain([measurements.as_ref().map(Spanned::span)])
                    .flatten()
                    .next();
                let what = "a scenario is either simulated or measured";
                let mend = "write [sensor] and [initial_error] for a simulated world, or [measurements] alone for a \
                            measured one";
                self.problem(span.unwrap_or(0..0), "sensor, initial_error, measurements", what, mend);
                None
            }
        }
    }

    fn measured(
        &mut self,
        raw: &raw::Scenario,
        measurements: &raw::Measurements,
        open: &dyn Fn(&str) -> Result<String, String>,
    ) -> Option<WorldSpec> {
        let mut columns = Vec::new();
        for (index, joint) in raw.robot.joints.get_ref().iter().enumerate() {
            match &joint.get_ref().column {
                Some(column) => columns.push(column.get_ref().as_str()),
                None => {
                    let mend = "add `column = \"…\"`, the column of the data file with this joint's position";
                    self.problem(joint.span(), format!("robot.joint[{index}].column"), "missing", mend);
                }
            }
        }
        let file = measurements.file.get_ref();
        let text = match open(file) {
            Ok(text) => text,
            Err(error) => {
                let mend = "name a file beside the scenario that can be read";
                self.problem(measurements.file.span(), "measurements.file", format!("{file}: {error}"), mend);
                return None;
            }
        };
        if columns.len() < raw.robot.joints.get_ref().len() {
            return None;
        }
        let recording = match Recording::from_csv(&text, &columns, measurements.marker_columns_m.get_ref()) {
            Ok(recording) => recording,
            Err(error) => {
                let mend = "correct the data file or the names of its columns";
                self.problem(measurements.file.span(), "measurements.file", format!("{file} {error}"), mend);
                return None;
            }
        };
        let (rows, held_out) = (recording.markers_m.len(), *measurements.held_out.get_ref());
        // The rigid fit needs four rows at least.
        if held_out == 0 || held_out + 4 > rows {
            let what = format!("{held_out} of {rows} rows cannot be held out");
            let mend = format!("write a number from 1 to {}", rows.saturating_sub(4));
            self.problem(measurements.held_out.span(), "measurements.held_out", what, mend);
            return None;
        }
        self.data = Some((file.clone(), text));
        Some(WorldSpec::Measured { recording, held_out })
    }

    fn prior(&mut self, raw: &raw::Scenario) -> Prior {
        let prior = raw.prior.get_ref();
        if raw.robot.learn_marker && prior.marker_m.is_none() {
            let mend = "add `marker_m = …`, its standard deviation in metres";
            self.problem(raw.prior.span(), "prior.marker_m", "the marker is learned", mend);
        }
        Prior {
            direction_rad: self.positive("prior.direction_rad", &prior.direction_rad),
            point_m: self.positive("prior.point_m", &prior.point_m),
            marker_m: prior.marker_m.as_ref().map_or(1.0, |sd| self.positive("prior.marker_m", sd)),
        }
    }

    fn filter(&mut self, raw: &raw::Filter) -> Filter {
        let stabilising = raw.stabilising_noise.as_ref().map(|noise| StabilisingNoise {
            variance: self.not_negative("filter.stabilising_noise.variance", &noise.variance),
            first_step: self.at_least_one("filter.stabilising_noise.first_step", &noise.first_step),
            every: self.at_least_one("filter.stabilising_noise.every", &noise.every),
        });
        let noise_m2 = self.positive("filter.measurement_variance_m2", &raw.measurement_variance_m2);
        Filter { noise_m2, stabilising }
    }

    fn selection(&mut self, raw: &raw::Selection) -> SelectionSpec {
        let units = match (raw.units, &raw.characteristic_length_m) {
            (raw::Units::CharacteristicLength, None) => CriterionUnits::CharacteristicLength(1.0),
            (raw::Units::CharacteristicLength, Some(length)) => {
                CriterionUnits::CharacteristicLength(self.positive("selection.characteristic_length_m", length))
            }
            (raw::Units::Prior, None) => CriterionUnits::Prior,
            (raw::Units::Prior, Some(length)) => {
                let mend = "remove it, or set `units = \"characteristic_length\"`";
                self.problem(length.span(), "selection.characteristic_length_m", "units are the prior's", mend);
                CriterionUnits::Prior
            }
        };
        let evaluations = &raw.evaluations;
        if !(1..=100_000).contains(evaluations.get_ref()) {
            let what = format!("{} is out of range", evaluations.get_ref());
            self.problem(evaluations.span(), "selection.evaluations", what, "write a number from 1 to 100000");
        }
        let search = Settings {
            variant: match raw.variant {
                raw::DirectVariant::Direct => Variant::Original,
                raw::DirectVariant::DirectL => Variant::LocallyBiased,
            },
            epsilon: self.not_negative("selection.epsilon", &raw.epsilon),
            max_evaluations: *evaluations.get_ref(),
        };
        SelectionSpec { search, units }
    }

    fn learners(&mut self, raw: &Spanned<Vec<raw::Learner>>) -> Vec<LearnerSpec> {
        let mut learners: Vec<LearnerSpec> = Vec::new();
        for (index, learner) in raw.get_ref().iter().enumerate() {
            let (name, policy) = (learner.name.get_ref(), *learner.policy.get_ref());
            let key = format!("learner[{index}]");
            if learners.iter().any(|other| other.name == *name) || RESERVED.contains(&name.as_str()) || !is_plain(name)
            {
                let what = format!("{name:?} is taken, reserved or not a plain word");
                let mend = "give each learner a name of its own, of letters, digits, '-' and '_'";
                self.problem(learner.name.span(), format!("{key}.name"), what, mend);
            }
            if policy == PolicyKind::Active && !learner.estimator.keeps_covariance() {
                let what = format!("`{}` keeps no covariance to choose by", learner.estimator.name());
                let mend = "write `policy = \"random\"`, or another estimator";
                self.problem(learner.policy.span(), format!("{key}.policy"), what, mend);
            }
            learners.push(LearnerSpec { name: name.clone(), estimator: learner.estimator, policy });
        }
        if learners.is_empty() {
            self.problem(raw.span(), "learner", "there is no learner", "add a [[learner]]");
        }
        learners
    }

    fn promises(
        &mut self,
        raw: &BTreeMap<Spanned<String>, Spanned<u64>>,
        learners: &[LearnerSpec],
    ) -> BTreeMap<String, u64> {
        let mut promises = BTreeMap::new();
        for (name, promise) in raw {
            let names = || learners.iter().map(|learner| learner.name.as_str());
            if !names().any(|known| known == name.get_ref()) {
                let mend = match similar(name.get_ref(), names()) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => format!("name one of {}", names().collect::<Vec<_>>().join(", ")),
                };
                let key = format!("promises.{}", name.get_ref());
                self.problem(name.span(), key, "there is no such learner", mend);
            }
            promises.insert(name.get_ref().clone(), *promise.get_ref());
        }
        promises
    }
}

/// Names that recordings use for something else.
const RESERVED: [&str; 1] = ["world"];

fn is_plain(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c))
}
