//! What is begun, and what is said where nothing can be.

use super::{Begun, Sources, begin};
use crate::{Case, Figures};
use body_schema_scenario::Scenario;

/// A description of links and of joints `name type parent child limit`.
fn urdf(links: &str, joints: &[&str]) -> String {
    let links: String = links.split(' ').map(|link| format!("<link name=\"{link}\"/>\n")).collect();
    let joint = |joint: &&str| {
        let words: Vec<&str> = joint.splitn(5, ' ').collect();
        let limit = match words.get(4) {
            Some(&"none") => "",
            Some(limit) => *limit,
            None => "<limit lower=\"-1\" upper=\"1\"/>",
        };
        format!(
            "<joint name=\"{}\" type=\"{}\"><parent link=\"{}\"/><child link=\"{}\"/>{limit}</joint>\n",
            words[0], words[1], words[2], words[3]
        )
    };
    let joints: String = joints.iter().map(joint).collect();
    format!("<robot name=\"r\">\n{links}{joints}</robot>\n")
}

fn sources<'a>(urdf: &'a str, table: &'a str, base: Option<&'a str>, tip: Option<&'a str>) -> Sources<'a> {
    Sources {
        name: "it",
        urdf_file: "robot.urdf",
        urdf,
        shapes_file: None,
        table_file: "data.csv",
        table,
        base,
        tip,
        on: &[],
        tag_side_m: None,
        socket_distance_m: None,
    }
}

fn begun(urdf: &str, table: &str, base: Option<&str>, tip: Option<&str>) -> Result<Begun, String> {
    begin(&sources(urdf, table, base, tip)).map_err(|error| error.to_string())
}

#[track_caller]
fn refused(urdf: &str, table: &str, said: &[&str]) {
    let error = begun(urdf, table, None, None).expect_err("refused");
    said.iter().for_each(|said| assert!(error.contains(said), "{said}: {error}"));
}

#[track_caller]
fn taken(begun: Result<Begun, String>, said: &[&str]) -> Begun {
    let begun = begun.unwrap_or_else(|error| panic!("{error}"));
    said.iter().for_each(|said| assert!(begun.text.contains(said), "{said}: {}", begun.text));
    begun
}

const PLAIN: [&str; 2] = ["a revolute base one", "b revolute one two"];

/// Two arms on a lift, the second as long as the first or not.
fn two_arms(second: &str) -> String {
    urdf(
        "base torso left left_hand right right_hand",
        &[
            "lift prismatic base torso",
            "l1 revolute torso left",
            "l2 revolute left left_hand",
            "r1 revolute torso right",
            &format!("r2 {second} right right_hand"),
        ],
    )
}

#[test]
fn chains_that_tie_are_named_and_none_is_taken() {
    let table = "lift,l1,l2,r1,r2,x,y,z\n0,0,0,0,0,1,2,3\n";
    let said = [
        "2 chains",
        "to `left_hand` by lift, l1, l2; to `right_hand` by lift, r1, r2",
        "--tip left_hand or --tip right_hand",
    ];
    refused(&two_arms("revolute"), table, &said);
    // One that is asked for, or the only one that has columns, is taken.
    let begun_at = begun(&two_arms("revolute"), table, None, Some("right_hand"));
    taken(begun_at, &["tip = \"right_hand\"", "lift, r1, r2, by the titles", "passed over: l1, l2"]);
    taken(begun(&two_arms("revolute"), "lift,r1,r2,x,y,z\n0,0,0,1,2,3\n", None, None), &["tip = \"right_hand\""]);
    // A shorter one is not passed over in silence.
    let shorter = begun(&two_arms("fixed"), table, None, None);
    taken(shorter, &["tip = \"left_hand\"", "not on that chain, though they have columns: `r1`", "--tip right, say"]);
    // Two fingers of a hand.
    let hand = urdf("base one two left right", &[PLAIN[0], PLAIN[1], "f prismatic two left", "g prismatic two right"]);
    refused(&hand, "a,b,f,g,x,y,z\n0,0,0,0,1,2,3\n", &["--tip left or --tip right or --tip two, where they part"]);
    let both = begun(&two_arms("revolute"), table, None, None).expect_err("a tie");
    assert!(!both.contains("where they part"), "most joints come behind: {both}");
    // Two robots in one description.
    let two = urdf("one hand two paw", &["a revolute one hand", "b revolute two paw"]);
    refused(
        &two,
        "a,b,x,y,z\n0,0,1,2,3\n",
        &["from `one` to `hand` by a", "--base one --tip hand or --base two --tip paw"],
    );
}

