//! A folder in a frame of another page, which drives it by messages and hears what happens.

use serde_json::Value;

use super::{exported, in_browser};

/// The page that docs/hosting.md shows, which keeps what it hears.
fn holding() -> String {
    let docs = include_str!("../../docs/hosting.md");
    let snippet = docs.split("```html\n").find(|part| part.contains("postMessage")).expect("a snippet with messages");
    let snippet = snippet.split("```").next().expect("its end");
    let (own, script) = ("https://example.org/demo/", "<script>");
    assert!(snippet.contains(own) && snippet.contains(script), "{snippet}");
    let snippet = snippet.replace(own, "./").replacen(
        script,
        "<script>window.heard = []; addEventListener('message', ({ data }) => heard.push(data));",
        1,
    );
    format!("<!doctype html><meta charset=\"utf-8\"><link rel=\"icon\" href=\"icon.svg\">{snippet}")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_that_holds_a_frame_drives_it_and_hears_of_it() {
    let folder = exported(&[]);
    std::fs::write(folder.path().join("holding.html"), holding()).expect("written");
    in_browser(folder.path(), "/demo/", |page, host| async move {
        let heard = |event: &str| format!("heard.filter(({{ event }}) => event === '{event}')");
        page.open(&host.at("holding.html")).await;
        page.wait_for("a page that is ready", &format!("{}.length === 1", heard("ready"))).await;
        let ready: Value = page.evaluate(&format!("{}[0]", heard("ready"))).await;
        assert_eq!((&ready["type"], &ready["version"], &ready["step"]), (&"body-schema".into(), &1.into(), &1.into()));
        assert!(ready["scenarios"].as_array().is_some_and(|names| names.contains(&"head-fov".into())), "{ready}");
        assert!(ready["errors"][0]["location_m"].as_f64() > Some(0.0), "{ready}");

        let tell = async |message: &str| {
            let script = format!("document.querySelector('iframe').contentWindow.postMessage({message}, '*')");
            page.run(&script).await;
        };
        // What the page of the documentation does.
        page.wait_for("its seed", &format!("{}.some(({{ seed }}) => seed === 7)", heard("step"))).await;
        let shown = "document.getElementById('step').textContent === 'step 1'";
        page.wait_for("its words", shown).await;

        // One step, which is answered and told.
        let before: Value = page.evaluate(&format!("{}.length", heard("step"))).await;
        tell("{ type: 'body-schema', command: 'step', id: 'one' }").await;
        page.wait_for("the answer", &format!("{}.some(({{ id }}) => id === 'one')", heard("done"))).await;
        page.wait_for("the step", &format!("{}.length > {before}", heard("step"))).await;

        // Another seed, another scenario with a seed.
        tell("{ type: 'body-schema', command: 'seed', seed: 4711 }").await;
        page.wait_for("that seed", &format!("{}.some(({{ seed }}) => seed === 4711)", heard("step"))).await;
        tell("{ type: 'body-schema', command: 'scenario', scenario: 'positioner', seed: 2 }").await;
        let is_there = "({ scenario, seed }) => scenario === 'positioner' && seed === 2";
        page.wait_for("that scenario", &format!("{}.some({is_there})", heard("step"))).await;

        // It plays, and stops when it is told to.
        tell("{ type: 'body-schema', command: 'play' }").await;
        page.wait_for("it plays", &format!("{}.some(({{ phase }}) => phase === 'playing')", heard("step"))).await;
        tell("{ type: 'body-schema', command: 'pause' }").await;
        tell("{ type: 'body-schema', command: 'state', id: 2 }").await;
        page.wait_for("the state", &format!("{}.some(({{ id }}) => id === 2)", heard("state"))).await;

        // What is wrong is said.
        for (message, why) in [
            ("{ type: 'body-schema', command: 'dance' }", "there is no command “dance”"),
            ("{ type: 'body-schema', command: 'seed', seed: -1 }", "must be a whole number"),
            ("{ type: 'body-schema', command: 'scenario', scenario: 'arm' }", "there is no scenario “arm”"),
            ("{ type: 'body-schema', version: 2, command: 'play' }", "version 2 is unknown"),
        ] {
            tell(message).await;
            page.wait_for(why, &format!("{}.some(({{ why }}) => why.includes('{why}'))", heard("refused"))).await;
        }
        // What is not for it is nothing to it.
        tell("'anything'").await;
        tell("{ type: 'other', command: 'dance' }").await;
        let refused: Value = page.evaluate(&format!("{}.length", heard("refused"))).await;
        assert_eq!(refused, 4);

        // A run that ends by itself says so.
        tell("{ type: 'body-schema', command: 'play' }").await;
        page.wait_for("the end", &format!("{}.length === 1", heard("end"))).await;
        let end: Value = page.evaluate(&format!("{}[0]", heard("end"))).await;
        assert!(end["why"].as_str().is_some_and(|why| !why.is_empty()) && end["scenario"] == "positioner", "{end}");
    })
    .await;
}
