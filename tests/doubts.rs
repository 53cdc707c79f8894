//! For each way in which a file may be wrong, one made from a real robot's, and the sentence that comes out.

use std::{collections::BTreeMap, sync::LazyLock};

use body_schema::{
    diagnostics::{Diagnostic, DiagnosticKind, Evidence, Examination, Subject, examine},
    kinematics::Joint,
    robot::Urdf,
    scenario::Scenario,
    table::{Columns, Quantity, Table},
};
use nalgebra::Point3;

/// The robot whose table is spoilt, and of which seven rows are held out.
static TIAGO: LazyLock<String> = LazyLock::new(|| {
    let toml = include_str!("../scenarios/tiago-mocap.toml");
    toml.replace("file = \"tiago-mocap-1504.csv\"", "count = 7")
});
/// The same robot's rows as they were first published: joints and markers were paired 3.9 s apart, and the hand had begun to move.
const LATE_CSV: &str = include_str!("doubts/tiago-late.csv");
const TIAGO_CSV: &str = include_str!("../scenarios/tiago-mocap.csv");
const PANDA: &str = include_str!("urdf/robots/panda-mukca.urdf");
const PANDA_CSV: &str = include_str!("doubts/panda-front-center.csv");

/// A table that can be spoilt.
struct Sheet {
    titles: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Sheet {
    fn new(text: &str) -> Self {
        let mut lines = text.lines();
        let titles = lines.next().expect("titles").split(',').map(str::to_owned).collect();
        let rows = lines.map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect()).collect();
        Self { titles, rows }
    }

    fn column(&self, title: &str) -> usize {
        self.titles.iter().position(|given| given == title).expect(title)
    }

    fn change(&mut self, title: &str, change: impl Fn(f64) -> f64) {
        let column = self.column(title);
        self.rows.iter_mut().for_each(|row| row[column] = change(row[column]));
    }

    fn swap_titles(&mut self, one: &str, other: &str) {
        let (one, other) = (self.column(one), self.column(other));
        self.titles.swap(one, other);
    }

    fn text(&self) -> String {
        let rows = self.rows.iter().map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
        std::iter::once(self.titles.join(",")).chain(rows).collect::<Vec<_>>().join("\n") + "\n"
    }
}

fn tiago(toml: &str, csv: &str) -> Examination {
    let scenario = Scenario::parse("my.toml", toml, &|_| Ok(csv.to_owned())).unwrap_or_else(|error| panic!("{error}"));
    scenario.examine().expect("measured")
}

/// The doubts about TIAGo's table after a change.
fn spoilt(spoil: impl FnOnce(&mut Sheet)) -> Vec<Diagnostic> {
    let mut sheet = Sheet::new(TIAGO_CSV);
    spoil(&mut sheet);
    tiago(&TIAGO, &sheet.text()).diagnostics
}

/// The doubts of these kinds, each with the words that its sentence must hold; nothing else but rows outside limits.
#[track_caller]
fn told(doubts: &[Diagnostic], wanted: &[(DiagnosticKind, &[&str])]) {
    let listed = doubts.iter().map(|doubt| format!("{:?}: {doubt}", doubt.kind)).collect::<Vec<_>>().join("\n");
    let found: Vec<&Diagnostic> = doubts.iter().filter(|doubt| doubt.kind != DiagnosticKind::Limits).collect();
    assert_eq!(found.len(), wanted.len(), "{listed}");
    for (doubt, (kind, words)) in found.iter().zip(wanted) {
        assert_eq!(doubt.kind, *kind, "{listed}");
        assert!(words.iter().all(|word| doubt.to_string().contains(word)), "{words:?}\n{listed}");
    }
}

#[test]
fn nothing_is_doubted_in_a_table_that_is_right() {
    let examination = tiago(&TIAGO, TIAGO_CSV);
    assert_eq!(examination, Examination::default(), "{:?}", examination.diagnostics.iter().map(ToString::to_string));
    assert_eq!(panda(|_| {}), []);
}

/// A row that went wrong is an outlier and no reason to doubt all others; and they are doubted as if it were not there.
#[test]
fn one_row_that_went_wrong_is_no_doubt() {
    let ruined: [fn(f64) -> f64; 5] = [|_| -9999.0, |_| 0.0, |x| x * 1e3, |x| x * 1e-3, |x| x / 0.0254];
    for ruin in ruined {
        for row in [0, 7, 33] {
            let spoil = |sheet: &mut Sheet| {
                for title in ["x1", "y1", "z1"] {
                    let column = sheet.column(title);
                    sheet.rows[row][column] = ruin(sheet.rows[row][column]);
                }
            };
            told(&spoilt(spoil), &[]);
            let sign = spoilt(|sheet| {
                spoil(sheet);
                sheet.change("arm_4_joint", |x| -x);
            });
            told(&sign, &[(DiagnosticKind::Sign, &["column `arm_4_joint`: its sign is reversed", "fits to 3."])]);
        }
    }
}

