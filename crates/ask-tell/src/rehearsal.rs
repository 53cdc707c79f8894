//! The rehearsal of a session: when it is opened, made-up observations show whether `calibrate` can read what it will write.
//!
//! Joints, targets and columns have names, and in a table several of them can collide: two columns with one title, a sensor's column
//! with a joint's title, a name that ends with a blank. Writing a table and reading it finds whatever `calibrate` would read
//! differently.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Fault, Session, SetupError};
use body_schema_calibration::Case;
use body_schema_engine::{
    selection::Movement,
    sensing::{Channel, MeasurementModel, Occasion},
};
use body_schema_experiment::Executed;
use body_schema_scenario::{Problem, Scenario, ScenarioError};
use body_schema_table::{Quantity, Table, TableError, Titles};

/// The numbers of made-up observations that are tried: few first, more if these are too few for what is held out.
const ROWS: [usize; 3] = [24, 200, 2000];
/// The most by which a number may differ from what was written, as a share of it (or of 1), because units are converted
/// back and forth.
const TOLERANCE: f64 = 1e-9;
/// The advice for colliding names.
const HINT: &str = "name the columns of each sensor, `columns = […]`, each once, and other than joints: as many as its readings have \
                    numbers, without blanks at their ends";

impl Session {
    /// Checks that the session will have results as soon as enough was observed.
    ///
    /// # Errors
    ///
    /// [`SetupError::Invalid`] names the key of the calibration by which `calibrate` could not read the observations.
    pub fn check_results(&self) -> Result<(), SetupError> {
        self.check_names()?;
        let mut refused = Vec::new();
        for count in ROWS {
            match self.rehearse(count) {
                Ok(()) => return Ok(()),
                Err(faults) => refused = faults,
            }
        }
        Err(SetupError::Invalid(refused))
    }

    /// Checks that a table can tell joints from each other and from sockets, and has the columns by which rows are held
    /// out.
    fn check_names(&self) -> Result<(), Fault> {
        let Scenario { robot, .. } = &**self.scenario();
        let kinds = robot.names.iter().zip(&robot.state.joints).map(|(name, joint)| (name, Quantity::of(joint.kind())));
        let read: Vec<String> = robot.names.iter().map(|name| name.trim().to_owned()).collect();
        let found = Titles::listed(read).and_then(|titles| {
            let mut kinds = kinds;
            kinds.try_for_each(|(name, kind)| titles.find(name, kind).map(drop))
        });
        if let Err(TableError { what, .. }) = found {
            let what = format!("a table with a column for each joint {what}");
            let hint =
                "give the joints other names: blanks at their ends count for nothing, and `a_deg` is `a` in degrees";
            return Err(Fault::new("robot.urdf", what, hint));
        }
        let [place, socket] = self.socket_titles();
        for (key, title) in [("sockets.place_column", place), ("sockets.socket_column", socket)] {
            if !robot.sockets.is_empty() && robot.names.contains(&title) {
                let what = format!("`{title}` is the column of a joint");
                return Err(Fault::new(key, what, "name a column that is no joint's"));
            }
        }
        let by = self.setup().calibration.pointer("/held_out/by").and_then(serde_json::Value::as_str);
        let written = self.csv_of(&[]);
        let Ok(titles) = Table::open(written.as_bytes()).map(|table| table.titles().clone()) else { return Ok(()) };
        match by.filter(|by| titles.label(by).is_err()) {
            Some(by) => {
                let what = format!("the observations have no column `{by}`; they have {}", titles.all().join(", "));
                Err(Fault::new("held_out.by", what, "name one of these, or leave `held_out` out"))
            }
            None => Ok(()),
        }
    }

