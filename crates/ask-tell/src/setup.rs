//! The setup of a session.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use toml::Table;

use super::{Fault, SetupError, limits::*};
use body_schema_robot::{Urdf, UrdfError};
use body_schema_scenario::{Scenario, ScenarioError};

/// The robot, its sensors, what is known beforehand, and who decides.
///
/// `calibration` holds the keys of a calibration file (`docs/calibrate.md`, `docs/sensors.md`, `docs/constraints.md`) as JSON, with
/// these differences:
///
/// * `robot.urdf` is the text of the description, not the name of a file;
/// * `robot.base` and `robot.tip` may be left out where one link hangs on nothing and nothing hangs on one link, and `robot.tips` is
///   not given;
/// * `name` may be left out, and is then the robot's; a null counts as left out;
/// * there are no `measurements`: they are reported as observations;
/// * sockets are listed, each with a posture in which the target was in it: `"socket": [{"name": "0", "place": "front",
///   "posture_deg": […]}, …]`. What they have in common stands in `sockets`.
///
/// Whatever is left out has the defaults of `calibrate`: the marker is somewhere on the tip, the robot stands somewhere, noise is
/// learned, rows may be outliers, movements go to what predictions over the whole joint box need, or over the list that constraints
/// hold the robot to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// The keys of a calibration file.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub calibration: Value,
    /// The learner that decides: the first of the calibration's, which is `global` unless it lists others; or an estimator and a
    /// policy, such as `smoother:random`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agent: Option<String>,
    /// The seed of all random draws.
    #[serde(default, deserialize_with = "crate::integer::integer")]
    pub seed: u64,
}

/// The name of the description in errors and files.
pub(super) const URDF: &str = "robot.urdf";
/// The name of the shapes of its links there.
const SHAPES: &str = "shapes.json";
/// The name of a session if neither it nor its robot has one.
const NAME: &str = "session";
/// The most characters of a robot's name that become a session's.
const MOST_NAME_CHARACTERS: usize = 40;

impl Setup {
    /// A setup of these keys, with the default agent.
    pub fn new(calibration: Value) -> Self {
        Self { calibration, agent: None, seed: 0 }
    }

