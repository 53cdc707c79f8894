//! The titles of a table, and the columns that are found by them.

use std::collections::HashMap;

use super::{TableError, absent::is_absent, error::AS_TEXT};
use crate::{
    magnitude::{is_usable, what_is_wrong},
    similar::similar,
};

/// What a column's numbers measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Radians inside.
    Angle,
    /// Metres inside.
    Length,
    /// Pixels.
    Pixels,
    /// Without a unit.
    Number,
}

impl Quantity {
    /// Ends of titles, and what the numbers below them are multiplied by.
    fn units(self) -> &'static [(&'static str, f64)] {
        const DEGREE: f64 = std::f64::consts::PI / 180.0;
        match self {
            Self::Angle => &[("", 1.0), ("_rad", 1.0), ("_deg", DEGREE)],
            Self::Length => &[("", 1.0), ("_m", 1.0), ("_mm", 1e-3)],
            Self::Pixels => &[("", 1.0), ("_px", 1.0)],
            Self::Number => &[("", 1.0)],
        }
    }
}

/// A column of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Counted from 0.
    pub index: usize,
    /// What its numbers are multiplied by to be metres or radians.
    pub factor: f64,
}

/// The line of titles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Titles {
    titles: Vec<String>,
}

impl Titles {
    pub(super) fn new(record: &csv::StringRecord) -> Result<Self, TableError> {
        let titles: Vec<String> = record.iter().map(str::to_owned).collect();
        let mut seen = HashMap::new();
        // Spreadsheets leave columns without a title at the end.
        for (index, title) in titles.iter().enumerate().filter(|(_, title)| !title.is_empty()) {
            if let Some(first) = seen.insert(title.as_str(), index) {
                let what = format!("line 1: columns {} and {} are both called `{title}`", first + 1, index + 1);
                return Err(TableError::new(what, "give each column a title of its own"));
            }
        }
        if titles.iter().all(String::is_empty) {
            return Err(TableError::new("is empty", "begin it with a line of titles, one per column"));
        }
        if titles.len() > 1 && titles.iter().all(|title| title.parse::<f64>().is_ok()) {
            let mend = "begin the table with a line of titles: the names of the joints, and of what is measured";
            return Err(TableError::new("line 1 holds numbers, no titles", mend));
        }
        Ok(Self { titles })
    }

    /// All titles, in order.
    pub fn all(&self) -> &[String] {
        &self.titles
    }

    /// The column of `name`, alone or with the unit at its end.
    ///
    /// # Errors
    ///
    /// [`TableError`] where there is none, or more than one.
    pub fn find(&self, name: &str, quantity: Quantity) -> Result<Column, TableError> {
        let units = quantity.units().iter();
        let mut found = units.filter_map(|(unit, factor)| {
            let index = self.titles.iter().position(|title| title.strip_prefix(name) == Some(unit))?;
            Some(Column { index, factor: *factor })
        });
        match (found.next(), found.next()) {
            (Some(column), None) => Ok(column),
            (Some(one), Some(other)) => {
                let what =
                    format!("line 1: `{}` and `{}` say the same", self.titles[one.index], self.titles[other.index]);
                Err(TableError::new(what, "leave one of the two columns"))
            }
            (None, _) => Err(self.unknown(name)),
        }
    }

    /// The column with exactly this title, whose end says the unit.
    ///
    /// # Errors
    ///
    /// [`TableError`] where there is none.
    pub fn titled(&self, title: &str, quantity: Quantity) -> Result<Column, TableError> {
        let factor = quantity.units().iter().rev().find(|(unit, _)| title.ends_with(unit)).map_or(1.0, |unit| unit.1);
        Ok(Column { index: self.label(title)?, factor })
    }

    /// The index of the column with exactly this title, of any text.
    ///
    /// # Errors
    ///
    /// [`TableError`] where there is none.
    pub fn label(&self, title: &str) -> Result<usize, TableError> {
        self.titles.iter().position(|given| given == title).ok_or_else(|| self.unknown(title))
    }

    /// What is wrong where columns are separated by something else than commas.
    pub(crate) fn separated(&self) -> Option<TableError> {
        let filled: Vec<&String> = self.titles.iter().filter(|title| !title.is_empty()).collect();
        // Words may well stand in one title among several.
        let is_alone =
            |title: &str| filled.len() == 1 && self.titles.len() == 1 && title.split_whitespace().count() > 2;
        let plural = match () {
            () if filled.iter().any(|title| title.contains(';')) => "semicolons",
            () if filled.iter().any(|title| title.contains('\t')) => "tabs",
            () if filled.len() == 1 && filled.iter().any(|title| title.contains('|')) => "bars",
            () if filled.iter().any(|title| is_alone(title)) => "blanks",
            () => return None,
        };
        let what = format!("line 1: the columns are separated by {plural}");
        Some(TableError::new(what, "write commas between columns, and a decimal point in numbers: 1.5, not 1,5"))
    }

    /// These titles without some, so that what is found is another column.
    pub(crate) fn besides(&self, taken: &[&String]) -> Self {
        let kept = |title: &String| if taken.contains(&title) { String::new() } else { title.clone() };
        Self { titles: self.titles.iter().map(kept).collect() }
    }

    fn unknown(&self, name: &str) -> TableError {
        let line = self.titles.join(", ");
        if let Some(error) = self.separated() {
            return error;
        }
        let mend = match similar(name, self.titles.iter().map(String::as_str)) {
            Some(known) => format!("did you mean `{known}`?"),
            None => "correct the name of the column, here or in the scenario".to_owned(),
        };
        TableError::new(format!("has no column `{name}`; its columns are {line}"), mend)
    }
}

/// What to do about a joint's cell that holds nothing.
pub(super) const JOINT: &str = "write where the joint was, as 0.03, or remove the line";
/// What to do where some cells of a reading hold nothing and others do not.
pub(super) const READING: &str =
    "write a number such as 0.03, or leave all cells of this reading empty, or remove the line";

/// A finite number; `absent` says what to do where there is none. A comma in it is refused: it may separate decimals or thousands.
pub(super) fn number(text: &str, absent: &str, place: &dyn Fn() -> String) -> Result<f64, TableError> {
    match text.parse::<f64>() {
        Ok(value) if is_usable(value) => Ok(value),
        _ if text.is_empty() => Err(TableError::new(format!("{} is empty", place()), absent)),
        _ if text.len() > 1000 => Err(TableError::new(format!("{} holds no number", place()), AS_TEXT)),
        _ => {
            let with_point = text.replacen(',', ".", 1);
            let mend = if with_point != text && with_point.parse::<f64>().is_ok() {
                format!("write a decimal point: {with_point}")
            } else if is_absent(text) {
                absent.to_owned()
            } else {
                "write a number such as 0.03, or remove the line".to_owned()
            };
            Err(TableError::new(format!("{}: `{text}` {}", place(), what_is_wrong(text)), mend))
        }
    }
}
