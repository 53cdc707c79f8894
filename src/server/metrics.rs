//! The server's figures, in the text form of OpenMetrics, which Prometheus reads.

use std::{sync::atomic::AtomicU64, time::Duration};

use axum::http::StatusCode;
use prometheus_client::{
    encoding::{EncodeLabelSet, text::encode},
    metrics::{counter::Counter, family::Family, gauge::Gauge, histogram::Histogram},
    registry::{Registry, Unit},
};

use super::clock::now_s;
use body_schema_recording::rerun_version;
use body_schema_scenario::WorldKind;

/// The media type of the figures.
pub(super) const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Upper bounds of the durations that are distinguished, seconds: a file of the page takes well below a millisecond, many steps
/// take minutes.
const DURATIONS_S: [f64; 10] = [0.001, 0.005, 0.025, 0.1, 0.5, 1.0, 5.0, 15.0, 60.0, 300.0];
/// The route of a request for a missing page, or without authorisation.
const NO_ROUTE: &str = "none";

/// All figures of a server. Copies of counters share their count.
pub(super) struct Metrics {
    registry: Registry,
    requests: Family<Request, Counter>,
    durations: Family<Route, Histogram, fn() -> Histogram>,
    problems: Family<Problem, Counter>,
    /// Steps that sessions made.
    pub(super) steps: Counter,
    /// Observations received from robots elsewhere.
    pub(super) observations: Counter,
    /// Observations of robots elsewhere that were learned from again: after a while out of memory, or after a change of what
    /// is excluded.
    pub(super) replayed: Counter,
    /// Sessions whose engine failed.
    pub(super) failed_sessions: Counter,
    /// Connections that were refused for want of room …
    pub(super) refused_connections: Counter,
    /// … and those that made room for another.
    pub(super) evicted_connections: Counter,
    /// Heads that were too large to be read.
    pub(super) refused_heads: Counter,
    sessions: Family<InWorld, Gauge>,
    stored_sessions: Gauge,
    streams: Gauge,
    connections: Gauge,
    memory: Gauge,
}

/// The server's state at the moment.
pub(super) struct Present {
    /// Sessions in memory.
    pub(super) sessions: [(WorldKind, usize); 3],
    /// Sessions with robots elsewhere, in memory or not.
    pub(super) stored_sessions: usize,
    /// Followers of sessions by a stream.
    pub(super) streams: usize,
    /// Open connections.
    pub(super) connections: usize,
    /// The memory of reports and recordings, bytes.
    pub(super) memory_bytes: usize,
}

/// The limits that are reported.
pub(super) struct Most {
    pub(super) connections: usize,
    pub(super) memory_bytes: usize,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Build {
    version: &'static str,
    rerun: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Request {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Route {
    method: &'static str,
    route: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Problem {
    kind: &'static str,
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct InWorld {
    world: &'static str,
}

impl Metrics {
    pub(super) fn new(most: &Most) -> Self {
        let mut metrics = Self {
            registry: Registry::default(),
            requests: Family::default(),
            durations: Family::new_with_constructor(|| Histogram::new(DURATIONS_S)),
            problems: Family::default(),
            steps: Counter::default(),
            observations: Counter::default(),
            replayed: Counter::default(),
            failed_sessions: Counter::default(),
            refused_connections: Counter::default(),
            refused_heads: Counter::default(),
            evicted_connections: Counter::default(),
            sessions: Family::default(),
            stored_sessions: Gauge::default(),
            streams: Gauge::default(),
            connections: Gauge::default(),
            memory: Gauge::default(),
        };
        metrics.register(most);
        metrics
    }

    fn register(&mut self, most: &Most) {
        let began = Gauge::<f64, AtomicU64>::default();
        began.set(now_s());
        // Named as it is everywhere.
        self.registry.register_with_unit("process_start_time", "The start, since 1970", Unit::Seconds, began);
        let all = self.registry.sub_registry_with_prefix("body_schema");
        let build = Family::<Build, Gauge>::default();
        build.get_or_create(&Build { version: env!("CARGO_PKG_VERSION"), rerun: rerun_version() }).set(1);
        // A gauge, and no `info`: that is unknown to what reads the older form of the text.
        all.register("build_info", "What is running", build);
        all.register("requests", "Answered requests", self.requests.clone());
        let after = "From a request's head to the head of its answer";
        all.register_with_unit("request_duration", after, Unit::Seconds, self.durations.clone());
        all.register("problems", "Answers that were problem documents, by kind", self.problems.clone());
        all.register("steps", "Steps that sessions made", self.steps.clone());
        all.register("observations", "Observations of robots elsewhere", self.observations.clone());
        let again = "Observations of robots elsewhere that were learned from once more";
        all.register("observations_replayed", again, self.replayed.clone());
        all.register("sessions_failed", "Sessions whose engine failed", self.failed_sessions.clone());
        all.register("sessions", "Sessions in memory", self.sessions.clone());
        all.register("sessions_stored", "Sessions with robots elsewhere", self.stored_sessions.clone());
        all.register("streams", "Events, growing recordings and WebSockets that are followed", self.streams.clone());
        all.register("connections", "Open connections", self.connections.clone());
        all.register("connections_limit", "How many there may be", constant(most.connections));
        let refused = "Connections that were closed because all were busy";
        all.register("connections_refused", refused, self.refused_connections.clone());
        let unread = "Heads that were several times too large, and were not read";
        all.register("heads_refused", unread, self.refused_heads.clone());
        let evicted = "Waiting connections that were closed to make room";
        all.register("connections_evicted", evicted, self.evicted_connections.clone());
        let held = "What reports and recordings of all sessions take";
        all.register_with_unit("memory", held, Unit::Bytes, self.memory.clone());
        let most_held = "What they may take; beyond it no session makes steps";
        all.register_with_unit("memory_limit", most_held, Unit::Bytes, constant(most.memory_bytes));
    }

    /// Counts an answer, and the time until it began.
    pub(super) fn answered(&self, method: &'static str, route: Option<&str>, status: StatusCode, after: Duration) {
        let route = route.unwrap_or(NO_ROUTE);
        let request = Request { method, route: route.to_owned(), status: status.as_u16() };
        self.requests.get_or_create(&request).inc();
        let route = Route { method, route: request.route };
        self.durations.get_or_create(&route).observe(after.as_secs_f64());
    }

    /// Counts a problem that was answered.
    pub(super) fn refused(&self, kind: &'static str, status: StatusCode) {
        self.problems.get_or_create(&Problem { kind, status: status.as_u16() }).inc();
    }

    /// All figures, with the state at the moment.
    pub(super) fn text(&self, present: &Present) -> Result<String, std::fmt::Error> {
        for (world, count) in present.sessions {
            self.sessions.get_or_create(&InWorld { world: name(world) }).set(whole(count));
        }
        self.stored_sessions.set(whole(present.stored_sessions));
        self.streams.set(whole(present.streams));
        self.connections.set(whole(present.connections));
        self.memory.set(whole(present.memory_bytes));
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

fn name(world: WorldKind) -> &'static str {
    match world {
        WorldKind::Simulated => "simulated",
        WorldKind::Measured => "measured",
        WorldKind::External => "outside",
    }
}

fn constant(value: usize) -> Gauge {
    let gauge = Gauge::default();
    gauge.set(whole(value));
    gauge
}

fn whole(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}
