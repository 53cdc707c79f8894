//! A session with a robot elsewhere that is over, or goes on elsewhere: it is watched, and nothing more is asked of it.

use body_schema_ask_tell::{ChannelShape, Session, Status};
use body_schema_experiment::Experiment;
use body_schema_recording::{Appearance, Recorder, RecordingError, Target};
use body_schema_wire::Description;
use serde_json::json;

use crate::{Kept, Kind, Problem, recording_failed};

/// Draws the next suggested posture of a session at a step, as a ghost of the arm; or none.
///
/// # Errors
///
/// [`RecordingError`] where it cannot be recorded.
pub fn draw_next(session: &Session, step: u64, recorder: &mut Recorder) -> Result<(), RecordingError> {
    recorder.log_ghost(step, 0, session.next_bones_m().as_deref())
}

/// What has become of a session, and its recording.
pub(crate) struct Watched {
    session: Session,
    description: Description,
    recorder: Recorder,
}

impl Watched {
    /// Has the events of a session happen again; with the reports of all steps. Nothing is chosen again.
    ///
    /// # Errors
    ///
    /// [`Kind::EngineFailed`] where `written` is no session, [`Kind::Internal`] where it cannot be recorded.
    pub(crate) fn replay(written: &str, target: Target) -> Result<(Self, Vec<Kept>), Problem> {
        let session = Session::from_json(written)?;
        let description = session.description();
        let target = target.with_appearance(Appearance::of(session.scenario()));
        let mut recorder = Recorder::new(&description, target).map_err(recording_failed)?;
        let mut history = Vec::new();
        for report in session.history() {
            recorder.log(&report).map_err(recording_failed)?;
            history.push(Kept::of(&report, &description)?);
        }
        let shown = draw_next(&session, history.len().saturating_sub(1) as u64, &mut recorder);
        shown.and_then(|()| recorder.flush()).map_err(recording_failed)?;
        Ok((Self { session, description, recorder }, history))
    }

    pub(crate) fn experiment(&self) -> &Experiment {
        self.session.experiment()
    }

    pub(crate) fn description(&self) -> &Description {
        &self.description
    }

    pub(crate) fn recorder(&mut self) -> &mut Recorder {
        &mut self.recorder
    }

    pub(crate) fn status(&self) -> Status {
        self.session.status()
    }

    pub(crate) fn channels(&self) -> Vec<ChannelShape> {
        self.session.channels().to_vec()
    }

    /// How it stands, as a message to those who follow it.
    pub(crate) fn standing(&self) -> String {
        let pending: Vec<_> = self.session.pending().collect();
        let last = self.session.observations().last().map(|told| &told.answer);
        let standing = json!({ "status": self.status(), "pending": pending, "last": last });
        json!({ "type": "status", "data": standing }).to_string()
    }

    /// What was learned or told, as a file.
    ///
    /// # Errors
    ///
    /// [`Kind::NothingToShow`] where nothing was observed, [`Kind::UnknownRoute`] of a file that takes a server.
    pub(crate) fn file(&self, name: &str) -> Result<Vec<u8>, Problem> {
        match name {
            "model.urdf" => self.learned("calibrated.urdf"),
            "kinematics.yaml" => self.learned("kinematics.yaml"),
            "observations.csv" => Ok(self.session.observations_csv().into_bytes()),
            "calibration.toml" => Ok(self.session.calibration_toml().into_bytes()),
            "robot.urdf" => Ok(self.session.setup().urdf().as_bytes().to_vec()),
            "session.json" => Ok(self.session.to_json().into_bytes()),
            _ => Err(Problem::new(Kind::UnknownRoute, format!("`{name}` needs a server: start `body-schema serve`"))),
        }
    }

    fn learned(&self, name: &str) -> Result<Vec<u8>, Problem> {
        let found = self.session.results()?.description()?.into_iter().find(|file| file.path == name);
        let found = found.ok_or_else(|| Problem::new(Kind::Internal, format!("`{name}` was not made")));
        Ok(found?.text.into_bytes())
    }
}
