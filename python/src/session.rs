//! Sessions.

use std::{
    path::Path,
    sync::{Mutex, MutexGuard, PoisonError},
};

use body_schema_ask_tell::{
    Ask, Fault, Observation, Outcome, Session, Setup, Shape,
    json::{self, Unreadable},
};
use body_schema_calibration::Options;
use body_schema_engine::{model::State, sensing::Occasion};
use body_schema_robot::{Hulls, Urdf};
use body_schema_wire::RunResult;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value, json as value};

use crate::{refusal::Failure, waiting::heard};

/// A session with a robot elsewhere.
#[pyclass(frozen)]
pub struct Engine(Mutex<Session>);

/// The outcome of a suggestion that is not carried out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ended {
    state: Outcome,
    #[serde(default)]
    reason: Option<String>,
}

type Answer = Result<String, Failure>;

impl Engine {
    /// Runs `work` on the session with the interpreter's lock released. A change that fails changes nothing, so a panic
    /// in between leaves a sound session.
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(MutexGuard<'_, Session>) -> T + Send) -> T {
        py.detach(|| work(self.0.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

#[pymethods]
impl Engine {
    /// Opens a session from the JSON of a setup.
    #[staticmethod]
    fn open(py: Python<'_>, setup: &str) -> PyResult<Self> {
        let opened = py.detach(|| Ok::<_, Failure>(Session::open(read::<Setup>("calibration", setup)?)?));
        Ok(Self(Mutex::new(opened?)))
    }

    /// Loads a session that `save` wrote.
    #[staticmethod]
    fn load(py: Python<'_>, text: &str) -> PyResult<Self> {
        let loaded = py.detach(|| Session::from_json(text));
        Ok(Self(Mutex::new(loaded.map_err(Failure::from)?)))
    }

    fn save(&self, py: Python<'_>) -> String {
        self.with(py, |session| session.to_json())
    }

    fn suggest(&self, py: Python<'_>, ask: &str, now_s: f64) -> PyResult<String> {
        let answer = self.with(py, |mut session| -> Answer {
            written(&session.suggest(&read::<Ask>("suggest", ask)?, Some(now_s))?)
        });
        Ok(answer?)
    }

    fn outcome(&self, py: Python<'_>, id: u64, outcome: &str, now_s: f64) -> PyResult<String> {
        let answer = self.with(py, |mut session| -> Answer {
            let Ended { state, reason } = read::<Ended>("outcome", outcome)?;
            written(&session.outcome(id, state, reason.as_deref(), Some(now_s))?)
        });
        Ok(answer?)
    }

    fn observe(&self, py: Python<'_>, observation: &str, now_s: f64) -> PyResult<String> {
        let answer = self.with(py, |mut session| -> Answer {
            written(&session.observe(read::<Observation>("observation", observation)?, Some(now_s))?)
        });
        Ok(answer?)
    }

    fn exclude(&self, py: Python<'_>, number: u64, now_s: f64) -> PyResult<()> {
        Ok(self.with(py, |mut session| session.exclude(number, Some(now_s))).map_err(Failure::from)?)
    }

    fn include(&self, py: Python<'_>, number: u64, now_s: f64) -> PyResult<()> {
        Ok(self.with(py, |mut session| session.include(number, Some(now_s))).map_err(Failure::from)?)
    }

    fn suggestions(&self, py: Python<'_>) -> PyResult<String> {
        let answer = self.with(py, |session| {
            let all: Vec<_> = session.suggestions().iter().map(|suggestion| (**suggestion).clone()).collect();
            written(&all)
        });
        Ok(answer?)
    }

    fn observations(&self, py: Python<'_>) -> PyResult<String> {
        let answer = self.with(py, |session| {
            let all = session.observations().iter().map(|told| {
                let number = told.answer.observation;
                serde_json::json!({ "number": number, "told": told.observation, "answer": told.answer, "excluded": told.excluded })
            });
            written(&all.collect::<Vec<_>>())
        });
        Ok(answer?)
    }

    fn events(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(session.events()))?)
    }

    fn channels(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(session.channels()))?)
    }

