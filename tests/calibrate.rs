//! Calibration as a user meets it: files in, files out.

pub mod certificate;
mod entered;
mod sentences;
mod shapes;
mod without_urdf;

use std::{
    collections::BTreeMap,
    path::Path,
    process::{Command, Output},
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use body_schema::{
    calibration::{Calibration, Case, Figures, File, Options, Report, Silent, calibrate},
    kinematics::Joint,
    robot::Urdf,
    scenario::{Described, Scenario, builtin},
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const TIAGO: &str = include_str!("urdf/robots/tiago.urdf");

fn body_schema(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_body-schema")).args(arguments).output().expect("the program starts")
}

fn done(arguments: &[&str]) -> String {
    let output = body_schema(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Exit code and standard error.
fn failure(arguments: &[&str]) -> (i32, String) {
    let output = body_schema(arguments);
    (output.status.code().expect("an exit code"), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Of a calibration whose description alone is looked at: nothing is held out, and no correction beyond the axes is tried.
pub fn axes_alone() -> Options {
    Options { folds: Some(0), ..Options::default() }
}

/// TIAGo's table with the URDF that its axes are from.
fn tiago() -> Scenario {
    let mut scenario = builtin("tiago-mocap").expect("built in");
    let urdf = Urdf::parse(TIAGO).expect("a URDF");
    let chain = urdf.chain("base_footprint", "arm_tool_link").expect("a chain");
    scenario.robot.state.joints = chain.state().joints;
    scenario.robot.described = Some(Arc::new(Described { file: "tiago.urdf".to_owned(), urdf, chain }));
    scenario
}

/// A robot that ships, calibrated as it is by default: once for all tests that look at it, since some take half a minute.
fn shipped(name: &str) -> (Scenario, Arc<Calibration>) {
    type Kept = Arc<OnceLock<Arc<Calibration>>>;
    static FOUND: Mutex<BTreeMap<String, Kept>> = Mutex::new(BTreeMap::new());
    let scenario = builtin(name).expect("built in");
    let kept = FOUND.lock().unwrap_or_else(PoisonError::into_inner).entry(name.to_owned()).or_default().clone();
    let found = kept.get_or_init(|| {
        let case = Case::new(&scenario).expect("measured");
        Arc::new(calibrate(&case, &Options::default(), &Silent).expect("calibrated"))
    });
    let found = found.clone();
    (scenario, found)
}

/// Its calibration by five folds, with all files.
fn by_folds(scenario: &Scenario) -> (Report, Vec<File>) {
    let case = Case::new(scenario).expect("measured");
    let found = calibrate(&case, &Options { folds: Some(5), active: None }, &Silent).expect("calibrated");
    let files = found.files(&case).expect("writable");
    (found.report, files)
}

fn text<'a>(files: &'a [File], path: &str) -> &'a str {
    &files.iter().find(|file| file.path == path).unwrap_or_else(|| panic!("{path}")).text
}

fn placed(placement: &body_schema::calibration::Placement) -> Isometry3<f64> {
    let [roll, pitch, yaw] = placement.rpy_rad;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(placement.xyz_m), rotation)
}

/// The headline is the written files': read back, with base and target of the report, they miss by the same.
#[test]
fn the_written_urdf_predicts_what_the_report_says() {
    let scenario = tiago();
    let (report, files) = by_folds(&scenario);
    let case = Case::new(&scenario).expect("measured");
    let held_out = report.held_out.expect("folds");
    let (mut sum, mut count) = (0.0, 0.0);
    for fold in &held_out.folds {
        let written = Urdf::parse(text(&files, &format!("folds/{}/calibrated.urdf", fold.fold))).expect("a URDF");
        let chain = written.chain("base_footprint", "arm_tool_link").expect("the same chain");
        assert_eq!(fold.targets[0].link, "arm_tool_link");
        for row in fold.rows.iter().map(|row| &case.rows[row - 1]) {
            let target = chain.tip_at(&row.positions) * Point3::from(fold.targets[0].xyz_m);
            let measured = Point3::from_slice(row.observation.readings[0].as_ref().expect("seen"));
            sum += (placed(&fold.base) * target - measured).norm() * 1e3;
            count += 1.0;
        }
    }
    assert!((sum / count - held_out.after.mean_mm.expect("lengths")).abs() < 1e-9, "{}", sum / count);
    assert_eq!(count, 96.0);
    assert!(text(&files, "kinematics.yaml").contains("arm_4_joint:\n    x: "));
    assert!(text(&files, "readings.yaml").contains("kinematics:\n"));
    assert_ne!(text(&files, "calibrated.urdf"), TIAGO);
}

/// Another library recomputes the figures from the written files and the tables: of folds, and of sockets. Which Python has it
/// `BODY_SCHEMA_PYTHON` says (`pip install -r tests/requirements.txt`); without that variable `python3` may lack it.
#[test]
fn another_library_recomputes_the_held_out_figure() {
    let asked = std::env::var("BODY_SCHEMA_PYTHON");
    let python = asked.clone().unwrap_or_else(|_| "python3".to_owned());
    let library = Command::new(&python).args(["-c", "import yourdfpy"]).output();
    if !library.is_ok_and(|output| output.status.success()) {
        assert!(asked.is_err(), "{python} has no yourdfpy");
        eprintln!("{python} has no yourdfpy: not recomputed");
        return;
    }
    let tiago = by_folds(&tiago());
    let (panda, found) = shipped("panda-sockets");
    let files = found.files(&Case::new(&panda).expect("measured")).expect("written");
    for (name, (report, files), table) in [
        ("tiago", tiago, &["scenarios/tiago-mocap.csv,scenarios/tiago-mocap-1504.csv", "x1", "y1", "z1"][..]),
        ("panda", (found.report.clone(), files), &["scenarios/panda-sockets.csv"]),
    ] {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("calibrated").join(name);
        for File { path, text } in files {
            let place = folder.join(path);
            std::fs::create_dir_all(place.parent().expect("a folder")).expect("created");
            std::fs::write(place, text).expect("written");
        }
        let script = "tests/calibrate/held_out.py";
        let output = Command::new(&python).arg(script).arg(&folder).args(table).output().expect("it starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let theirs: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let after = report.held_out.expect("judged").after;
        assert_eq!(theirs["readings"].as_u64(), Some(after.readings as u64), "{name}");
        let apart_mm = theirs["mean_mm"].as_f64().expect("a number") - after.mean_mm.expect("lengths");
        assert!(apart_mm.abs() < 1e-3, "{name}: {apart_mm} mm");
    }
}

/// A robot that calibrates itself by a ball in two sockets: what it learned at one place holds at the seven others, and chosen
/// rows do with few.
#[test]
fn a_ball_in_two_sockets_calibrates_a_panda() {
    let output = done(&["calibrate", "panda-sockets", "--active", "12", "--json", "-"]);
    let report: Report = serde_json::from_str(&output).expect("JSON");
    let held_out = report.held_out.expect("seven places");
    let (before, after) = (held_out.before.mean_mm.expect("lengths"), held_out.after.mean_mm.expect("lengths"));
    assert!((7.5..8.7).contains(&before) && after <= 0.40, "{before} {after}");
    let after = |rows: usize| {
        let point = report.active.iter().find(|point| point.rows == rows).expect("as many");
        (point.active_mm.expect("judged"), point.random_median_mm.expect("judged"))
    };
    let ((chosen, random), (last, at_random)) = (after(10), after(12));
    assert!(random >= 1.4 * chosen, "{chosen} {random}");
    assert!(last <= 0.40 && at_random >= 1.25 * last, "{last} {at_random}");
}

/// Other robots: held-out errors in mm that the description has at least, and that are left at most.
#[test]
fn held_out_errors_of_other_robots_fall() {
    for (name, before_mm, after_mm) in [
        ("kinova-sockets", 4.0, 3.2),
        ("tiago-mocap-3", 3.6, 2.6),
        ("ur10-camera", 10.0, 4.5),
        ("fr3-hand-eye", 4.4, 1.18),
        ("talos-contact", 4.0, 0.8),
        ("positioner", 0.40, 0.40),
    ] {
        let (scenario, found) = shipped(name);
        let case = Case::new(&scenario).expect("measured");
        let held_out = found.report.held_out.as_ref().expect("held out");
        let (before, after) = (held_out.before.mean_mm.expect("lengths"), held_out.after.mean_mm.expect("lengths"));
        assert!(before > before_mm && after < after_mm, "{name}: {before} {after}");
        assert!(!found.files(&case).expect("writable").is_empty());
    }
}

/// Every file is there, the report says the same everywhere, and needs nothing from the network.
#[test]
fn a_calibration_writes_its_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let path = out.to_str().expect("text");
    let said = done(&["calibrate", "tiago-mocap", "--folds", "5", "--active", "6", "--out", path]);
    assert!(said.contains("held out, calibrated") && said.contains("report.html"), "{said}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let report: serde_json::Value = serde_json::from_str(&read("report.json")).expect("JSON");
    for key in ["rows", "parameters", "training", "held_out", "outliers", "base", "targets", "joints", "active"] {
        assert!(!report[key].is_null(), "{key}");
    }
    for (part, figures) in [("training", ["before", "after", "after"]), ("held_out", ["before", "after", "full_model"])]
    {
        for figure in figures {
            for number in ["mean_mm", "rms_mm", "max_mm"] {
                assert!(report[part][figure][number].is_f64(), "{part}.{figure}.{number}");
            }
        }
    }
    assert_eq!(report["parameters"]["learned"], 39);
    assert!(report["parameters"]["rank"].as_u64() < Some(39) && report["parameters"]["undetermined"][0].is_string());
    let active = report["active"].as_array().expect("points");
    assert_eq!(
        active.iter().map(|point| point["rows"].as_u64()).collect::<Vec<_>>(),
        (1..=6).map(Some).collect::<Vec<_>>()
    );
    for key in ["active_mm", "random_median_mm", "random_q25_mm", "random_q75_mm"] {
        assert!(active.iter().all(|point| point[key].is_f64()), "{key}");
    }
    // Chosen rows are worth more than random ones once there are enough to place the robot.
    assert!(active[5]["active_mm"].as_f64() < active[5]["random_median_mm"].as_f64(), "{active:?}");
    assert_eq!(report["residuals"].as_array().map(Vec::len), Some(96));
    let mean = format!("{:.2}", report["held_out"]["after"]["mean_mm"].as_f64().expect("a number"));
    let (html, markdown) = (read("report.html"), read("report.md"));
    assert!(html.contains(&mean) && markdown.contains(&mean) && said.contains(&mean));
    assert!(html.contains("<svg") && markdown.contains("residuals.svg") && out.join("residuals.svg").exists());
    for outside in ["<script", "<link", "src=", "@import", "url(http"] {
        assert!(!html.contains(outside), "{outside}");
    }
    // Joints written one by one: no URDF, and the report says so.
    assert!(!out.join("calibrated.urdf").exists() && html.contains("so none is written"));
}

/// A calibration that is done again leaves nothing of the one before, and takes no folder that holds anything else.
#[test]
fn a_folder_is_exchanged_as_a_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let path = out.to_str().expect("text");
    done(&["calibrate", "positioner", "--folds", "3", "--out", path]);
    assert!(out.join("folds/0/calibrated.urdf").exists());
    let said = done(&["calibrate", "positioner", "--out", path]);
    assert!(said.starts_with("use calibrated.urdf: yes, because on rows that it has not seen"), "{said}");
    let folds = std::fs::read_dir(out.join("folds")).map_or(0, Iterator::count);
    assert!(out.join("calibrated.urdf").exists() && folds != 3, "{folds} folds");
    assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 1, "nothing is left beside it");
    std::fs::write(out.join("notes.txt"), "mine").expect("written");
    let (code, error) = failure(&["calibrate", "positioner", "--out", path]);
    assert!(code == 2 && error.contains("holds `notes.txt`, which no calibration wrote"), "{code} {error}");
    assert_eq!(std::fs::read_to_string(out.join("notes.txt")).expect("there"), "mine");
}

#[test]
fn with_json_on_standard_output_there_is_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["calibrate", "tiago-mocap", "--json", "-"])
        .current_dir(folder.path())
        .output()
        .expect("the program starts");
    let report: Report = serde_json::from_slice(&output.stdout).expect("JSON alone");
    assert_eq!((report.rows, report.training_rows), (96, 37));
    assert_eq!(report.held_out.expect("another session").after.readings, 59);
    assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 0, "no folder that nobody asked for");
}

