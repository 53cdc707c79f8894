//! The scenarios: built in, and those of the server's own.

use std::sync::Arc;

use crate::server::{App, problem::Problem};
use axum::{
    Json,
    extract::{Path, State},
};
use body_schema_backend::{ScenarioList, ScenarioResource};

/// All scenarios.
#[utoipa::path(get, path = "/v1/scenarios", tag = "scenarios", operation_id = "listScenarios", responses(
    (status = 200, description = "All scenarios: those that the server was started with, then the built-in ones, simplest first", body = ScenarioList)
))]
pub(super) async fn list(State(app): State<Arc<App>>) -> Json<ScenarioList> {
    Json(app.listed.clone())
}

/// One scenario with its source.
#[utoipa::path(get, path = "/v1/scenarios/{name}", tag = "scenarios", operation_id = "getScenario",
    params(("name" = String, Path, description = "The scenario's name", example = "arm-6dof")),
    responses(
        (status = 200, description = "The scenario", body = ScenarioResource),
        (status = 404, description = "There is no such scenario", body = Problem),
    )
)]
pub(super) async fn get(
    State(app): State<Arc<App>>,
    Path(name): Path<String>,
) -> Result<Json<ScenarioResource>, Problem> {
    let scenarios = app.sessions.scenarios().clone();
    let found = crate::server::blocking::run_blocking(move || Ok::<_, Problem>(scenarios.resource(&name)?)).await?;
    Ok(Json(found))
}
