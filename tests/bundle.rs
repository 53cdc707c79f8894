//! The panel that is kept in the repository was built from the sources beside it.

#[path = "../web/bundle/src/stamp.rs"]
mod stamp;

use std::path::Path;

#[test]
fn the_bundle_is_of_its_sources() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = std::fs::read_to_string(workspace.join("assets/panel/stamp.txt")).expect("a stamp");
    let sources = stamp::of_sources(workspace, &workspace.join("assets/panel")).expect("the sources");
    assert_eq!(
        kept.trim(),
        sources.trim(),
        "assets/panel and assets/engine are stale: run `cargo run -p body-schema-bundle`"
    );
}

#[test]
fn the_bundles_are_light() {
    for (file, most) in [("assets/panel/panel_bg.wasm.gz", 2_000_000), ("assets/engine/engine_bg.wasm.gz", 2_200_000)] {
        let size = std::fs::metadata(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("the bundle").len();
        assert!(size < most, "{file}: {size} bytes");
    }
}
