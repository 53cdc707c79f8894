//! A robot of the visitor's own: what its files say, a calibration file for them, the calibration, and what can be known before
//! anything is measured.
//!
//! Each request brings the files, or the session, that it is about: whoever asks may stop the whole worker at any time.

mod asked;
mod dialogue;
mod later;
mod meshes;
mod planned;
#[cfg(test)]
mod tests;

use std::{borrow::Cow, collections::BTreeMap};

use body_schema_ask_tell::{Ask, Session};
use body_schema_calibration::{
    Begun, Case, Certificate, File, InitError, Issue, Options, Progress, Sources, Taken, begin, calibrate, carried,
    name_of, with_roles, with_units,
};
use body_schema_diagnostics::{Diagnostic, Examination};
use body_schema_recording::{CalibrationLook, calibration_bytes};
use body_schema_robot::Urdf;
use body_schema_scenario::{BUILTIN, Scenario, WorldSpec, builtin};
use body_schema_table::{Quantity, Table, TableError, Titles};
use body_schema_wire::ObservabilityReport;
use serde_json::{Value, json};

use crate::{Answer, Kind, Problem, local::refused, read, recording_failed};
use asked::{Angle, Asked, Begin, Bench, Calibrate, Length, Observability, Plan};
use dialogue::Stage;
pub use meshes::Meshes;

/// What a request comes to.
#[derive(Debug)]
pub struct Worked {
    /// The answer, or a [`Problem`].
    pub answer: Answer,
    /// The scene of it, as the bytes of an .rrd file.
    pub recording: Option<Vec<u8>>,
}

/// An answer, and its scene.
type Answered = (Value, Option<Vec<u8>>);

/// Answers requests about robots of the visitor's own.
#[derive(Default)]
pub struct Workbench {
    /// The last session, under its text: the next request is probably about it.
    session: Option<(String, Session)>,
}

impl Workbench {
    /// Answers a request, which is JSON: `{"files": {NAME: TEXT, …}, "ask": {WHAT: {…}}, "recording": ID}`. Long work tells its
    /// progress. With `meshes` scenes draw the robot as itself.
    ///
    /// | ask | answer |
    /// |---|---|
    /// | `examples` | the measured robots that are built in: `[{name, title}]` |
    /// | `example {name}` | its calibration file and its files: `{file, text, files}` |
    /// | `describe {urdf, table}` | the links and joints of a description, the titles of a table, and the targets and cameras in these |
    /// | `begin {urdf, table, base, tip, on, tag_side_mm, socket_distance_mm, columns, angles, lengths}` | a first calibration file, what was guessed in it, what each column was taken for, and those whose titles say no unit; with `columns`, `angles` (`deg`) or `lengths` (`cm`, `mm`, `in`) the table whose titles say it |
    /// | `plan {urdf, base, tip, sensor}` | the same where nothing is measured yet, with an empty table |
    /// | `read {file, text, folds}` | what a calibration file comes to, and what is doubtful in its table |
    /// | `calibrate {file, text, folds, software}` | the verdict, the files that the command `calibrate` writes, the report among them, and the meshes for which capsules stand |
    /// | `observability {file, text, postures, accuracy_mm}` | what can be determined, and the postures to measure |
    /// | `watch {file, text, later, false_alarms_per_year, covariate}` | whether the robot has changed since, by the rows of a later table or those held out: `{changed, said, report, page}` |
    /// | `open {text}` | a session with a robot that somebody moves by hand |
    /// | `suggest {session}`, `observe {session, observation}`, `outcome {session, id, state, reason}`, `count {session, observation, counts}` | the session after it, and where it stands |
    /// | `results {session}` | its observations as files to calibrate by |
    ///
    /// A session is the text that [`Session::to_json`] writes.
    pub fn work(&mut self, request: &[u8], meshes: &Meshes, progress: &dyn Progress) -> Worked {
        match self.answer(request, meshes, progress) {
            Ok((answer, recording)) => {
                Worked { answer: Answer { status: 200, body: answer.to_string().into_bytes() }, recording }
            }
            Err(problem) => Worked { answer: refused(&problem), recording: None },
        }
    }