    /// Writes `count` observations, and reads them as `calibrate` does.
    fn rehearse(&self, count: usize) -> Result<(), Vec<Fault>> {
        let told = self.made_up(count);
        let written = self.csv_of(&told);
        let read = self.recorded(&written).map_err(|error| match error {
            ScenarioError::Invalid { problems, .. } => problems.into_iter().map(blamed).collect(),
            other => vec![Fault::new("calibration", other.to_string(), HINT)],
        })?;
        let case = Case::new(&read).map_err(|error| vec![Fault::new("calibration", error.to_string(), HINT)])?;
        let measurement_model = &self.scenario().measurement_model;
        if case.rows.len() != told.len() {
            let what = format!("{} of {} observations are read from the table of them", case.rows.len(), told.len());
            return Err(vec![Fault::new("sensor.columns", what, HINT)]);
        }
        let mut sockets = vec![None; self.scenario().robot.sockets.len()];
        for (told, row) in told.iter().zip(&case.rows) {
            let names = &self.scenario().robot.names;
            let joints = names.iter().zip(told.movement.configuration.iter().zip(&row.positions));
            if let Some((name, _)) = joints.clone().find(|(_, (told, read))| !are_near(**told, **read)) {
                let what =
                    format!("in the table of the observations the column of joint `{name}` holds something else");
                return Err(vec![Fault::new("sensor.columns", what, HINT)]);
            }
            let always = |measurement_model: &MeasurementModel| -> Vec<usize> {
                let sensors = measurement_model.sensors().iter().enumerate();
                sensors.filter(|(_, it)| it.subject().occasion == Occasion::Always).map(|(index, _)| index).collect()
            };
            for (here, there) in always(measurement_model).into_iter().zip(always(&read.measurement_model)) {
                let (told, read) = (&told.observation.readings[here], &row.observation.readings[there]);
                if !is_read_so(measurement_model.sensors()[here].channel().as_ref(), told.as_deref(), read.as_deref()) {
                    let what = "in the table of the observations the columns of a sensor hold something else";
                    return Err(vec![Fault::new("sensor.columns", what, HINT)]);
                }
            }
            let Some(held) = told.movement.socket else { continue };
            let is_another = row.socket.is_none()
                || sockets[held].is_some_and(|other| Some(other) != row.socket)
                || (sockets[held].is_none() && sockets.contains(&row.socket));
            if is_another {
                let name = self.scenario().robot.sockets[held].label();
                let what = format!("in a table `{name}` is no socket, or another one");
                let hint = "give each socket of a place a name of its own, without blanks at its ends, and no word that says nothing";
                return Err(vec![Fault::new("socket", what, hint)]);
            }
            sockets[held] = row.socket;
        }
        Ok(())
    }

    /// Observations of the robot as described, in random postures.
    fn made_up(&self, count: usize) -> Vec<Executed> {
        let Scenario { robot, measurement_model, .. } = &**self.scenario();
        let (sockets, mut rng) = (robot.sockets.len(), ChaCha8Rng::seed_from_u64(0));
        let noise = vec![0.0; measurement_model.equations()];
        let observed = |number: usize| {
            let configuration = robot.limits.draw(&mut rng);
            let socket = (sockets > 0).then(|| number % sockets);
            let mut observation = measurement_model.observe_in(socket, &robot.state, &configuration, &noise);
            for (sensor, reading) in measurement_model.sensors().iter().zip(&mut observation.readings) {
                // What a camera does not see from there it may see of the true robot.
                let is_missing = sensor.subject().occasion == Occasion::Always && reading.is_none();
                let anything = || (0..sensor.equations()).map(|index| (number + index) as f64).collect();
                *reading = if is_missing { Some(anything()) } else { reading.take() };
            }
            Executed { proposal: None, movement: Movement { configuration, row: None, socket }, observation }
        };
        (0..count).map(observed).collect()
    }
}

/// A problem of a table that does not exist yet, attributed to the key that corrects it.
fn blamed(problem: Problem) -> Fault {
    match problem.key.starts_with("measurements") {
        true => {
            Fault::new("sensor.columns", format!("`calibrate` cannot read the observations: {}", problem.what), HINT)
        }
        false => problem.into(),
    }
}

fn are_near(one: f64, other: f64) -> bool {
    (one - other).abs() <= TOLERANCE * one.abs().max(1.0) || (one.is_nan() && other.is_nan())
}

