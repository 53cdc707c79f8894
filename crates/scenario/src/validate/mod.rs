//! Validation: from the keys of a file to values that can be relied on.

mod body;
mod change;
mod completed;
mod constraints;
mod described;
mod equipment;
mod external;
mod gravity;
mod head;
mod held_out;
mod learners;
mod lens;
mod measured;
mod readings;
mod recorded_sockets;
mod shapes;
mod sockets;
mod unread;
mod world;

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use nalgebra::{Point3, UnitVector3, Vector3};
use toml::Spanned;

use super::{
    EstimatorKind, Filter, Known, LearnerSpec, Prior, Robot, Scenario, SelectionSpec, SmootherSpec, WorldKind,
    error::{Problem, ScenarioError},
    misfit::Setting,
    raw,
};
use body_schema_engine::{
    estimation::{HypothesisSettings, StabilisingNoise},
    kinematics::JointKind,
    model::Block,
    numeric_range::{are_usable, is_not_negative, is_positive, is_usable},
    optimize::{Settings, Variant},
    selection::{CriterionUnits, Planning},
    sensing::{Loss, MeasurementModel},
};
use body_schema_experiment::Thresholds;

/// The torque, N·m, under which a joint's default prior compliance equals the tilt of an axis: 1 kg half a metre out.
const USUAL_TORQUE: f64 = 5.0;
/// The default prior deviations of the zeros of a described robot's joints: 3 degrees, and 5 mm.
const USUAL_ZERO_RAD: f64 = 0.05;
const USUAL_ZERO_M: f64 = 0.005;

/// The most hypotheses, and the most planned movements.
const MOST_HYPOTHESES: u64 = 1000;
const MOST_PLANNED: u64 = 100;

/// How far from 1 the length of an axis may be: what is lost by writing six digits.
const UNIT_TOLERANCE: f64 = 1e-5;

impl Scenario {
    /// Reads a scenario from `text`. `file` is its name in errors; `open` returns the text of a data file that the
    /// scenario names, or the reason why it cannot.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Invalid`] with every problem found: text that is no TOML, an unknown or missing key, a value
    /// out of range, a data file that cannot be read.
    pub fn parse(file: &str, text: &str, open: &dyn Fn(&str) -> Result<String, String>) -> Result<Self, ScenarioError> {
        Self::parse_as(raw::Source::File, file, text, open)
    }

    /// Reads the description of a robot elsewhere, in the keys of a file that replays a table, but without one.
    ///
    /// # Errors
    ///
    /// [`ScenarioError::Invalid`] with every problem found, as for [`parse`](Self::parse), and if the text names a
    /// table or a simulated world.
    pub fn parse_outside(
        file: &str,
        text: &str,
        open: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, ScenarioError> {
        Self::parse_as(raw::Source::External, file, text, open)
    }

    fn parse_as(
        source: raw::Source,
        file: &str,
        text: &str,
        open: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, ScenarioError> {
        let invalid = |problems| ScenarioError::Invalid { file: file.to_owned(), problems };
        let mut raw = raw::read(text, source).map_err(|problem| invalid(vec![problem]))?;
        let mut check =
            Check { text, open, is_external: source == raw::Source::External, data: Vec::new(), problems: Vec::new() };
        check.first_joints(&mut raw);
        check.first_targets(&mut raw);
        let scenario = check.scenario(raw);
        match scenario {
            Some(scenario) if check.problems.is_empty() => Ok(scenario),
            _ => Err(invalid(check.problems)),
        }
    }
}

/// The default σ of filters, as a multiple of the first sensor's: a chain has errors that no axis explains.
const FILTER_SIGMAS: f64 = 2.0;

/// A converter that collects problems. A value that cannot be converted is `None`, and has left a problem behind.
struct Check<'a> {
    text: &'a str,
    open: &'a dyn Fn(&str) -> Result<String, String>,
    /// Whether the text describes a robot elsewhere.
    is_external: bool,
    data: Vec<(String, String)>,
    problems: Vec<Problem>,
}

impl Check<'_> {
    /// The text of a file that the scenario names, or the reason why there is none.
    fn opened(&mut self, file: &str) -> Result<String, String> {
        if let Some((_, text)) = self.data.iter().find(|(name, _)| name == file) {
            return Ok(text.clone());
        }
        let text = (self.open)(file)?;
        self.data.push((file.to_owned(), text.clone()));
        Ok(text)
    }