#[test]
fn several_links_at_the_end_are_no_tie() {
    let hand = urdf("base one two camera finger", &[PLAIN[0], PLAIN[1], "c fixed two camera", "f fixed two finger"]);
    taken(begun(&hand, "a,b,x,y,z\n0,0,1,2,3\n", None, None), &["tip = \"two\"", "several links hang on it"]);
    let gripper = urdf("base one two finger", &[PLAIN[0], PLAIN[1], "f prismatic two finger"]);
    taken(
        begun(&gripper, "a,b,x,y,z\n0,0,1,2,3\n", None, None),
        &["tip = \"two\"", "what hangs on it moves by others"],
    );
}

/// What a table's titles call as links are called is there: an eye on a neck that looks at a hand, an eye in a hand that looks at something
/// that stands still, two hands that are measured from outside.
#[test]
fn names_of_links_say_where_targets_and_cameras_are() {
    let neck = urdf(
        "base torso head eye_optical_frame arm hand",
        &[
            "lift prismatic base torso",
            "pan revolute torso head",
            "mount fixed head eye_optical_frame none",
            "a revolute torso arm",
            "b revolute arm hand",
        ],
    );
    let table = "pan,a,b,eye_tag_u,eye_tag_v\n0,0,0,1,2\n";
    // The lift moves both alike.
    taken(
        begun(&neck, table, None, None),
        &[
            "base = \"torso\"\n# Joints",
            "camera `eye`: on link `eye_optical_frame`, by its name; --on eye=LINK says another",
            "target `tag`: on link `hand`, the end of the longest chain",
            "name = \"tag\"\nlink = \"hand\"\n",
            "name = \"eye\"\nlink = \"eye_optical_frame\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [0.0, 0.0, 0.0]\n",
            "joints: a, b, pan, by the titles",
        ],
    );
    let by_name = begun(&neck, "pan,a,b,eye_hand_u,eye_hand_v\n0,0,0,1,2\n", None, None);
    taken(by_name, &["target `hand`: on link `hand`, by its name"]);
    // The same camera, and something that is measured from outside.
    let outside =
        begun(&neck, "lift,pan,a,b,eye_hand_u,eye_hand_v,hand_x,hand_y,hand_z\n0,0,0,0,1,2,1,2,3\n", None, None);
    taken(outside, &["base = \"base\"\n# Joints", "joints: lift, a, b, pan, by"]);
    refused(
        &neck,
        "pan,a,b,eye_hand_u,eye_hand_v,hand_x,hand_y,hand_z\n0,0,0,1,2,1,2,3\n",
        &["no column for lift", "--coupled"],
    );
    refused(&neck, "pan,a,eye_hand_u,eye_hand_v\n0,0,1,2\n", &["no column for b"]);

    let eye_in_hand = urdf("base one two cam", &[PLAIN[0], PLAIN[1], "m fixed two cam none"]);
    taken(
        begun(&eye_in_hand, "a,b,cam_board_u,cam_board_v\n0,0,1,2\n", None, None),
        &[
            "target `board`: on link `base`, it stands still, and camera `cam` moves",
            "name = \"board\"\nlink = \"base\"\n",
            "it looks along x of link `cam`",
            "link = \"cam\"\nat_m = [0.0, 0.0, 0.0]\nrpy_deg = [-90.0, 0.0, -90.0]\n",
        ],
    );

    let hands = "lift,l1,l2,r1,r2,left_hand_x,left_hand_y,left_hand_z,right_hand_x,right_hand_y,right_hand_z\n0,0,0,0,0,1,2,3,1,2,3\n";
    taken(
        begun(&two_arms("revolute"), hands, None, None),
        &["joints: lift, l1, l2, r1, r2, by", "link = \"right_hand\""],
    );
    // Of one the other arm's columns are passed over, and said to be.
    let one = "lift,l1,l2,r1,r2,left_hand_x,left_hand_y,left_hand_z\n0,0,0,0,0,1,2,3\n";
    let one = taken(
        begun(&two_arms("revolute"), one, None, None),
        &["not between these links, though they have columns: r1, r2"],
    );
    assert!(!one.guesses.iter().any(|guess| guess.said.starts_with("passed over")), "{:?}", one.guesses);
    taken(begun(&two_arms("revolute"), hands, None, Some("left_hand")), &["tip = \"left_hand\""]);

    // A ball in sockets is on the longest chain, whatever else is measured.
    let held = "lift,r1,r2,place,socket,right_x,right_y,right_z\n0,0,0,a,1,1,2,3\n0,1,0,a,1,1,2,3\n";
    taken(
        begun(&two_arms("revolute"), held, None, None),
        &["name = \"ball\"\nlink = \"right_hand\"\n", "name = \"right\"\nlink = \"right\""],
    );
    // What has no name in titles is not the link of that name: a camera may stand beside the robot.
    let mount = urdf(
        "base one two camera_link marker",
        &[PLAIN[0], PLAIN[1], "m fixed two camera_link none", "n fixed one marker none"],
    );
    let beside = begun(&mount, "a,b,camera_marker_u,camera_marker_v\n0,0,1,2\n", None, None);
    let unknown = "looks_at_m = [x, y, z], in the frame of the base.\n[[camera]]\nname = \"camera\"\nknown = \"unknown\"\nsize_px";
    taken(beside, &["tip = \"camera_link\"", "write them before you calibrate", unknown]);
    // How it is on a link that has not its name, nothing tells.
    let on = [("camera".to_owned(), "two".to_owned())];
    let table = "a,b,camera_marker_u,camera_marker_v\n0,0,1,2\n";
    let carried = begin(&Sources { on: &on, ..sources(&mount, table, None, None) });
    let carried = taken(carried.map_err(|error| error.to_string()), &["link = \"two\"\nknown = \"unknown\"\nsize_px"]);
    assert!(!carried.guesses.iter().any(|guess| guess.said.contains("looks along x")), "{:?}", carried.guesses);
}