#[test]
fn a_target_that_never_moves_is_doubted_and_nothing_else() {
    let still = spoilt(|sheet| ["x1", "y1", "z1"].iter().for_each(|title| sheet.change(title, |_| 0.4)));
    told(&still, &[(DiagnosticKind::Still, &["column `x1, y1, z1`: its place never changes", "in 37 rows"])]);
}

#[test]
fn units_are_doubted() {
    let millimetres = spoilt(|sheet| ["x1", "y1", "z1"].iter().for_each(|title| sheet.change(title, |x| x * 1e3)));
    told(
        &millimetres,
        &[(DiagnosticKind::Unit, &["column `x1, y1, z1`: positions are millimetres", "fits to 3.", "`_mm`"])],
    );
    let metres = spoilt(|sheet| ["x1", "y1", "z1"].iter().for_each(|title| sheet.change(title, |x| x * 1e-3)));
    told(&metres, &[(DiagnosticKind::Unit, &["positions are metres, read as millimetres"])]);
    for (factor, said, suffix) in [
        (1e2, "positions are centimetres, read as metres", "`_cm`"),
        (1e-2, "positions are metres, read as centimetres", "`_m`"),
    ] {
        let other = spoilt(|sheet| ["x1", "y1", "z1"].iter().for_each(|title| sheet.change(title, |x| x * factor)));
        told(&other, &[(DiagnosticKind::Unit, &[said, suffix, "fits to 3."])]);
    }
    let degrees = spoilt(|sheet| sheet.change("arm_3_joint", f64::to_degrees));
    told(&degrees, &[(DiagnosticKind::Unit, &["column `arm_3_joint`: degrees, read as radians", "`_deg`"])]);
    assert!(degrees.iter().any(|doubt| doubt.kind == DiagnosticKind::Limits && doubt.lines.len() > 20), "{degrees:?}");
    let all = spoilt(|sheet| (1..8).for_each(|k| sheet.change(&format!("arm_{k}_joint"), f64::to_degrees)));
    told(&all, &[(DiagnosticKind::Unit, &["all joint angles are degrees, read as radians"])]);
    let torso = spoilt(|sheet| sheet.change("torso_lift_joint", |x| x * 1e3));
    told(&torso, &[(DiagnosticKind::Unit, &["column `torso_lift_joint`: millimetres, read as metres"])]);
    let torso = spoilt(|sheet| sheet.change("torso_lift_joint", |x| x * 1e2));
    told(&torso, &[(DiagnosticKind::Unit, &["column `torso_lift_joint`: centimetres, read as metres", "`_cm`"])]);
}

#[test]
fn signs_zeros_and_orders_are_doubted() {
    let sign = spoilt(|sheet| sheet.change("arm_4_joint", |x| -x));
    told(&sign, &[(DiagnosticKind::Sign, &["column `arm_4_joint`: its sign is reversed", "fits to 3."])]);
    let zero = spoilt(|sheet| sheet.change("arm_2_joint", |x| x + 0.5));
    told(&zero, &[(DiagnosticKind::Zero, &["column `arm_2_joint`: its zero is 2", "<origin>"])]);
    let order = spoilt(|sheet| sheet.swap_titles("arm_5_joint", "arm_6_joint"));
    told(&order, &[(DiagnosticKind::Order, &["column `arm_5_joint`: in the place of column `arm_6_joint`"])]);
    let mirror = spoilt(|sheet| sheet.swap_titles("x1", "y1"));
    told(&mirror, &[(DiagnosticKind::Mirror, &["positions are in a left-handed frame"])]);
    let both = spoilt(|sheet| {
        sheet.change("arm_4_joint", |x| -x);
        ["x1", "y1", "z1"].iter().for_each(|title| sheet.change(title, |x| x * 1e3));
    });
    told(&both, &[(DiagnosticKind::Unit, &["millimetres"]), (DiagnosticKind::Sign, &["`arm_4_joint`"])]);
}

