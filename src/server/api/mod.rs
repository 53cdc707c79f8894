//! The routes under `/v1`, and what OpenAPI says of them.

mod choices;
mod downloads;
mod observations;
mod outcomes;
mod readers;
mod refusals;
mod scenarios;
mod sessions;
mod streams;
mod suggestions;
mod views;

use std::sync::Arc;

use axum::{
    Json, Router,
    body::{Body, Bytes},
    extract::{DefaultBodyLimit, State},
    http::header,
    response::{IntoResponse, Response},
};
use serde::Serialize;
use serde_json::json;
use utoipa::{
    IntoResponses, OpenApi, ToSchema,
    openapi::{
        Object, OneOf, RefOr, Schema,
        extensions::ExtensionsBuilder,
        path::Parameter,
        schema::{SchemaType, Type},
    },
};
use utoipa_axum::{
    router::{OpenApiRouter, UtoipaMethodRouterExt},
    routes,
};

pub use body_schema_backend::{MadeSteps, ScenarioList, ScenarioResource, StepRequest};
pub use sessions::SessionList;

use super::{
    App, Limits,
    blocking::run_blocking,
    metrics::OPEN_METRICS,
    problem::{Kind, PROBLEM_JSON, Problem},
};
use body_schema_recording::{Shape, Theme};
use body_schema_wire::StepReport;

const JSON: &str = "application/json";
const EVENT_STREAM: &str = "text/event-stream";

/// Whether the server works.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`, or there is no answer.
    pub status: Liveness,
    /// Version of body-schema.
    #[schema(value_type = String)]
    pub version: &'static str,
}

/// The health of a server that answers.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Liveness {
    /// It answers.
    Ok,
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "body-schema",
        description = "Learn a robot's kinematic body schema from a few well-chosen movements, and watch it happen.\n\n\
            A session is an experiment: a scenario with a seed, in which several learners each make one movement per \
            step. Step it, follow its reports as they are made, take its recording away. Or it is a robot elsewhere: ask \
            where to move it, tell where it was and what was seen, take its calibrated description away.\n\nEvery error is a problem \
            document (RFC 9457). Lengths are in metres and angles in radians unless a name says otherwise."
    ),
    tags(
        (name = "scenarios", description = "What experiments there are"),
        (name = "sessions", description = "Running experiments"),
        (name = "robots", description = "Robots elsewhere, which ask and tell"),
        (name = "results", description = "What came out of a session"),
        (name = "server", description = "The server itself")
    ),
    // What streams carry, and so no route returns.
    // The last three are words of parameters, which utoipa names without taking them up.
    components(schemas(StepReport, streams::LiveEvent, Shape, Theme, sessions::Condition))
)]
struct Document;

/// All routes, and the document that describes them.
pub(super) fn routes(limits: &Limits) -> (Router<Arc<App>>, Bytes) {
    let (router, mut document) = OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(scenarios::list))
        .routes(routes!(scenarios::get))
        .routes(routes!(sessions::list, sessions::create).layer(DefaultBodyLimit::max(limits.setup_body_bytes())))
        .routes(routes!(sessions::get, sessions::delete))
        .routes(routes!(sessions::step))
        .routes(routes!(choices::selection))
        .routes(routes!(choices::evaluate))
        .routes(routes!(choices::configuration, choices::set_configuration))
        .routes(routes!(suggestions::list, suggestions::suggest))
        .routes(routes!(suggestions::outcome))
        .routes(routes!(observations::list, observations::observe))
        .routes(routes!(observations::get, observations::exclude))
        .routes(routes!(observations::include))
        .routes(routes!(outcomes::urdf))
        .routes(routes!(outcomes::kinematics))
        .routes(routes!(outcomes::report_json))
        .routes(routes!(outcomes::report_html))
        .routes(routes!(outcomes::observations))
        .routes(routes!(outcomes::calibration_file))
        .routes(routes!(outcomes::nominal_urdf))
        .routes(routes!(outcomes::saved))
        .routes(routes!(streams::events))
        .routes(routes!(streams::live))
        .routes(routes!(streams::live_recording))
        .routes(routes!(views::blueprint))
        .routes(routes!(downloads::recording))
        .routes(routes!(downloads::steps_csv))
        .routes(routes!(downloads::result))
        .routes(routes!(openapi))
        .routes(routes!(health))
        .routes(routes!(metrics))
        .split_for_parts();
    describe_what_holds_for_all(&mut document);
    describe_events(&mut document);
    describe_limits(&mut document, limits);
    // The document consists of strings, so that it can always be written.
    (router, document.to_pretty_json().unwrap_or_default().into())
}

