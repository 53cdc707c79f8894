//! What a visitor's files come to.

use std::{
    collections::BTreeMap,
    sync::atomic::{AtomicU64, Ordering},
};

use body_schema_calibration::{Progress, Silent};
use serde_json::{Value, json};

use super::{Meshes, Workbench, Worked};

fn worked(bench: &mut Workbench, files: &Value, ask: &Value) -> Worked {
    bench.work(json!({ "files": files, "ask": ask }).to_string().as_bytes(), &Meshes::new(), &Silent)
}

/// The answer, which is one.
fn asked(files: &Value, ask: &Value) -> Value {
    let worked = worked(&mut Workbench::default(), files, ask);
    let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
    assert_eq!(worked.answer.status, 200, "{body}");
    body
}

/// Why there is none: the field to blame, and the detail.
fn refused(files: &Value, ask: &Value) -> (String, String) {
    let worked = worked(&mut Workbench::default(), files, ask);
    let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
    assert!((400..500).contains(&worked.answer.status) && worked.recording.is_none(), "{body}");
    let text = |key: &str| body[key].as_str().unwrap_or_default().to_owned();
    (text("field"), text("detail"))
}

fn panda() -> (Value, String, String) {
    let example = asked(&json!({}), &json!({ "example": { "name": "panda-sockets" } }));
    let text = |key: &str| example[key].as_str().expect("text").to_owned();
    (example["files"].clone(), text("file"), text("text"))
}

#[derive(Default)]
struct Counted {
    steps: AtomicU64,
    ticks: AtomicU64,
}

impl Progress for Counted {
    fn stage(&self, _what: &str, steps: u64) {
        self.steps.fetch_add(steps, Ordering::Relaxed);
    }

