//! What visitors of a folder do: they play, ask why, and play the game.

use std::time::Duration;

use serde_json::Value;

use super::{exported, in_browser, own_scenario};
use crate::browser::{
    driver::Browser,
    pointer::reads,
    visits::{ESCAPE, LEFT, SPACE},
};

/// Asks the engine in the page, as the page does.
async fn asked(page: &Browser, method: &str, path: &str, body: &str) -> Value {
    let script = format!("import(new URL('engine.js', document.baseURI)).then((m) => m.ask('{method}', {path}{body}))");
    page.evaluate_later(&script).await
}

/// Whatever is asked is computed by the visitor, and nothing is asked of the host any more.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_visitors_browser_computes() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        page.open(&host.at("?scenario=arm-12dof&seed=4711&learners=active,random&speed=20&stop=never")).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        page.evaluate_later("navigator.serviceWorker.ready.then(() => true)").await;
        page.press(ESCAPE).await;
        page.press(SPACE).await;
        page.wait_for_state("twelve steps", "Number(state.latest) >= 12").await;
        page.press(SPACE).await;
        page.wait_for_state("the pause", "state.phase === 'ready'").await;
        page.press(LEFT).await;
        page.wait_for_state("one step back", "Number(state.step) === Number(state.latest) - 1").await;
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

        // Another scenario, whose seed nobody has recorded, by its address alone; and why its movement was chosen.
        page.screen(1280, 2400, false).await;
        page.open(&host.at("?scenario=head-fov&seed=77&step=3&tab=why")).await;
        page.wait_for_state("another run", "state.phase === 'ready' && state.step === '3'").await;
        reads(&page, "chose movement 3").await;
        let sessions = asked(&page, "GET", "'/v1/sessions'", "").await;
        assert_eq!(sessions["sessions"][0]["description"]["scenario"], "head-fov");
    })
    .await;
}

/// A folder opens with what it was exported with, a scenario of one's own among it, and an address goes before that.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_opens_with_what_it_was_exported_with() {
    let own = tempfile::tempdir().expect("a folder");
    let file = own_scenario(own.path(), "mine");
    let folder = exported(&[&file, "--seed", "3", "--learner", "random", "--steps", "4"]);
    in_browser(folder.path(), "/", |page, host| async move {
        let words = "document.getElementById('mirror').textContent";
        page.open(&host.at("?embed=1&speed=20")).await;
        page.wait_for_state("step 1", "state.phase === 'ready' && state.step === '1'").await;
        page.wait_for("its name", &format!("{words}.includes('mine, seed 3,')")).await;
        page.press(SPACE).await;
        page.wait_for_state("its end", "state.phase === 'stopped' && state.latest === '4'").await;
        let sessions = asked(&page, "GET", "'/v1/sessions'", "").await;
        let learners = &sessions["sessions"][0]["description"]["learners"];
        assert_eq!((learners.as_array().map(Vec::len), &learners[0]["name"]), (Some(1), &Value::from("random")));
        let scenarios = asked(&page, "GET", "'/v1/scenarios'", "").await;
        let names = scenarios["scenarios"].as_array().expect("scenarios").iter().map(|one| one["name"].clone());
        let names: Vec<Value> = names.collect();
        assert!(names[0] == "mine" && names.contains(&Value::from("positioner")), "{names:?}");

        page.open(&host.at("?scenario=arm-6dof&seed=5")).await;
        page.wait_for("what the address asks for", &format!("{words}.includes('arm-6dof, seed 5,')")).await;
    })
    .await;
}

/// Sets the sliders of the game to the best of some postures, as a visitor would who tries many before each movement.
const TRIES: &str = "(async () => {
    const { ask } = await import(new URL('engine.js', document.baseURI));
    const { sessions: [{ id, description }] } = await ask('GET', '/v1/sessions');
    let draw = Number(document.getElementById('mirror').dataset.latest) + 1;
    const chance = () => (draw = (draw * 16807) % 2147483647) / 2147483647;
    let best = { gain: -Infinity };
    for (let tried = 0; tried < 80; tried++) {
        const configuration = description.joints.map(({ limits: [low, high] }) => low + chance() * (high - low));
        const { gain } = await ask('POST', `/v1/sessions/${id}/learners/human/evaluations`, { configuration });
        if (gain > best.gain) best = { gain, configuration };
    }
    const sliders = [...document.querySelectorAll('#controls input[type=range]')];
    description.joints.forEach(({ name }, joint) => {
        const slider = sliders.find((one) => one.getAttribute('aria-label') === name.replaceAll('_', ' '));
        slider.value = String(Math.round(best.configuration[joint] * 180 / Math.PI));
        slider.dispatchEvent(new Event('input', { bubbles: true }));
    });
    return 'set';
})()";

/// A game is won: the visitor ends it with a smaller error than another learner.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_game_is_played_to_its_end_and_won() {
    let folder = exported(&[]);
    in_browser(folder.path(), "/demo/", |page, host| async move {
        page.open(&host.at("?scenario=arm-6dof&seed=5&play=human")).await;
        page.wait_for_state("the game", "state.phase === 'ready' && state.step === '0'").await;
        page.wait_for("the scene", "document.getElementById('cover').hidden").await;
        page.press(ESCAPE).await;
        for movement in 1..=10 {
            reads(&page, &format!("movement {movement} of 10")).await;
            assert_eq!(page.evaluate_later(TRIES).await, "set");
            // Postures are asked about once sliders rest.
            tokio::time::sleep(Duration::from_secs(1)).await;
            reads(&page, "Your posture teaches").await;
            page.press('s').await;
            page.wait_for_state("a movement", &format!("state.phase === 'ready' && state.latest === '{movement}'"))
                .await;
        }
        reads(&page, "You beat active").await;
    })
    .await;
}

/// Where a browser lacks what the engine needs, that is said.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_browser_lacks_is_said() {
    let folder = exported(&[]);
    let file = format!("file://{}/index.html", folder.path().display());
    in_browser(folder.path(), "/", |page, host| async move {
        let lacks = [
            ("WebAssembly.validate = () => false;", "this browser knows no SIMD in WebAssembly"),
            ("window.Worker = class { terminate() {} };", "this browser knows no module workers"),
        ];
        for (before, said) in lacks {
            let script = page.before_scripts(before).await;
            page.open(&host.at("?scenario=arm-6dof")).await;
            page.wait_for(said, &format!("document.getElementById('mirror').textContent.includes('{said}')")).await;
            page.wait_for_state("no run", "state.phase === 'failed'").await;
            page.without(&script).await;
        }
        // Its console says so, too.
        page.open(&file).await;
        page.wait_for("a sentence", "document.body.innerText.includes('python3 -m http.server')").await;
        page.wait_for_state("no run", "state.phase === 'failed'").await;
        let errors = page.console().await;
        assert!(errors.iter().all(|error| error.contains("file://")), "{errors:?}");
    })
    .await;
}