#[test]
fn what_cannot_be_calibrated_is_said() {
    for (arguments, said) in [
        (&["calibrate", "arm-6dof"][..], "there is no table to calibrate by"),
        (&["calibrate", "nowhere.toml"], "nowhere.toml cannot be read"),
        (&["calibrate", "tiago-mocap", "--folds", "1"], "96 rows cannot be held out in 1 folds"),
        (&["calibrate", "tiago-mocap", "--active", "40"], "40 rows cannot be chosen from 37 training rows"),
    ] {
        let (code, error) = failure(arguments);
        assert!(code == 2 && error.contains(said), "{arguments:?}: {code} {error}");
    }
}

/// A scatter in sockets is blind to scale: how well that is known stands beside it, and only there.
#[test]
fn a_ball_in_sockets_says_how_large_the_robot_is() {
    let calibrated = |name: &str| {
        let (scenario, found) = shipped(name);
        let files = body_schema::report::files(&found, &Case::new(&scenario).expect("measured"));
        (text(&files, "report.md").to_owned(), found.report.clone())
    };
    let (said, report) = calibrated("panda-sockets");
    let sd_mm = report.span_1m_sd_mm.expect("sockets");
    // 0.1 mm of the known 50 mm are 2 mm of a metre, and the prior of seven axes says no more than a little about that.
    assert!((0.3..2.5).contains(&sd_mm), "{sd_mm}");
    assert!(said.contains(&format!("right to ± {sd_mm:.2} mm")), "{said}");
    assert_eq!(calibrated("tiago-mocap").1.span_1m_sd_mm, None, "a tracker has a scale of its own");
}