    fn problem(
        &mut self,
        span: Range<usize>,
        key: impl Into<String>,
        what: impl Into<String>,
        hint: impl Into<String>,
    ) {
        let line = raw::line_of(self.text, span.start);
        self.problems.push(Problem { line, key: key.into(), what: what.into(), hint: hint.into() });
    }

    /// A number that satisfies `holds`; NaN never does.
    fn number(&mut self, key: &str, value: &Spanned<f64>, holds: impl Fn(f64) -> bool, hint: &str) -> f64 {
        let number = *value.get_ref();
        if !is_usable(number) || !holds(number) {
            self.problem(value.span(), key, format!("{number} is out of range"), format!("write {hint}"));
        }
        number
    }

    fn positive(&mut self, key: &str, value: &Spanned<f64>) -> f64 {
        self.number(key, value, is_positive, "a number above 0, from 1e-18 to 1e12")
    }

    fn not_negative(&mut self, key: &str, value: &Spanned<f64>) -> f64 {
        self.number(key, value, is_not_negative, "a number that is 0 or more")
    }

    fn at_least_one(&mut self, key: &str, value: &Spanned<u64>) -> u64 {
        if *value.get_ref() == 0 {
            self.problem(value.span(), key, "0 is out of range", "write a whole number of at least 1");
        }
        *value.get_ref()
    }

    /// A whole number from 1 to `most`; `usual` where none is given.
    fn count(&mut self, key: &str, value: Option<&Spanned<u64>>, usual: usize, most: u64) -> usize {
        let Some(value) = value else { return usual };
        let number = *value.get_ref();
        if !(1..=most).contains(&number) {
            let hint = format!("write a whole number from 1 to {most}");
            self.problem(value.span(), key, format!("{number} is out of range"), hint);
        }
        number.clamp(1, most) as usize
    }

    fn point(&mut self, key: &str, value: &Spanned<raw::Exactly<f64, 3>>) -> Point3<f64> {
        let raw::Exactly(coordinates) = *value.get_ref();
        if !are_usable(&coordinates) {
            self.problem(value.span(), key, "a coordinate is out of range", "write three finite numbers, in metres");
        }
        Point3::from(coordinates)
    }

    /// A direction; refused unless its length is 1.
    fn unit(&mut self, key: &str, value: &Spanned<raw::Exactly<f64, 3>>) -> Option<UnitVector3<f64>> {
        let raw::Exactly(coordinates) = *value.get_ref();
        let direction = Vector3::from(coordinates);
        let length = direction.norm();
        // A NaN fails this comparison as well.
        if (length - 1.0).abs() <= UNIT_TOLERANCE {
            return Some(UnitVector3::new_normalize(direction));
        }
        let hint = if length.is_finite() && length > 0.0 {
            let unit = direction / length;
            format!("write the unit vector [{:.6}, {:.6}, {:.6}]", unit.x, unit.y, unit.z)
        } else {
            "write a unit vector, such as [0.0, 0.0, 1.0]".to_owned()
        };
        self.problem(value.span(), key, format!("its length is {length}, not 1"), hint);
        None
    }

