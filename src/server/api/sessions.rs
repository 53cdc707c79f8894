//! Opening, stepping and ending sessions.

use std::sync::Arc;

use axum::{
    Json,
    extract::{Path, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::value::RawValue;
use utoipa::ToSchema;

use super::json;
use crate::{
    experiment::StepReport,
    recording::MOST_FRAMES,
    server::{
        App, MAX_STEPS_PER_REQUEST,
        extract::JsonBody,
        problem::{Kind, Problem},
        session::{NewSession, SessionResource},
    },
};

/// A request draws at most so many postures on the way: each takes some kilobytes of the session's memory.
const MAX_FRAMES_PER_REQUEST: u64 = 1000;

/// All sessions.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SessionList {
    /// Oldest first.
    pub sessions: Vec<SessionResource>,
}

/// How far to go.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StepRequest {
    /// How many steps to make.
    #[serde(default = "one")]
    #[schema(default = 1, minimum = 1, maximum = 1000)]
    pub count: u64,
    /// The step that the session must be at; otherwise nothing is stepped (409). It makes a repeated request safe.
    #[serde(default)]
    pub expected_step: Option<u64>,
    /// So many postures are drawn on the way to each step in the live recording, on its timeline `motion`; downloads have
    /// none of them. At most 1000 in one request.
    #[serde(default)]
    #[schema(default = 0, maximum = 30)]
    pub frames: u64,
    /// Whether the answer carries the reports of the steps. Whoever follows the session's events or its WebSocket gets
    /// them there.
    #[serde(default = "yes")]
    #[schema(default = true)]
    pub reports: bool,
}

fn one() -> u64 {
    1
}

fn yes() -> bool {
    true
}

/// What was made of a [`StepRequest`].
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct MadeSteps {
    /// The step that the session is at after these.
    pub step: u64,
    /// How many steps the recorded data set has left; null without an end.
    pub remaining: Option<u64>,
    /// The reports of the steps made, in order; empty if the request wants none.
    #[serde(serialize_with = "all")]
    #[schema(value_type = Vec<StepReport>)]
    pub reports: Vec<Arc<RawValue>>,
}

fn all<S: Serializer>(reports: &[Arc<RawValue>], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(reports.iter().map(AsRef::as_ref))
}

/// All sessions.
#[utoipa::path(get, path = "/v1/sessions", tag = "sessions", operation_id = "listSessions", responses(
    (status = 200, description = "All sessions, oldest first", body = SessionList)
))]
pub(super) async fn list(State(app): State<Arc<App>>) -> Json<SessionList> {
    Json(SessionList { sessions: app.sessions.all().iter().map(|session| session.resource()).collect() })
}

/// Open a session. It is at step 0: no movement yet.
#[utoipa::path(post, path = "/v1/sessions", tag = "sessions", operation_id = "openSession",
    request_body = NewSession,
    responses(
        (status = 201, description = "The session", body = SessionResource,
            headers(("Location" = String, description = "The session's address"))),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 413, description = "The body is too large", body = Problem),
        (status = 415, description = "The body is not said to be JSON", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 500, description = "The session could not be set up", body = Problem),
        (status = 503, description = "There are too many sessions, or the server is shutting down", body = Problem),
    )
)]
pub(super) async fn create(
    State(app): State<Arc<App>>,
    JsonBody(new): JsonBody<NewSession>,
) -> Result<Response, Problem> {
    let session = app.sessions.open(new).await?;
    let location = format!("/v1/sessions/{}", session.id());
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(session.resource())).into_response())
}

/// One session.
#[utoipa::path(get, path = "/v1/sessions/{id}", tag = "sessions", operation_id = "getSession",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "The session", body = SessionResource),
        (status = 404, description = "There is no such session", body = Problem),
    )
)]
pub(super) async fn get(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Json<SessionResource>, Problem> {
    Ok(Json(app.sessions.get(&id)?.resource()))
}

/// End a session. Its streams end, its recording is finished, and its memory is free again.
#[utoipa::path(delete, path = "/v1/sessions/{id}", tag = "sessions", operation_id = "deleteSession",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 204, description = "The session is no more"),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
    )
)]
pub(super) async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<StatusCode, Problem> {
    let id = app.sessions.get(&id)?.id();
    app.sessions.close(id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Make steps: in each, every learner makes one movement. Requests to a busy session wait for their turn; one that its
/// client gives up stops after the step that it is at.
#[utoipa::path(post, path = "/v1/sessions/{id}/steps", tag = "sessions", operation_id = "makeSteps",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    request_body(content = Option<StepRequest>, description = "May be left out: one step"),
    responses(
        (status = 200, description = "The steps were made", body = MadeSteps),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 409, description = "The session is not at `expected_step` but at `step`, or a person has not chosen \
            a movement yet (problem type `no-configuration`); nothing was stepped", body = Problem),
        (status = 413, description = "The body is too large", body = Problem),
        (status = 415, description = "The body is not said to be JSON", body = Problem),
        (status = 422, description = "A value is not valid, or only `remaining` steps are left; nothing was stepped", body = Problem),
        (status = 500, description = "The engine failed; the session is at `step`", body = Problem),
        (status = 503, description = "The server's memory is full, or the session is ending", body = Problem),
    )
)]
pub(super) async fn step(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    JsonBody(StepRequest { count, expected_step, frames, reports }): JsonBody<StepRequest>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    if !(1..=MAX_STEPS_PER_REQUEST).contains(&count) {
        let detail = format!("`count` must be from 1 to {MAX_STEPS_PER_REQUEST}, not {count}");
        return Err(Problem::new(Kind::InvalidValue, detail).field("count"));
    }
    if frames > MOST_FRAMES {
        let detail = format!("`frames` must be from 0 to {MOST_FRAMES}, not {frames}");
        return Err(Problem::new(Kind::InvalidValue, detail).field("frames"));
    }
    if count * frames > MAX_FRAMES_PER_REQUEST {
        let detail = format!(
            "{count} steps with {frames} postures on the way to each are more than {MAX_FRAMES_PER_REQUEST} postures; ask \
             for fewer of them, or for fewer steps"
        );
        return Err(Problem::new(Kind::InvalidValue, detail).field("frames"));
    }
    let session = session.watch();
    let made = session.make_steps(count, expected_step, frames).await?;
    let step = made.last().map_or(session.step(), |report| report.step);
    let reports = if reports { made.into_iter().map(|report| report.json).collect() } else { Vec::new() };
    json(MadeSteps { step, remaining: session.resource().remaining, reports }).await
}