/// Joints and measurements that were paired by clocks that differ: of some rows while the hand moved on, of all while it never stood.
#[test]
fn rows_that_lag_are_told() {
    let way = "measured while the robot moved, on its way to that of the line below";
    told(
        &tiago(&TIAGO, LATE_CSV).diagnostics,
        &[(DiagnosticKind::Lag, &["lines 16, 20, 31", way, "their clocks differ"])],
    );
    let late = |rows: f64| {
        let mut sheet = Sheet::new(TIAGO_CSV);
        let joints: Vec<usize> = (0..8).map(|k| sheet.column("torso_lift_joint") + k).collect();
        // A robot that is followed on its way through these postures, ten times on each part of it; and once more, later.
        let postures = sheet.rows.clone();
        let between = |at: f64, column: usize| {
            let (row, part) = (at.floor() as usize, at.fract());
            postures[row][column] + (postures[row + 1][column] - postures[row][column]) * part
        };
        let chain = Urdf::parse(include_str!("urdf/robots/tiago.urdf")).expect("a URDF");
        let chain = chain.chain("base_footprint", "arm_tool_link").expect("a chain");
        sheet.rows = (20..300)
            .map(|row| {
                let at = |row: f64| joints.iter().map(|column| between(row / 10.0, *column)).collect::<Vec<_>>();
                let seen = chain.tip_at(&at(f64::from(row))) * Point3::new(0.05, 0.02, 0.1);
                let mut cells = postures[0].clone();
                cells[..3].copy_from_slice(seen.coords.as_slice());
                joints.iter().zip(at(f64::from(row) - rows)).for_each(|(column, q)| cells[*column] = q);
                cells
            })
            .collect();
        tiago(&TIAGO, &sheet.text()).diagnostics
    };
    told(&late(0.0), &[]);
    told(&late(0.4), &[(DiagnosticKind::Lag, &["belongs to the joints 0.40 lines below"])]);
    told(&late(-1.3), &[(DiagnosticKind::Lag, &["belongs to the joints 1.30 lines above"])]);
}

#[test]
fn columns_are_doubted_by_themselves() {
    let constant = spoilt(|sheet| sheet.change("arm_7_joint", |_| 0.25));
    told(
        &constant,
        &[(DiagnosticKind::Constant, &["column `arm_7_joint`: this joint never moves (0.25 in all 37 rows)"])],
    );
    let outside = spoilt(|sheet| {
        let column = sheet.column("arm_7_joint");
        sheet.rows[3][column] = 2.5;
    });
    let limits = outside.iter().find(|doubt| doubt.kind == DiagnosticKind::Limits).expect("doubted").to_string();
    assert!(limits.contains("column `arm_7_joint`: line 5: outside the joint's limits (by up to 0.40"), "{limits}");
    let third = TIAGO.replace("\"x1\", \"y1\", \"z1\"", "\"x3\", \"y3\", \"z3\"");
    told(
        &tiago(&third, LATE_CSV)
            .diagnostics
            .into_iter()
            .filter(|doubt| doubt.kind != DiagnosticKind::Lag)
            .collect::<Vec<_>>(),
        &[(DiagnosticKind::RepeatedColumn, &["column `x4, y4, z4`: a copy of `x3, y3, z3`"])],
    );
    let twice = TIAGO_CSV.replacen("x2", "x1", 1);
    let error = Scenario::parse("my.toml", &TIAGO, &|_| Ok(twice.clone())).expect_err("a title twice");
    assert!(error.to_string().contains("line 1: columns 1 and 4 are both called `x1`"), "{error}");
}

#[test]
fn rows_are_doubted() {
    let copied = spoilt(|sheet| sheet.rows.push(sheet.rows[2].clone()));
    told(&copied, &[(DiagnosticKind::CopiedRow, &["line 39: a copy of an earlier row", "what line 4 said"])]);
    let few = TIAGO.replace("count = 7", "count = 1");
    let table: String = TIAGO_CSV.split_inclusive('\n').take(11).collect();
    told(
        &tiago(&few, &table).diagnostics,
        &[(DiagnosticKind::TooFewRows, &["10 rows are too few (30 equations for 39 unknowns)"])],
    );
}

#[test]
fn repeats_tell_the_noise_and_what_had_not_settled() {
    let mut sheet = Sheet::new(TIAGO_CSV);
    let wave = |k: usize| (k as f64 * 2.4).sin();
    for row in 0..6 {
        for k in 0..4 {
            let mut again = sheet.rows[row].clone();
            (0..3).for_each(|axis| again[axis] += 1e-3 * wave(100 * row + 10 * k + 3 * axis));
            sheet.rows.push(again);
        }
    }
    let examination = tiago(&TIAGO, &sheet.text());
    told(
        &examination.diagnostics,
        &[(DiagnosticKind::RepeatedPosture, &["6 postures were measured more than once", "σ is 0."])],
    );
    let sigma = examination.sigma_m.expect("repeats");
    assert!((0.0004..0.0011).contains(&sigma), "a sine of 1 mm: {sigma}");
    sheet.rows[43][1] += 0.05;
    let doubts = tiago(&TIAGO, &sheet.text()).diagnostics;
    told(
        &doubts,
        &[
            (
                DiagnosticKind::Unsettled,
                &["line 45: `x1, y1, z1` is not where it was in the same posture", "still moving"],
            ),
            (DiagnosticKind::RepeatedPosture, &["6 postures"]),
        ],
    );
}

