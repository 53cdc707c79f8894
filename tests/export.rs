//! The page without a server: exports in a real browser, from a host that knows no more than to send files.
//!
//! Without Chromium and chromedriver this is skipped, unless the environment has `CI` or
//! `BODY_SCHEMA_REQUIRE_BROWSER=1`.

mod first;
mod framed;
pub mod host;
mod hosting;
mod kept;
mod played;
mod worker;

use std::{
    path::Path,
    process::{Command, Output},
    sync::Arc,
};

use host::Host;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::browser::driver::Browser;

/// The whole folder, as it is promised.
const MOST_BYTES: u64 = 24_000_000;
/// What `export` says.
fn export(out: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
    command.arg("export").args(arguments).arg("--out").arg(out);
    // Another build of the panel than the embedded one may be tested.
    command.args(
        std::env::var_os("BODY_SCHEMA_PANEL_DIR")
            .iter()
            .flat_map(|folder| ["--panel-dir".as_ref(), folder.as_os_str()]),
    );
    command.output().expect("the program starts")
}

/// A folder with an export.
pub fn exported(arguments: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let output = export(folder.path(), arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

fn read_json(folder: &Path, file: &str) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join(file)).expect(file)).expect("JSON")
}

/// Sizes of all files, by their paths.
fn files(folder: &Path) -> Vec<(String, u64)> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    let found = entries.flat_map(|entry| {
        let (name, data) =
            (entry.file_name().into_string().expect("a plain name"), entry.metadata().expect("readable"));
        match data.is_dir() {
            true => files(&entry.path()).into_iter().map(|(path, size)| (format!("{name}/{path}"), size)).collect(),
            false => vec![(name, data.len())],
        }
    });
    found.collect()
}

/// A scenario of one's own with the files that it names, as those of a built-in one.
fn own_scenario(folder: &Path, name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    for file in ["positioner.csv", "positioner.urdf"] {
        std::fs::copy(scenarios.join(file), folder.join(file)).expect("a copy");
    }
    let text = std::fs::read_to_string(scenarios.join("positioner.toml")).expect("a scenario");
    let file = folder.join("own.toml");
    std::fs::write(&file, text.replacen("name = \"positioner\"", &format!("name = \"{name}\""), 1)).expect("written");
    file.to_str().expect("text").to_owned()
}

#[test]
fn a_folder_holds_the_page_and_what_was_added_to_it() {
    let own = tempfile::tempdir().expect("a folder");
    let file = own_scenario(own.path(), "mine");
    let command = ["arm-12dof", &file, "--seed", "4711", "--learner", "active,random", "--steps", "60"];
    let folder = exported(&[&command[..], &["--address", "https://example.org/demo"]].concat());
    let manifest = read_json(folder.path(), "export.json");
    assert_eq!(manifest["opens"], "scenario=arm-12dof&seed=4711&learners=active,random&to=60");
    assert!(
        manifest["first"].is_null() && !folder.path().join("first.json.gz").exists(),
        "another run than the first story"
    );
    // What is built in is in the engine.
    let added = json!([{ "file": "mine.toml", "source": "scenarios/mine.toml",
        "data": { "positioner.csv": "scenarios/mine/0", "positioner.urdf": "scenarios/mine/1" } }]);
    let data = |value: &Value| value[0]["data"].as_object().map(|data| data.keys().cloned().collect::<Vec<_>>());
    assert_eq!(
        (&manifest["scenarios"][0]["source"], data(&manifest["scenarios"])),
        (&added[0]["source"], data(&added))
    );
    for (path, _) in files(folder.path()).iter().filter(|(path, _)| path.starts_with("scenarios/mine/")) {
        let kept = std::fs::read(folder.path().join(path)).expect("a file");
        let is_one = ["positioner.csv", "positioner.urdf"]
            .iter()
            .any(|name| std::fs::read(own.path().join(name)).is_ok_and(|bytes| bytes == kept));
        assert!(is_one, "{path}");
    }
    let page = std::fs::read_to_string(folder.path().join("index.html")).expect("a page");
    assert!(page.contains("https://example.org/demo/preview.png") && page.contains("· body-schema</title>"), "{page}");
    let size: u64 = files(folder.path()).iter().map(|(_, size)| size).sum();
    assert!(size < MOST_BYTES, "{size} bytes: {:#?}", files(folder.path()));

    // Every script that the page's scripts import lies beside them.
    for (path, _) in files(folder.path()).iter().filter(|(path, _)| path.ends_with(".js")) {
        let script = std::fs::read_to_string(folder.path().join(path)).expect("a script");
        let imports = ["from \"./", "import(\"./"].into_iter().flat_map(|way| script.split(way).skip(1));
        for import in imports.filter_map(|rest| rest.split('"').next()) {
            assert!(folder.path().join(path).with_file_name(import).is_file(), "{path} imports {import}");
        }
    }

    // Another export takes its place, and that of one from before: what they held is gone.
    std::fs::create_dir_all(folder.path().join("runs/arm-6dof/1")).expect("a folder");
    std::fs::write(folder.path().join("export.json"), "{\"format\":1,\"scenarios\":[]}").expect("written");
    assert!(export(folder.path(), &[]).status.success());
    for gone in ["runs", "scenarios", ".old"] {
        assert!(!folder.path().join(gone).exists(), "{gone}");
    }
    let manifest = read_json(folder.path(), "export.json");
    assert_eq!(manifest["opens"], "");
    // By the version that keeps it in the browser, so that it is fetched once.
    let (file, version) = manifest["first"].as_str().and_then(|first| first.split_once("?v=")).expect("a version");
    let kept = std::fs::read_to_string(folder.path().join("sw.js")).expect("a script");
    assert!(
        folder.path().join(file).is_file() && kept.contains(&format!("[\"{file}\",\"{version}\"]")),
        "{file} {version}"
    );
}

