//! Structures by their evidence.

use std::collections::{HashMap, HashSet};

use body_schema_engine::elementary::exp;

use crate::{
    fit::Fit,
    robot::{Robot, Shape},
};

/// By how much evidence a structure must be better to be preferred.
pub const BETTER: f64 = 0.5;

/// Structures of one body by evidence, the best first. Each is fitted once.
#[derive(Clone, Debug)]
pub struct Ranking {
    /// The fits.
    pub fits: Vec<Fit>,
    /// The share of readings that are independent.
    pub independence: f64,
    seen: HashMap<Shape, usize>,
    /// Structures that stand for no mechanism.
    refused: HashSet<Shape>,
}

impl Ranking {
    pub fn new() -> Self {
        Self { fits: Vec::new(), independence: 1.0, seen: HashMap::new(), refused: HashSet::new() }
    }

    /// Weighs all evidence anew.
    pub fn weigh(&mut self, independence: f64) {
        self.independence = independence;
        self.fits.iter_mut().for_each(|fit| fit.evidence = independence * fit.likelihood - fit.price);
    }

    pub fn add(&mut self, mut found: Fit) -> bool {
        found.evidence = self.independence * found.likelihood - found.price;
        let shape = found.robot.shape();
        if !found.evidence.is_finite() {
            self.refused.insert(shape);
            return false;
        }
        let best = self.best();
        match self.seen.get(&shape) {
            Some(index) if self.fits[*index].evidence >= found.evidence => false,
            Some(index) => {
                let is_better = found.evidence > best + 1e-3;
                self.fits[*index] = found;
                is_better
            }
            None => {
                self.seen.insert(shape, self.fits.len());
                let is_better = found.evidence > best + BETTER;
                self.fits.push(found);
                is_better
            }
        }
    }

    pub fn best(&self) -> f64 {
        self.fits.iter().map(|fit| fit.evidence).fold(f64::NEG_INFINITY, f64::max)
    }

    pub fn leader(&self) -> Option<&Fit> {
        self.fits.iter().max_by(|one, other| one.evidence.total_cmp(&other.evidence))
    }

    pub fn has(&self, robot: &Robot) -> bool {
        self.seen.contains_key(&robot.shape()) || self.refused.contains(&robot.shape())
    }

    pub fn sorted(mut self) -> Vec<Fit> {
        self.fits.sort_by(|one, other| other.evidence.total_cmp(&one.evidence));
        self.fits
    }
}

/// The probabilities of structures by their evidence, all equally probable before.
pub fn probabilities(fits: &[Fit]) -> Vec<f64> {
    let best = fits.iter().map(|fit| fit.evidence).fold(f64::NEG_INFINITY, f64::max);
    let odds: Vec<f64> = fits.iter().map(|fit| exp(fit.evidence - best)).collect();
    let sum: f64 = odds.iter().sum();
    odds.into_iter().map(|odds| odds / sum).collect()
}