/// Whether a reading is read as it was given.
fn is_read_so(channel: &dyn Channel, told: Option<&[f64]>, read: Option<&[f64]>) -> bool {
    let (Some(told), Some(read)) = (told, read) else { return told.is_none() && read.is_none() };
    if told.len() != read.len() {
        return false;
    }
    if told.iter().zip(read).all(|(told, read)| are_near(*told, *read)) {
        return true;
    }
    // A rotation has more than one vector.
    let mut apart = vec![0.0; told.len()];
    channel.difference(told, read, &mut apart);
    let both_absent = |index: usize| told[index].is_nan() && read[index].is_nan();
    apart.iter().enumerate().all(|(index, apart)| apart.abs() <= TOLERANCE.sqrt() || both_absent(index))
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, collections::BTreeMap};

    use proptest::{
        prelude::*,
        test_runner::{Config, TestRunner},
    };
    use serde_json::{Value, json};

    use super::*;
    use crate::{Observation, Setup, Shape};
    use body_schema_calibration::{Options, Silent};

    /// Names that may be in each other's way.
    const NAMES: [&str; 22] = [
        "a",
        "a_deg",
        "a_rad",
        "a_m",
        "a_mm",
        " a",
        "a ",
        "A",
        "b",
        "x",
        "y",
        "z",
        "hand_x",
        "hand_x_mm",
        "hand_u",
        "hand",
        "hand_distance",
        "socket",
        "place",
        "nan",
        "q,\"w\"",
        "x (mm)",
    ];

    #[derive(Clone, Debug)]
    struct Keys {
        joints: [&'static str; 2],
        target: &'static str,
        channels: Vec<(usize, Option<Vec<&'static str>>)>,
        sockets: Vec<(&'static str, &'static str)>,
        socket_column: Option<&'static str>,
        held_out: Value,
    }

    fn keys() -> impl Strategy<Value = Keys> {
        let name = || prop::sample::select(&NAMES[..]);
        let columns = prop_oneof![
            2 => Just(None),
            2 => Just(Some(vec!["x", "y", "z"])),
            1 => Just(Some(vec!["u_px", "v_px"])),
            1 => Just(Some(vec!["px", "py", "pz", "qw", "qx", "qy", "qz"])),
            4 => prop::collection::vec(name(), 0..8).prop_map(Some),
        ];
        let sockets = prop_oneof![
            3 => Just(vec![]),
            2 => prop::collection::vec((prop::sample::select(&["", "front", "front ", "-"][..]), name()), 1..4),
        ];
        let held_out = prop::sample::select(vec![
            Value::Null,
            Value::Null,
            Value::Null,
            json!({ "count": 4 }),
            json!({ "folds": 3 }),
            json!({ "file": "other.csv" }),
            json!({ "by": "place", "train": ["front"] }),
            json!({ "rows": [0, 1] }),
        ]);
        (
            (name(), name()).prop_filter("joints of their own", |(a, b)| a != b),
            prop_oneof![3 => Just("hand"), 1 => name()],
            prop::collection::vec((0..4_usize, columns), 1..3),
            sockets,
            prop::option::weighted(0.2, name()),
            held_out,
        )
            .prop_map(|((a, b), target, channels, sockets, socket_column, held_out)| Keys {
                joints: [a, b],
                target,
                channels,
                sockets,
                socket_column,
                held_out,
            })
    }

    fn calibration(keys: &Keys) -> Value {
        let escaped = |name: &str| name.replace('"', "&quot;");
        let joint = |name: &str, parent: &str, child: &str, xyz: &str, axis: &str| {
            let name = escaped(name);
            format!(
                "<joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
                 <axis xyz=\"{axis}\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
            )
        };
        let urdf = format!(
            "<robot name=\"two\"><link name=\"base\"/><link name=\"upper\"/><link name=\"lower\"/>{}{}</robot>",
            joint(keys.joints[0], "base", "upper", "0 0 0.2", "0 0 1"),
            joint(keys.joints[1], "upper", "lower", "0.3 0 0", "0 1 0"),
        );
        let sensors = keys.channels.iter().map(|(kind, columns)| {
            let mut sensor = match kind {
                0 => json!({ "channel": "position", "sigma_m": 0.001 }),
                1 => json!({ "channel": "pose", "sigma_m": 0.001, "sigma_deg": 0.1 }),
                2 => json!({ "channel": "distance", "to_m": [1, 0, 0], "sigma_m": 0.001 }),
                _ => json!({ "channel": "pixels", "camera": "cam", "sigma_px": 0.3 }),
            };
            sensor["target"] = json!(keys.target);
            columns.iter().for_each(|columns| sensor["columns"] = json!(columns));
            sensor
        });
        let mut calibration = json!({
            "robot": { "urdf": urdf },
            "target": [{ "name": keys.target, "at_m": [0.25, 0.02, 0.0], "rpy_deg": [0, 0, 0], "known": { "to_m": 0.02, "to_deg": 2 } }],
            "base": { "at_m": [0, 0, 0], "rpy_deg": [0, 0, 0] },
            "camera": [{ "name": "cam", "at_m": [3, 0, 0.2], "looks_at_m": [0, 0, 0.2], "size_px": [1000, 1000], "focal_px": [900, 900] }],
            "sensor": sensors.collect::<Vec<_>>(),
            "smoother": { "hypotheses": 1, "spawned": 1 },
            "selection": { "evaluations": 10, "ahead": 1 },
        });
        if !keys.channels.iter().any(|(kind, _)| *kind == 3) {
            calibration.as_object_mut().expect("an object").remove("camera");
        }
        if !keys.sockets.is_empty() {
            let postures = [[10, 20], [-30, 5], [25, -20], [0, 30]];
            let socket = |((place, name), posture): (&(&str, &str), [i32; 2])| {
                let mut socket = json!({ "name": name, "posture_deg": posture });
                if !place.is_empty() {
                    socket["place"] = json!(place);
                }
                socket
            };
            calibration["socket"] = keys.sockets.iter().zip(postures).map(socket).collect();
            calibration["sockets"] = json!({ "target": keys.target });
            keys.socket_column.iter().for_each(|column| calibration["sockets"]["socket_column"] = json!(column));
        }
        calibration["held_out"] = keys.held_out.clone();
        calibration
    }

    /// What a session is told of what was read.
    fn told(session: &Session, executed: &Executed) -> Observation {
        let Scenario { robot, measurement_model, .. } = &**session.scenario();
        let always = measurement_model.sensors().iter().zip(&executed.observation.readings);
        let readings =
            always.filter(|(sensor, _)| sensor.subject().occasion == Occasion::Always).map(|(_, reading)| reading);
        let mut measurements: BTreeMap<String, Value> = BTreeMap::new();
        for (shape, reading) in session.channels().iter().zip(readings) {
            let Some(reading) = reading else { continue };
            let told = match shape.shape {
                Shape::Position => json!(reading),
                Shape::Distance | Shape::Depth => json!(reading[0]),
                Shape::Pixels { .. } => json!(reading.chunks(2).collect::<Vec<_>>()),
                Shape::Pose => {
                    let turn = nalgebra::Vector3::from_column_slice(&reading[3..]);
                    let turned = body_schema_table::Rotation::Quaternion.write(turn);
                    json!({ "position": &reading[..3], "quaternion": turned })
                }
                Shape::Sockets { .. } => continue,
            };
            measurements.insert(shape.name.clone(), told);
        }
        let held = executed.movement.socket.map(|socket| robot.sockets[socket].label());
        measurements.extend(held.map(|held| ("socket".to_owned(), json!(held))));
        let configuration = robot.names.iter().cloned().zip(executed.movement.configuration.iter().copied()).collect();
        Observation { suggestion_id: None, configuration, measurements }
    }

    /// Points that are not seen are null in observations and empty in the table, and a reading of too few is none.
    #[test]
    fn points_that_are_not_seen_are_null() {
        let channels = vec![(3, None)];
        let keys = Keys {
            joints: ["a", "b"],
            target: "hand",
            channels,
            sockets: vec![],
            socket_column: None,
            held_out: Value::Null,
        };
        let mut calibration = calibration(&keys);
        let body = &mut calibration["target"][0];
        body["points_m"] = json!([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0], [0, 0, 0.05]]);
        (body["partly_seen"], body["least_points"]) = (json!(true), json!(2));
        calibration["camera"][0]["distortion"] = json!([-0.2, 0.05, 0, 0]);
        let open = |calibration: Value| {
            let mut setup = Setup::new(calibration);
            setup.agent = Some("smoother:random".to_owned());
            Session::open(setup)
        };
        let mut session = open(calibration.clone()).expect("a session");
        let shape = serde_json::to_value(&session.channels()[0]).expect("JSON");
        assert_eq!(shape, json!({ "name": "cam_hand", "channel": "pixels", "points": 4, "least_points": 2 }));
        let measurement_model = session.scenario().measurement_model.clone();
        for (number, mut executed) in session.made_up(12).into_iter().enumerate() {
            let reading = executed.observation.readings[0].as_mut().expect("in view");
            measurement_model.sensors()[0]
                .disturb(reading, &[0.3, -0.7, 1.1, 0.2, -0.4, 0.9, -1.3, 0.1].map(|x| x * (number as f64).cos()));
            let absent = if number == 11 { vec![0, 1, 3] } else { vec![number % 4] };
            absent.iter().for_each(|point| reading[2 * point..2 * point + 2].fill(f64::NAN));
            let mut told = told(&session, &executed);
            assert_eq!(told.measurements["cam_hand"][absent[0]], json!([null, null]));
            if number == 3 {
                told.measurements.get_mut("cam_hand").expect("told")[3] = Value::Null;
            }
            let answer = session.observe(told, None).expect("an answer");
            assert_eq!(answer.seen, number != 11, "{number}");
        }
        let csv = session.observations_csv();
        let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.len(), 11);
        for (number, row) in rows.iter().enumerate() {
            let is_empty: Vec<bool> = row[2..].iter().map(|cell| cell.is_empty()).collect();
            assert_eq!(is_empty, (0..8).map(|cell| cell / 2 == number % 4).collect::<Vec<_>>(), "{csv}");
        }
        session.calibrate(&Options::default(), &Silent).expect("a report");
        // Half a point is none, and of a target that is seen whole nothing may be absent.
        let mut half = told(&session, &session.made_up(1)[0]);
        half.measurements.get_mut("cam_hand").expect("told")[1] = json!([null, 3.0]);
        assert!(format!("{:?}", session.observe(half.clone(), None)).contains("null for one that is not seen"));
        calibration["target"][0]
            .as_object_mut()
            .expect("a table")
            .retain(|key, _| !["partly_seen", "least_points"].contains(&key.as_str()));
        let mut whole = open(calibration).expect("a session");
        half.measurements.get_mut("cam_hand").expect("told")[1] = Value::Null;
        assert!(whole.observe(half, None).is_err());
    }

    /// Of a setup that is opened: what it comes to. The observations are those of the robot as described, with noise.
    fn comes_to_something(keys: &Keys) -> Result<bool, String> {
        let mut setup = Setup::new(calibration(keys));
        setup.agent = Some("smoother:random".to_owned());
        let Ok(mut session) = Session::open(setup) else { return Ok(false) };
        let made_up = session.made_up(16);
        let measurement_model = session.scenario().measurement_model.clone();
        for (number, mut executed) in made_up.into_iter().enumerate() {
            for (sensor, reading) in measurement_model.sensors().iter().zip(&mut executed.observation.readings) {
                let noise: Vec<f64> =
                    (0..sensor.equations()).map(|index| ((number * 7 + index * 3 + 1) as f64 * 1.7).sin()).collect();
                let always = reading.as_mut().filter(|_| sensor.subject().occasion == Occasion::Always);
                always.into_iter().for_each(|reading| sensor.disturb(reading, &noise));
            }
            let told = told(&session, &executed);
            session.observe(told, None).map_err(|error| format!("an observation: {error}"))?;
        }
        session.calibrate(&Options::default(), &Silent).map_err(|error| format!("a report: {error}"))?;
        Ok(true)
    }

    /// Either a setup is refused when it is opened, or there is a report once enough was observed.
    #[test]
    fn who_may_observe_gets_a_report() {
        const CASES: u32 = 200;
        let config = Config { cases: CASES, failure_persistence: None, ..Config::default() };
        let opened = Cell::new(0);
        let ran = TestRunner::new(config).run(&keys(), |keys| {
            let came = comes_to_something(&keys);
            prop_assert!(came.is_ok(), "{:?}", came);
            opened.set(opened.get() + u32::from(came == Ok(true)));
            Ok(())
        });
        ran.unwrap_or_else(|error| panic!("{error}"));
        assert!((CASES / 20..CASES).contains(&opened.get()), "{} of {CASES} are opened", opened.get());
    }

    fn usual() -> Keys {
        let (channels, held_out) = (vec![(0, None)], Value::Null);
        Keys { joints: ["shoulder", "elbow"], target: "hand", channels, sockets: vec![], socket_column: None, held_out }
    }

    /// The named instances, and who is not in anybody's way.
    #[test]
    fn names_that_are_in_each_others_way_are_refused_at_the_opening() {
        let of = |columns: &[&'static str]| Keys { channels: vec![(0, Some(columns.to_vec()))], ..usual() };
        let two = |first: &[&'static str], second: &[&'static str]| Keys {
            channels: vec![(0, Some(first.to_vec())), (2, Some(second.to_vec()))],
            ..usual()
        };
        for (keys, field) in [
            (of(&["x", "y"]), "sensor.columns"),
            (of(&["x", "y", "y"]), "sensor.columns"),
            (of(&[]), "sensor.columns"),
            (of(&["shoulder", "y", "z"]), "sensor.columns"),
            (of(&[" x", "y", "z"]), "sensor.columns"),
            (of(&["x", "y", "z "]), "sensor.columns"),
            (of(&["x", "y", "nan"]), ""),
            (two(&["x", "y", "z"], &["z"]), "sensor.columns"),
            (two(&["x", "y", "z"], &["d"]), ""),
            (of(&["x", "elbow_deg", "z"]), "sensor.columns"),
            (Keys { joints: ["a", "a_deg"], ..usual() }, "robot.urdf"),
            (Keys { joints: ["a ", "b"], ..usual() }, "robot.urdf"),
            (Keys { joints: ["hand_x", "b"], ..usual() }, "sensor.columns"),
            (Keys { joints: ["hand_x", "b"], ..of(&["x", "y", "z"]) }, ""),
            (Keys { sockets: vec![("", "1"), ("", "1 ")], ..usual() }, "socket"),
            (Keys { sockets: vec![("", "1"), ("", "nan")], ..usual() }, "socket"),
            (Keys { sockets: vec![("", "1"), ("", "2")], ..usual() }, ""),
            (Keys { sockets: vec![("", "1")], joints: ["socket", "b"], ..usual() }, "sockets.socket_column"),
            (Keys { held_out: json!({ "file": "other.csv" }), ..usual() }, "held_out.file"),
            (Keys { held_out: json!({ "count": 100 }), ..usual() }, ""),
            (Keys { held_out: json!({ "by": "place", "train": ["front"] }), ..usual() }, "held_out.by"),
        ] {
            let opened = Session::open(Setup::new(calibration(&keys))).map(drop);
            match opened {
                Ok(()) => assert!(field.is_empty(), "{keys:?} is opened"),
                Err(SetupError::Invalid(faults)) => {
                    assert_eq!(faults[0].field, field, "{keys:?}: {faults:?}");
                    assert!(!faults[0].hint.is_empty() && !faults[0].what.is_empty(), "{faults:?}");
                }
                Err(other) => panic!("{keys:?}: {other}"),
            }
        }
    }
}
