//! The page of a visitor's own robot: files dropped on it become a calibration, in a real browser, and nothing leaves the machine.
//!
//! Without Chromium and chromedriver this is skipped, unless the environment has `CI` or `BODY_SCHEMA_REQUIRE_BROWSER=1`.

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    browser::driver::Browser,
    calibrate::certificate::verified,
    export::{exported, host::Host},
};

/// A host of an export below a path, and a page that has loaded all that it ever loads.
async fn loaded() -> Option<(TempDir, Host, Browser)> {
    let page = Browser::start(&[]).await?;
    let folder = exported(&[]);
    let host = Host::start(folder.path(), "/demo/");
    page.open(&host.at("calibrate.html")).await;
    page.wait_for("the engine and the viewer", "document.body.dataset.state === 'ready'").await;
    Some((folder, host, page))
}

/// All that was fetched so far.
const FETCHED: &str = "performance.getEntriesByType('resource').map(({ name }) => name).join(' ')";

const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";

fn scenario_file(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(name)).expect(name)
}

/// Drops files on the page.
async fn drop_files(page: &Browser, files: &[(&str, &str)]) {
    let files = Value::from_iter(files.iter().map(|(name, text)| (name.to_string(), Value::from(*text))));
    let script = format!(
        "const transfer = new DataTransfer();
         for (const [name, text] of Object.entries({files})) transfer.items.add(new File([text], name));
         document.dispatchEvent(new DragEvent('drop', {{ dataTransfer: transfer, bubbles: true, cancelable: true }}));"
    );
    page.run(&script).await;
}

/// The text of a file that the page offers, as it is saved.
async fn saved(page: &Browser, name: &str) -> String {
    page.run(&format!(
        "HTMLAnchorElement.prototype.click = () => {{}};
         const address = URL.createObjectURL;
         URL.createObjectURL = (blob) => {{ window.saved = blob; return address.call(URL, blob); }};
         [...document.querySelectorAll('#downloads button')].find((button) => button.textContent.endsWith('{name}')).click();
         URL.createObjectURL = address;"
    ))
    .await;
    page.evaluate_later("window.saved.text()").await.as_str().expect("a text").to_owned()
}

const COMPUTED: &str = "!document.getElementById('outcome').hidden && document.getElementById('progress').hidden && \
     document.getElementById('said').textContent !== ''";

