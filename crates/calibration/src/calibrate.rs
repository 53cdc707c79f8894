//! Calibration: from a case to everything in its report.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    CalibrationError, Case, Chain, Choice, Comparison, Coverage, Extra, Figures, Fit, Fold, HeldOut, Outlier, Progress,
    Reading, Report, Residual, Split, Trial, Verdict,
    extras::TRIED,
    figures::{Sensed, Unit},
    misfit::misfit,
    verdict::Grounds,
};
use body_schema_diagnostics::{DiagnosticKind, Line, few_folds};
use body_schema_engine::{most::middle, selection::Optimality};

/// The options of a calibration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// The number of folds in which every row is held out once, in place of the file's rule. With 0 all rows are learned from and nothing
    /// is judged, neither folds nor corrections beyond the axes nor the curve of learning: a small part of the time.
    pub folds: Option<usize>,
    /// The number of rows to choose one by one, and to compare with random ones.
    pub active: Option<usize>,
}

/// The result of a calibration.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The report.
    pub report: Report,
    /// The chain as described, with base, targets, cameras and sockets fitted to the training rows.
    pub nominal: Fit,
    /// The fit of what a URDF can hold.
    pub fit: Fit,
    /// The corrections that were added to it.
    pub extras: Vec<Extra>,
    /// The extended model with these corrections; equal to `fit` where there are none.
    pub extended: Fit,
    /// The fit of what a URDF can hold, fold by fold; empty without folds.
    pub folds: Vec<Fit>,
    /// The residuals of held-out readings by `fit`, or by those of the folds, as far as they count in figures.
    pub held_out: Vec<Residual>,
}

/// The judgement of one split.
struct Judged {
    before: Vec<Residual>,
    after: Vec<Residual>,
    extended: Vec<Residual>,
    /// The residuals of each trial.
    tried: Vec<Vec<Residual>>,
    /// For each reading its row, and whether it lies within the stated interval.
    covered: Vec<(usize, bool)>,
    /// The factor by which that interval was widened.
    widening: f64,
}