    fn description(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(&session.description()))?)
    }

    fn status(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(&session.status()))?)
    }

    fn estimate(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(&session.report().learners[0].estimate))?)
    }

    fn model(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, |session| written(&RunResult::of(session.experiment()).learners[0].model))?)
    }

    /// Predicted positions of the hand at postures, metres.
    fn predict(&self, py: Python<'_>, postures: Vec<Vec<f64>>) -> PyResult<Vec<[f64; 3]>> {
        let predicted = self.with(py, |session| {
            let state = &session.belief().ok_or_else(no_agent)?.state;
            let of = |posture: &Vec<f64>| fits(state, posture).map(|()| state.marker_at(posture).coords.into());
            postures.iter().map(of).collect::<Result<Vec<[f64; 3]>, Failure>>()
        });
        Ok(predicted?)
    }

    /// What every channel would read at postures, as JSON: by channel a reading in its shape, null where nothing would be seen.
    fn readings(&self, py: Python<'_>, postures: Vec<Vec<f64>>) -> PyResult<String> {
        let predicted = self.with(py, |session| -> Answer {
            let belief = session.belief().ok_or_else(no_agent)?;
            let (measurement_model, no_noise) =
                (&belief.measurement_model, vec![0.0; belief.measurement_model.equations()]);
            let of = |posture: &Vec<f64>| {
                fits(&belief.state, posture)?;
                let sensors = measurement_model
                    .sensors()
                    .iter()
                    .zip(measurement_model.observe(&belief.state, posture, &no_noise).readings);
                let always = sensors.filter(|(sensor, _)| sensor.subject().occasion == Occasion::Always);
                let readings = session.channels().iter().zip(always).map(|(channel, (_, read))| {
                    (channel.name.clone(), read.map_or(Value::Null, |read| shown(&channel.shape, &read)))
                });
                Ok(readings.collect::<Map<String, Value>>())
            };
            written(&postures.iter().map(of).collect::<Result<Vec<_>, Failure>>()?)
        });
        Ok(predicted?)
    }

    /// The content of `report.json`, judged in `folds`; `hear` is told how far it is.
    #[pyo3(signature = (folds=None, hear=None))]
    fn report(&self, py: Python<'_>, folds: Option<usize>, hear: Option<Py<PyAny>>) -> PyResult<String> {
        // Nobody else waits meanwhile.
        let results = self.with(py, |session| session.results()).map_err(Failure::from)?;
        let options = Options { folds, active: None };
        let answer =
            heard(py, hear, move |progress| -> Answer { written(&results.judged(&options, progress)?.report) })?;
        Ok(answer?)
    }

    /// The text of `calibrated.urdf` or `kinematics.yaml`.
    fn described(&self, py: Python<'_>, path: &str) -> PyResult<String> {
        let answer = self.with(py, |session| -> Answer {
            let files = session.results()?.description()?;
            let found = files.into_iter().find(|file| file.path == path);
            found.map(|file| file.text).ok_or_else(|| Failure::new("EngineError", format!("there is no {path}")))
        });
        Ok(answer?)
    }

    fn csv(&self, py: Python<'_>) -> String {
        self.with(py, |session| session.observations_csv())
    }

    fn toml(&self, py: Python<'_>) -> String {
        self.with(py, |session| session.calibration_toml())
    }
}

fn no_agent() -> Failure {
    Failure::new("EngineError", "there is no agent")
}

fn fits(state: &State, posture: &[f64]) -> Result<(), Failure> {
    let wanted = state.joints.len();
    let fault = || Fault {
        field: "configuration".to_owned(),
        what: format!("{} positions are none of {wanted} joints", posture.len()),
        hint: "write one position per joint".to_owned(),
    };
    if posture.len() == wanted { Ok(()) } else { Err(fault().into()) }
}

/// A channel's own numbers in the shape in which a reading is told.
fn shown(shape: &Shape, read: &[f64]) -> Value {
    match (shape, read) {
        (Shape::Pose, &[x, y, z, a, b, c]) => {
            // A rotation vector as the quaternion of the same turn.
            let angle = (a * a + b * b + c * c).sqrt();
            let half = if angle > 0.0 { (0.5 * angle).sin() / angle } else { 0.5 };
            value!({ "position": [x, y, z], "quaternion": [half * a, half * b, half * c, (0.5 * angle).cos()] })
        }
        (Shape::Pixels { .. }, read) => {
            let point = |pair: &[f64]| if pair.iter().any(|x| x.is_nan()) { Value::Null } else { value!(pair) };
            read.chunks(2).map(point).collect()
        }
        (Shape::Distance | Shape::Depth, &[length]) => value!(length),
        (_, read) => value!(read),
    }
}

/// The setup of a calibration file, as JSON; the URDF that it names is beside it.
#[pyfunction]
pub fn setup_of_file(path: &str) -> PyResult<String> {
    let unreadable = |error: std::io::Error| Fault {
        field: "config".to_owned(),
        what: format!("{path}: {error}"),
        hint: "name a calibration file that can be read, or pass its keys as a dict".to_owned(),
    };
    let text = std::fs::read_to_string(path).map_err(|error| Failure::from(unreadable(error)))?;
    let folder = Path::new(path).parent().unwrap_or(Path::new("")).to_path_buf();
    let open = |file: &str| std::fs::read_to_string(folder.join(file)).map_err(|error| error.to_string());
    let setup = Setup::from_toml(&text, &open).map_err(|error| Failure::from(error).of_file(path))?;
    Ok(written(&setup)?)
}

/// The setup of the text of a URDF, as JSON; of one from a file with the shapes of the links whose meshes are beside it.
#[pyfunction]
#[pyo3(signature = (urdf, base=None, tip=None, path=None))]
pub fn setup_of_urdf(urdf: &str, base: Option<&str>, tip: Option<&str>, path: Option<&str>) -> PyResult<String> {
    let setup = Setup::from_urdf(urdf, base, tip);
    let shapes = path
        .zip(Urdf::parse(urdf).ok())
        .and_then(|(path, urdf)| Hulls::of_meshes(&urdf, |file| body_schema_files::mesh(Path::new(path), file).ok()).0);
    let setup = match shapes {
        Some(hulls) => setup.with_shapes(&hulls.to_string()),
        None => setup,
    };
    Ok(written(&setup)?)
}

/// JSON of a value that holds only numbers, names and lists.
fn written<T: Serialize + ?Sized>(value: &T) -> Answer {
    serde_json::to_string(value).map_err(|error| Failure::new("EngineError", error))
}

/// Reads JSON; `whole` is named in the error where no field of it is wrong.
fn read<T: DeserializeOwned>(whole: &str, text: &str) -> Result<T, Failure> {
    json::read(text.as_bytes()).map_err(|Unreadable { field, what, hint, .. }| {
        Fault { field: field.unwrap_or_else(|| whole.to_owned()), what, hint: hint.to_owned() }.into()
    })
}