#[test]
fn links_that_are_said_must_be_there() {
    let arms = two_arms("revolute");
    let told = |on: &[(&str, &str)]| {
        let on: Vec<(String, String)> =
            on.iter().map(|(name, link)| ((*name).to_owned(), (*link).to_owned())).collect();
        let table = "lift,l1,l2,r1,r2,x,y,z\n0,0,0,0,0,1,2,3\n";
        let sources = Sources { on: &on, ..sources(&arms, table, None, None) };
        begin(&sources).map_err(|error| error.to_string())
    };
    taken(told(&[("marker", "right_hand")]), &["joints: lift, r1, r2", "name = \"marker\"\nlink = \"right_hand\""]);
    let unknown = told(&[("tag", "right_hand")]).expect_err("no such target");
    assert!(unknown.contains("no target or camera `tag`") && unknown.contains("name one of marker"), "{unknown}");
    let nowhere = told(&[("marker", "foot")]).expect_err("no such link");
    assert!(nowhere.contains("no link `foot`") && nowhere.contains("left_hand"), "{nowhere}");
}

#[test]
fn a_root_that_floats_or_lies_beside_is_named() {
    for kind in ["floating", "planar"] {
        let root = format!("free {kind} world base none");
        let floating = urdf("world base one two", &[&root, PLAIN[0], PLAIN[1]]);
        let said = ["joint `free` between `world` and `base`", kind, "--base base"];
        refused(&floating, "a,b,x,y,z\n0,0,1,2,3\n", &said);
        let with_tip = begun(&floating, "a,b,x,y,z\n0,0,1,2,3\n", None, Some("two")).expect_err("it floats");
        assert!(with_tip.contains("--base base"), "{with_tip}");
        refused(&floating, "q,x,y,z\n0,1,2,3\n", &["names: a, b", "joint `free` is of type"]);
        taken(begun(&floating, "a,b,x,y,z\n0,0,1,2,3\n", Some("base"), None), &["base = \"base\"", "tip = \"two\""]);
    }
    let orphan = urdf("world base one two", &PLAIN);
    taken(begun(&orphan, "a,b,x,y,z\n0,0,1,2,3\n", None, None), &["base = \"base\"", "tip = \"two\""]);
    let mount = urdf("table leg base one two", &["leg fixed table leg", PLAIN[0], PLAIN[1]]);
    taken(begun(&mount, "a,b,x,y,z\n0,0,1,2,3\n", None, None), &["base = \"base\"", "as `table` do"]);
    taken(begun(&mount, "a,b,x,y,z\n0,0,1,2,3\n", None, Some("two")), &["base = \"base\""]);
}