/// Calibrates a case.
///
/// # Errors
///
/// [`CalibrationError`] if the options do not fit the table, or no fit explains it.
pub fn calibrate(case: &Case<'_>, options: &Options, progress: &dyn Progress) -> Result<Calibration, CalibrationError> {
    let is_judged = options.folds != Some(0);
    let splits = case.splits(options.folds)?;
    let has_folds = splits.len() > 1;
    let Some(first) = splits.first() else { return Err(CalibrationError::NoRows) };
    let mut training = first.training.clone();
    if has_folds {
        training.extend(&first.held_out);
        training.sort_unstable();
    }
    if training.is_empty() {
        return Err(CalibrationError::NoRows);
    }
    progress.stage("all training rows", 3);
    let nominal = case.nominal(&training)?;
    progress.advance()?;
    let fit = case.fit(&case.writable(), &training, Some(nominal.state()))?;
    progress.advance()?;
    let mut strays = case.strays(&fit);
    let asked = case.asked_about(fit.state(), &splits);
    let (mut trials, widening) = if is_judged {
        case.trials(&without(&training, &strays), &fit, &asked)?
    } else {
        (case.untried(fit.state()), 1.0)
    };
    let extended = case.extended_fit(&trials, &fit)?;
    progress.advance()?;

    progress.stage(if has_folds { "folds" } else { "held-out rows" }, splits.len() as u64);
    let (mut folds, mut judged) = (Vec::new(), Vec::new());
    for split in splits.iter().filter(|split| !split.held_out.is_empty()) {
        let (fold, verdict) = if has_folds {
            let nominal = case.nominal(&split.training)?;
            let fit = case.fit(&case.writable(), &split.training, Some(nominal.state()))?;
            let (trials, widening) = case.trials(&without(&split.training, &case.strays(&fit)), &fit, &asked)?;
            let extended = case.extended_fit(&trials, &fit)?;
            let verdict = case.judge(split, (&nominal, &fit, &extended), widening)?;
            (fit, verdict)
        } else {
            (fit.clone(), case.judge(split, (&nominal, &fit, &extended), widening)?)
        };
        folds.push(fold);
        judged.push(verdict);
        progress.advance()?;
    }
    // What went wrong altogether counts for nothing in any figure, nor for what is judged by figures.
    let learned: BTreeSet<usize> = fit.rows.iter().copied().collect();
    let unlearned = judged.iter().flat_map(|judged| &judged.after).filter(|it| !learned.contains(&it.row));
    let unlearned = gross(GROSS, &unlearned.collect::<Vec<_>>());
    strays.extend(&unlearned);
    let figures = |residuals: &mut dyn Iterator<Item = &Residual>| {
        Figures::of(residuals.filter(|it| !strays.contains(&(it.row, it.sensor))))
    };
    for (index, trial) in trials.iter_mut().enumerate().filter(|_| !judged.is_empty()) {
        trial.held_out = Some(figures(&mut judged.iter().flat_map(|judged| &judged.tried[index])));
    }
    let mut without_strays = splits.clone();
    without_strays.iter_mut().for_each(|split| split.held_out = without(&split.held_out, &strays));

    let (mut active, mut selection, mut learning) = (Vec::new(), None, Vec::new());
    if let Some(count) = options.active {
        active = case.active(&without_strays, count, progress)?;
        let asked = if has_folds { &training } else { &first.held_out };
        selection = Some(case.choice(&training, asked, count, progress)?);
    } else if is_judged {
        learning = case.learning(&without_strays, progress)?;
    }

    let training_residuals = |fit: &Fit| case.residuals(fit, &training);
    let comparison = Comparison {
        before: figures(&mut training_residuals(&nominal).iter()),
        after: figures(&mut training_residuals(&fit).iter()),
    };
    let all = |of: fn(&Judged) -> &Vec<Residual>| figures(&mut judged.iter().flat_map(of));
    let held_out = if judged.is_empty() {
        None
    } else {
        Some(HeldOut {
            before: all(|it| &it.before),
            after: all(|it| &it.after),
            full_model: all(|it| &it.extended),
            folds: if has_folds { case.folds(&splits, &folds, &judged, &figures)? } else { Vec::new() },
        })
    };
    let scenario = case.scenario;
    let examination = scenario.examine().unwrap_or_default();
    let noise = case.noise(&fit);
    let share = if has_folds { 1.0 - 1.0 / splits.len() as f64 } else { 1.0 };
    let judged_by = held_out.as_ref().map(|held_out| (&held_out.after, share));
    let more_rows = case.more_rows(&fit, &asked, judged_by, (&noise, examination.sigma_m));
    let mut doubts = examination.diagnostics;
    doubts
        .extend(options.folds.filter(|_| is_judged).and_then(|folds| few_folds(folds, splits.len(), case.rows.len())));
    let outliers = case.outliers(&fit, unlearned.iter().map(|(row, _)| *row).collect());
    let misfit = misfit(&noise, held_out.as_ref().map(|it| &it.after), outliers.len(), case.rows.len());
    let misfit = misfit.or_else(|| case.readings_misfit(&fit));
    if let Some(misfit) = misfit.filter(|_| doubts.iter().all(|doubt| doubt.kind != DiagnosticKind::Misfit)) {
        doubts.insert(0, misfit);
    }
    let stray_rows: BTreeSet<usize> = strays.iter().map(|(row, _)| *row).collect();
    let covered: Vec<(usize, bool)> =
        judged.iter().flat_map(|it| &it.covered).filter(|(row, _)| !stray_rows.contains(row)).copied().collect();
    let widened = judged.iter().map(|it| it.widening).sum::<f64>() / judged.len().max(1) as f64;
    let coverage = Coverage::of(&covered, widened);
    let unit = held_out.as_ref().map_or(comparison.after.unit(), |held_out| held_out.after.unit());
    let span_1m_sd_mm = if case.meets_itself() { case.span_sd_mm(&fit) } else { None };
    let grounds = Grounds {
        doubts: &doubts,
        held_out: held_out.as_ref(),
        more_rows: &more_rows,
        outliers: (outliers.len(), case.rows.len()),
        unit,
        unsized_mm: span_1m_sd_mm.filter(|_| case.known.is_none()),
    };
    let verdict = Verdict::of(&grounds);
    let shown = case.in_gauge(&fit);
    let [intrinsics, distortion] = case.lenses(&shown);
    let report = Report {
        scenario: scenario.name.clone(),
        title: scenario.title.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        chain: case.described.map(|described| Chain {
            urdf: described.file.clone(),
            base: described.chain.base.clone(),
            tip: described.chain.tip().to_owned(),
            tips: described.chain.tips().skip(1).map(str::to_owned).collect(),
        }),
        rows: case.rows.len(),
        training_rows: training.len(),
        held_out_by: case.held_out_by(&splits),
        doubts: (doubts.iter().map(ToString::to_string))
            .chain(coverage.as_ref().and_then(Coverage::warning))
            .chain(case.seen_from_behind(&fit))
            .chain(case.beyond_prior(&fit))
            .chain(trials.iter().find(|trial| trial.is_beyond).and_then(Trial::warning))
            .collect(),
        parameters: case.determined(&fit),
        verdict,
        coverage,
        widened: widening,
        unit,
        training: comparison,
        held_out,
        sockets: if has_folds { Vec::new() } else { case.distances(&fit, &first.held_out) },
        span_1m_sd_mm,
        extras: trials.clone(),
        compliance: case.compliance(&extended),
        outliers,
        noise,
        reading_sigmas: fit.reading_sigmas.clone(),
        base: case.base(&shown),
        targets: case.targets(&shown)?,
        cameras: case.cameras(&shown)?,
        joints: case.joints(&shown),
        intrinsics,
        distortion,
        correlations: case.correlations(&shown),
        more_rows,
        residuals: case.readings(&fit, &splits, &judged, selection.as_ref()),
        selection,
        active,
        learning,
    };
    let extras = trials.iter().find(|trial| trial.kept).map(|trial| trial.extras.clone()).unwrap_or_default();
    let counted = judged.into_iter().flat_map(|judged| judged.after);
    let held_out = counted.filter(|residual| !strays.contains(&(residual.row, residual.sensor))).collect();
    Ok(Calibration {
        report,
        nominal,
        fit,
        extras,
        extended,
        folds: if has_folds { folds } else { Vec::new() },
        held_out,
    })
}

