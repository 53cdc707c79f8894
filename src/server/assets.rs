//! The page and Rerun's viewer, out of the program itself.

use std::{
    borrow::Cow,
    hash::{DefaultHasher, Hasher},
    path::Path,
    sync::{Arc, LazyLock},
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header},
    response::{IntoResponse, Response},
    routing::get,
};
use re_web_viewer_server::WebViewerData;

use super::{
    App, ServerError,
    gzip::{self, Compressed},
    problem::{Kind, Problem},
};

/// The viewer's WebAssembly is the same for all servers of a program.
static VIEWER_WASM: LazyLock<Compressed> = LazyLock::new(Compressed::default);

/// What the page says of its picture, which previews take from a whole address only.
const PREVIEW: &str = "\"og:image\" content=\"";

const PANEL_SCRIPT: &str = "/panel/panel.js";
const PANEL_WASM: &str = "/panel/panel_bg.wasm";

/// The page itself, whose addresses of the other files are still without versions.
pub(crate) const INDEX: &str = include_str!("../../assets/page/index.html");

/// A file of the page: its path and its content.
macro_rules! embedded {
    ($name:literal) => {
        (concat!("/", $name), include_bytes!(concat!("../../assets/page/", $name)) as &[u8])
    };
}

/// The page's own files, all but [`INDEX`].
const PAGE: [(&str, &[u8]); 15] = [
    embedded!("controls.js"),
    embedded!("files.js"),
    embedded!("icon.svg"),
    embedded!("legend.js"),
    embedded!("links.js"),
    embedded!("page.css"),
    embedded!("page.js"),
    embedded!("picture.js"),
    embedded!("preview.png"),
    embedded!("quiet.js"),
    embedded!("save.js"),
    embedded!("scene.js"),
    embedded!("seeds.js"),
    embedded!("session.js"),
    embedded!("viewer.js"),
];

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// The media type of one of them, by how its name ends.
fn media_type(path: &str) -> &'static str {
    match path.rsplit('.').next() {
        Some("css") => "text/css; charset=utf-8",
        Some("png") => "image/png",
        Some("svg") => "image/svg+xml",
        _ => JAVASCRIPT,
    }
}

/// All files, by their paths.
pub(super) struct Assets(Vec<Asset>);

struct Asset {
    path: &'static str,
    content_type: &'static str,
    bytes: Bytes,
    /// Changes with the content: the entity tag, and `?v=` in the addresses under which it may be kept for ever.
    version: String,
    compressed: Compressed,
}

/// The routes of all files.
pub(super) fn routes(Assets(assets): &Assets) -> Router<Arc<App>> {
    assets.iter().fold(Router::new(), |router, asset| router.route(asset.path, get(file)))
}

async fn file(State(app): State<Arc<App>>, uri: Uri, headers: HeaderMap) -> Response {
    match app.assets.0.iter().find(|asset| asset.path == uri.path()) {
        Some(asset) if asset.path == "/" => asset.at(&headers).response(&headers, uri.query()).await,
        Some(asset) => asset.response(&headers, uri.query()).await,
        None => Problem::new(Kind::UnknownRoute, format!("there is no file `{}`", uri.path())).into_response(),
    }
}

impl Assets {
    /// All files; the page's addresses of the others carry their versions. The panel is that of a folder, if one is
    /// named.
    pub(super) fn load(panel: Option<&Path>) -> Result<Self, ServerError> {
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
                Bytes::from_static(include_bytes!("../../assets/panel/panel.js")),
                Bytes::from_static(include_bytes!("../../assets/panel/panel_bg.wasm.gz")),
            ),
        };
        let page = PAGE.map(|(path, bytes)| Asset::new(path, media_type(path), Bytes::from_static(bytes)));
        let mut assets = Vec::from(page);
        assets.extend([
            Asset::new(PANEL_SCRIPT, JAVASCRIPT, panel_script),
            Asset::compressed_already(PANEL_WASM, "application/wasm", panel_wasm),
            Asset::new("/viewer/re_viewer.js", JAVASCRIPT, Bytes::copy_from_slice(viewer.viewer_js())),
            Asset::viewer("/viewer/re_viewer_bg.wasm", viewer_wasm(viewer)),
        ]);
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
        packed: asset.compressed.of(&asset.bytes).unwrap_or_default(),
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
        Self { path, content_type, bytes, version, compressed: Compressed::default() }
    }

    /// The viewer's 42 MB: compressed from the start of the program on, so that the first visitor too gets 14 MB.
    fn viewer(path: &'static str, bytes: Bytes) -> Self {
        VIEWER_WASM.begin(bytes.clone());
        Self { compressed: VIEWER_WASM.clone(), ..Self::new(path, "application/wasm", bytes) }
    }

    /// A file that was compressed when it was built; who does not take it so gets it unpacked.
    fn compressed_already(path: &'static str, content_type: &'static str, compressed: Bytes) -> Self {
        let asset = Self::new(path, content_type, gzip::unpack(&compressed));
        Self { compressed: Compressed::ready(compressed), ..asset }
    }

    /// The page as it is under the address by which it was asked for.
    fn at(&self, headers: &HeaderMap) -> Self {
        let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let host = text("host");
        // A host is written into the page only if it can be nothing else.
        let is_plain =
            !host.is_empty() && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".:-[]".contains(&byte));
        let page = String::from_utf8_lossy(&self.bytes);
        let page = if is_plain {
            let scheme = if text("x-forwarded-proto") == "https" { "https" } else { "http" };
            page.replace(PREVIEW, &format!("{PREVIEW}{scheme}://{host}"))
        } else {
            page.into_owned()
        };
        Self::new(self.path, self.content_type, page.into())
    }

    async fn response(&self, headers: &HeaderMap, query: Option<&str>) -> Response {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let compressed = match gzip::is_accepted(text(header::ACCEPT_ENCODING)) {
            true => self.compressed.of_large(self.bytes.clone()).await,
            false => None,
        };
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
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, fs, path::Path};

    use super::PAGE;

    #[test]
    fn every_file_of_the_page_is_embedded() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/page");
        let files = fs::read_dir(folder).expect("the page's folder");
        let names = files.map(|file| file.expect("a file").file_name().into_string().expect("a name"));
        let there: BTreeSet<String> =
            names.filter(|name| name != "index.html").map(|name| format!("/{name}")).collect();
        assert_eq!(there, PAGE.map(|(path, _)| path.to_owned()).into());
    }
}