async fn text(page: &Browser, id: &str) -> String {
    let text = page.evaluate(&format!("document.getElementById('{id}').innerText")).await;
    text.as_str().unwrap_or_default().to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_shipped_robot_and_a_dropped_one_are_calibrated_without_a_request() {
    let Some((_folder, host, page)) = loaded().await else { return };
    let before = page.evaluate(FETCHED).await;
    page.run(
        "document.getElementById('example').value = 'panda-sockets'; document.getElementById('open-example').click();",
    )
    .await;
    page.wait_for("what was read", "document.getElementById('read').textContent.includes('497 rows')").await;
    page.run("document.getElementById('calibrate').click();").await;
    page.wait_for("the Panda's calibration", COMPUTED).await;
    let said = text(&page, "said").await;
    // The figures of `body-schema calibrate panda-sockets`.
    assert!(said.contains("calibrated.urdf: yes") && said.contains("0.34 mm"), "{said}");
    let report = text(&page, "report").await;
    assert!(report.contains("panda_joint7"), "{report}");
    for name in ["calibrated.urdf", "kinematics.yaml", "report.html", "calibration.rrd"] {
        assert!(text(&page, "downloads").await.contains(name), "{name}");
    }
    // The program finds anew what the page certifies.
    let certificate = saved(&page, "certificate.json").await;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("certificate.json");
    std::fs::write(&file, &certificate).expect("written");
    let (code, found) = verified(&file, "panda-sockets");
    assert!(code == 0, "{found}");
    assert!(saved(&page, "certificate.html").await.contains("0.34"));

    // Files of one's own: what was guessed can be said otherwise.
    // Not the description that ships, whose meshes do, too.
    let urdf = scenario_file("ur10.urdf").replacen("<robot", "<!-- mine --><robot", 1);
    let table = scenario_file("ur10-camera.csv");
    // A folder has other JSON, too, and meshes.
    let dropped = [("mine.urdf", &*urdf), ("mine.csv", &table), ("package.json", "{}"), ("base.stl", STL)];
    drop_files(&page, &dropped).await;
    page.wait_for("what was guessed", "document.getElementById('read').textContent.includes('23 rows')").await;
    assert!(text(&page, "guesses").await.contains("base: `world`"), "{}", text(&page, "guesses").await);
    // Radians taken for degrees are doubtful, and can be taken back.
    for (unit, doubts) in [("deg", "> 0"), ("", "=== 0")] {
        page.run(&format!(
            "const angles = document.getElementById('form').elements.angles; angles.value = '{unit}';
             angles.dispatchEvent(new Event('change', {{ bubbles: true }}));"
        ))
        .await;
        let is_read = "document.getElementById('read').textContent.includes('23 rows')";
        let found = format!("document.getElementById('doubts').children.length {doubts} && {is_read}");
        page.wait_for("doubts", &found).await;
    }
    page.run(
        "const base = document.getElementById('form').elements.base; base.value = 'base_link';
         base.dispatchEvent(new Event('change', { bubbles: true }));",
    )
    .await;
    page.wait_for("another base", "document.getElementById('text').value.includes('base = \"base_link\"')").await;
    page.wait_for("what was read", "document.getElementById('read').textContent.includes('23 rows')").await;
    page.run("document.getElementById('calibrate').click();").await;
    page.wait_for("progress", "/ of /.test(document.getElementById('progress').innerText)").await;
    // At once, whatever is being computed.
    page.run("document.getElementById('cancel').click();").await;
    page.wait_for("an end", "document.getElementById('progress').hidden").await;
    assert!(text(&page, "failure").await.contains("Stopped"));
    let stopped = page.evaluate(FETCHED).await;
    page.run("document.getElementById('calibrate').click();").await;
    page.wait_for("the calibration of the dropped robot", COMPUTED).await;
    assert!(text(&page, "said").await.contains("calibrated.urdf"));
    assert!(text(&page, "list").await.contains("1 mesh, "), "{}", text(&page, "list").await);
    let caption = text(&page, "scene").await;
    let missing = "Capsules stand for links whose meshes are not here (";
    assert!(caption.contains(missing) && !caption.contains("base.stl"), "{caption}");

    // A worker that was stopped is begun anew, by its scripts; nothing else was fetched.
    let fetched = |found: &Value| found.as_str().unwrap_or_default().split(' ').map(str::to_owned).collect::<Vec<_>>();
    let known = fetched(&before);
    assert_eq!(stopped, before);
    for address in fetched(&page.evaluate(FETCHED).await) {
        assert!(known.contains(&address) || address.contains(".js"), "{address} was fetched");
    }
    assert!(host.missed().is_empty(), "{:?}", host.missed());
    assert_eq!(page.hosts().await, [host.address.to_string()]);
    page.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_description_alone_tells_which_postures_to_measure() {
    let Some((_folder, _host, page)) = loaded().await else { return };
    drop_files(&page, &[("notes.md", "no robot")]).await;
    page.wait_for("what is wrong", "document.getElementById('problem').textContent.includes('no URDF')").await;
    drop_files(&page, &[("mine.urdf", &scenario_file("ur10.urdf"))]).await;
    page.wait_for("a plan", "!document.getElementById('work').hidden").await;
    assert!(text(&page, "read").await.contains("Nothing is measured yet"));
    page.run("document.getElementById('postures').value = 6; document.getElementById('observe').click();").await;
    page.wait_for("postures", COMPUTED).await;
    let rows = page.evaluate("document.querySelector('#report table').rows.length").await;
    assert_eq!(rows, 7);
    assert!(text(&page, "downloads").await.contains("mine.csv"));
    page.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_wrong_in_a_file_is_said_beside_it() {
    let Some((_folder, _host, page)) = loaded().await else { return };
    // The first joint in degrees, which no title says.
    let in_degrees = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[6] = cells[6].parse::<f64>().map_or_else(|_| cells[6].clone(), |rad| rad.to_degrees().to_string());
        cells.join(",")
    };
    let table = scenario_file("ur10-camera.csv").lines().map(in_degrees).collect::<Vec<_>>().join("\n");
    drop_files(&page, &[("mine.urdf", &scenario_file("ur10.urdf")), ("mine.csv", &table)]).await;
    page.wait_for("a doubt", "document.getElementById('doubts').textContent.includes('shoulder_pan_joint')").await;
    // Another base than there is.
    page.run(
        "const text = document.getElementById('text'); text.value = text.value.replace('base = \"world\"', 'base = \"moon\"');
         text.dispatchEvent(new Event('input', { bubbles: true }));",
    )
    .await;
    page.wait_for("what is wrong", "document.getElementById('problem').textContent.includes('moon')").await;
    page.wait_for("no calibration", "document.getElementById('work').hidden").await;
    page.stop().await;
}

/// Titles that say nothing: what the columns hold is said in the form, and the table with better titles can be taken away.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn columns_are_told_in_the_form() {
    let Some((_folder, _host, page)) = loaded().await else { return };
    let own = scenario_file("ur10-camera.csv");
    // The last joint and a number that nobody needs.
    let table = own.replacen("wrist_3_joint", "J6", 1);
    assert_ne!(own, table);
    drop_files(&page, &[("mine.urdf", &scenario_file("ur10.urdf")), ("mine.csv", &table)]).await;
    page.wait_for("what is missing", "document.getElementById('guesses').textContent.includes('passed over: J6')")
        .await;
    page.wait_for("what was read", "document.getElementById('read').textContent.includes('23 rows of 5 joints')").await;
    let column =
        "[...document.querySelectorAll('#columns label')].find((label) => label.firstChild.textContent === 'J6')";
    let said = page.evaluate(&format!("{column}.querySelector('select').selectedOptions[0].textContent")).await;
    assert_eq!(said, "what its title says: nothing");
    page.run(&format!(
        "const select = {column}.querySelector('select');
         select.value = JSON.stringify('wrist_3_joint');
         select.dispatchEvent(new Event('change', {{ bubbles: true }}));"
    ))
    .await;
    page.wait_for("all joints", "document.getElementById('read').textContent.includes('23 rows of 6 joints')").await;
    let text = text(&page, "guesses").await;
    assert!(text.contains("wrist_3_joint") && !text.contains("J6"), "{text}");
    page.run("document.getElementById('calibrate').click();").await;
    page.wait_for("the calibration", COMPUTED).await;
    let offered = "[...document.querySelectorAll('#downloads button')].map((button) => button.textContent).join(', ')";
    let offered = page.evaluate(offered).await;
    assert!(offered.as_str().is_some_and(|offered| offered.contains("Download mine.csv")), "{offered}");
    page.stop().await;
}

/// A robot that branches: which link carries the eye and which the tag is said in the form.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn links_of_cameras_and_targets_are_told_in_the_form() {
    let Some((_folder, _host, page)) = loaded().await else { return };
    let urdf = r#"<robot name="r">
        <link name="base"/><link name="head"/><link name="arm"/><link name="hand"/><link name="left"/>
        <joint name="pan" type="revolute"><parent link="base"/><child link="head"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint>
        <joint name="a" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
        <joint name="b" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
        <joint name="c" type="revolute"><parent link="base"/><child link="left"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
        </robot>"#;
    let corners: Vec<String> = (1..=4).map(|k| format!("eye_tag_u{k},eye_tag_v{k}")).collect();
    let row = |k: f64| format!("{k},{k},{k},{}\n", ["100,200"; 4].join(","));
    let table =
        format!("pan,a,b,{}\n{}", corners.join(","), (0..6).map(|k| row(0.1 * f64::from(k))).collect::<String>());
    drop_files(&page, &[("mine.urdf", urdf), ("mine.csv", &table)]).await;
    page.wait_for("the links", "!document.getElementById('carriers').hidden").await;
    let names =
        "[...document.querySelectorAll('#carriers label')].map((label) => label.firstChild.textContent).join(';')";
    assert_eq!(page.evaluate(names).await, "Link that carries tag ;Link that carries eye ");
    page.run(
        "const select = document.querySelector('#carriers [name=\"on:eye\"]');
         select.value = 'head';
         select.dispatchEvent(new Event('change', { bubbles: true }));",
    )
    .await;
    let said = "document.getElementById('guesses').textContent.includes('target `tag1`: on link `hand`')";
    page.wait_for("where the tag is then", said).await;
    page.wait_for("its side is asked for", "!document.querySelector('[data-for=tag_side]').hidden").await;
    page.run(
        "const side = document.querySelector('[name=tag_side]');
         side.value = '40';
         side.dispatchEvent(new Event('change', { bubbles: true }));",
    )
    .await;
    page.wait_for("a tag", "document.getElementById('guesses').textContent.includes('a square tag in a picture')")
        .await;
    let written = page.evaluate("document.getElementById('text').value").await;
    let written = written.as_str().unwrap_or_default();
    assert!(written.contains("link = \"head\"") && written.contains("[-0.02, 0.02, 0.0]"), "{written}");
    page.wait_for("what was read", "document.getElementById('read').textContent.includes('6 rows of 3 joints')").await;
    page.stop().await;
}

