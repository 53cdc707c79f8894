//! The files of the page and of Rerun's viewer, which are part of the program: the server sends them and an export writes
//! them.

pub(crate) mod gzip;

use std::{
    fs,
    hash::{DefaultHasher, Hasher},
    io,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use bytes::Bytes;
use re_web_viewer_server::WebViewerData;

use gzip::Compressed;

/// The policy of the page: scripts, styles, images and connections come from this server alone; the viewer is
/// WebAssembly. It also keeps the viewer from calling its makers' telemetry and from loading fonts.
pub(crate) const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; \
     style-src 'self'; img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'";

/// The page itself, whose addresses of the other files are still without versions.
pub(crate) const INDEX: &str = include_str!("../../assets/page/index.html");

/// The page of a visitor's own robot, likewise.
pub(crate) const CALIBRATE: &str = include_str!("../../assets/page/calibrate.html");

/// The viewer's WebAssembly is the same for all servers of a program.
static VIEWER_WASM: LazyLock<Compressed> = LazyLock::new(Compressed::default);

/// A file of the page: its path and its content.
macro_rules! embedded {
    ($name:literal) => {
        (concat!("/", $name), include_bytes!(concat!("../../assets/page/", $name)) as &[u8])
    };
}

/// The pages' own files, all but [`INDEX`] and [`CALIBRATE`].
const PAGE: [(&str, &[u8]); 36] = [
    embedded!("bench-worker.js"),
    embedded!("bench.js"),
    embedded!("calibrate.css"),
    embedded!("calibrate.js"),
    embedded!("capable.js"),
    embedded!("columns.js"),
    embedded!("controls.js"),
    embedded!("dialogue.js"),
    embedded!("engine.js"),
    embedded!("first.js"),
    embedded!("folder.js"),
    embedded!("holder.js"),
    embedded!("icon.svg"),
    embedded!("lag.js"),
    embedded!("later.js"),
    embedded!("legend.js"),
    embedded!("links.js"),
    embedded!("offline.js"),
    embedded!("packed.js"),
    embedded!("page.css"),
    embedded!("page.js"),
    embedded!("picture.js"),
    embedded!("preview.png"),
    embedded!("pick.js"),
    embedded!("quiet.js"),
    embedded!("refused.js"),
    embedded!("save.js"),
    embedded!("scene.js"),
    embedded!("seeds.js"),
    embedded!("session.js"),
    embedded!("sketch.js"),
    embedded!("storage.js"),
    embedded!("sw.js"),
    embedded!("table.js"),
    embedded!("viewer.js"),
    embedded!("worker.js"),
];

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// The media type of a file, by the end of its name.
fn media_type(path: &str) -> &'static str {
    match path.rsplit('.').next() {
        Some("css") => "text/css; charset=utf-8",
        Some("png") => "image/png",
        Some("svg") => "image/svg+xml",
        _ => JAVASCRIPT,
    }
}

