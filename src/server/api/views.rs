//! How a page arranges the viewer.

use std::sync::Arc;

use axum::{
    extract::{Path, RawQuery, State},
    http::header,
    response::{IntoResponse, Response},
};

use crate::server::{
    App, extract,
    problem::{Kind, Problem},
};
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
    ),
    responses(
        (status = 200, description = "A Rerun blueprint (.rbl): the 12-byte header of a stream, then its messages",
            body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 400, description = "A parameter is neither of these words nor in this range", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 500, description = "The arrangement could not be written", body = Problem),
    )
)]
pub(super) async fn blueprint(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let [theme, shape, aspect] = extract::parameters(query.as_deref(), ["theme", "shape", "aspect"])?;
    let (theme, shape): (Theme, Shape) = (extract::word("theme", theme)?, extract::word("shape", shape)?);
    let aspect = aspect.map(self::aspect).transpose()?.unwrap_or(shape.aspect());
    let failed = |detail: String| Problem::new(Kind::Internal, format!("no arrangement: {detail}"));
    let blueprint = session.live().blueprint(theme, aspect).map_err(|error| failed(error.to_string()))?;
    let blueprint = blueprint.ok_or_else(|| failed("the recording has not begun".to_owned()))?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], blueprint).into_response())
}

fn aspect(value: &str) -> Result<f64, Problem> {
    value.parse().ok().filter(|aspect| (0.2..=5.0).contains(aspect)).ok_or_else(|| {
        let detail = format!("`aspect` must be a number from 0.2 to 5, not `{value}`");
        Problem::new(Kind::Malformed, detail).field("aspect")
    })
}
