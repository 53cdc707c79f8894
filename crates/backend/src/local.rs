//! Sessions in one thread, with nobody else: what the visitor's browser has in place of a server.

use std::time::Duration;

use body_schema_experiment::Experiment;
use body_schema_recording::{LiveLog, Recorder, Target};
use body_schema_scenario::{Scenario, WorldKind};
use body_schema_wire::{AppraisalReport, Choice, Description, RunResult};
use bytes::Bytes;
use percent_encoding::percent_decode_str;
use serde::Serialize;
use serde_json::{json, to_vec};
use web_time::Instant;

use crate::{
    Configuration, ConfigurationRequest, EvaluationRequest, Kept, Kind, MadeSteps, NewSession, Problem, Scenarios,
    SessionResource, StepRequest, Steps, arrangement, read, recording_failed, table_head, watched::Watched, world,
};

/// How many steps a session makes at most: what a browser's memory holds of it.
const MOST_STEPS: u64 = 100_000;
/// How many steps one request makes at most.
const MOST_STEPS_PER_REQUEST: u64 = 1000;

/// What is answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// HTTP's status.
    pub status: u16,
    /// JSON, or the bytes of a file.
    pub body: Vec<u8>,
}

/// How long steps are made until they are shown, together: a viewer takes as long for the message of one step as for that of many, and
/// whoever stops the run waits no longer.
const MOMENT: Duration = Duration::from_millis(100);

/// What comes of asking.
pub enum Asked {
    /// The answer.
    Done(Answer),
    /// Steps that are still to be made, some at a time, by [`Local::go_on`].
    Begun(Job),
}

/// Steps that are being made.
pub struct Job {
    session: String,
    request: StepRequest,
    made: u64,
}

/// Some sessions.
pub struct Local {
    scenarios: Scenarios,
    sessions: Vec<Session>,
    /// Makes the id of a session.
    ids: Box<dyn FnMut() -> String>,
}

struct Session {
    id: String,
    made: Made,
    live: LiveLog,
    history: Vec<Kept>,
}

/// How the steps of a session are made.
enum Made {
    /// Here.
    Steps(Steps),
    /// By a robot, some time ago.
    Watched(Watched),
}

impl Local {
    /// None yet; `ids` makes their ids, each another.
    pub fn new(ids: impl FnMut() -> String + 'static) -> Self {
        Self { scenarios: Scenarios::default(), sessions: Vec::new(), ids: Box::new(ids) }
    }

    /// Adds a scenario from the text of its file, and of those that it names. It takes the place of another of its name.
    ///
    /// # Errors
    ///
    /// [`Kind::EngineFailed`] where it is not valid.
    pub fn add(&mut self, file: &str, source: &str, data: &[(String, String)]) -> Result<(), Problem> {
        let open = |wanted: &str| {
            let found = data.iter().find(|(name, _)| name == wanted).map(|(_, text)| text.clone());
            found.ok_or_else(|| "is not in this folder".to_owned())
        };
        self.scenarios.add(Scenario::parse(file, source, &open)?);
        Ok(())
    }

    /// Takes up a session with a robot elsewhere as it was written down, to be watched: its events happen again, and no more of them.
    ///
    /// # Errors
    ///
    /// [`Kind::EngineFailed`] where it is no such session, [`Kind::Internal`] where it cannot be recorded.
    pub fn take_up(&mut self, id: &str, written: &str) -> Result<(), Problem> {
        let live = LiveLog::new();
        let (watched, history) = Watched::replay(written, Target::live(live.clone()).with_recording_id(id))?;
        self.sessions.retain(|session| session.id != id);
        self.sessions.push(Session { id: id.to_owned(), made: Made::Watched(watched), live, history });
        Ok(())
    }

    /// Answers a request as a server's routes would; `path` with its query.
    pub fn ask(&mut self, method: &str, path: &str, body: &[u8]) -> Asked {
        self.answer(method, path, body).unwrap_or_else(|problem| Asked::Done(refused(&problem)))
    }

    /// Answers a request, all its steps made.
    pub fn answered(&mut self, method: &str, path: &str, body: &[u8]) -> Answer {
        match self.ask(method, path, body) {
            Asked::Done(answer) => answer,
            Asked::Begun(mut job) => loop {
                if let Some(answer) = self.go_on(&mut job) {
                    return answer;
                }
            },
        }
    }

    /// Makes more of the steps, as many as a moment allows and at least one; the answer once all are made or one could not be. A job
    /// that is dropped has made what it has made.
    pub fn go_on(&mut self, job: &mut Job) -> Option<Answer> {
        self.step(job).unwrap_or_else(|problem| Some(refused(&problem)))
    }

