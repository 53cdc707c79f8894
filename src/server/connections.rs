//! Connections: their number, and how long each may keep the server waiting.
//!
//! A connection that sends no request, sends it slowly, or does not take what it asked for, is ended; one whose request has
//! come is served as long as that takes. At the maximum, the one that has waited longest for a request makes room; where all
//! are busy, a newcomer gets an error.

mod stream;

use std::{
    convert::Infallible,
    io,
    net::SocketAddr,
    pin::pin,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::{
    Router,
    extract::{ConnectInfo, Request},
    http::StatusCode,
};
use bytes::Bytes;
use hyper::{
    body::{Body as _, Incoming},
    server::conn::http1,
    service::{Service, service_fn},
};
use hyper_util::{rt::TokioIo, service::TowerToHyperService};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore, watch},
    time::{Instant, sleep, sleep_until, timeout},
};
use tokio_util::sync::CancellationToken;

use super::{
    authentication::Reached,
    holding::Holding,
    limits::Limits,
    metrics::Metrics,
    problem::{Kind, PROBLEM_JSON, Problem},
    rarely::Rarely,
};
use stream::Stream;

/// The time that a connection which has to make room may take to end.
const ROOM_WITHIN: Duration = Duration::from_millis(100);
/// The most newcomers that are told at a time that all are busy, and the time for it.
const MOST_REFUSALS: usize = 16;
const REFUSED_WITHIN: Duration = Duration::from_millis(500);
/// The pause after the operating system has refused a connection for want of descriptors or memory.
const REST: Duration = Duration::from_millis(20);
/// The time that connections may take to end by themselves at shutdown …
const DRAIN_WITHIN: Duration = Duration::from_secs(3);
/// … and after they were broken off.
const BREAK_WITHIN: Duration = Duration::from_secs(1);

/// All connections of a server.
pub(super) struct Connections {
    limits: Limits,
    most: usize,
    /// A permit for each connection, also while it ends, and for each WebSocket.
    permits: Arc<Semaphore>,
    open: Mutex<Vec<Arc<Connection>>>,
    /// Cancels all of them.
    broken: CancellationToken,
    /// The answer where all are busy …
    busy: Bytes,
    /// … and a permit for each newcomer that is being sent it.
    refusals: Arc<Semaphore>,
    metrics: Arc<Metrics>,
    /// The log of those that could not be taken.
    rarely: Rarely,
}

/// The phase of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Between two requests, since that time.
    Idle(Instant),
    /// The head of a request is coming, since that time; from the beginning, as a connection is opened to ask for
    /// something.
    Asking(Instant),
    /// A request is served, or a WebSocket is open.
    Busy,
}

/// A connection, as the others know it.
struct Connection {
    phase: watch::Sender<Phase>,
    /// Cancelled when it has to make room.
    evicted: CancellationToken,
    /// Whether the last request was refused, perhaps before all of it had come.
    unread: AtomicBool,
}

impl Connection {
    /// Notes that bytes have come.
    fn heard(&self) {
        self.phase.send_if_modified(|phase| {
            let is_idle = matches!(phase, Phase::Idle(_));
            if is_idle {
                *phase = Phase::Asking(Instant::now());
            }
            is_idle
        });
    }

    /// Whether part of a request may be left that nobody will read.
    fn has_unread(&self) -> bool {
        self.unread.load(Ordering::Relaxed)
    }

    /// The time since which it has waited for the head of a request; `None` while it serves one.
    fn waiting_since(&self) -> Option<Instant> {
        match *self.phase.borrow() {
            Phase::Idle(since) | Phase::Asking(since) => Some(since),
            Phase::Busy => None,
        }
    }
}