/// A long table: what is drawn is thinned, and what is worked out stays in proportion.
#[test]
fn thousands_of_rows_are_calibrated() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    generated(&place("long.csv"), 1500);
    std::fs::copy("scenarios/panda.urdf", place("panda.urdf")).expect("copied");
    done(&["init", &place("panda.urdf"), &place("long.csv"), "--tip", "panda_link8"]);
    let out = place("out");
    done(&["calibrate", &place("long.toml"), "--out", &out]);
    let size = |name: &str| std::fs::metadata(format!("{out}/{name}")).expect(name).len();
    let report: Report =
        serde_json::from_str(&std::fs::read_to_string(format!("{out}/report.json")).expect("written")).expect("JSON");
    assert_eq!((report.rows, report.residuals.len()), (1500, 1500));
    let held_out = report.held_out.expect("folds");
    let (before, after) = (held_out.before.mean_mm.expect("lengths"), held_out.after.mean_mm.expect("lengths"));
    // Three coordinates of 0.5 mm each are 0.8 mm away on average.
    assert!(before > 2.0 && (0.75..0.85).contains(&after), "{before} {after}");
    assert!(size("report.html") < 600_000, "{} bytes: plots are thinned", size("report.html"));
}

/// Rows of a Panda whose third joint is 2 mm and 0.3 degrees off, its target seen to 0.5 mm.
fn generated(file: &str, rows: usize) {
    let text = std::fs::read_to_string("scenarios/panda.urdf").expect("there");
    let chain = Urdf::parse(&text).expect("a URDF").chain("panda_link0", "panda_link8").expect("a chain");
    let mut truth = chain.state();
    if let Joint::Revolute(line) = &mut truth.joints[2] {
        line.point.y += 0.002;
        let turned = line.direction.into_inner() + nalgebra::Vector3::new(0.005, 0.0, 0.0);
        line.direction = nalgebra::UnitVector3::new_normalize(turned);
    }
    let target = chain.frames().pop().expect("a tip").1 * Point3::new(0.05, 0.02, 0.1);
    truth = truth.with_marker(target);
    let limits = chain.limits().expect("limits");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut table = chain.names().join(",") + ",x,y,z\n";
    for _ in 0..rows {
        let theta = limits.draw(&mut rng);
        let seen = truth.marker_at(&theta).coords.map(|x| x + 0.0005 * rng.sample::<f64, _>(StandardNormal));
        let cells: Vec<String> = theta.iter().chain(seen.iter()).map(|x| format!("{x:.7}")).collect();
        table.push_str(&(cells.join(",") + "\n"));
    }
    std::fs::write(file, table).expect("written");
}