    /// The recording of a session from part `from` on, arranged for a page, and its reports from step `step` on, each as one message;
    /// behind the reports of a robot's session, how it stands. `None` where there is no such session.
    pub fn news(&self, id: &str, from: usize, step: usize) -> Option<(Vec<Bytes>, Vec<String>)> {
        let session = self.sessions.iter().find(|session| session.id == id)?;
        let reports = session.history.iter().skip(step);
        let reports = reports.map(|kept| format!("{{\"type\":\"step\",\"data\":{}}}", kept.json.get()));
        let standing = match &session.made {
            Made::Watched(watched) if step <= session.history.len() => Some(watched.standing()),
            _ => None,
        };
        Some((session.live.scene_parts_from(from), reports.chain(standing).collect()))
    }

    fn answer(&mut self, method: &str, path: &str, body: &[u8]) -> Result<Asked, Problem> {
        let (path, query) = path.split_once('?').map_or((path, None), |(path, query)| (path, Some(query)));
        let decoded = |part: &str| percent_decode_str(part).decode_utf8_lossy().into_owned();
        let parts: Vec<String> = path.trim_start_matches('/').split('/').map(decoded).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        let answer = match (method, parts.as_slice()) {
            ("GET", ["v1", "scenarios"]) => ok(&self.scenarios.list()?)?,
            ("GET", ["v1", "scenarios", name]) => ok(&self.scenarios.resource(name)?)?,
            ("GET", ["v1", "sessions"]) => {
                let sessions: Vec<SessionResource> = self.sessions.iter().map(Session::resource).collect();
                ok(&json!({ "sessions": sessions }))?
            }
            ("POST", ["v1", "sessions"]) => self.open(&read(body)?)?,
            ("GET", ["v1", "sessions", id]) => ok(&self.session(id)?.resource())?,
            ("DELETE", ["v1", "sessions", id]) => {
                self.session(id)?;
                self.sessions.retain(|session| session.id != *id);
                Answer { status: 204, body: Vec::new() }
            }
            ("POST", ["v1", "sessions", id, "steps"]) => {
                let request: StepRequest = read(body)?;
                request.check(MOST_STEPS_PER_REQUEST)?;
                self.session(id)?.steps()?.may_make(request.count, request.expected_step)?;
                return Ok(Asked::Begun(Job { session: (*id).to_owned(), request, made: 0 }));
            }
            ("GET", ["v1", "sessions", id, "learners", name, "selection"]) => {
                ok(&Choice::of(self.session(id)?.experiment(), name)?)?
            }
            ("POST", ["v1", "sessions", id, "learners", name, "evaluations"]) => {
                let asked: EvaluationRequest = read(body)?;
                match &mut self.session_mut(id)?.made {
                    Made::Steps(steps) => ok(&steps.appraise(name, &asked)?)?,
                    Made::Watched(watched) => {
                        let appraised = watched.experiment().appraise(name, &asked.configuration)?;
                        ok(&AppraisalReport::from(&appraised))?
                    }
                }
            }
            ("GET", ["v1", "sessions", id, "learners", name, "configuration"]) => {
                ok(&Configuration { configuration: self.session(id)?.steps()?.configuration(name)? })?
            }
            ("POST", ["v1", "sessions", id, "learners", name, "configuration"]) => {
                let ConfigurationRequest { configuration } = read(body)?;
                ok(&self.session_mut(id)?.steps_mut()?.set_configuration(name, &configuration)?)?
            }
            ("GET", ["v1", "sessions", id, "result.json"]) => ok(&RunResult::of(self.session(id)?.experiment()))?,
            ("GET", ["v1", "sessions", id, "steps.csv"]) => file(self.session(id)?.table()?),
            ("GET", ["v1", "sessions", id, "recording.rrd"]) => {
                let session = self.session_mut(id)?;
                session.recorder().flush().map_err(recording_failed)?;
                let complete = session.live.complete();
                file(complete.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?)
            }
            ("GET", ["v1", "sessions", id, "blueprint.rbl"]) => {
                let session = self.session(id)?;
                file(arrangement(&session.live, &session.description().learners, query)?.to_vec())
            }
            ("GET", ["v1", "sessions", id, name]) if let Made::Watched(watched) = &self.session(id)?.made => {
                file(watched.file(name)?)
            }
            _ => {
                let detail = format!("{method} {path} needs a server: start `body-schema serve`");
                return Err(Problem::new(Kind::UnknownRoute, detail));
            }
        };
        Ok(Asked::Done(answer))
    }

    fn session(&self, id: &str) -> Result<&Session, Problem> {
        self.sessions.iter().find(|session| session.id == id).ok_or_else(|| Problem::unknown_session(id))
    }

