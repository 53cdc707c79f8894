//! What is told of a discovery: every column, every joint, what is in doubt.

use body_schema_engine::kinematics::{Joint, JointKind};
use body_schema_table::split;
use serde::Serialize;

use crate::{
    audit::Kind,
    chain::{is_misfit, movement},
    data::Data,
    discovery::{Body, Discovery},
    equivalence::commute,
    fit::Fit,
    robot::Robot,
    trust::{are_alike, covariance, expected_error, held_out, numbers, unknowns},
};

/// Probabilities above this are told as this: structures that nobody tried count for nothing in them.
const MOST: f64 = 0.999;
/// Above this there is no doubt that is worth a sentence.
const SURE: f64 = 0.95;
/// A direction less certain than this is told to be unknown, rad.
const VAGUE_RAD: f64 = 0.35;
/// A point less certain than this, m.
const VAGUE_M: f64 = 0.1;

/// Places that lie within this of their middle do not move, m.
const STILL_M: f64 = 1e-5;

/// Numbers measured per unknown below which a structure is not believed, however well it fits: a body gives six a row, a point three.
const NUMBERS: usize = 3;
/// Rows held out may be missed by this many times the noise of those that are learned from.
const UNSEEN: f64 = 2.5;
/// The structures that no movement tells from the best one must have this probability together.
const TOGETHER: f64 = 0.9;

/// What was found, in words and numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// Rows with readings, those of one posture in one table counted once.
    pub rows: usize,
    /// Whether the robot explains the rows. If not, nothing below is to be believed.
    pub explains: bool,
    /// Whether the structure is beyond doubt: it explains the rows, and every question of structure is answered with 95 % or more.
    pub sure: bool,
    /// The probability of the whole structure, among those that were tried.
    pub probability: f64,
    /// The noise of a coordinate of a place, mm.
    pub noise_mm: f64,
    /// The noise of a component of a rotation, degrees; none where no rotation is measured.
    pub noise_deg: Option<f64>,
    /// How far off predictions are expected to be on postures like these, mm.
    pub expected_error_mm: f64,
    /// How far off predictions are on rows that are held out, a quarter at a time, with this structure fitted to the others: the deviation
    /// of a coordinate, mm; to be compared with the noise.
    pub held_out_mm: f64,
    /// Every column.
    pub columns: Vec<ColumnAnswer>,
    /// The joints, each parent before its children.
    pub joints: Vec<JointAnswer>,
    /// Every target.
    pub targets: Vec<TargetAnswer>,
    /// What is in doubt, and what no movement can tell, in sentences.
    pub doubts: Vec<String>,
    /// Other structures, the most probable first.
    pub alternatives: Vec<Alternative>,
}

/// What a column does.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnAnswer {
    /// Its title.
    pub title: String,
    /// `turns`, `slides`, `couples`, `copy`, `constant`, `unusable` or `nothing`.
    pub role: &'static str,
    /// The probability that it moves something that is measured; none where that was not asked.
    pub moves: Option<f64>,
    /// The probability that its kind is right.
    pub kind: Option<f64>,
    /// The whole, as a sentence.
    pub message: String,
}

/// A joint.
#[derive(Clone, Debug, Serialize)]
pub struct JointAnswer {
    /// Its name: the column's title without the unit.
    pub name: String,
    /// The joint that carries it; none for the ground.
    pub parent: Option<String>,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// The columns that drive it, with their ratios.
    pub drives: Vec<(String, f64)>,
    /// The direction of its axis where all columns read 0, in the frame of the measurements.
    pub direction: [f64; 3],
    /// A point of that axis, mm; none of a joint that slides.
    pub point_mm: Option<[f64; 3]>,
    /// The standard deviation of the direction, degrees.
    pub direction_sd_deg: f64,
    /// That of the point across the axis, mm.
    pub point_sd_mm: Option<f64>,
    /// The probability that it comes after its parent and not before it.
    pub order: Option<f64>,
}

