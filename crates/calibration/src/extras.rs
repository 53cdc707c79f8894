//! Extra corrections, which axes cannot express, kept only if they predict rows better that were not learned from.
//!
//! The rows that are held out decide nothing. Within the training rows there are folds of their own: what is added stays where the mean
//! error over them falls by more than two standard errors, taken from the differences reading by reading.
//!
//! Folds say nothing of postures that lie elsewhere than all rows. With p and p′ the hand as predicted without and with what is added, P
//! and P′ the covariances and J, J′ the Jacobians, all fitted to all rows, what is added changes predictions where the robot is asked about
//! by
//!
//! ```text
//! c = rms ‖p′ − p‖,    v = √ mean tr(J′ P′ J′ᵀ − J P Jᵀ)
//! ```
//!
//! of which v is what it makes less certain. Postures that are asked about lie outside those of the rows where v is more than twice as
//! large there as over the rows. What is added stays then only where c is above two v: a change that is certain. Where it is not, what
//! stays may be a part of it for which both hold.
//!
//! Where the robot is asked about sockets that no row is in, or all rows are in the sockets of one place, nothing is added: rows in one place
//! meet there, and folds of real robots spoke for what did not hold in other places.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::{CalibrationError, Case, Extra, Figures, Fit, Residual, Split, Unit, coverage::widening};
use body_schema_engine::parallel::mapped;
use body_schema_engine::{
    kinematics::JointKind,
    model::{Block, Layout, State, Workspace, listed},
};
use body_schema_scenario::SocketSpec;

/// The combinations that are tried: each alone, the two that are functions of a joint's own reading, and all together.
pub(super) const TRIED: [&[Extra]; 5] = [
    &[Extra::Ratios],
    &[Extra::Eccentricity],
    &[Extra::Compliance],
    &[Extra::Ratios, Extra::Eccentricity],
    &[Extra::Ratios, Extra::Eccentricity, Extra::Compliance],
];

/// The number of folds among the training rows, and the least number of postures for any.
pub(super) const FOLDS: usize = 5;
pub(super) const FEWEST: usize = 10;
/// The factor of uncertainty beyond which postures lie outside those of the rows.
const OUTSIDE: f64 = 2.0;
/// Deviations by which a change of predictions is certain.
const CERTAIN: f64 = 2.0;
/// The most rows of the inner folds, spread evenly over the table; that many are enough to decide.
const MOST: usize = 2000;

/// A trial of extra corrections.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The corrections that were added.
    pub extras: Vec<Extra>,
    /// The number of parameters that they add.
    pub parameters: usize,
    /// The corrections without a parameter of their own, because they cannot be told from others, in words.
    pub merged: Vec<String>,
    /// Mean error over the folds among the training rows without it, in the unit of the report.
    pub inner_without: Option<f64>,
    /// Mean error over the folds among the training rows with it, in the unit of the report.
    pub inner: Option<f64>,
    /// The standard error of the difference of the two.
    pub standard_error: Option<f64>,
    /// Held-out figures with it, for information; they decide nothing.
    pub held_out: Option<Figures>,
    /// The change that it makes to predictions where the robot is asked about, root mean square, millimetres; null where the folds do not
    /// support it.
    #[serde(default)]
    pub change_mm: Option<f64>,
    /// The standard deviation that it adds to predictions there, millimetres.
    #[serde(default)]
    pub change_sd_mm: Option<f64>,
    /// Whether it is dropped although the folds support it, because the postures that are asked about lie outside those of the
    /// rows.
    #[serde(default)]
    pub is_beyond: bool,
    /// Whether it is kept.
    pub kept: bool,
}

impl Trial {
    /// Why it is dropped although the folds support it.
    pub(super) fn warning(&self) -> Option<String> {
        let (change, sd) = (self.change_mm.filter(|_| self.is_beyond)?, self.change_sd_mm?);
        let names = listed(self.extras.iter().map(|extra| extra.name().to_owned()).collect());
        Some(format!(
            "the postures that are asked about lie outside those learned from: {names} would change predictions there by {change:.2} mm, \
             of which {sd:.2} mm are uncertain, so that it does not stay, though it predicts better among the training rows; learn \
             from rows that are spread as widely"
        ))
    }
}

