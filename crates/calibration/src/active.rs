//! Active choice of rows: the most informative ones instead of all, compared with random ones.
//!
//! Rows are picked one by one by the scenario's criterion. Before the first, the belief is the prior at the description; after each,
//! everything is fitted anew to the rows picked so far, and predictions are judged by the rows that are held out. Once the model error
//! makes predictions worse than the uncertainty of the parameters does, rows are picked to be distributed like the postures that are asked
//! about, as a session's movements are.

use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use super::{CalibrationError, Case, Figures, Fit, Progress, Split};
use body_schema_engine::parallel::mapped;
use body_schema_engine::{
    elementary::powf,
    model::{Layout, State},
    selection::{Criterion, Weights, herd},
};
use body_schema_experiment::Stream;

/// The held-out error after a number of rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActivePoint {
    /// The number of rows learned from.
    pub rows: usize,
    /// The mean held-out error with chosen rows, millimetres; null without chosen rows.
    pub active_mm: Option<f64>,
    /// The median of the mean held-out error over random orders, millimetres.
    pub random_median_mm: Option<f64>,
    /// The lower quartile over random orders, millimetres.
    pub random_q25_mm: Option<f64>,
    /// The upper quartile over random orders, millimetres.
    pub random_q75_mm: Option<f64>,
}

/// The number of random orders beside chosen rows.
pub const ORDERS: usize = 20;
/// The number of random orders where no rows are chosen, and of the row counts at which they are judged.
const FEW_ORDERS: usize = 8;
const SIZES: usize = 8;
/// The most rows among which rows are chosen, spread evenly; also the most rows for which the error by number of rows
/// is computed without being asked for.
const POOL: usize = 2000;
/// The number of rows below which a fit is searched wherever the prior allows, not near the last.
const SEARCHED: usize = 8;
/// The seed of the random orders.
const SEED: u64 = 1;

