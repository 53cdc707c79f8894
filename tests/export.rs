//! The page without a server: exports in a real browser, from a host that knows no more than to send files.
//!
//! Without Chromium and chromedriver this is skipped, unless the environment has `CI` or
//! `BODY_SCHEMA_REQUIRE_BROWSER=1`.

pub mod host;

use std::{
    path::Path,
    process::{Command, Output},
};

use host::Host;
use serde_json::Value;
use tempfile::TempDir;

use crate::browser::driver::Browser;

/// The whole folder, as it is promised.
const MOST_BYTES: u64 = 25_000_000;
const SPACE: char = ' ';
const LEFT: char = '\u{e012}';
const ESCAPE: char = '\u{e00c}';

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
fn exported(arguments: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let output = export(folder.path(), arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

fn json(folder: &Path, file: &str) -> Value {
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

#[test]
fn a_folder_holds_the_page_and_the_runs_that_were_asked_for() {
    let command =
        ["arm-6dof", "tiago-mocap", "--learner", "active", "--learner", "random", "--seed", "2,4..5", "--steps", "3"];
    let folder = exported(&[&command[..], &["--address", "https://example.org/demo"]].concat());
    let manifest = json(folder.path(), "export.json");
    let scenarios = manifest["scenarios"].as_array().expect("scenarios");
    assert_eq!(scenarios.iter().map(|one| &one["name"]).collect::<Vec<_>>(), ["arm-6dof", "tiago-mocap"]);
    for scenario in scenarios {
        let runs = scenario["runs"].as_array().expect("runs");
        assert_eq!(runs.iter().map(|run| run["seed"].as_u64()).collect::<Vec<_>>(), [2, 4, 5].map(Some));
        assert!(folder.path().join(scenario["source"].as_str().expect("a path")).is_file());
        for run in runs {
            let of_run = folder.path().join(run["folder"].as_str().expect("a path"));
            assert_eq!(json(&of_run, "description.json")["seed"], run["seed"]);
            assert_eq!(json(&of_run, "result.json")["steps"], 3);
            let rows = std::fs::read_to_string(of_run.join("steps.csv")).expect("a table").lines().count();
            assert_eq!(rows, 1 + 2 * 4, "a header, and steps 0 to 3 of two learners");
            for file in ["scene.rrd", "recording.rrd", "reports.ndjson.gz", "blueprint-dark-0.7.rbl"] {
                assert!(of_run.join(file).is_file(), "{file}");
            }
            // Recorded movements are tried one by one: no search explains them.
            let is_searched = scenario["name"] == "arm-6dof";
            assert_eq!(run["searched"].as_array().is_some_and(|names| names == &["active"]), is_searched);
            assert_eq!(of_run.join("selections/active/3.json.gz").is_file(), is_searched);
        }
    }
    let page = std::fs::read_to_string(folder.path().join("index.html")).expect("a page");
    assert!(page.contains("https://example.org/demo/preview.png"), "{page}");

    // Every script that the page's scripts import lies beside them.
    for (path, _) in files(folder.path()).iter().filter(|(path, _)| path.ends_with(".js")) {
        let script = std::fs::read_to_string(folder.path().join(path)).expect("a script");
        let imports = script.split("from \"./").skip(1).filter_map(|rest| rest.split('"').next());
        for import in imports {
            assert!(folder.path().join(path).with_file_name(import).is_file(), "{path} imports {import}");
        }
    }

    // Another export takes its place; what is no export stays.
    assert!(export(folder.path(), &["arm-6dof", "--steps", "1"]).status.success());
    assert!(folder.path().join("runs/arm-6dof/1").is_dir() && !folder.path().join("runs/tiago-mocap").exists());
}

#[test]
fn what_cannot_be_exported_is_said_before_anything_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = folder.path().join("full");
    std::fs::create_dir(&full).expect("a folder");
    std::fs::write(full.join("thesis.tex"), "mine").expect("written");
    let new = folder.path().join("new");
    let cases: [(&Path, &[&str], &[&str]); 11] = [
        (&full, &["arm-6dof"], &["is not empty and holds no export", "--force"]),
        (&new, &["--steps", "3"], &["name their scenarios", "the page then computes"]),
        (&new, &["--learner", "random"], &["name their scenarios"]),
        (&new, &["arm-6dofx"], &["did you mean `arm-6dof`"]),
        (&new, &["arm-6dof", "arm-6dof"], &["named twice"]),
        (&new, &["arm-6dof", "--learner", "clever"], &["`clever`"]),
        (&new, &["arm-6dof", "--learner", "human"], &["a person chooses", "body-schema serve"]),
        (&new, &["arm-6dof", "--steps", "0"], &["1 to 1000 steps"]),
        (&new, &["tiago-mocap", "--steps", "38"], &["`tiago-mocap`", "--steps 37"]),
        (&new, &["arm-6dof", "--seed", "5..1"], &["write 1..5"]),
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

/// Does something with a folder in a browser of its own, and holds what must always hold: every request is answered from
/// the folder, and the console stays quiet.
async fn in_browser<Visit: Future<Output = ()> + Send + 'static>(
    folder: &TempDir,
    below: &'static str,
    visit: impl FnOnce(Browser, String) -> Visit,
) {
    // One after the other: each draws without a graphics card, with all the processors there are.
    static TURN: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());
    let _turn = TURN.lock().await;
    let Some(browser) = Browser::start(&[]).await else { return };
    let host = Host::start(folder.path(), below).await;
    // In a task of its own, so that the browser is closed whatever becomes of it.
    let outcome = tokio::spawn(visit(browser.clone(), format!("http://{}{below}", host.address))).await;
    let (errors, hosts) = (browser.console().await, browser.hosts().await);
    browser.stop().await;
    if let Err(panic) = outcome {
        eprintln!("errors in the console: {errors:#?}; not found: {:#?}", host.missed());
        std::panic::resume_unwind(panic.into_panic());
    }
    assert_eq!(errors, [""; 0], "errors in the console");
    assert_eq!(host.missed(), [""; 0], "requests that failed");
    assert_eq!(hosts, [host.address.to_string()], "every request goes to this host");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_plays_to_its_end_below_any_address() {
    let folder = exported(&["arm-6dof", "--steps", "60"]);
    let size: u64 = files(folder.path()).iter().map(|(_, size)| size).sum();
    assert!(size < MOST_BYTES, "{size} bytes: {:#?}", files(folder.path()));
    in_browser(&folder, "/demo/", |page, address| async move {
        page.open(&format!("{address}?speed=20&stop=never")).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        page.press(ESCAPE).await;
        page.press(SPACE).await;
        page.wait_for_state("the end", "state.step === '60' && state.latest === '60' && state.phase !== 'playing'")
            .await;
        page.press(LEFT).await;
        page.wait_for_state("one step back", "state.step === '59' && state.latest === '60'").await;
        page.wait_for("the address", "new URLSearchParams(location.search).get('step') === '59'").await;
        let query = page.evaluate("location.search").await;
        let query = query.as_str().expect("text");

        // Whoever gets the address sees the same; why a movement was chosen can be asked.
        page.open(&format!("{address}{query}&tab=why")).await;
        page.wait_for_state("the same step", "state.phase === 'ready' && state.step === '59'").await;
        let asked = "performance.getEntriesByType('resource').some(({ name }) => name.includes('/selections/active/'))";
        page.wait_for("the choice", asked).await;
    })
    .await;
}

/// Asks the engine in the page, as the page does.
async fn asked(page: &Browser, method: &str, path: &str, body: &str) -> Value {
    let script = format!("import(new URL('engine.js', document.baseURI)).then((m) => m.ask('{method}', {path}{body}))");
    page.evaluate_later(&script).await
}

/// Without runs there is the engine: whatever is asked is computed by the visitor, and nothing is asked of the host any more.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_runs_the_visitors_browser_computes() {
    let folder = exported(&[]);
    let size: u64 = files(folder.path()).iter().map(|(_, size)| size).sum();
    assert!(size < MOST_BYTES, "{size} bytes: {:#?}", files(folder.path()));
    assert!(!folder.path().join("runs").exists(), "nothing is recorded");
    in_browser(&folder, "/demo/", |page, address| async move {
        page.open(&format!("{address}?scenario=arm-12dof&seed=4711&learners=active,random&speed=20&stop=never")).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        page.press(ESCAPE).await;
        page.press(SPACE).await;
        page.wait_for_state("twelve steps", "Number(state.latest) >= 12").await;
        page.press(SPACE).await;
        let sessions = asked(&page, "GET", "'/v1/sessions'", "").await;
        let requests = "performance.getEntriesByType('resource').map(({ name }) => name).join(' ')";
        let loaded = page.evaluate(requests).await;
        let session = &sessions["sessions"][0];
        assert_eq!(session["description"]["seed"], 4711);
        let of = |what: &str| format!("'/v1/sessions/{}{what}'", session["id"].as_str().expect("an id"));
        let choice = asked(&page, "GET", &of("/learners/active/selection"), "").await;
        assert!(
            choice["evaluations"].as_u64().is_some_and(|evaluations| evaluations > 100),
            "{}",
            choice["evaluations"]
        );
        let posture = format!(", {{ configuration: {:?} }}", [0.0; 12]);
        let appraised = asked(&page, "POST", &of("/learners/active/evaluations"), &posture).await;
        assert!(appraised["gain"].is_number(), "{appraised}");
        assert_eq!(page.evaluate(requests).await, loaded, "nothing was fetched");

        // Another scenario, whose seed nobody has recorded, by its address alone.
        page.open(&format!("{address}?scenario=head-fov&seed=77")).await;
        page.wait_for_state("another run", "state.phase === 'ready' && state.step === '1'").await;
        let sessions = asked(&page, "GET", "'/v1/sessions'", "").await;
        assert_eq!(sessions["sessions"][0]["description"]["scenario"], "head-fov");
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_address_opens_the_run_that_it_names_or_says_that_there_is_none() {
    let folder = exported(&["arm-6dof", "tiago-mocap", "--learner", "random", "--seed", "3..4", "--steps", "5"]);
    in_browser(&folder, "/", |page, address| async move {
        let words = "document.getElementById('mirror').textContent";
        page.open(&format!("{address}?scenario=tiago-mocap&seed=4&step=5")).await;
        page.wait_for_state("the run", "state.phase === 'ready' && state.step === '5'").await;
        page.wait_for("its name", &format!("{words}.includes('tiago-mocap') && {words}.includes('seed 4')")).await;
        page.open(&format!("{address}?scenario=arm-6dof&seed=99&learners=active,random")).await;
        page.wait_for_state("another run", "state.phase === 'ready' && state.step === '1'").await;
        let said = format!(
            "{words}.includes('seed 3') && {words}.includes('seed=99, learners=active,random is not recorded')"
        );
        page.wait_for("what is not here", &said).await;
    })
    .await;
}
