//! A robot that somebody moves by hand: asked where to go, told what was seen.

use body_schema_ask_tell::{Refusal, Session, Setup, SetupError};
use body_schema_recording::{LiveLog, Recorder, RecordingError, Target};
use body_schema_robot::{Hulls, Urdf};
use body_schema_wire::JointKind;
use serde_json::{Value, json};

use super::{Answered, Files, Meshes, Workbench, invalid, meshes};
use crate::{Problem, draw_next, recording_failed};

/// A new session of the robot that a calibration file describes; meshes say how thick its links are where the file names no shapes.
pub(super) fn open(files: &Files, text: &str, meshes: &Meshes) -> Result<Session, Problem> {
    let open = |name: &str| files.text(name).map(str::to_owned);
    let refused = |error: SetupError| invalid(error.to_string()).field("text");
    let mut setup = Setup::from_toml(text, &open).map_err(refused)?;
    if setup.shapes().is_none()
        && let Ok(urdf) = Urdf::parse(setup.urdf())
        && let Some(hulls) = Hulls::of_meshes(&urdf, |file| meshes::found(meshes, file).map(<[u8]>::to_vec)).0
    {
        setup = setup.with_shapes(&hulls.to_string());
    }
    Session::open(setup).map_err(refused)
}

/// How a session is shown: the id of the recording, and the meshes that draw its robot as itself.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub recording: &'a str,
    pub meshes: &'a Meshes,
}

impl Workbench {
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

    /// Changes a session, and shows it; one that refuses has not changed.
    pub(super) fn change(
        &mut self,
        session: String,
        stage: Stage<'_>,
        change: impl FnOnce(&mut Session) -> Result<(), Refusal>,
    ) -> Result<Answered, Problem> {
        let (text, mut session) = self.taken(session)?;
        if let Err(refusal) = change(&mut session) {
            self.session = Some((text, session));
            return Err(refusal.into());
        }
        self.shown(session, stage)
    }

    /// Where a session stands, and its scene; it is kept for the next request.
    pub(super) fn shown(&mut self, session: Session, stage: Stage<'_>) -> Result<Answered, Problem> {
        let text = session.to_json();
        let scene = scene(&session, stage).map_err(recording_failed)?;
        let told: Vec<Value> = session
            .observations()
            .iter()
            .map(|told| json!({ "observation": told.observation, "answer": told.answer, "excluded": told.excluded }))
            .collect();
        let joints = session.description().joints;
        let sliding = joints.iter().filter(|joint| joint.kind == JointKind::Prismatic).map(|joint| joint.name.as_str());
        let answer = json!({
            "sliding": sliding.collect::<Vec<_>>(),
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
fn scene(session: &Session, stage: Stage<'_>) -> Result<Vec<u8>, RecordingError> {
    let (log, report) = (LiveLog::new(), session.report());
    let (appearance, _) = meshes::appearance(session.scenario(), stage.meshes);
    let target = Target::live(log.clone()).with_recording_id(stage.recording).with_appearance(appearance);
    let mut recorder = Recorder::new(&session.description(), target)?;
    recorder.log(&report)?;
    draw_next(session, report.step, &mut recorder)?;
    recorder.finish()?;
    Ok(log.scene_parts_from(0).concat())
}