impl Case<'_> {
    /// Judges a split. `widening` is the factor by which the stated interval of readings is wider than noise and
    /// uncertainty make it.
    fn judge(
        &self,
        split: &Split,
        (nominal, fit, extended): (&Fit, &Fit, &Fit),
        widening: f64,
    ) -> Result<Judged, CalibrationError> {
        let judged = |fit: &Fit| self.residuals(fit, &split.held_out);
        let tried = TRIED.iter().map(|extras| {
            let fit = self.fit(&self.extended(extras, fit.state()), &split.training, Some(fit.state()))?;
            Ok(judged(&fit))
        });
        let tried = tried.collect::<Result<_, CalibrationError>>()?;
        let reaches = self.reaches(fit, &split.held_out);
        let covered = reaches.into_iter().map(|(row, reach)| (row, reach <= widening)).collect();
        Ok(Judged { before: judged(nominal), after: judged(fit), extended: judged(extended), tried, covered, widening })
    }

    fn folds(
        &self,
        splits: &[Split],
        fits: &[Fit],
        judged: &[Judged],
        figures: &dyn Fn(&mut dyn Iterator<Item = &Residual>) -> Figures,
    ) -> Result<Vec<Fold>, CalibrationError> {
        let of = |(fold, ((split, fit), judged)): (usize, ((&Split, &Fit), &Judged))| {
            let shown = self.in_gauge(fit);
            Ok(Fold {
                fold,
                rows: split.held_out.iter().map(|row| row + 1).collect(),
                before: figures(&mut judged.before.iter()),
                after: figures(&mut judged.after.iter()),
                full_model: figures(&mut judged.extended.iter()),
                base: self.base(&shown),
                targets: self.targets(&shown)?,
            })
        };
        splits.iter().zip(fits).zip(judged).enumerate().map(of).collect()
    }

    fn choice(
        &self,
        training: &[usize],
        asked: &[usize],
        count: usize,
        progress: &dyn Progress,
    ) -> Result<Choice, CalibrationError> {
        progress.stage("the rows that would be chosen of all", count as u64);
        let (rows, _) = self.choose(training, asked, count, progress)?;
        let criterion = match self.scenario.selection.planning.optimality {
            Optimality::A => "A: the mean squared error of the parameters",
            Optimality::D => "D: the volume of what is not known of the parameters",
            Optimality::E => "E: the error of the parameters that are known worst",
            Optimality::I if self.meets_itself() => {
                "I: the mean squared scatter of predictions in the sockets that are asked about"
            }
            Optimality::I => "I: the mean squared error of predictions over the training rows",
        };
        Ok(Choice {
            criterion: criterion.to_owned(),
            start: "no row: the prior around the description".to_owned(),
            rows: rows.into_iter().map(|row| row + 1).collect(),
        })
    }

    fn held_out_by(&self, splits: &[Split]) -> String {
        let held_out = splits.iter().map(|split| split.held_out.len()).sum::<usize>();
        match splits.len() {
            folds @ 2.. => {
                let held_out = format!("f, f + {folds}, …, counted from 0");
                let has_repeats = self.postures.iter().enumerate().any(|(row, posture)| row != *posture);
                let of = match has_repeats {
                    true => format!("postures {held_out}, each with all its rows"),
                    false => format!("rows {held_out}"),
                };
                format!("every row once, in {folds} folds: fold f holds out {of}")
            }
            _ if held_out == 0 => "no row, so how good the model is on new data is not known".to_owned(),
            _ => format!("{held_out} of {} rows, as the file says", self.rows.len()),
        }
    }

    /// The rows that are likelier outliers than not in the fit that learned from them, and `others`.
    fn outliers(&self, fit: &Fit, others: BTreeSet<usize>) -> Vec<Outlier> {
        let told = |(row, probability): (usize, f64)| {
            let Line { file, number } = &self.rows[row].line;
            Outlier { row: row + 1, file: file.as_deref().map(str::to_owned), line: *number, probability }
        };
        let others = others.into_iter().map(|row| (row, 1.0));
        let mut outliers: Vec<Outlier> = fit.suspected().into_iter().chain(others).map(told).collect();
        outliers.sort_by_key(|outlier| outlier.row);
        outliers
    }

    /// The readings that are likelier outliers than not in the fit that learned from them, and far beyond most of their
    /// sensor's.
    pub(super) fn strays(&self, fit: &Fit) -> BTreeSet<(usize, Sensed)> {
        let outliers: BTreeSet<usize> = fit.suspected().into_iter().map(|(row, _)| row).collect();
        if outliers.is_empty() {
            return BTreeSet::new();
        }
        let residuals = self.residuals(fit, &fit.rows);
        let mut strays = gross(STRAY, &residuals.iter().collect::<Vec<_>>());
        strays.retain(|(row, _)| outliers.contains(row));
        strays
    }

    /// Every reading as predicted by the model that had not learned from its row, if there is one, otherwise by the
    /// calibrated one.
    fn readings(&self, fit: &Fit, splits: &[Split], judged: &[Judged], choice: Option<&Choice>) -> Vec<Reading> {
        let probabilities: std::collections::HashMap<usize, f64> = fit.outliers().into_iter().collect();
        let has_folds = splits.len() > 1;
        let held_out = judged.iter().enumerate().flat_map(|(fold, judged)| {
            judged.after.iter().map(move |residual| (residual.clone(), true, has_folds.then_some(fold)))
        });
        let trained = self.residuals(fit, if has_folds { &[] } else { &fit.rows });
        let mut all: Vec<_> = held_out.chain(trained.into_iter().map(|residual| (residual, false, None))).collect();
        all.sort_by_key(|(residual, ..)| (residual.row, residual.sensor));
        let reading = |(residual, held_out, fold): (Residual, bool, Option<usize>)| Reading {
            row: residual.row + 1,
            file: self.rows[residual.row].line.file.as_deref().map(str::to_owned),
            line: self.rows[residual.row].line.number,
            sensor: self.sensor(residual.sensor),
            held_out,
            fold,
            chosen: choice.and_then(|choice| Some(choice.rows.iter().position(|row| *row == residual.row + 1)? + 1)),
            residual_mm: residual.norms.length_m.map(|metres| metres * 1e3),
            residual_deg: residual.norms.angle_rad.map(f64::to_degrees),
            residual_px: residual.norms.pixels,
            outlier_probability: probabilities.get(&residual.row).copied(),
            predicted: residual.predicted,
            measured: residual.measured,
        };
        all.into_iter().map(reading).collect()
    }
}