    fn scenario(&mut self, mut raw: raw::Scenario) -> Option<Scenario> {
        if self.is_external {
            self.nothing_recorded_or_simulated(&raw)?;
            completed::complete(&mut raw, None);
            self.share_what_sockets_have_in_common(&mut raw);
        }
        let is_recorded = raw.initial_error.is_none() && !self.is_external;
        if let (Some(measurements), Some(_), true) = (&raw.measurements, &raw.robot.urdf, is_recorded) {
            let titles = self.titles(measurements.get_ref())?;
            let titles = self.beside_joints(&raw, &titles);
            completed::complete(&mut raw, Some(&titles));
        }
        let raw = &raw;
        let name = raw.name.get_ref();
        let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
        if name.is_empty() || !is_plain || name.starts_with(['.', '-']) {
            let hint = "use letters, digits, '-', '_' and '.', the first a letter, a digit or '_'; the name becomes part of file names \
                        and addresses";
            self.problem(raw.name.span(), "name", format!("{name:?} cannot be a name"), hint);
        }
        let mut robot = self.robot(raw)?;
        if self.is_external {
            self.space_sockets(raw, &mut robot);
        }
        let recorded = if is_recorded { self.recorded(raw, &mut robot) } else { None };
        let measurement_model = self.measurement_model(raw, &robot);
        let readings = self.readings(raw, &robot, measurement_model.as_deref());
        let servo = raw.view.as_ref().and_then(|view| self.servo(view, &robot));
        let measurement_model = measurement_model.map(|measurement_model| {
            let measurement_model = measurement_model.as_ref().clone().with_joint_noise(readings.noise.clone());
            Arc::new(measurement_model.with_servo(servo.clone()))
        });
        let rows = recorded.as_ref().map(|(_, held_out)| held_out.fewest_training() as u64);
        let prior = self.prior(raw, &robot);
        let world = self.world(raw, &robot, measurement_model.as_deref(), &prior, recorded);
        let kind = match (self.is_external, &raw.measurements) {
            (true, _) => WorldKind::External,
            (false, Some(_)) => WorldKind::Measured,
            (false, None) => WorldKind::Simulated,
        };
        let setting = Setting::of(&robot, measurement_model.as_deref(), kind);
        let learners = self.learners(&raw.learners, setting);
        let is_told = raw.measurements.is_some() || self.is_external;
        let usual = (robot.described.is_some() && is_told).then(|| match &measurement_model {
            Some(measurement_model) => (FILTER_SIGMAS * measurement_model.sigma()).powi(2),
            // What is wrong with the sensors is said already.
            None => 1.0,
        });
        let filter = self.filter("filter", &raw.filter, usual);
        let unscented = raw.unscented.as_ref().map_or(filter, |given| self.filter("unscented", given, usual));
        self.underweighting(raw, &learners);
        let smoother = self.smoother(raw, measurement_model.as_deref(), readings.unknown);
        if let (Some(measurement_model), true) = (&measurement_model, self.problems.is_empty()) {
            self.assumed_noise(raw, measurement_model, [filter.sigma(), unscented.sigma(), smoother.sigma]);
        }
        let constraints = raw.constraints.as_ref();
        if let (Some(given), true) = (constraints, raw.held.is_some() && !self.is_external) {
            let hint = "leave [constraints] out, or the sockets";
            self.problem(given.span(), "constraints", "recorded sockets know no constraints yet", hint);
        }
        let constraints = constraints.and_then(|given| self.constraints(given, &robot, world.as_ref()));
        let constraints =
            if self.is_external && self.problems.is_empty() { robot.held_apart(constraints, &[]) } else { constraints };
        Some(Scenario {
            name: name.clone(),
            title: raw.title.clone(),
            steps: self.at_least_one("steps", &raw.steps).min(rows.unwrap_or(u64::MAX)),
            prior,
            filter,
            unscented,
            smoother,
            gradient_rate: self.gradient_rate(raw),
            selection: self.selection(&raw.selection),
            constraints,
            thresholds: self.thresholds(raw),
            settled_below_m: self.positive("settled.expected_prediction_m", &raw.settled.expected_prediction_m),
            promises: self.promises(&raw.promises, &learners),
            learners,
            robot,
            world: world?,
            measurement_model: measurement_model?,
            replaced: Vec::new(),
            source: self.text.to_owned(),
            data: std::mem::take(&mut self.data),
        })
    }

