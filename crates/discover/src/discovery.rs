//! From a table to a robot: the bodies, their chains, the tree that they make.

use crate::{
    audit::{self, Kind},
    bodies::bodies,
    chain::{self, Effort},
    data::Data,
    fit::{Fit, fit},
    ranking::probabilities,
    robot::{Driven, Robot},
};

/// The chains that may carry one body.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its targets.
    pub targets: Vec<usize>,
    /// The structures, the most probable first.
    pub fits: Vec<Fit>,
    /// Their probabilities.
    pub probabilities: Vec<f64>,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Discovery {
    /// What each column is by itself.
    pub kinds: Vec<Kind>,
    /// The bodies, each with its own chain.
    pub bodies: Vec<Body>,
    /// The robot of all bodies, fitted to all rows.
    pub fit: Fit,
}

/// Why nothing can be found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DiscoverError {
    /// There are too few rows to tell even one joint.
    #[error("the table has {rows} rows with readings, and {needed} at least are needed; measure more postures")]
    FewRows {
        /// How many there are.
        rows: usize,
        /// How many are needed.
        needed: usize,
    },
    /// No column moves.
    #[error("no column moves: all have the same value in every row; move the joints between measurements")]
    NothingMoves,
    /// All columns that move are too wide for radians and metres.
    #[error(
        "no column can be a joint: {columns} name no unit, and their numbers span more than two turns or 13 m; if they are degrees or \
         millimetres, end their titles with _deg or _mm"
    )]
    NoUnits {
        /// Their titles.
        columns: String,
    },
    /// There is no target.
    #[error(
        "the table has no measured place; title its columns x, y, z, with rx, ry, rz or a quaternion where rotations are measured"
    )]
    NoTarget,
}

/// The least number of rows.
const LEAST_ROWS: usize = 4;

/// Finds the robot of a table.
///
/// # Errors
///
/// [`DiscoverError`] if there are too few rows, no target, or no column that moves.
pub fn discover(data: &Data) -> Result<Discovery, DiscoverError> {
    advance(data, None, Effort::Whole)
}

/// Finds the robot of a table, from what was found with fewer rows.
///
/// # Errors
///
/// As [`discover`].
pub fn advance(data: &Data, before: Option<&Discovery>, effort: Effort) -> Result<Discovery, DiscoverError> {
    if data.targets.is_empty() {
        return Err(DiscoverError::NoTarget);
    }
    let rows = data.rows.iter().filter(|row| row.readings.iter().any(Option::is_some)).count();
    if rows < LEAST_ROWS {
        return Err(DiscoverError::FewRows { rows, needed: LEAST_ROWS });
    }
    let kinds = audit::audit(data);
    let columns: Vec<usize> = (0..kinds.len()).filter(|column| kinds[*column] == Kind::Candidate).collect();
    if columns.is_empty() {
        let wide = (0..kinds.len()).filter(|column| kinds[*column] == Kind::Wide);
        let wide: Vec<String> = wide.map(|column| format!("`{}`", data.columns[column].title)).collect();
        return Err(match wide.is_empty() {
            true => DiscoverError::NothingMoves,
            false => DiscoverError::NoUnits { columns: wide.join(", ") },
        });
    }
    let mut found = Vec::new();
    for targets in bodies(data) {
        let own = data.of_targets(&targets);
        let known: Vec<Robot> = before
            .and_then(|before| before.bodies.iter().find(|body| body.targets == targets))
            .map(|body| body.fits.iter().take(4).map(|fit| fit.robot.clone()).collect())
            .unwrap_or_default();
        let is_known = |robot: &Robot| {
            robot.joints.iter().all(|joint| joint.drives.iter().all(|drive| columns.contains(&drive.column)))
        };
        let known: Vec<Robot> = known.into_iter().filter(is_known).collect();
        let fits = chain::search(&own, &columns, &known, effort);
        let probabilities = probabilities(&fits);
        found.push(Body { targets, fits, probabilities });
    }
    let fit = joined(data, &found);
    Ok(Discovery { kinds, bodies: found, fit })
}

/// The tree of all bodies: chains share what they have in common at the ground, as far as the evidence says.
fn joined(data: &Data, bodies: &[Body]) -> Fit {
    let middle = data.middle();
    let mut order: Vec<usize> = (0..bodies.len()).collect();
    order.sort_by_key(|body| std::cmp::Reverse(bodies[*body].fits.first().map_or(0, |fit| fit.robot.joints.len())));
    let mut tree = Robot { targets: Robot::still(data).targets, middle: middle.clone(), joints: Vec::new() };
    let mut best: Option<Fit> = None;
    for body in order {
        let own = &bodies[body];
        // Of structures that are nearly as probable the one that shares most.
        let plausible = own.fits.iter().zip(&own.probabilities).filter(|(_, p)| **p > 0.01 * own.probabilities[0]);
        let mut tried: Vec<Robot> = Vec::new();
        for (fit, _) in plausible.take(4) {
            let chain = fit.robot.rebased(&middle);
            let most = shared(&tree, &chain).len();
            tried.extend((0..=most).map(|share| grafted(&tree, &chain, &own.targets, share)));
        }
        let fits = tried.into_iter().map(|robot| fit(data, &robot, 20));
        let chosen = fits.max_by(|one, other| one.evidence.total_cmp(&other.evidence));
        if let Some(chosen) = chosen {
            tree = chosen.robot.clone();
            best = Some(chosen);
        }
    }
    let best = best.unwrap_or_else(|| fit(data, &tree, 20));
    fit(data, &best.robot, 40)
}

/// The joints of a tree that a chain could share: the longest way from the ground along equal columns and kinds.
fn shared(tree: &Robot, chain: &Robot) -> Vec<usize> {
    let mut way = Vec::new();
    for joint in &chain.joints {
        let parent = way.last().copied();
        let is_same = |(_, other): &(usize, &Driven)| {
            other.parent == parent && other.column() == joint.column() && other.axis.kind() == joint.axis.kind()
        };
        match tree.joints.iter().enumerate().find(is_same) {
            Some((index, _)) => way.push(index),
            None => break,
        }
    }
    way
}

/// A tree with a chain that shares its first joints, `share` of them.
fn grafted(tree: &Robot, chain: &Robot, targets: &[usize], share: usize) -> Robot {
    let mut grown = tree.clone();
    let mut at = shared(tree, chain)[..share].last().copied();
    for joint in &chain.joints[share..] {
        grown.joints.push(Driven { parent: at, ..joint.clone() });
        at = Some(grown.joints.len() - 1);
    }
    for (own, target) in targets.iter().enumerate() {
        grown.targets[*target].carrier = at;
        grown.targets[*target].home = chain.targets[own].home;
    }
    grown
}