    fn answer(&mut self, request: &[u8], meshes: &Meshes, progress: &dyn Progress) -> Result<Answered, Problem> {
        let Bench { files, ask, recording } = read(request)?;
        let ask = serde_json::from_value(ask).map_err(|error| invalid(error.to_string()).field("ask"))?;
        let files = Files(files);
        let stage = Stage { recording: &recording, meshes };
        let answer = match ask {
            Asked::Examples {} => examples(),
            Asked::Example { name } => example(&name)?,
            Asked::Describe { urdf, table } => described(&files, &urdf, table.as_deref())?,
            Asked::Begin(asked) => begun(&files, &asked)?,
            Asked::Plan(asked) => plan(&files, &asked)?,
            Asked::Read { file, text, folds } => examined(&files, &file, &text, folds)?,
            Asked::Calibrate(asked) => return calibrated(&files, meshes, &asked, &recording, progress),
            Asked::Observability(asked) => observed(&files, &asked, progress)?,
            Asked::Watch(asked) => later::watched(&files, &asked, progress)?,
            Asked::Open { text } => return self.shown(dialogue::open(&files, &text, meshes)?, stage),
            Asked::Suggest { session } => {
                return self.change(session, stage, |it| it.suggest(&Ask::default(), None).map(drop));
            }
            Asked::Observe { session, observation } => {
                return self.change(session, stage, |it| it.observe(observation, None).map(drop));
            }
            Asked::Outcome { session, id, state, reason } => {
                return self.change(session, stage, |it| it.outcome(id, state, reason.as_deref(), None).map(drop));
            }
            Asked::Count { session, observation, counts: true } => {
                return self.change(session, stage, |it| it.include(observation, None));
            }
            Asked::Count { session, observation, counts: false } => {
                return self.change(session, stage, |it| it.exclude(observation, None));
            }
            Asked::Results { session } => self.results(session)?,
        };
        Ok((answer, None))
    }
}

/// Files by their names.
struct Files(BTreeMap<String, String>);

impl Files {
    fn text(&self, name: &str) -> Result<&str, String> {
        let listed = || self.0.keys().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let known = || if self.0.is_empty() { "nothing was".to_owned() } else { format!("there are {}", listed()) };
        // Names in a calibration file may lead through folders.
        let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let text = self.0.get(name).or_else(|| self.0.get(last));
        text.map(String::as_str).ok_or_else(|| format!("was not dropped here; {}", known()))
    }

    fn asked(&self, field: &str, name: &str) -> Result<&str, Problem> {
        self.text(name).map_err(|why| invalid(format!("the file `{name}` {why}")).field(field))
    }

    fn urdf(&self, name: &str) -> Result<Urdf, Problem> {
        let text = self.asked("urdf", name)?;
        Urdf::parse(text).map_err(|error| invalid(format!("{name}, {error}")).field("urdf"))
    }

    fn titles(&self, name: &str) -> Result<Titles, Problem> {
        let table = Table::open(self.asked("table", name)?.as_bytes());
        let table = table.map_err(|error| invalid(format!("{name}: {error}")).field("table"))?;
        Ok(table.titles().clone())
    }

    /// The scenario of a calibration file, whose prior is one; `parse` is one of [`Scenario`]'s.
    #[inline(never)]
    fn scenario(&self, file: &str, text: &str, parse: Parse) -> Result<Scenario, Problem> {
        let scenario = parse(file, text, &|name| self.text(name).map(str::to_owned)).map_err(of_text)?;
        scenario.check_prior().map_err(of_text)?;
        Ok(scenario)
    }
}

type Parse =
    fn(&str, &str, &dyn Fn(&str) -> Result<String, String>) -> Result<Scenario, body_schema_scenario::ScenarioError>;

/// Seconds since 1970, where the clock says so.
fn now_s() -> Option<f64> {
    let now = web_time::SystemTime::now().duration_since(web_time::UNIX_EPOCH);
    now.ok().map(|now| now.as_secs_f64())
}

fn invalid(detail: impl Into<String>) -> Problem {
    Problem::new(Kind::InvalidValue, detail)
}

/// What is wrong with a calibration file.
fn of_text(error: impl std::fmt::Display) -> Problem {
    invalid(error.to_string()).field("text")
}

/// Whether a scenario is a measured robot with a description.
fn is_example(scenario: &Scenario) -> bool {
    matches!(scenario.world, WorldSpec::Measured { .. }) && scenario.robot.described.is_some()
}

fn examples() -> Value {
    let all = BUILTIN.iter().filter_map(|it| builtin(it.name).ok());
    all.filter(is_example).map(|scenario| json!({ "name": scenario.name, "title": scenario.title })).collect()
}

fn example(name: &str) -> Result<Value, Problem> {
    let scenario = builtin(name).ok().filter(is_example);
    let scenario = scenario.ok_or_else(|| invalid(format!("there is no example `{name}`")).field("name"))?;
    let files: BTreeMap<&str, &str> = scenario.data.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    Ok(json!({ "file": format!("{name}.toml"), "text": scenario.source, "files": files }))
}

