//! A robot that somebody moves by hand: asked where to go, told what was seen.

use body_schema_ask_tell::{Ask, Observation, Outcome, Refusal, Session, Setup};
use body_schema_recording::{Appearance, LiveLog, Recorder, RecordingError, Target};
use serde_json::{Value, json};

use super::{Files, Workbench, invalid};
use crate::{Problem, draw_next, recording_failed};

/// An answer, and the scene.
type Shown = (Value, Option<Vec<u8>>);

impl Workbench {
    /// A new session of the robot that a calibration file describes.
    pub(super) fn open(&mut self, files: &Files, text: &str) -> Result<Shown, Problem> {
        let open = |name: &str| files.text(name).map(str::to_owned);
        let setup = Setup::from_toml(text, &open).map_err(|error| invalid(error.to_string()).field("text"))?;
        let session = Session::open(setup).map_err(|error| invalid(error.to_string()).field("text"))?;
        self.shown(session)
    }

    pub(super) fn suggest(&mut self, session: String) -> Result<Shown, Problem> {
        self.change(session, |session| session.suggest(&Ask::default(), None).map(drop))
    }

    pub(super) fn observe(&mut self, session: String, observation: Observation) -> Result<Shown, Problem> {
        self.change(session, |session| session.observe(observation, None).map(drop))
    }

    pub(super) fn outcome(
        &mut self,
        session: String,
        id: u64,
        state: Outcome,
        reason: Option<&str>,
    ) -> Result<Shown, Problem> {
        self.change(session, |session| session.outcome(id, state, reason, None).map(drop))
    }

    pub(super) fn count(&mut self, session: String, observation: u64, counts: bool) -> Result<Shown, Problem> {
        self.change(session, |session| match counts {
            true => session.include(observation, None),
            false => session.exclude(observation, None),
        })
    }

    /// What was observed so far: a calibration file with its table and its description.
    pub(super) fn results(&mut self, session: String) -> Result<Value, Problem> {
        let (text, session) = self.taken(session)?;
        let (table, urdf) = (session.observations_csv(), session.setup().urdf().to_owned());
        let files = json!({ "observations.csv": table, "robot.urdf": urdf });
        let answer = json!({ "file": "calibration.toml", "text": session.calibration_toml(), "files": files });
        self.session = Some((text, session));
        Ok(answer)
    }

    /// The session of a text: the last one, or one that is replayed.
    fn taken(&mut self, text: String) -> Result<(String, Session), Problem> {
        match self.session.take() {
            Some(last) if last.0 == text => Ok(last),
            _ => {
                let session = Session::from_json(&text).map_err(|error| invalid(error.to_string()).field("session"))?;
                Ok((text, session))
            }
        }
    }

    /// Changes a session; one that refuses has not changed.
    fn change(
        &mut self,
        session: String,
        change: impl FnOnce(&mut Session) -> Result<(), Refusal>,
    ) -> Result<Shown, Problem> {
        let (text, mut session) = self.taken(session)?;
        if let Err(refusal) = change(&mut session) {
            self.session = Some((text, session));
            return Err(refusal.into());
        }
        self.shown(session)
    }

    /// Where a session stands, and its scene; it is kept for the next request.
    fn shown(&mut self, session: Session) -> Result<Shown, Problem> {
        let text = session.to_json();
        let scene = scene(&session).map_err(recording_failed)?;
        let told: Vec<Value> = session
            .observations()
            .iter()
            .map(|told| json!({ "observation": told.observation, "answer": told.answer, "excluded": told.excluded }))
            .collect();
        let answer = json!({
            "session": text,
            "channels": session.channels(),
            "status": session.status(),
            "pending": session.pending().collect::<Vec<_>>(),
            "observations": told,
        });
        self.session = Some((text, session));
        Ok((answer, Some(scene)))
    }
}

/// The arm as it is believed to be, with the posture that is suggested next.
fn scene(session: &Session) -> Result<Vec<u8>, RecordingError> {
    let (log, report) = (LiveLog::new(), session.report());
    let id = format!("session-{}-{}", session.setup().seed, session.events().len());
    let target = Target::live(log.clone()).with_recording_id(id).with_appearance(Appearance::of(session.scenario()));
    let mut recorder = Recorder::new(&session.description(), target)?;
    recorder.log(&report)?;
    draw_next(session, report.step, &mut recorder)?;
    recorder.finish()?;
    let parts = log.scene_parts_from(0);
    Ok(parts.iter().flat_map(|part| part.iter().copied()).collect())
}
