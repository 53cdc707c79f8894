//! The page and Rerun's viewer, out of the program itself.

use std::{
    borrow::Cow,
    hash::{DefaultHasher, Hasher},
    io::{Read, Write},
    path::Path,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header},
    response::{IntoResponse, Response},
    routing::get,
};
use flate2::{Compression, read::GzDecoder, write::GzEncoder};
use re_web_viewer_server::WebViewerData;

use super::{
    App, ServerError,
    problem::{Kind, Problem},
};

/// Files larger than this are compressed in the background while they are first sent as they are.
const COMPRESS_AT_ONCE_BYTES: usize = 1 << 20;

const PANEL_SCRIPT: &str = "/panel/panel.js";
const PANEL_WASM: &str = "/panel/panel_bg.wasm";

/// The page itself, whose addresses of the other files are still without versions.
pub(crate) const INDEX: &str = include_str!("../../web/page/index.html");

/// A file of the page.
macro_rules! embedded {
    ($name:literal) => {
        Bytes::from_static(include_bytes!(concat!("../../web/page/", $name)))
    };
}

/// All files, by their paths.
pub(super) struct Assets(Vec<Asset>);

struct Asset {
    path: &'static str,
    content_type: &'static str,
    bytes: Bytes,
    /// Changes with the content: the entity tag, and `?v=` in the addresses under which it may be kept for ever.
    version: String,
    compressed: Arc<OnceLock<Option<Bytes>>>,
    compressing: AtomicBool,
}

/// The routes of all files.
pub(super) fn routes() -> Router<Arc<App>> {
    let page = ["/", "/page.css", "/page.js", "/session.js", "/files.js", "/seeds.js", "/viewer.js", "/icon.svg"];
    let panel = [PANEL_SCRIPT, PANEL_WASM];
    let viewer = ["/viewer/re_viewer.js", "/viewer/re_viewer_bg.wasm"];
    let paths = page.into_iter().chain(panel).chain(viewer);
    paths.fold(Router::new(), |router, path| router.route(path, get(file)))
}

async fn file(State(app): State<Arc<App>>, uri: Uri, headers: HeaderMap) -> Response {
    match app.assets.0.iter().find(|asset| asset.path == uri.path()) {
        Some(asset) => asset.response(&headers, uri.query()),
        None => Problem::new(Kind::UnknownRoute, format!("there is no file `{}`", uri.path())).into_response(),
    }
}

impl Assets {
    /// All files; the page's addresses of the others carry their versions. The panel is that of a folder, if one is
    /// named.
    pub(super) fn load(panel: Option<&Path>) -> Result<Self, ServerError> {
        const JAVASCRIPT: &str = "text/javascript; charset=utf-8";
        let viewer = WebViewerData::load(None)?;
        let (panel_script, panel_wasm) = match panel {
            Some(folder) => {
                let read = |name: &str| {
                    let file = folder.join(name);
                    std::fs::read(&file).map(Bytes::from).map_err(|source| ServerError::Panel { file, source })
                };
                (read("panel.js")?, read("panel_bg.wasm.gz")?)
            }
            None => (
                Bytes::from_static(include_bytes!("../../web/dist/panel.js")),
                Bytes::from_static(include_bytes!("../../web/dist/panel_bg.wasm.gz")),
            ),
        };
        let mut assets = vec![
            Asset::new("/page.css", "text/css; charset=utf-8", embedded!("page.css")),
            Asset::new("/page.js", JAVASCRIPT, embedded!("page.js")),
            Asset::new("/session.js", JAVASCRIPT, embedded!("session.js")),
            Asset::new("/files.js", JAVASCRIPT, embedded!("files.js")),
            Asset::new("/seeds.js", JAVASCRIPT, embedded!("seeds.js")),
            Asset::new("/viewer.js", JAVASCRIPT, embedded!("viewer.js")),
            Asset::new("/icon.svg", "image/svg+xml", embedded!("icon.svg")),
            Asset::new(PANEL_SCRIPT, JAVASCRIPT, panel_script),
            Asset::compressed_already(PANEL_WASM, "application/wasm", panel_wasm),
            Asset::new("/viewer/re_viewer.js", JAVASCRIPT, Bytes::copy_from_slice(viewer.viewer_js())),
            Asset::new("/viewer/re_viewer_bg.wasm", "application/wasm", viewer_wasm(viewer)),
        ];
        let mut page = INDEX.to_owned();
        for asset in &assets {
            let Asset { path, version, .. } = asset;
            page = page.replace(&format!("\"{path}\""), &format!("\"{path}?v={version}\""));
        }
        assets.push(Asset::new("/", "text/html; charset=utf-8", page.into()));
        Ok(Self(assets))
    }
}

/// The wasm without a copy of its 42 MB, where it is part of the program.
fn viewer_wasm(viewer: WebViewerData) -> Bytes {
    struct Wasm(WebViewerData);
    impl AsRef<[u8]> for Wasm {
        fn as_ref(&self) -> &[u8] {
            self.0.viewer_wasm()
        }
    }
    Bytes::from_owner(Wasm(viewer))
}