/// Describes once for all routes what any of them may refuse, and the media type of problems.
fn describe_what_holds_for_all(document: &mut utoipa::openapi::OpenApi) {
    for item in document.paths.paths.values_mut() {
        for operation in [&mut item.get, &mut item.post, &mut item.put, &mut item.delete].into_iter().flatten() {
            for parameter in operation.parameters.iter_mut().flatten() {
                if let RefOr::T(Parameter { schema: Some(RefOr::T(schema)), .. }) = parameter {
                    never_null(schema);
                }
            }
            let described = &mut operation.responses.responses;
            for (status, refusal) in refusals::OfAll::responses() {
                described.entry(status).or_insert(refusal);
            }
            for (_, response) in described.iter_mut().filter(|(status, _)| status.starts_with(['4', '5'])) {
                let RefOr::T(response) = response else { continue };
                let content = response.content.swap_remove(JSON);
                response.content.extend(content.map(|content| (PROBLEM_JSON.to_owned(), content)));
            }
        }
    }
}

/// Removes null from a parameter's types: it may be absent, but JSON's null cannot be written.
fn never_null(schema: &mut Schema) {
    match schema {
        Schema::Object(Object { schema_type: SchemaType::Array(types), .. }) => types.retain(|of| *of != Type::Null),
        Schema::OneOf(OneOf { items, .. }) => items.retain(|item| {
            !matches!(item, RefOr::T(Schema::Object(Object { schema_type: SchemaType::Type(Type::Null), .. })))
        }),
        _ => {}
    }
}

/// Describes this server's limits where the types do not.
fn describe_limits(document: &mut utoipa::openapi::OpenApi, limits: &Limits) {
    let steps = document.components.as_mut().and_then(|components| components.schemas.get_mut("StepRequest"));
    if let Some(RefOr::T(Schema::Object(request))) = steps
        && let Some(RefOr::T(Schema::Object(count))) = request.properties.get_mut("count")
    {
        count.maximum = Some(limits.steps_per_request.into());
    }
}

/// Describes server-sent events: they are neither JSON nor a string, and OpenAPI 3.1 has no word for them. Their content is
/// described as OpenAPI 3.2 does.
fn describe_events(document: &mut utoipa::openapi::OpenApi) {
    let operations = document.paths.paths.values_mut().filter_map(|item| item.get.as_mut());
    let responses = operations.flat_map(|operation| operation.responses.responses.values_mut());
    for response in responses {
        let RefOr::T(response) = response else { continue };
        let Some(RefOr::T(content)) = response.content.get_mut(EVENT_STREAM) else { continue };
        content.schema = None;
        let report = json!({ "$ref": "#/components/schemas/StepReport" });
        let event = json!({ "type": "object", "properties": { "id": { "type": "string" }, "data": report } });
        content.extensions = Some(ExtensionsBuilder::new().add("x-itemSchema", event).build());
    }
}

/// This document.
#[utoipa::path(get, path = "/v1/openapi.json", tag = "server", responses(
    (status = 200, description = "The OpenAPI 3.1 description of this server", body = serde_json::Value)
))]
async fn openapi(State(app): State<Arc<App>>) -> Response {
    ([(header::CONTENT_TYPE, JSON)], app.openapi.clone()).into_response()
}

/// Whether the server works.
#[utoipa::path(get, path = "/healthz", tag = "server", responses(
    (status = 200, description = "The server works", body = Health)
))]
async fn health() -> Json<Health> {
    Json(Health { status: Liveness::Ok, version: env!("CARGO_PKG_VERSION") })
}

/// What the server does and holds, in figures for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "server", responses(
    (status = 200, description = "Counters since the start, and what there is now, in the text form of OpenMetrics 1.0",
        body = String, content_type = "application/openmetrics-text")
))]
async fn metrics(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let text = app.metrics.text(&app.sessions.present(app.connections.count()));
    let text = text.map_err(|error| Problem::new(Kind::Internal, format!("no figures: {error}")))?;
    Ok(([(header::CONTENT_TYPE, OPEN_METRICS)], text).into_response())
}

/// A file to take away.
fn attachment(name: &str, content_type: &'static str, content: impl Into<Body>) -> Response {
    // Names are made of letters, digits, points and hyphens.
    let disposition = format!("attachment; filename=\"{name}\"");
    let headers = [(header::CONTENT_TYPE, content_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)];
    (headers, content.into()).into_response()
}

/// A JSON response, serialised where it blocks no other request.
async fn json<T: Serialize + Send + 'static>(value: T) -> Result<Response, Problem> {
    let bytes = run_blocking(move || {
        serde_json::to_vec(&value).map_err(|error| Problem::new(Kind::Internal, format!("no JSON: {error}")))
    });
    Ok(([(header::CONTENT_TYPE, JSON)], Body::from(bytes.await?)).into_response())
}