impl Connections {
    pub(super) fn new(limits: Limits, metrics: Arc<Metrics>) -> Arc<Self> {
        let most = limits.possible_connections();
        let detail = format!("the server has {most} connections, and all are busy; try again later");
        Arc::new(Self {
            limits,
            most,
            permits: Arc::new(Semaphore::new(most)),
            open: Mutex::default(),
            broken: CancellationToken::new(),
            busy: refusal(&Problem::new(Kind::ServerFull, detail)),
            refusals: Arc::new(Semaphore::new(MOST_REFUSALS)),
            metrics,
            rarely: Rarely::default(),
        })
    }

    /// The number of open connections.
    pub(super) fn count(&self) -> usize {
        self.lock().len()
    }

    /// Serves connections until the server shuts down.
    pub(super) async fn serve(self: &Arc<Self>, listener: TcpListener, router: Router, shutdown: &CancellationToken) {
        let service = TowerToHyperService::new(router);
        loop {
            let accepted = tokio::select! {
                biased;
                () = shutdown.cancelled() => return,
                accepted = listener.accept() => accepted,
            };
            match accepted {
                Ok((stream, _)) => self.take(stream, &service, shutdown).await,
                // It went away before it was met.
                Err(error) if is_of_connection(&error) => {}
                // No descriptor is left, or no memory.
                Err(error) => {
                    self.rarely.tell(|times| tracing::warn!(times, %error, "no connection could be taken"));
                    self.make_room();
                    sleep(REST).await;
                }
            }
        }
    }

    async fn take(
        self: &Arc<Self>,
        stream: TcpStream,
        service: &TowerToHyperService<Router>,
        shutdown: &CancellationToken,
    ) {
        let Some(permit) = self.permit().await else {
            self.metrics.refused_connections.inc();
            let most = self.most;
            self.rarely.tell(|times| tracing::warn!(times, most, "all connections are busy"));
            return self.refuse(stream);
        };
        let reached = stream.local_addr().ok();
        let connection = Arc::new(Connection {
            phase: watch::Sender::new(Phase::Asking(Instant::now())),
            evicted: CancellationToken::new(),
            unread: AtomicBool::new(false),
        });
        self.lock().push(connection.clone());
        let place = Admitted { connection, all: self.clone(), _permit: permit };
        tokio::spawn(self.clone().attend(stream, place, reached, service.clone(), shutdown.clone()));
    }

    /// Sends a newcomer the answer that all are busy, unless many are being sent it.
    fn refuse(&self, mut stream: TcpStream) {
        let (busy, Ok(place)) = (self.busy.clone(), self.refusals.clone().try_acquire_owned()) else { return };
        tokio::spawn(async move {
            let told = async {
                stream.write_all(&busy).await?;
                stream.shutdown().await?;
                // Were it closed with a request unread, the answer would be taken back.
                while stream.read(&mut [0; 1 << 10]).await? > 0 {}
                Ok::<_, io::Error>(())
            };
            drop(timeout(REFUSED_WITHIN, told).await);
            drop(place);
        });
    }

    async fn permit(&self) -> Option<OwnedSemaphorePermit> {
        if let Ok(permit) = self.permits.clone().try_acquire_owned() {
            return Some(permit);
        }
        if !self.make_room() {
            return None;
        }
        timeout(ROOM_WITHIN, self.permits.clone().acquire_owned()).await.ok()?.ok()
    }

    /// Ends the connection that has waited longest for a request; false if there is none.
    fn make_room(&self) -> bool {
        let open = self.lock();
        let waiting = open.iter().filter(|connection| !connection.evicted.is_cancelled());
        let waiting = waiting.filter_map(|connection| Some((connection.waiting_since()?, connection)));
        let longest = waiting.min_by_key(|(since, _)| *since);
        let Some((_, connection)) = longest else { return false };
        connection.evicted.cancel();
        self.metrics.evicted_connections.inc();
        true
    }