impl Case<'_> {
    /// The `count` of `rows` that are most informative, by their postures, for predictions at the rows `asked`: in the order of the
    /// choice, with the fit after each.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Active`] if `count` is 0 or more than the rows to choose from, [`CalibrationError::GivenUp`] if `progress`
    /// says that nobody waits any longer, [`CalibrationError::Estimation`] or [`CalibrationError::Selection`] if a fit or the criterion
    /// fails.
    pub fn choose(
        &self,
        rows: &[usize],
        asked: &[usize],
        count: usize,
        progress: &dyn Progress,
    ) -> Result<(Vec<usize>, Vec<Fit>), CalibrationError> {
        let mut pool: Vec<usize> =
            (0..rows.len().min(POOL)).map(|k| rows[k * rows.len() / rows.len().min(POOL)]).collect();
        if count == 0 || count > pool.len() {
            return Err(CalibrationError::Active { asked: count, rows: pool.len() });
        }
        let layout = self.writable();
        let deviations = self.deviations(&layout);
        let selection = &self.scenario.selection;
        let weights = Weights::new(selection.units, &layout, &deviations);
        let (mut chosen, mut fits) = (Vec::new(), Vec::new());
        let mut fit = self.fit(&layout, &[], None)?;
        let of_pool = self.predicted(&pool);
        while chosen.len() < count {
            let workspace = if self.meets_itself() { self.met(fit.state(), asked) } else { of_pool.clone() };
            let best = if fit.belief.model_error_prevails(&workspace) {
                let postures = |rows: &[usize]| -> Vec<&[f64]> {
                    rows.iter().map(|row| self.rows[*row].positions.as_slice()).collect()
                };
                herd(&postures(&pool), &workspace.configurations, &postures(&chosen))
            } else {
                let criterion = Criterion::new(&fit.belief, &weights)?.by(selection.planning.optimality, &workspace);
                let gains = mapped(&pool, |row| criterion.gain_of(&self.whitened(&fit, *row)));
                let gain = |place: usize| if gains[place].is_finite() { gains[place] } else { f64::NEG_INFINITY };
                // The first of equals: `max_by` would take the last.
                (0..pool.len()).rev().max_by(|a, b| gain(*a).total_cmp(&gain(*b)))
            };
            chosen.extend(best.map(|place| pool.remove(place)));
            fit = self.fit(&layout, &chosen, near(&fit, chosen.len()))?;
            fits.push(fit.clone());
            progress.advance()?;
        }
        Ok((chosen, fits))
    }

    /// Hᵀ of what was read in a row, whitened by the noise that a fit found.
    pub(super) fn whitened(&self, fit: &Fit, row: usize) -> DMatrix<f64> {
        let (belief, row) = (&fit.belief, &self.rows[row]);
        belief.measurement_model.equations_of(&belief.state, &belief.layout, &row.positions, &row.observation).rows
    }

    /// The held-out error after `1..=count` chosen rows, and in random orders, over all `splits`.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::NothingHeldOut`] if no split holds rows out; otherwise the errors of
    /// [`choose`](Self::choose).
    pub fn active(
        &self,
        splits: &[Split],
        count: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<ActivePoint>, CalibrationError> {
        if splits.iter().all(|split| split.held_out.is_empty()) {
            return Err(CalibrationError::NothingHeldOut);
        }
        progress.stage("chosen rows", (splits.len() * count) as u64);
        let mut active = Vec::new();
        for split in splits {
            let (_, fits) = self.choose(&split.training, &split.held_out, count, progress)?;
            active.push(fits.iter().map(|fit| self.held_out(fit, split)).collect::<Vec<Figures>>());
        }
        let sizes: Vec<usize> = (1..=count).collect();
        let random = self.random(splits, &sizes, ORDERS, progress)?;
        let point = |(index, rows): (usize, &usize)| {
            let chosen: Vec<Figures> = active.iter().map(|figures| figures[index]).collect();
            point(*rows, together(&chosen), &random[index])
        };
        Ok(sizes.iter().enumerate().map(point).collect())
    }

    /// The held-out error by number of rows in random orders; empty if no rows are held out, or too many rows would
    /// have to be tried.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Estimation`] if a fit fails, [`CalibrationError::GivenUp`] if `progress` says that nobody
    /// waits any longer.
    pub fn learning(&self, splits: &[Split], progress: &dyn Progress) -> Result<Vec<ActivePoint>, CalibrationError> {
        let fewest = splits.iter().map(|split| split.training.len()).min().unwrap_or(0);
        if splits.iter().all(|split| split.held_out.is_empty()) || !(3..=POOL).contains(&fewest) {
            return Ok(Vec::new());
        }
        let ratio = powf(fewest as f64 / 3.0, 1.0 / (SIZES - 1) as f64);
        let mut sizes: Vec<usize> = (0..SIZES).map(|k| (3.0 * ratio.powi(k as i32)).round() as usize).collect();
        sizes.dedup();
        let random = self.random(splits, &sizes, FEW_ORDERS, progress)?;
        Ok(sizes.iter().zip(&random).map(|(rows, errors)| point(*rows, None, errors)).collect())
    }

    /// The mean held-out error over all splits, by number of rows and random order.
    fn random(
        &self,
        splits: &[Split],
        sizes: &[usize],
        orders: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<f64>>, CalibrationError> {
        progress.stage("random rows", orders as u64);
        let layout = self.writable();
        let numbers: Vec<u64> = (0..orders as u64).collect();
        let found = mapped(&numbers, |number| -> Result<Vec<Option<f64>>, CalibrationError> {
            let by_split = splits.iter().map(|split| self.in_order(&layout, split, sizes, *number));
            let by_split = by_split.collect::<Result<Vec<_>, _>>()?;
            progress.advance()?;
            let at = |index: usize| together(&by_split.iter().map(|figures| figures[index]).collect::<Vec<_>>());
            Ok((0..sizes.len()).map(at).collect())
        });
        let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok((0..sizes.len()).map(|index| found.iter().filter_map(|order| order[index]).collect()).collect())
    }

    fn in_order(
        &self,
        layout: &Layout,
        split: &Split,
        sizes: &[usize],
        number: u64,
    ) -> Result<Vec<Figures>, CalibrationError> {
        let mut order = split.training.clone();
        order.shuffle(&mut Stream::Policy.keyed(SEED, number));
        let mut last: Option<Fit> = None;
        let mut figures = Vec::new();
        for size in sizes {
            let start = last.as_ref().and_then(|fit| near(fit, *size));
            let fit = self.fit(layout, &order[..*size], start)?;
            figures.push(self.held_out(&fit, split));
            last = Some(fit);
        }
        Ok(figures)
    }

    fn held_out(&self, fit: &Fit, split: &Split) -> Figures {
        Figures::of(&self.residuals(fit, &split.held_out))
    }
}

fn near(fit: &Fit, rows: usize) -> Option<&State> {
    (rows > SEARCHED).then(|| fit.state())
}

/// The mean over all readings of several sets.
fn together(figures: &[Figures]) -> Option<f64> {
    let (sum, count) = figures
        .iter()
        .filter_map(|it| Some((it.mean()?, it.readings as f64)))
        .fold((0.0, 0.0), |(sum, count), (mean, readings)| (sum + mean * readings, count + readings));
    (count > 0.0).then(|| sum / count)
}

fn point(rows: usize, active_mm: Option<f64>, random: &[f64]) -> ActivePoint {
    let mut sorted = random.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = share * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
        Some(low + (high - low) * at.fract())
    };
    ActivePoint {
        rows,
        active_mm,
        random_median_mm: quantile(0.5),
        random_q25_mm: quantile(0.25),
        random_q75_mm: quantile(0.75),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Silent,
        laws::{REAL, learned_at},
    };

    #[test]
    fn quartiles_lie_between_neighbours() {
        let found = point(7, Some(1.0), &[4.0, 1.0, 2.0, 3.0]);
        assert_eq!(
            (found.random_q25_mm, found.random_median_mm, found.random_q75_mm),
            (Some(1.75), Some(2.5), Some(3.25))
        );
        assert_eq!(point(7, None, &[]).random_median_mm, None);
    }

    /// Of two real robots with a ball in sockets, at each of their twelve places: rows chosen by what is asked at the other places predict
    /// the ball there better than random rows do. Over all places and several numbers of rows, since a single fit of a dozen rows is half
    /// as good or twice as good by chance.
    #[test]
    fn rows_chosen_by_what_is_asked_in_other_sockets_tell_more_than_random_ones() {
        const ROWS: [usize; 5] = [8, 10, 12, 14, 16];
        let mut logarithms = Vec::new();
        for (name, places) in REAL {
            for place in places {
                let scenario = learned_at(name, place, "criterion = \"i\"");
                let case = Case::new(&scenario).expect("measured");
                let splits = case.splits(None).expect("as the file says");
                let (_, fits) = case
                    .choose(&splits[0].training, &splits[0].held_out, ROWS[ROWS.len() - 1], &Silent)
                    .expect("enough rows");
                let random = case.random(&splits, &ROWS, 9, &Silent).expect("fitted");
                for (rows, random) in ROWS.into_iter().zip(random) {
                    let chosen = case.held_out(&fits[rows - 1], &splits[0]).mean().expect("lengths");
                    let random = point(rows, None, &random).random_median_mm.expect("orders");
                    logarithms.push((chosen / random).ln());
                }
            }
        }
        let ratio = |of: &[f64]| (of.iter().sum::<f64>() / of.len() as f64).exp();
        let panda = &logarithms[..REAL[0].1.len() * ROWS.len()];
        for (of, ratio) in [("the Panda", ratio(panda)), ("both robots", ratio(&logarithms))] {
            assert!(ratio < 0.9, "{of}: {ratio} of random rows, {logarithms:.2?}");
        }
    }
}
