//! The search for the chain that carries one body.

use body_schema_engine::kinematics::{Joint, JointKind};

use crate::{
    beam, bodies,
    data::Data,
    fit::{self, Fit, fit},
    isolated,
    median::median,
    places::{Piece, solve},
    ranking::{BETTER, Ranking},
    robot::{Drive, Driven, Robot},
    turns,
};

/// Iterations of fits that compare, and of those that are told.
const QUICK: usize = 15;
const WHOLE: usize = 60;
/// How many structures of a search by rotations, or by places, are fitted as a whole.
const STARTS: usize = 8;
/// How many chains are kept at every length of a search by rotations: first, and where what came of that explains nothing.
const BEAMS: [usize; 2] = [10, 40];
/// The same where no rotation is measured.
const BEAMS_BY_PLACES: [usize; 2] = [5, 16];
/// Residuals above this share of how far a body moves are no noise: the structure is wrong, or the readings are.
const MISFIT: f64 = 0.03;
/// Two axes within this angle of being parallel, rad: rotations do not tell their order.
const PARALLEL: f64 = 0.35;

/// How much is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// From nothing: all searches, couplings too.
    Whole,
    /// From structures that were plausible a row ago: these and their neighbours.
    Update,
}

/// The structures that may carry the targets of `data`, all on one body, by evidence. `columns` are those that may drive joints; `known`
/// structures are tried first.
pub fn search(data: &Data, columns: &[usize], known: &[Robot], effort: Effort) -> Vec<Fit> {
    let middle = data.middle();
    let mut ranking = Ranking::new();
    for robot in known {
        ranking.add(fit(data, &robot.rebased(&middle), QUICK));
    }
    let posed = bodies::posed(data);
    let starts = |ranking: &mut Ranking, found: Vec<Robot>| {
        for robot in found {
            if !ranking.has(&robot) {
                ranking.add(fit(data, &robot.rebased(&middle), QUICK));
            }
        }
    };
    let is_whole = known.is_empty() || effort == Effort::Whole;
    if is_whole {
        starts(&mut ranking, isolated::starts(data, posed.as_ref(), columns));
        starts(&mut ranking, vec![Robot::still(data)]);
    }
    for round in 0..2 {
        if is_whole {
            starts(
                &mut ranking,
                match &posed {
                    Some(posed) => by_turns(data, posed, &middle, columns, BEAMS[round]),
                    None => by_places(data, &middle, columns, BEAMS_BY_PLACES[round]),
                },
            );
        }
        climb(data, columns, &mut ranking, effort, posed.is_some(), false);
        if let Some(leader) = ranking.leader() {
            let share = fit::independence(data, &leader.robot);
            ranking.weigh(share);
        }
        climb(data, columns, &mut ranking, effort, posed.is_some(), is_whole);
        // A coupling may stand for a joint that was not found.
        let is_plain = |found: &Fit| !is_misfit(data, found) && found.robot.is_plain();
        if !is_whole || ranking.leader().is_some_and(is_plain) {
            break;
        }
    }
    let independence = ranking.independence;
    let mut fits = ranking.sorted();
    fits.truncate(60);
    for found in fits.iter_mut().take(3) {
        *found = fit(data, &found.robot, WHOLE);
        found.evidence = independence * found.likelihood - found.price;
    }
    fits.sort_by(|one, other| other.evidence.total_cmp(&one.evidence));
    fits
}

/// Whether what a fit leaves unexplained is more than noise can be: above a share of how far the targets move.
pub fn is_misfit(data: &Data, found: &Fit) -> bool {
    found.noise.place_m > MISFIT * movement(data)
}

/// How far targets move: the median over them of the median distance from their middle, m.
pub fn movement(data: &Data) -> f64 {
    let of = |target: usize| {
        let points: Vec<_> = data.rows.iter().filter_map(|row| Some(row.readings[target]?.point())).collect();
        bodies::scatter(&points)
    };
    median((0..data.targets.len()).map(of).collect())
}

/// Tries the neighbours of the best structure until none is better.
fn climb(data: &Data, columns: &[usize], ranking: &mut Ranking, effort: Effort, has_turns: bool, couples: bool) {
    for _ in 0..12 {
        let Some(leader) = ranking.leader() else { return };
        let best = leader.robot.clone();
        // What explains nothing is not made better by couplings.
        let is_misfit = is_misfit(data, leader);
        let mut is_better = false;
        for robot in neighbours(data, &best, columns, effort, has_turns) {
            if !ranking.has(&robot) {
                is_better |= ranking.add(fit(data, &robot, QUICK));
            }
        }
        if !is_better && !is_misfit && couples {
            for robot in coupled(&best, columns) {
                if !ranking.has(&robot) {
                    is_better |= ranking.add(fit(data, &robot, QUICK));
                }
            }
        }
        if !is_better {
            return;
        }
    }
}

