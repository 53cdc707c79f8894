//! What came out of a session, to take away.

use std::sync::Arc;

use axum::{
    extract::{Path, State},
    response::Response,
};

use super::{attachment, json};
use crate::{
    experiment::RunResult,
    recording::{RecordingError, StepsCsv},
    server::{
        App,
        aside::aside,
        problem::{Kind, Problem},
        session::Session,
    },
};

/// The recording so far, complete: an .rrd file for Rerun's viewer.
#[utoipa::path(get, path = "/v1/sessions/{id}/recording.rrd", tag = "results", operation_id = "getRecording",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "An .rrd file with its footer", body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "The recording could not be completed", body = Problem),
    )
)]
pub(super) async fn recording(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?.watch();
    session.flush().await?;
    let live = session.live().clone();
    let complete = move || {
        live.complete().map_err(|error| Problem::new(Kind::Internal, format!("no complete recording: {error}")))
    };
    Ok(file(&session, "rrd", "application/octet-stream", aside(complete).await?))
}

/// The metrics of every learner at every step.
#[utoipa::path(get, path = "/v1/sessions/{id}/steps.csv", tag = "results", operation_id = "getStepsCsv",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "A table with one row per step and learner", body = String, content_type = "text/csv"),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "The table could not be written", body = Problem),
    )
)]
pub(super) async fn steps_csv(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let (description, reports) = (session.description().clone(), session.reports(0, usize::MAX));
    let table = move || {
        let mut table = Vec::new();
        StepsCsv::new(&description, &mut table)?.flush()?;
        reports.iter().for_each(|report| table.extend_from_slice(&report.rows));
        Ok(table)
    };
    let failed = |error: RecordingError| Problem::new(Kind::Internal, error.to_string());
    let table = aside(move || table().map_err(failed)).await?;
    Ok(file(&session, "csv", "text/csv; charset=utf-8", table))
}

/// The outcome so far: the metrics and the learned models. It is that of whatever the session was asked before.
#[utoipa::path(get, path = "/v1/sessions/{id}/result.json", tag = "results", operation_id = "getResult",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "The outcome", body = RunResult),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "The engine failed", body = Problem),
    )
)]
pub(super) async fn result(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?.watch();
    json(session.result().await?).await
}

fn file(session: &Session, extension: &str, content_type: &'static str, bytes: Vec<u8>) -> Response {
    let description = session.description();
    let name = format!("{}-seed{}-step{}.{extension}", description.scenario, description.seed, session.step());
    attachment(&name, content_type, bytes)
}
