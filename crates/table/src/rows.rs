//! The rows of a table, one after the other.

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
    io::Read,
};

use super::{
    Column, Guard, MOST_BYTES, Reading, TableError, Titles,
    absent::is_absent,
    lines::Lines,
    titles::{JOINT, POINT, READING, number},
    writer::unguarded,
};
use body_schema_engine::sensing::Observation;

/// The most rows that are read of a table.
pub const MOST_ROWS: usize = 1_000_000;

/// A table whose titles have been read.
#[derive(Debug)]
pub struct Table<R> {
    reader: csv::Reader<Lines<Guard<R>>>,
    titles: Titles,
}

/// The columns that are read from every row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// The joints' columns.
    pub joints: Vec<Column>,
    /// The readings' columns by channel, in the order of a [`MeasurementModel`](body_schema_engine::sensing::MeasurementModel).
    pub readings: Vec<Reading>,
    /// The indices of columns of text, such as `place` and `socket`.
    pub labels: Vec<usize>,
}

/// A row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The line of the file on which it begins, counted from 1.
    pub line: usize,
    /// The joints' positions, rad or m.
    pub positions: Vec<f64>,
    /// What was measured.
    pub observation: Observation,
    /// The cells of the columns of text.
    pub labels: Vec<String>,
}

impl<R: Read> Table<R> {
    /// Reads the titles. White space around cells does not matter.
    ///
    /// # Errors
    ///
    /// [`TableError`] if there are no titles, or if two are equal.
    pub fn open(source: R) -> Result<Self, TableError> {
        // Lengths of rows are checked here, where their lines are known.
        let mut builder = csv::ReaderBuilder::new();
        let mut reader =
            builder.trim(csv::Trim::All).flexible(true).from_reader(Lines::new(Guard::new(source, MOST_BYTES)));
        let titles = Titles::new(reader.headers().map_err(|error| TableError::unreadable(&error, 1))?)?;
        Ok(Self { reader, titles })
    }

    /// The titles.
    pub fn titles(&self) -> &Titles {
        &self.titles
    }

    /// The rows. After the first error there are no more.
    pub fn rows(self, columns: Columns) -> Rows<R> {
        let traces = vec![Trace::default(); self.titles.all().len()];
        let Self { reader, titles } = self;
        Rows { reader, titles, columns, record: csv::StringRecord::new(), traces, rows: 0, failed: false }
    }
}

/// An iterator over rows; see [`Table::rows`].
#[derive(Debug)]
pub struct Rows<R> {
    reader: csv::Reader<Lines<Guard<R>>>,
    titles: Titles,
    columns: Columns,
    record: csv::StringRecord,
    /// One trace per column.
    traces: Vec<Trace>,
    rows: usize,
    failed: bool,
}

/// The trace of a column that has been read.
#[derive(Clone, Debug, Default)]
struct Trace {
    /// A hash of all its cells so far.
    hash: u64,
    /// A hash of its last cell.
    last: u64,
    rows: u64,
    varies: bool,
}

impl Trace {
    fn add(&mut self, cell: &str) {
        let mut hasher = DefaultHasher::new();
        cell.hash(&mut hasher);
        let cell = hasher.finish();
        self.varies |= self.rows > 0 && cell != self.last;
        (self.last, self.rows) = (cell, self.rows + 1);
        (self.hash, cell).hash(&mut hasher);
        self.hash = hasher.finish();
    }
}

impl<R: Read> Rows<R> {
    /// Pairs of columns whose cells were equal in every row so far, and not constant: the later column first, then the
    /// one that it repeats.
    pub fn repeated_columns(&self) -> Vec<(String, String)> {
        let mut first: HashMap<u64, usize> = HashMap::new();
        let mut repeated = Vec::new();
        for (index, trace) in self.traces.iter().enumerate().filter(|(_, trace)| trace.varies) {
            match first.get(&trace.hash) {
                Some(&other) => repeated.push((self.titles.all()[index].clone(), self.titles.all()[other].clone())),
                None => drop(first.insert(trace.hash, index)),
            }
        }
        repeated
    }

