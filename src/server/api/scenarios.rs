//! The built-in scenarios.

use std::sync::OnceLock;

use crate::server::{blocking::run_blocking, problem::Problem};
use axum::{Json, extract::Path};
use body_schema_backend::{ScenarioList, ScenarioResource};
use body_schema_scenario::ScenarioSummary;

/// All built-in scenarios.
#[utoipa::path(get, path = "/v1/scenarios", tag = "scenarios", operation_id = "listScenarios", responses(
    (status = 200, description = "All built-in scenarios, simplest first", body = ScenarioList)
))]
pub(super) async fn list() -> Result<Json<ScenarioList>, Problem> {
    Ok(Json(ScenarioList { scenarios: run_blocking(summaries).await? }))
}

/// They are part of the program: those that have been read once need not be read again.
fn summaries() -> Result<Vec<ScenarioSummary>, Problem> {
    static SUMMARIES: OnceLock<Vec<ScenarioSummary>> = OnceLock::new();
    if let Some(known) = SUMMARIES.get() {
        return Ok(known.clone());
    }
    let read = body_schema_backend::summaries()?;
    Ok(SUMMARIES.get_or_init(|| read).clone())
}

/// One scenario with its source.
#[utoipa::path(get, path = "/v1/scenarios/{name}", tag = "scenarios", operation_id = "getScenario",
    params(("name" = String, Path, description = "The scenario's name", example = "arm-6dof")),
    responses(
        (status = 200, description = "The scenario", body = ScenarioResource),
        (status = 404, description = "There is no such scenario", body = Problem),
    )
)]
pub(super) async fn get(Path(name): Path<String>) -> Result<Json<ScenarioResource>, Problem> {
    let scenario = run_blocking(move || Ok::<_, Problem>(body_schema_backend::scenario(&name)?)).await?;
    Ok(Json(ScenarioResource { summary: scenario.summary(), source: scenario.source }))
}
