//! The page's files as the server sends them.

use std::{borrow::Cow, path::Path, sync::Arc};

use axum::{
    Router,
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header},
    response::{IntoResponse, Response},
    routing::get,
};

use super::{
    App, ServerError,
    problem::{Kind, Problem},
};
use crate::page::{self, CALIBRATE, INDEX, PageFile, gzip};

/// The page's property for its picture, which previews need as a whole address.
const PREVIEW: &str = "\"og:image\" content=\"";

/// All files, by their paths.
pub(super) struct Assets(Vec<PageFile>);

/// The routes of all files.
pub(super) fn routes(Assets(assets): &Assets) -> Router<Arc<App>> {
    assets.iter().fold(Router::new(), |router, asset| router.route(asset.path, get(file)))
}

async fn file(State(app): State<Arc<App>>, uri: Uri, headers: HeaderMap) -> Response {
    match app.assets.0.iter().find(|asset| asset.path == uri.path()) {
        Some(page) if page.path == "/" => response(&at(page, &headers), &headers, uri.query()).await,
        Some(file) => response(file, &headers, uri.query()).await,
        None => Problem::new(Kind::UnknownRoute, format!("there is no file `{}`", uri.path())).into_response(),
    }
}

impl Assets {
    /// All files; the pages' addresses of the others carry their versions, and they say the commit of the program. The panel is that
    /// of a folder, if one is named.
    pub(super) fn load(panel: Option<&Path>, commit: Option<&str>) -> Result<Self, ServerError> {
        let mut assets = page::files(panel)?;
        let pages = [("/", INDEX), ("/calibrate.html", CALIBRATE)].map(|(address, page)| {
            let page = page::generated(page, commit);
            let versioned = page::versioned(&page, &assets, |file| file.path.to_owned());
            PageFile::new(address, "text/html; charset=utf-8", versioned.into())
        });
        assets.extend(pages);
        Ok(Self(assets))
    }
}

/// The page as it is under the address by which it was requested.
fn at(file: &PageFile, headers: &HeaderMap) -> PageFile {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let host = text("host");
    // A host is written into the page only if it can be nothing else.
    let is_plain =
        !host.is_empty() && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".:-[]".contains(&byte));
    let page = String::from_utf8_lossy(&file.bytes);
    let page = if is_plain {
        let scheme = if text("x-forwarded-proto") == "https" { "https" } else { "http" };
        page.replace(PREVIEW, &format!("{PREVIEW}{scheme}://{host}"))
    } else {
        page.into_owned()
    };
    PageFile::new(file.path, file.content_type, page.into())
}

async fn response(file: &PageFile, headers: &HeaderMap, query: Option<&str>) -> Response {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let compressed = match gzip::is_accepted(text(header::ACCEPT_ENCODING)) {
        true => file.compressed.of_large(file.bytes.clone()).await,
        false => None,
    };
    let tag = match &compressed {
        Some(_) => Cow::from(format!("\"{}-gzip\"", file.version)),
        None => Cow::from(format!("\"{}\"", file.version)),
    };
    let is_versioned = query.is_some_and(|query| query.strip_prefix("v=") == Some(&file.version));
    let caching = if is_versioned { "public, max-age=31536000, immutable" } else { "no-cache" };
    let unchanged = text(header::IF_NONE_MATCH).split(',').any(|known| {
        let known = known.trim().trim_start_matches("W/");
        known == "*" || known.trim_matches('"').trim_end_matches("-gzip") == file.version
    });
    let mut response = match (unchanged, &compressed) {
        (true, _) => StatusCode::NOT_MODIFIED.into_response(),
        (false, Some(bytes)) => ([(header::CONTENT_ENCODING, "gzip")], bytes.clone()).into_response(),
        (false, None) => Body::from(file.bytes.clone()).into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(file.content_type));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
    headers.insert(header::VARY, HeaderValue::from_static("Accept-Encoding"));
    headers.extend(HeaderValue::from_str(&tag).map(|tag| (header::ETAG, tag)));
    // The length of what comes out of the decompression, for the page's progress.
    headers.insert("uncompressed-length", HeaderValue::from(file.bytes.len()));
    response
}
