//! Builds the page's panel into `assets/panel` and the engine for the browser into `assets/engine`, which the program embeds:
//!
//! ```sh
//! rustup target add wasm32-unknown-unknown    # once
//! cargo run -p body-schema-bundle             # --check only tells whether they are of these sources
//! ```
//!
//! Where rustup has no such target, Debian's `rustc-web cargo-web rust-web-src lld-19` do it: set
//! `BODY_SCHEMA_DEBIAN_RUST=1`. A folder as argument takes the place of `assets/panel`.

mod stamp;

use std::{
    env,
    error::Error,
    fs,
    num::NonZeroU64,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use wasm_bindgen_cli_support::Bindgen;
use zopfli::{Format, Options};

/// How it is compiled: see Cargo.toml.
const PROFILE: &str = "web";
const TARGET: &str = "wasm32-unknown-unknown";
/// Wide registers, and random numbers from the browser.
const FLAGS: &str = "-C target-feature=+simd128 --cfg getrandom_backend=\"wasm_js\"";
/// The most that the compressed bundle may weigh: it is what a first visitor waits for.
const MOST_BYTES: usize = 2_000_000;
/// The most that the engine may weigh, which is loaded behind it.
const MOST_ENGINE_BYTES: usize = 2_200_000;

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
    if kept.trim() == stamp::of_sources(workspace, folder)?.trim() {
        Ok("the bundle is of these sources".to_owned())
    } else {
        Err("the bundle is older than its sources: run `cargo run -p body-schema-bundle`".into())
    }
}

/// How often the compressor looks for a better way: with 40, and 320 blocks, the engine weighs 4 kB less than with 15 and 160.
const PACKING: NonZeroU64 = NonZeroU64::new(40).unwrap();
/// Into how many blocks it may divide megabytes of code, each with codes of its own: of 6 MB 15 weigh 1 % more, and without a limit 2 % more.
const BLOCKS: u16 = 320;

/// What is built: the package, its module, the files' name, and how much of it compressed a visitor may be made to wait for.
const BUNDLES: [(&str, &str, &str, usize); 2] = [
    ("body-schema-panel", "body_schema_panel.wasm", "panel", MOST_BYTES),
    ("body-schema-worker", "body_schema_worker.wasm", "engine", MOST_ENGINE_BYTES),
];

/// As small as gzip gets: every visitor waits for it, and it is built once.
fn packing() -> Options {
    Options { iteration_count: PACKING, maximum_block_splits: BLOCKS, ..Options::default() }
}

/// Builds all; each goes to a folder of its name beside that of the panel.
fn build(workspace: &Path, folder: &Path) -> Result<String, Box<dyn Error>> {
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target/panel"), PathBuf::from);
    compile(workspace, &target)?;
    let made = target.join(TARGET).join(PROFILE);
    let mut said = Vec::new();
    for (_, module, name, most) in BUNDLES {
        let bound = target.join("bindgen");
        // No wasm-opt: names removed, it saves nothing once compressed, and Debian's (108) exports the wrong table.
        let mut bindgen = Bindgen::new();
        bindgen.web(true)?.typescript(false).remove_name_section(true).remove_producers_section(true);
        bindgen.input_path(made.join(module)).out_name(name).generate(&bound)?;
        let wasm = fs::read(bound.join(format!("{name}_bg.wasm")))?;
        let mut compressed = Vec::new();
        zopfli::compress(packing(), Format::Gzip, &wasm[..], &mut compressed)?;
        let script = fs::read(bound.join(format!("{name}.js")))?;
        let size = compressed.len() + script.len();
        if size > most {
            return Err(format!("the bundle `{name}` weighs {size} bytes, more than {most}").into());
        }
        let folder = if name == "panel" { folder.to_owned() } else { folder.with_file_name(name) };
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(format!("{name}_bg.wasm.gz")), &compressed)?;
        fs::write(folder.join(format!("{name}.js")), script)?;
        let (wasm, compressed) = (wasm.len(), compressed.len());
        said.push(format!("{}: {wasm} bytes of WebAssembly, {compressed} compressed", folder.display()));
    }
    let modules = BUNDLES.map(|(_, module, ..)| made.join(module).with_extension("d"));
    fs::write(folder.join("sources.txt"), stamp::sources(workspace, &modules)?)?;
    fs::write(folder.join("stamp.txt"), stamp::of_sources(workspace, folder)?)?;
    Ok(said.join("\n"))
}

fn compile(workspace: &Path, target: &Path) -> Result<(), Box<dyn Error>> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.env("RUSTFLAGS", FLAGS);
    if env::var_os("BODY_SCHEMA_DEBIAN_RUST").is_some() {
        // Debian's compiler has the target's sources instead of its library.
        cargo = Command::new("/usr/bin/cargo");
        cargo
            .env("RUSTC", "/usr/bin/rustc")
            .env("RUSTC_BOOTSTRAP", "1")
            .env("RUSTFLAGS", format!("{FLAGS} -C linker-flavor=wasm-ld"))
            .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld-19")
            .env_remove("RUSTUP_TOOLCHAIN")
            .env_remove("RUSTC_WRAPPER")
            // Small sorting above all: there are a hundred of it, and a visitor waits for each.
            .args(["-Z", "build-std=std,panic_abort", "-Z", "build-std-features=optimize_for_size"]);
    }
    cargo
        .current_dir(workspace)
        .args(["build", "--locked", "--profile", PROFILE, "--target", TARGET])
        .args(BUNDLES.iter().flat_map(|(package, ..)| ["--package", package]))
        .arg("--target-dir")
        .arg(target);
    let status = cargo.status().map_err(|error| format!("cargo does not start: {error}"))?;
    if status.success() { Ok(()) } else { Err("the panel or the engine does not compile".into()) }
}
