//! A folder that a browser keeps: its host may go.

use super::{TempDir, export, exported, in_browser};
use crate::browser::{Server, driver::Browser, visits::SPACE};

/// Until the service worker has all files.
async fn is_kept(page: &Browser) {
    let ready = "navigator.serviceWorker.ready.then(({ active }) => active !== null)";
    assert_eq!(page.evaluate_later(ready).await, true);
}

async fn plays(page: &Browser, to: u64) {
    page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
    page.wait_for("the scene", "document.getElementById('cover').hidden").await;
    page.press(SPACE).await;
    page.wait_for_state("some steps", &format!("Number(state.latest) >= {to}")).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_its_host_a_kept_folder_plays_twice_in_a_row() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/some/where/", |page, host| async move {
        let address = host.at("?embed=1&scenario=arm-6dof&seed=1&speed=20");
        page.open(&address).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        is_kept(&page).await;
        host.stop();
        for _ in 0..2 {
            page.open(&address).await;
            plays(&page, 4).await;
        }
        // A newcomer's first look, with its steps.
        page.open(&host.at("")).await;
        page.wait_for_state("motion", "state.phase === 'playing' && Number(state.step) >= 3").await;
        let first = "fetch('first.json.gz').then(({ ok }) => ok, () => false)";
        assert_eq!(page.evaluate_later(first).await, true);
        // What is no file of the folder is not invented.
        let other = page.evaluate_later("fetch('nothing.json').then(() => 'there', () => 'not there')").await;
        assert_eq!(other, "not there");
        // Whether there is another version cannot be asked.
        let errors = page.console().await;
        assert!(errors.iter().all(|error| error.contains("nothing.json") || error.contains("sw.js")), "{errors:?}");
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_export_takes_the_place_of_a_kept_one() {
    another_export_is_seen(exported(&["arm-6dof"])).await;
}

/// A busy machine puts the other version in place when the page has already begun with the one that was kept.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_begins_again_when_another_export_comes_late() {
    let folder = exported(&["arm-6dof"]);
    let file = folder.path().join("offline.js");
    let script = std::fs::read_to_string(&file).expect("a script");
    let hasty = script.replacen("REPLACED_WITHIN = 5000", "REPLACED_WITHIN = 0", 1);
    assert_ne!(script, hasty);
    std::fs::write(&file, hasty).expect("written");
    another_export_is_seen(folder).await;
}

async fn another_export_is_seen(folder: TempDir) {
    let out = folder.path().to_owned();
    in_browser(folder.path(), "/", |page, host| async move {
        page.open(&host.at("?embed=1")).await;
        is_kept(&page).await;
        let caches = "caches.keys().then((names) => names.length)";
        assert_eq!(page.evaluate_later(caches).await, 1);
        assert!(export(&out, &["arm-6dof", "--seed", "8"]).status.success());
        // A visit hears of it, and the next one has it, unless a busy machine is early or late.
        let has_it = "document.getElementById('mirror').textContent.includes('seed 8,')";
        let waits = "navigator.serviceWorker.getRegistration().then(({ waiting }) => waiting !== null)";
        page.open(&host.at("?embed=1")).await;
        page.wait_for_later("another version", &format!("Promise.resolve({has_it} || {waits})")).await;
        page.open(&host.at("?embed=1")).await;
        page.wait_for("seed 8", has_it).await;
        is_kept(&page).await;
        page.wait_for_later("one version alone", "caches.keys().then((names) => names.length === 1)").await;
    })
    .await;
}

/// Whoever kept a folder of an address meets the server that stands there now.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_takes_the_place_of_a_kept_folder() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/", |page, host| async move {
        page.open(&host.at("?embed=1")).await;
        is_kept(&page).await;
        // Away from the page, which may still ask for its icon.
        page.open("about:blank").await;
        host.stop();
        let server = Server::start(host.address).await;
        page.open(&host.at("?embed=1")).await;
        page.wait_for("the server's page", "document.documentElement.dataset.source === undefined").await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        let left =
            "Promise.all([caches.keys(), navigator.serviceWorker.getRegistrations()]).then((all) => all.flat().length)";
        assert_eq!(page.evaluate_later(left).await, 0);
        server.stop().await;
    })
    .await;
}
