//! Tables of measurements: layouts, units, and what is refused and how.

use std::{f64::consts::FRAC_PI_2, io::Read};

use body_schema::table::{Columns, Guard, Layout, Quantity, Row, Table, TableError};

fn read(text: &str, joint: (&str, Quantity), reading: Option<(Layout, &str)>) -> Result<Vec<Row>, TableError> {
    let table = Table::open(text.as_bytes())?;
    let joints = vec![table.titles().find(joint.0, joint.1)?];
    let readings = reading.map(|(layout, prefix)| table.titles().reading(layout, prefix)).transpose()?;
    let labels = ["place", "socket"].iter().filter_map(|title| table.titles().label(title).ok()).collect();
    table.rows(Columns { joints, readings: readings.into_iter().collect(), labels }).collect()
}

const ELBOW: (&str, Quantity) = ("elbow", Quantity::Angle);

#[track_caller]
fn reads(text: &str, layout: Layout, prefix: &str, wanted: &[f64]) {
    let rows = read(text, ELBOW, Some((layout, prefix))).unwrap_or_else(|error| panic!("{error}"));
    let found = rows[0].observation.readings[0].as_ref().expect("a reading");
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
}

#[test]
fn every_layout_is_read() {
    let turned = [0.31, -0.12, 0.87, 0.0, 0.0, FRAC_PI_2];
    let half = std::f64::consts::FRAC_1_SQRT_2;
    reads("elbow,hand_x,hand_y,hand_z\n0.5,0.31,-0.12,0.87\n", Layout::Position, "hand", &turned[..3]);
    reads("elbow,z_mm,y_mm,x_m\n0.5,870,-120,0.31\n", Layout::Position, "", &turned[..3]);
    let titles = "elbow,hand_x_mm,hand_y_mm,hand_z_mm";
    let at = "30,310,-120,870";
    reads(&format!("{titles},hand_rx,hand_ry,hand_rz_deg\n{at},0,0,90\n"), Layout::Pose, "hand", &turned);
    let rpy = format!("{titles},hand_roll_deg,hand_pitch_deg,hand_yaw_deg\n{at},0,0,90\n");
    reads(&rpy, Layout::Pose, "hand", &turned);
    let quaternion = format!("{titles},hand_qx,hand_qy,hand_qz,hand_qw\n{at},0,0,{half},{half}\n");
    reads(&quaternion, Layout::Pose, "hand", &turned);
    reads("elbow,cam_hand_u_px,cam_hand_v_px\n0.5,412.5,208\n", Layout::Pixels(1), "cam_hand", &[412.5, 208.0]);
    let tag = "elbow,cam_tag_u1,cam_tag_v1,cam_tag_u2,cam_tag_v2\n0.5,1,2,3,4\n";
    reads(tag, Layout::Pixels(2), "cam_tag", &[1.0, 2.0, 3.0, 4.0]);
    reads("elbow,hand_distance_mm\n0.5,742.5\n", Layout::Distance, "hand", &[0.7425]);
}

/// A target's name may have an angle's name in it.
#[test]
fn a_rotation_is_what_all_three_of_its_titles_say() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (titles, rotation, wanted) in [
        ("roller_rx_deg,roller_ry,roller_rz", "90,0,0", [FRAC_PI_2, 0.0, 0.0]),
        ("Roll_deg,Pitch,Yaw_deg", "180,0,90", [2.0 * half * FRAC_PI_2, 2.0 * half * FRAC_PI_2, 0.0]),
    ] {
        let text = format!("elbow,x,y,z,{titles}\n0.5,1,2,3,{rotation}\n");
        let table = Table::open(text.as_bytes()).expect("titles");
        let names: Vec<String> = "x,y,z".split(',').chain(titles.split(',')).map(str::to_owned).collect();
        let reading = table.titles().reading_titled(Layout::Pose, &names).expect("a pose");
        let joints = vec![table.titles().find("elbow", Quantity::Angle).expect("a column")];
        let columns = Columns { joints, readings: vec![reading], labels: Vec::new() };
        let row = table.rows(columns).next().expect("a row").expect("numbers");
        let found = row.observation.readings[0].as_ref().expect("a reading");
        assert!(found[3..].iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{titles}: {found:?}");
    }
}