/// Three rows are fitted, and the report says what they cannot tell.
#[test]
fn three_rows_say_what_they_cannot_tell() {
    let scenario = tiago();
    let mut case = Case::new(&scenario).expect("measured");
    case.rows.truncate(3);
    let Calibration { report, .. } =
        calibrate(&case, &Options { folds: Some(3), active: None }, &Silent).expect("calibrated");
    assert!(report.parameters.rank <= 9, "{:?}", report.parameters);
    let undetermined = report.parameters.undetermined.concat();
    assert!(undetermined.contains("cannot be told by these rows"), "{undetermined}");
    assert!(report.extras.iter().all(|trial| trial.inner.is_none() && !trial.kept));
    let more_rows = report.more_rows;
    assert!(
        more_rows.said.contains("3 rows leave no equation to spare") && more_rows.rows_needed.is_none(),
        "{more_rows:?}"
    );
}

/// Pictures and distances: what their titles say is written, what no table says is named, and the file is valid.
#[test]
fn init_knows_pictures_and_distances() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    std::fs::copy("scenarios/positioner.urdf", place("arm.urdf")).expect("copied");
    let urdf = Urdf::parse(&std::fs::read_to_string(place("arm.urdf")).expect("there")).expect("a URDF");
    let tip = urdf.leaves().next().expect("a link").to_owned();
    let joints = urdf.chain(urdf.root().expect("one"), &tip).expect("a chain").names().join(",");
    let begun = |name: &str, titles: &str, cells: &str| {
        let rows: String = (0..12).map(|row| format!("0.{row},-0.{row},{cells}\n")).collect();
        std::fs::write(place(&format!("{name}.csv")), format!("{joints},{titles}\n{rows}")).expect("written");
        let said = done(&["init", &place("arm.urdf"), &place(&format!("{name}.csv")), "--tip", &tip]);
        done(&["check", &place(&format!("{name}.toml"))]);
        (said, std::fs::read_to_string(place(&format!("{name}.toml"))).expect("written"))
    };
    let (said, file) = begun("seen", "eye_tag_u1,eye_tag_v1,eye_tag_u2,eye_tag_v2", "700.5,320,710,330");
    assert!(said.contains("`tag1`: a point in a picture, from the columns eye_tag_u1, eye_tag_v1"), "{said}");
    assert!(said.contains("camera `eye`: a picture of 848 × 480, as its points lie in it"), "{said}");
    for line in [
        "camera = \"eye\"",
        "target = \"tag2\"",
        "size_px = [848.0, 480.0]",
        "columns = [\"eye_tag_u1\", \"eye_tag_v1\"]",
    ] {
        assert!(file.contains(line), "{line}: {file}");
    }
    let (said, file) = begun("cable", "hand_distance_mm", "742.5");
    assert!(said.contains("`hand`: the fixed point of its distance is taken for the origin"), "{said}");
    assert!(file.contains("channel = \"distance\"") && file.contains("to_m = [0.0, 0.0, 0.0]"), "{file}");
}

