//! The HTTP server: sessions to step and watch, and the page that does so.
//!
//! ```text
//! api/      the routes: scenarios, sessions, steps, streams, downloads; their OpenAPI description
//! session/  experiments on threads of their own, and what they leave to read
//! extract   requests, read        problem  errors, as RFC 9457 problem details
//! guard     foreign pages, headers, stray errors        assets   the page and Rerun's viewer
//! frame     who may embed the page
//! ```
//!
//! Every session's engine computes on its own thread; the runtime's workers only carry messages and bytes. Memory is
//! bounded: [`MAX_SESSIONS`] sessions of [`MAX_STEPS_PER_SESSION`] steps, and [`MAX_MEMORY_BYTES`] for the reports and
//! recordings of them all.

mod api;
mod assets;
mod extract;
mod frame;
mod guard;
mod gzip;
mod problem;
mod session;

use std::{future::IntoFuture, io, path::PathBuf, sync::Arc, time::Duration};

use axum::Router;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

pub use api::{Health, Liveness, MadeSteps, ScenarioList, ScenarioResource, SessionList, StepRequest};
pub(crate) use assets::{INDEX, PageFile, page_files};
pub use frame::{FrameAncestor, NoOrigin};
pub(crate) use guard::CONTENT_SECURITY_POLICY;
pub use problem::{PROBLEM_JSON, Problem};
use session::{Budget, Sessions};
pub use session::{NewSession, SessionResource};

/// How many sessions there are at most. When one more is asked for, one that was idle for [`IDLE_AFTER`] makes room.
pub const MAX_SESSIONS: usize = 32;
/// How many steps a session makes at most.
pub const MAX_STEPS_PER_SESSION: u64 = 100_000;
/// How many steps one request makes at most.
pub const MAX_STEPS_PER_REQUEST: u64 = 1000;
/// What reports and recordings of all sessions may take together; beyond it no session makes steps.
pub const MAX_MEMORY_BYTES: usize = 2 << 30;
/// How large a request's body may be.
pub const MAX_BODY_BYTES: usize = 64 << 10;
/// After this time without a request and without anyone watching, a session may have to make room for another.
pub const IDLE_AFTER: Duration = Duration::from_secs(15 * 60);

/// How long open connections may take to end at shutdown.
const DRAIN_WITHIN: Duration = Duration::from_secs(15);

/// How a server is set up.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Where recordings are kept as files, `{scenario}-seed{seed}-{session}.rrd`; made if it does not exist.
    pub data_dir: Option<PathBuf>,
    /// A folder with another build of the page's panel than the one that is part of this program, for those who work
    /// on it.
    pub panel_dir: Option<PathBuf>,
    /// Who may show the page in a frame; nobody if empty.
    pub frame_ancestors: Vec<FrameAncestor>,
}

/// Why a server could not run.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The data directory cannot be made.
    #[error("the data directory {} cannot be used: {source}", directory.display())]
    DataDir {
        /// The directory.
        directory: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Rerun's viewer is not part of this program.
    #[error("the viewer cannot be loaded: {0}")]
    Viewer(#[from] re_web_viewer_server::WebViewerDataError),
    /// Another build of the panel was asked for and is not there.
    #[error("the panel's file {} cannot be read: {source}", file.display())]
    Panel {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The socket failed.
    #[error("the socket failed: {0}")]
    Socket(#[from] io::Error),
}

/// What all requests share.
struct App {
    sessions: Sessions,
    assets: assets::Assets,
    /// The OpenAPI document, as it is sent.
    openapi: bytes::Bytes,
    /// The server can be reached from this machine only, so no other host name can be meant.
    loopback: bool,
}

/// Serves on `listener` until `shutdown` is cancelled; then ends sessions, so that their recordings are complete, and
/// open streams with them, and returns within half a minute at most.
pub async fn serve(listener: TcpListener, options: Options, shutdown: CancellationToken) -> Result<(), ServerError> {
    if let Some(directory) = &options.data_dir {
        std::fs::create_dir_all(directory)
            .map_err(|source| ServerError::DataDir { directory: directory.clone(), source })?;
    }
    let loopback = listener.local_addr()?.ip().is_loopback();
    let (routes, document) = api::routes();
    let app = Arc::new(App {
        sessions: Sessions::new(Budget::new(MAX_MEMORY_BYTES), options.data_dir, shutdown.clone()),
        assets: assets::Assets::load(options.panel_dir.as_deref())?,
        openapi: document,
        loopback,
    });
    let router = Router::new().merge(routes).merge(assets::routes(&app.assets));
    let router = guard::layered(router, &app, guard::Headers::new(&options.frame_ancestors));
    let serving = axum::serve(listener, router).with_graceful_shutdown(shutdown.clone().cancelled_owned());
    let ending = async {
        shutdown.cancelled().await;
        app.sessions.close_all().await;
        tokio::time::sleep(DRAIN_WITHIN).await;
    };
    // Serving ends by itself once all connections have; a connection that does not end is given up.
    let ended = tokio::select! {
        ended = serving.into_future() => Some(ended),
        () = ending => None,
    };
    // Without any connection serving may end before the recordings are complete.
    app.sessions.close_all().await;
    Ok(ended.unwrap_or(Ok(()))?)
}
