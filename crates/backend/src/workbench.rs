//! A robot of the visitor's own: what its files say, a calibration file for them, the calibration, and what can be known before
//! anything is measured.
//!
//! Each request brings the files, or the session, that it is about: whoever asks may stop the whole worker at any time.

mod asked;
mod dialogue;
mod planned;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use body_schema_ask_tell::Session;
use body_schema_calibration::{Case, File, Guess, Options, Progress, Sources, begin, calibrate, name_of};
use body_schema_diagnostics::Doubt;
use body_schema_recording::{Appearance, CalibrationLook, calibration_bytes};
use body_schema_robot::Urdf;
use body_schema_scenario::{BUILTIN, Scenario, WorldSpec, builtin};
use serde::Serialize;
use serde_json::{Value, json};

use crate::{Kind, Problem, read};
use asked::{Asked, Begin, Bench, Calibrate, Observe, Plan};

/// What a request comes to.
#[derive(Debug)]
pub struct Worked {
    /// HTTP's status.
    pub status: u16,
    /// JSON: the answer, or a [`Problem`].
    pub body: Vec<u8>,
    /// The recording of a calibration, as the bytes of an .rrd file.
    pub recording: Option<Vec<u8>>,
}

/// Answers requests about robots of the visitor's own.
#[derive(Default)]
pub struct Workbench {
    /// The last session, under its text: the next request is probably about it.
    session: Option<(String, Session)>,
}

impl Workbench {
    /// Answers a request, which is JSON: `{"files": {NAME: TEXT, …}, "ask": {WHAT: {…}}}`. Long work tells its progress.
    ///
    /// | ask | answer |
    /// |---|---|
    /// | `examples` | the measured robots that are built in: `[{name, title}]` |
    /// | `example {name}` | its calibration file and its files: `{file, text, files}` |
    /// | `describe {urdf}` | the links and joints of a description |
    /// | `begin {urdf, table, base, tip, socket_distance_mm}` | a first calibration file, and what was guessed in it |
    /// | `plan {urdf, base, tip, sensor}` | the same where nothing is measured yet, with an empty table |
    /// | `read {file, text}` | what a calibration file comes to, and what is doubtful in its table |
    /// | `calibrate {file, text, folds, recording}` | the report, and the files that the command `calibrate` writes |
    /// | `observability {file, text, postures, accuracy_mm}` | what can be determined, and the postures to measure |
    /// | `open {text}` | a session with a robot that somebody moves by hand |
    /// | `suggest {session}`, `observe {session, observation}`, `outcome {session, id, state, reason}`, `count {session, observation, counts}` | the session after it, and where it stands |
    /// | `results {session}` | its observations as files to calibrate by |
    ///
    /// A session is the text that [`Session::to_json`] writes.
    pub fn work(&mut self, request: &[u8], progress: &dyn Progress) -> Worked {
        match self.answer(request, progress) {
            Ok((answer, recording)) => Worked { status: 200, body: answer.to_string().into_bytes(), recording },
            Err(problem) => {
                // What is serialised holds names and texts alone.
                let body = serde_json::to_vec(&problem).unwrap_or_default();
                Worked { status: problem.status, body, recording: None }
            }
        }
    }