/// What a description has, and the titles of a table's columns.
fn described(files: &Files, urdf: &str, table: Option<&str>) -> Result<Value, Problem> {
    let (urdf, table) = (files.urdf(urdf)?, table.map(|name| files.titles(name)).transpose()?);
    let joints: Vec<Value> = urdf
        .joints()
        .filter(|joint| joint.moves().is_ok_and(|kind| kind.is_some()))
        .map(|joint| json!({ "name": joint.name, "parent": joint.parent, "child": joint.child, "mimics": joint.mimics() }))
        .collect();
    Ok(json!({
        "links": urdf.links(),
        "roots": urdf.roots().collect::<Vec<_>>(),
        "joints": joints,
        "titles": table.as_ref().map(Titles::all),
        "carried": table.as_ref().map(|titles| carried(&urdf, titles.all())),
    }))
}

fn begun(files: &Files, asked: &Begin) -> Result<Value, Problem> {
    let name = name_of(&asked.table);
    let dropped = files.asked("table", &asked.table)?;
    let of_table = |error: TableError| invalid(format!("{}: {error}", asked.table)).field("columns");
    let mut table = Cow::Borrowed(dropped);
    if !asked.columns.is_empty() {
        table = with_roles(&table, &asked.columns).map_err(of_table)?.into();
    }
    let on: Vec<(String, String)> = asked.on.clone().into_iter().collect();
    let mut sources = Sources {
        name: &name,
        urdf_file: &asked.urdf,
        urdf: files.asked("urdf", &asked.urdf)?,
        shapes_file: None,
        table_file: &asked.table,
        table: &table,
        base: asked.base.as_deref(),
        tip: asked.tip.as_deref(),
        on: &on,
        tag_side_m: asked.tag_side_mm.map(|mm| mm / 1e3),
        socket_distance_m: asked.socket_distance_mm.map(|mm| mm / 1e3),
    };
    let mut found = begun_from(&sources);
    // Where a row cannot be read, the units that are said may be why it can.
    let columns = match &found {
        Ok(found) => found.columns.clone(),
        Err(InitError::Row { columns, .. }) => columns.clone(),
        Err(_) => Vec::new(),
    };
    let said = [Quantity::Angle, Quantity::Length].map(|quantity| {
        let says = |column: &&Taken| column.quantity == Some(quantity) && column.says_no_unit();
        columns.iter().filter(says).map(|column| column.title.clone()).collect::<Vec<_>>()
    });
    let unitless = json!({ "angles": said[0], "lengths": said[1] });
    let roles: Vec<Value> =
        columns.iter().map(|Taken { title, role, .. }| json!({ "title": title, "role": role })).collect();
    let (angle, length) = (asked.angles.map(Angle::word), asked.lengths.map(Length::word));
    let in_units;
    if angle.or(length).is_some() && !columns.is_empty() {
        in_units = with_units(&table, &columns, angle, length).map_err(of_table)?;
        sources.table = &in_units;
        found = begun_from(&sources);
    }
    let mut answer = told_of(&name, &found.map_err(of_form)?);
    (answer["unitless"], answer["columns"]) = (unitless, roles.into());
    if sources.table != dropped {
        answer["table"] = json!({ "file": asked.table, "text": sources.table });
    }
    Ok(answer)
}

/// [`begin`], which is large, in one place of what the visitor's browser loads.
#[inline(never)]
fn begun_from(sources: &Sources<'_>) -> Result<Begun, InitError> {
    begin(sources)
}

/// What the command line calls an option is a field of the form here.
fn of_form(error: InitError) -> Problem {
    let said = error.to_string();
    invalid(said.replace("--base ", "base ").replace("--tip ", "tip ").replace("--on NAME=LINK", "in the form"))
}

fn told_of(name: &str, found: &Begun) -> Value {
    let guesses: Vec<Value> =
        found.guesses.iter().map(|guess| json!({ "said": guess.said, "field": guess.field })).collect();
    json!({ "file": format!("{name}.toml"), "text": found.text, "guesses": guesses })
}

/// A first calibration file where nothing is measured yet, and the empty table that it names.
fn plan(files: &Files, asked: &Plan) -> Result<Value, Problem> {
    let urdf = files.urdf(&asked.urdf)?;
    let name = name_of(&asked.urdf);
    let (table_file, table) = (format!("{name}.csv"), planned::table(&urdf, asked.sensor));
    let sources = Sources {
        name: &name,
        urdf_file: &asked.urdf,
        urdf: files.asked("urdf", &asked.urdf)?,
        shapes_file: None,
        table_file: &table_file,
        table: &table,
        base: asked.base.as_deref(),
        tip: asked.tip.as_deref(),
        on: &[],
        tag_side_m: None,
        socket_distance_m: None,
    };
    let mut begun = told_of(&name, &begun_from(&sources).map_err(of_form)?);
    begun["table"] = json!({ "file": table_file, "text": table });
    Ok(begun)
}