/// A target.
#[derive(Clone, Debug, Serialize)]
pub struct TargetAnswer {
    /// Its name.
    pub name: String,
    /// The joint that carries it; none for the ground.
    pub carrier: Option<String>,
}

/// Another structure.
#[derive(Clone, Debug, Serialize)]
pub struct Alternative {
    /// Its probability among those that were tried.
    pub probability: f64,
    /// Its columns from the ground, by body.
    pub chain: String,
}

/// The name of a column's joint: its title without the unit, unless another column would have the same.
pub fn joint_name(data: &Data, column: usize) -> String {
    let name = |column: usize| split(&data.columns[column].title).0;
    let is_taken = (0..data.columns.len()).any(|other| other != column && name(other) == name(column));
    if is_taken { data.columns[column].title.clone() } else { name(column).to_owned() }
}

/// The columns of a chain from the ground, with what they do.
fn chain(data: &Data, robot: &Robot) -> String {
    let joint = |joint: &crate::robot::Driven| {
        let names: Vec<String> = joint.drives.iter().map(|drive| joint_name(data, drive.column)).collect();
        format!("{} {}", names.join(" + "), verb(joint.axis.kind()))
    };
    let joints: Vec<String> = robot.joints.iter().map(joint).collect();
    if joints.is_empty() { "nothing moves it".to_owned() } else { joints.join(", ") }
}

fn verb(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "turns",
        JointKind::Prismatic => "slides",
    }
}

fn percent(probability: f64) -> String {
    if probability >= MOST { "over 99.9 %".to_owned() } else { format!("{:.1} %", 100.0 * probability) }
}

/// Σ of the probabilities of the structures for which something holds.
fn share(body: &Body, holds: impl Fn(&Robot) -> bool) -> f64 {
    let pairs = body.fits.iter().zip(&body.probabilities);
    pairs.filter(|(fit, _)| holds(&fit.robot)).map(|(_, probability)| probability).sum()
}