#[test]
fn titles_of_any_kind_can_be_named() {
    let table = Table::open("phix1,x1,y1,z1,phiy1,phiz1\n".as_bytes()).expect("titles");
    let titles = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let named = titles(&["x1", "y1", "z1", "phix1", "phiy1", "phiz1"]);
    let reading = table.titles().reading_titled(Layout::Pose, &named).expect("a pose");
    assert_eq!(reading.columns.iter().map(|column| column.index).collect::<Vec<_>>(), [1, 2, 3, 0, 4, 5]);
    let error = table.titles().reading_titled(Layout::Position, &named).expect_err("too many");
    assert!(error.to_string().contains("6 columns are named") && error.hint == "name 3", "{error}");
}

#[test]
fn joints_have_their_names_and_units() {
    for (title, value) in [("elbow", "1.5"), ("elbow_rad", "1.5"), ("elbow_deg", "85.94366926962348")] {
        let rows = read(&format!("a,{title}\n0,{value}\n"), ELBOW, None).expect(title);
        assert!((rows[0].positions[0] - 1.5).abs() < 1e-15, "{title}");
    }
    let lift = read("lift_mm\n250\n", ("lift", Quantity::Length), None).expect("a lift");
    assert_eq!(lift[0].positions, [0.25]);
    // A joint is not mistaken for another whose name is longer.
    let error = read("elbow_2\n1\n", ELBOW, None).expect_err("another joint");
    assert!(error.what.contains("no column `elbow`") && error.hint.contains("`elbow_2`"), "{error}");
}

#[test]
fn empty_cells_are_no_reading_and_labels_are_text() {
    let text = "elbow,hand_x,hand_y,hand_z,place,socket\n0.1,,,,front left,1\n\n0.2,1,2,3,back,0\n";
    let rows = read(text, ELBOW, Some((Layout::Position, "hand"))).expect("two rows");
    assert!(rows[0].observation.is_miss() && !rows[1].observation.is_miss());
    assert_eq!((rows[0].line, rows[1].line), (2, 4), "empty lines count");
    assert_eq!(rows[0].labels, ["front left", "1"]);
}

#[test]
fn words_for_nothing_are_no_reading() {
    let titles = "elbow,hand_x,hand_y,hand_z,cam_tag_u,cam_tag_v";
    let read = |cells: &str| {
        let text = format!("{titles}\n0.1,{cells}\n");
        let table = Table::open(text.as_bytes()).expect("titles");
        let joints = vec![table.titles().find("elbow", Quantity::Angle).expect("a column")];
        let readings = [(Layout::Position, "hand"), (Layout::Pixels(1), "cam_tag")]
            .map(|(layout, prefix)| table.titles().reading(layout, prefix).expect("columns"));
        let columns = Columns { joints, readings: readings.into(), labels: Vec::new() };
        table.rows(columns).next().expect("a row").map(|row| row.observation.readings)
    };
    // One sensor of two saw nothing.
    for word in ["nan", "NaN", "-nan", "NA", "n/a", "#N/A", "<NA>", "None", "NULL", "-"] {
        let found = read(&format!("{word},{word},{word},412,208")).expect(word);
        assert_eq!(found, [None, Some(vec![412.0, 208.0])], "{word}");
    }
    assert_eq!(read("1,2,3,nan,").expect("nothing in the picture"), [Some(vec![1.0, 2.0, 3.0]), None]);
    for (cells, what, hint) in [
        ("1,nan,3,412,208", "line 2, column `hand_y`: `nan` is not a finite number", "all cells of this reading empty"),
        ("1,,3,412,208", "line 2, column `hand_y` is empty", "all cells of this reading empty"),
        ("inf,inf,inf,412,208", "line 2, column `hand_x`: `inf` is not a finite number", "such as 0.03"),
        ("no,no,no,412,208", "line 2, column `hand_x`: `no` is not a finite number", "such as 0.03"),
    ] {
        let error = read(cells).expect_err(cells);
        assert!(error.what.contains(what) && error.hint.contains(hint), "{cells}: {error}");
    }
}

#[test]
fn lines_are_counted_whatever_ends_them() {
    let text = "elbow,place\n\n1,a\n\n\n2,\"b\nc\"\n3,d\nx,e";
    for end in ["\n", "\r\n", "\r"] {
        let text = text.replace('\n', end);
        let table = Table::open(text.as_bytes()).expect("titles");
        let columns =
            Columns { joints: vec![table.titles().find("elbow", Quantity::Angle).expect("it")], ..Columns::default() };
        let rows: Vec<_> = table.rows(columns).collect();
        let lines: Vec<usize> = rows.iter().filter_map(|row| Some(row.as_ref().ok()?.line)).collect();
        assert_eq!(lines, [3, 6, 8], "{end:?}");
        let error = rows[3].as_ref().expect_err("no number");
        assert!(error.what.contains("line 9, column `elbow`: `x`"), "{end:?}: {error}");
    }
}

