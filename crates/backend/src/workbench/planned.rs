//! What a robot has that nobody has measured yet: the titles of its table, and the postures to be measured.

use body_schema_engine::selection::Movement;
use body_schema_robot::Urdf;
use body_schema_scenario::{Scenario, SocketSpec};

use super::asked::Sensor;

/// The titles of what a sensor measures.
fn measured(sensor: Sensor) -> &'static [&'static str] {
    match sensor {
        Sensor::Position => &["hand_x", "hand_y", "hand_z"],
        Sensor::Pose => &["hand_x", "hand_y", "hand_z", "hand_qx", "hand_qy", "hand_qz", "hand_qw"],
        Sensor::Camera => &["cam_hand_u", "cam_hand_v"],
        Sensor::Distance => &["hand_distance"],
    }
}

/// A table without rows: a title for every joint that moves by itself, and those of what is measured.
pub fn table(urdf: &Urdf, sensor: Sensor) -> String {
    let moves =
        urdf.joints().filter(|joint| joint.moves().is_ok_and(|kind| kind.is_some()) && joint.mimics().is_none());
    let titles = moves.map(|joint| joint.name).chain(measured(sensor).iter().copied());
    csv([titles.map(str::to_owned).collect()])
}

/// A calibration file without its table, and without what of it is held out.
///
/// # Errors
///
/// A sentence that says why `text` is no TOML.
pub fn without_table(text: &str) -> Result<String, String> {
    let mut keys: toml::Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    keys.remove("measurements");
    keys.remove("held_out");
    toml::to_string(&keys).map_err(|error| error.to_string())
}

/// The postures to measure, the most telling first, as a table that waits for what will be measured: joints in rad or m as their titles
/// without a unit say, the socket that holds the target where there are sockets, and an empty cell for each column of the sensors of the
/// calibration file `text`.
pub fn postures(scenario: &Scenario, text: &str, best: &[Movement]) -> String {
    let columns = sensor_columns(text);
    let sockets: Vec<&SocketSpec> = scenario.robot.all_sockets().collect();
    let held = |movement: &Movement| movement.socket.and_then(|socket| sockets.get(socket).copied());
    let has_socket = best.iter().any(|movement| held(movement).is_some());
    let has_place = best.iter().any(|movement| held(movement).is_some_and(|socket| socket.place.is_some()));
    let of_sockets = |place: String, socket: String| {
        has_place.then_some(place).into_iter().chain(has_socket.then_some(socket)).collect::<Vec<String>>()
    };
    let mut titles = of_sockets("place".to_owned(), "socket".to_owned());
    titles.extend(scenario.robot.names.iter().chain(&columns).cloned());
    let rows = best.iter().map(|movement| {
        let place = held(movement).and_then(|socket| socket.place.clone());
        let mut row =
            of_sockets(place.unwrap_or_default(), held(movement).map(|it| it.name.clone()).unwrap_or_default());
        row.extend(movement.configuration.iter().map(|position| format!("{position:.6}")));
        row.extend(columns.iter().map(|_| String::new()));
        row
    });
    csv(std::iter::once(titles).chain(rows))
}

/// The columns that the sensors of a calibration file read.
fn sensor_columns(text: &str) -> Vec<String> {
    let keys: toml::Table = text.parse().unwrap_or_default();
    let sensors = keys.get("sensor").and_then(toml::Value::as_array).into_iter().flatten();
    let columns = sensors.filter_map(|sensor| sensor.get("columns")?.as_array()).flatten();
    columns.filter_map(|column| Some(column.as_str()?.to_owned())).collect()
}

fn csv(lines: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in lines {
        // Writing to memory does not fail, and what was text stays text.
        let _ = writer.write_record(line);
    }
    writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}