    fn prior(&mut self, raw: &raw::Scenario, robot: &Robot) -> Prior {
        let prior = raw.prior.get_ref();
        if raw.robot.learn_marker && prior.marker_m.is_none() {
            let hint = "add `marker_m = …`, its standard deviation in metres";
            self.problem(raw.prior.span(), "prior.marker_m", "the marker is learned", hint);
        }
        let direction_rad = self.positive("prior.direction_rad", &prior.direction_rad);
        let compliance = prior.compliance_rad_per_nm.as_ref();
        Prior {
            direction_rad,
            point_m: self.positive("prior.point_m", &prior.point_m),
            marker_m: prior.marker_m.as_ref().map_or(1.0, |sd| self.positive("prior.marker_m", sd)),
            zero_rad: prior.offset_rad.as_ref().map_or(USUAL_ZERO_RAD, |sd| self.positive("prior.offset_rad", sd)),
            zero_m: prior.offset_m.as_ref().map_or(USUAL_ZERO_M, |sd| self.positive("prior.offset_m", sd)),
            compliance_rad_per_nm: compliance
                .map_or(direction_rad / USUAL_TORQUE, |sd| self.positive("prior.compliance_rad_per_nm", sd)),
            known: self.known_blocks(raw, robot),
        }
    }

    /// The prior knowledge of learned targets, cameras, ratios and offsets.
    fn known_blocks(&mut self, raw: &raw::Scenario, robot: &Robot) -> BTreeMap<Block, Known> {
        let prior = raw.prior.get_ref();
        let joints = raw.robot.joints.get_ref().iter().enumerate();
        let mut known: BTreeMap<Block, Known> = robot.known.iter().copied().collect();
        let unit = |size: f64| Known::Within { length_m: size, angle_rad: size, other: size };
        for (index, joint) in joints {
            let (span, joint) = (joint.span(), joint.get_ref());
            if joint.learn_ratio {
                match &prior.ratio {
                    Some(sd) => drop(known.insert(Block::Ratio(index), unit(self.positive("prior.ratio", sd)))),
                    None => {
                        let hint = "add `ratio = 0.02`, say, to [prior]: the standard deviation of a ratio";
                        self.problem(span.clone(), "prior.ratio", "a ratio is learned", hint);
                    }
                }
            }
            if joint.learn_eccentricity {
                let (block, key) = (Block::Eccentricity(index), "prior.eccentricity_rad");
                match &prior.eccentricity_rad {
                    Some(sd) => drop(known.insert(block, unit(self.positive(key, sd)))),
                    None => {
                        let hint = "add `eccentricity_rad = 0.005`, say, to [prior]: the standard deviation of its sine and cosine";
                        self.problem(span.clone(), key, "an eccentricity is learned", hint);
                    }
                }
            }
            if joint.learn_offset {
                let (key, sd) = match joint.kind {
                    JointKind::Revolute => ("prior.offset_rad", &prior.offset_rad),
                    JointKind::Prismatic => ("prior.offset_m", &prior.offset_m),
                };
                match sd {
                    Some(sd) => drop(known.insert(Block::Offset(index), unit(self.positive(key, sd)))),
                    None => {
                        let hint = "add it to [prior]: the standard deviation of an offset";
                        self.problem(span, key, "an offset is learned", hint);
                    }
                }
            }
        }
        known
    }

