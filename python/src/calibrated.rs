//! Tables that are calibrated, and robots that are looked at before anything is measured.

use std::path::Path;

use body_schema_ask_tell::Fault;
use body_schema_calibration::{Calibration, Case, Options, Sources, begin, calibrate, name_of};
use body_schema_engine::model::{Hand, Layout, State, jacobian};
use body_schema_scenario::Scenario;
use body_schema_wire::ObservabilityReport;
use pyo3::prelude::*;

use crate::{files, refusal::Failure, waiting::heard};

/// A calibration that has been made: its report, its files, and the robot as described and as learned.
#[pyclass(frozen)]
pub struct Calibrated {
    scenario: Scenario,
    layout: Layout,
    found: Calibration,
    files: Vec<(String, String)>,
    guesses: Vec<String>,
}

/// A first calibration file from a URDF and a table, and what had to be guessed.
fn begun(
    urdf: &str,
    table: &str,
    base: Option<&str>,
    tip: Option<&str>,
    (on, tag_side_m): (&[(String, String)], Option<f64>),
    socket_distance_m: Option<f64>,
    keys: &str,
) -> Result<(Scenario, Vec<String>), Failure> {
    let (urdf_text, table_text) = (files::text(urdf)?, files::text(table)?);
    let begun = begin(&Sources {
        name: &name_of(table),
        urdf_file: urdf,
        urdf: &urdf_text,
        shapes_file: None,
        table_file: table,
        table: &table_text,
        base,
        tip,
        on,
        tag_side_m,
        socket_distance_m,
    });
    let begun = begun.map_err(|error| Failure::new("EngineError", error))?;
    let open = |file: &str| match file {
        _ if file == urdf => Ok(urdf_text.clone()),
        _ if file == table => Ok(table_text.clone()),
        // What keys name lies beside the URDF.
        _ => std::fs::read_to_string(Path::new(urdf).with_file_name(file)).map_err(|error| error.to_string()),
    };
    let text = with_keys(begun.text, keys)?;
    let scenario = Scenario::parse(&format!("the calibration file of {urdf} and {table}"), &text, &open)?;
    Ok((scenario, begun.guesses.iter().map(ToString::to_string).collect()))
}

/// A calibration file with keys, a JSON object, in place of its own: tables key by key, `held_out` and all else as a whole.
fn with_keys(text: String, keys: &str) -> Result<String, Failure> {
    let keys: toml::Table = serde_json::from_str(keys).map_err(|error| Fault {
        field: "keys".to_owned(),
        what: format!("a calibration file has no such value: {error}"),
        hint: "write numbers, texts, lists and dicts, and leave out what is None".to_owned(),
    })?;
    if keys.is_empty() {
        return Ok(text);
    }
    let of_engine = |error: String| Failure::new("EngineError", error);
    let mut made: toml::Table = toml::from_str(&text).map_err(|error| of_engine(error.to_string()))?;
    for (key, value) in keys {
        // What is held out is said in one way.
        match (made.get_mut(&key).filter(|_| key != "held_out"), value) {
            (Some(toml::Value::Table(made)), toml::Value::Table(own)) => made.extend(own),
            (_, value) => drop(made.insert(key, value)),
        }
    }
    toml::to_string(&made).map_err(|error| of_engine(error.to_string()))
}