/// A table of two joints and a point on the second link, with a quarter of a millimetre of play between rows; from row `since` on the
/// first joint's readings are off by a degree.
fn two_joints(rows: u32, since: u32) -> String {
    let mut csv = "turn_deg,lift_deg,tip_x_mm,tip_y_mm,tip_z_mm\n".to_owned();
    for row in 0..rows {
        let (turn, lift) = (f64::from(row * 37 % 140) - 70.0, f64::from(row * 53 % 110) - 55.0);
        let play = |shift: u32| 0.25 * (f64::from((row * 29 + shift) % 11) / 5.0 - 1.0);
        let (a, b) = (turn.to_radians(), lift.to_radians());
        let out = 100.0 + 300.0 * b.cos();
        let [x, y, z] = [out * a.cos() - 20.0 * a.sin(), out * a.sin() + 20.0 * a.cos(), 200.0 - 300.0 * b.sin()];
        let read = if row >= since { turn + 1.0 } else { turn };
        csv += &format!("{read},{lift},{},{},{}\n", x + play(0), y + play(4), z + play(7));
    }
    csv
}

/// Rows of a later day name the joint whose readings are off, and how it is mended.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn later_days_are_held_against_the_robot() {
    let Some((_folder, _host, page)) = loaded().await else { return };
    let urdf = r#"<robot name="r"><link name="base"/><link name="post"/><link name="arm"/>
        <joint name="turn" type="revolute"><parent link="base"/><child link="post"/><axis xyz="0 0 1"/><limit lower="-2" upper="2"/></joint>
        <joint name="lift" type="revolute"><parent link="post"/><child link="arm"/><origin xyz="0.1 0 0.2"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2"/></joint></robot>"#;
    drop_files(&page, &[("mine.urdf", urdf), ("mine.csv", &two_joints(60, 60))]).await;
    page.wait_for("a calibration file", "!document.getElementById('work').hidden").await;
    assert_eq!(page.evaluate("document.getElementById('later').hidden").await, true, "nothing is calibrated yet");
    page.run("document.getElementById('calibrate').click();").await;
    page.wait_for("a calibration", "!document.getElementById('later').hidden").await;
    page.wait_for("its end", "!document.getElementById('choose-later').disabled").await;
    let choose = |name: &str, table: &str| {
        let (name, table) = (serde_json::json!(name), serde_json::json!(table));
        format!(
            "const held = new DataTransfer();
             held.items.add(new File([{table}], {name}));
             const input = document.getElementById('later-input');
             input.files = held.files;
             input.dispatchEvent(new Event('change'));"
        )
    };
    // A table of the same name as that which was learned from.
    page.run(&choose("mine.csv", &two_joints(40, 12))).await;
    page.wait_for("what changed", "document.getElementById('watched').querySelector('svg') !== null").await;
    let told = text(&page, "watched").await;
    assert!(told.contains("has changed") && told.contains("turn") && told.contains("movement 3"), "{told}");
    assert!(told.contains("Download watch.json"), "{told}");
    page.run(&choose("other.csv", "turn_deg,lift_deg\n1,2\n")).await;
    page.wait_for("a refusal", "!document.getElementById('unwatched').hidden").await;
    let said = text(&page, "unwatched").await;
    assert!(said.contains("tip_x"), "{said}");
    page.wait_for("its end", "!document.getElementById('choose-later').disabled").await;
    // A column that zeros may drift with is looked for in it.
    page.run("document.getElementById('covariate').value = 'warmth';").await;
    page.run(&choose("quiet.csv", &two_joints(30, 30))).await;
    page.wait_for("a refusal", "document.getElementById('unwatched').textContent.includes('warmth')").await;
    page.wait_for("its end", "!document.getElementById('choose-later').disabled").await;
    page.run("document.getElementById('covariate').value = '';").await;
    page.run(&choose("quiet.csv", &two_joints(30, 30))).await;
    page.wait_for("an answer", "document.getElementById('watched').textContent.includes('is as calibrated')").await;
    assert_eq!(page.evaluate("document.getElementById('unwatched').hidden").await, true);
    page.stop().await;
}