    /// A setup from the text of a calibration file. `open` returns the text of the URDF and of the shapes that it names, or the reason
    /// why it cannot; the table, `[measurements]`, is left out.
    ///
    /// # Errors
    ///
    /// [`SetupError::Invalid`] if the text is no TOML or one of these cannot be opened.
    pub fn from_toml(text: &str, open: &dyn Fn(&str) -> Result<String, String>) -> Result<Self, SetupError> {
        let unreadable = |error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            let what = format!("line {line} of the calibration file: {}", error.message());
            Fault::new("calibration", what, "correct the TOML")
        };
        let mut table: Table = text.parse().map_err(unreadable)?;
        table.remove("measurements");
        if let Some(toml::Value::Table(robot)) = table.get_mut("robot") {
            for key in ["urdf", "shapes"] {
                let Some(toml::Value::String(file)) = robot.get_mut(key) else { continue };
                let opened = open(file);
                let hint = "name a file that can be read, beside this one";
                let refused = |why| Fault::new(format!("robot.{key}"), format!("{file} {why}"), hint);
                *file = opened.map_err(refused)?;
            }
        }
        let calibration = serde_json::to_value(table);
        calibration.map(Self::new).map_err(|error| Fault::new("calibration", error.to_string(), "correct it").into())
    }

    /// A setup from the text of a URDF, whose measurement is the position of a marker somewhere on `tip`.
    pub fn from_urdf(urdf: &str, base: Option<&str>, tip: Option<&str>) -> Self {
        Self::new(serde_json::json!({ "robot": { "urdf": urdf, "base": base, "tip": tip } }))
    }

    /// The same, with the shapes of the robot's links, as [`Hulls`](body_schema_robot::Hulls) are written.
    pub fn with_shapes(mut self, shapes: &str) -> Self {
        if let Some(Value::Object(robot)) = self.calibration.get_mut("robot") {
            robot.insert("shapes".to_owned(), shapes.into());
        }
        self
    }

    /// The text of the shapes of the robot's links, if there are any.
    pub fn shapes(&self) -> Option<&str> {
        self.calibration.pointer("/robot/shapes").and_then(Value::as_str)
    }

    /// The text of the URDF.
    pub fn urdf(&self) -> &str {
        self.calibration.pointer("/robot/urdf").and_then(Value::as_str).unwrap_or_default()
    }

    /// The scenario of the setup: the robot's sensors, prior and agents.
    pub(super) fn scenario(&self) -> Result<Scenario, SetupError> {
        let text = toml::to_string(&self.table()?).map_err(|error| {
            Fault::new("calibration", error.to_string(), "write values that a calibration file can have")
        })?;
        let scenario = Scenario::parse_outside("calibration", &text, &|file| self.open(file));
        let scenario = scenario.map_err(|error| match error {
            ScenarioError::Invalid { problems, .. } => {
                SetupError::Invalid(problems.into_iter().map(Fault::from).collect())
            }
            other => SetupError::Agent(other),
        })?;
        check_size(&scenario, &Most::default())?;
        Ok(scenario)
    }

    /// The text of a file that the calibration names.
    pub(super) fn open(&self, file: &str) -> Result<String, String> {
        let text = match file {
            URDF => "/robot/urdf",
            SHAPES => "/robot/shapes",
            _ => return Err("is not part of a session".to_owned()),
        };
        Ok(self.calibration.pointer(text).and_then(Value::as_str).unwrap_or_default().to_owned())
    }

    /// The keys as they stand in a file, with the description under its name.
    pub(super) fn table(&self) -> Result<Table, Fault> {
        let size = self.calibration.to_string().len();
        if size > MOST_SETUP_BYTES {
            let what = format!("{size} bytes are more than the {MOST_SETUP_BYTES} that there may be");
            return Err(Fault::new("calibration", what, "leave out what has no part in the kinematics"));
        }
        let Value::Object(keys) = &self.calibration else {
            return Err(Fault::new("calibration", "it is no object", "write the keys of a calibration file"));
        };
        let mut table = tabled("", keys)?;
        let carriers = carriers(&table);
        let Some(toml::Value::Table(robot)) = table.get_mut("robot") else {
            let hint = "add {\"robot\": {\"urdf\": TEXT, \"base\": LINK, \"tip\": LINK}}";
            return Err(Fault::new("robot", "missing", hint));
        };
        let Some(urdf) = robot.get("urdf").and_then(toml::Value::as_str) else {
            return Err(Fault::new("robot.urdf", "missing", "add the text of the robot's URDF"));
        };
        if !urdf.trim_start().starts_with(['<', '\u{feff}']) {
            let what = format!("`{}` is no text of a URDF", urdf.chars().take(40).collect::<String>());
            return Err(Fault::new("robot.urdf", what, "write the text of the file, not its name"));
        }
        let description = Urdf::parse(urdf).map_err(|UrdfError { line, what, hint, .. }| {
            Fault::new("robot.urdf", format!("{URDF}, line {line}: {what}"), hint)
        })?;
        // In letters that can stand in names of files and addresses.
        let is_sound = |c: &char| c.is_ascii_alphanumeric() || "-_".contains(*c);
        let own: String = description.name().chars().filter(is_sound).take(MOST_NAME_CHARACTERS).collect();
        let leaves: Vec<&str> = description.leaves().collect();
        let only_leaf = leaves.first().copied().filter(|_| leaves.len() == 1);
        let tip = robot.get("tip").and_then(toml::Value::as_str).or(only_leaf);
        // Of several links that hang on nothing that on which the tip hangs.
        let root = tip.and_then(|tip| description.carriers(tip).last().map(|joint| joint.parent));
        // Of several that carry what is measured the nearest one on which they all hang, as in a calibration.
        let carriers: Vec<&str> = carriers.iter().map(String::as_str).collect();
        let shared = description.ancestor(&carriers).filter(|link| tip.is_none() && !carriers.contains(link));
        let ends = [("base", root.or(shared).or_else(|| description.root())), ("tip", only_leaf)];
        // Where several tips are named they say what carries them.
        let ends = if robot.contains_key("tips") { &[][..] } else { &ends[..] };
        for (key, link) in ends.iter().filter_map(|(key, link)| Some((*key, (*link)?.to_owned()))) {
            robot.entry(key).or_insert_with(|| link.into());
        }
        robot.insert("urdf".to_owned(), URDF.into());
        if let Some(shapes @ toml::Value::String(_)) = robot.get_mut("shapes") {
            *shapes = SHAPES.into();
        }
        table.entry("name").or_insert_with(|| if own.is_empty() { NAME.into() } else { own.into() });
        Ok(table)
    }
}

