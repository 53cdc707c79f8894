//! The built-in scenarios.

use std::sync::OnceLock;

use axum::{Json, extract::Path};
use serde::Serialize;
use utoipa::ToSchema;

use crate::server::{
    blocking::run_blocking,
    problem::{Kind, Problem},
};
use body_schema_scenario::{BUILTIN, Scenario, ScenarioError, ScenarioSummary, builtin};

/// The built-in scenarios.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ScenarioList {
    /// All of them, simplest first.
    pub scenarios: Vec<ScenarioSummary>,
}

/// A scenario with its source.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ScenarioResource {
    /// The scenario in brief.
    #[serde(flatten)]
    pub summary: ScenarioSummary,
    /// The scenario file, TOML.
    pub source: String,
}

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
    let read = BUILTIN.iter().map(|known| find(known.name).map(|scenario| scenario.summary()));
    let read = read.collect::<Result<Vec<_>, Problem>>()?;
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
    let scenario = run_blocking(move || find(&name)).await?;
    Ok(Json(ScenarioResource { summary: scenario.summary(), source: scenario.source }))
}

fn find(name: &str) -> Result<Scenario, Problem> {
    builtin(name).map_err(|error| match error {
        ScenarioError::UnknownScenario { .. } => Problem::new(Kind::UnknownScenario, error.to_string()).field("name"),
        error => error.into(),
    })
}
