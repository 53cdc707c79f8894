//! Movements that are suggested to a robot elsewhere.

use std::sync::Arc;

use axum::{
    extract::{Path, State},
    response::Response,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{
    json,
    refusals::{OfBodies, OfEngines, OfRobots},
};
use crate::server::{App, clock::now_s, extract::JsonBody, problem::Problem, session::Snapshot};
use body_schema_ask_tell::{Ask, Enough, Outcome, Suggestion, Suggestions};

/// All suggestions of a session.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct AllSuggestions {
    /// The suggestions, in the order in which they were chosen.
    #[schema(value_type = Vec<Suggestion>)]
    suggestions: Vec<Arc<Suggestion>>,
    /// Present once no more observations are needed.
    #[serde(skip_serializing_if = "Option::is_none")]
    enough: Option<Enough>,
}

/// The report that a suggestion is not carried out.
#[derive(Clone, Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewOutcome {
    /// Whether the robot cannot go there, or nobody asks it to.
    state: Outcome,
    /// The reason in words, for people.
    #[serde(default)]
    #[schema(max_length = 1000)]
    reason: Option<String>,
}

/// Ask where to move: the client's pending suggestions, topped up to `count`. Asking again changes nothing.
///
/// They are chosen together, given everybody's pending ones: two clients are never sent to learn the same. It may take a while;
/// other sessions do not wait.
#[utoipa::path(post, path = "/v1/sessions/{id}/suggestions", tag = "robots", operation_id = "suggest",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    request_body(content = Option<Ask>, description = "May be left out: one for who gives no name"),
    responses(
        (status = 200, description = "The client's pending suggestions; they are kept", body = Suggestions),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 409, description = "The session has no robot elsewhere, is full, or no movement can be chosen; nothing has \
            happened", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 507, description = "There is no room to keep them; nothing has happened", body = Problem),
        OfBodies,
        OfEngines,
    )
)]
pub(super) async fn suggest(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    JsonBody(ask): JsonBody<Ask>,
) -> Result<Response, Problem> {
    json(app.sessions.tell(&id, move |robot| robot.suggest(&ask)).await?).await
}

/// All suggestions that were ever made, and what became of them.
#[utoipa::path(get, path = "/v1/sessions/{id}/suggestions", tag = "robots", operation_id = "listSuggestions",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "All of them, in the order in which they were chosen", body = AllSuggestions),
        (status = 507, description = "There is no room to keep that some have expired", body = Problem),
        OfRobots,
    )
)]
pub(super) async fn list(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let standing = app.sessions.standing(&id).await?;
    let standing = match some_have_expired(&standing) {
        true => {
            app.sessions.tell(&id, |robot| robot.expire()).await?;
            app.sessions.standing(&id).await?
        }
        false => standing,
    };
    json(AllSuggestions { suggestions: standing.suggestions.clone(), enough: standing.status.enough }).await
}

fn some_have_expired(standing: &Snapshot) -> bool {
    let now = now_s();
    standing.pending.iter().filter_map(|suggestion| suggestion.expires_at_s).any(|at| at <= now)
}

/// Say that a pending suggestion is not carried out.
#[utoipa::path(post, path = "/v1/sessions/{id}/suggestions/{sid}/outcome", tag = "robots", operation_id = "endSuggestion",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("sid" = u64, Path, description = "The suggestion's id"),
    ),
    request_body = NewOutcome,
    responses(
        (status = 200, description = "The suggestion, as it is now", body = Suggestion),
        (status = 400, description = "The body is not JSON, or `sid` is no number", body = Problem),
        (status = 404, description = "There is no such session or suggestion", body = Problem),
        (status = 409, description = "It is not pending, or the session has no robot elsewhere, or is full; nothing has \
            happened", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
        (status = 503, description = "The server's memory is full, or it is shutting down", body = Problem),
        (status = 507, description = "There is no room to keep it; nothing has happened", body = Problem),
        OfBodies,
    )
)]
pub(super) async fn outcome(
    State(app): State<Arc<App>>,
    Path((id, suggestion)): Path<(String, u64)>,
    JsonBody(NewOutcome { state, reason }): JsonBody<NewOutcome>,
) -> Result<Response, Problem> {
    json(app.sessions.tell(&id, move |robot| robot.outcome(suggestion, state, reason.as_deref())).await?).await
}
