//! Opening, stepping and ending sessions.

use std::sync::Arc;

use axum::{
    Json,
    extract::{Path, RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::{Deserialize, Serialize, de::IgnoredAny};
use utoipa::ToSchema;
use uuid::Uuid;

use super::{json, refusals::OfBodies};
use crate::server::{
    App, Limits,
    extract::{self, FromJson, JsonBody, parse},
    problem::{Kind, Problem},
    requests,
    session::{DamagedSession, Listed, NewOutsideSession, NewSession, SessionResource},
};
use body_schema_backend::{MadeSteps, StepRequest, parameters, word};

/// The most sessions that are listed at a time.
const MOST_LISTED: u64 = 1000;
/// The most reports that are put together at once; more are handled where they block no other request.
const FEW_REPORTS: usize = 16;

/// Sessions.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SessionList {
    /// Oldest first.
    pub sessions: Vec<SessionResource>,
    /// Sessions with robots elsewhere that were kept, and cannot be relied on any more: `body-schema repair` mends what can be.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub damaged: Vec<DamagedSession>,
    /// The `after` with which to ask for those that follow; left out at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(format = "uuid")]
    pub next: Option<String>,
}

/// All sessions, oldest first, at most 1000 at a time.
#[utoipa::path(get, path = "/v1/sessions", tag = "sessions", operation_id = "listSessions",
    params(
        ("after" = Option<String>, Query, description = "The id of the session after which to go on, as `next` of an answer has it",
            format = "uuid"),
        ("limit" = Option<u64>, Query, description = "How many at most", minimum = 1, maximum = 1000),
    ),
    responses(
        (status = 200, description = "Sessions; `next` is there if there are more", body = SessionList),
        (status = 400, description = "A parameter is none of those", body = Problem),
        (status = 404, description = "There is no session `after`", body = Problem),
        (status = 500, description = "The sessions with robots elsewhere cannot be read", body = Problem),
    )
)]
pub(super) async fn list(State(app): State<Arc<App>>, RawQuery(query): RawQuery) -> Result<Response, Problem> {
    let [after, limit] = parameters(query.as_deref(), ["after", "limit"])?;
    let after = after.map(|after| {
        Uuid::parse_str(after).map_err(|_| {
            Problem::new(Kind::Malformed, format!("`after` must be the id of a session, not `{after}`")).field("after")
        })
    });
    let limit = limit.map(|limit| extract::whole_number("limit", limit)).transpose()?;
    let limit = limit.unwrap_or(MOST_LISTED);
    if !(1..=MOST_LISTED).contains(&limit) {
        let detail = format!("`limit` must be from 1 to {MOST_LISTED}, not {limit}");
        return Err(Problem::new(Kind::Malformed, detail).field("limit"));
    }
    let Listed { sessions, damaged, next } = app.sessions.list(after.transpose()?, limit as usize).await?;
    json(SessionList { sessions, damaged, next: next.map(|id| id.to_string()) }).await
}

/// The request for a session: a scenario of ours, or a robot elsewhere.
#[derive(ToSchema)]
#[schema(as = OpenSession)]
#[serde(untagged)]
pub(super) enum Opening {
    /// Learners in a world of ours, compared.
    Scenario(NewSession),
    /// A robot that is not ours.
    External(NewOutsideSession),
}

impl FromJson for Opening {
    fn from_json(bytes: &[u8], limits: &Limits) -> Result<Self, Problem> {
        #[derive(Deserialize)]
        struct Which {
            world: Option<IgnoredAny>,
            calibration: Option<IgnoredAny>,
        }
        // What cannot even be read so far is told of by the one that has always been there.
        let which = serde_json::from_slice(bytes).unwrap_or(Which { world: None, calibration: None });
        match which.world.is_some() {
            true => parse(bytes).map(Self::External),
            false if which.calibration.is_some() => {
                let detail = "a session with a robot elsewhere names its world; add `\"world\": \"outside\"`";
                Err(Problem::new(Kind::InvalidValue, detail).field("world"))
            }
            false if bytes.len() > limits.body_bytes => Err(Problem::body_too_large(limits.body_bytes)),
            false => parse(bytes).map(Self::Scenario),
        }
    }

    fn too_large(limits: &Limits) -> Problem {
        Problem::body_too_large(limits.setup_body_bytes()).field("calibration")
    }
}