    fn tick(&self) {
        self.ticks.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn a_shipped_robot_is_calibrated_as_by_the_command() {
    let (files, file, text) = panda();
    let read = asked(&files, &json!({ "read": { "file": file, "text": text } }));
    assert_eq!((read["rows"].as_u64(), read["held_out"].as_u64()), (Some(497), Some(437)), "{read}");
    let ask = json!({ "file": file, "text": text, "software": "body-schema 0 (commit abc)" });
    let request = json!({ "files": files, "ask": { "calibrate": ask } }).to_string();
    let counted = Counted::default();
    let worked = Workbench::default().work(request.as_bytes(), &Meshes::new(), &counted);
    let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
    assert_eq!(worked.answer.status, 200, "{body}");
    // As `body-schema calibrate panda-sockets` tells.
    assert!(body["said"].as_str().expect("said").starts_with("use calibrated.urdf: yes"), "{body}");
    let file = |path: &str| body["files"].as_array()?.iter().find(|file| file["path"] == path)?["text"].as_str();
    let report: Value = serde_json::from_str(file("report.json").expect("a report")).expect("JSON");
    let certificate = file("certificate.json").expect("a certificate");
    assert!(certificate.contains("\"body-schema 0 (commit abc), on a page\""), "{certificate}");
    let mean_mm = report["held_out"]["after"]["mean_mm"].as_f64().expect("a mean");
    assert!((0.3..0.45).contains(&mean_mm), "{mean_mm}");
    let paths: Vec<&str> =
        body["files"].as_array().expect("files").iter().filter_map(|file| file["path"].as_str()).collect();
    for path in ["calibrated.urdf", "kinematics.yaml", "report.json", "report.html", "report.md"] {
        assert!(paths.contains(&path), "{paths:?}");
    }
    assert!(worked.recording.is_some_and(|bytes| bytes.starts_with(b"RRF2")), "no recording");
    let (steps, ticks) = (counted.steps.into_inner(), counted.ticks.into_inner());
    assert!(ticks > 0 && ticks <= steps, "{ticks} of {steps}");
}

#[test]
fn dropped_files_become_a_calibration() {
    let example = asked(&json!({}), &json!({ "example": { "name": "ur10-camera" } }));
    let files = &example["files"];
    let described = asked(files, &json!({ "describe": { "urdf": "ur10.urdf" } }));
    assert_eq!(described["roots"], json!(["world"]));
    assert_eq!(described["joints"].as_array().map(Vec::len), Some(6));
    let of = |base: Option<&str>| json!({ "begin": { "urdf": "ur10.urdf", "table": "ur10-camera.csv", "base": base, "tip": null } });
    let begun = asked(files, &of(None));
    let guesses = begun["guesses"].as_array().expect("guesses");
    let fields: Vec<&str> = guesses.iter().filter_map(|guess| guess["field"].as_str()).collect();
    assert_eq!(fields, ["base", "tip"]);
    assert!(!guesses.iter().any(|guess| guess["said"].as_str().is_some_and(|said| said.contains("--"))), "{guesses:?}");
    let (file, text) = (&begun["file"], &begun["text"]);
    let read = asked(files, &json!({ "read": { "file": file, "text": text } }));
    assert_eq!(read["rows"], 23);
    let (field, why) = refused(files, &of(Some("elbow")));
    assert!(field.is_empty() && why.contains("elbow") && !why.contains("--"), "{field}: {why}");
}

#[test]
fn before_any_measurement_postures_are_told() {
    let example = asked(&json!({}), &json!({ "example": { "name": "ur10-camera" } }));
    let files = &example["files"];
    for (sensor, columns) in [("position", 3), ("pose", 7), ("camera", 2), ("distance", 1)] {
        let plan = asked(files, &json!({ "plan": { "urdf": "ur10.urdf", "sensor": sensor } }));
        let (file, text) = (&plan["file"], &plan["text"]);
        let ask = json!({ "observability": { "file": file, "text": text, "postures": 4, "accuracy_mm": 2.0 } });
        let observed = asked(files, &ask);
        let table = observed["table"].as_str().expect("a table");
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 5, "{sensor}: {table}");
        assert_eq!(lines[0].split(',').count(), 6 + columns, "{sensor}: {table}");
        assert!(lines[1].ends_with(&",".repeat(columns)), "{sensor}: {table}");
        assert_eq!(observed["found"]["accuracy"]["wanted_mm"], 2.0);
        // The titles say no unit: rad, as the report's degrees are.
        let best = observed["found"]["best"].as_array().expect("postures");
        for (line, posture) in lines[1..].iter().zip(best) {
            let read: Vec<f64> = line.split(',').take(6).map(|cell| cell.parse().expect("a number")).collect();
            let told = posture["joints"].as_array().expect("joints").iter().filter_map(Value::as_f64);
            let is_near = |(read, told): (&f64, f64)| (read.to_degrees() - told).abs() < 1e-3;
            assert!(read.iter().zip(told).all(is_near), "{sensor}: {line} {posture}");
        }
        // Once it is measured it is read as the same calibration's table.
        let titles = plan["table"]["text"].as_str().expect("titles").trim_end();
        assert_eq!(lines[0], titles, "{sensor}");
    }
}

/// A ball in sockets: where they are is told by the rows that are there, and each posture names its socket.
#[test]
fn sockets_are_planned_for() {
    let (files, file, text) = panda();
    let ask = json!({ "observability": { "file": file, "text": text, "postures": 3, "accuracy_mm": null } });
    let observed = asked(&files, &ask);
    let table = observed["table"].as_str().expect("a table");
    let lines: Vec<&str> = table.lines().collect();
    assert!(lines[0].starts_with("place,socket,panda_joint1,"), "{table}");
    assert!(lines[1..].iter().all(|line| line.starts_with("front_center,")), "{table}");
    for postures in [0, 1001] {
        let ask = json!({ "observability": { "file": file, "text": text, "postures": postures, "accuracy_mm": null } });
        let (field, why) = refused(&files, &ask);
        assert!(field == "postures" && why.contains("from 1 to 1000"), "{field}: {why}");
    }
}

/// Rotations in degrees whose titles say no unit are refused as radians, and read once their unit is said.
#[test]
fn rotations_in_degrees_are_read_once_that_is_said() {
    let example = asked(&json!({}), &json!({ "example": { "name": "ur10-camera" } }));
    let mut files: BTreeMap<String, String> = serde_json::from_value(example["files"].clone()).expect("texts");
    let table = files["ur10-camera.csv"].clone();
    let titles: Vec<&str> = table.lines().next().expect("titles").split(',').collect();
    let is_angle: Vec<bool> = titles
        .iter()
        .map(|it| it.ends_with("_joint") || it.ends_with("roll") || it.ends_with("pitch") || it.ends_with("yaw"))
        .collect();
    let rows = table.lines().skip(1).map(|line| {
        let cell = |(cell, is): (&str, &bool)| match is {
            true => cell.parse::<f64>().expect("a number").to_degrees().to_string(),
            false => cell.to_owned(),
        };
        line.split(',').zip(&is_angle).map(cell).collect::<Vec<_>>().join(",")
    });
    let degrees = [titles.join(",")].into_iter().chain(rows).collect::<Vec<_>>().join("\n");
    files.insert("ur10-camera.csv".to_owned(), degrees);
    let begin =
        |angles: Value| json!({ "begin": { "urdf": "ur10.urdf", "table": "ur10-camera.csv", "angles": angles } });
    let (_, why) = refused(&json!(files), &begin(Value::Null));
    assert!(why.contains("_deg"), "{why}");
    let begun = asked(&json!(files), &begin(json!("deg")));
    files.insert("ur10-camera.csv".to_owned(), begun["table"]["text"].as_str().expect("a table").to_owned());
    let read = asked(&json!(files), &json!({ "read": { "file": begun["file"], "text": begun["text"], "folds": 3 } }));
    assert_eq!((&read["rows"], &read["folds"], &read["doubts"]), (&json!(23), &json!(3), &json!([])));
}

#[test]
fn what_is_wrong_is_said() {
    let (files, file, text) = panda();
    let (field, why) = refused(&json!({}), &json!({ "read": { "file": file, "text": text } }));
    assert!(field == "text" && why.contains("panda-sockets.csv was not dropped here; nothing was"), "{field}: {why}");
    let (field, why) = refused(&files, &json!({ "read": { "file": file, "text": format!("{text}\nnonsense = 1") } }));
    assert!(field == "text" && why.contains("nonsense"), "{field}: {why}");
    let (field, why) = refused(&files, &json!({ "describe": { "urdf": "other.urdf" } }));
    assert!(field == "urdf" && why.contains("`panda.urdf`"), "{field}: {why}");
    let (_, why) = refused(&files, &json!({ "guess": {} }));
    assert!(why.contains("guess"), "{why}");
    let broken = json!({ "robot.urdf": "<robot>", "data.csv": "a,b\n1,2\n" });
    let (field, why) = refused(&broken, &json!({ "describe": { "urdf": "robot.urdf" } }));
    assert!(field == "urdf" && why.contains("robot.urdf"), "{field}: {why}");
}

/// A row that is doubted is named by its line.
#[test]
fn doubts_name_their_rows() {
    let (mut files, file, text) = panda();
    let table = files["panda-sockets.csv"].as_str().expect("a table").to_owned();
    let mut lines: Vec<String> = table.lines().map(str::to_owned).collect();
    // The tenth row's first joint turned by hand.
    let mut cells: Vec<String> = lines[9].split(',').map(str::to_owned).collect();
    cells[2] = "2.9e1".to_owned();
    lines[9] = cells.join(",");
    files["panda-sockets.csv"] = lines.join("\n").into();
    let read = asked(&files, &json!({ "read": { "file": file, "text": text } }));
    let doubts = read["doubts"].as_array().expect("doubts");
    let of_line = |doubt: &&Value| doubt["lines"].as_array().is_some_and(|it| it.iter().any(|at| at["line"] == 10));
    assert!(doubts.iter().any(|doubt| of_line(&doubt)), "{doubts:?}");
}

/// A robot that somebody moves by hand: what it is told is kept in the session's text alone.
#[test]
fn a_session_is_carried_on_by_its_text() {
    let example = asked(&json!({}), &json!({ "example": { "name": "ur10-camera" } }));
    let files = &example["files"];
    let plan = asked(files, &json!({ "plan": { "urdf": "ur10.urdf", "sensor": "position" } }));
    let mut bench = Workbench::default();
    let mut tell = |ask: Value, files: &Value| {
        let worked = worked(&mut bench, files, &ask);
        let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
        assert_eq!(worked.answer.status, 200, "{body}");
        (body, worked.recording)
    };
    let (mut at, scene) = tell(json!({ "open": { "text": plan["text"] } }), files);
    assert!(scene.is_some_and(|bytes| bytes.starts_with(b"RRF2")));
    assert_eq!(at["channels"], json!([{ "name": "hand", "channel": "position" }]));
    for movement in 1..=3 {
        (at, _) = tell(json!({ "suggest": { "session": at["session"] } }), &json!({}));
        let next = at["pending"][0].clone();
        assert_eq!(next["configuration"].as_object().map(serde_json::Map::len), Some(6), "{next}");
        let told = json!({ "suggestion_id": next["id"], "configuration": next["configuration"], "measurements": { "hand": [0.6, 0.1, 0.8] } });
        let observe = json!({ "observe": { "session": at["session"], "observation": told } });
        (at, _) = tell(observe, &json!({}));
        assert_eq!(at["status"]["observations"], movement);
    }
    let (excluded, _) =
        tell(json!({ "count": { "session": at["session"], "observation": 2, "counts": false } }), &json!({}));
    assert_eq!(excluded["status"]["excluded"], json!([2]));
    // Another worker knows nothing but the text.
    let files_of = asked(&json!({}), &json!({ "results": { "session": at["session"] } }));
    let table = files_of["files"]["observations.csv"].as_str().expect("a table");
    assert_eq!(table.lines().count(), 4, "{table}");
    assert!(files_of["text"].as_str().is_some_and(|text| text.contains("observations.csv")));
    let (_, why) = refused(&json!({}), &json!({ "suggest": { "session": "{}" } }));
    assert!(why.contains("version"), "{why}");
}

/// A dropped folder's meshes are in the recording, and those that are missing are named.
#[test]
fn a_dropped_folder_draws_the_robot_as_itself() {
    let (files, file, text) = panda();
    let mut files: BTreeMap<String, String> = serde_json::from_value(files).expect("texts");
    let urdf = files.values_mut().find(|text| text.contains("<robot")).expect("a URDF");
    *urdf = urdf.replace(".dae", ".stl");
    let named = urdf.split("filename=\"").skip(1).filter_map(|rest| rest.split('"').next()?.rsplit('/').next());
    let stl = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let meshes: Meshes = named.map(|name| (format!("/panda/meshes/{name}"), stl.to_vec())).collect();
    let request = json!({ "files": files, "ask": { "calibrate": { "file": file, "text": text } } }).to_string();
    let drawn = |meshes: &Meshes| {
        let worked = Workbench::default().work(request.as_bytes(), meshes, &Silent);
        let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
        let undrawn = body["undrawn"].as_array().unwrap_or_else(|| panic!("{body}")).len();
        let (content, recording) = (b"outer loop", worked.recording.expect("a recording"));
        (undrawn, recording.windows(content.len()).any(|bytes| bytes == content))
    };
    assert_eq!(drawn(&meshes), (0, true));
    let plan = asked(&json!(files), &json!({ "plan": { "urdf": "panda.urdf", "sensor": "position" } }));
    let open = json!({ "files": files, "ask": { "open": { "text": plan["text"] } } }).to_string();
    let opened = Workbench::default().work(open.as_bytes(), &meshes, &Silent);
    let body = String::from_utf8_lossy(&opened.answer.body).into_owned();
    let scene = opened.recording.unwrap_or_else(|| panic!("{body}"));
    assert!(scene.windows(10).any(|bytes| bytes == b"outer loop"), "where it is measured movement by movement, too");
    let (undrawn, has_meshes) = drawn(&Meshes::new());
    assert!(undrawn > 5 && !has_meshes, "{undrawn}");
}

#[test]
fn units_that_titles_do_not_say_can_be_said() {
    let (files, ..) = panda();
    let files: BTreeMap<String, String> = serde_json::from_value(files).expect("texts");
    let find = |end: &str| files.iter().find(|(name, _)| name.ends_with(end)).expect("a file");
    let ((urdf, description), (table, rows)) = (find(".urdf"), find(".csv"));
    let rows = rows.replace("_deg", "");
    let files = json!({ urdf: description, table: rows });
    let begun = |units: Value| {
        let mut ask = json!({ "urdf": urdf, "table": table, "base": null, "tip": null, "socket_distance_mm": null });
        ask.as_object_mut().expect("an object").extend(units.as_object().expect("an object").clone());
        asked(&files, &json!({ "begin": ask }))
    };
    let plain = begun(json!({}));
    assert!(plain.get("table").is_none());
    assert_eq!(plain["unitless"]["angles"].as_array().map(Vec::len), Some(7), "{plain}");
    assert_eq!(plain["unitless"]["lengths"], json!([]));
    let said = begun(json!({ "angles": "deg", "lengths": null }));
    assert_eq!((&said["unitless"], &said["table"]["file"]), (&plain["unitless"], &json!(table)));
    let text = said["table"]["text"].as_str().expect("a table");
    assert!(text.starts_with("panda_joint1_deg,") || text.contains(",panda_joint1_deg,"), "{text:.200}");
    assert_eq!(text.lines().skip(1).collect::<Vec<_>>(), rows.lines().skip(1).collect::<Vec<_>>());
    assert!(refused(&files, &json!({ "begin": { "urdf": urdf, "table": table, "angles": "gon" } })).1.contains("gon"));
}

/// Titles that nobody could guess: what they hold is said beside them, and the file comes out as if they had said it.
#[test]
fn columns_can_be_said_to_hold_what_their_titles_do_not_say() {
    let example = asked(&json!({}), &json!({ "example": { "name": "ur10-camera" } }));
    let mut files: BTreeMap<String, String> = serde_json::from_value(example["files"].clone()).expect("texts");
    let described = asked(&json!(files), &json!({ "describe": { "urdf": "ur10.urdf", "table": "ur10-camera.csv" } }));
    let titles: Vec<&str> = described["titles"].as_array().expect("titles").iter().filter_map(Value::as_str).collect();
    assert!(titles.contains(&"elbow_joint"), "{titles:?}");
    let begin = |files: &BTreeMap<String, String>, columns: &Value| json!({ "files": files, "ask": { "begin": { "urdf": "ur10.urdf", "table": "ur10-camera.csv", "columns": columns } } });
    let answer = |request: &Value| {
        let worked = Workbench::default().work(request.to_string().as_bytes(), &Meshes::new(), &Silent);
        (worked.answer.status, serde_json::from_slice::<Value>(&worked.answer.body).expect("JSON"))
    };
    let (_, told) = answer(&begin(&files, &json!({})));
    let roles: BTreeMap<String, Value> = told["columns"]
        .as_array()
        .expect("columns")
        .iter()
        .enumerate()
        .map(|(index, column)| (format!("c{index}"), column["role"].clone()))
        .collect();
    assert_eq!(roles.len(), titles.len());
    let rows = files["ur10-camera.csv"].split_once('\n').expect("rows").1.to_owned();
    let names: Vec<String> = (0..titles.len()).map(|index| format!("c{index}")).collect();
    *files.get_mut("ur10-camera.csv").expect("a table") = format!("{}\n{rows}", names.join(","));
    let (status, why) = answer(&begin(&files, &json!({})));
    assert!(status == 422 || status == 400, "{why}");
    let (status, said) = answer(&begin(&files, &json!(roles)));
    assert_eq!((status, &said["text"]), (200, &told["text"]), "{said}");
    assert_eq!(
        said["table"]["text"].as_str().and_then(|text| text.split_once('\n')).map(|(_, rows)| rows),
        Some(&*rows)
    );
    let read = json!({ "files": { "ur10.urdf": files["ur10.urdf"], "ur10-camera.csv": said["table"]["text"] }, "ask": { "read": { "file": said["file"], "text": said["text"] } } });
    assert_eq!(answer(&read).1["rows"], 23);
    let (_, why) = answer(&begin(&files, &json!({ "c99": null })));
    assert!(why["detail"].as_str().is_some_and(|detail| detail.contains("`c99`")), "{why}");
}

/// An arm of three joints, measured with noise of half a millimetre; from row `since` on a joint's readings are `off`, rad.
fn rows(count: usize, seed: u64, since: usize, off: f64) -> String {
    let chain = body_schema_robot::Urdf::parse(THREE).expect("a URDF").chain("base", "hand").expect("a chain");
    let mut random = seed;
    // As good as any for noise: Knuth's linear congruential numbers.
    let mut drawn = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut csv = "pan,lift,bend,marker_x,marker_y,marker_z\n".to_owned();
    for row in 0..count {
        let positions = [3.0 * drawn(), 2.0 * drawn(), 2.0 * drawn()];
        let marker = chain.tip_at(&positions) * nalgebra::Point3::new(0.3, 0.02, 0.05);
        let [pan, lift, bend] = positions;
        let lift = if row >= since { lift + off } else { lift };
        let seen = marker.coords.map(|at| at + 5e-4 * (drawn() + drawn() + drawn() + drawn()));
        csv += &format!("{pan},{lift},{bend},{},{},{}\n", seen.x, seen.y, seen.z);
    }
    csv
}

const THREE: &str = r#"<robot name="three"><link name="base"/><link name="post"/><link name="arm"/><link name="hand"/>
    <joint name="pan" type="revolute"><origin xyz="0 0 0.3"/><parent link="base"/><child link="post"/><axis xyz="0 0 1"/>
    <limit lower="-1.6" upper="1.6" effort="1" velocity="1"/></joint>
    <joint name="lift" type="revolute"><origin xyz="0.05 0 0.1"/><parent link="post"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1.6" upper="1.6" effort="1" velocity="1"/></joint>
    <joint name="bend" type="revolute"><origin xyz="0.4 0 0"/><parent link="arm"/><child link="hand"/><axis xyz="0 1 0"/>
    <limit lower="-1.6" upper="1.6" effort="1" velocity="1"/></joint></robot>"#;

#[test]
fn later_rows_tell_what_has_moved() {
    let with = |later: String| json!({ "three.urdf": THREE, "rows.csv": rows(80, 1, 80, 0.0), "later.csv": later });
    let files = with(rows(60, 2, 20, 0.02));
    let begun = asked(&files, &json!({ "begin": { "urdf": "three.urdf", "table": "rows.csv" } }));
    let ask = |later: Option<&str>| {
        let asked = json!({ "file": "rows.toml", "text": begun["text"], "later": later, "false_alarms_per_year": 0.1 });
        json!({ "watch": asked })
    };
    let moved = asked(&files, &ask(Some("later.csv")));
    let said = moved["said"].as_str().expect("a sentence");
    assert!(moved["changed"] == true && said.contains("lift") && said.contains("deg"), "{said}");
    let first = &moved["report"]["events"][0];
    let (row, size) = (first["line"].as_u64().expect("a line"), &first["explanations"][0]["amounts"][0]["value"]);
    assert!((22..30).contains(&row), "told in line {row}");
    // What is to be added to the readings.
    assert!((size.as_f64().expect("a size") + 0.02_f64.to_degrees()).abs() < 0.3, "{size}");
    assert_eq!(first["movements"]["positions"].as_array().map(Vec::len), Some(3), "{first}");
    let page = moved["page"].as_str().expect("HTML");
    assert!(page.contains("Movements that would tell best") && page.contains("<svg"), "a page");
    assert!(page.contains("Without a time 52 a year are assumed."), "rows have no time");
    assert_eq!(asked(&with(rows(60, 2, 60, 0.0)), &ask(Some("later.csv")))["changed"], false);
    // What is wrong is said of the table, or of the file.
    let (field, said) = refused(&with("pan,lift\n0.1,0.2\n".to_owned()), &ask(Some("later.csv")));
    assert!(field == "later" && said.contains("bend"), "{field}: {said}");
    assert_eq!(refused(&files, &ask(Some("none.csv"))).0, "later");
    let (field, said) = refused(&files, &ask(None));
    assert!(field == "text" && said.contains("every row of this file is learned from"), "{field}: {said}");
}

/// Meshes beside the description say how thick links are, movement by movement.
#[test]
fn dropped_meshes_hold_links_apart() {
    let urdf = "<robot name=\"two\"><link name=\"base\"><collision><geometry><mesh filename=\"package://two/cube.obj\"/></geometry></collision></link>\
        <link name=\"arm\"/><link name=\"hand\"/>\
        <joint name=\"lift\" type=\"revolute\"><origin xyz=\"0.3 0 0.6\"/><parent link=\"base\"/><child link=\"arm\"/><axis xyz=\"0 1 0\"/>\
        <limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint>\
        <joint name=\"bend\" type=\"revolute\"><origin xyz=\"0.3 0 0\"/><parent link=\"arm\"/><child link=\"hand\"/><axis xyz=\"0 1 0\"/>\
        <limit lower=\"-1.5\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint></robot>";
    let text = "name = \"two\"\n[robot]\nurdf = \"two.urdf\"\nbase = \"base\"\ntip = \"hand\"\n[[target]]\nname = \"marker\"\nat_m = [0.3, 0.0, 0.0]\n";
    let cube: String = (0..8)
        .map(|k| [0, 1, 2].map(|side| f64::from(k >> side & 1) - 0.5))
        .map(|[x, y, z]| format!("v {x} {y} {z}\n"))
        .collect();
    let sides = "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n";
    let meshes = Meshes::from([("/two/cube.obj".to_owned(), (cube + sides).into_bytes())]);
    let excluded = |meshes: &Meshes| {
        let ask = json!({ "files": { "two.urdf": urdf }, "ask": { "open": { "text": text } } });
        let worked = Workbench::default().work(ask.to_string().as_bytes(), meshes, &Silent);
        let body: Value = serde_json::from_slice(&worked.answer.body).expect("JSON");
        let session = body["session"].as_str().unwrap_or_else(|| panic!("{body}"));
        let session = body_schema_ask_tell::Session::from_json(session).expect("a session");
        let constraints = session.scenario().constraints.clone();
        // Straight down onto the cube, half a metre high.
        constraints.is_some_and(|constraints| !constraints.allow(None, &[1.4, 1.2]))
    };
    assert!(!excluded(&Meshes::new()), "a frame has no thickness");
    assert!(excluded(&meshes));
}