/// Calibrates a robot: from a calibration file alone, or from a URDF and a table; `hear` is told how far it is.
#[pyfunction]
#[pyo3(signature = (file, table=None, base=None, tip=None, on=Vec::new(), tag_side_m=None, socket_distance_m=None, folds=None, active=None, hear=None, keys="{}"))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub fn calibrate_table(
    py: Python<'_>,
    file: String,
    table: Option<String>,
    base: Option<String>,
    tip: Option<String>,
    on: Vec<(String, String)>,
    tag_side_m: Option<f64>,
    socket_distance_m: Option<f64>,
    folds: Option<usize>,
    active: Option<usize>,
    hear: Option<Py<PyAny>>,
    keys: &str,
) -> PyResult<Calibrated> {
    let keys = keys.to_owned();
    let made = heard(py, hear, move |progress| -> Result<Calibrated, Failure> {
        let (scenario, guesses) = match table {
            Some(table) => {
                begun(&file, &table, base.as_deref(), tip.as_deref(), (&on, tag_side_m), socket_distance_m, &keys)?
            }
            None => (files::scenario(&file)?, Vec::new()),
        };
        scenario.check_prior()?;
        let of_calibration = |error| Failure::new("EngineError", error);
        let (layout, found, files) = {
            let case = Case::new(&scenario).map_err(of_calibration)?;
            let found = calibrate(&case, &Options { folds, active }, progress).map_err(of_calibration)?;
            let files = found.files(&case).map_err(of_calibration)?;
            (case.writable(), found, files)
        };
        let files = files.into_iter().map(|file| (file.path, file.text)).collect();
        Ok(Calibrated { scenario, layout, found, files, guesses })
    })?;
    Ok(made?)
}

/// What movements could determine, before any measurement, as JSON.
#[pyfunction]
#[pyo3(signature = (file, postures=30, accuracy_m=None))]
pub fn observability(py: Python<'_>, file: &str, postures: usize, accuracy_m: Option<f64>) -> PyResult<String> {
    let answer = py.detach(|| -> Result<String, Failure> {
        if !(1..=1000).contains(&postures) {
            let (what, hint) = (format!("{postures} is out of range"), "write a number from 1 to 1000".to_owned());
            return Err(Fault { field: "postures".to_owned(), what, hint }.into());
        }
        if let Some(wanted) = accuracy_m.filter(|wanted| !(wanted.is_finite() && *wanted > 0.0)) {
            let (what, hint) = (format!("{wanted} is no length"), "write metres, above 0".to_owned());
            return Err(Fault { field: "accuracy_m".to_owned(), what, hint }.into());
        }
        let scenario = files::robot(file)?;
        scenario.check_prior()?;
        let wanted_m = accuracy_m.unwrap_or(scenario.settled_below_m);
        let prospect = scenario.prospect()?;
        let found = prospect.observability(postures, wanted_m, &|| ());
        let found = found.map_err(|error| Failure::new("EngineError", error))?;
        let names = scenario.robot.called();
        let report = ObservabilityReport::of(&found, &prospect, &names, &scenario.name, &scenario.title);
        serde_json::to_string(&report).map_err(|error| Failure::new("EngineError", error))
    });
    Ok(answer?)
}

impl Calibrated {
    fn state(&self, nominal: bool) -> &State {
        if nominal { self.found.nominal.state() } else { self.found.fit.state() }
    }

    /// The positions of the joints that are learned, of the readings in the order of [`joints`](Self::joints).
    fn positions(&self, readings: &[f64]) -> Result<Vec<f64>, Failure> {
        let wanted = self.names().len();
        if readings.len() != wanted {
            let (what, hint) =
                (format!("{} numbers are none of {wanted} joints", readings.len()), "write one position per joint");
            return Err(Fault { field: "configuration".to_owned(), what, hint: hint.to_owned() }.into());
        }
        let described = self.scenario.robot.described.as_deref();
        Ok(described.map_or_else(|| readings.to_vec(), |described| described.chain.positions(readings)))
    }

    fn names(&self) -> Vec<String> {
        match self.scenario.robot.described.as_deref() {
            Some(described) => described.chain.readings.iter().map(|reading| reading.name.clone()).collect(),
            None => self.scenario.robot.names.clone(),
        }
    }
}

#[pymethods]
impl Calibrated {
    /// The names of the joints whose readings a posture has.
    fn joints(&self) -> Vec<String> {
        self.names()
    }

    /// The content of `report.json`.
    fn report(&self) -> PyResult<String> {
        let text = serde_json::to_string(&self.found.report).map_err(|error| Failure::new("EngineError", error));
        Ok(text?)
    }

