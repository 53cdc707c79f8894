//! The HTTP server: sessions to step and watch, robots elsewhere that ask and tell, and the page that shows them.
//!
//! ```text
//! api/            the routes: scenarios, sessions, steps, suggestions, observations, streams, downloads; their OpenAPI description
//! session/        experiments and robots elsewhere on threads of their own, and the state that they share with readers
//! store/          the sessions of robots elsewhere on the disk
//! extract         reading requests
//! problem         errors, as RFC 9457 problem details
//! middleware      origins, headers, errors that no handler made
//! authentication  tokens, passes, and the names of the server
//! connections     how long each may keep the server waiting
//! limits          the limits of all of this
//! blocking        work that must not hold up other requests
//! requests        ids of requests, and their lines in the log
//! metrics         figures for Prometheus
//! holding         bodies that hold a value until they are sent
//! assets          the page and Rerun's viewer
//! frame           the origins that may embed the page
//! ```
//!
//! Every session's engine computes on its own thread; the runtime's workers only carry messages and bytes. What is taken on,
//! from connections to memory, is bounded by [`Limits`].

mod api;
mod assets;
mod authentication;
mod blocking;
mod clock;
mod connections;
mod extract;
mod frame;
mod holding;
mod limits;
mod metrics;
mod middleware;
mod problem;
mod rarely;
mod requests;
mod session;
mod store;

use std::{io, net::SocketAddr, path::PathBuf, sync::Arc};

use crate::page::PageError;
use axum::{Router, middleware::from_fn_with_state};
use blocking::Jobs;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

pub use api::{Health, Liveness, MadeSteps, ScenarioList, ScenarioResource, SessionList, StepRequest};
use authentication::Authentication;
pub use authentication::{HostName, NoHostName, NoToken, Token};
use body_schema_backend::Scenarios;
use body_schema_scenario::Scenario;
use connections::Connections;
pub use frame::{FrameAncestor, NoOrigin};
pub use limits::{Limits, raise_descriptors};
use metrics::{Metrics, Most};
pub use problem::{Beside, PROBLEM_JSON, Problem};
use session::{Budget, Keeping, Sessions};
pub use session::{DamagedSession, NewOutsideSession, NewSession, SessionResource};
pub use store::{Finding, Held, Shown, State, Store, StoreError, Stored};

/// The options of a server.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The folder in which sessions with robots elsewhere are kept; made if it does not exist. Without it they end with
    /// the server.
    pub data_dir: Option<PathBuf>,
    /// Whether recordings of all other sessions are kept there as files, `{scenario}-seed{seed}-{session}.rrd`.
    pub keep_recordings: bool,
    /// The token that requests must carry. A server that can be reached from other machines needs one.
    pub token: Option<Token>,
    /// The names of this server, beside those of this machine and the address at which it was reached.
    pub allow_hosts: Vec<HostName>,
    /// The limits.
    pub limits: Limits,
    /// The commit that the program was built from, if known: certificates of the page name it.
    pub commit: Option<String>,
    /// A folder with another build of the page's panel than this program's, for work on it.
    pub panel_dir: Option<PathBuf>,
    /// The origins that may show the page in a frame; nobody if empty.
    pub frame_ancestors: Vec<FrameAncestor>,
    /// Scenarios beside the built-in ones.
    pub scenarios: Vec<Scenario>,
}