impl Extra {
    /// Its blocks, when all of `extras` are learned.
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
    /// The trials before anything is tried, in the order of `TRIED`; `near` is a fit without corrections.
    pub(super) fn untried(&self, near: &State) -> Vec<Trial> {
        let plain = self.writable().dimension();
        let trial = |extras: &&[Extra]| Trial {
            extras: extras.to_vec(),
            parameters: self.extended(extras, near).dimension() - plain,
            merged: if extras.contains(&Extra::Compliance) { self.borne(extras, near).said } else { Vec::new() },
            inner_without: None,
            inner: None,
            standard_error: None,
            held_out: None,
            change_mm: None,
            change_sd_mm: None,
            is_beyond: false,
            kept: false,
        };
        TRIED.iter().map(trial).collect()
    }

    /// Tries the extra corrections by folds among `rows` and where the robot is `asked` about; `plain` is a fit of the rows without
    /// them. Returns the trials, and the factor by which readings scatter more widely in these folds than stated.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Prior`] or [`CalibrationError::Estimation`] if a fit fails.
    pub fn trials(
        &self,
        rows: &[usize],
        plain: &Fit,
        asked: &Workspace,
    ) -> Result<(Vec<Trial>, f64), CalibrationError> {
        let near = plain.state();
        let (mut trials, writable) = (self.untried(near), self.writable());
        if Split::numbered(rows, &self.postures).1 < FEWEST {
            return Ok((trials, 1.0));
        }
        let count = rows.len().min(MOST);
        let spread: Vec<usize> = (0..count).map(|index| rows[index * rows.len() / count]).collect();
        let folds = Split::folds(&spread, FOLDS, &self.postures);
        let (without, reaches) = self.inner(&writable, &folds, near)?;
        let layouts: Vec<Layout> = TRIED.iter().map(|extras| self.extended(extras, near)).collect();
        for (trial, layout) in trials.iter_mut().zip(&layouts) {
            let (with, _) = self.inner(layout, &folds, near)?;
            let figures = Figures::of(&without);
            let (before, after) = (figures.mean(), Figures::of(&with).mean());
            (trial.inner_without, trial.inner) = (before, after);
            trial.standard_error = standard_error(figures.unit(), &without, &with);
        }
        let gain = |trial: &Trial| Some(trial.inner_without? - trial.inner?);
        let is_worth =
            |trial: &Trial| gain(trial).zip(trial.standard_error).is_some_and(|(gain, error)| gain > 2.0 * error);
        let mut worth: Vec<usize> = (0..trials.len()).filter(|index| is_worth(&trials[*index])).collect();
        worth.sort_by(|a, b| gain(&trials[*b]).partial_cmp(&gain(&trials[*a])).unwrap_or(Ordering::Equal));
        let is_elsewhere = !self.is_everywhere(rows);
        // Of what reaches too far a part may not.
        let most = worth.first().map_or(&[][..], |index| TRIED[*index]);
        worth.retain(|index| TRIED[*index].iter().all(|extra| most.contains(extra)));
        for index in worth {
            let fit = self.fit(&layouts[index], &plain.rows, Some(near))?;
            let trial = &mut trials[index];
            let own = if self.meets_itself() { self.in_sockets(&fit.rows) } else { self.predicted(&fit.rows) };
            if let (Some([change, sd]), Some([_, within])) =
                (self.change(plain, &fit, asked), self.change(plain, &fit, &own))
            {
                (trial.change_mm, trial.change_sd_mm) = (Some(change), Some(sd));
                trial.is_beyond = sd > OUTSIDE * within && change <= CERTAIN * sd;
            }
            trial.is_beyond |= is_elsewhere;
            if !trial.is_beyond {
                trial.kept = true;
                break;
            }
        }
        Ok((trials, widening(&reaches)))
    }

    /// Whether some of `rows` is in every socket of this robot, and these are not all of one place; without sockets it is so.
    fn is_everywhere(&self, rows: &[usize]) -> bool {
        let sockets: Vec<&SocketSpec> = self.scenario.robot.all_sockets().collect();
        let is_in = |socket: usize| rows.iter().any(|row| self.rows[*row].socket == Some(socket));
        let is_one_place = sockets.windows(2).all(|pair| pair[0].place == pair[1].place);
        sockets.is_empty() || ((0..sockets.len()).all(is_in) && !is_one_place)
    }

