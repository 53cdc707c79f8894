//! The titles of a table, and the search for columns by title.

use std::collections::HashMap;

use super::{
    Component, Quantity, TableError, Title,
    absent::is_absent,
    error::AS_TEXT,
    names::{NAME, split},
    writer::unguarded,
};
use body_schema_engine::{
    numeric_range::{is_usable, what_is_wrong},
    suggest::did_you_mean,
};

/// A column of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Its index, counted from 0.
    pub index: usize,
    /// The factor that turns its numbers into metres or radians.
    pub factor: f64,
}

/// The line of titles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Titles {
    titles: Vec<String>,
}

impl Titles {
    pub(super) fn new(record: &csv::StringRecord) -> Result<Self, TableError> {
        Self::listed(record.iter().map(|title| unguarded(title).to_owned()).collect())
    }

    /// Titles from a list.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there are none, or if two are equal.
    pub fn listed(titles: Vec<String>) -> Result<Self, TableError> {
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
            let hint = "begin the table with a line of titles: the names of the joints, and of what is measured";
            return Err(TableError::new("line 1 holds numbers, no titles", hint));
        }
        Ok(Self { titles })
    }

    /// All titles, in order.
    pub fn all(&self) -> &[String] {
        &self.titles
    }

    /// Whether a title is `name`, alone or with something at its end that may be a unit.
    pub fn names(&self, name: &str) -> bool {
        self.titles.iter().any(|title| title == name || split(title).0 == name)
    }

    /// The column of `name`, alone or with the unit at its end.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there is none or more than one, or if its unit is unknown.
    pub fn find(&self, name: &str, quantity: Quantity) -> Result<Column, TableError> {
        let is_named = |title: &&String| *title == name || split(title).0 == name;
        let named: Vec<&String> = self.titles.iter().filter(is_named).collect();
        // Beside a column of this very name another that ends with a unit of something else has a name of its own.
        let has_exact = named.iter().any(|title| *title == name);
        let says_it = |title: &&String| {
            let word = split(title).1;
            !has_exact || *title == name || word != NAME && quantity.factor(word).is_some()
        };
        let found: Vec<&String> = named.into_iter().filter(says_it).collect();
        match found.as_slice() {
            [one] if *one == name => Ok(Column { index: self.label(one)?, factor: 1.0 }),
            [one] => self.in_unit(one, quantity),
            [one, other, ..] => Err(TableError::new(
                format!("line 1: `{one}` and `{other}` say the same"),
                "leave one of the two columns",
            )),
            [] => Err(self.unknown(name)),
        }
    }

    /// The column of a component of `before`, with `number` behind the component.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there is none or more than one, or if its unit is unknown.
    pub(super) fn component(&self, before: &str, component: Component, number: &str) -> Result<Column, TableError> {
        let of = |title: &&String| {
            let is_it = |it: &Title<'_>| it.component == component && it.number == number && it.is_of(before);
            Title::parse(title).is_some_and(|it| is_it(&it))
        };
        let mut found: Vec<&String> = self.titles.iter().filter(of).collect();
        // Titles that differ in nothing but capitals: what is spelt as it is asked for.
        let written = Title { before, component, number, unit: "" }.to_string();
        let is_spelt = |title: &&&String| split(title).0 == written;
        if found.len() > 1 && found.iter().any(|title| is_spelt(&title)) {
            found.retain(|title| is_spelt(&title));
        }
        match found.as_slice() {
            [one] => self.in_unit(one, component.quantity()),
            [one, other, ..] => Err(TableError::new(
                format!("line 1: `{one}` and `{other}` say the same"),
                "leave one of the two columns, or list those that are meant as `columns` of the sensor",
            )),
            [] => Err(self.unknown(&written)),
        }
    }

    /// The column with exactly this title, which ends with the unit.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there is none, or if its unit is unknown.
    pub fn titled(&self, title: &str, quantity: Quantity) -> Result<Column, TableError> {
        if split(title).1 == NAME && quantity != Quantity::Length && Title::parse(title).is_none() {
            return Ok(Column { index: self.label(title)?, factor: 1.0 });
        }
        self.in_unit(title, quantity)
    }

    fn in_unit(&self, title: &str, quantity: Quantity) -> Result<Column, TableError> {
        let (index, word) = (self.label(title)?, split(title).1);
        let factor = quantity.factor(word).ok_or_else(|| {
            let what = format!("line 1, column `{title}`: `{word}` is no unit in which {} is read", quantity.called());
            TableError::new(what, format!("convert the numbers and title them so: {}", quantity.ends()))
        })?;
        Ok(Column { index, factor })
    }

    /// The column with exactly this title, or, if there is none, the one whose title differs in capitals alone.
    pub(super) fn titled_in_any_case(&self, title: &str, quantity: Quantity) -> Result<Column, TableError> {
        let mut alike = self.titles.iter().filter(|given| given.eq_ignore_ascii_case(title));
        match (self.titles.iter().any(|given| given == title), alike.next(), alike.next()) {
            (false, Some(only), None) => self.titled(only, quantity),
            _ => self.titled(title, quantity),
        }
    }

    /// The prefixes of the titles that end with x, alone or with a unit: targets whose positions may be there.
    pub fn prefixes(&self) -> Vec<&str> {
        let found = self.titles.iter().filter_map(|title| Title::parse(title));
        found.filter(|it| it.component == Component::X && it.number.is_empty()).map(|it| it.before).collect()
    }

    /// The index of the text column with exactly this title.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there is none.
    pub fn label(&self, title: &str) -> Result<usize, TableError> {
        self.titles.iter().position(|given| given == title).ok_or_else(|| self.unknown(title))
    }

    /// The error for columns that are separated by something other than commas.
    pub fn separated(&self) -> Option<TableError> {
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

    /// These titles without some, so that another column is found.
    pub fn besides(&self, taken: &[&String]) -> Self {
        let kept = |title: &String| if taken.contains(&title) { String::new() } else { title.clone() };
        Self { titles: self.titles.iter().map(kept).collect() }
    }

    fn unknown(&self, name: &str) -> TableError {
        let line = self.titles.join(", ");
        if let Some(error) = self.separated() {
            return error;
        }
        let hint = did_you_mean(name, self.titles.iter().map(String::as_str), || {
            "correct the name of the column, here or in the scenario".to_owned()
        });
        TableError::new(format!("has no column `{name}`; its columns are {line}"), hint)
    }
}

