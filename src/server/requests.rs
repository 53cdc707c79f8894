//! Every request has an id, and leaves one line in the log and its mark in the figures.
//!
//! Of the client's input a line holds only the request id: the route is the pattern that matched, never the requested
//! address, so that no token and no body can get into the log.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Instant,
};

use axum::{
    body::{Body, Bytes},
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode},
    middleware::Next,
    response::Response,
};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tracing::Level;
use uuid::Uuid;

use super::metrics::Metrics;

/// The header of a request's id.
const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// The most bytes of an id from a client.
const MOST_ID_BYTES: usize = 64;

/// The prefix of the names of kinds of problems.
const URN: &str = "urn:body-schema:problem:";

tokio::task_local! {
    static ID: Arc<str>;
}

/// The id of the request that is being served; `None` outside of any.
pub(super) fn id() -> Option<String> {
    ID.try_with(|id| id.to_string()).ok()
}

/// Work for a separate task, under the id of the request that is being served.
pub(super) fn carried<F: Future>(work: F) -> impl Future<Output = F::Output> {
    let id = ID.try_with(Arc::clone).ok();
    async move {
        match id {
            Some(id) => ID.scope(id, work).await,
            None => work.await,
        }
    }
}

/// Serves a request under an id: the client's, if it is a plain one, or a new one.
pub(super) async fn attended(State(metrics): State<Arc<Metrics>>, request: Request, next: Next) -> Response {
    let id = given(request.headers()).unwrap_or_else(|| Uuid::new_v4().simple().to_string()).into();
    let mut exchange = Exchange::begun(&id, request.method(), metrics);
    let mut response = ID.scope(id.clone(), next.run(request)).await;
    // Ids are of visible characters.
    response.headers_mut().extend(HeaderValue::from_str(&id).map(|id| (REQUEST_ID, id)));
    exchange.answered(&response);
    response.map(|body| Body::new(Sent { body, exchange }))
}

/// Marks the answer with its route.
pub(super) async fn routed(route: Option<MatchedPath>, request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    if let Some(route) = route {
        response.extensions_mut().insert(route);
    }
    response
}

/// The id that a request came with, if it may be repeated.
fn given(headers: &HeaderMap) -> Option<String> {
    let mut ids = headers.get_all(REQUEST_ID).into_iter();
    let (Some(id), None) = (ids.next()?.to_str().ok(), ids.next()) else { return None };
    let is_plain = id.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._".contains(&byte));
    (is_plain && (1..=MOST_ID_BYTES).contains(&id.len())).then(|| id.to_owned())
}

/// What an answer that is a problem carries for the log.
#[derive(Clone, Debug)]
pub(super) struct Refused {
    kind: &'static str,
    /// What went wrong, if that is internal to the server; details of clients' mistakes may hold their words, and are
    /// not logged.
    why: Option<String>,
}

impl Refused {
    pub(super) fn new(kind: &'static str, why: Option<String>) -> Self {
        Self { kind, why }
    }

    /// The kind, without the prefix that all kinds share.
    fn kind(&self) -> &'static str {
        self.kind.strip_prefix(URN).unwrap_or("other")
    }

    fn why(&self) -> Option<&str> {
        self.why.as_deref()
    }
}

/// A request and its answer, logged when the answer was sent or nobody waits for it any longer.
struct Exchange {
    id: Arc<str>,
    method: &'static str,
    begun: Instant,
    answer: Option<Answer>,
    metrics: Arc<Metrics>,
}

/// The facts about an answer once it begins.
struct Answer {
    status: StatusCode,
    route: Option<MatchedPath>,
    refused: Option<Refused>,
    after_ms: f64,
    bytes: u64,
    is_whole: bool,
}

impl Exchange {
    fn begun(id: &Arc<str>, method: &Method, metrics: Arc<Metrics>) -> Self {
        Self { id: id.clone(), method: known(method), begun: Instant::now(), answer: None, metrics }
    }

    fn answered(&mut self, response: &Response) {
        let (status, extensions) = (response.status(), response.extensions());
        let (route, refused) = (extensions.get::<MatchedPath>().cloned(), extensions.get::<Refused>().cloned());
        let path = route.as_ref().map(MatchedPath::as_str);
        self.metrics.answered(self.method, path, status, self.begun.elapsed());
        if let Some(refused) = &refused {
            self.metrics.refused(refused.kind(), status);
        }
        // The answer to `HEAD` has a body that nobody takes.
        let is_whole = self.method == "HEAD";
        self.answer = Some(Answer { status, route, refused, after_ms: self.ms(), bytes: 0, is_whole });
    }

    fn ms(&self) -> f64 {
        (self.begun.elapsed().as_secs_f64() * 1e6).round() / 1e3
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        let (id, method, duration_ms) = (&*self.id, self.method, self.ms());
        let Some(answer) = &self.answer else {
            tracing::info!(request = id, method, duration_ms, "given up by its client");
            return;
        };
        let Answer { status, route, refused, after_ms, bytes, is_whole } = answer;
        let route = route.as_ref().map(MatchedPath::as_str);
        let (problem, why) = (refused.as_ref().map(Refused::kind), refused.as_ref().and_then(Refused::why));
        let cut_off = (!is_whole).then_some(true);
        macro_rules! tell {
            ($level:expr) => {
                tracing::event!(
                    $level,
                    request = id,
                    method,
                    route,
                    status = status.as_u16(),
                    problem,
                    why,
                    answered_ms = after_ms,
                    duration_ms,
                    bytes,
                    cut_off,
                    "answered"
                )
            };
        }
        match *status {
            StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE => tell!(Level::WARN),
            status if status.is_server_error() => tell!(Level::ERROR),
            _ => tell!(Level::INFO),
        }
    }
}

/// The name of a method in figures and lines: clients may invent others.
fn known(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// The body of an answer, counted.
struct Sent {
    body: Body,
    exchange: Exchange,
}

impl Sent {
    fn answer(&mut self) -> Option<&mut Answer> {
        self.exchange.answer.as_mut()
    }
}

impl Drop for Sent {
    fn drop(&mut self) {
        let is_at_end = self.body.is_end_stream();
        if let Some(answer) = self.answer() {
            answer.is_whole |= is_at_end;
        }
    }
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(cx));
        if let Some(answer) = self.answer() {
            match &frame {
                Some(Ok(frame)) => answer.bytes += frame.data_ref().map_or(0, |data| data.len() as u64),
                Some(Err(_)) => {}
                None => answer.is_whole = true,
            }
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_taken_if_they_are_plain_and_short_and_one() {
        let given =
            |ids: &[&'static str]| given(&ids.iter().map(|id| (REQUEST_ID, HeaderValue::from_static(id))).collect());
        for id in ["a", "7f3c-0.9_Z", "0123456789012345678901234567890123456789012345678901234567890123"] {
            assert_eq!(given(&[id]).as_deref(), Some(id));
        }
        for ids in [
            &[][..],
            &[""],
            &["two words"],
            &["line=1"],
            &["a", "b"],
            &["01234567890123456789012345678901234567890123456789012345678901234"],
        ] {
            assert_eq!(given(ids), None, "{ids:?}");
        }
    }
}
