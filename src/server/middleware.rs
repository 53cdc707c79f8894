//! Middleware: what holds for every request and every response.

use std::sync::Arc;

use axum::{
    Router,
    body::{Body, HttpBody, to_bytes},
    extract::{ConnectInfo, DefaultBodyLimit, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header},
    middleware::{Next, from_fn, from_fn_with_state, map_response},
    response::{IntoResponse, Response},
};

use crate::page::CONTENT_SECURITY_POLICY;

use super::{
    App, FrameAncestor,
    authentication::Reached,
    holding::Holding,
    problem::{Kind, PROBLEM_JSON, Problem},
    requests,
    session::Taken,
};

/// The size from which on answers are counted, bytes.
const LARGE_BYTES: usize = 64 << 10;
/// The most bytes that are read of an error that no handler made.
const MOST_SAID_BYTES: usize = 64 << 10;

/// The headers of every response.
#[derive(Clone)]
pub(super) struct Headers(Arc<[(HeaderName, HeaderValue)]>);

impl Headers {
    /// The headers, with these origins allowed to show the page in a frame.
    pub(super) fn new(frame_ancestors: &[FrameAncestor]) -> Self {
        let policy = match frame_ancestors {
            [] => format!("{CONTENT_SECURITY_POLICY}; frame-ancestors 'none'"),
            origins => {
                let origins: Vec<&str> = origins.iter().map(FrameAncestor::as_str).collect();
                format!("{CONTENT_SECURITY_POLICY}; frame-ancestors {}", origins.join(" "))
            }
        };
        // Origins are of visible characters.
        let policy = HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static(CONTENT_SECURITY_POLICY));
        // For browsers that do not read `frame-ancestors`; it knows no list of origins.
        let old = frame_ancestors.is_empty().then_some((header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY")));
        let headers = [
            (header::CONTENT_SECURITY_POLICY, policy),
            (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
            (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
            (HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin")),
            (HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")),
        ];
        Self(headers.into_iter().chain(old).collect())
    }
}

/// The routes with the middleware around them.
pub(super) fn layered(router: Router<Arc<App>>, app: &Arc<App>, always: Headers) -> Router {
    let router = router
        .fallback(async |uri: Uri| {
            Problem::new(Kind::UnknownRoute, format!("there is nothing at `{}`; see /v1/openapi.json", uri.path()))
        })
        .layer(DefaultBodyLimit::max(app.limits.body_bytes))
        .layer(from_fn(requests::routed));
    // Around the router as a whole: what is wrong with a method is known only there.
    Router::new()
        .fallback_service(router.with_state(app.clone()))
        .layer(from_fn_with_state(app.clone(), authenticate))
        .layer(from_fn_with_state(app.clone(), refuse_large_heads))
        .layer(map_response(as_problem))
        .layer(map_response(move |response| with_headers(always.clone(), response)))
        .layer(from_fn_with_state(app.metrics.clone(), requests::attended))
}

/// Refuses a head that is larger than allowed, though small enough to be read.
async fn refuse_large_heads(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    match app.limits.too_large_a_head(request.method(), request.uri(), request.headers()) {
        Some(detail) => Problem::new(Kind::HeadTooLarge, detail).into_response(),
        None => next.run(request).await,
    }
}

/// Counts large answers until they are sent; beyond the limit, requests that only read are asked to come again.
pub(super) async fn counted(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let only_reads = *request.method() == Method::GET;
    let response = next.run(request).await;
    let bytes = response.body().size_hint().exact().and_then(|bytes| usize::try_from(bytes).ok()).unwrap_or(0);
    if bytes < LARGE_BYTES {
        return response;
    }
    if only_reads && !app.answers.has_room() {
        let detail = "as many large answers are on their way to clients as there may be; ask again later";
        return Problem::new(Kind::Busy, detail).into_response();
    }
    let taken = Taken::of(&app.answers, bytes);
    response.map(|body| Body::new(Holding::new(body, taken)))
}

/// Refuses requests under a foreign name, without the token, or from a page of another origin, which must neither change
/// anything nor open a WebSocket.
async fn authenticate(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let mut hosts = request.headers().get_all(header::HOST).into_iter();
    let (Some(host), None) = (hosts.next().and_then(|host| host.to_str().ok()), hosts.next()) else {
        let detail = "a request has one header `Host`: the name or the address of the server, with its port";
        return Problem::new(Kind::Malformed, detail).field("Host").into_response();
    };
    let reached = request.extensions().get::<ConnectInfo<Reached>>().map(|ConnectInfo(reached)| *reached);
    if !app.authentication.are_meant_by(host, reached) {
        let detail = format!("this server does not answer to `{host}`; start it with --allow-host if it is to");
        return Problem::new(Kind::ForeignOrigin, detail).field("Host").into_response();
    }
    if let Some(response) = app.authentication.turn_away(&request) {
        return response;
    }
    let harmless = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS)
        && !request.headers().contains_key(header::UPGRADE);
    if !harmless && !is_own_origin(request.headers(), host) {
        let detail = "a page of another origin may not do this";
        return Problem::new(Kind::ForeignOrigin, detail).field("Origin").into_response();
    }
    next.run(request).await
}

/// Whether the origin is our own. Scripts send none; browsers always do where it matters.
fn is_own_origin(headers: &HeaderMap, host: &str) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else { return true };
    let authority = origin.to_str().ok().and_then(|origin| origin.split_once("://")).map(|(_, authority)| authority);
    authority.is_some_and(|authority| authority.eq_ignore_ascii_case(host))
}

/// Turns errors that no handler made (wrong methods, bad paths, failed upgrades) into problems.
async fn as_problem(response: Response) -> Response {
    let status = response.status();
    let is_problem = response.headers().get(header::CONTENT_TYPE).is_some_and(|value| value == PROBLEM_JSON);
    if is_problem || !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let said = to_bytes(body, MOST_SAID_BYTES).await.unwrap_or_default();
    let said = String::from_utf8_lossy(&said).into_owned();
    let problem = match status {
        StatusCode::METHOD_NOT_ALLOWED => {
            let allowed = parts.headers.get(header::ALLOW).and_then(|value| value.to_str().ok()).unwrap_or("no method");
            Problem::new(Kind::MethodNotAllowed, format!("allowed here: {}", allowed.replace(',', ", ")))
        }
        StatusCode::NOT_FOUND => Problem::new(Kind::UnknownRoute, said),
        StatusCode::BAD_REQUEST => Problem::new(Kind::Malformed, said),
        _ => Problem::new(Kind::Other(status.as_u16(), status.canonical_reason().unwrap_or("Error")), said),
    };
    parts.headers.remove(header::CONTENT_TYPE);
    parts.headers.remove(header::CONTENT_LENGTH);
    let (made, body) = problem.into_response().into_parts();
    parts.headers.extend(made.headers);
    parts.extensions.extend(made.extensions);
    Response::from_parts(parts, body)
}

async fn with_headers(always: Headers, mut response: Response) -> Response {
    let headers = response.headers_mut();
    for (name, value) in always.0.iter() {
        // A document with its style within has said its own policy.
        if *name != header::CONTENT_SECURITY_POLICY || !headers.contains_key(name) {
            headers.insert(name, value.clone());
        }
    }
    // What sessions say changes from step to step; assets have said themselves how long they hold.
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_must_be_the_host() {
        let check = |origin: Option<&'static str>| {
            let mut headers = HeaderMap::new();
            headers.extend(origin.map(|origin| (header::ORIGIN, HeaderValue::from_static(origin))));
            is_own_origin(&headers, "localhost:8080")
        };
        assert!(check(None) && check(Some("http://localhost:8080")));
        for origin in ["http://localhost:8081", "http://localhost", "https://example.org", "null"] {
            assert!(!check(Some(origin)), "{origin}");
        }
    }
}
