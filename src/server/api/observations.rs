//! Observations that a robot elsewhere reports after its movements.

use std::sync::Arc;

use axum::{
    extract::{Path, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use utoipa::ToSchema;

use super::{
    json,
    refusals::{OfBodies, OfEngines, OfRobots},
};
use crate::server::{
    App,
    extract::{self, JsonBody},
    problem::{Kind, Problem},
};
use body_schema_ask_tell::{Answer, Observation, Status, Told};

/// All observations of a session.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ObservationList {
    /// The observations, in the order in which they were received.
    observations: Vec<ToldObservation>,
}

/// An observation that was told.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ToldObservation {
    /// Its number, counted from 1.
    number: u64,
    /// As it was told.
    told: Observation,
    /// The answer that was given then.
    answer: Answer,
    /// Whether it counts for nothing.
    excluded: bool,
}

impl From<&Told> for ToldObservation {
    fn from(Told { observation, answer, excluded }: &Told) -> Self {
        Self { number: answer.observation, told: observation.clone(), answer: answer.clone(), excluded: *excluded }
    }
}

/// Tell where the robot moved, and what was seen there. Where it truly was is all that counts; it need not have been suggested.
///
/// With an `Idempotency-Key` a request may be repeated: the same body is answered as it was the first time, and counts once.
#[utoipa::path(post, path = "/v1/sessions/{id}/observations", tag = "robots", operation_id = "observe",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("Idempotency-Key" = Option<String>, Header, description = "A text of the client's own, another for each observation",
            max_length = 200, pattern = "^[!-~]([ -~]*[!-~])?$"),
    ),
    request_body = Observation,
    responses(
        (status = 201, description = "It is taken in, and kept", body = Answer,
            headers(("Location" = String, description = "The observation's address"))),
        (status = 200, description = "It was taken in before, with the same key; the same answer", body = Answer,
            headers(("Location" = String, description = "The observation's address"))),
        (status = 400, description = "The body is not JSON, or the key cannot be read", body = Problem),
        (status = 409, description = "The key came with another body, the session has no robot elsewhere or is full, or its \
            estimate has diverged; nothing has happened", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 507, description = "There is no room to keep it; nothing has happened", body = Problem),
        OfBodies,
        OfEngines,
    )
)]
pub(super) async fn observe(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    headers: HeaderMap,
    JsonBody(told): JsonBody<Observation>,
) -> Result<Response, Problem> {
    let key = extract::idempotency_key(&headers)?;
    let (answer, is_repeated) = app.sessions.tell(&id, move |robot| robot.observe(&told, key.as_deref())).await?;
    let status = if is_repeated { StatusCode::OK } else { StatusCode::CREATED };
    let location = format!("/v1/sessions/{id}/observations/{}", answer.observation);
    Ok((status, [(header::LOCATION, location)], json(answer).await?).into_response())
}

/// All observations, as they were told, with what was answered.
#[utoipa::path(get, path = "/v1/sessions/{id}/observations", tag = "robots", operation_id = "listObservations",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "All of them, in order, those that are excluded too", body = ObservationList),
        OfRobots,
    )
)]
pub(super) async fn list(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let standing = app.sessions.standing(&id).await?;
    let observations = standing.observations.iter().map(|told| ToldObservation::from(&**told)).collect();
    json(ObservationList { observations }).await
}

/// One observation.
#[utoipa::path(get, path = "/v1/sessions/{id}/observations/{n}", tag = "robots", operation_id = "getObservation",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("n" = u64, Path, description = "The observation's number"),
    ),
    responses(
        (status = 200, description = "The observation", body = ToldObservation),
        (status = 400, description = "`n` is no number", body = Problem),
        (status = 404, description = "There is no such session or observation", body = Problem),
        (status = 409, description = "The session has no robot elsewhere", body = Problem),
        (status = 500, description = "The session cannot be taken up again", body = Problem),
        (status = 503, description = "The server's memory is full, or it is shutting down", body = Problem),
    )
)]
pub(super) async fn get(
    State(app): State<Arc<App>>,
    Path((id, number)): Path<(String, u64)>,
) -> Result<Response, Problem> {
    let standing = app.sessions.standing(&id).await?;
    let told = standing.observations.iter().find(|told| told.answer.observation == number);
    let unknown = || {
        let detail = format!(
            "there is no observation {number}; {} were received so far, counted from 1",
            standing.observations.len()
        );
        Problem::new(Kind::UnknownObservation, detail).field("n")
    };
    json(ToldObservation::from(&**told.ok_or_else(unknown)?)).await
}

/// Exclude an observation: from now on it counts for nothing, and the belief is what the others give. Its number stays its own.
#[utoipa::path(delete, path = "/v1/sessions/{id}/observations/{n}", tag = "robots", operation_id = "excludeObservation",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("n" = u64, Path, description = "The observation's number"),
    ),
    responses(
        (status = 200, description = "It is excluded: how the session stands without it", body = Status),
        (status = 400, description = "`n` is no number", body = Problem),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session or observation", body = Problem),
        (status = 409, description = "The session has no robot elsewhere, or is full; nothing has happened", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
        (status = 503, description = "The server's memory is full, it is shutting down, or what happened is still being replayed: ask again after `Retry-After`", body = Problem),
        (status = 507, description = "There is no room to keep it; nothing has happened", body = Problem),
    )
)]
pub(super) async fn exclude(
    State(app): State<Arc<App>>,
    Path((id, number)): Path<(String, u64)>,
) -> Result<Response, Problem> {
    json(app.sessions.mark(&id, number, true).await?).await
}

/// Take an excluded observation back: the belief is as if it had never been excluded.
#[utoipa::path(put, path = "/v1/sessions/{id}/observations/{n}/included", tag = "robots", operation_id = "includeObservation",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("n" = u64, Path, description = "The observation's number"),
    ),
    responses(
        (status = 200, description = "It counts again: how the session stands with it", body = Status),
        (status = 400, description = "`n` is no number", body = Problem),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session or observation", body = Problem),
        (status = 409, description = "The session has no robot elsewhere, or is full; nothing has happened", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
        (status = 503, description = "The server's memory is full, it is shutting down, or what happened is still being replayed: ask again after `Retry-After`", body = Problem),
        (status = 507, description = "There is no room to keep it; nothing has happened", body = Problem),
    )
)]
pub(super) async fn include(
    State(app): State<Arc<App>>,
    Path((id, number)): Path<(String, u64)>,
) -> Result<Response, Problem> {
    json(app.sessions.mark(&id, number, false).await?).await
}