#[test]
fn what_cannot_be_exported_is_said_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = folder.path().join("full");
    std::fs::create_dir(&full).expect("a folder");
    std::fs::write(full.join("thesis.tex"), "mine").expect("written");
    let new = folder.path().join("new");
    let cases: [(&Path, &[&str], &[&str]); 11] = [
        (&full, &[], &["is not empty and holds no export", "--force"]),
        (&new, &["--learner", "random"], &["<SCENARIO>"]),
        (&new, &["arm-6dofx"], &["did you mean `arm-6dof`"]),
        (&new, &["arm-6dof", "arm-6dof"], &["named twice"]),
        (&new, &["arm-6dof", "--learner", "clever"], &["`clever`"]),
        (&new, &["arm-6dof", "--steps", "0"], &["1 to 100000 steps"]),
        (&new, &["tiago-mocap", "--steps", "38"], &["`tiago-mocap`", "--steps 37"]),
        (&new, &["arm-6dof", "--seed", "1..5"], &["the one that the page opens with", "visitors choose any other"]),
        (&new, &["arm-6dof", "--seed", "1,4"], &["the one that the page opens with"]),
        (&new, &["--seed", "9007199254740992"], &["9007199254740991"]),
        (&new, &["arm-6dof", "--address", "example.org"], &["https://example.org/demo/"]),
    ];
    for (out, arguments, expected) in cases {
        let output = export(out, arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(expected.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
    assert!(!new.exists(), "nothing was written");
    assert_eq!(files(&full), [("thesis.tex".to_owned(), 4)]);
}

/// What became of a visit.
struct Visited {
    outcome: Result<(), tokio::task::JoinError>,
    /// What stands in the browser's console, and the hosts that it asked.
    errors: Vec<String>,
    hosts: Vec<String>,
    host: Arc<Host>,
}

/// Does something with a folder in a browser of its own, if there is one.
async fn visited<Visit: Future<Output = ()> + Send + 'static>(
    folder: &Path,
    below: &'static str,
    visit: impl FnOnce(Browser, Arc<Host>) -> Visit,
) -> Option<Visited> {
    // One after the other: each draws without a graphics card, with all the processors there are.
    static TURN: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());
    let _turn = TURN.lock().await;
    let browser = Browser::start(&[]).await?;
    let host = Arc::new(Host::start(folder, below));
    // In a task of its own, so that the browser is closed whatever becomes of it.
    let outcome = tokio::spawn(visit(browser.clone(), host.clone())).await;
    let (errors, hosts) = (browser.console().await, browser.hosts().await);
    browser.stop().await;
    Some(Visited { outcome, errors, hosts, host })
}

/// The same, and holds what must always hold: every request is answered from the folder, and the console stays quiet.
async fn in_browser<Visit: Future<Output = ()> + Send + 'static>(
    folder: &Path,
    below: &'static str,
    visit: impl FnOnce(Browser, Arc<Host>) -> Visit,
) {
    let Some(Visited { outcome, errors, hosts, host }) = visited(folder, below, visit).await else { return };
    if let Err(panic) = outcome {
        eprintln!("errors in the console: {errors:#?}; not found: {:#?}", host.missed());
        std::panic::resume_unwind(panic.into_panic());
    }
    assert_eq!(errors, [""; 0], "errors in the console");
    assert_eq!(host.missed(), [""; 0], "requests that failed");
    assert_eq!(hosts, [host.address.to_string()], "every request goes to this host");
}