#[test]
fn joints_that_cannot_be_taken_are_named_with_the_reason() {
    let table = "a,b,x,y,z\n0,0,1,2,3\n";
    // At the beginning no chain is left, at the end it would be cut short.
    refused(
        &urdf("base one two", &["a revolute base one none", PLAIN[1]]),
        table,
        &["line 5", "joint `a` has no <limit>"],
    );
    refused(
        &urdf("base one two", &[PLAIN[0], "b revolute one two none"]),
        table,
        &["line 6", "joint `b` has no <limit>"],
    );
    let still = "<limit lower=\"0\" upper=\"0\"/>";
    refused(
        &urdf("base one two", &[PLAIN[0], &format!("b revolute one two {still}")]),
        table,
        &["joint `b`: it cannot move"],
    );
    refused(&urdf("base one two", &[PLAIN[0], "b floating one two none"]), table, &["joint `b` is of type `floating`"]);
    // Nothing is titled as a joint.
    let odd = urdf(
        "base one two three",
        &[
            "a revolute base one none",
            PLAIN[1],
            "m revolute two three <limit lower=\"0\" upper=\"1\"/><mimic joint=\"b\"/>",
        ],
    );
    let said = [
        "no column of data.csv is titled",
        "its columns are A, x, y, z",
        "names: b",
        "joint `a` has no <limit>",
        "`m` follows",
    ];
    refused(&odd, "A,x,y,z\n0,1,2,3\n", &said);
    refused(&urdf("base one", &["f fixed base one"]), "a,x,y,z\n0,1,2,3\n", &["joints that move"]);
    // A column is missing within.
    let three = urdf("base one two three", &[PLAIN[0], PLAIN[1], "c revolute two three"]);
    refused(&three, "a,c,x,y,z\n0,0,1,2,3\n", &["a column for joint `c` and none for b", "--tip one"]);
    refused(
        &three,
        "b,c,x,y,z\n0,0,1,2,3\n",
        &["a column for joint `c` and none for a", "b, c, x, y, z", "--base one"],
    );
}

