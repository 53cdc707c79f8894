//! Builds the page's panel into `assets/panel`, which the server embeds:
//!
//! ```sh
//! rustup target add wasm32-unknown-unknown    # once
//! cargo run -p body-schema-bundle             # --check only tells whether assets/panel is of these sources
//! ```
//!
//! Where rustup has no such target, Debian's `rustc-web cargo-web rust-web-src lld-19` do it: set
//! `BODY_SCHEMA_DEBIAN_RUST=1`. A folder as argument takes the place of `assets/panel`.

mod stamp;

use std::{
    env,
    error::Error,
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use flate2::{Compression, write::GzEncoder};
use wasm_bindgen_cli_support::Bindgen;

const TARGET: &str = "wasm32-unknown-unknown";
/// The most that the compressed bundle may weigh: it is what a first visitor waits for.
const MOST_BYTES: usize = 2_000_000;

fn main() -> ExitCode {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let arguments: Vec<String> = env::args().skip(1).collect();
    let folder = arguments.iter().find(|argument| !argument.starts_with("--"));
    let folder = folder.map_or_else(|| workspace.join("assets/panel"), PathBuf::from);
    let outcome = if arguments.iter().any(|argument| argument == "--check") {
        check(&workspace, &folder)
    } else {
        build(&workspace, &folder)
    };
    match outcome {
        Ok(said) => {
            println!("{said}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn check(workspace: &Path, folder: &Path) -> Result<String, Box<dyn Error>> {
    let kept = fs::read_to_string(folder.join("stamp.txt")).unwrap_or_default();
    if kept.trim() == stamp::of_sources(workspace)?.trim() {
        Ok("the bundle is of these sources".to_owned())
    } else {
        Err("the bundle is older than its sources: run `cargo run -p body-schema-bundle`".into())
    }
}

fn build(workspace: &Path, folder: &Path) -> Result<String, Box<dyn Error>> {
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target/panel"), PathBuf::from);
    compile(workspace, &target)?;
    let module = target.join(TARGET).join("release/body_schema_panel.wasm");
    let made = target.join("bindgen");
    // No wasm-opt: names removed, it saves nothing once compressed, and Debian's (108) exports the wrong table.
    let mut bindgen = Bindgen::new();
    bindgen.web(true)?.typescript(false).remove_name_section(true).remove_producers_section(true);
    bindgen.input_path(module).out_name("panel").generate(&made)?;
    let wasm = fs::read(made.join("panel_bg.wasm"))?;

    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&wasm)?;
    let compressed = encoder.finish()?;
    let script = fs::read(made.join("panel.js"))?;
    let size = compressed.len() + script.len();
    if size > MOST_BYTES {
        return Err(format!("the bundle weighs {size} bytes, more than {MOST_BYTES}").into());
    }
    fs::create_dir_all(folder)?;
    fs::write(folder.join("panel_bg.wasm.gz"), &compressed)?;
    fs::write(folder.join("panel.js"), script)?;
    fs::write(folder.join("stamp.txt"), stamp::of_sources(workspace)?)?;
    let (wasm, compressed) = (wasm.len(), compressed.len());
    Ok(format!("{}: {wasm} bytes of WebAssembly, {compressed} compressed", folder.display()))
}

fn compile(workspace: &Path, target: &Path) -> Result<(), Box<dyn Error>> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    if env::var_os("BODY_SCHEMA_DEBIAN_RUST").is_some() {
        // Debian's compiler has the target's sources instead of its library.
        cargo = Command::new("/usr/bin/cargo");
        cargo
            .env("RUSTC", "/usr/bin/rustc")
            .env("RUSTC_BOOTSTRAP", "1")
            .env("RUSTFLAGS", "-C linker-flavor=wasm-ld")
            .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld-19")
            .env_remove("RUSTUP_TOOLCHAIN")
            .env_remove("RUSTC_WRAPPER")
            .args(["-Z", "build-std=std,panic_abort"]);
    }
    cargo
        .current_dir(workspace)
        // All at once: what nobody calls is left out across crates.
        .env("CARGO_PROFILE_RELEASE_LTO", "fat")
        .env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "1")
        .args(["build", "--locked", "--release", "--package", "body-schema-panel", "--target", TARGET])
        .arg("--target-dir")
        .arg(target);
    let status = cargo.status().map_err(|error| format!("cargo does not start: {error}"))?;
    if status.success() { Ok(()) } else { Err("the panel does not compile".into()) }
}
