//! The held-out rows of a table.

use std::ops::Range;

use toml::Spanned;

use super::{Check, raw};
use crate::{HeldOut, HeldOutRule, Measurements};
use body_schema_table::TableError;

/// The number of folds where a scenario does not state what is held out.
const FOLDS: usize = 5;
/// The least number of rows: base and marker take four.
const LEAST: usize = 4;

impl Check<'_> {
    /// The rule for holding out of `rows`; the rows of a second file, read by `read`, are added to them. `None` has left a
    /// problem behind.
    pub(super) fn held_out(
        &mut self,
        raw: &raw::Scenario,
        rows: &mut Measurements,
        read: &dyn Fn(&str) -> Result<Measurements, TableError>,
    ) -> Option<HeldOut> {
        let count = rows.rows();
        let found = HeldOut::new(HeldOutRule::Nothing, &rows.configurations);
        let old = raw.measurements.as_ref().and_then(|given| given.get_ref().held_out.as_ref());
        let Some(spanned) = &raw.held_out else {
            let rule = match old {
                Some(held_out) => self.drawn("measurements.held_out", held_out, count)?,
                None => match found.count_postures() {
                    0 | 1 => HeldOutRule::Nothing,
                    postures => HeldOutRule::Folds(FOLDS.min(postures)),
                },
            };
            return self.whole(HeldOut { rule, ..found }, old.map_or(0..0, Spanned::span));
        };
        if let Some(old) = old {
            let hint = "remove it; [held_out] says what is held out";
            self.problem(old.span(), "measurements.held_out", "it is said twice", hint);
            return None;
        }
        let given = spanned.get_ref();
        let rule = match (&given.folds, &given.count, &given.by, &given.rows, &given.file) {
            (Some(folds), None, None, None, None) => self.fold(folds, count)?,
            (None, Some(held_out), None, None, None) => self.drawn("held_out.count", held_out, count)?,
            (None, None, Some(by), None, None) => self.by_label(by, given.train.as_ref(), rows)?,
            (None, None, None, Some(held_out), None) => self.told(held_out, &rows.numbers)?,
            (None, None, None, None, Some(file)) => self.second_file(file, raw, rows, read)?,
            _ => {
                let hint = "write one of `folds = 5`, `by = \"place\"` with `train = […]`, `rows = […]`, `file = \"…\"` and \
                            `count = 7`; `rows = []` holds nothing out";
                self.problem(spanned.span(), "held_out", "it says nothing, or says it in two ways", hint);
                return None;
            }
        };
        if let (Some(train), None) = (&given.train, &given.by) {
            let hint = "add `by = \"…\"`, the column that has these values";
            self.problem(train.span(), "held_out.train", "it says nothing without a column", hint);
        }
        self.whole(HeldOut::new(rule, &rows.configurations), spanned.span())
    }

    /// Checks that held-out rows leave none of their postures behind.
    fn whole(&mut self, held_out: HeldOut, span: Range<usize>) -> Option<HeldOut> {
        let postures = held_out.count_postures();
        let mut sizes = vec![0; postures];
        held_out.postures.iter().for_each(|posture| sizes[*posture] += 1);
        let least = sizes.iter().copied().min().unwrap_or(0);
        let stay = "rows of one posture stay together";
        let (what, hint) = match held_out.rule {
            HeldOutRule::Folds(_) | HeldOutRule::Count(_) if postures < 2 => (
                format!("all {} rows are one posture: {stay}", held_out.rows),
                "measure more postures, or write `rows = []`, which holds nothing out".to_owned(),
            ),
            HeldOutRule::Count(count) if count < least => {
                (format!("each posture has {least} rows or more: {stay}"), format!("hold out {least} rows or more"))
            }
            _ => return Some(held_out),
        };
        self.problem(span, "held_out", what, hint);
        None
    }

    fn drawn(&mut self, key: &str, held_out: &Spanned<usize>, count: usize) -> Option<HeldOutRule> {
        let wanted = *held_out.get_ref();
        if wanted == 0 || wanted + LEAST > count {
            let what = format!("{wanted} of {count} rows cannot be held out");
            let hint = format!("write a number from 1 to {}", count.saturating_sub(LEAST));
            self.problem(held_out.span(), key, what, hint);
            return None;
        }
        Some(HeldOutRule::Count(wanted))
    }

    fn fold(&mut self, folds: &Spanned<usize>, count: usize) -> Option<HeldOutRule> {
        if !(2..=count).contains(folds.get_ref()) {
            let what = format!("{count} rows cannot be held out in {} parts", folds.get_ref());
            let hint = match count {
                0..=2 => "measure more rows, or write `rows = []` in its place to hold out none".to_owned(),
                _ => format!("write a number from 2 to {count}"),
            };
            self.problem(folds.span(), "held_out.folds", what, hint);
            return None;
        }
        Some(HeldOutRule::Folds(*folds.get_ref()))
    }

    fn by_label(
        &mut self,
        by: &Spanned<String>,
        train: Option<&Spanned<Vec<String>>>,
        rows: &Measurements,
    ) -> Option<HeldOutRule> {
        let Some(train) = train else {
            let hint = "add `train = [\"…\"]`, the values of that column whose rows are learned from";
            self.problem(by.span(), "held_out.train", "missing", hint);
            return None;
        };
        let labels = rows.labels.get(by.get_ref()).map(Vec::as_slice).unwrap_or_default();
        if let Some(unknown) = train.get_ref().iter().find(|value| !labels.contains(value)) {
            let mut known: Vec<&str> = labels.iter().map(String::as_str).collect();
            known.sort_unstable();
            known.dedup();
            let what = format!("column `{}` has no `{unknown}`", by.get_ref());
            self.problem(train.span(), "held_out.train", what, format!("write some of {}", known.join(", ")));
            return None;
        }
        let held_out = (0..labels.len()).filter(|row| !train.get_ref().contains(&labels[*row])).collect();
        if train.get_ref().is_empty() {
            self.problem(train.span(), "held_out.train", "nothing is left to learn from", "name a value to train on");
            return None;
        }
        Some(HeldOutRule::Rows(held_out))
    }

    /// Rows as they are numbered in the file; those without a measurement are counted, and hold nothing out.
    fn told(&mut self, held_out: &Spanned<Vec<usize>>, numbers: &[usize]) -> Option<HeldOutRule> {
        let told = held_out.get_ref();
        let count = numbers.last().map_or(0, |last| last + 1);
        let rows: Vec<usize> = (0..numbers.len()).filter(|row| told.contains(&numbers[*row])).collect();
        if told.iter().any(|row| *row >= count) || rows.len() == numbers.len() {
            let what = format!("of {count} rows these cannot be held out");
            let hint = format!("write some of 0 to {}, row 0 being the line after the titles", count.saturating_sub(1));
            self.problem(held_out.span(), "held_out.rows", what, hint);
            return None;
        }
        Some(if rows.is_empty() { HeldOutRule::Nothing } else { HeldOutRule::Rows(rows) })
    }

    fn second_file(
        &mut self,
        file: &Spanned<String>,
        raw: &raw::Scenario,
        rows: &mut Measurements,
        read: &dyn Fn(&str) -> Result<Measurements, TableError>,
    ) -> Option<HeldOutRule> {
        let name = file.get_ref();
        let text = self.opened(name).map_err(|error| {
            let hint = "name a file beside the scenario that can be read, with the columns of the first";
            self.problem(file.span(), "held_out.file", format!("{name} {error}"), hint);
        });
        let more = read(&text.ok()?).map_err(|TableError { what, hint }| {
            self.problem(file.span(), "held_out.file", format!("{name} {what}"), hint);
        });
        let (first, more) = (rows.rows(), more.ok()?);
        let trained = raw.measurements.as_ref().map_or("", |given| given.get_ref().file.get_ref().as_str());
        rows.append(more, [trained, name]);
        Some(HeldOutRule::Rows((first..rows.rows()).collect()))
    }
}
