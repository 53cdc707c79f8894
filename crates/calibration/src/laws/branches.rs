//! A torso with two arms and a head, whose camera sees a tag on each hand: nothing is measured from outside.

use body_schema_engine::model::{Frame, State};
use body_schema_robot::{Chain, Urdf};
use body_schema_scenario::{Scenario, ScenarioError};
use nalgebra::{Isometry3, Matrix4, Point3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::put_off;
use crate::{Calibration, Case, Figures, Options, Silent, Sources, begin, calibrate};

const URDF: &str = include_str!("two_arms.urdf");
/// The corners of a tag of 8 cm, metres.
const TAG: [[f64; 3]; 4] = [[-0.04, -0.04, 0.0], [0.04, -0.04, 0.0], [0.04, 0.04, 0.0], [-0.04, 0.04, 0.0]];
/// Of the camera, pixels.
const FOCAL: f64 = 900.0;
const SIZE: [f64; 2] = [1280.0, 960.0];
const SIGMA: f64 = 0.3;

/// A tag on a hand.
struct Tag {
    name: &'static str,
    link: &'static str,
    place: Isometry3<f64>,
}

/// The robot as it is, and its tags and camera.
struct Truth {
    chain: Chain,
    camera: Isometry3<f64>,
    tags: Vec<Tag>,
}

impl Truth {
    fn new(tags: &[(&'static str, &'static str)], rng: &mut ChaCha8Rng) -> Self {
        let urdf = Urdf::parse(URDF).expect("a URDF");
        let mut chain = urdf.branches("torso", &["left_hand", "right_hand", "head_camera"]).expect("branches");
        put_off(&mut chain, 0.004, 0.01, rng);
        let mut near = |size: f64| {
            let mut vector = |size: f64| nalgebra::Vector3::from_fn(|_, _| rng.random_range(-size..size));
            Isometry3::from_parts(vector(size).into(), UnitQuaternion::from_scaled_axis(vector(0.1)))
        };
        let camera = near(0.01);
        let tags = tags.iter().map(|(name, link)| Tag { name, link, place: near(0.02) }).collect();
        Self { chain, camera, tags }
    }

    fn link(&self, name: &str, positions: &[f64]) -> Isometry3<f64> {
        let index = self.chain.segments.iter().position(|segment| segment.link == name).expect("a link");
        self.chain.links(positions)[index + 1]
    }

    /// Where a tag is in the frame of the camera.
    fn seen(&self, tag: &Tag, positions: &[f64]) -> Isometry3<f64> {
        let camera = self.link("head_camera", positions) * self.camera;
        camera.inverse() * self.link(tag.link, positions) * tag.place
    }

    /// The corners of a tag in the picture, if all are in it.
    fn picture(&self, tag: &Tag, positions: &[f64]) -> Option<Vec<f64>> {
        let place = self.seen(tag, positions);
        let of = |corner: &[f64; 3]| {
            let at = place * Point3::from(*corner);
            let uv = [FOCAL * at.x / at.z + 0.5 * SIZE[0], FOCAL * at.y / at.z + 0.5 * SIZE[1]];
            (at.z > 0.1 && uv.iter().zip(SIZE).all(|(x, size)| (0.0..size).contains(x))).then_some(uv)
        };
        Some(TAG.iter().map(of).collect::<Option<Vec<_>>>()?.concat())
    }

    /// A posture in which a tag is seen.
    fn posture(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let limits = self.chain.limits().expect("limits");
        let mut draws = std::iter::repeat_with(|| limits.draw(rng)).take(100_000);
        draws.find(|q| self.tags.iter().any(|tag| self.picture(tag, q).is_some())).expect("in view")
    }

    /// A table of so many rows, without the columns of `left_out`.
    fn table(&self, rows: usize, left_out: &[&str], rng: &mut ChaCha8Rng) -> String {
        let names = self.chain.names();
        let kept: Vec<usize> = (0..names.len()).filter(|joint| !left_out.contains(&names[*joint].as_str())).collect();
        let mut titles: Vec<String> = kept.iter().map(|joint| names[*joint].clone()).collect();
        for tag in &self.tags {
            titles.extend((1..=TAG.len()).flat_map(|k| ["u", "v"].map(|axis| format!("eye_{}_{axis}{k}", tag.name))));
        }
        let mut lines = vec![titles.join(",")];
        for _ in 0..rows {
            let q = self.posture(rng);
            let mut cells: Vec<String> = kept.iter().map(|joint| q[*joint].to_string()).collect();
            for tag in &self.tags {
                match self.picture(tag, &q) {
                    Some(picture) => cells.extend(picture.iter().map(|x| {
                        let noise: f64 = rng.sample(StandardNormal);
                        (x + SIGMA * noise).to_string()
                    })),
                    None => cells.extend(vec![String::new(); 2 * TAG.len()]),
                }
            }
            lines.push(cells.join(","));
        }
        lines.join("\n") + "\n"
    }

    fn scenario(&self, robot: &str, table: &str) -> Result<Scenario, ScenarioError> {
        let mut toml = format!(
            "name = \"two-arms\"\n[robot]\nurdf = \"robot.urdf\"\n{robot}[measurements]\nfile = \"rows.csv\"\n"
        );
        toml += &format!(
            "[[camera]]\nname = \"eye\"\nlink = \"head_camera\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\nsize_px = {SIZE:?}\n\
             focal_px = [{FOCAL:?}, {FOCAL:?}]\nknown = {{ to_m = 0.02, to_deg = 10.0 }}\n"
        );
        for Tag { name, link, .. } in &self.tags {
            toml += &format!(
                "[[target]]\nname = \"{name}\"\nlink = \"{link}\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\npoints_m = {TAG:?}\n\
                 known = {{ to_m = 0.03, to_deg = 10.0 }}\n[[sensor]]\nchannel = \"pixels\"\ntarget = \"{name}\"\nsigma_px = {SIGMA:?}\n"
            );
        }
        Scenario::parse("two-arms.toml", &toml, &|file| match file {
            "robot.urdf" => Ok(URDF.to_owned()),
            _ => Ok(table.to_owned()),
        })
    }
}

/// Where a target is in the frame of the camera, as a state has it.
fn believed(state: &State, target: usize, positions: &[f64]) -> Isometry3<f64> {
    state.relative(Frame::Target(target), Frame::Device(0), positions)
}

const TAGS: [(&str, &str); 2] = [("left_tag", "left_hand"), ("right_tag", "right_hand")];

/// From the pixels alone rows that were held out are predicted to the noise, and the tags' places to the camera far better than by the
/// description; what cannot be told is one rigid motion.
#[test]
fn two_arms_are_calibrated_by_the_camera_on_their_head() {
    let mut rng = ChaCha8Rng::seed_from_u64(1001);
    let truth = Truth::new(&TAGS, &mut rng);
    let table = truth.table(50, &[], &mut rng);
    let scenario = truth.scenario("", &table).unwrap_or_else(|error| panic!("{error}"));
    let described = scenario.robot.described.as_ref().expect("a URDF");
    assert_eq!(described.chain.base, "torso", "where they part");
    assert!(!scenario.robot.state.tree.is_serial());
    let case = Case::new(&scenario).expect("measured");
    let calibration = calibrate(&case, &Options { folds: Some(3), ..Options::default() }, &Silent).expect("calibrated");
    let Calibration { report, nominal, fit, .. } = &calibration;

    let held_out = report.held_out.as_ref().expect("folds");
    let rms = |figures: &Figures| figures.rms_px.expect("pixels");
    // A corner is off by noise in u and in v.
    let noise = SIGMA * 2_f64.sqrt();
    assert!(rms(&held_out.before) > 10.0 * noise && rms(&held_out.after) < 1.4 * noise, "{held_out:?}");
    assert_eq!(report.parameters.learned - report.parameters.rank, 6);
    let said =
        "all is known up to one rigid motion: 6 directions in which all joints, targets and cameras move together";
    let [only] = report.parameters.undetermined.as_slice() else { panic!("{:?}", report.parameters.undetermined) };
    assert!(only.contains(said), "{only}");
    assert!(report.doubts.is_empty(), "{:?}", report.doubts);
    let chain = report.chain.as_ref().expect("a URDF");
    assert_eq!(
        (chain.tip.as_str(), chain.tips.as_slice()),
        ("left_hand", &["right_hand".to_owned(), "head_camera".to_owned()][..])
    );

    let error = |state: &State, rng: &mut ChaCha8Rng| {
        let mut errors: Vec<f64> = Vec::new();
        for q in (0..200).map(|_| truth.posture(rng)).collect::<Vec<_>>() {
            for (index, tag) in truth.tags.iter().enumerate().filter(|(_, tag)| truth.picture(tag, &q).is_some()) {
                let off = believed(state, index, &q).translation.vector - truth.seen(tag, &q).translation.vector;
                errors.push(off.norm());
            }
        }
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let (before, after) = (error(nominal.state(), &mut rng), error(fit.state(), &mut rng));
    assert!(before > 0.003 && after < 0.1 * before, "{before} m before, {after} m after");
    written_as_reported(&case, &calibration, &mut rng);
}

/// The written description, with the places of tags and camera that the report gives on its links, has everything where the learned
/// state has it.
fn written_as_reported(case: &Case<'_>, calibration: &Calibration, rng: &mut ChaCha8Rng) {
    let Calibration { report, fit, .. } = calibration;
    let chain = &case.described.expect("a URDF").chain;
    let files = calibration.files(case).expect("writable");
    let written = &files.iter().find(|file| file.path == "calibrated.urdf").expect("written").text;
    let tips: Vec<&str> = chain.tips().collect();
    let back = Urdf::parse(written).and_then(|urdf| urdf.branches(&chain.base, &tips)).expect("the same branches");
    as_pinocchio_reads(written, &back);
    let place = |of: &crate::Target| {
        let [roll, pitch, yaw] = of.rpy_rad.expect("a body");
        Isometry3::from_parts(of.xyz_m.into(), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    };
    for q in (0..50).map(|_| chain.limits().expect("limits").draw(rng)).collect::<Vec<_>>() {
        let links = back.links(&q);
        let at = |name: &str| {
            (0..links.len()).find(|link| back.link(*link) == name).map(|link| links[link]).expect("a link")
        };
        let [camera] = report.cameras.as_slice() else { panic!("one camera") };
        let eye = at(&camera.link) * place(camera);
        for (index, target) in report.targets.iter().enumerate() {
            let found = eye.inverse() * at(&target.link) * place(target);
            let wanted = believed(fit.state(), index, &q);
            let apart = (found.translation.vector - wanted.translation.vector).norm();
            assert!(apart < 1e-9 && found.rotation.angle_to(&wanted.rotation) < 1e-9, "{} {apart}", target.name);
        }
        for (link, body) in chain.bodies().into_iter().enumerate() {
            let frames = chain.fitted(&crate::learned::fitted_part(fit.state())).expect("writable").frames;
            let apart = links[body].inverse() * fit.state().frame_at(Frame::Link(link), &q) * frames[link];
            assert!(apart.translation.vector.norm() < 1e-9 && apart.rotation.angle() < 1e-9, "{}", back.link(body));
        }
    }
}

/// Another library has the links of a written description where we have them. Which Python has it, `BODY_SCHEMA_PINOCCHIO` says, as for the
/// branches of described robots.
fn as_pinocchio_reads(written: &str, chain: &Chain) {
    let Ok(python) = std::env::var("BODY_SCHEMA_PINOCCHIO") else { return eprintln!("not compared with pinocchio") };
    let file = std::env::temp_dir().join(format!("body-schema-{}.urdf", std::process::id()));
    std::fs::write(&file, written).expect("a file");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../robot/tests/all/link_poses.py");
    let output =
        std::process::Command::new(python).args([script.as_ref(), file.as_path()]).output().expect("it starts");
    std::fs::remove_file(&file).expect("it was there");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    let ours = text.lines().find(|line| line.contains("body-schema-")).expect("it read the description");
    let read: serde_json::Value = serde_json::from_str(ours).expect("JSON");
    let postures = read["postures"].as_array().expect("a list");
    assert!(!postures.is_empty());
    for posture in postures {
        let pose = |link: &str| {
            let rows = &posture["poses"][link];
            Matrix4::from_fn(|row, column| match row {
                3 => f64::from(column == 3),
                _ => rows[row][column].as_f64().expect("a number"),
            })
        };
        let q: Vec<f64> =
            chain.names().iter().map(|name| posture["positions"][name].as_f64().expect("a number")).collect();
        let base = pose(&chain.base).try_inverse().expect("a pose");
        for (index, link) in chain.links(&q).iter().enumerate() {
            let away = (link.to_homogeneous() - base * pose(chain.link(index))).amax();
            assert!(away < 1e-12, "{}: {away:e}", chain.link(index));
        }
    }
}

/// A calibration file that is begun from the description and the table, and the focal length that nobody can guess: it calibrates the robot
/// as the one that was written by hand.
#[test]
fn a_robot_that_branches_is_begun_by_what_its_links_carry() {
    let mut rng = ChaCha8Rng::seed_from_u64(1003);
    let truth = Truth::new(&TAGS, &mut rng);
    let table_as_counted = truth.table(50, &[], &mut rng);
    let mut table = table_as_counted.clone();
    // `init` counts the corners from the top left one on, clockwise.
    for (tag, _) in TAGS {
        for (k, number) in ["d", "c", "b", "a"].into_iter().enumerate() {
            for axis in ["u", "v"] {
                table = table.replacen(&format!("eye_{tag}_{axis}{}", k + 1), &format!("eye_{tag}_{axis}{number}"), 1);
            }
        }
        for (k, number) in ["a", "b", "c", "d"].into_iter().enumerate() {
            for axis in ["u", "v"] {
                table = table.replacen(&format!("eye_{tag}_{axis}{number}"), &format!("eye_{tag}_{axis}{}", k + 1), 1);
            }
        }
    }
    let on = [("eye", "head_camera"), ("left_tag", "left_hand"), ("right_tag", "right_hand")];
    let on = on.map(|(name, link)| (name.to_owned(), link.to_owned()));
    let sources = |on, tag_side_m| Sources {
        name: "two-arms",
        urdf_file: "robot.urdf",
        urdf: URDF,
        shapes_file: None,
        table_file: "rows.csv",
        table: &table,
        base: None,
        tip: None,
        on,
        tag_side_m,
        socket_distance_m: None,
    };
    let unsaid = begin(&sources(&[], None)).expect_err("the trunk has no column").to_string();
    assert!(unsaid.contains("--base torso") && unsaid.contains("--on NAME=LINK"), "{unsaid}");
    let one_arm = begin(&Sources { base: Some("torso"), ..sources(&[], None) }).expect("the longer arm");
    assert!(one_arm.guesses.iter().any(|guess| guess.to_string().contains("--on NAME=LINK")), "{:?}", one_arm.guesses);
    let points = begin(&sources(&on, None)).expect("points");
    assert!(points.guesses.iter().any(|guess| guess.to_string().contains("--tag-side MM")), "{:?}", points.guesses);

    let begun = begin(&sources(&on, Some(0.08))).unwrap_or_else(|error| panic!("{error}"));
    let said: Vec<String> = begun.guesses.iter().map(ToString::to_string).collect();
    let says = |what: &str| said.iter().any(|said| said.contains(what));
    assert!(says("base: `torso`, the last link that carries all of that"), "{said:?}");
    assert!(says("where it is, is found") && says("`right_tag`: a square tag in a picture"), "{said:?}");
    let text = begun.text.replace(
        "size_px = [1280.0, 1024.0]\nfocal_px = [1280.0, 1280.0]",
        "size_px = [1280.0, 960.0]\nfocal_px = [900.0, 900.0]",
    );
    assert!(text.contains("focal_px = [900.0"), "{text}");
    let open = |file: &str| Ok(if file == "rows.csv" { table.clone() } else { URDF.to_owned() });
    let begun = Scenario::parse("two-arms.toml", &text, &open).unwrap_or_else(|error| panic!("{error}"));
    let written = truth.scenario("", &table_as_counted).unwrap_or_else(|error| panic!("{error}"));
    let [begun, written] = [&begun, &written].map(|scenario| {
        let case = Case::new(scenario).expect("measured");
        let options = Options { folds: Some(3), ..Options::default() };
        let report = calibrate(&case, &options, &Silent).expect("calibrated").report;
        assert_eq!(report.parameters.learned - report.parameters.rank, 6, "{:?}", report.parameters.undetermined);
        assert!(report.doubts.is_empty(), "{:?}", report.doubts);
        report.held_out.expect("folds").after.rms_px.expect("pixels")
    });
    assert!(begun < 1.05 * written && begun < 1.6 * SIGMA * 2_f64.sqrt(), "{begun} {written}");
}

/// Joints of a branch on which nothing is measured need no column: they are held, and the rest is learned as without them.
#[test]
fn joints_of_which_nothing_is_measured_need_no_column() {
    let mut rng = ChaCha8Rng::seed_from_u64(1002);
    let truth = Truth::new(&TAGS[..1], &mut rng);
    let right = ["right_shoulder_pan", "right_shoulder_lift", "right_elbow"];
    let table = truth.table(30, &right, &mut rng);
    let scenario = |robot: &str| truth.scenario(robot, &table).unwrap_or_else(|error| panic!("{error}"));
    let fitted = |scenario: &Scenario| {
        let case = Case::new(scenario).expect("measured");
        let rows: Vec<usize> = (0..case.rows.len()).collect();
        let nominal = case.nominal(&rows).expect("fitted");
        let fit = case.fit(&case.writable(), &rows, Some(nominal.state())).expect("fitted");
        (case.determined(&fit), fit)
    };
    let base = "base = \"torso\"\n";
    let all = scenario(&format!("{base}tips = [\"left_hand\", \"right_hand\", \"head_camera\"]\n"));
    let ((told, fit), (alone, wanted)) = (fitted(&all), fitted(&scenario("")));
    assert_eq!(fit.state().joints.len(), wanted.state().joints.len() + 3);
    let said = "the table has no column of right_shoulder_pan, right_shoulder_lift and right_elbow, with which nothing moves that is \
                measured: they are held at 0 and stay as described";
    assert_eq!(told.undetermined[0], said);
    assert_eq!(
        (told.learned, told.rank, &told.undetermined[1..]),
        (alone.learned, alone.rank, &alone.undetermined[..])
    );
    let learned = |state: &State, name: &str, of: &Scenario| {
        state.joints[of.robot.names.iter().position(|joint| joint == name).expect("a joint")]
    };
    for joint in &scenario("").robot.names {
        let (with, without) = (learned(fit.state(), joint, &all), learned(wanted.state(), joint, &scenario("")));
        assert!(with.direction().angle(&without.direction()) < 1e-6, "{joint}");
    }
    for joint in right {
        assert_eq!(learned(fit.state(), joint, &all), learned(&all.robot.state, joint, &all), "{joint} stays");
    }
    // All columns of what is doubted are those of a joint.
    let examination = all.examine().expect("measured");
    assert!(
        examination.diagnostics.iter().all(|doubt| doubt.column.as_deref() != Some("")),
        "{:?}",
        examination.diagnostics
    );

    let without = |left_out: &str| {
        let table = truth.table(30, &[left_out], &mut ChaCha8Rng::seed_from_u64(1003));
        truth.scenario("", &table).expect_err("a joint is needed").to_string()
    };
    for joint in ["left_elbow", "head_tilt"] {
        let error = without(joint);
        assert!(error.contains(&format!("has no column `{joint}`")), "{error}");
    }
}