    /// The values of a filter; `usual` is the variance if that need not be given.
    fn filter(&mut self, section: &str, raw: &Spanned<raw::Filter>, usual: Option<f64>) -> Filter {
        let (span, raw) = (raw.span(), raw.get_ref());
        let key = |key: &str| format!("{section}.{key}");
        let stabilising = raw.stabilising_noise.as_ref().map(|noise| StabilisingNoise {
            variance: self.not_negative(&key("stabilising_noise.variance"), &noise.variance),
            first_step: self.at_least_one(&key("stabilising_noise.first_step"), &noise.first_step),
            every: self.at_least_one(&key("stabilising_noise.every"), &noise.every),
        });
        let name = "measurement_variance_m2";
        let variance = match (&raw.measurement_variance_m2, usual) {
            (Some(variance), _) => self.positive(&key(name), variance),
            (None, Some(usual)) => usual,
            (None, None) => {
                let hint = format!("add `{name} = …`, σ² of the noise that the filter assumes");
                self.problem(span, key(name), "missing", hint);
                1.0
            }
        };
        let underweighting =
            raw.underweighting.as_ref().map_or(0.0, |share| self.not_negative(&key("underweighting"), share));
        Filter { variance, stabilising, underweighting }
    }

    /// Underweighting is of the linearised filter alone.
    fn underweighting(&mut self, raw: &raw::Scenario, learners: &[LearnerSpec]) {
        let six_numbers = learners.iter().find(|learner| learner.estimator == EstimatorKind::OverparameterisedRls);
        if let (Some(share), Some(learner)) = (&raw.filter.get_ref().underweighting, six_numbers) {
            let what = format!("`{}` filters in six numbers, without it", learner.name);
            self.problem(
                share.span(),
                "filter.underweighting",
                what,
                "remove it, or write `estimator = \"rls\"` there",
            );
        }
        if let Some(share) = raw.unscented.as_ref().and_then(|given| given.get_ref().underweighting.as_ref()) {
            let what = "the unscented filter sees by itself how far a prediction bends";
            self.problem(share.span(), "unscented.underweighting", what, "remove it, or write it in [filter]");
        }
    }

    /// Checks every σ that an estimator assumes, the first sensor's as stated and the others' in proportion.
    fn assumed_noise(&mut self, raw: &raw::Scenario, measurement_model: &MeasurementModel, sigmas: [f64; 3]) {
        let told = sigmas.into_iter().find_map(|sigma| measurement_model.assuming(sigma).check_noise().err());
        if let Some(error) = told {
            let sensor = raw.sensor.as_ref().map(Spanned::span);
            let span = sensor.or(raw.sockets.first().map(Spanned::span)).unwrap_or(raw.filter.span());
            let hint = "bring the σ of all sensors, and what filters assume of the first, nearer to each other";
            self.problem(span, "sensor", error.to_string(), hint);
        }
    }

    fn smoother(
        &mut self,
        raw: &raw::Scenario,
        measurement_model: Option<&MeasurementModel>,
        joints_unknown: bool,
    ) -> SmootherSpec {
        let default = HypothesisSettings::default();
        let given = raw.smoother.as_ref();
        let variance = given.and_then(|given| given.measurement_variance_m2.as_ref());
        let sigma = match variance {
            Some(variance) => self.positive("smoother.measurement_variance_m2", variance).sqrt(),
            // A sensor without noise would make the posterior infinitely sharp.
            None => measurement_model.map_or(0.0, MeasurementModel::sigma).max(1e-5),
        };
        let kept = given.and_then(|given| given.hypotheses.as_ref());
        let spawned = given.and_then(|given| given.spawned.as_ref());
        let hypotheses = HypothesisSettings {
            kept: self.count("smoother.hypotheses", kept, default.kept, MOST_HYPOTHESES),
            spawned: self.count("smoother.spawned", spawned, default.spawned, MOST_HYPOTHESES),
        };
        // Of recorded data nobody knows more than the filter assumes.
        let is_told = raw.measurements.is_some() || self.is_external;
        let usual = if is_told { raw::NoiseKnowledge::Unknown } else { raw::NoiseKnowledge::Known };
        let noise_unknown = given.and_then(|given| given.noise).unwrap_or(usual) == raw::NoiseKnowledge::Unknown;
        SmootherSpec { sigma, hypotheses, loss: self.loss(given), noise_unknown, joints_unknown }
    }