/// A first file from a URDF and a table: what was guessed is said, and nothing is overwritten.
#[test]
fn init_says_what_it_guessed() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    std::fs::write(place("tiago.urdf"), TIAGO).expect("written");
    std::fs::copy("scenarios/tiago-mocap.csv", place("hand.csv")).expect("copied");
    let said = done(&["init", &place("tiago.urdf"), &place("hand.csv"), "--tip", "arm_tool_link"]);
    assert!(said.contains("base: `base_footprint`, the link that hangs on nothing"), "{said}");
    assert!(said.contains("`marker1`: a position, from the columns x1, y1, z1"), "{said}");
    let written = std::fs::read_to_string(place("hand.toml")).expect("written");
    for line in ["urdf = \"tiago.urdf\"", "tip = \"arm_tool_link\"", "file = \"hand.csv\"", "folds = 5"] {
        assert!(written.contains(line), "{line}: {written}");
    }
    // It is a valid file, and calibrates.
    let report: Report = serde_json::from_str(&done(&["calibrate", &place("hand.toml"), "--json", "-"])).expect("JSON");
    let held_out = report.held_out.expect("folds");
    assert!(held_out.after.mean_mm < held_out.before.mean_mm, "{held_out:?}");
    let (code, error) = failure(&["init", &place("tiago.urdf"), &place("hand.csv")]);
    assert!(code == 2 && error.contains("is there already"), "{error}");
    std::fs::write(place("none.csv"), "x,y,z,elbow\n1,2,3,4\n").expect("written");
    let (code, error) = failure(&["init", &place("tiago.urdf"), &place("none.csv")]);
    assert!(code == 2 && error.contains("title columns with the joints' names: torso_lift_joint"), "{error}");
}