fn examined(files: &Files, file: &str, text: &str, folds: Option<usize>) -> Result<Value, Problem> {
    let scenario = files.scenario(file, text, Scenario::parse)?;
    let case = Case::new(&scenario).map_err(of_text)?;
    let splits = case.splits(folds).map_err(of_text)?;
    let Examination { diagnostics, unjudged, .. } = scenario.examine().unwrap_or_default();
    let held_out: usize = splits.iter().map(|split| split.held_out.len()).sum();
    Ok(json!({
        "joints": case.names.joints,
        "rows": case.rows.len(),
        "held_out": held_out,
        "folds": splits.len(),
        "unknowns": scenario.robot.layout.dimension(),
        "doubts": diagnostics.iter().map(told_diagnostic).collect::<Vec<_>>(),
        "unjudged": unjudged,
    }))
}

fn told_diagnostic(diagnostic: &Diagnostic) -> Value {
    let lines: Vec<Value> =
        diagnostic.lines.iter().map(|line| json!({ "file": line.file.as_deref(), "line": line.number })).collect();
    json!({
        "column": diagnostic.column,
        "lines": lines,
        "what": diagnostic.what,
        "evidence": diagnostic.evidence,
        "hint": diagnostic.hint,
    })
}

fn calibrated(
    files: &Files,
    meshes: &Meshes,
    asked: &Calibrate,
    recording: &str,
    progress: &dyn Progress,
) -> Result<Answered, Problem> {
    let scenario = files.scenario(&asked.file, &asked.text, Scenario::parse)?;
    let case = Case::new(&scenario).map_err(of_text)?;
    let options = Options { folds: asked.folds, ..Options::default() };
    let found = calibrate(&case, &options, progress).map_err(of_text)?;
    progress.stage("the report", 1);
    let mut written = found.files(&case).map_err(of_text)?;
    written.extend(body_schema_report::files(&found, &case));
    let program = asked.software.as_deref().unwrap_or(concat!("body-schema ", env!("CARGO_PKG_VERSION")));
    let issue = Issue {
        software: format!("{program}, on a page"),
        file: asked.file.clone(),
        folds: asked.folds,
        at_s: now_s().map(f64::floor),
    };
    written.extend(body_schema_report::certificate_files(&Certificate::of(&found, &case, &issue)));
    let markdown = body_schema_report::markdown(&found, &case);
    let (appearance, undrawn) = meshes::appearance(&scenario, meshes);
    let look = CalibrationLook { appearance, enlarged: None };
    let recording = calibration_bytes(&found, &case, &markdown, &look, recording).map_err(recording_failed)?;
    progress.tick();
    let told = found.report.verdict.said(if found.report.chain.is_some() { "calibrated.urdf" } else { "these axes" });
    let files: Vec<Value> =
        written.into_iter().map(|File { path, text }| json!({ "path": path, "text": text })).collect();
    Ok((json!({ "said": told, "files": files, "undrawn": undrawn }), Some(recording)))
}

fn observed(files: &Files, asked: &Observability, progress: &dyn Progress) -> Result<Value, Problem> {
    if !(1..=1000).contains(&asked.postures) {
        return Err(invalid("write a number from 1 to 1000").field("postures"));
    }
    // A table that can be read tells of sockets, and of where the robot has been. Its readings do not count.
    let scenario = files.scenario(&asked.file, &asked.text, Scenario::parse).or_else(|_| {
        let text = planned::without_table(&asked.text).map_err(of_text)?;
        files.scenario(&asked.file, &text, Scenario::parse_outside)
    })?;
    let wanted_m = asked.accuracy_mm.map_or(scenario.settled_below_m, |mm| mm * 1e-3);
    let prospect = scenario.prospect().map_err(of_text)?;
    progress.stage("postures", prospect.steps(asked.postures) as u64);
    let found = prospect.observability(asked.postures, wanted_m, &|| progress.tick());
    let found = found.map_err(|error| invalid(format!("no postures can be chosen: {error}")).field("text"))?;
    let table = planned::postures(&scenario, &asked.text, &found.best);
    let names = scenario.robot.called();
    let report = ObservabilityReport::of(&found, &prospect, &names, &scenario.name, &scenario.title);
    Ok(json!({ "found": report, "table": table }))
}