#[test]
fn columns_that_repeat_others_are_known() {
    let table = Table::open("a,b,c,d,e\n1,1,2,5,2\n2,1,3,5,3\n".as_bytes()).expect("titles");
    let mut rows = table.rows(Columns::default());
    assert_eq!(rows.by_ref().filter_map(Result::ok).count(), 2);
    assert_eq!(rows.repeated_columns(), [("e".to_owned(), "c".to_owned())], "b and d never vary");
}

#[test]
fn what_is_wrong_has_line_column_and_mend() {
    for (text, what, hint) in [
        ("", "is empty", "line of titles"),
        ("a,elbow,a\n", "columns 1 and 3 are both called `a`", "a title of its own"),
        ("elbow,elbow_deg\n", "`elbow` and `elbow_deg` say the same", "leave one"),
        ("0.5,1.5\n0.1,0.2\n", "line 1 holds numbers", "begin the table with"),
        ("elbw\n1\n", "has no column `elbow`", "did you mean `elbw`?"),
        ("elbow;x\n1;2\n", "separated by semicolons", "write commas"),
        ("elbow\tx\n1\t2\n", "separated by tabs", "write commas"),
        ("elbow,x\n1,2\n1\n", "line 3 has 1 values, line 1 names 2 columns", "one value per column"),
        ("elbow\nnan\n", "line 2, column `elbow`: `nan` is not a finite number", "0.03"),
        ("elbow\n1\nNone\n", "line 3, column `elbow`: `None` is not a finite number", "where the joint was, as 0.03"),
        ("elbow\n1\ninf\n", "line 3, column `elbow`: `inf` is not a finite number", "0.03"),
        ("elbow\n-2e12\n", "line 2, column `elbow`: `-2e12` is beyond ±1e12", "0.03"),
        ("elbow,x\n1,1\n,1\n", "line 3, column `elbow` is empty", "remove the line"),
        ("elbow\n\"1,5\"\n", "`1,5` is not a finite number", "decimal point: 1.5"),
        ("elbow\n1\0\n", "is not text: its byte 8 is 0", "export the table"),
    ] {
        let error = read(text, ELBOW, None).expect_err(text);
        assert!(error.what.contains(what) && error.hint.contains(hint), "{text:?}: {error}");
    }
    for (text, what) in [
        ("elbow,hand_x,hand_y,hand_z\n1,2,,3\n", "line 2, column `hand_y` is empty"),
        ("elbow,hand_x,hand_y\n1,2,3\n", "has no column `hand_z`"),
    ] {
        let error = read(text, ELBOW, Some((Layout::Position, "hand"))).expect_err(text);
        assert!(error.what.contains(what), "{text:?}: {error}");
    }
    let text = "elbow,x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,0,0.5\n";
    let error = read(text, ELBOW, Some((Layout::Pose, ""))).expect_err(text);
    assert!(error.what.contains("line 2, column `qx`: the quaternion's length is not 1"), "{error}");
    for (angles, is_read) in [("roll,pitch,yaw", false), ("rx,ry,rz", false), ("roll_deg,pitch_deg,yaw_deg", true)] {
        let text = format!("elbow,x,y,z,{angles}\n1,0,0,0,1,2,3\n1,0,0,0,10,-170,12\n");
        match read(&text, ELBOW, Some((Layout::Pose, ""))) {
            Ok(_) => assert!(is_read, "{angles}"),
            Err(error) => {
                assert!(
                    !is_read && error.what.contains("line 3") && error.what.contains("-170 rad is more than two turns")
                );
                assert!(error.hint.contains("`_deg`"), "{error}");
            }
        }
    }
    let latin = Table::open(&b"elbow\n1\n\xe9\n"[..]).expect("titles").rows(Columns::default());
    let error = latin.last().expect("rows").expect_err("not UTF-8");
    assert!(error.what.contains("not text in UTF-8: line 3"), "{error}");
}

#[test]
fn what_never_ends_is_refused() {
    let error = Table::open(std::io::repeat(0)).expect_err("nothing but zeros");
    assert!(error.what.contains("its byte 1 is 0"), "{error}");
    let mut text = Vec::new();
    let error = Guard::new(std::io::repeat(b'a'), 3 << 20).read_to_end(&mut text).expect_err("no end");
    assert!(error.to_string().contains("longer than 3 MiB") && text.len() <= 4 << 20, "{error}");
    let error = Table::open(&b"\xff\xfee\0l\0"[..]).expect_err("UTF-16");
    assert!(error.what.contains("UTF-16"), "{error}");
}
