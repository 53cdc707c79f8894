//! Certificates: what is found again, and what is not.

use std::{fs, path::Path};

use serde_json::Value;

use super::{body_schema, done, failure};

/// The exit code and what was said of it on standard output.
/// Exit code and standard output of `verify`.
pub fn verified(certificate: &Path, data: &str) -> (i32, String) {
    let output = body_schema(&["verify", certificate.to_str().expect("a plain path"), data]);
    (output.status.code().expect("an exit code"), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn a_certificate_is_found_again_and_what_was_changed_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let text = |name: &str| at(name).to_str().expect("a plain path").to_owned();
    for name in ["panda-sockets.toml", "panda-sockets.csv", "panda.urdf"] {
        fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(name), at(name)).expect("copied");
    }
    let (data, out) = (text("panda-sockets.toml"), text("out"));
    done(&["calibrate", &data, "--certificate", "--out", &out]);
    for certificate in ["out", "out/certificate.json", "out/certificate.html"] {
        // The same robot is built in.
        for data in [data.as_str(), "panda-sockets"] {
            let (code, said) = verified(&at(certificate), data);
            assert!(code == 0 && said.contains("497 rows"), "{certificate}: {said}");
        }
    }

    // Nothing is known beforehand of a row in a socket, so no interval of it is judged.
    let page = fs::read_to_string(at("out/certificate.html")).expect("a page");
    assert!(page.contains("How many readings lie within the intervals that are stated for them is not told"), "{page}");

    // A number in it: the field.
    let json = fs::read_to_string(at("out/certificate.json")).expect("a certificate");
    let mut changed: Value = serde_json::from_str(&json).expect("JSON");
    changed["joints"][3]["turn_deg"][0] = Value::from(0.05);
    changed["held_out"]["calibrated"]["mean_mm"] = Value::from(0.2);
    changed["command"] = Value::from("another");
    changed["comment"] = Value::from("accurate to 0.01 mm");
    fs::write(at("changed.json"), changed.to_string()).expect("written");
    let output = body_schema(&["verify", &text("changed.json"), &data, "--json", "-"]);
    assert_eq!(output.status.code(), Some(1));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let fields: Vec<&str> =
        found["differences"].as_array().expect("a list").iter().filter_map(|it| it["field"].as_str()).collect();
    assert_eq!(fields, ["comment", "held_out.calibrated.mean_mm", "joints[3].turn_deg[0]"]);
    assert_eq!(found["verified"], false);

    // A number that the page shows, but not in the JSON that it holds.
    let page = fs::read_to_string(at("out/certificate.html")).expect("a page");
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());
    fs::write(at("changed.html"), page.replacen("by 8.17 mm", "by 9.17 mm", 1)).expect("written");
    let (code, said) = verified(&at("changed.html"), &data);
    assert!(code == 1 && said.contains("  page: "), "{said}");

    // Lines may end otherwise, and of another version's page only the numbers count.
    fs::write(at("ends.html"), page.replace('\n', "\r\n")).expect("written");
    assert_eq!(verified(&at("ends.html"), &data).0, 0);
    let version = format!("body-schema {}", env!("CARGO_PKG_VERSION"));
    let older = page.replace(&version, "body-schema 0.0.9").replace("<style>", "<style>/* another layout */");
    fs::write(at("older.html"), older).expect("written");
    let (code, said) = verified(&at("older.html"), &data);
    assert!(code == 0 && said.contains("to a millionth"), "{said}");

    // A number in the data: the row and its line.
    let csv = fs::read_to_string(at("panda-sockets.csv")).expect("a table");
    let mut lines: Vec<String> = csv.lines().map(str::to_owned).collect();
    let cells: Vec<&str> = lines[17].split(',').collect();
    let moved: f64 = cells[4].parse::<f64>().expect("a position") + 1e-9;
    lines[17] = [&cells[..4], &[moved.to_string().as_str()], &cells[5..]].concat().join(",");
    fs::write(at("panda-sockets.csv"), lines.join("\n")).expect("written");
    let (code, said) = verified(&at("out"), &data);
    assert!(code == 1 && said.contains("row 17: ") && said.contains("line 18"), "{said}");
    assert_eq!(said.matches("row ").count(), 1, "{said}");
    // A row less.
    fs::write(at("panda-sockets.csv"), csv.lines().take(497).collect::<Vec<_>>().join("\n")).expect("written");
    let (code, said) = verified(&at("out"), &data);
    assert!(code == 1 && said.contains("row 497: ") && said.contains("found nothing"), "{said}");

    // What is no certificate, or no data.
    let (code, said) = failure(&["verify", &text("out/report.json"), &data]);
    assert!(code == 2 && said.contains("no certificate"), "{said}");
    let (code, said) = failure(&["verify", &text("out/report.html"), &data]);
    assert!(code == 2 && said.contains("no certificate"), "{said}");
    fs::write(at("half.json"), &json[..json.len() / 2]).expect("written");
    let (code, said) = failure(&["verify", &text("half.json"), &data]);
    assert!(code == 2 && said.contains("half.json cannot be read"), "{said}");
    fs::write(at("later.json"), json.replacen("\"certificate\": 1", "\"certificate\": 2", 1)).expect("written");
    let (code, said) = failure(&["verify", &text("later.json"), &data]);
    assert!(code == 2 && said.contains("version 2"), "{said}");
    let (code, said) = failure(&["verify", &out, &text("panda-sockets.csv")]);
    assert!(code == 2 && said.contains("name the calibration file"), "{said}");
    let (code, said) = failure(&["calibrate", "panda-sockets", "--certificate", "--json", "-"]);
    assert!(code == 2 && said.contains("--out"), "{said}");
}

/// With folds it has an interval by them, and the number of folds that it was asked for.
#[test]
fn folds_are_repeated() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let path = out.to_str().expect("a plain path");
    done(&["calibrate", "ur10-camera", "--folds", "4", "--certificate", "--out", path]);
    let certificate: Value =
        serde_json::from_str(&fs::read_to_string(out.join("certificate.json")).expect("a certificate")).expect("JSON");
    assert_eq!(certificate["folds"], 4);
    assert!(certificate["command"].as_str().expect("a command").ends_with("ur10-camera --folds 4 --certificate"));
    let interval = |by: &str| [0, 1].map(|end| certificate["held_out"][by][end].as_f64().expect("an end"));
    let mean = certificate["held_out"]["calibrated"]["mean_mm"].as_f64().expect("a mean");
    for by in ["mean_by_rows", "mean_by_folds"] {
        let [low, high] = interval(by);
        assert!(low < mean && mean < high, "{by}: {low} to {high}, {mean}");
    }
    assert_eq!(verified(&out, "ur10-camera").0, 0);
}
