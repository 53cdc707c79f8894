//! `watch` as a user meets it: the TIAGo's own rows, as they are and with a joint that reads wrongly from some row on.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::cli::{body_schema, failure};

/// The rows from which on the joint is off.
const SINCE: usize = 16;
const JOINT: &str = "arm_1_joint";
/// What no test waits longer for.
const PATIENCE: Duration = Duration::from_secs(120);

pub(crate) struct Files(tempfile::TempDir);

impl Files {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    /// The TIAGo's rows with a time a week apart; `off_deg` is what the joint reads too little by.
    pub(crate) fn rows(off_deg: f64) -> Vec<String> {
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
        let text = fs::read_to_string(scenarios.join("tiago-mocap.csv")).expect("the rows");
        let mut lines = text.lines();
        let titles = lines.next().expect("titles");
        let column = titles.split(',').position(|title| title == JOINT).expect("the joint");
        let mut rows = vec![format!("date,{titles}")];
        for (week, line) in lines.enumerate() {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if week >= SINCE {
                let read: f64 = cells[column].parse().expect("a number");
                cells[column] = (read - off_deg.to_radians()).to_string();
            }
            let day = 1 + week * 7;
            rows.push(format!("2026-{:02}-{:02}T08:00:00Z,{}", 1 + day / 28, 1 + day % 28, cells.join(",")));
        }
        rows
    }

