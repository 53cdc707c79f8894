//! How a page arranges the viewer.

use std::sync::Arc;

use axum::{
    extract::{Path, RawQuery, State},
    http::header,
    response::{IntoResponse, Response},
};

use crate::server::{App, problem::Problem};
use body_schema_recording::{Shape, Theme};

/// An arrangement of the viewer for a page that has controls and curves of its own: the scene alone.
///
/// A viewer that has the recording takes it up at once, whatever a visitor did to its last one. Its camera is where it is
/// at first, so that this also restores the view.
#[utoipa::path(get, path = "/v1/sessions/{id}/blueprint.rbl", tag = "sessions", operation_id = "getArrangement",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("theme" = Option<Theme>, Query, description = "Background and ground; light if absent"),
        ("shape" = Option<Shape>, Query, description = "Of the view, which the camera fills; wide if absent"),
        ("aspect" = Option<f64>, Query, description = "The exact shape: the view's width in heights, from 0.2 to 5; it goes \
            before `shape`", minimum = 0.2, maximum = 5.0),
        ("learner" = Option<String>, Query, description = "The name of the learner that is shown alone; all if absent"),
    ),
    responses(
        (status = 200, description = "A Rerun blueprint (.rbl): the 12-byte header of a stream, then its messages",
            body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 400, description = "A parameter is none of these words, or not in this range", body = Problem),
        (status = 404, description = "There is no such session, or it has no such learner", body = Problem),
        (status = 500, description = "The arrangement could not be written", body = Problem),
    )
)]
pub(super) async fn blueprint(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let blueprint =
        body_schema_backend::arrangement(session.live(), &session.description().learners, query.as_deref())?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], blueprint).into_response())
}