/// What to do about an empty cell of a joint.
pub(super) const JOINT: &str = "write where the joint was, as 0.03, or remove the line";
/// What to do if some cells of a reading are empty and others are not.
pub(super) const READING: &str =
    "write a number such as 0.03, or leave all cells of this reading empty, or remove the line";

/// What to do if one cell of a point is empty and the other is not.
pub(super) const POINT: &str = "write a number such as 0.03, or leave both cells of this point empty";

/// A finite number; `absent` says what to do where there is none. A number with a comma is refused: the comma may separate
/// decimals or thousands.
pub(super) fn number(text: &str, absent: &str, place: &dyn Fn() -> String) -> Result<f64, TableError> {
    match text.parse::<f64>() {
        Ok(value) if is_usable(value) => Ok(value),
        _ if text.is_empty() => Err(TableError::new(format!("{} is empty", place()), absent)),
        _ if text.len() > 1000 => Err(TableError::new(format!("{} holds no number", place()), AS_TEXT)),
        _ => {
            let with_point = text.replacen(',', ".", 1);
            let hint = if with_point != text && with_point.parse::<f64>().is_ok() {
                format!("write a decimal point: {with_point}")
            } else if is_absent(text) {
                absent.to_owned()
            } else {
                "write a number such as 0.03, or remove the line".to_owned()
            };
            Err(TableError::new(format!("{}: `{text}` {}", place(), what_is_wrong(text)), hint))
        }
    }
}