    fn session_mut(&mut self, id: &str) -> Result<&mut Session, Problem> {
        self.sessions.iter_mut().find(|session| session.id == id).ok_or_else(|| Problem::unknown_session(id))
    }

    fn open(&mut self, new: &NewSession) -> Result<Answer, Problem> {
        let (id, live) = ((self.ids)(), LiveLog::new());
        let target = Target::live(live.clone()).with_recording_id(&id);
        let (steps, start) = Steps::open(&*self.scenarios.find(&new.scenario)?, new, target, MOST_STEPS)?;
        let session = Session { id, made: Made::Steps(steps), live, history: vec![start] };
        let answer = Answer { status: 201, ..ok(&session.resource())? };
        self.sessions.push(session);
        Ok(answer)
    }

    fn step(&mut self, job: &mut Job) -> Result<Option<Answer>, Problem> {
        let Session { made, history, .. } = self.session_mut(&job.session)?;
        let steps = made.steps_mut()?;
        let (began, mut outcome) = (Instant::now(), Ok(()));
        while outcome.is_ok() {
            outcome = steps.make(job.request.frames).and_then(|(kept, recorded)| {
                history.push(kept);
                job.made += 1;
                recorded
            });
            if job.made >= job.request.count || began.elapsed() >= MOMENT {
                break;
            }
        }
        let shown = steps.recorder().flush_shown().map_err(recording_failed);
        outcome.and(shown).map_err(|problem| problem.step(steps.step()))?;
        if job.made < job.request.count {
            return Ok(None);
        }
        let told = if job.request.reports { job.made as usize } else { 0 };
        let reports = history[history.len() - told..].iter().map(|kept| kept.json.clone()).collect();
        let remaining = steps.remaining().map(|left| left as u64);
        ok(&MadeSteps { step: steps.step(), remaining, reports }).map(Some)
    }
}

impl Made {
    fn steps_mut(&mut self) -> Result<&mut Steps, Problem> {
        match self {
            Self::Steps(steps) => Ok(steps),
            Self::Watched(_) => Err(never_steps()),
        }
    }
}

/// The problem of steps that are asked for of what a robot did.
fn never_steps() -> Problem {
    let detail = "a robot made the movements of this session; open a scenario to have some made here";
    Problem::new(Kind::NeverSteps, detail.to_owned())
}

impl Session {
    fn steps(&self) -> Result<&Steps, Problem> {
        match &self.made {
            Made::Steps(steps) => Ok(steps),
            Made::Watched(_) => Err(never_steps()),
        }
    }

    fn steps_mut(&mut self) -> Result<&mut Steps, Problem> {
        self.made.steps_mut()
    }

    fn experiment(&self) -> &Experiment {
        match &self.made {
            Made::Steps(steps) => steps.experiment(),
            Made::Watched(watched) => watched.experiment(),
        }
    }

    fn description(&self) -> &Description {
        match &self.made {
            Made::Steps(steps) => steps.description(),
            Made::Watched(watched) => watched.description(),
        }
    }

    fn recorder(&mut self) -> &mut Recorder {
        match &mut self.made {
            Made::Steps(steps) => steps.recorder(),
            Made::Watched(watched) => watched.recorder(),
        }
    }

    fn resource(&self) -> SessionResource {
        let (world, remaining, status, channels) = match &self.made {
            Made::Steps(steps) => (world(steps.description()), steps.remaining(), None, Vec::new()),
            Made::Watched(watched) => (WorldKind::External, None, Some(watched.status()), watched.channels()),
        };
        SessionResource {
            id: self.id.clone(),
            world,
            description: self.description().clone(),
            step: self.history.len() as u64 - 1,
            remaining: remaining.map(|left| left as u64),
            recording: Some(self.id.clone()),
            file: None,
            recording_failure: None,
            failure: None,
            status,
            channels,
        }
    }

    fn table(&self) -> Result<Vec<u8>, Problem> {
        let mut table = table_head(self.description())?;
        self.history.iter().for_each(|kept| table.extend_from_slice(&kept.rows));
        Ok(table)
    }
}

fn ok<T: Serialize>(value: &T) -> Result<Answer, Problem> {
    let body = to_vec(value).map_err(|error| Problem::new(Kind::Internal, format!("no JSON: {error}")))?;
    Ok(Answer { status: 200, body })
}

fn file(body: Vec<u8>) -> Answer {
    Answer { status: 200, body }
}

/// The answer that there is none.
pub(crate) fn refused(problem: &Problem) -> Answer {
    Answer { status: problem.status, body: to_vec(problem).unwrap_or_default() }
}
