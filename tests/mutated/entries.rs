//! Whatever is read from files and strangers, one function for each kind: of any bytes whatsoever none of them may panic. The fuzzers in
//! `fuzz/` and the short form of them in `tests/mutated.rs` call the same.

use std::collections::BTreeMap;

use body_schema::{
    ask_tell::{Ask, Observation, Outcome, Session, Setup},
    robot::Urdf,
    scenario::Scenario,
    table::{Columns, Layout, Quantity, Table},
};
use serde::Deserialize;

/// A robot of two joints.
pub const URDF: &str = r#"<robot name="two"><link name="wall"/><link name="arm"/><link name="hand"/>
  <joint name="turn" type="revolute"><parent link="wall"/><child link="arm"/><origin xyz="0 0 0.4" rpy="0 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/><origin xyz="0.5 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.3" effort="1" velocity="1"/></joint></robot>"#;
/// What was measured with it.
pub const TABLE: &str =
    "turn,slide,hand_x_mm,hand_y_mm,hand_z_mm\n0.1,0.05,540,90,410\n-0.4,0.2,610,-320,402\n0.9,0,300,450,399\n";
/// No file that this program reads is this large in practice; fuzzers try.
const MOST_BYTES: usize = 1 << 16;

fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok().filter(|text| text.len() <= MOST_BYTES)
}

fn file(name: &str) -> Result<String, String> {
    Ok(if name.ends_with("csv") { TABLE } else { URDF }.to_owned())
}

/// A scenario, a file of `calibrate`, or the keys of a session: whichever it is, all three are tried.
pub fn scenario(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    drop(Scenario::parse("mutated", text, &file));
    drop(Scenario::parse_outside("mutated", text, &file));
}

/// A calibration, opened as a session.
pub fn calibration(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    if let Ok(setup) = Setup::from_toml(text, &file) {
        drop(Session::open(setup));
    }
}

/// A description, and every chain in it.
pub fn urdf(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let Ok(urdf) = Urdf::parse(text) else { return };
    let leaves: Vec<&str> = urdf.leaves().take(3).collect();
    for tip in leaves {
        let Some(Ok(chain)) = urdf.root().map(|root| urdf.chain(root, tip)) else { continue };
        let middle = vec![0.1; chain.names().len()];
        drop((chain.limits(), chain.tip_at(&chain.positions(&middle)), chain.kinematics_yaml(), urdf.written(&chain)));
        drop(chain.state());
    }
}

/// A table of measurements, to its last row.
pub fn table(bytes: &[u8]) {
    if bytes.len() > MOST_BYTES {
        return;
    }
    let Ok(table) = Table::open(bytes) else { return };
    let titles = table.titles();
    let joints = ["turn", "slide"].into_iter().filter_map(|name| titles.find(name, Quantity::Angle).ok()).collect();
    let layouts = [Layout::Position, Layout::Pose, Layout::Pixels(2), Layout::Distance];
    let readings = layouts.into_iter().filter_map(|layout| titles.reading(layout, "hand").ok()).collect();
    let labels = titles.label("place").into_iter().collect();
    table.rows(Columns { joints, readings, labels }).for_each(drop);
}

/// Bodies of requests, by what they are about: all are tried on a session, and committed where it takes them.
pub fn body(bytes: &[u8]) {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct NewOutcome {
        state: Outcome,
        reason: Option<String>,
    }
    thread_local!(static SESSION: Session = Session::from_json(include_str!("events.json")).expect("a session"));
    if bytes.len() > MOST_BYTES {
        return;
    }
    SESSION.with(|session| {
        let mut session = session.clone();
        if let Ok(ask) = serde_json::from_slice::<Ask>(bytes) {
            drop(session.suggest(&ask, Some(4.0)));
        }
        if let Ok(told) = serde_json::from_slice::<Observation>(bytes) {
            drop(session.observe(told, Some(4.0)));
        }
        if let Ok(NewOutcome { state, reason }) = serde_json::from_slice(bytes) {
            drop(session.outcome(1, state, reason.as_deref(), Some(4.0)));
        }
        if let Ok(setup) = serde_json::from_slice::<Setup>(bytes) {
            drop(Session::open(setup));
        }
        drop(serde_json::from_slice::<BTreeMap<String, f64>>(bytes));
    });
}

/// What happened in a session, replayed: a session that is taken up is written again as it was.
pub fn events(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    if let Ok(session) = Session::from_json(text) {
        let again = session.to_json();
        assert_eq!(Session::from_json(&again).expect("its own").to_json(), again);
    }
}

/// A recording, mended as `repair` does, and read by a page that follows late: what is kept of it is whole.
pub fn recording(bytes: &[u8]) {
    use std::fs;

    use body_schema::recording::{LiveLog, examine, restore};

    thread_local!(static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("a folder"));
    FOLDER.with(|folder| {
        let [broken, out] = ["broken.rrd", "out.rrd"].map(|name| folder.path().join(name));
        fs::write(&broken, bytes).expect("written");
        drop(fs::remove_file(&out));
        if let Ok(condition) = restore(&broken, &out) {
            let again = examine(&out).expect("what was restored can be read");
            assert!(again.is_complete && again.messages == condition.messages, "{condition:?}, then {again:?}");
        }
    });
    // A part of a live recording stands without the header.
    let part = bytes.get(LiveLog::new().header().len()..).unwrap_or_default();
    drop(LiveLog::new().put_together(&[part.to_vec().into()]));
}
