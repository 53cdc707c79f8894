//! What a watch answers by HTTP: its page, its metrics, its state, and sightings that are sent to it.

use std::{
    net::{IpAddr, SocketAddr},
    sync::{Arc, Mutex, PoisonError, atomic::AtomicU64, mpsc},
};

use anyhow::{Context, Result};
use axum::{
    Router,
    body::Bytes,
    extract::{Request, State as Shared},
    http::{HeaderMap, StatusCode, header},
    middleware::{Next, from_fn_with_state},
    response::{IntoResponse, Redirect, Response},
    routing::{get, post},
};
use body_schema_watch::Kind;
use prometheus_client::{encoding::text::encode, metrics::counter::Counter, metrics::gauge::Gauge, registry::Registry};
use serde_json::{Value, json};
use tokio::sync::oneshot;

use body_schema_sightings::{Settled, Standing, page};

/// The media type of the metrics.
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// What keeps the page up to date: it is in a file of its own, so that nothing else may run there.
const SCRIPT: &str = include_str!("page.js");
/// Nothing is asked of anybody else.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'self'; connect-src 'self'; img-src data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// Sightings that somebody sent, and where the answer goes.
pub struct Posted {
    pub text: String,
    pub is_json: bool,
    pub answer: oneshot::Sender<(StatusCode, Value)>,
}

/// What is published at the moment.
#[derive(Clone, Default)]
pub struct Published(Arc<Mutex<Pages>>);

#[derive(Default)]
struct Pages {
    metrics: String,
    status: String,
    watch: String,
}

impl Published {
    /// Publishes the state anew.
    pub fn publish(&self, state: &Standing, settled: &Settled) {
        let status = serde_json::to_string(&settled.report(state, false)).unwrap_or_default();
        let mut pages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *pages = Pages { metrics: metrics(state, settled), status, watch: renewed(&page(state, settled)) };
    }

    fn page(&self, of: impl Fn(&Pages) -> &String) -> String {
        of(&self.0.lock().unwrap_or_else(PoisonError::into_inner)).clone()
    }
}

/// The page with what keeps it up to date.
fn renewed(page: &str) -> String {
    let head = "<link rel=\"icon\" href=\"data:,\">\n<script src=\"watch.js\" type=\"module\"></script>\n</head>";
    let away = "<body>\n<p id=\"away\" role=\"alert\" hidden>The watch does not answer: what stands here is what it last said.</p>";
    page.replacen("</head>", head, 1).replacen("<body>", away, 1)
}

fn metrics(state: &Standing, settled: &Settled) -> String {
    let mut registry = Registry::with_prefix("body_schema_watch");
    let mut gauge = |name: &str, help: &str, value: f64| {
        let gauge = Gauge::<f64, AtomicU64>::default();
        gauge.set(value);
        registry.register(name, help, gauge);
    };
    let threshold = 1.0 / settled.false_alarms_per_year;
    gauge("evidence", "The evidence of a change, years (R)", state.watch.evidence() * threshold);
    gauge("threshold", "The evidence of an alarm, years (one by the false alarms per year)", threshold);
    gauge("changed", "1 while a change stands", f64::from(u8::from(state.watch.is_changed())));
    if let Some(last) = state.heard.last() {
        gauge("last_residual_sds", "The last residual, in deviations of what is predicted", last.residual_sds);
        gauge("last_wild", "The probability that the last sighting alone is wild", last.wild);
    }
    let mut counter = |name: &str, help: &str, value: usize| {
        let counter = Counter::<u64>::default();
        counter.inc_by(value as u64);
        registry.register(name, help, counter);
    };
    let of = |kind: Kind| state.told.iter().filter(|told| told.kind == kind).count();
    counter("alarms", "Alarms", of(Kind::Alarm));
    counter("recoveries", "Recoveries", of(Kind::Recovered));
    counter("sightings", "Sightings that were heard", state.heard.len());
    counter("left_out", "Lines that were left out", state.left_out.len());
    let mut text = String::new();
    // Writing to a string does not fail.
    encode(&mut text, &registry).map_or_else(|_| String::new(), |()| text)
}

