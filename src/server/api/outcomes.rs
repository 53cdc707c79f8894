//! The results of a session with a robot elsewhere, for download.
//!
//! The robot's description is quick to make. The report judges it on data that it has not seen, which takes longer: it is made
//! when it is first asked for, and kept until something changes.

use std::sync::Arc;

use axum::{
    extract::{Path, RawQuery, State},
    http::header,
    response::{IntoResponse, Response},
};

use super::{attachment, refusals::OfEngines};
use crate::server::{
    App, extract,
    problem::{Kind, Problem},
    session::ReportFiles,
};
use body_schema_ask_tell::Session;
use body_schema_calibration::{File, Options, Progress};
use body_schema_report as report;

/// The robot's URDF with what was learned.
#[utoipa::path(get, path = "/v1/sessions/{id}/model.urdf", tag = "results", operation_id = "getUrdf",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "A URDF", body = String, content_type = "application/xml"),
        (status = 409, description = "Nothing was observed, nothing explains it, or the session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn urdf(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let file = of_session(&app, &id, |session| find(&description(session)?, "calibrated.urdf")).await?;
    Ok(attachment("model.urdf", "application/xml", file))
}

/// The origins of joints with what was learned, as YAML, in the form of `ros_calibration`s and drivers.
#[utoipa::path(get, path = "/v1/sessions/{id}/kinematics.yaml", tag = "results", operation_id = "getKinematics",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "YAML", body = Object, content_type = "application/yaml"),
        (status = 409, description = "Nothing was observed, nothing explains it, or the session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn kinematics(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let file = of_session(&app, &id, |session| find(&description(session)?, "kinematics.yaml")).await?;
    Ok(attachment("kinematics.yaml", "application/yaml", file))
}

/// What `calibrate` finds: errors on data that was not learned from, what is undetermined, outliers.
#[utoipa::path(get, path = "/v1/sessions/{id}/report.json", tag = "results", operation_id = "getReport",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("folds" = Option<u64>, Query, description = "In how many folds rows are held out to judge by, 5 if absent; 0: all rows are \
            learned from and nothing is judged, which takes a small part of the time"),
    ),
    responses(
        (status = 200, description = "The report of `body-schema calibrate`", body = Object, content_type = "application/json"),
        (status = 400, description = "`folds` is no whole number", body = Problem),
        (status = 422, description = "There cannot be so many folds, or one alone", body = Problem),
        (status = 409, description = "Too little was observed, nothing explains it, or the session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn report_json(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Result<Response, Problem> {
    let [folds] = extract::whole_numbers(query.as_deref(), ["folds"])?;
    let folds = folds.map(|folds| usize::try_from(folds).unwrap_or(usize::MAX));
    let report = find(&report(&app, &id, folds).await?, "report.json")?;
    Ok(([(header::CONTENT_TYPE, "application/json")], report).into_response())
}

/// The report of `calibrate` as a page to read, with its figures.
#[utoipa::path(get, path = "/v1/sessions/{id}/report.html", tag = "results", operation_id = "getReportPage",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "A page", body = String, content_type = "text/html"),
        (status = 409, description = "Too little was observed, nothing explains it, or the session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn report_html(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let page = find(&report(&app, &id, None).await?, "report.html")?;
    // It is a document by itself, with its style and its drawings within.
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'";
    let headers = [(header::CONTENT_TYPE, "text/html; charset=utf-8"), (header::CONTENT_SECURITY_POLICY, policy)];
    Ok((headers, page).into_response())
}

/// The observations as the table that `calibrate` reads, with `calibration.toml` and the robot's URDF beside it.
#[utoipa::path(get, path = "/v1/sessions/{id}/observations.csv", tag = "results", operation_id = "getObservationsCsv",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "A table with one row for each observation that counts", body = String, content_type = "text/csv"),
        (status = 409, description = "The session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn observations(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let table = of_session(&app, &id, |session| Ok(session.observations_csv())).await?;
    Ok(attachment("observations.csv", "text/csv; charset=utf-8", table))
}

/// The calibration file beside `observations.csv`: it names that table, and the description that the session was opened with as
/// `robot.urdf`.
#[utoipa::path(get, path = "/v1/sessions/{id}/calibration.toml", tag = "results", operation_id = "getCalibrationFile",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "TOML", body = String, content_type = "application/toml"),
        (status = 409, description = "The session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn calibration_file(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let file = of_session(&app, &id, |session| Ok(session.calibration_toml())).await?;
    Ok(attachment("calibration.toml", "application/toml", file))
}

/// The URDF that the session was opened with.
#[utoipa::path(get, path = "/v1/sessions/{id}/robot.urdf", tag = "results", operation_id = "getNominalUrdf",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "A URDF", body = String, content_type = "application/xml"),
        (status = 409, description = "The session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn nominal_urdf(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let file = of_session(&app, &id, |session| Ok(session.setup().urdf().to_owned())).await?;
    Ok(attachment("robot.urdf", "application/xml", file))
}

/// The whole session, setup and events: what `body_schema.Session.load` reads, and what another session can be opened with.
#[utoipa::path(get, path = "/v1/sessions/{id}/session.json", tag = "results", operation_id = "saveSession",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "`version`, `setup` and `events`", body = Object, content_type = "application/json"),
        (status = 409, description = "The session has no robot elsewhere", body = Problem),
        OfEngines,
    )
)]
pub(super) async fn saved(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let file = of_session(&app, &id, |session| Ok(session.to_json())).await?;
    Ok(attachment("session.json", "application/json", file))
}

/// Works on a copy of a session, so that its engine is free meanwhile.
async fn of_session<T: Send + 'static>(
    app: &App,
    id: &str,
    work: impl FnOnce(&Session) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let session = app.sessions.tell(id, |robot| Ok(robot.copy())).await?;
    app.jobs.done(move |_| work(&session)).await
}

fn description(session: &Session) -> Result<Vec<File>, Problem> {
    Ok(session.results()?.description()?)
}

/// The files of the report; the latest are kept until an event or a request for other folds.
async fn report(app: &App, id: &str, folds: Option<usize>) -> Result<Arc<[File]>, Problem> {
    let session = app.sessions.get(id).await?.watch();
    let mut kept = session.report().lock().await;
    if let Some(kept) = kept.as_ref().filter(|kept| kept.folds == folds)
        && app.sessions.tell(id, |robot| Ok(robot.revision())).await? == kept.revision
    {
        return Ok(kept.files.clone());
    }
    let copy = app.sessions.tell(id, |robot| Ok(robot.copy())).await?;
    let revision = copy.events().len();
    let files: Arc<[File]> = app.jobs.done(move |wanted| report_files(&copy, folds, wanted)).await?.into();
    *kept = Some(ReportFiles { revision, folds, files: files.clone() });
    Ok(files)
}

fn report_files(session: &Session, folds: Option<usize>, wanted: &dyn Progress) -> Result<Vec<File>, Problem> {
    let results = session.results()?;
    let calibration = results.judged(&Options { folds, ..Options::default() }, wanted)?;
    let mut files = report::files(&calibration, &results.case()?);
    files.push(calibration.report_json());
    files.retain(|file| file.path.starts_with("report."));
    Ok(files)
}

fn find(files: &[File], path: &str) -> Result<String, Problem> {
    let found = files.iter().find(|file| file.path == path).map(|file| file.text.clone());
    found.ok_or_else(|| Problem::new(Kind::Internal, format!("`{path}` was not made")))
}