    /// Serves one connection to its end.
    async fn attend(
        self: Arc<Self>,
        stream: TcpStream,
        place: Admitted,
        reached: Option<SocketAddr>,
        service: TowerToHyperService<Router>,
        shutdown: CancellationToken,
    ) {
        let connection = place.connection.clone();
        let stream = Stream::new(stream, self.limits.write_timeout, self.broken.clone(), place);
        let asked = connection.clone();
        let service = service_fn(move |mut request: Request<Incoming>| {
            let served = Served(asked.clone());
            asked.phase.send_replace(Phase::Busy);
            request.extensions_mut().insert(ConnectInfo(Reached::at(reached)));
            let has_body = !request.body().is_end_stream();
            let (answering, connection) = (service.call(request), asked.clone());
            async move {
                let response = answering.await?;
                let is_refused = response.status().is_client_error() || response.status().is_server_error();
                connection.unread.store(has_body && is_refused, Ordering::Relaxed);
                Ok::<_, Infallible>(response.map(|body| Holding::new(body, served)))
            }
        });
        let serving = http1::Builder::new()
            // Phases have their own times.
            .header_read_timeout(None)
            .max_headers(self.limits.most_headers())
            .max_header_size(self.limits.buffer_bytes())
            .max_buf_size(self.limits.buffer_bytes())
            .serve_connection(TokioIo::new(stream), service);
        let mut serving = pin!(serving.with_upgrades());
        let mut phase = connection.phase.subscribe();
        let mut is_ending = false;
        loop {
            let deadline = self.deadline(*phase.borrow_and_update());
            tokio::select! {
                // Whether it broke off or came to an end is all the same here.
                served = serving.as_mut() => {
                    if served.is_err_and(|error| error.is_parse_too_large()) {
                        self.metrics.refused_heads.inc();
                        self.rarely.tell(|times| tracing::warn!(times, "a head was too large to be read"));
                    }
                    break;
                }
                () = shutdown.cancelled(), if !is_ending => {
                    is_ending = true;
                    serving.as_mut().graceful_shutdown();
                }
                () = self.broken.cancelled() => break,
                () = connection.evicted.cancelled() => break,
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => break,
                // The sender is here too, so that this is a change.
                _ = phase.changed() => {}
            }
        }
        // A WebSocket may go on from here: it waits for no request.
        connection.phase.send_replace(Phase::Busy);
    }

    fn deadline(&self, phase: Phase) -> Option<Instant> {
        match phase {
            Phase::Idle(since) => Some(since + self.limits.idle_timeout),
            Phase::Asking(since) => Some(since + self.limits.header_timeout),
            Phase::Busy => None,
        }
    }

    /// Waits for all of them to end after the shutdown has begun, and cancels those that do not.
    pub(super) async fn end(&self) {
        let all = u32::try_from(self.most).unwrap_or(u32::MAX);
        if timeout(DRAIN_WITHIN, self.permits.acquire_many(all)).await.is_err() {
            self.broken.cancel();
            drop(timeout(BREAK_WITHIN, self.permits.acquire_many(all)).await);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Connection>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The place of a connection among all, freed when its stream is closed.
struct Admitted {
    connection: Arc<Connection>,
    all: Arc<Connections>,
    _permit: OwnedSemaphorePermit,
}

impl Drop for Admitted {
    fn drop(&mut self) {
        self.all.lock().retain(|other| !Arc::ptr_eq(other, &self.connection));
    }
}

/// The marker of a request being served, until its answer is sent. After it the connection waits for the next request.
struct Served(Arc<Connection>);

impl Drop for Served {
    fn drop(&mut self) {
        self.0.phase.send_replace(Phase::Idle(Instant::now()));
    }
}

/// A problem as a complete answer, after which the connection is closed.
fn refusal(problem: &Problem) -> Bytes {
    let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::SERVICE_UNAVAILABLE);
    let body = serde_json::to_string(problem).unwrap_or_default();
    format!(
        "HTTP/1.1 {status}\r\ncontent-type: {PROBLEM_JSON}\r\ncontent-length: {}\r\nretry-after: {}\r\n\
         connection: close\r\n\r\n{body}",
        body.len(),
        super::problem::RETRY_AFTER_S,
    )
    .into()
}

/// Whether accepting failed because of the connection alone.
fn is_of_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}