/// A chain that is described as well as calibration files say by default.
fn subject<'a>(
    columns: &'a [String],
    joints: &'a [Joint],
    limits: &'a [Option<(f64, f64)>],
    target: Point3<f64>,
) -> Subject<'a> {
    Subject {
        columns,
        joints,
        carriers: None,
        limits,
        target,
        target_sd_m: 0.3,
        learned: &[],
        zeros_rad: &[],
        unknowns: 9,
        sigma_m: 5e-4,
        direction_rad: 0.01,
        point_m: 0.005,
        base: None,
    }
}

/// The doubts about a table of a Panda whose ball was held in two sockets, and nothing measured but joint angles.
fn panda(spoil: impl FnOnce(&mut Sheet)) -> Vec<Diagnostic> {
    let mut sheet = Sheet::new(PANDA_CSV);
    spoil(&mut sheet);
    let text = sheet.text();
    let chain = Urdf::parse(PANDA).and_then(|urdf| urdf.chain("panda_link0", "panda_link8")).expect("a chain");
    let table = Table::open(text.as_bytes()).expect("a table");
    let names = chain.names();
    let joints = names.iter().map(|name| table.titles().find(name, Quantity::Angle).expect("a column")).collect();
    let labels = vec![table.titles().label("socket").expect("a column")];
    let rows: Vec<_> =
        table.rows(Columns { joints, labels, ..Columns::default() }).map(|row| row.expect("a row")).collect();
    let mut sockets = BTreeMap::new();
    let state = chain.state();
    let limits: Vec<_> = chain.moving().map(|segment| segment.limits).collect();
    let subject = subject(&names, &state.joints, &limits, Point3::origin());
    let (lines, configurations): (Vec<usize>, Vec<Vec<f64>>) =
        rows.iter().map(|row| (row.line, row.positions.clone())).unzip();
    let socket = |label: &String| {
        let next = sockets.len();
        *sockets.entry(label.clone()).or_insert(next)
    };
    let sockets = Some(rows.iter().map(|row| &row.labels[0]).map(socket).collect());
    let evidence = Evidence { lines: &lines, configurations: &configurations, sockets, ..Evidence::default() };
    examine(&subject, &evidence).diagnostics
}

#[test]
fn joint_angles_alone_are_evidence_where_sockets_held_the_target() {
    let sign = panda(|sheet| sheet.change("panda_joint5", |x| -x));
    told(&sign, &[(DiagnosticKind::Sign, &["column `panda_joint5`: its sign is reversed"])]);
    let degrees = panda(|sheet| (1..8).for_each(|k| sheet.change(&format!("panda_joint{k}"), f64::to_degrees)));
    told(&degrees, &[(DiagnosticKind::Unit, &["all joint angles are degrees"])]);
    let zero = panda(|sheet| sheet.change("panda_joint4", |x| x - 0.3));
    told(&zero, &[(DiagnosticKind::Zero, &["column `panda_joint4`: its zero is"])]);
    let order = panda(|sheet| sheet.swap_titles("panda_joint2", "panda_joint6"));
    told(&order, &[(DiagnosticKind::Order, &["`panda_joint2`", "`panda_joint6`"])]);
}

#[test]
fn a_long_chain_takes_time_that_grows_with_its_joints() {
    let chain = Urdf::parse(PANDA).and_then(|urdf| urdf.chain("panda_link0", "panda_link8")).expect("a chain");
    let joints = [chain.state().joints, vec![chain.state().joints[6]; 793]].concat();
    let names: Vec<String> = (0..800).map(|k| format!("j{k}")).collect();
    let configurations: Vec<Vec<f64>> =
        (0..300).map(|row| (0..800).map(|k| ((row * 31 + k * 17) as f64).sin() * 0.1).collect()).collect();
    let lines: Vec<usize> = (2..302).collect();
    let limits = vec![None; 800];
    let subject = subject(&names, &joints, &limits, Point3::new(0.1, 0.0, 1.0));
    let sockets = Some((0..300).map(|row| row % 3).collect());
    let started = std::time::Instant::now();
    examine(&subject, &Evidence { lines: &lines, configurations: &configurations, sockets, ..Evidence::default() });
    assert!(started.elapsed().as_secs() < 20, "{:?}", started.elapsed());
}
