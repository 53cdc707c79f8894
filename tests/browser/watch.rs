//! The page of a watch: it follows by itself, and says when nobody answers.

use std::process::Stdio;

use crate::{
    browser::{axe::serious_findings, driver::Browser},
    cli::watch::{Files, Running, ask},
};

async fn says(page: &Browser, words: &str) {
    page.wait_for(words, &format!("document.querySelector('main').innerText.includes('{words}')")).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_watch_has_a_page_that_follows_it() {
    let Some(page) = Browser::start(&[]).await else { return };
    let files = Files::new();
    let rows = Files::rows(1.5);
    let table = files.write("growing.csv", &rows[..10]);
    let (running, address) = Running::following(&table, &[], Stdio::inherit());
    page.open(&format!("http://{address}/")).await;
    says(&page, "It is as it was calibrated").await;
    says(&page, "9 sightings").await;
    assert_eq!(page.evaluate("document.querySelectorAll('main svg').length").await, 1, "the evidence is drawn");
    assert_eq!(serious_findings(&page).await, Vec::<String>::new());

    let (code, answer) = ask(&address, "POST /sightings", &format!("{}\n{}\n", rows[0], rows[10..].join("\n")));
    assert!(code.contains("200"), "{code} {answer}");
    says(&page, "A change stands: the zero of arm_1_joint has moved by").await;
    for words in ["What has changed", "movement 3", "its size will be known to", "found soon from", "What was told"] {
        says(&page, words).await;
    }
    page.wait_for("its title", "document.title === '⚠ tiago-mocap has changed'").await;
    assert_eq!(page.evaluate("document.getElementById('away').hidden").await, true);
    assert_eq!(serious_findings(&page).await, Vec::<String>::new());
    let console = page.console().await;
    assert!(console.is_empty(), "{console:#?}");
    assert_eq!(page.hosts().await, [address]);

    drop(running);
    page.wait_for("that nobody answers", "!document.getElementById('away').hidden").await;
    says(&page, "A change stands").await;
    page.stop().await;
}