/// The whole answer.
pub fn answer(data: &Data, found: &Discovery) -> Answer {
    let Fit { robot, noise, .. } = &found.fit;
    let explains = !is_misfit(data, &found.fit);
    let covariance = covariance(data, &found.fit);
    let order = |index: usize| -> Option<f64> {
        let (own, parent) = (robot.joints[index].column(), robot.joints[robot.joints[index].parent?].column());
        let body = carried(found, robot, index)?;
        let place = |robot: &Robot, column: usize| robot.joints.iter().position(|joint| joint.column() == column);
        let is_behind =
            |robot: &Robot| matches!((place(robot, parent), place(robot, own)), (Some(a), Some(b)) if a < b);
        let is_before =
            |robot: &Robot| matches!((place(robot, parent), place(robot, own)), (Some(a), Some(b)) if a > b);
        let (behind, before) = (share(body, is_behind), share(body, is_before));
        Some((behind / (behind + before).max(1e-300)).min(MOST))
    };
    let at_zero = robot.rebased(&vec![0.0; robot.middle.len()]);
    let mut first = 0;
    let mut joints = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let sd = |from: usize| {
            let variance = covariance[(from, from)] + covariance[(from + 1, from + 1)];
            variance.max(0.0).sqrt()
        };
        let is_line = joint.axis.kind() == JointKind::Revolute;
        let zero = &at_zero.joints[index].axis;
        joints.push(JointAnswer {
            name: joint_name(data, joint.column()),
            parent: joint.parent.map(|parent| joint_name(data, robot.joints[parent].column())),
            kind: joint.axis.kind(),
            drives: joint.drives.iter().map(|drive| (data.columns[drive.column].title.clone(), drive.ratio)).collect(),
            direction: zero.direction().into_inner().into(),
            point_mm: zero.line().map(|line| (line.point.coords * 1e3).into()),
            direction_sd_deg: sd(first + if is_line { 2 } else { 0 }).to_degrees(),
            point_sd_mm: is_line.then(|| 1e3 * sd(first)),
            order: order(index),
        });
        first += joint.axis.degrees_of_freedom() + joint.drives.iter().filter(|drive| drive.is_free).count();
    }
    let columns: Vec<ColumnAnswer> = (0..data.columns.len()).map(|column| column_answer(data, found, column)).collect();
    let held_out_m = held_out(data, &found.fit);
    let mut doubts = doubts(data, found, explains, &joints, &columns);
    let is_general = held_out_m <= UNSEEN * noise.place_m;
    if explains && !is_general {
        doubts.push(format!(
            "rows that are held out are missed by {:.1} mm, others by {:.1} mm: measure more postures before this is believed",
            1e3 * held_out_m,
            1e3 * noise.place_m
        ));
    }
    let together: f64 = found
        .bodies
        .iter()
        .map(|body| {
            let best = body.fits.first();
            share(body, |robot| best.is_some_and(|best| are_alike(&best.robot, robot, &best.noise)))
        })
        .product();
    let imitations = imitations(data, robot);
    doubts.extend(imitations.iter().cloned());
    let is_measured = numbers(data, found) >= NUMBERS * unknowns(data, robot);
    let probability: f64 = found.bodies.iter().map(|body| body.probabilities.first().copied().unwrap_or(0.0)).product();
    let is_answered = columns.iter().all(|column| {
        let is_clear = |p: Option<f64>| p.is_none_or(|p| !(1.0 - SURE..=SURE).contains(&p));
        is_clear(column.moves) && is_clear(column.kind)
    }) && joints.iter().zip(&robot.joints).all(|(joint, own)| {
        let commutes = own.parent.is_some_and(|parent| is_commuting(&robot.joints[parent].axis, &own.axis, joint));
        commutes || joint.order.is_none_or(|order| order >= SURE)
    });
    let alternatives = found.bodies.iter().flat_map(|body| {
        let others = body.fits.iter().zip(&body.probabilities).skip(1).filter(|(_, p)| **p > 1e-3).take(5);
        others.map(|(fit, probability)| Alternative { probability: *probability, chain: chain(data, &fit.robot) })
    });
    Answer {
        rows: data.rows.len(),
        explains,
        sure: explains
            && is_answered
            && imitations.is_empty()
            && is_general
            && is_measured
            && together >= TOGETHER
            && !joints.is_empty(),
        held_out_mm: 1e3 * held_out_m,
        probability: if explains { probability.min(MOST) } else { 0.0 },
        noise_mm: 1e3 * noise.place_m,
        noise_deg: data.targets.iter().any(|target| target.is_pose).then(|| noise.turn_rad.to_degrees()),
        expected_error_mm: 1e3 * expected_error(data, &found.fit, &covariance),
        columns,
        targets: data
            .targets
            .iter()
            .zip(&robot.targets)
            .map(|(target, held)| TargetAnswer {
                name: target.name.clone(),
                carrier: held.carrier.map(|joint| joint_name(data, robot.joints[joint].column())),
            })
            .collect(),
        alternatives: alternatives.collect(),
        doubts,
        joints,
    }
}

/// Ratios that may stand for something else: of a slide, which moves like a turn about a short lever; and any where no rotation is measured,
/// where a turn that was not found can look like it.
fn imitations(data: &Data, robot: &Robot) -> Vec<String> {
    let has_turns = data.targets.iter().any(|target| target.is_pose) || data.targets.len() > 2;
    let is_one = |joint: &&crate::robot::Driven| {
        let has_ratio = joint.drives.iter().any(|drive| drive.is_free);
        has_ratio && (!has_turns || joint.axis.kind() == JointKind::Prismatic)
    };
    let told = |joint: &crate::robot::Driven| {
        format!(
            "the ratios of `{}` may stand for a turn that was not found: measure rotations, or more markers, or move its columns alone",
            joint_name(data, joint.column())
        )
    };
    robot.joints.iter().filter(is_one).map(told).collect()
}