/// The pages of the robots that ship say what their reports say today, and so does the page that lists them.
#[test]
fn pages_of_robots_tell_what_is_measured() {
    let list = std::fs::read_to_string("docs/robots/README.md").expect("readable");
    for entry in std::fs::read_dir("docs/robots").expect("pages") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name").to_owned();
        if path.extension().is_none_or(|end| end != "md") || name == "README" {
            continue;
        }
        let page = std::fs::read_to_string(&path).expect("readable");
        let (scenario, found) = shipped(&name);
        let case = Case::new(&scenario).expect("measured");
        let said = body_schema::report::markdown(&found, &case);
        let lead = said.lines().find(|line| line.starts_with("**")).expect("a headline");
        let errors =
            said.lines().skip_while(|line| !line.starts_with("| errors")).take_while(|line| line.starts_with('|'));
        for line in errors.chain([lead]) {
            assert!(page.contains(line), "docs/robots/{name}.md lacks: {line}");
        }
        for sentence in page.lines().filter(|line| line.contains("calibrated robot misses by")) {
            assert!(
                said.lines().any(|line| line == sentence),
                "docs/robots/{name}.md has what is not said: {sentence}"
            );
        }
        let held_out = found.report.held_out.as_ref().expect("rows that are held out");
        let mean = |figures: &Figures| figures.mean_mm.expect("lengths");
        let figures = format!("| {:.2} mm | {:.2} mm |", mean(&held_out.before), mean(&held_out.after));
        let row = list.lines().find(|line| line.contains(&format!("]({name}.md)"))).expect("a row of the list");
        assert!(row.ends_with(&figures), "docs/robots/README.md: {row}, but {figures}");
    }
}