/// A chain with its joints in another order.
pub(crate) fn chained(robot: &Robot, joints: Vec<Driven>) -> Robot {
    let count = joints.len();
    let joints =
        joints.into_iter().enumerate().map(|(index, joint)| Driven { parent: index.checked_sub(1), ..joint }).collect();
    let mut chain = Robot { joints, ..robot.clone() };
    chain.targets.iter_mut().for_each(|held| held.carrier = count.checked_sub(1));
    chain
}

/// Structures that differ in one thing: two neighbours swapped, a joint elsewhere, away, new, or of the other kind.
fn neighbours(data: &Data, robot: &Robot, columns: &[usize], effort: Effort, has_turns: bool) -> Vec<Robot> {
    let count = robot.joints.len();
    let mut found = Vec::new();
    let reach = if effort == Effort::Whole { count } else { 1 };
    for from in 0..count {
        for to in 0..count {
            let apart = from.abs_diff(to);
            // Each pair of neighbours is swapped once.
            if apart == 0 || apart > reach || apart == 1 && to < from {
                continue;
            }
            let mut joints = robot.joints.clone();
            let joint = joints.remove(from);
            joints.insert(to, joint);
            found.push(chained(robot, joints));
        }
        let mut joints = robot.joints.clone();
        joints.remove(from);
        found.push(chained(robot, joints));
    }
    let pieces = pieces(robot);
    let middle = &robot.middle;
    let best = |tried: Vec<Vec<Piece>>| {
        let solved = tried.iter().filter_map(|pieces| solve(data, middle, pieces));
        solved.max_by(|one, other| one.1.total_cmp(&other.1)).map(|found| found.0)
    };
    let is_free = |column: usize, kind: JointKind| data.columns[column].kind.is_none_or(|of| of == kind);
    for (index, joint) in robot.joints.iter().enumerate() {
        let column = joint.column();
        let with = |piece: Piece| {
            let mut pieces = pieces.clone();
            pieces[index] = piece;
            pieces
        };
        match joint.axis.kind() {
            JointKind::Revolute if is_free(column, JointKind::Prismatic) => {
                found.extend(best(vec![with(Piece::Slide(column))]));
            }
            JointKind::Prismatic if is_free(column, JointKind::Revolute) => {
                let turned = turns::directions().into_iter().map(|direction| with(Piece::turn(column, direction)));
                found.extend(best(turned.collect()));
            }
            _ => {}
        }
    }
    let absent = columns.iter().filter(|column| robot.joints.iter().all(|joint| joint.column() != **column));
    for column in absent {
        for at in 0..=count {
            let with = |piece: Piece| {
                let mut pieces: Vec<Piece> = pieces.iter().map(|piece| piece.without(*column)).collect();
                pieces.insert(at, piece);
                pieces
            };
            if is_free(*column, JointKind::Prismatic) {
                found.extend(best(vec![with(Piece::Slide(*column))]));
            }
            if is_free(*column, JointKind::Revolute) && (effort == Effort::Whole || !has_turns) {
                let turned = turns::directions().into_iter().map(|direction| with(Piece::turn(*column, direction)));
                found.extend(best(turned.collect()));
            }
        }
    }
    found
}

/// The same structures with a column more in one joint, or with a ratio that is learned.
fn coupled(robot: &Robot, columns: &[usize]) -> Vec<Robot> {
    let mut found = Vec::new();
    for index in 0..robot.joints.len() {
        for column in columns {
            let mut other = robot.clone();
            let drives = &mut other.joints[index].drives;
            match drives.iter_mut().find(|drive| drive.column == *column) {
                Some(drive) if drive.is_free => continue,
                Some(drive) => drive.is_free = true,
                None => drives.push(Drive { column: *column, ratio: 0.0, is_free: true }),
            }
            found.push(other);
        }
    }
    found
}

/// A chain without what is not known of it beforehand.
fn pieces(robot: &Robot) -> Vec<Piece> {
    let piece = |joint: &Driven| match &joint.axis {
        Joint::Revolute(line) => {
            Piece::Turn(joint.drives.iter().map(|drive| (drive.column, drive.ratio)).collect(), line.direction)
        }
        Joint::Prismatic(_) => Piece::Slide(joint.column()),
    };
    robot.joints.iter().map(piece).collect()
}

/// Structures by measured rotations, with what slides put in by the places.
fn by_turns(data: &Data, posed: &Data, middle: &[f64], columns: &[usize], beam: usize) -> Vec<Robot> {
    let turning: Vec<usize> =
        columns.iter().copied().filter(|column| data.columns[*column].kind != Some(JointKind::Prismatic)).collect();
    let mut found: Vec<(Robot, f64)> = Vec::new();
    for chain in beam::search(posed, middle, &turning, beam).into_iter().take(STARTS) {
        let pieces: Vec<Piece> =
            chain.order.iter().map(|(column, direction)| Piece::turn(*column, *direction)).collect();
        for pieces in parallel_orders(pieces) {
            found.extend(completed(data, middle, pieces, columns));
        }
    }
    found.sort_by(|one, other| other.1.total_cmp(&one.1));
    found.into_iter().take(STARTS).map(|found| found.0).collect()
}

