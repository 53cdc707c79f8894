//! A host that sends files and knows nothing of them.

use std::{
    net::{SocketAddr, TcpListener},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use axum::{
    Router,
    extract::State,
    http::{HeaderValue, StatusCode, Uri, header},
    response::{IntoResponse, Response},
};
use tokio::{
    runtime::{Builder, Runtime},
    sync::watch,
};

/// A host, as long as it is needed.
pub struct Host {
    pub address: SocketAddr,
    site: Arc<Site>,
    /// With all connections, which end with it.
    serving: Mutex<Option<Runtime>>,
}

struct Site {
    folder: PathBuf,
    /// The address of the folder, with a slash at both ends.
    below: &'static str,
    missed: Mutex<Vec<String>>,
    /// The files that were sent, and their bytes in all.
    sent: Mutex<Vec<String>>,
    bytes: AtomicU64,
    /// The files that are held back.
    held: watch::Sender<&'static [&'static str]>,
}

impl Host {
    /// Serves a folder below an address.
    pub fn start(folder: &Path, below: &'static str) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        listener.set_nonblocking(true).expect("a listener");
        let address = listener.local_addr().expect("an address");
        let site = Arc::new(Site {
            folder: folder.to_owned(),
            below,
            missed: Mutex::default(),
            sent: Mutex::default(),
            bytes: AtomicU64::new(0),
            held: watch::channel(&[][..]).0,
        });
        let router = Router::new().fallback(file).with_state(site.clone());
        let serving = Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("threads");
        serving.spawn(async {
            let listener = tokio::net::TcpListener::from_std(listener).expect("a listener");
            axum::serve(listener, router).await.expect("no error");
        });
        Self { address, site, serving: Mutex::new(Some(serving)) }
    }

    /// The address of the page with this query, or of another file.
    pub fn at(&self, query: &str) -> String {
        format!("http://{}{}{query}", self.address, self.site.below)
    }

    /// Goes away: nothing is answered any more.
    pub fn stop(&self) {
        if let Some(serving) = self.serving.lock().expect("no panic").take() {
            // In a thread that may wait, until the port is free.
            let ended = std::thread::spawn(|| serving.shutdown_timeout(Duration::from_secs(5)));
            ended.join().expect("no panic");
        }
    }

    /// Holds these files back and no others, as a slow line does: who asks for one is answered once it is held back no more.
    pub fn hold(&self, files: &'static [&'static str]) {
        self.site.held.send_replace(files);
    }

    /// The files that were sent, as often as they were.
    pub fn sent(&self) -> Vec<String> {
        self.site.sent.lock().expect("no panic").clone()
    }

    /// The bytes of all of them.
    pub fn bytes(&self) -> u64 {
        self.site.bytes.load(Ordering::Relaxed)
    }

    /// What was asked for in vain.
    pub fn missed(&self) -> Vec<String> {
        self.site.missed.lock().expect("no panic").clone()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Sends a file as it is: never compressed, nothing said of keeping it, and only what no browser does without is known of
/// its type.
async fn file(State(site): State<Arc<Site>>, uri: Uri) -> Response {
    let path = uri.path().strip_prefix(site.below).filter(|path| !path.contains(".."));
    let path = path.map(|path| if path.is_empty() { "index.html" } else { path });
    let mut held = site.held.subscribe();
    let is_free = held.wait_for(|files| path.is_none_or(|path| !files.contains(&path))).await.is_ok();
    let bytes = path.filter(|_| is_free).and_then(|path| std::fs::read(site.folder.join(path)).ok());
    let Some((path, bytes)) = path.zip(bytes) else {
        site.missed.lock().expect("no panic").push(uri.to_string());
        return StatusCode::NOT_FOUND.into_response();
    };
    site.sent.lock().expect("no panic").push(path.to_owned());
    site.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
    let kind = match path.rsplit('.').next() {
        Some("html") => "text/html",
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        _ => "text/plain",
    };
    ([(header::CONTENT_TYPE, HeaderValue::from_static(kind))], bytes).into_response()
}