    fn answer(&mut self, request: &[u8], progress: &dyn Progress) -> Result<(Value, Option<Vec<u8>>), Problem> {
        let Bench { files, ask } = read(request)?;
        let ask = serde_json::from_value(ask).map_err(|error| invalid(error.to_string()).field("ask"))?;
        let files = Files(files);
        let answer = match ask {
            Asked::Examples {} => examples(),
            Asked::Example { name } => example(&name)?,
            Asked::Describe { urdf } => described(&files.urdf(&urdf)?),
            Asked::Begin(asked) => begun(&files, &asked)?,
            Asked::Plan(asked) => plan(&files, &asked)?,
            Asked::Read { file, text } => examined(&files, &file, &text)?,
            Asked::Calibrate(asked) => return calibrated(&files, &asked, progress),
            Asked::Observability(asked) => observed(&files, &asked, progress)?,
            Asked::Open { text } => return self.open(&files, &text),
            Asked::Suggest { session } => return self.suggest(session),
            Asked::Observe { session, observation } => return self.observe(session, observation),
            Asked::Outcome { session, id, state, reason } => {
                return self.outcome(session, id, state, reason.as_deref());
            }
            Asked::Count { session, observation, counts } => return self.count(session, observation, counts),
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

    /// The scenario of a calibration file; `parse` is one of [`Scenario`]'s.
    fn scenario(&self, file: &str, text: &str, parse: Parse) -> Result<Scenario, Problem> {
        let scenario = parse(file, text, &|name| self.text(name).map(str::to_owned));
        scenario.map_err(|error| invalid(error.to_string()).field("text"))
    }
}

type Parse =
    fn(&str, &str, &dyn Fn(&str) -> Result<String, String>) -> Result<Scenario, body_schema_scenario::ScenarioError>;

fn invalid(detail: impl Into<String>) -> Problem {
    Problem::new(Kind::InvalidValue, detail)
}

/// The measured robots with a description that are built in.
fn measured() -> impl Iterator<Item = Scenario> {
    let all = BUILTIN.iter().filter_map(|it| builtin(it.name).ok());
    all.filter(|it| matches!(it.world, WorldSpec::Measured { .. }) && it.robot.described.is_some())
}

fn examples() -> Value {
    measured().map(|scenario| json!({ "name": scenario.name, "title": scenario.title })).collect()
}

fn example(name: &str) -> Result<Value, Problem> {
    let scenario = measured().find(|scenario| scenario.name == name);
    let scenario = scenario.ok_or_else(|| invalid(format!("there is no example `{name}`")).field("name"))?;
    let files: BTreeMap<&str, &str> = scenario.data.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    Ok(json!({ "file": format!("{name}.toml"), "text": scenario.source, "files": files }))
}

fn described(urdf: &Urdf) -> Value {
    let joints: Vec<Value> = urdf
        .joints()
        .filter(|joint| joint.moves().is_ok_and(|kind| kind.is_some()))
        .map(|joint| json!({ "name": joint.name, "parent": joint.parent, "child": joint.child, "mimics": joint.mimics() }))
        .collect();
    json!({
        "name": urdf.name(),
        "links": urdf.links(),
        "roots": urdf.roots().collect::<Vec<_>>(),
        "leaves": urdf.leaves().collect::<Vec<_>>(),
        "joints": joints,
    })
}

fn begun(files: &Files, asked: &Begin) -> Result<Value, Problem> {
    let name = name_of(&asked.table);
    begun_from(&Sources {
        name: &name,
        urdf_file: &asked.urdf,
        urdf: files.asked("urdf", &asked.urdf)?,
        table_file: &asked.table,
        table: files.asked("table", &asked.table)?,
        base: asked.base.as_deref(),
        tip: asked.tip.as_deref(),
        socket_distance_m: asked.socket_distance_mm.map(|mm| mm / 1e3),
    })
}

fn begun_from(sources: &Sources<'_>) -> Result<Value, Problem> {
    // What the command line calls an option is a field of the form here.
    let found = begin(sources).map_err(|error| invalid(error.to_string().replace("--", "")))?;
    let guesses: Vec<Value> = found.guesses.iter().map(guessed).collect();
    Ok(json!({ "file": format!("{}.toml", sources.name), "text": found.text, "guesses": guesses }))
}

fn guessed(guess: &Guess) -> Value {
    let field = guess.option.as_ref().and_then(|option| {
        let name = option.split("--").nth(1)?.split(' ').next()?;
        Some(name.replace('-', "_"))
    });
    json!({ "said": guess.said, "field": field })
}

/// A first calibration file where nothing is measured yet, and the empty table that it names.
fn plan(files: &Files, asked: &Plan) -> Result<Value, Problem> {
    let urdf = files.urdf(&asked.urdf)?;
    let name = name_of(&asked.urdf);
    let (table_file, table) = (format!("{name}.csv"), planned::table(&urdf, asked.sensor));
    let mut begun = begun_from(&Sources {
        name: &name,
        urdf_file: &asked.urdf,
        urdf: files.asked("urdf", &asked.urdf)?,
        table_file: &table_file,
        table: &table,
        base: asked.base.as_deref(),
        tip: asked.tip.as_deref(),
        socket_distance_m: None,
    })?;
    begun["table"] = json!({ "file": table_file, "text": table });
    Ok(begun)
}

fn examined(files: &Files, file: &str, text: &str) -> Result<Value, Problem> {
    let scenario = files.scenario(file, text, Scenario::parse)?;
    scenario.check_prior().map_err(|error| invalid(error.to_string()).field("text"))?;
    let case = Case::new(&scenario).map_err(|error| invalid(error.to_string()).field("text"))?;
    let splits = case.splits(None).map_err(|error| invalid(error.to_string()).field("text"))?;
    let doubts = scenario.examine().map(|found| found.doubts).unwrap_or_default();
    let held_out: usize = splits.iter().map(|split| split.held_out.len()).sum();
    Ok(json!({
        "name": scenario.name,
        "title": scenario.title,
        "joints": case.names.joints,
        "rows": case.rows.len(),
        "held_out": held_out,
        "folds": splits.len(),
        "unknowns": scenario.robot.layout.dimension(),
        "doubts": doubts.iter().map(doubted).collect::<Vec<_>>(),
    }))
}

fn doubted(doubt: &Doubt) -> Value {
    let lines: Vec<Value> =
        doubt.lines.iter().map(|line| json!({ "file": line.file.as_deref(), "line": line.number })).collect();
    json!({
        "column": doubt.column,
        "lines": lines,
        "what": doubt.what,
        "evidence": doubt.evidence,
        "hint": doubt.hint,
    })
}

fn calibrated(files: &Files, asked: &Calibrate, progress: &dyn Progress) -> Result<(Value, Option<Vec<u8>>), Problem> {
    let failed = |error: &dyn std::fmt::Display| invalid(error.to_string()).field("text");
    let scenario = files.scenario(&asked.file, &asked.text, Scenario::parse)?;
    scenario.check_prior().map_err(|error| failed(&error))?;
    let case = Case::new(&scenario).map_err(|error| failed(&error))?;
    let options = Options { folds: asked.folds, active: None };
    let found = calibrate(&case, &options, progress).map_err(|error| failed(&error))?;
    progress.stage("the report", 1);
    let mut written = found.files(&case).map_err(|error| failed(&error))?;
    written.extend(body_schema_report::files(&found, &case));
    let markdown = body_schema_report::markdown(&found, &case);
    let id = asked.recording.as_deref().unwrap_or(&scenario.name);
    let look = CalibrationLook { appearance: Appearance::of(&scenario), enlarged: None };
    let recording = calibration_bytes(&found, &case, &markdown, &look, id)
        .map_err(|error| Problem::new(Kind::EngineFailed, format!("the recording cannot be made: {error}")))?;
    progress.tick();
    let told = found.report.verdict.said(if found.report.chain.is_some() { "calibrated.urdf" } else { "these axes" });
    let files: Vec<Value> =
        written.into_iter().map(|File { path, text }| json!({ "path": path, "text": text })).collect();
    Ok((
        json!({ "name": scenario.name, "said": told, "report": told_of(&found.report)?, "files": files }),
        Some(recording),
    ))
}

fn observed(files: &Files, asked: &Observe, progress: &dyn Progress) -> Result<Value, Problem> {
    let text = planned::without_table(&asked.text).map_err(|error| invalid(error).field("text"))?;
    let scenario = files.scenario(&asked.file, &text, Scenario::parse_outside)?;
    scenario.check_prior().map_err(|error| invalid(error.to_string()).field("text"))?;
    let wanted_m = asked.accuracy_mm.map_or(scenario.settled_below_m, |mm| mm * 1e-3);
    let prospect = scenario.prospect();
    progress.stage("postures", prospect.steps(asked.postures) as u64);
    let found = prospect.observability(asked.postures, wanted_m, &|| progress.tick());
    let found = found.map_err(|error| invalid(format!("no postures can be chosen: {error}")).field("text"))?;
    let table = planned::postures(&scenario, &asked.text, &found);
    Ok(json!({ "found": told_of(&found)?, "table": table }))
}

fn told_of(found: &impl Serialize) -> Result<Value, Problem> {
    serde_json::to_value(found).map_err(|error| Problem::new(Kind::EngineFailed, error.to_string()))
}
