//! What explains an alarm: which change, of what size, since when.

use body_schema_engine::{elementary::exp, model::Quantity};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    body::Body,
    evidence::{Alternative, Turn},
    filter::{Part, log_sum},
    suspect::{Change, Suspect},
};

/// One number of a change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Amount {
    /// What it is: `zero`, `x`, `y`, `z`, `turn x`, `turn y`, `turn z`.
    pub what: String,
    /// The value, in `unit`.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// `deg` or `mm`.
    pub unit: String,
}

/// A change that may explain what was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// What has changed, or has come back.
    pub suspect: Suspect,
    /// Its name.
    pub name: String,
    /// The joint's name, where it is a joint's zero or link.
    pub joint: Option<String>,
    /// Its probability among all changes that could explain it.
    pub probability: f64,
    /// By how much; empty of what has come back.
    pub amounts: Vec<Amount>,
    /// The sighting from which on it is most likely there, counted from 1.
    pub since: u64,
    /// The earliest and the latest sighting of a 90 % interval.
    pub since_90: [u64; 2],
}

/// A change by its number, with its probability, and with mean and covariance over all times at which it may have happened.
pub(crate) struct Grouped {
    pub turn: Turn,
    pub probability: f64,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    since: Vec<(u64, f64)>,
}

/// Alternatives by what they say has happened last, the likeliest first. Their `log` need not be normalised.
pub(crate) fn grouped(alternatives: &[Alternative]) -> Vec<Grouped> {
    by(alternatives, |it| vec![(it.turn, it.since)])
}

/// The changes that stand, the likeliest first, each over all alternatives by which it does.
pub(crate) fn standing(alternatives: &[Alternative]) -> Vec<Grouped> {
    by(alternatives, |it| it.standing.iter().map(|(index, since)| (Turn::Change(*index), *since)).collect())
}

/// Alternatives by what `says` each says, with the sighting since which it does.
fn by(alternatives: &[Alternative], says: impl Fn(&Alternative) -> Vec<(Turn, u64)>) -> Vec<Grouped> {
    let total = log_sum(alternatives.iter().map(|it| it.log));
    let said: Vec<(Turn, u64, &Alternative)> =
        alternatives.iter().flat_map(|it| says(it).into_iter().map(move |(turn, since)| (turn, since, it))).collect();
    let mut turns: Vec<Turn> = said.iter().map(|it| it.0).collect();
    turns.sort_unstable();
    turns.dedup();
    let members = |turn: Turn| said.iter().filter(move |it| it.0 == turn).map(|it| (it.1, it.2)).collect::<Vec<_>>();
    let mut groups: Vec<Grouped> = turns.iter().map(|turn| group(*turn, &members(*turn), total)).collect();
    groups.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    groups
}

fn group(turn: Turn, members: &[(u64, &Alternative)], total: f64) -> Grouped {
    let within = log_sum(members.iter().map(|(_, it)| it.log));
    let mut since: Vec<(u64, f64)> = members.iter().map(|(since, it)| (*since, exp(it.log - within))).collect();
    since.sort_unstable_by_key(|it| it.0);
    let (mut mean, mut covariance) = (DVector::zeros(0), DMatrix::zeros(0, 0));
    if let Turn::Change(index) = turn {
        let of = |(_, it): &(u64, &Alternative)| Some((exp(it.log - within), it.filter.of(Part::Change(index))?));
        let known: Vec<_> = members.iter().filter_map(of).collect();
        let k = known.first().map_or(0, |it| it.1.0.len());
        (mean, covariance) = (DVector::zeros(k), DMatrix::zeros(k, k));
        known.iter().for_each(|(weight, (of, _))| mean += of * *weight);
        for (weight, (of, spread)) in &known {
            let apart = of - &mean;
            covariance += (spread + &apart * apart.transpose()) * *weight;
        }
    }
    Grouped { turn, probability: exp(within - total), mean, covariance, since }
}

/// A number of a change, from its value and variance in rad or m.
pub(crate) fn amount(change: &Change, k: usize, value: f64, variance: f64) -> Amount {
    const NAMES: [&str; 6] = ["x", "y", "z", "turn x", "turn y", "turn z"];
    let what = if change.units.len() == 1 { "zero" } else { NAMES[k % NAMES.len()] };
    let (factor, unit) = match change.units[k] {
        Quantity::Angle => (1_f64.to_degrees(), "deg"),
        _ => (1e3, "mm"),
    };
    let sd = variance.max(0.0).sqrt() * factor;
    Amount { what: what.to_owned(), value: value * factor, sd, unit: unit.to_owned() }
}

impl Grouped {
    pub fn told(&self, body: &Body) -> Option<Explanation> {
        let (Turn::Change(index) | Turn::Return(index)) = self.turn;
        let change = body.changes.get(index)?;
        let quantile = |share: f64| {
            let mut sum = 0.0;
            let found = self.since.iter().find(|(_, weight)| {
                sum += weight;
                sum >= share
            });
            found.or(self.since.last()).map_or(0, |it| it.0)
        };
        let best = self.since.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |it| it.0);
        Some(Explanation {
            suspect: change.suspect,
            name: change.suspect.name(&body.names),
            joint: change.suspect.joint().and_then(|joint| body.names.joints.get(joint).cloned()),
            probability: self.probability,
            amounts: (0..self.mean.len()).map(|k| amount(change, k, self.mean[k], self.covariance[(k, k)])).collect(),
            since: best,
            since_90: [quantile(0.05), quantile(0.95)],
        })
    }
}
