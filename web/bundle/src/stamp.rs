//! What a bundle was built from, as one number. The tests of the server's crate compare it too.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// The crates whose version changes the bundle.
const CRATES: [&str; 8] = ["eframe", "egui", "egui_plot", "epaint", "serde", "serde_json", "wasm-bindgen", "web-sys"];

/// What the panel takes of other crates: the types of reports, those of sessions with robots elsewhere, the rules behind a
/// picture, and the palette of recordings. All else of these crates may change without changing the bundle.
const ENGINE: [&str; 17] = [
    "crates/ask-tell/src/observation.rs",
    "crates/ask-tell/src/status.rs",
    "crates/ask-tell/src/suggestion.rs",
    "crates/engine/src/optimize/direct/plane.rs",
    "crates/engine/src/optimize/direct/settings.rs",
    "crates/engine/src/optimize/direct/ternary.rs",
    "crates/experiment/src/convergence.rs",
    "crates/palette/src/lib.rs",
    "crates/scenario/src/summary.rs",
    "crates/wire/src/choice.rs",
    "crates/wire/src/description.rs",
    "crates/wire/src/head.rs",
    "crates/wire/src/loads.rs",
    "crates/wire/src/metrics.rs",
    "crates/wire/src/model.rs",
    "crates/wire/src/place.rs",
    "crates/wire/src/step.rs",
];

/// The stamp of the panel's sources, given the folder of the workspace.
pub fn of_sources(workspace: &Path) -> io::Result<String> {
    let mut files: Vec<PathBuf> = ENGINE.iter().chain(&["web/Cargo.toml"]).map(|file| workspace.join(file)).collect();
    collect(&workspace.join("web/src"), &mut files)?;
    files.sort();
    let mut hash = Fnv::new();
    for file in files {
        let name = file.strip_prefix(workspace).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        hash.add(name.as_bytes());
        // A checkout may have other line ends; they change nothing.
        hash.add(fs::read_to_string(&file)?.replace('\r', "").as_bytes());
    }
    let lock = fs::read_to_string(workspace.join("Cargo.lock"))?.replace('\r', "");
    for package in lock.split("[[package]]") {
        let field = |name: &str| {
            let line = package.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
            line.unwrap_or_default().trim_matches('"')
        };
        if CRATES.contains(&field("name")) {
            hash.add(field("name").as_bytes());
            hash.add(field("version").as_bytes());
        }
    }
    Ok(format!("{:016x}\n", hash.0))
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

/// FNV-1a: short, and the same for ever, which the standard library's hashers do not promise.
struct Fnv(u64);

impl Fnv {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        // The length keeps two texts from running into each other.
        for byte in (bytes.len() as u64).to_le_bytes().iter().chain(bytes) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