/// Why the page is incomplete.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The viewer's WebAssembly is missing.
    #[error("the viewer cannot be loaded: {0}")]
    Viewer(#[from] re_web_viewer_server::WebViewerDataError),
    /// The requested build of the panel is not there.
    #[error("the panel's file {} cannot be read: {source}", file.display())]
    Panel {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// The version of a file, which changes with its content.
pub(crate) fn version(bytes: &[u8]) -> String {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    format!("{:016x}", hasher.finish())
}

/// A file of the page.
pub(crate) struct PageFile {
    /// Its address on a server.
    pub(crate) path: &'static str,
    pub(crate) content_type: &'static str,
    pub(crate) bytes: Bytes,
    /// The file's version, which changes with its content: the entity tag, and `?v=` in the addresses under which it
    /// may be cached for ever.
    pub(crate) version: String,
    pub(crate) compressed: Compressed,
}

impl PageFile {
    pub(crate) fn new(path: &'static str, content_type: &'static str, bytes: Bytes) -> Self {
        let version = version(&bytes);
        Self { path, content_type, bytes, version, compressed: Compressed::default() }
    }

    /// The viewer's file of 42 MB: compressed from the start of the program on, so that the first visitor too gets 14
    /// MB.
    fn viewer(path: &'static str, bytes: Bytes) -> Self {
        VIEWER_WASM.begin(bytes.clone());
        Self { compressed: VIEWER_WASM.clone(), ..Self::new(path, "application/wasm", bytes) }
    }

    /// A file that was compressed when it was built; clients that do not accept gzip get it unpacked.
    fn compressed_already(path: &'static str, content_type: &'static str, compressed: Bytes) -> Self {
        let file = Self::new(path, content_type, gzip::unpack(&compressed));
        Self { compressed: Compressed::ready(compressed), ..file }
    }
}

/// A page with the addresses that `address` gives its files, and their versions.
pub(crate) fn versioned(page: &str, files: &[PageFile], address: impl Fn(&PageFile) -> String) -> String {
    files.iter().fold(page.to_owned(), |page, file| {
        let versioned = format!("\"{}?v={}\"", address(file), file.version);
        page.replace(&format!("\"{}\"", file.path), &versioned)
    })
}

/// What the pages say of the program that they are of: its version, and the commit if that is known.
pub(crate) fn generated(page: &str, commit: Option<&str>) -> String {
    const GENERATOR: &str = "<meta name=\"generator\" content=\"body-schema";
    let commit = commit.map(|commit| format!(" (commit {commit})")).unwrap_or_default();
    page.replacen(GENERATOR, &format!("{GENERATOR} {}{commit}", env!("CARGO_PKG_VERSION")), 1)
}

/// All files but the pages themselves, which are [`INDEX`] and [`CALIBRATE`]. The panel is that of a folder, if one is named.
///
/// # Errors
///
/// [`PageError::Panel`] if that folder lacks a file, [`PageError::Viewer`] if the program lacks its viewer.
pub(crate) fn files(panel: Option<&Path>) -> Result<Vec<PageFile>, PageError> {
    let viewer = WebViewerData::load(None)?;
    let (panel_script, panel_wasm) = match panel {
        Some(folder) => {
            let read = |name: &str| {
                let file = folder.join(name);
                fs::read(&file).map(Bytes::from).map_err(|source| PageError::Panel { file, source })
            };
            (read("panel.js")?, read("panel_bg.wasm.gz")?)
        }
        None => (
            Bytes::from_static(include_bytes!("../../assets/panel/panel.js")),
            Bytes::from_static(include_bytes!("../../assets/panel/panel_bg.wasm.gz")),
        ),
    };
    let page = PAGE.map(|(path, bytes)| PageFile::new(path, media_type(path), Bytes::from_static(bytes)));
    let mut files = Vec::from(page);
    files.extend([
        PageFile::new("/panel/panel.js", JAVASCRIPT, panel_script),
        PageFile::compressed_already("/panel/panel_bg.wasm", "application/wasm", panel_wasm),
        PageFile::new(
            "/engine/engine.js",
            JAVASCRIPT,
            Bytes::from_static(include_bytes!("../../assets/engine/engine.js")),
        ),
        PageFile::compressed_already(
            "/engine/engine_bg.wasm",
            "application/wasm",
            Bytes::from_static(include_bytes!("../../assets/engine/engine_bg.wasm.gz")),
        ),
        PageFile::new("/engine/meshes.bin", "application/octet-stream", body_schema_recording::mesh_pack().into()),
        PageFile::new("/viewer/re_viewer.js", JAVASCRIPT, Bytes::copy_from_slice(viewer.viewer_js())),
        PageFile::viewer("/viewer/re_viewer_bg.wasm", viewer_wasm(viewer)),
    ]);
    Ok(files)
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
            names.filter(|name| !name.ends_with(".html")).map(|name| format!("/{name}")).collect();
        assert_eq!(there, PAGE.map(|(path, _)| path.to_owned()).into());
    }
}