/// Open a session: a scenario of ours, or a robot elsewhere, which is asked to move and tells what it saw. It is at step 0: no
/// movement yet.
#[utoipa::path(post, path = "/v1/sessions", tag = "sessions", operation_id = "openSession",
    request_body = Opening,
    responses(
        (status = 201, description = "The session", body = SessionResource,
            headers(("Location" = String, description = "The session's address"))),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 500, description = "The session could not be set up", body = Problem),
        (status = 503, description = "There are too many sessions, or the server is shutting down", body = Problem),
        (status = 507, description = "There is no room to keep it; no session was opened", body = Problem),
        OfBodies,
    )
)]
pub(super) async fn create(
    State(app): State<Arc<App>>,
    JsonBody(opening): JsonBody<Opening>,
) -> Result<Response, Problem> {
    let session = to_its_end(async move {
        match opening {
            Opening::Scenario(new) => app.sessions.open(new).await,
            Opening::External(new) => app.sessions.open_external(new).await,
        }
    });
    let session = session.await?;
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
    Ok(Json(app.sessions.get(&id).await?.resource()))
}

/// When a session is to be ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Condition {
    /// End it in any case.
    #[default]
    Always,
    /// End it only if no stream follows it.
    Unwatched,
}

/// End a session. Its streams end, its recording is finished, and its memory is free again; one with a robot elsewhere is kept
/// no longer.
#[utoipa::path(delete, path = "/v1/sessions/{id}", tag = "sessions", operation_id = "deleteSession",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("if" = Option<Condition>, Query, description = "`unwatched`: only if no stream follows it"),
    ),
    responses(
        (status = 400, description = "A parameter is none of those", body = Problem),
        (status = 409, description = "A stream follows the session, and `if` is `unwatched`; it is still there", body = Problem),
        (status = 204, description = "The session is no more"),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "It cannot be deleted, and is still there", body = Problem),
        (status = 503, description = "It is deleted, but is still choosing a movement", body = Problem),
        (status = 507, description = "There is no room to complete its recording, or to forget it; it is still there", body = Problem),
    )
)]
pub(super) async fn delete(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Result<StatusCode, Problem> {
    let [condition] = parameters(query.as_deref(), ["if"])?;
    let condition: Condition = word("if", condition)?;
    let id = Uuid::parse_str(&id).map_err(|_| Problem::unknown_session(id))?;
    if condition == Condition::Unwatched && app.sessions.is_followed(id) {
        let detail =
            "somebody follows the session, and it is still there; leave out `if=unwatched` to delete it all the same";
        return Err(Problem::new(Kind::Watched, detail).field("if"));
    }
    to_its_end(async move { app.sessions.close(id).await }).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Completes the work, even for a client that goes away meanwhile.
async fn to_its_end<T: Send + 'static>(
    work: impl Future<Output = Result<T, Problem>> + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::spawn(requests::carried(work)).await;
    done.unwrap_or_else(|error| Err(Problem::new(Kind::Internal, format!("a part of the server failed: {error}"))))
}

/// Make steps: in each, every learner makes one movement. Requests to a busy session wait for their turn; one that its
/// client gives up stops after the step that it is at.
#[utoipa::path(post, path = "/v1/sessions/{id}/steps", tag = "sessions", operation_id = "makeSteps",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    request_body(content = Option<StepRequest>, description = "May be left out: one step"),
    responses(
        (status = 200, description = "The steps were made", body = MadeSteps),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 409, description = "The session is not at `expected_step` but at `step`, a person has not chosen a \
            movement yet (problem type `no-configuration`), or a robot elsewhere moves (`never-steps`); nothing was stepped",
            body = Problem),
        (status = 422, description = "A value is not valid, or only `remaining` steps are left; nothing was stepped", body = Problem),
        (status = 500, description = "The engine failed; the session is at `step`", body = Problem),
        (status = 503, description = "The server's memory is full, or the session is ending", body = Problem),
        OfBodies,
    )
)]
pub(super) async fn step(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    JsonBody(request): JsonBody<StepRequest>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    request.check(app.limits.steps_per_request)?;
    let StepRequest { count, expected_step, frames, reports } = request;
    let session = session.watch();
    let made = session.make_steps(count, expected_step, frames).await?;
    let step = made.last().map_or(session.step(), |report| report.step);
    let reports = if reports { made.into_iter().map(|report| report.json).collect() } else { Vec::new() };
    let made = MadeSteps { step, remaining: session.remaining(), reports };
    // Reports are written already, and few are soon put together.
    if made.reports.len() <= FEW_REPORTS { Ok(Json(made).into_response()) } else { json(made).await }
}