/// The body whose chain holds a joint of the tree.
fn carried<'a>(found: &'a Discovery, robot: &Robot, joint: usize) -> Option<&'a Body> {
    found.bodies.iter().find(|body| body.targets.iter().any(|target| robot.chain_of(*target).contains(&joint)))
}

fn is_commuting(one: &Joint, other: &Joint, said: &JointAnswer) -> bool {
    let turn = 3.0 * said.direction_sd_deg.to_radians();
    let shift = 3e-3 * said.point_sd_mm.unwrap_or(0.0);
    commute(one, other, turn.min(0.1), shift.min(0.02))
}

fn column_answer(data: &Data, found: &Discovery, column: usize) -> ColumnAnswer {
    let title = &data.columns[column].title;
    let told = |role: &'static str, message: String| ColumnAnswer {
        title: title.clone(),
        role,
        moves: None,
        kind: None,
        message,
    };
    match found.kinds[column] {
        Kind::Constant => {
            return told(
                "constant",
                format!("`{title}` has one value in every row: nothing can be told of it; move it"),
            );
        }
        Kind::Copy { of, factor } => {
            let unit = data.columns[column].factor / data.columns[of].factor;
            return told(
                "copy",
                format!(
                    "`{title}` repeats `{}`: it is {:.6} times that and a constant",
                    data.columns[of].title,
                    factor / unit
                ),
            );
        }
        Kind::Wide => {
            return told(
                "unusable",
                format!(
                    "`{title}` names no unit and spans more than 13, which is neither radians nor metres: it was left out; if it is a \
                     joint, end its title with _deg or _mm"
                ),
            );
        }
        Kind::Candidate => {}
    }
    let robot = &found.fit.robot;
    let drives = |joint: &crate::robot::Driven| joint.drives.iter().any(|drive| drive.column == column);
    let own = robot.joints.iter().find(|joint| joint.column() == column);
    let any = own.or_else(|| robot.joints.iter().find(|joint| drives(joint)));
    let moves =
        found.bodies.iter().map(|body| share(body, |robot| robot.joints.iter().any(drives))).fold(0.0, f64::max);
    let Some(joint) = any else {
        let points = data.targets.iter().all(|target| !target.is_pose);
        let unless = if points && data.targets.len() < 3 {
            ", or turns about an axis through what is measured, which no place shows"
        } else {
            ""
        };
        let message = format!("`{title}` moves nothing that is measured ({}){unless}", percent(1.0 - moves));
        return ColumnAnswer { moves: Some(moves), ..told("nothing", message) };
    };
    let kind = joint.axis.kind();
    let is_kind =
        |robot: &Robot| robot.joints.iter().any(|joint| joint.column() == column && joint.axis.kind() == kind);
    let body = found.bodies.iter().max_by(|one, other| {
        let of = |body: &Body| share(body, is_kind);
        of(one).total_cmp(&of(other))
    });
    let kind_share = body.map_or(0.0, |body| {
        let all = share(body, |robot| robot.joints.iter().any(|joint| joint.column() == column));
        share(body, is_kind) / all.max(1e-300)
    });
    if own.is_none() {
        let message = format!(
            "`{title}` has no joint of its own; it moves that of `{}` too ({})",
            joint_name(data, joint.column()),
            percent(moves)
        );
        return ColumnAnswer { moves: Some(moves.min(MOST)), ..told("couples", message) };
    }
    let behind = match joint.parent {
        Some(parent) => format!("behind `{}`", joint_name(data, robot.joints[parent].column())),
        None => "on the ground".to_owned(),
    };
    // Where all columns read 0.
    let at_zero = robot.rebased(&vec![0.0; robot.middle.len()]);
    let axis = at_zero.joints.iter().find(|other| other.column() == column).map_or(joint.axis, |joint| joint.axis);
    let [x, y, z] = <[f64; 3]>::from(axis.direction().into_inner());
    let place = axis.line().map_or(String::new(), |line| {
        format!(" through ({:.1}, {:.1}, {:.1}) mm", 1e3 * line.point.x, 1e3 * line.point.y, 1e3 * line.point.z)
    });
    let what = match kind {
        JointKind::Revolute => "turns about",
        JointKind::Prismatic => "slides along",
    };
    let mut message = format!(
        "`{title}` {what} ({x:.3}, {y:.3}, {z:.3}){place}, {behind} (moves {}, kind {})",
        percent(moves),
        percent(kind_share)
    );
    for drive in joint.drives.iter().filter(|drive| drive.is_free) {
        let own = drive.column == column;
        let of = if own { "itself".to_owned() } else { format!("`{}`", data.columns[drive.column].title) };
        message += &format!("; the joint moves {:.4} per unit of {of}", drive.ratio);
    }
    let role = if kind == JointKind::Revolute { "turns" } else { "slides" };
    ColumnAnswer { moves: Some(moves.min(MOST)), kind: Some(kind_share.min(MOST)), ..told(role, message) }
}