    fn loss(&mut self, given: Option<&raw::Smoother>) -> Loss {
        let Some(given) = given else { return Loss::None };
        let keys = [("fraction", &given.outlier_fraction), ("spread", &given.outlier_spread)];
        let loss = given.loss.unwrap_or(raw::Loss::None);
        let (mut fraction, mut spread) = (Loss::USUAL_FRACTION, None);
        for (key, value) in keys {
            let Some(value) = value else { continue };
            let key = format!("smoother.outlier_{key}");
            if loss != raw::Loss::Mixture {
                let hint = "remove it, or write `loss = \"mixture\"`";
                self.problem(value.span(), key, "only a mixture of noise and outliers has one", hint);
            } else if key.ends_with("fraction") {
                fraction = self.number(&key, value, |x| x > 0.0 && x < 0.5, "a share above 0 and below 0.5");
            } else {
                let must = "a number above 1, in standard deviations of the noise";
                spread = Some(self.number(&key, value, |x| x > 1.0, must));
            }
        }
        match loss {
            raw::Loss::None => Loss::None,
            raw::Loss::Huber => Loss::Huber,
            raw::Loss::Mixture => Loss::Mixture { fraction, spread },
        }
    }

    /// The rate of the gradient. A file with learners that use it must state it; others use a default.
    fn gradient_rate(&mut self, raw: &raw::Scenario) -> f64 {
        if let Some(gradient) = &raw.gradient {
            return self.positive("gradient.rate", &gradient.rate);
        }
        let learners = raw.learners.get_ref();
        if let Some(learner) = learners.iter().find(|learner| learner.estimator == EstimatorKind::Gradient) {
            let what = format!("missing: learner `{}` learns by it", learner.name.get_ref());
            self.problem(learner.name.span(), "gradient.rate", what, "add `[gradient]` with `rate = 0.1`, say");
        }
        Scenario::GRADIENT_RATE
    }

    /// The thresholds of convergence. Without a truth nothing is judged by them.
    fn thresholds(&mut self, raw: &raw::Scenario) -> Thresholds {
        if let Some(thresholds) = &raw.thresholds {
            return Thresholds {
                orientation_deg: self.positive("thresholds.orientation_deg", &thresholds.orientation_deg),
                location_m: self.positive("thresholds.location_m", &thresholds.location_m),
            };
        }
        let socket = raw.sockets.first().map(Spanned::span);
        if self.is_external || (raw.measurements.is_some() && raw.initial_error.is_none()) {
            return Scenario::THRESHOLDS;
        }
        if let Some(span) = raw.sensor.as_ref().map(Spanned::span).or(socket) {
            let what = "missing: a simulated world is judged by them";
            let hint = "add `[thresholds]` with `orientation_deg = …` and `location_m = …`";
            self.problem(span, "thresholds", what, hint);
        }
        Scenario::THRESHOLDS
    }

    fn selection(&mut self, raw: &raw::Selection) -> SelectionSpec {
        let units = match (raw.units, &raw.characteristic_length_m) {
            (raw::Units::CharacteristicLength, None) => CriterionUnits::CharacteristicLength(1.0),
            (raw::Units::CharacteristicLength, Some(length)) => {
                CriterionUnits::CharacteristicLength(self.positive("selection.characteristic_length_m", length))
            }
            (raw::Units::Prior, None) => CriterionUnits::Prior,
            (raw::Units::Prior, Some(length)) => {
                let hint = "remove it, or set `units = \"characteristic_length\"`";
                self.problem(length.span(), "selection.characteristic_length_m", "units are the prior's", hint);
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
            ..Settings::default()
        };
        let default = Planning::default();
        let planning = Planning {
            optimality: raw.criterion,
            ahead: self.count("selection.ahead", raw.ahead.as_ref(), default.ahead, MOST_PLANNED),
            batch: self.count("selection.batch", raw.batch.as_ref(), default.batch, MOST_PLANNED),
            ..default
        };
        SelectionSpec { search, units, planning }
    }
}