/// A file of the page, for those who put it elsewhere.
pub(crate) struct PageFile {
    /// Its address on this server.
    pub(crate) path: &'static str,
    pub(crate) bytes: Bytes,
    /// The same, compressed.
    pub(crate) packed: Bytes,
    /// Changes with the content.
    pub(crate) version: String,
}

/// All files but the page itself, which is [`INDEX`].
pub(crate) fn page_files(panel: Option<&Path>) -> Result<Vec<PageFile>, ServerError> {
    let Assets(assets) = Assets::load(panel)?;
    let files = assets.into_iter().filter(|asset| asset.path != "/").map(|asset| PageFile {
        path: asset.path,
        packed: asset.compressed.get_or_init(|| gzip(&asset.bytes)).clone().unwrap_or_default(),
        bytes: asset.bytes,
        version: asset.version,
    });
    Ok(files.collect())
}

impl Asset {
    fn new(path: &'static str, content_type: &'static str, bytes: Bytes) -> Self {
        let mut hasher = DefaultHasher::new();
        hasher.write(&bytes);
        let version = format!("{:016x}", hasher.finish());
        Self { path, content_type, bytes, version, compressed: Arc::default(), compressing: false.into() }
    }

    /// A file that was compressed when it was built; who does not take it so gets it unpacked.
    fn compressed_already(path: &'static str, content_type: &'static str, compressed: Bytes) -> Self {
        let mut plain = Vec::new();
        // What does not unpack stays empty, and the browser says so.
        drop(GzDecoder::new(compressed.as_ref()).read_to_end(&mut plain));
        let asset = Self::new(path, content_type, plain.into());
        drop(asset.compressed.set(Some(compressed)));
        asset
    }

    fn response(&self, headers: &HeaderMap, query: Option<&str>) -> Response {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let compressed = accepts_gzip(text(header::ACCEPT_ENCODING)).then(|| self.compressed()).flatten();
        let tag = match &compressed {
            Some(_) => Cow::from(format!("\"{}-gzip\"", self.version)),
            None => Cow::from(format!("\"{}\"", self.version)),
        };
        let is_versioned = query.is_some_and(|query| query.strip_prefix("v=") == Some(&self.version));
        let caching = if is_versioned { "public, max-age=31536000, immutable" } else { "no-cache" };
        let unchanged = text(header::IF_NONE_MATCH).split(',').any(|known| {
            let known = known.trim().trim_start_matches("W/");
            known == "*" || known.trim_matches('"').trim_end_matches("-gzip") == self.version
        });
        let mut response = match (unchanged, &compressed) {
            (true, _) => StatusCode::NOT_MODIFIED.into_response(),
            (false, Some(bytes)) => ([(header::CONTENT_ENCODING, "gzip")], bytes.clone()).into_response(),
            (false, None) => Body::from(self.bytes.clone()).into_response(),
        };
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.content_type));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
        headers.insert(header::VARY, HeaderValue::from_static("Accept-Encoding"));
        headers.extend(HeaderValue::from_str(&tag).map(|tag| (header::ETAG, tag)));
        // The length of what comes out of the decompression, for the page's progress.
        headers.insert("uncompressed-length", HeaderValue::from(self.bytes.len()));
        response
    }

    /// The compressed content, if it is ready. A large file begins to be compressed when it is first asked for.
    fn compressed(&self) -> Option<Bytes> {
        if let Some(done) = self.compressed.get() {
            return done.clone();
        }
        if self.bytes.len() <= COMPRESS_AT_ONCE_BYTES {
            return self.compressed.get_or_init(|| gzip(&self.bytes)).clone();
        }
        // In a debug build it would take minutes.
        if !cfg!(debug_assertions) && !self.compressing.swap(true, Ordering::Relaxed) {
            let (bytes, compressed) = (self.bytes.clone(), self.compressed.clone());
            let work = move || drop(compressed.set(gzip(&bytes)));
            // Without a thread it stays as it is.
            drop(std::thread::Builder::new().name("gzip".to_owned()).spawn(work));
        }
        None
    }
}

fn gzip(bytes: &[u8]) -> Option<Bytes> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(bytes).ok()?;
    encoder.finish().ok().map(Bytes::from)
}

/// Whether `Accept-Encoding` names gzip and does not refuse it.
fn accepts_gzip(accepted: &str) -> bool {
    accepted.split(',').any(|coding| {
        let mut parts = coding.split(';').map(str::trim);
        let is_gzip = parts.next().is_some_and(|name| name.eq_ignore_ascii_case("gzip"));
        is_gzip && !parts.any(|weight| matches!(weight, "q=0" | "q=0.0" | "q=0.00" | "q=0.000"))
    })
}

#[cfg(test)]
mod tests {
    use super::accepts_gzip;

    #[test]
    fn gzip_is_sent_to_those_who_ask_for_it() {
        assert!(accepts_gzip("gzip, deflate, br") && accepts_gzip("br;q=1, GZIP;q=0.5"));
        assert!(!accepts_gzip("") && !accepts_gzip("br") && !accepts_gzip("gzip;q=0, br"));
    }
}