fn doubts(
    data: &Data,
    found: &Discovery,
    explains: bool,
    joints: &[JointAnswer],
    columns: &[ColumnAnswer],
) -> Vec<String> {
    let robot = &found.fit.robot;
    let mut doubts = Vec::new();
    let moved = movement(data);
    if moved < STILL_M {
        doubts.push("what is measured never moves: see whether the tracker sends new places, and whether the target moves with the joints".to_owned());
    } else if !explains {
        doubts.push(format!(
            "nothing that was tried explains these rows: {:.1} mm are left of movements of {:.0} mm; rows may be paired with the wrong \
             readings, a moving column may be missing or in another unit, or there are too few rows",
            1e3 * found.fit.noise.place_m,
            1e3 * moved
        ));
    }
    if joints.is_empty() {
        doubts.push("no column moves what is measured".to_owned());
    }
    let (numbers, unknowns) = (numbers(data, found), unknowns(data, robot));
    if numbers < NUMBERS * unknowns {
        doubts.push(format!(
            "there are {numbers} independent measured numbers for {unknowns} unknowns: measure more postures before this is believed"
        ));
    }
    for (joint, own) in joints.iter().zip(&robot.joints) {
        if let (Some(parent), Some(name), Some(order)) = (own.parent, &joint.parent, joint.order) {
            if is_commuting(&robot.joints[parent].axis, &own.axis, joint) {
                doubts.push(format!(
                    "`{name}` and `{}` commute as far as these rows say: which of them comes first no movement tells, and no prediction \
                     depends on it",
                    joint.name
                ));
            } else if order < SURE {
                doubts.push(format!("`{}` comes behind `{name}` with {} only", joint.name, percent(order)));
            }
        }
        if joint.direction_sd_deg.to_radians() > VAGUE_RAD {
            doubts.push(format!("where the axis of `{}` points these rows do not say", joint.name));
        } else if joint.point_sd_mm.is_some_and(|sd| sd > 1e3 * VAGUE_M) {
            doubts.push(format!(
                "where the axis of `{}` is these rows do not say: nothing measured is far from it",
                joint.name
            ));
        }
    }
    for column in columns {
        if column.role != "nothing" && column.moves.is_some_and(|moves| moves < SURE) {
            doubts.push(format!(
                "`{}` moves something with {} only",
                column.title,
                percent(column.moves.unwrap_or(0.0))
            ));
        }
        if column.role == "nothing" && column.moves.is_some_and(|moves| moves > 1.0 - SURE) {
            doubts.push(format!(
                "`{}` may move something after all ({})",
                column.title,
                percent(column.moves.unwrap_or(0.0))
            ));
        }
        if column.kind.is_some_and(|kind| kind < SURE) {
            doubts.push(format!("whether `{}` turns or slides is open", column.title));
        }
    }
    doubts
}