/// Why a server could not run.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Sessions cannot be kept.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Other machines can reach it, and requests would need no token.
    #[error("other machines can reach {0}, and real robots may be connected to this server; give it a token")]
    Unguarded(SocketAddr),
    /// The server has ended, and some files are incomplete.
    #[error("these recordings are incomplete: {}", .0.join("; "))]
    Incomplete(Vec<String>),
    /// A built-in scenario is not valid.
    #[error("a scenario is not valid: {0}")]
    Scenarios(String),
    /// The page is incomplete.
    #[error(transparent)]
    Page(#[from] PageError),
    /// The socket failed.
    #[error("the socket failed: {0}")]
    Socket(#[from] io::Error),
}

/// The state that all requests share.
struct App {
    sessions: Arc<Sessions>,
    assets: assets::Assets,
    /// All scenarios in brief.
    listed: ScenarioList,
    /// The OpenAPI document, as it is sent.
    openapi: bytes::Bytes,
    authentication: Authentication,
    limits: Limits,
    metrics: Arc<Metrics>,
    connections: Arc<Connections>,
    /// The jobs that take a core for a while.
    jobs: Jobs,
    /// The answers on their way to clients.
    answers: Arc<Budget>,
}

/// A server that is ready to serve.
pub struct Server {
    listener: TcpListener,
    app: Arc<App>,
    router: Router,
    shutdown: CancellationToken,
    damage: Vec<String>,
}

impl Server {
    /// A server on `listener`. Whatever can fail at the start fails here.
    ///
    /// # Errors
    ///
    /// [`ServerError::Store`] if sessions cannot be kept, [`ServerError::Page`] if files are missing,
    /// [`ServerError::Unguarded`] if other machines can reach it and no token is set, [`ServerError::Socket`] if the
    /// socket fails.
    pub fn new(listener: TcpListener, options: Options, shutdown: CancellationToken) -> Result<Self, ServerError> {
        let address = listener.local_addr()?;
        if !address.ip().to_canonical().is_loopback() && options.token.is_none() {
            return Err(ServerError::Unguarded(address));
        }
        let store = match &options.data_dir {
            Some(directory) => Store::open(directory)?,
            None => Store::in_memory()?,
        };
        // Sessions that come back ask who can read what they have learned; to find it out takes a moment.
        std::thread::spawn(store::build);
        let limits = options.limits;
        let damage = store.damage().to_vec();
        let mut scenarios = Scenarios::default();
        options.scenarios.into_iter().for_each(|scenario| scenarios.add(scenario));
        let listed =
            scenarios.list().map_err(|problem| ServerError::Scenarios(Problem::from(problem).into_detail()))?;
        let keeping = Keeping {
            store: store.holding(limits.stored_sessions, limits.stored_bytes),
            recordings: options.data_dir.clone().filter(|_| options.keep_recordings),
            scratch: options.data_dir,
            limits: limits.clone(),
            scenarios: Arc::new(scenarios),
        };
        let most = Most { connections: limits.possible_connections(), memory_bytes: limits.memory_bytes };
        let metrics = Arc::new(Metrics::new(&most));
        let (routes, document) = api::routes(&limits);
        let app = Arc::new(App {
            sessions: Sessions::new(Budget::new(limits.memory_bytes), keeping, metrics.clone(), shutdown.clone())?,
            assets: assets::Assets::load(options.panel_dir.as_deref(), options.commit.as_deref())?,
            listed,
            openapi: document,
            authentication: Authentication::new(options.token, options.allow_hosts, address.port()),
            connections: Connections::new(limits.clone(), metrics.clone()),
            answers: Arc::new(Budget::new(limits.answers_bytes())),
            limits,
            metrics,
            jobs: Jobs::default(),
        });
        let routes = routes.layer(from_fn_with_state(app.clone(), middleware::counted));
        let router = Router::new().merge(routes).merge(assets::routes(&app.assets));
        let router = middleware::layered(router, &app, middleware::Headers::new(&options.frame_ancestors));
        Ok(Self { listener, app, router, shutdown, damage })
    }

    /// The damage found in the data directory, in words; everything else is served.
    pub fn damage(&self) -> &[String] {
        &self.damage
    }

    /// Serves until the shutdown; then ends sessions, so that their recordings are complete, and open streams with them. It
    /// returns within five seconds, whatever its clients do.
    ///
    /// # Errors
    ///
    /// [`ServerError::Incomplete`] if recordings could not be completed, [`ServerError::Socket`] if the socket fails.
    pub async fn run(self) -> Result<(), ServerError> {
        let Self { listener, app, router, shutdown, damage: _ } = self;
        tokio::select! {
            () = app.connections.serve(listener, router, &shutdown) => {}
            () = app.sessions.watch_over() => {}
        }
        tracing::info!("ending");
        let (incomplete, ()) = tokio::join!(app.sessions.close_all(), app.connections.end());
        for why in &incomplete {
            tracing::error!(why, "a recording lacks its end");
        }
        tracing::info!("ended");
        if incomplete.is_empty() { Ok(()) } else { Err(ServerError::Incomplete(incomplete)) }
    }
}

/// Serves on `listener` until `shutdown` is cancelled; see [`Server`].
///
/// # Errors
///
/// The errors of [`Server::new`] and of [`Server::run`].
pub async fn serve(listener: TcpListener, options: Options, shutdown: CancellationToken) -> Result<(), ServerError> {
    Server::new(listener, options, shutdown)?.run().await
}
