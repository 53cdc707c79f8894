//! The panel that is kept in the repository was built from the sources beside it.

#[path = "../web/bundle/src/stamp.rs"]
mod stamp;

use std::path::Path;

#[test]
fn the_bundle_is_of_its_sources() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = std::fs::read_to_string(workspace.join("assets/panel/stamp.txt")).expect("a stamp");
    let sources = stamp::of_sources(workspace).expect("the sources");
    assert_eq!(kept.trim(), sources.trim(), "assets/panel is stale: run `cargo run -p body-schema-bundle`");
}

#[test]
fn the_bundle_is_light() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/panel/panel_bg.wasm.gz");
    let size = std::fs::metadata(file).expect("the bundle").len();
    assert!(size < 2_000_000, "{size} bytes");
}