    pub(crate) fn write(&self, name: &str, lines: &[String]) -> String {
        let path = self.path(name);
        fs::write(&path, lines.join("\n") + "\n").expect("written");
        path.to_str().expect("text").to_owned()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

fn report(arguments: &[&str]) -> (i32, Value) {
    let output = body_schema(arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("JSON: {told}"));
    (output.status.code().expect("an exit code"), value)
}

#[test]
fn a_quiet_table_ends_with_0_and_a_joint_that_is_off_with_1() {
    let files = Files::new();
    let quiet = files.write("quiet.csv", &Files::rows(0.0));
    let (code, found) = report(&["watch", "tiago-mocap", "--table", &quiet, "--json", "-"]);
    assert_eq!((code, found["changed"].as_bool(), found["sightings"].as_u64()), (0, Some(false), Some(37)), "{found}");
    assert!(found["events"].as_array().is_some_and(Vec::is_empty));

    let off = files.write("off.csv", &Files::rows(1.0));
    let log = files.path("log.jsonl");
    let log = log.to_str().expect("text");
    let (code, found) = report(&["watch", "tiago-mocap", "--table", &off, "--log", log, "--json", "-"]);
    assert_eq!((code, found["changed"].as_bool()), (1, Some(true)), "{found}");
    let first = &found["explanations"][0];
    assert_eq!((first["joint"].as_str(), first["suspect"]["zero"].as_u64()), (Some(JOINT), Some(1)), "{found}");
    let amount = &first["amounts"][0];
    let (value, sd) = (amount["value"].as_f64().expect("a size"), amount["sd"].as_f64().expect("a deviation"));
    assert!((value - 1.0).abs() < 4.0 * sd && sd < 0.3 && amount["unit"] == "deg", "{amount}");
    let [from, to] = [0, 1].map(|k| first["since_90"][k].as_u64().expect("a sighting"));
    assert!(from <= SINCE as u64 + 1 && SINCE as u64 <= to, "{first}");
    let event = &found["events"][0];
    assert_eq!(event["movements"]["positions"].as_array().map(Vec::len), Some(3), "{event}");
    assert!(event["time"].as_str().is_some_and(|time| time.starts_with("2026-")), "{event}");

    // What the log holds is not told anew.
    let logged = fs::read_to_string(log).expect("a log");
    let events = logged.lines().count();
    assert!(events >= 1 && logged.contains("\"kind\":\"alarm\""), "{logged}");
    let output = body_schema(&["watch", "tiago-mocap", "--table", &off, "--log", log]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("the zero of arm_1_joint has moved by +") && said.contains("a change stands"), "{said}");
    assert_eq!(fs::read_to_string(log).expect("a log"), logged);

    // What fits no suspect comes without movements: they would tell others apart.
    let far = files.write("far.csv", &Files::rows(45.0));
    let (code, found) = report(&["watch", "tiago-mocap", "--table", &far, "--json", "-"]);
    assert_eq!((code, &found["explanations"][0]["suspect"]), (1, &Value::from("unlike")), "{found}");
    let events = found["events"].as_array().expect("events").iter();
    let unlike: Vec<&Value> = events.filter(|it| it["explanations"][0]["suspect"] == "unlike").collect();
    assert!(!unlike.is_empty() && unlike.iter().all(|it| it["movements"].is_null()), "{unlike:?}");
}

/// An arm of three joints, and rows of a marker on it with a quarter of a millimetre of play; from row `since` on the second joint's readings are
/// 1 degree too small.
const THREE_JOINTS: &str = r#"<robot name="r"><link name="base"/><link name="post"/><link name="upper"/><link name="fore"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="post"/><axis xyz="0 0 1"/><limit lower="-2" upper="2"/></joint>
<joint name="lift" type="revolute"><parent link="post"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2"/></joint></robot>"#;

fn three_joints(rows: u32, since: u32) -> Vec<String> {
    let mut lines = vec!["turn_deg,lift_deg,elbow_deg,tip_x_mm,tip_y_mm,tip_z_mm".to_owned()];
    for row in 0..rows {
        let [turn, lift, elbow] = [(37, 140, 70), (53, 110, 55), (71, 130, 65)]
            .map(|(step, span, half)| f64::from(row * step % span) - f64::from(half));
        let play = |shift: u32| 0.25 * (f64::from((row * 29 + shift) % 11) / 5.0 - 1.0);
        let [a, b, c] = [turn, lift, lift + elbow].map(f64::to_radians);
        let out = 300.0 * b.cos() + 250.0 * c.cos();
        let [x, y, z] =
            [out * a.cos() - 20.0 * a.sin(), out * a.sin() + 20.0 * a.cos(), 200.0 - 300.0 * b.sin() - 250.0 * c.sin()];
        let read = if row >= since { lift - 1.0 } else { lift };
        lines.push(format!("{turn},{read},{elbow},{},{},{}", x + play(0), y + play(4), z + play(7)));
    }
    lines
}

/// What a joint's zero has moved by is in the description that is written, and nothing else is other than calibrated.
#[test]
fn the_description_is_mended_by_what_has_moved() {
    let files = Files::new();
    let text = |path: PathBuf| path.to_str().expect("text").to_owned();
    let (mended, rows) = (files.path("mended.urdf"), text(files.path("rows.toml")));
    let to = text(mended.clone());
    files.write("robot.urdf", &[THREE_JOINTS.to_owned()]);
    let learned = files.write("rows.csv", &three_joints(60, 60));
    let made = body_schema(&["init", &text(files.path("robot.urdf")), &learned, "--out", &rows]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let quiet = files.write("quiet.csv", &three_joints(30, 30));
    let output = body_schema(&["watch", &rows, "--table", &quiet, "--mend", &to]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && said.contains("nothing has changed") && !mended.exists(), "{said}");

    let (off, json) = (files.write("off.csv", &three_joints(40, 12)), files.path("watch.json"));
    let output = body_schema(&["watch", &rows, "--table", &off, "--mend", &to, "--json", &text(json.clone())]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("with what has moved"), "{said}");
    let told: Value = serde_json::from_str(&fs::read_to_string(json).expect("a report")).expect("JSON");
    let first = &told["explanations"][0];
    let moved = first["amounts"][0]["value"].as_f64().expect("a size");
    assert!(first["joint"] == "lift" && (moved - 1.0).abs() < 0.1, "{first}");

    // `watch` calibrates by all rows; so does `calibrate`.
    let folder = files.path("calibrated");
    let made = body_schema(&["calibrate", &rows, "--out", &text(folder.clone())]);
    assert!(made.status.code().is_some_and(|code| code < 2));
    let [calibrated, written] =
        [folder.join("calibrated.urdf"), mended].map(|path| fs::read_to_string(path).expect("a description"));
    let joints = |urdf: &str| urdf.split("<joint ").skip(1).map(str::to_owned).collect::<Vec<_>>();
    let [[turn, lift, elbow], [turn_now, lift_now, elbow_now]] =
        [joints(&calibrated), joints(&written)].map(|it| <[String; 3]>::try_from(it).expect("three joints"));
    assert_eq!((turn, elbow), (turn_now, elbow_now), "joints that have not moved");
    let turned = |joint: &str| {
        let rpy = joint.split("rpy=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("angles");
        let [roll, pitch, yaw] =
            <[f64; 3]>::try_from(rpy.split(' ').map(|x| x.parse().expect("a number")).collect::<Vec<f64>>())
                .expect("three angles");
        nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    };
    let turn = turned(&lift).rotation_to(&turned(&lift_now)).scaled_axis().map(f64::to_degrees);
    assert!((turn.y - moved).abs() < 0.01 && turn.x.abs() < 0.05 && turn.z.abs() < 0.05, "{turn} {moved}");
}

/// Lines that say nothing are left out with a word; rows come in the order of their times.
#[test]
fn what_says_nothing_is_left_out() {
    let files = Files::new();
    let mut rows = Files::rows(0.0);
    rows[1..].reverse();
    let cells = rows[1].split(',').count();
    rows.push(format!("2026-12-01{}", ",".repeat(cells - 1)));
    rows.push(rows[2].replacen("2026", "some day", 1));
    let table = files.write("odd.csv", &rows);
    let (code, found) = report(&["watch", "tiago-mocap", "--table", &table, "--json", "-"]);
    assert_eq!((code, found["sightings"].as_u64()), (0, Some(37)), "{found}");
    let left_out: Vec<u64> =
        found["left_out"].as_array().expect("a list").iter().filter_map(|it| it["line"].as_u64()).collect();
    assert_eq!(left_out, [39, 40], "{found}");
    let times: Vec<&str> =
        found["heard"].as_array().expect("a list").iter().filter_map(|it| it["time"].as_str()).collect();
    assert!(times.len() == 37 && times.is_sorted(), "{times:?}");

    let one = files.write("one.csv", &rows[..rows.len() - 1]);
    let said = String::from_utf8_lossy(&body_schema(&["watch", "tiago-mocap", "--table", &one]).stdout).into_owned();
    assert!(said.contains("\n1 line was left out\n"), "{said}");
    // A number that is no time of seconds is told, and by a day alone no other is meant.
    let number = |time: &str| {
        let line = |row: &String| format!("{time},{}", row.split_once(',').expect("cells").1);
        let all: Vec<String> = rows[..1].iter().cloned().chain(rows[1..5].iter().map(line)).collect();
        failure(&["watch", "tiago-mocap", "--table", &files.write("number.csv", &all)])
    };
    for (time, word) in [("1700000000000", "milliseconds"), ("20260601", "2026-06-01"), ("", "the time is empty")] {
        let (code, message) = number(time);
        assert!(code == 2 && message.contains(word), "{time}: {message}");
    }
}

#[test]
fn what_cannot_be_watched_is_refused_with_2() {
    let files = Files::new();
    let rows = Files::rows(0.0);
    let table = files.write("rows.csv", &rows);
    let empty = files.write("empty.csv", &[]);
    let titles = files.write("titles.csv", &["a,b".to_owned(), "1,2".to_owned()]);
    let missing = files.path("none.csv");
    let missing = missing.to_str().expect("text");
    let with = |more: &[&str]| -> (i32, String) { failure(&[&["watch", "tiago-mocap"][..], more].concat()) };
    for (arguments, word) in [
        (&["--table", missing][..], "none.csv"),
        (&["--table", &empty][..], "no row"),
        (&["--table", &titles][..], "no column `torso_lift_joint`"),
        (&["--table", &table, "--time", "when"], "when"),
        (&["--table", &table, "--covariate", "heat"], "heat"),
        (&["--table", &table, "--false-alarms-per-year", "0"], "above 0"),
        (&["--table", &table, "--webhook", "https://example.org/"], "relay"),
        (&["--table", &table, "--listen", "127.0.0.1:0"], "--follow"),
        (&["--table", &table, "--log", &table], "--log"),
        (&["--table", &table, "--json", &table], "--json"),
        (&["--follow"], "--table"),
    ] {
        let (code, message) = with(arguments);
        assert!(code == 2 && message.contains(word), "{arguments:?}: {code} {message}");
    }
    assert_eq!(fs::read_to_string(&table).expect("as it was"), rows.join("\n") + "\n");
    let (code, message) = failure(&["watch", "positioner"]);
    assert!(code == 2 && message.contains("name a table of later rows with --table"), "{message}");
    let (code, message) = failure(&["watch", "arm-6dof"]);
    assert!(code == 2 && message.contains("simulates"), "{message}");
}

/// Rows at one time, as a column of days has them, are watched like others; a day and a time of the day are one time.
#[test]
fn equal_times_hide_no_change() {
    let files = Files::new();
    let with = |name: &str, titles: &str, time: &dyn Fn(&str, usize) -> String| {
        let mut rows = Files::rows(1.0);
        for (index, row) in rows.iter_mut().enumerate() {
            let (first, rest) = row.split_once(',').expect("cells");
            *row = if index == 0 { format!("{titles},{rest}") } else { format!("{},{rest}", time(first, index)) };
        }
        files.write(name, &rows)
    };
    let all = with("all.csv", "date", &|_, _| "2026-06-01".to_owned());
    let many = with("many.csv", "date", &|_, index| format!("2026-06-{:02}", 1 + index / 12));
    let pair = with("pair.csv", "date,time", &|time, _| format!("{},08:15:00", &time[..10]));
    let other = with("other.csv", "time,date", &|time, _| format!("08:15,{}", &time[..10]));
    for table in [&all, &many, &pair, &other] {
        let (code, found) = report(&["watch", "tiago-mocap", "--table", table, "--json", "-"]);
        assert_eq!((code, found["explanations"][0]["joint"].as_str()), (1, Some(JOINT)), "{table}: {found}");
        assert_eq!(found["sightings"], 37, "{table}: {found}");
        if *table == pair || *table == other {
            let time = found["events"][0]["time"].as_str().unwrap_or_default();
            assert!(time.ends_with("T08:15:00Z"), "{time}");
        }
    }
    let output = body_schema(&["watch", "tiago-mocap", "--table", &all]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("the same time: 52 sightings a year"), "{told}");
    let timeless: Vec<String> =
        Files::rows(1.0).iter().map(|row| row.split_once(',').expect("cells").1.to_owned()).collect();
    let timeless = files.write("timeless.csv", &timeless);
    let output = body_schema(&["watch", "tiago-mocap", "--table", &timeless]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(told.matches("line 2 has no time: 52 sightings a year").count(), 1, "{told}");
    assert_eq!(told.matches("sightings a year").count(), 1, "{told}");
    let output = body_schema(&["watch", "tiago-mocap", "--table", &many]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("is not later than that of a row before it"), "{told}");
}

/// A table that is begun anew repeats rows: they are counted, and what comes after its old end is heard again.
#[test]
fn a_table_that_is_begun_anew_is_heard_again_after_its_old_end() {
    let files = Files::new();
    let rows = Files::rows(0.0);
    let table = files.write("turned.csv", &rows[..10]);
    let (_running, address) = Running::following(&table, &[], Stdio::null());
    let wait = |sightings: u64, left_out: usize| {
        let began = Instant::now();
        loop {
            let status: Value = serde_json::from_str(&ask(&address, "GET /status", "").1).expect("JSON");
            if status["sightings"] == sightings && status["left_out"].as_array().map(Vec::len) == Some(left_out) {
                return;
            }
            assert!(began.elapsed() < PATIENCE, "{sightings}, {left_out}: {status}");
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    wait(9, 0);
    // Shorter by its first two rows.
    let kept = [&rows[..1], &rows[3..10]].concat();
    fs::write(&table, kept.join("\n") + "\n").expect("written");
    wait(9, 7);
    // Three more lines: two lie before the old end, and one of these is late as well.
    let mut file = fs::OpenOptions::new().append(true).open(&table).expect("the table");
    file.write_all((rows[10].clone() + "\n" + &rows[4] + "\n").as_bytes()).expect("added");
    wait(10, 8);
    // Behind the old end a row that is late is one that is heard.
    file.write_all((rows[4].clone() + "\n").as_bytes()).expect("added");
    wait(11, 8);
}

/// Another table's events are new to a log; an output that would replace the log is refused.
#[test]
fn a_log_holds_the_events_of_several_tables() {
    let files = Files::new();
    let one = files.write("one.csv", &Files::rows(1.0));
    // One joint, one line, one time; other readings.
    let other = files.write("other.csv", &Files::rows(1.01));
    let log = files.path("log.jsonl");
    let log = log.to_str().expect("text");
    let (code, message) = failure(&["watch", "tiago-mocap", "--table", &one, "--log", log, "--json", log]);
    assert!(code == 2 && message.contains("--log and --json"), "{message}");
    let count = |table: &str| {
        let output = body_schema(&["watch", "tiago-mocap", "--table", table, "--log", log]);
        assert_eq!(output.status.code(), Some(1));
        fs::read_to_string(log).expect("a log").lines().count()
    };
    let first = count(&one);
    let both = count(&other);
    assert!(first >= 1 && both > first, "{first} {both}");
    assert_eq!((count(&one), count(&other)), (both, both));
    let (code, message) = failure(&["watch", "tiago-mocap", "--table", &one, "--log", log, "--json", log]);
    assert!(code == 2 && message.contains("--json"), "{message}");
    assert_eq!(fs::read_to_string(log).expect("a log").lines().count(), both);
}

/// A running watch; ended when it is dropped.
pub(crate) struct Running(Child);

impl Running {
    /// One that follows a table, and the address at which it answers.
    pub(crate) fn following(table: &str, more: &[&str], errors: Stdio) -> (Self, String) {
        let child = Command::new(env!("CARGO_BIN_EXE_body-schema"))
            .args(["watch", "tiago-mocap", "--table", table, "--follow", "--listen", "127.0.0.1:0"])
            .args(more)
            .stdout(Stdio::piped())
            .stderr(errors)
            .spawn()
            .expect("the program starts");
        let mut running = Self(child);
        let mut lines = BufReader::new(running.0.stdout.take().expect("piped")).lines();
        let address = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| Some(line.split_once("http://")?.1.trim_end_matches("/metrics").to_owned()))
            .expect("an address");
        // The rest is read, so that it never waits.
        std::thread::spawn(move || lines.for_each(drop));
        (running, address)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Status line and body of an answer.
pub(crate) fn ask(address: &str, head: &str, body: &str) -> (String, String) {
    let mut stream = TcpStream::connect(address).expect("it listens");
    let request =
        format!("{head} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
    let kind = if body.starts_with('{') { "application/json" } else { "text/csv" };
    let kind = if body.is_empty() { String::new() } else { format!("Content-Type: {kind}\r\n") };
    stream.write_all(format!("{request}{kind}\r\n{body}").as_bytes()).expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("answered");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    (head.lines().next().unwrap_or_default().to_owned(), body.to_owned())
}

/// Rows are appended while it follows, others are sent; its metrics count them, its webhook is told once of the alarm.
#[test]
fn it_follows_a_table_answers_and_tells_a_webhook() {
    let files = Files::new();
    let rows = Files::rows(1.5);
    let table = files.write("growing.csv", &rows[..10]);
    let hook = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}/alarms", hook.local_addr().expect("an address"));
    let (_running, address) = Running::following(&table, &["--webhook", &url], Stdio::inherit());
    let told = std::thread::spawn(move || {
        let (mut stream, _) = hook.accept().expect("it tells");
        let (mut request, mut buffer) = (Vec::new(), [0; 4096]);
        while !String::from_utf8_lossy(&request).contains("\"since\"") {
            let read = stream.read(&mut buffer).expect("a request");
            assert!(read > 0, "the request ends early");
            request.extend(&buffer[..read]);
        }
        stream.write_all(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n").expect("answered");
        String::from_utf8_lossy(&request).into_owned()
    });

    let status = || -> Value { serde_json::from_str(&ask(&address, "GET /status", "").1).expect("JSON") };
    let wait = |what: &str, is_so: &dyn Fn(&Value) -> bool| {
        let began = Instant::now();
        loop {
            let status = status();
            if is_so(&status) {
                return;
            }
            assert!(began.elapsed() < PATIENCE, "{what}: {status}");
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    wait("as it began", &|status| status["sightings"] == 9);
    let append = |text: &str| {
        let mut file = fs::OpenOptions::new().append(true).open(&table).expect("the table");
        file.write_all(text.as_bytes()).expect("added");
    };
    // Half a line is not yet there.
    let (half, rest) = rows[10].split_at(30);
    append(half);
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(status()["sightings"], 9);
    append(&format!("{rest}\nno,row\n"));
    wait("a row, and one that is none", &|status| status["sightings"] == 10 && status["left_out"][0]["line"] == 12);

    let titles = &rows[0];
    let (code, answer) = ask(&address, "POST /sightings", &format!("{titles}\n{}\n", rows[11]));
    let answer: Value = serde_json::from_str(&answer).expect("JSON");
    assert!(code.contains("200") && answer["heard"][0]["sighting"] == 11, "{code} {answer}");
    let object: serde_json::Map<String, Value> =
        titles.split(',').zip(rows[12].split(',')).map(|(title, cell)| (title.to_owned(), cell.into())).collect();
    let (code, answer) = ask(&address, "POST /sightings", &Value::Object(object).to_string());
    assert!(code.contains("200"), "{code} {answer}");
    let (code, answer) = ask(&address, "POST /sightings", "{\"nobody\": 1}");
    assert!(code.contains("422"), "{code} {answer}");
    // What was sent outlives the program.
    let kept = fs::read_to_string(&table).expect("the table");
    assert!(kept.lines().count() == 14 && kept.ends_with(&format!("{}\n", rows[12])), "{kept}");

    // What says nothing is not added, and nothing is glued onto a line that is not ended.
    let (code, answer) = ask(&address, "POST /sightings", "{}");
    assert!(code.contains("400"), "{code} {answer}");
    append("half");
    let (code, answer) = ask(&address, "POST /sightings", &format!("{titles}\n{}\n", rows[13]));
    assert!(code.contains("409") && answer.contains("again"), "{code} {answer}");
    assert!(fs::read_to_string(&table).expect("the table").ends_with("\nhalf"));
    // A byte that is no text takes its own line alone; a year that is mistyped does not stop the time.
    let bytes = [b" a line\nno \xff text\n", rows[13].replacen("2026", "9026", 1).as_bytes(), b"\n"].concat();
    fs::OpenOptions::new().append(true).open(&table).and_then(|mut file| file.write_all(&bytes)).expect("added");
    wait("three lines that are left out", &|status| {
        let lines: Vec<u64> =
            status["left_out"].as_array().into_iter().flatten().filter_map(|it| it["line"].as_u64()).collect();
        let mut sorted = lines.clone();
        sorted.sort_unstable();
        sorted == [12, 15, 16, 17]
    });

    append(&(rows[13..].join("\n") + "\n"));
    wait("an alarm", &|status| status["changed"] == true && status["sightings"] == 37);
    let hooked = told.join().expect("told");
    assert!(hooked.starts_with("POST /alarms") && hooked.contains("\"kind\":\"alarm\""), "{hooked}");
    let (code, metrics) = ask(&address, "GET /metrics", "");
    let has = |line: &str| metrics.lines().any(|it| it == line);
    assert!(code.contains("200") && has("body_schema_watch_sightings_total 37"), "{metrics}");
    assert!(has("body_schema_watch_threshold 2.0") && has("body_schema_watch_changed 1.0"), "{metrics}");
    assert!(
        metrics.contains("body_schema_watch_alarms_total ") && !has("body_schema_watch_alarms_total 0"),
        "{metrics}"
    );
}