/// A person is the robot: movements come one by one, what was seen is told, all of it survives a reload, and it becomes a calibration.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_person_moves_the_robot() {
    let Some((_folder, host, page)) = loaded().await else { return };
    drop_files(&page, &[("mine.urdf", &scenario_file("ur10.urdf"))]).await;
    page.wait_for("a plan", "!document.getElementById('work').hidden").await;
    page.run("document.getElementById('dialogue').click();").await;
    page.wait_for("a movement", "document.getElementById('posture').querySelectorAll('tbody tr').length === 6").await;
    // Nothing to calibrate by yet, whatever is pressed.
    page.run("document.getElementById('skip').click();").await;
    page.wait_for("an end", "!document.getElementById('skip').disabled").await;
    assert_eq!(page.evaluate("document.getElementById('finish').disabled").await, true);
    // A joint that is not written is not 0.
    page.run("document.querySelector('#true-posture input').value = ''; document.getElementById('nothing').click();")
        .await;
    page.wait_for("a refusal", "document.getElementById('refused').textContent.includes('is no number')").await;
    page.run("document.getElementById('skip').click();").await;
    page.wait_for("another movement", "document.getElementById('refused').hidden").await;
    page.wait_for("its form", "document.querySelector('#true-posture input').value !== ''").await;
    page.wait_for("an end", "!document.getElementById('skip').disabled").await;
    let stands = |count: u64| format!("document.getElementById('stand').textContent.startsWith('{count} observation')");
    // By the fields, by a line, and nothing.
    page.run(
        "[...document.querySelectorAll('#readings input')].forEach((input, index) => (input.value = [0.6, 0.1, 0.8][index]));
         document.getElementById('seen').requestSubmit();",
    )
    .await;
    page.wait_for("one observation", &stands(1)).await;
    page.wait_for("the next movement", "!document.getElementById('finish').disabled").await;
    page.run(
        "document.getElementById('seen').elements.line.value = '[0.55, 0.2; 0.7]'; document.getElementById('seen').requestSubmit();",
    )
    .await;
    page.wait_for("two observations", &stands(2)).await;
    page.wait_for("the next movement", "!document.getElementById('finish').disabled").await;
    page.run(
        "document.getElementById('seen').elements.line.value = '1 2'; document.getElementById('seen').requestSubmit();",
    )
    .await;
    page.wait_for("a refusal", "document.getElementById('refused').textContent.includes('The line has 2 numbers')")
        .await;
    page.run("document.getElementById('infeasible').click();").await;
    page.wait_for("another movement", "document.getElementById('refused').hidden").await;
    page.wait_for("the next movement", "!document.getElementById('finish').disabled").await;

    page.open(&host.at("calibrate.html")).await;
    page.wait_for("what was kept", &stands(2)).await;
    // What another tab was told since is not written over.
    page.run(
        "globalThis.mine = localStorage.getItem('body-schema.session'); localStorage.setItem('body-schema.session', `${mine} `);
         document.getElementById('nothing').click();",
    )
    .await;
    page.wait_for("a refusal", "document.getElementById('refused').textContent.includes('in another tab')").await;
    page.run("localStorage.setItem('body-schema.session', mine);").await;
    let kept = page.evaluate("localStorage.getItem('body-schema.session')").await;
    let session: Value = serde_json::from_str(kept.as_str().expect("a session")).expect("JSON");
    assert!(session["events"].as_array().is_some_and(|events| events.len() >= 5), "{session}");
    page.run("document.getElementById('finish').click();").await;
    page.wait_for("a calibration file", "document.getElementById('text').value.includes('observations.csv')").await;
    // Where the browser keeps nothing, it is said, and the robot is asked for the next movement all the same.
    drop_files(&page, &[("session.json", kept.as_str().expect("a session"))]).await;
    page.wait_for("the session again", "!document.getElementById('measure').hidden").await;
    page.run("Storage.prototype.setItem = () => { throw new Error('full'); };").await;
    page.wait_for("what can be pressed", "!document.getElementById('skip').disabled").await;
    page.run("document.getElementById('skip').click();").await;
    page.wait_for("a word", "!document.getElementById('unkept').hidden").await;
    page.wait_for("the next movement", "!document.getElementById('skip').disabled").await;
    // What Python and the server write is read here.
    page.run("document.getElementById('forget').click();").await;
    drop_files(&page, &[("session.json", kept.as_str().expect("a session"))]).await;
    page.wait_for("the same session", &stands(2)).await;
    page.stop().await;
}