#[test]
fn separators_and_missing_titles_are_told() {
    let urdf = urdf("base one two", &PLAIN);
    for (table, said) in [
        ("a;b;x;y;z\n0,5;0;1;2;3\n", "data.csv: line 1: the columns are separated by semicolons"),
        ("-2,07;1,31;0,5;1;2\n-2,07;1,31;0,5;1;2\n", "separated by semicolons"),
        ("a\tb\tx\ty\tz\n0\t0\t1\t2\t3\n", "separated by tabs"),
        ("a|b|x|y|z\n0|0|1|2|3\n", "separated by bars"),
        ("a b  x y z\n0 0  1 2 3\n", "separated by blanks"),
        ("0.5,1.5,1,2,3\n0,0,1,2,3\n", "line 1 holds numbers, no titles"),
        ("", "is empty"),
    ] {
        refused(&urdf, table, &[said]);
        let with_tip = begun(&urdf, table, None, Some("two")).expect_err("refused");
        assert!(with_tip.contains(said), "{with_tip}");
    }
}

#[test]
fn a_title_that_is_a_joints_name_is_no_measurement() {
    let joints = ["x prismatic base one", "y prismatic one two", "z prismatic two three"];
    let gantry = urdf("base one two three", &joints);
    taken(
        begun(&gantry, "x,y,z,x_mm,y_mm,z_mm\n0,0,0,1,2,3\n", None, None),
        &["columns = [\"x_mm\", \"y_mm\", \"z_mm\"]"],
    );
    taken(
        begun(&gantry, "x_mm,y_mm,z_mm,p_x,p_y,p_z\n0,0,0,1,2,3\n", None, None),
        &["columns = [\"p_x\", \"p_y\", \"p_z\"]"],
    );
    taken(
        begun(&gantry, "x,y,z,x_cm,y_cm,z_cm\n0,0,0,1,2,3\n", None, None),
        &["columns = [\"x_cm\", \"y_cm\", \"z_cm\"]"],
    );
    refused(&gantry, "x,y,z,far,near\n0,0,0,1,2\n", &["nothing is measured", "beside the joints' are far, near"]);
    refused(&gantry, "x,y,z\n0,0,0\n", &["of its columns, x, y, z, those beside the joints' are none"]);
}

const PANDA: [&str; 2] = [
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/panda.urdf")),
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/panda-sockets.csv")),
];
const KINOVA: [&str; 2] = [
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/gen3lite.urdf")),
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/kinova-sockets.csv")),
];

fn of_sockets([urdf, table]: [&str; 2], base: &str, tip: &str, socket_distance_m: Option<f64>) -> Begun {
    let sources = Sources {
        name: "it",
        urdf_file: "robot.urdf",
        urdf,
        shapes_file: None,
        table_file: "data.csv",
        table,
        base: Some(base),
        tip: Some(tip),
        on: &[],
        tag_side_m: None,
        socket_distance_m,
    };
    begin(&sources).unwrap_or_else(|error| panic!("{error}"))
}