/// The links that targets and cameras are said to be on.
fn carriers(table: &Table) -> BTreeSet<String> {
    let listed = ["target", "camera"].into_iter().filter_map(|key| table.get(key)?.as_array()).flatten();
    listed.filter_map(|one| Some(one.get("link")?.as_str()?.to_owned())).collect()
}

/// JSON as TOML, which has no null.
fn tabled(path: &str, keys: &Map<String, Value>) -> Result<Table, Fault> {
    let given = keys.iter().filter(|(_, value)| !value.is_null());
    given
        .map(|(key, value)| {
            let path = below(path, &key.chars().take(MOST_TEXT_CHARACTERS).collect::<String>());
            is_short(&path, key)?;
            Ok((key.clone(), value_of(&path, value)?))
        })
        .collect()
}

fn value_of(path: &str, value: &Value) -> Result<toml::Value, Fault> {
    let refuse = |what: &str| Err(Fault::new(path, what, "write a number, a text, a list or an object"));
    Ok(match value {
        Value::Null => return refuse("null is no element of a list"),
        Value::Bool(value) => (*value).into(),
        Value::String(text) => {
            if !["robot.urdf", "robot.shapes"].contains(&path) {
                is_short(path, text)?;
            }
            text.as_str().into()
        }
        Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => whole.into(),
            (None, Some(number)) => number.into(),
            (None, None) => return refuse("this number is out of range"),
        },
        Value::Array(list) => {
            let values = list.iter().enumerate().map(|(index, value)| value_of(&format!("{path}[{index}]"), value));
            toml::Value::Array(values.collect::<Result<_, _>>()?)
        }
        Value::Object(keys) => tabled(path, keys)?.into(),
    })
}

/// Checks the length of a name or title: they are repeated with every reading and every answer.
fn is_short(path: &str, text: &str) -> Result<(), Fault> {
    let count = text.chars().count();
    if count <= MOST_TEXT_CHARACTERS {
        return Ok(());
    }
    let what = format!("{count} characters are more than the {MOST_TEXT_CHARACTERS} that a text may have");
    Err(Fault::new(path, what, "say it shorter"))
}

fn below(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// Checks that a session of the scenario is within limits.
pub(super) fn check_size(scenario: &Scenario, most: &Most) -> Result<(), Fault> {
    let robot = &scenario.robot;
    let points = robot.equipment.targets.iter().map(|target| target.points.len()).sum();
    let counts = [
        ("robot.urdf", "joints that move", robot.names.len(), most.joints),
        ("target", "targets", robot.equipment.targets.len(), most.targets),
        ("target.points_m", "points of targets", points, MOST_POINTS),
        ("camera", "cameras", robot.equipment.cameras.len(), MOST_CAMERAS),
        ("socket", "sockets", robot.sockets.len(), MOST_SOCKETS),
        ("sensor", "channels", scenario.measurement_model.sensors().len(), MOST_CHANNELS),
        ("selection.evaluations", "evaluations", scenario.selection.search.max_evaluations, most.evaluations),
    ];
    match counts.into_iter().find(|(_, _, count, most)| count > most) {
        Some((field, what, count, most)) => Err(Fault::new(
            field,
            format!("{count} {what} are more than the {most} that there may be"),
            "leave some out",
        )),
        None => Ok(()),
    }
}