/// All orders of neighbours that turn about nearly parallel axes, 24 at most.
fn parallel_orders(pieces: Vec<Piece>) -> Vec<Vec<Piece>> {
    let is_parallel = |one: &Piece, other: &Piece| match (one, other) {
        (Piece::Turn(_, one), Piece::Turn(_, other)) => one.cross(other).norm() < PARALLEL,
        _ => false,
    };
    let mut all = vec![pieces];
    let mut at = 0;
    while at < all.len() && all.len() < 24 {
        for index in 1..all[at].len() {
            if is_parallel(&all[at][index - 1], &all[at][index]) {
                let mut swapped = all[at].clone();
                swapped.swap(index - 1, index);
                if !all.contains(&swapped) {
                    all.push(swapped);
                }
            }
        }
        at += 1;
    }
    all
}

/// A chain of turns with the slides, and the turns that cancel in all rotations, that its places ask for.
fn completed(data: &Data, middle: &[f64], pieces: Vec<Piece>, columns: &[usize]) -> Option<(Robot, f64)> {
    let mut pieces = pieces;
    let mut best = solve(data, middle, &pieces)?;
    loop {
        let is_absent = |column: &&usize| {
            pieces.iter().all(|piece| match piece {
                Piece::Turn(drives, _) => drives.iter().all(|(of, _)| of != *column),
                Piece::Slide(of) => of != *column,
            })
        };
        let mut tried: Vec<Vec<Piece>> = Vec::new();
        for column in columns.iter().filter(is_absent) {
            if data.columns[*column].kind != Some(JointKind::Revolute) {
                for at in 0..=pieces.len() {
                    let mut with = pieces.clone();
                    with.insert(at, Piece::Slide(*column));
                    tried.push(with);
                }
            }
            if data.columns[*column].kind != Some(JointKind::Prismatic) {
                // A parallelogram: what is behind joint `at` keeps its rotation while the column turns.
                for (at, piece) in pieces.iter().enumerate() {
                    let Piece::Turn(drives, direction) = piece else { continue };
                    for ratio in [-1.0, 1.0] {
                        let mut with = pieces.clone();
                        let coupled = drives.iter().copied().chain([(*column, ratio)]).collect();
                        with[at] = Piece::Turn(coupled, *direction);
                        let own = if ratio < 0.0 { *direction } else { -*direction };
                        with.insert(at, Piece::turn(*column, own));
                        tried.push(with);
                    }
                }
            }
        }
        let solved = tried.into_iter().filter_map(|pieces| Some((solve(data, middle, &pieces)?, pieces)));
        match solved.max_by(|one, other| one.0.1.total_cmp(&other.0.1)) {
            Some((found, with)) if found.1 > best.1 + BETTER => (best, pieces) = (found, with),
            _ => return Some(best),
        }
    }
}

/// Structures where no rotation is measured: columns are put in one by one, turns by a grid of directions.
fn by_places(data: &Data, middle: &[f64], columns: &[usize], width: usize) -> Vec<Robot> {
    let Some(still) = solve(data, middle, &[]) else { return Vec::new() };
    let mut beam = vec![still.clone()];
    let mut found = vec![still];
    for _ in columns {
        let mut next: Vec<(Robot, f64)> = Vec::new();
        for (robot, _) in &beam {
            let pieces = pieces(robot);
            for column in columns.iter().filter(|column| robot.joints.iter().all(|joint| joint.column() != **column)) {
                for at in 0..=pieces.len() {
                    let kind = data.columns[*column].kind;
                    let mut tried = Vec::new();
                    if kind != Some(JointKind::Revolute) {
                        tried.push(Piece::Slide(*column));
                    }
                    if kind != Some(JointKind::Prismatic) {
                        let turned = turns::directions();
                        tried.extend(turned.into_iter().map(|direction| Piece::turn(*column, direction)));
                    }
                    let solved = tried.into_iter().filter_map(|piece| {
                        let mut with = pieces.clone();
                        with.insert(at, piece);
                        solve(data, middle, &with)
                    });
                    next.extend(solved.max_by(|one, other| one.1.total_cmp(&other.1)));
                }
            }
        }
        next.sort_by(|one, other| other.1.total_cmp(&one.1));
        let mut fitted: Vec<(Robot, f64)> = Vec::new();
        for (robot, _) in next.into_iter().take(4 * width) {
            if fitted.iter().all(|(other, _)| other.shape() != robot.shape()) {
                let better = fit(data, &robot, 6);
                fitted.push((better.robot, better.evidence));
            }
        }
        fitted.sort_by(|one, other| other.1.total_cmp(&one.1));
        fitted.truncate(width);
        if fitted.is_empty() {
            break;
        }
        found.extend(fitted.iter().take(3).cloned());
        beam = fitted;
    }
    let mut ranked: Vec<(Robot, f64)> = found
        .into_iter()
        .map(|(robot, _)| {
            let found = fit(data, &robot, 6);
            (found.robot, found.evidence)
        })
        .collect();
    ranked.sort_by(|one, other| other.1.total_cmp(&one.1));
    ranked.into_iter().take(STARTS).map(|found| found.0).collect()
}
