//! What axes cannot explain, learned as far as rows that were not learned from say that it predicts better.
//!
//! The rows that are held out decide nothing. Within the training rows there are folds of their own: what is added stays
//! where the mean error over them falls by more than two standard errors, taken from the differences reading by reading.

use serde::{Deserialize, Serialize};

use super::{CalibrationError, Case, Figures, Fit, Residual, Split, Unit};
use crate::parallel::mapped;
use crate::{
    kinematics::JointKind,
    model::{Block, Layout, State},
};

/// What can be added to axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extra {
    /// Ratios of readings, of all joints whose axes are learned.
    Ratios,
    /// Sine and cosine of readings, of all revolute joints whose axes are learned: encoders off their centres.
    Eccentricity,
    /// How much the same joints give way to gravity, at the target and at the elbow.
    Compliance,
}

/// What is tried: each, the two that are functions of a joint's own reading, and all together.
pub(super) const TRIED: [&[Extra]; 5] = [
    &[Extra::Ratios],
    &[Extra::Eccentricity],
    &[Extra::Compliance],
    &[Extra::Ratios, Extra::Eccentricity],
    &[Extra::Ratios, Extra::Eccentricity, Extra::Compliance],
];

/// Folds among the training rows, and how many postures there must be for any.
const FOLDS: usize = 5;
const FEWEST: usize = 10;
/// Rows of the inner folds at most, spread evenly over the table: that many decide.
const MOST: usize = 2000;

/// What came of adding something.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// What was added.
    pub extras: Vec<Extra>,
    /// Parameters more.
    pub parameters: usize,
    /// What has no parameter of its own, since it cannot be told from others, in words.
    pub merged: Vec<String>,
    /// Mean error over the folds among the training rows without it, in the unit of the report.
    pub inner_without: Option<f64>,
    /// The same with it.
    pub inner: Option<f64>,
    /// The standard error of their difference.
    pub standard_error: Option<f64>,
    /// Held-out figures with it; for the reader, who decides nothing by them either.
    pub held_out: Option<Figures>,
    /// Whether it stays.
    pub kept: bool,
}

impl Extra {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ratios => "ratios",
            Self::Eccentricity => "eccentricity",
            Self::Compliance => "compliance",
        }
    }

    /// Its blocks, where all of `extras` are learned.
    pub(super) fn blocks(self, case: &Case<'_>, extras: &[Self], near: &State) -> Vec<Block> {
        let joints = (0..case.guess().joints.len()).filter(|joint| case.scenario.robot.layout.is_learned(*joint));
        match self {
            Self::Ratios => joints.map(Block::Ratio).collect(),
            Self::Eccentricity => joints
                .filter(|joint| case.guess().joints[*joint].kind() == JointKind::Revolute)
                .map(Block::Eccentricity)
                .collect(),
            Self::Compliance => case.borne(extras, near).blocks,
        }
    }
}

impl Case<'_> {
    /// What is worth adding, by folds among `rows`; `near` is a fit of them without it.
    pub fn trials(&self, rows: &[usize], near: &State) -> Result<Vec<Trial>, CalibrationError> {
        let layouts: Vec<Layout> = TRIED.iter().map(|extras| self.extended(extras, near)).collect();
        let plain = self.writable();
        let trial = |(extras, layout): (&&[Extra], &Layout)| Trial {
            extras: extras.to_vec(),
            parameters: layout.dimension() - plain.dimension(),
            merged: if extras.contains(&Extra::Compliance) { self.borne(extras, near).said } else { Vec::new() },
            inner_without: None,
            inner: None,
            standard_error: None,
            held_out: None,
            kept: false,
        };
        let mut trials: Vec<Trial> = TRIED.iter().zip(&layouts).map(trial).collect();
        if Split::numbered(rows, &self.postures).1 < FEWEST {
            return Ok(trials);
        }
        let count = rows.len().min(MOST);
        let spread: Vec<usize> = (0..count).map(|index| rows[index * rows.len() / count]).collect();
        let folds = Split::folds(&spread, FOLDS, &self.postures);
        let without = self.inner(&plain, &folds, near)?;
        for (trial, layout) in trials.iter_mut().zip(&layouts) {
            let with = self.inner(layout, &folds, near)?;
            let figures = Figures::of(&without);
            let (before, after) = (figures.mean(), Figures::of(&with).mean());
            (trial.inner_without, trial.inner) = (before, after);
            trial.standard_error = standard_error(figures.unit(), &without, &with);
        }
        let gain = |trial: &Trial| Some(trial.inner_without? - trial.inner?);
        let is_worth =
            |trial: &Trial| gain(trial).zip(trial.standard_error).is_some_and(|(gain, error)| gain > 2.0 * error);
        let best = trials
            .iter_mut()
            .filter(|trial| is_worth(trial))
            .max_by(|a, b| gain(a).partial_cmp(&gain(b)).unwrap_or(std::cmp::Ordering::Equal));
        if let Some(best) = best {
            best.kept = true;
        }
        Ok(trials)
    }

    fn inner(&self, layout: &Layout, folds: &[Split], near: &State) -> Result<Vec<Residual>, CalibrationError> {
        let judged = |fold: &Split| -> Result<Vec<Residual>, CalibrationError> {
            let fit = self.fit(layout, &fold.training, Some(near))?;
            Ok(self.residuals(&fit, &fold.held_out))
        };
        let found = mapped(folds, judged).into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(found.into_iter().flatten().collect())
    }

    /// The fit with what stays; `plain` itself where nothing does.
    pub fn fuller(&self, trials: &[Trial], plain: &Fit) -> Result<Fit, CalibrationError> {
        match trials.iter().find(|trial| trial.kept) {
            Some(trial) => self.fit(&self.extended(&trial.extras, plain.state()), &plain.rows, Some(plain.state())),
            None => Ok(plain.clone()),
        }
    }
}

/// The standard error of the mean difference, reading by reading, in a unit.
fn standard_error(unit: Unit, before: &[Residual], after: &[Residual]) -> Option<f64> {
    let error = |residual: &Residual| unit.of(&residual.apart);
    let differences: Vec<f64> = before.iter().zip(after).filter_map(|(a, b)| Some(error(a)? - error(b)?)).collect();
    let count = differences.len() as f64;
    if count < 2.0 {
        return None;
    }
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Some((variance / count).sqrt())
}
