//! The results of a session, for download.

use std::{convert::Infallible, sync::Arc};

use axum::{
    body::{Body, Bytes},
    extract::{Path, State},
    http::header,
    response::{IntoResponse, Response},
};
use futures_util::stream;

use super::{attachment, json};
use crate::server::{App, problem::Problem, session::Session};
use body_schema_backend::table_head;
use body_schema_wire::RunResult;

/// The recording so far, complete: an .rrd file for Rerun's viewer.
#[utoipa::path(get, path = "/v1/sessions/{id}/recording.rrd", tag = "results", operation_id = "getRecording",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "An .rrd file with its footer", body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "The recording could not be completed", body = Problem),
        (status = 503, description = "The server has as much to compute as may wait", body = Problem),
        (status = 507, description = "There is no room to put it together", body = Problem),
    )
)]
pub(super) async fn recording(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?.watch();
    session.flush().await?;
    let completed = session.completed(&app.jobs).await?;
    let length = [(header::CONTENT_LENGTH, completed.bytes)];
    Ok((length, file(&session, "rrd", "application/octet-stream", completed.body())).into_response())
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
    let header = table_head(session.description())?;
    // Rows are written already, and shared by all who read them.
    let rows = session.reports(0, usize::MAX).into_iter().map(|report| Bytes::from_owner(report.rows));
    let table = stream::iter([header.into()].into_iter().chain(rows).map(Ok::<_, Infallible>));
    Ok(file(&session, "csv", "text/csv; charset=utf-8", Body::from_stream(table)))
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

fn file(session: &Session, extension: &str, content_type: &'static str, content: Body) -> Response {
    let description = session.description();
    let name = format!("{}-seed{}-step{}.{extension}", description.scenario, description.seed, session.step());
    attachment(&name, content_type, content)
}