    /// c and v, millimetres; `None` without a covariance.
    fn change(&self, plain: &Fit, extended: &Fit, asked: &Workspace) -> Option<[f64; 2]> {
        let square = |fit: &Fit| {
            let jacobian = asked.jacobian(fit.state(), &fit.belief.layout);
            Some((&jacobian * fit.belief.covariance.as_ref()?).dot(&jacobian) / asked.configurations.len() as f64)
        };
        let (change, _) = asked.distance(&asked.points(extended.state()), &asked.points(plain.state()))?;
        let sd = (square(extended)? - square(plain)?).max(0.0).sqrt();
        (change.is_finite() && sd.is_finite()).then_some([change * 1e3, sd * 1e3])
    }

    /// The residuals of every fold's held-out rows, and how far these [reach](Self::reaches).
    pub(super) fn inner(&self, layout: &Layout, folds: &[Split], near: &State) -> Result<Inner, CalibrationError> {
        let judged = |fold: &Split| -> Result<Inner, CalibrationError> {
            let fit = self.fit(layout, &fold.training, Some(near))?;
            Ok((self.residuals(&fit, &fold.held_out), self.reaches(&fit, &fold.held_out)))
        };
        let found = mapped(folds, judged).into_iter().collect::<Result<Vec<_>, _>>()?;
        let (residuals, reaches): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        Ok((residuals.concat(), reaches.concat()))
    }

    /// The extended model with the corrections that are kept; `plain` itself if none are.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Prior`] or [`CalibrationError::Estimation`] if the fit fails.
    pub fn extended_fit(&self, trials: &[Trial], plain: &Fit) -> Result<Fit, CalibrationError> {
        match trials.iter().find(|trial| trial.kept) {
            Some(trial) => self.fit(&self.extended(&trial.extras, plain.state()), &plain.rows, Some(plain.state())),
            None => Ok(plain.clone()),
        }
    }
}

/// Residuals, and by reading its row and its reach.
type Inner = (Vec<Residual>, Vec<(usize, f64)>);

/// The standard error of the mean difference, reading by reading, in a unit.
fn standard_error(unit: Unit, before: &[Residual], after: &[Residual]) -> Option<f64> {
    let error = |residual: &Residual| unit.of(&residual.norms);
    let differences: Vec<f64> = before.iter().zip(after).filter_map(|(a, b)| Some(error(a)? - error(b)?)).collect();
    let count = differences.len() as f64;
    if count < 2.0 {
        return None;
    }
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Some((variance / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{REAL, learned_at, of_one_place};

    /// Of two real robots with a ball in sockets, learned at each of their places: what is kept makes predictions at the other places no
    /// worse, and what folds speak for in vain is told. It is so where the table has no other place, too.
    #[test]
    fn what_is_kept_does_not_hurt_elsewhere() {
        let mut beyond = 0;
        for (name, places) in REAL {
            for place in places {
                let scenario = learned_at(name, place, "criterion = \"d\"");
                let alone = of_one_place(name, place);
                let case = Case::new(&alone).expect("measured");
                let rows: Vec<usize> = (0..case.rows.len()).collect();
                let fit = case.fit(&case.writable(), &rows, None).expect("fitted");
                let (trials, _) = case.trials(&rows, &fit, &case.asked_about(fit.state(), &[])).expect("tried");
                assert!(trials.iter().all(|trial| !trial.kept), "{name} {place}");
                let case = Case::new(&scenario).expect("measured");
                let splits = case.splits(None).expect("as the file says");
                let (training, held_out) = (&splits[0].training, &splits[0].held_out);
                let nominal = case.nominal(training).expect("fitted");
                let fit = case.fit(&case.writable(), training, Some(nominal.state())).expect("fitted");
                let asked = case.asked_about(fit.state(), &splits);
                let (trials, _) = case.trials(training, &fit, &asked).expect("tried");
                let extended = case.extended_fit(&trials, &fit).expect("fitted");
                let mean = |fit| Figures::of(&case.residuals(fit, held_out)).mean().expect("lengths");
                let (with, without) = (mean(&extended), mean(&fit));
                assert!(with <= 1.02 * without, "{name} {place}: {without} to {with} mm");
                beyond += trials.iter().filter(|trial| trial.is_beyond && !trial.kept).count();
                let said: Vec<String> = trials.iter().filter_map(Trial::warning).collect();
                assert!(said.iter().all(|said| said.contains("lie outside those learned from")), "{said:?}");
            }
        }
        assert!(beyond > 0, "nothing was left out");
    }
}