#[derive(Clone)]
struct App {
    published: Published,
    send: mpsc::Sender<Posted>,
    is_local: bool,
}

/// Begins to answer at an address, in a thread of its own.
pub fn begin(address: SocketAddr, published: Published, send: mpsc::Sender<Posted>) -> Result<SocketAddr> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("cannot start")?;
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).with_context(|| {
        format!("cannot listen on {address}; another program may be using it, try --listen 127.0.0.1:0")
    })?;
    let bound = listener.local_addr().context("cannot tell the address")?;
    let app = App { published, send, is_local: bound.ip().is_loopback() };
    let routes = Router::new()
        .route("/", get(|| async { Redirect::temporary("/watch") }))
        .route("/watch", get(get_watch))
        .route("/watch.js", get(get_script))
        .route("/metrics", get(get_metrics))
        .route("/status", get(get_status))
        .route("/sightings", post(post_sightings))
        .layer(from_fn_with_state(app.clone(), only_by_its_address))
        .with_state(app);
    let serve = move || {
        if let Err(error) = runtime.block_on(async { axum::serve(listener, routes).await }) {
            crate::cli::output::tell(format_args!("warning: nobody is answered any longer: {error}"));
        }
    };
    std::thread::Builder::new().name("listen".to_owned()).spawn(serve).context("cannot start")?;
    Ok(bound)
}

/// On this machine alone a page elsewhere must not get in by a name that leads here.
async fn only_by_its_address(Shared(app): Shared<App>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let name = host.rsplit_once(':').map_or(host, |(name, port)| if port.ends_with(']') { host } else { name });
    let is_address = name.trim_matches(['[', ']']).parse::<IpAddr>().is_ok() || name.eq_ignore_ascii_case("localhost");
    match app.is_local && !is_address {
        true => problem(StatusCode::FORBIDDEN, "ask by the address of this machine, not by another name"),
        false => next.run(request).await,
    }
}

fn problem(status: StatusCode, detail: &str) -> Response {
    (status, axum::Json(json!({ "status": status.as_u16(), "detail": detail }))).into_response()
}

async fn get_watch(Shared(app): Shared<App>) -> Response {
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    (headers, app.published.page(|pages| &pages.watch)).into_response()
}

async fn get_script() -> Response {
    ([(header::CONTENT_TYPE, "text/javascript; charset=utf-8"), (header::X_CONTENT_TYPE_OPTIONS, "nosniff")], SCRIPT)
        .into_response()
}

async fn get_metrics(Shared(app): Shared<App>) -> Response {
    ([(header::CONTENT_TYPE, OPEN_METRICS)], app.published.page(|pages| &pages.metrics)).into_response()
}

async fn get_status(Shared(app): Shared<App>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], app.published.page(|pages| &pages.status)).into_response()
}

async fn post_sightings(Shared(app): Shared<App>, headers: HeaderMap, body: Bytes) -> Response {
    let kind = headers.get(header::CONTENT_TYPE).and_then(|it| it.to_str().ok()).unwrap_or_default();
    let is_json = kind.starts_with("application/json");
    // A form of a page elsewhere can send neither without asking first.
    if !is_json && !kind.starts_with("text/csv") {
        let hint =
            "send `Content-Type: text/csv` with a line of titles, or `application/json` with an object by titles";
        return problem(StatusCode::UNSUPPORTED_MEDIA_TYPE, hint);
    }
    let Ok(text) = String::from_utf8(body.to_vec()) else {
        return problem(StatusCode::BAD_REQUEST, "the body is not text in UTF-8");
    };
    let (answer, answered) = oneshot::channel();
    if app.send.send(Posted { text, is_json, answer }).is_err() {
        return problem(StatusCode::SERVICE_UNAVAILABLE, "the watch is ending");
    }
    match answered.await {
        Ok((status, value)) => (status, axum::Json(value)).into_response(),
        Err(_) => problem(StatusCode::SERVICE_UNAVAILABLE, "the watch is ending"),
    }
}