    /// The files that `calibrate` writes, but for pages and pictures: path and text.
    fn files(&self) -> Vec<(String, String)> {
        self.files.clone()
    }

    /// What had to be guessed.
    fn guesses(&self) -> Vec<String> {
        self.guesses.clone()
    }

    /// The pose of a target, a camera or the hand at a posture, 4 × 4.
    #[pyo3(signature = (readings, nominal, of=None))]
    fn fk(&self, readings: Vec<f64>, nominal: bool, of: Option<&str>) -> PyResult<Vec<Vec<f64>>> {
        let state = self.state(nominal);
        let pose = state.frame_at(self.hand(of, state)?.frame(), &self.positions(&readings)?).to_homogeneous();
        Ok(rows(4, 4, |row, column| pose[(row, column)]))
    }

    /// The Jacobian of that pose by the readings of the joints that are learned, 6 × n.
    #[pyo3(signature = (readings, nominal, of=None))]
    fn jacobian(&self, readings: Vec<f64>, nominal: bool, of: Option<&str>) -> PyResult<Vec<Vec<f64>>> {
        let state = self.state(nominal);
        let jacobian = state.frame_jacobian(self.hand(of, state)?.frame(), &self.positions(&readings)?);
        let by_positions = rows(6, jacobian.ncols(), |row, column| jacobian[(row, column)]);
        let Some(described) = self.scenario.robot.described.as_deref() else { return Ok(by_positions) };
        // A joint that follows another moves with its reading.
        let count = self.names().len();
        let by_readings = |row: Vec<f64>| {
            let mut sums = vec![0.0; count];
            for (follows, x) in described.chain.moving().filter_map(|segment| segment.follows.as_ref()).zip(row) {
                follows.terms.iter().for_each(|(reading, multiplier)| sums[*reading] += multiplier * x);
            }
            sums
        };
        Ok(by_positions.into_iter().map(by_readings).collect())
    }

    /// The covariance of the predicted position of a target, a camera or the hand at a posture, 3 × 3, m².
    #[pyo3(signature = (readings, of=None))]
    fn covariance(&self, readings: Vec<f64>, of: Option<&str>) -> PyResult<Vec<Vec<f64>>> {
        let belief = &self.found.fit.belief;
        let missing = || Failure::new("EngineError", "the fit has no covariance");
        let covariance =
            belief.covariance.as_ref().filter(|p| p.nrows() == self.layout.dimension()).ok_or_else(missing)?;
        let state = State { hand: self.hand(of, &belief.state)?, ..belief.state.clone() };
        let (_, h) = jacobian(&state, &self.layout, &self.positions(&readings)?);
        let spread = &h * covariance * h.transpose();
        Ok(rows(3, 3, |row, column| spread[(row, column)]))
    }
}

impl Calibrated {
    /// A target or camera by its name; the hand without one.
    fn hand(&self, of: Option<&str>, state: &State) -> Result<Hand, Failure> {
        let Some(name) = of else { return Ok(state.hand) };
        let equipment = &self.scenario.robot.equipment;
        let target = equipment.targets.iter().position(|target| target.name == name).map(Hand::Target);
        let camera = || equipment.cameras.iter().position(|camera| camera.name == name).map(Hand::Device);
        target.or_else(camera).ok_or_else(|| {
            let targets = equipment.targets.iter().map(|target| target.name.as_str());
            let known: Vec<&str> = targets.chain(equipment.cameras.iter().map(|camera| camera.name.as_str())).collect();
            let hint = format!("write one of {}", known.join(", "));
            Fault { field: "of".to_owned(), what: format!("there is no target or camera `{name}`"), hint }.into()
        })
    }
}

/// A matrix by the numbers in its places, row by row.
fn rows(count: usize, columns: usize, at: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..count).map(|row| (0..columns).map(|column| at(row, column)).collect()).collect()
}
