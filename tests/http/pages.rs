//! The page's files.

use std::io::Read;

use body_schema::server::Options;
use reqwest::{Method, StatusCode};

use crate::http::support::Server;

#[tokio::test]
async fn the_page_and_all_that_it_names_are_served() {
    let server = Server::start().await;
    let page = server.get("/").await;
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    assert_eq!(page.headers()["x-content-type-options"], "nosniff");
    assert!(page.headers().contains_key("referrer-policy"));
    let policy = page.headers()["content-security-policy"].to_str().expect("text").to_owned();
    assert!(policy.starts_with("default-src 'none'") && !policy.contains("unsafe-inline") && !policy.contains("http"));
    let page = page.text().await.expect("text");
    let addresses: Vec<&str> = page.split('"').filter(|text| text.starts_with('/') && text.contains("?v=")).collect();
    assert_eq!(
        addresses.len(),
        12,
        "style, scripts, icon, worker, script and wasm of panel, viewer and engine, meshes: {addresses:?}"
    );
    for address in addresses {
        let file = server.get(address).await;
        assert_eq!(file.status(), StatusCode::OK, "{address}");
        assert_eq!(file.headers()["cache-control"], "public, max-age=31536000, immutable");
        let tag = file.headers()["etag"].clone();
        let again = server.request(Method::GET, address).header("if-none-match", &tag).send().await.expect("an answer");
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(again.headers()["etag"], tag);
        assert!(again.bytes().await.expect("nothing").is_empty());
        let plain = server.get(address.split('?').next().expect("a path")).await;
        assert_eq!(plain.headers()["cache-control"], "no-cache", "an address without a version may change");
    }
    for script in ["/session.js", "/seeds.js", "/viewer.js", "/panel/panel.js"] {
        assert_eq!(server.get(script).await.headers()["content-type"], "text/javascript; charset=utf-8");
    }
    for wasm in ["/viewer/re_viewer_bg.wasm", "/panel/panel_bg.wasm"] {
        let wasm = server.request(Method::HEAD, wasm).send().await.expect("an answer");
        assert_eq!(wasm.headers()["content-type"], "application/wasm");
    }
    server.stop().await;
}

#[tokio::test]
async fn files_are_compressed_for_those_who_ask() {
    let server = Server::start().await;
    let path = "/viewer/re_viewer.js";
    let plain = server.get(path).await;
    assert!(!plain.headers().contains_key("content-encoding"));
    let plain = plain.bytes().await.expect("a file");
    let small =
        server.request(Method::GET, path).header("accept-encoding", "br, gzip").send().await.expect("an answer");
    assert_eq!(small.headers()["content-encoding"], "gzip");
    assert_eq!(small.headers()["vary"], "Accept-Encoding");
    let small = small.bytes().await.expect("a file");
    let mut unpacked = Vec::new();
    flate2::read::GzDecoder::new(small.as_ref()).read_to_end(&mut unpacked).expect("gzip");
    assert!(unpacked == plain && small.len() * 2 < plain.len());
    server.stop().await;
}

#[tokio::test]
async fn the_panel_is_sent_as_it_was_compressed_and_unpacked_for_those_who_do_not_ask() {
    let server = Server::start().await;
    let path = "/panel/panel_bg.wasm";
    let small = server.request(Method::GET, path).header("accept-encoding", "gzip").send().await.expect("an answer");
    assert_eq!(small.headers()["content-encoding"], "gzip");
    let small = small.bytes().await.expect("a file");
    assert!(small.len() < 2_000_000, "{} bytes", small.len());
    let plain = server.get(path).await.bytes().await.expect("a file");
    assert!(plain.starts_with(b"\0asm") && plain.len() > small.len());
    server.stop().await;
}

/// Even the first visitor, who comes before anything was compressed on demand.
#[tokio::test]
async fn the_viewer_is_sent_compressed_from_the_start() {
    let server = Server::start().await;
    let path = "/viewer/re_viewer_bg.wasm";
    let small = server.request(Method::GET, path).header("accept-encoding", "gzip").send().await.expect("an answer");
    assert_eq!(small.headers()["content-encoding"], "gzip");
    let unpacked: usize = small.headers()["uncompressed-length"].to_str().expect("text").parse().expect("a number");
    let small = small.bytes().await.expect("a file");
    assert!(small.len() < 15_000_000 && unpacked > 40_000_000, "{} of {unpacked} bytes", small.len());
    server.stop().await;
}

#[tokio::test]
async fn health() {
    let server = Server::start().await;
    let health = server.get_json("/healthz").await;
    assert_eq!((health["status"].as_str(), health["version"].as_str()), (Some("ok"), Some(env!("CARGO_PKG_VERSION"))));
    server.stop().await;
}

/// What makes certificates on the page says which program it is of.
#[tokio::test]
async fn the_page_of_ones_own_robot_names_version_and_commit() {
    for (commit, named) in [(None, ""), (Some("0123456789".to_owned()), " (commit 0123456789)")] {
        let server = Server::with(Options { commit, ..Options::default() }).await;
        let page = server.get("/calibrate.html").await.text().await.expect("a page");
        let meta = format!("<meta name=\"generator\" content=\"body-schema {}{named}\" />", env!("CARGO_PKG_VERSION"));
        assert!(page.contains(&meta), "{meta}: {page}");
        server.stop().await;
    }
}

/// Clickjacking: the policy and its forerunner say the same.
#[tokio::test]
async fn nobody_shows_the_page_in_a_frame_but_who_was_allowed_to() {
    for (allowed, ancestors, old) in [
        (&[][..], "frame-ancestors 'none'", Some("DENY")),
        (&["https://example.org", "self"], "frame-ancestors https://example.org 'self'", None),
    ] {
        let frame_ancestors = allowed.iter().map(|origin| origin.parse().expect("an origin")).collect();
        let server = Server::with(Options { frame_ancestors, ..Options::default() }).await;
        for path in ["/", "/v1/scenarios"] {
            let headers = server.get(path).await.headers().clone();
            let policy = headers["content-security-policy"].to_str().expect("text");
            assert!(policy.starts_with("default-src 'none'") && policy.ends_with(ancestors), "{policy}");
            assert_eq!(headers.get("x-frame-options").map(|value| value.to_str().expect("text")), old);
        }
        server.stop().await;
    }
}
