//! Why this posture: how a movement was chosen, and what another would have taught.

use std::sync::Arc;

use axum::{
    extract::{Path, State},
    response::Response,
};

use super::{json, refusals::OfBodies};
use crate::server::{App, extract::JsonBody, problem::Problem};
use body_schema_backend::{Configuration, ConfigurationRequest, EvaluationRequest};
use body_schema_wire::{AppraisalReport, Choice};

/// How DIRECT chose a learner's last movement: every rectangle and every iteration.
#[utoipa::path(get, path = "/v1/sessions/{id}/learners/{name}/selection", tag = "sessions",
    operation_id = "getSelection",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("name" = String, Path, description = "The learner's name"),
    ),
    responses(
        (status = 200, description = "The search that chose the last movement", body = Choice),
        (status = 404, description = "There is no such session or learner", body = Problem),
        (status = 409, description = "The last movement was not chosen by DIRECT, or there is none", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
    )
)]
pub(super) async fn selection(
    State(app): State<Arc<App>>,
    Path((id, name)): Path<(String, String)>,
) -> Result<Response, Problem> {
    json(app.sessions.get(&id).await?.choice(name).await?).await
}

/// What a posture of your own would have taught instead of the last movement.
#[utoipa::path(post, path = "/v1/sessions/{id}/learners/{name}/evaluations", tag = "sessions",
    operation_id = "evaluateConfiguration",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("name" = String, Path, description = "The learner's name"),
    ),
    request_body = EvaluationRequest,
    responses(
        (status = 200, description = "The criterion there beside the best that DIRECT finds, the marker predicted there \
            and the chance of seeing it, under the belief before the last movement", body = AppraisalReport),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 404, description = "There is no such session or learner", body = Problem),
        (status = 409, description = "The learner keeps no covariance, so that nothing can be said", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
        (status = 503, description = "The posture is to be shown, and the server's memory is full", body = Problem),
        OfBodies,
    )
)]
pub(super) async fn evaluate(
    State(app): State<Arc<App>>,
    Path((id, name)): Path<(String, String)>,
    JsonBody(request): JsonBody<EvaluationRequest>,
) -> Result<Response, Problem> {
    json(app.sessions.get(&id).await?.appraise(name, request).await?).await
}

/// The next movement of a learner for which a person chooses (policy `human`), as it is set so far.
#[utoipa::path(get, path = "/v1/sessions/{id}/learners/{name}/configuration", tag = "sessions",
    operation_id = "getConfiguration",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("name" = String, Path, description = "The learner's name"),
    ),
    responses(
        (status = 200, description = "What is set for the next step", body = Configuration),
        (status = 404, description = "There is no such session or learner", body = Problem),
        (status = 409, description = "The learner chooses its movements itself, or a robot elsewhere moves", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
    )
)]
pub(super) async fn configuration(
    State(app): State<Arc<App>>,
    Path((id, name)): Path<(String, String)>,
) -> Result<Response, Problem> {
    json(Configuration { configuration: app.sessions.get(&id).await?.configuration(name).await? }).await
}

/// Set the next movement of a learner for which a person chooses (policy `human`). It may be set anew until the next step;
/// the live recording shows the posture beside the learner's arm.
#[utoipa::path(post, path = "/v1/sessions/{id}/learners/{name}/configuration", tag = "sessions",
    operation_id = "setConfiguration",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("name" = String, Path, description = "The learner's name"),
    ),
    request_body = ConfigurationRequest,
    responses(
        (status = 200, description = "It is set. What it is expected to teach, beside the best that DIRECT finds, under \
            the present belief", body = AppraisalReport),
        (status = 400, description = "The body is not JSON", body = Problem),
        (status = 404, description = "There is no such session or learner", body = Problem),
        (status = 409, description = "The learner chooses its movements itself, or makes no movement any more", body = Problem),
        (status = 422, description = "A value is not valid; `field` names it", body = Problem),
        (status = 500, description = "The session's engine has failed", body = Problem),
        (status = 503, description = "The server's memory is full", body = Problem),
        OfBodies,
    )
)]
pub(super) async fn set_configuration(
    State(app): State<Arc<App>>,
    Path((id, name)): Path<(String, String)>,
    JsonBody(request): JsonBody<ConfigurationRequest>,
) -> Result<Response, Problem> {
    json(app.sessions.get(&id).await?.set_configuration(name, request.configuration).await?).await
}