    /// The line on which the last record begins. The CSV reader counts the empty lines before it as part of it.
    fn line(&self) -> usize {
        let within: usize = self.record.iter().map(|cell| cell.matches('\n').count()).sum();
        (self.reader.position().line() as usize).saturating_sub(1 + within)
    }

    fn row(&self) -> Result<Row, TableError> {
        let (line, wanted, found) = (self.line(), self.titles.all().len(), self.record.len());
        if found != wanted {
            let what = format!("line {line} has {found} values, line 1 names {wanted} columns");
            let hint = "give it one value per column, with a decimal point in numbers: 1.5, not 1,5";
            return Err(TableError::new(what, hint));
        }
        let cell = |column: &Column| self.record.get(column.index).unwrap_or_default();
        let value = |column: &Column, absent: &str| {
            let place = || format!("line {line}, column `{}`", self.titles.all()[column.index]);
            Ok(number(cell(column), absent, &place)? * column.factor)
        };
        let whole = |reading: &Reading| -> Result<Option<Vec<f64>>, TableError> {
            let numbers = reading.columns.iter().map(|column| value(column, READING)).collect::<Result<Vec<_>, _>>()?;
            if let Some((column, angle)) = reading.beyond_turns(&numbers) {
                let title = &self.titles.all()[column.index];
                let what = format!("line {line}, column `{title}`: {angle} rad is more than two turns");
                let hint = "end the titles of angles in degrees with `_deg`, and write angles within a turn";
                return Err(TableError::new(what, hint));
            }
            reading.of(numbers).map(Some).ok_or_else(|| {
                let title = reading.columns.get(3).map_or("", |column| &self.titles.all()[column.index]);
                let what = format!("line {line}, column `{title}`: the quaternion's length is not 1");
                TableError::new(what, "write x, y, z and w of a unit quaternion")
            })
        };
        let point = |point: &[Column]| -> Result<[f64; 2], TableError> {
            match point {
                [u, v] if !(is_absent(cell(u)) && is_absent(cell(v))) => Ok([value(u, POINT)?, value(v, POINT)?]),
                _ => Ok([f64::NAN; 2]),
            }
        };
        let reading = |reading: &Reading| -> Result<Option<Vec<f64>>, TableError> {
            if reading.columns.iter().all(|column| is_absent(cell(column))) {
                return Ok(None);
            }
            let Some(least) = reading.least_points() else { return whole(reading) };
            let points = reading.columns.chunks(2).map(point).collect::<Result<Vec<_>, _>>()?;
            let found = points.iter().filter(|[u, _]| !u.is_nan()).count();
            Ok((found >= least).then(|| points.concat()))
        };
        let Columns { joints, readings, labels } = &self.columns;
        Ok(Row {
            line,
            positions: joints.iter().map(|column| value(column, JOINT)).collect::<Result<_, TableError>>()?,
            observation: Observation { readings: readings.iter().map(reading).collect::<Result<_, _>>()? },
            labels: labels
                .iter()
                .map(|index| unguarded(self.record.get(*index).unwrap_or_default()).to_owned())
                .collect(),
        })
    }
}

impl<R: Read> Iterator for Rows<R> {
    type Item = Result<Row, TableError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let row = match self.reader.read_record(&mut self.record) {
            Ok(false) => return None,
            Ok(true) if self.rows == MOST_ROWS => {
                let what = format!("has more than {MOST_ROWS} rows, the most that are read");
                Err(TableError::new(what, "take fewer, as every tenth: rows that are alike teach little"))
            }
            Ok(true) => {
                self.rows += 1;
                self.record.iter().zip(&mut self.traces).for_each(|(cell, trace)| trace.add(cell));
                self.row()
            }
            Err(error) => Err(TableError::unreadable(&error, self.line())),
        };
        self.failed = row.is_err();
        Some(row)
    }
}