/// The rows without a stray reading.
pub(super) fn without(rows: &[usize], strays: &BTreeSet<(usize, Sensed)>) -> Vec<usize> {
    let strays: BTreeSet<usize> = strays.iter().map(|(row, _)| *row).collect();
    rows.iter().copied().filter(|row| !strays.contains(row)).collect()
}

/// The multiple of its sensor's median residual beyond which an outlier is ignored in judging a model. A nearer one may be an error
/// of the model, and counts.
const STRAY: f64 = 10.0;
/// The multiple of the median that is no model error, for readings that no fit knows.
const GROSS: f64 = 50.0;

/// The readings whose residual is more than `times` the median of their sensor: as from other units, or from a mark for an unseen target.
/// A bad model that is off by the same everywhere has none of them.
fn gross(times: f64, residuals: &[&Residual]) -> BTreeSet<(usize, Sensed)> {
    let mut by_sensor: BTreeMap<Sensed, Vec<&Residual>> = BTreeMap::new();
    residuals.iter().for_each(|it| by_sensor.entry(it.sensor).or_default().push(it));
    let mut found = BTreeSet::new();
    for (sensor, of) in by_sensor {
        for unit in [Unit::Millimetres, Unit::Degrees, Unit::Pixels] {
            let errors: Vec<(f64, usize)> = of.iter().filter_map(|it| Some((unit.of(&it.norms)?, it.row))).collect();
            let median = middle(errors.iter().map(|it| it.0).collect());
            let Some(median) = median.filter(|median| *median > 0.0) else { continue };
            found.extend(errors.into_iter().filter(|(error, _)| *error > times * median).map(|(_, row)| (row, sensor)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use body_schema_scenario::{Scenario, builtin};

    fn tiago() -> Scenario {
        builtin("tiago-mocap").expect("built in")
    }

    /// A real TIAGo: axes that are learned predict rows that were held out better than the description does.
    #[test]
    fn held_out_rows_are_predicted_better_than_by_the_description() {
        let scenario = tiago();
        let case = Case::new(&scenario).expect("measured");
        let options = Options { folds: Some(5), ..Options::default() };
        let Calibration { report, folds, .. } = calibrate(&case, &options, &Silent).expect("calibrated");
        let held_out = report.held_out.expect("folds");
        let mean = |figures: &Figures| figures.mean_mm.expect("lengths");
        assert!((2.9..3.5).contains(&mean(&held_out.before)), "{held_out:?}");
        assert!(mean(&held_out.after) < 2.2, "{held_out:?}");
        assert!(mean(&report.training.after) < mean(&report.training.before));
        assert_eq!((folds.len(), held_out.folds.len(), held_out.after.readings), (5, 5, 96));
        let rows: Vec<usize> = report.residuals.iter().map(|reading| reading.row).collect();
        assert_eq!(rows, (1..=96).collect::<Vec<_>>());
        // Means of folds are the mean of all.
        let sum: f64 = held_out.folds.iter().map(|fold| mean(&fold.after) * fold.after.readings as f64).sum();
        assert!((sum / 96.0 - mean(&held_out.after)).abs() < 1e-9);
    }

    /// What rows that are held out say changes nothing that is learned.
    #[test]
    fn held_out_rows_decide_nothing() {
        let scenario = tiago();
        let mut case = Case::new(&scenario).expect("measured");
        let split = case.splits(None).expect("as the file says").remove(0);
        let found = calibrate(&case, &Options::default(), &Silent).expect("calibrated");
        for row in &split.held_out {
            case.rows[*row].observation.readings[0].as_mut().expect("seen")[0] += 0.1;
        }
        let spoilt = calibrate(&case, &Options::default(), &Silent).expect("calibrated");
        assert_eq!(found.fit.state(), spoilt.fit.state());
        assert_eq!(found.extended.state(), spoilt.extended.state());
        assert_ne!(found.report.held_out, spoilt.report.held_out);
    }

    /// Of rows that nothing learned from what is gross is no error of the model, but a model that is off everywhere is.
    #[test]
    fn what_is_gross_is_told_from_what_is_bad() {
        let residual = |row: usize, mm: f64| Residual {
            row,
            sensor: Sensed::Channel(0),
            predicted: vec![],
            measured: vec![],
            norms: body_schema_engine::sensing::ResidualNorms { length_m: Some(mm / 1e3), ..Default::default() },
        };
        let all: Vec<Residual> =
            [3.0, 1.0, 40.0, 9e6, 2.0].into_iter().enumerate().map(|(row, mm)| residual(row, mm)).collect();
        assert_eq!(gross(GROSS, &all.iter().collect::<Vec<_>>()), BTreeSet::from([(3, Sensed::Channel(0))]));
        let bad: Vec<Residual> = (0..9).map(|row| residual(row, 400.0 + 50.0 * row as f64)).collect();
        assert_eq!(gross(STRAY, &bad.iter().collect::<Vec<_>>()), BTreeSet::new());
    }

    #[test]
    fn what_cannot_be_asked_is_refused() {
        let scenario = tiago();
        let case = Case::new(&scenario).expect("measured");
        let refused = |folds, active| calibrate(&case, &Options { folds, active }, &Silent).expect_err("refused");
        assert_eq!(refused(Some(1), None), CalibrationError::Folds { folds: 1, rows: 96 });
        assert_eq!(refused(Some(97), None), CalibrationError::Folds { folds: 97, rows: 96 });
        assert_eq!(refused(None, Some(38)), CalibrationError::Active { asked: 38, rows: 37 });
        let simulated = builtin("arm-6dof").expect("built in");
        assert!(matches!(Case::new(&simulated), Err(CalibrationError::Simulated { .. })));
    }
}