/// Of real robots, by postures alone: learned where `init` says, the ball scatters elsewhere hardly more than learned at the best place, and
/// less than at most. The order of the rows changes nothing.
#[test]
fn the_place_to_learn_at_is_the_one_that_tells_most_about_the_others() {
    for (name, data, [base, tip]) in [
        ("panda", PANDA, ["panda_link0", "panda_link8"]),
        ("kinova", KINOVA, ["kinova_base_link", "end_effector_link"]),
    ] {
        let [urdf, table] = data;
        let begun = of_sockets(data, base, tip, Some(0.05));
        let trained = |text: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix("train = [\"")).expect("a place");
            line.trim_end_matches("\"]").to_owned()
        };
        let chosen = trained(&begun.text);
        let mut lines: Vec<&str> = table.lines().collect();
        let first = lines.remove(0);
        lines.reverse();
        let reversed = format!("{first}\n{}", lines.join("\n"));
        assert_eq!(trained(&of_sockets([urdf, &reversed], base, tip, None).text), chosen, "{name}");
        let mut places: Vec<&str> = lines.iter().filter_map(|line| line.split(',').next()).collect();
        places.sort_unstable();
        places.dedup();
        let found = |place: &str| {
            let text = begun.text.replace(&format!("train = [\"{chosen}\"]"), &format!("train = [\"{place}\"]"));
            let open = |file: &str| Ok(if file == "data.csv" { table } else { urdf }.to_owned());
            let scenario = Scenario::parse("it.toml", &text, &open).unwrap_or_else(|error| panic!("{error}"));
            let case = Case::new(&scenario).expect("measured");
            let split = case.splits(None).expect("as the file says").remove(0);
            let nominal = case.nominal(&split.training).expect("fitted");
            let fit = case.fit(&case.writable(), &split.training, Some(nominal.state())).expect("fitted");
            Figures::of(&case.residuals(&fit, &split.held_out)).mean().expect("lengths")
        };
        let mut errors: Vec<f64> = places.iter().map(|place| found(place)).collect();
        errors.sort_by(f64::total_cmp);
        let at = found(&chosen);
        assert!(at <= 1.1 * errors[0] && at < errors[errors.len() / 2], "{name}: `{chosen}` {at} of {errors:?} mm");
        assert!(
            begun.guesses.iter().any(|it| it.said.contains(&format!("all places but `{chosen}`, whose"))),
            "{name}"
        );
    }
}

/// A distance that is told is written; one that is not stands first in what is said, with what it costs.
#[test]
fn a_distance_of_sockets_that_is_missing_is_said_first() {
    let told = of_sockets(PANDA, "panda_link0", "panda_link8", Some(0.05));
    assert!(told.text.contains("\ndistance_m = 0.05\nsigma_distance_m = 0.0001\n"), "{}", told.text);
    assert!(!told.text.contains("MISSING"), "{}", told.text);
    let missing = of_sockets(PANDA, "panda_link0", "panda_link8", None);
    let first = missing.guesses[0].to_string();
    assert!(
        first.starts_with("MISSING: how far the two sockets") && first.contains("a span of 1 m is known to ±"),
        "{first}"
    );
    assert!(first.contains("--socket-distance MM"), "{first}");
    assert!(
        missing.text.contains("# MISSING, see above") && !missing.text.contains("\ndistance_m"),
        "{}",
        missing.text
    );
    let single: Vec<&str> = PANDA[1].lines().filter(|line| line.split(',').nth(1) != Some("1")).collect();
    let single = of_sockets([PANDA[0], &single.join("\n")], "panda_link0", "panda_link8", None);
    assert!(single.guesses[0].said.starts_with("MISSING: a distance. With one socket"), "{}", single.guesses[0]);
}

/// What `check` says of the rows, `init` says at once: it begins no file that cannot be used.
#[test]
fn a_table_whose_rows_cannot_be_read_begins_nothing() {
    let robot = urdf("base one two", &PLAIN);
    for (table, said) in [
        ("a,b,x,y,z\nrad,rad,m,m,m\n0,0,1,2,3\n", ["data.csv line 2, column `a`: `rad`", "0.03"]),
        ("a,b,x,y,z\n0,0,1,2,3\n0,0.1,1,2\n", ["line 3 has 4 values, line 1 names 5", "one value per column"]),
        ("a,b,x,y,z\n# morning,,,,\n0,0,1,2,3\n", ["line 2, column `a`: `# morning`", "0.03"]),
        ("a,a_deg,b,x,y,z\n0,0,0,1,2,3\n", ["`a` and `a_deg` say the same", "leave one"]),
        (
            "a,b,x,y,z,qx,qy,qz,qw\n0,0,1,2,3,0,0,0,2\n",
            ["line 2, column `qx`: the quaternion's length", "unit quaternion"],
        ),
        ("a,b,x,y,z,roll,pitch,yaw\n0,0,1,2,3,0,0,90\n", ["90 rad is more than two turns", "`_deg`"]),
    ] {
        refused(&robot, table, &said);
    }
}
