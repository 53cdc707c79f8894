//! Rows that come after the calibration: read as the calibration file says, with their time and a covariate.

use std::collections::BTreeMap;

use body_schema_calibration::{CalibrationError, Case};
use body_schema_engine::sensing::Observation;
use body_schema_scenario::{Scenario, ScenarioError, WorldSpec};
use body_schema_table::Table;
use jiff::{Timestamp, civil};

use super::SightingsError;

/// Titles by which a column of times is known, in any case.
const TIMES: [&str; 6] = ["time", "timestamp", "date", "datetime", "time_s", "stamp"];
/// The most seconds since 1970 that a time has: the year 5138.
const MOST_S: f64 = 1e11;
/// The name under which later rows are handed to the reader of the calibration file.
const LATER: &str = "later rows";
/// Seconds of a day, and of a mean year.
const DAY_S: f64 = 86_400.0;
pub const YEAR_S: f64 = 365.25 * DAY_S;

/// A row after the calibration.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its line in the file.
    pub line: usize,
    /// Joint positions, rad or m.
    pub positions: Vec<f64>,
    /// What was seen.
    pub observation: Observation,
    /// Seconds since 1970, or since any other moment.
    pub time_s: Option<f64>,
    /// The covariate, if there is one.
    pub covariate: Option<f64>,
}

/// A line that was left out, and why.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LeftOut {
    /// The line in the file.
    pub line: usize,
    /// The reason.
    pub why: String,
}

/// The reader of later rows.
pub struct Reader<'a> {
    scenario: &'a Scenario,
    /// The calibration file's text, with the later rows as those that are held out.
    text: String,
    /// The rows of the table that is learned from.
    first: usize,
    /// The channels of a row.
    channels: usize,
    /// The columns asked for by name.
    pub(crate) time: Option<String>,
    pub(crate) covariate: Option<String>,
}

impl<'a> Reader<'a> {
    /// Of a calibration file, with the names of the columns of the time and of a covariate.
    ///
    /// # Errors
    ///
    /// [`SightingsError`] if it is a simulated robot's.
    pub fn new(case: &Case<'a>, time: Option<String>, covariate: Option<String>) -> Result<Self, SightingsError> {
        let scenario = case.scenario;
        let WorldSpec::Measured { measurements, .. } = &scenario.world else {
            return Err(CalibrationError::Simulated { scenario: scenario.name.clone() }.into());
        };
        let mut document = scenario.source.parse::<toml::Table>().unwrap_or_default();
        let table = document.get_mut("measurements").and_then(toml::Value::as_table_mut);
        let file = table.as_ref().and_then(|table| table.get("file")?.as_str()).unwrap_or_default().to_owned();
        table.map(|table| table.remove("held_out"));
        let held_out = toml::Table::from_iter([("file".to_owned(), LATER.into())]);
        document.insert("held_out".to_owned(), held_out.into());
        let is_first = |name: &std::sync::Arc<str>| **name == *file;
        let first = match measurements.files.is_empty() {
            true => measurements.rows(),
            false => measurements.files.iter().filter(|name| is_first(name)).count(),
        };
        let channels = case.measurement_model().sensors().len();
        Ok(Self { scenario, text: document.to_string(), first, channels, time, covariate })
    }

    /// The text of the table that was learned from.
    pub fn learned(&self) -> Option<&str> {
        let document = self.text.parse::<toml::Table>().ok()?;
        let file = document.get("measurements")?.get("file")?.as_str()?;
        self.scenario.data.iter().find(|(name, _)| name == file).map(|(_, text)| text.as_str())
    }

    /// The rows of a table, and the lines that are left out with the reason. `offset` is added to the numbers of its lines. Where no line
    /// can be read the error is returned, unless others with these titles `were_read` before.
    ///
    /// # Errors
    ///
    /// [`SightingsError`] if no line can be read.
    pub fn read(&self, text: &str, offset: usize, were_read: bool) -> Result<(Vec<Row>, Vec<LeftOut>), SightingsError> {
        let mut lines = text.lines();
        let (Some(titles), true) = (lines.next(), text.lines().skip(1).any(|line| !line.trim().is_empty())) else {
            // Titles alone: they are checked once there is a row.
            return Ok((Vec::new(), Vec::new()));
        };
        let all = match self.whole(text, offset) {
            Ok(found) => return Ok(found),
            Err(error) => error,
        };
        // One bad line does not take the others with it.
        let (mut rows, mut left_out) = (Vec::new(), Vec::new());
        for (index, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            match self.whole(&format!("{titles}\n{line}\n"), offset + index) {
                Ok((found, others)) => {
                    rows.extend(found);
                    left_out.extend(others);
                }
                Err(error) => left_out.push(LeftOut { line: index + 2 + offset, why: why(&error) }),
            }
        }
        if rows.is_empty() && !were_read { Err(all) } else { Ok((rows, left_out)) }
    }

    /// The rows of a table that can be read as a whole, with what stands beside the readings.
    fn whole(&self, text: &str, offset: usize) -> Result<(Vec<Row>, Vec<LeftOut>), SightingsError> {
        let found = self.rows(text)?;
        let asides: BTreeMap<usize, Aside> = self.asides(text)?.into_iter().map(|aside| (aside.line, aside)).collect();
        let (mut rows, mut left_out) = (Vec::new(), Vec::new());
        for line in asides.keys().filter(|line| found.iter().all(|row| row.line != **line)) {
            left_out.push(LeftOut { line: line + offset, why: "nothing was measured in it".to_owned() });
        }
        for row in found {
            let aside = asides.get(&row.line);
            let line = row.line + offset;
            match aside.and_then(Aside::seconds).transpose() {
                Ok(time_s) => rows.push(Row { line, time_s, covariate: aside.and_then(Aside::number), ..row }),
                Err(why) => left_out.push(LeftOut { line, why }),
            }
        }
        Ok((rows, left_out))
    }

    /// The rows without what stands beside them.
    fn rows(&self, text: &str) -> Result<Vec<Row>, SightingsError> {
        let open = |file: &str| if file == LATER { Ok(text.to_owned()) } else { self.scenario.data_file(file) };
        let scenario =
            Scenario::parse(&format!("{}.toml", self.scenario.name), &self.text, &open).map_err(|error| {
                match of_the_table(&error) {
                    Some(told) => SightingsError::Refused(told),
                    None => error.into(),
                }
            })?;
        let case = Case::new(&scenario)?;
        if case.measurement_model().sensors().len() != self.channels {
            return Err(SightingsError::Refused(
                "the calibration file holds sockets out, so that rows in them cannot be watched; write `[held_out] rows = []` there"
                    .to_owned(),
            ));
        }
        let row = |row: &body_schema_calibration::Row| Row {
            line: row.line.number,
            positions: row.positions.clone(),
            observation: row.observation.clone(),
            time_s: None,
            covariate: None,
        };
        Ok(case.rows.iter().skip(self.first).map(row).collect())
    }

    /// What stands beside the readings, line by line.
    fn asides(&self, text: &str) -> Result<Vec<Aside>, SightingsError> {
        let table = Table::open(text.as_bytes()).map_err(|error| SightingsError::Refused(error.to_string()))?;
        let titles = table.titles().clone();
        let asked = |name: &Option<String>, what: &str| -> Result<Option<usize>, SightingsError> {
            let Some(name) = name else { return Ok(None) };
            let known = titles.all().join("`, `");
            let missing =
                || SightingsError::Refused(format!("{what}: there is no column `{name}`; there are `{known}`"));
            Ok(Some(titles.label(name).map_err(|_| missing())?))
        };
        let usual = || titles.all().iter().position(|title| TIMES.iter().any(|it| title.eq_ignore_ascii_case(it)));
        let named = |name: &str| titles.all().iter().position(|title| title.eq_ignore_ascii_case(name));
        let (date, time) = match asked(&self.time, "the time")? {
            Some(time) => (None, Some(time)),
            // A day and a time of the day are one time.
            None => named("date").zip(named("time")).map_or((None, usual()), |(date, time)| (Some(date), Some(time))),
        };
        let covariate = asked(&self.covariate, "the covariate")?;
        let wanted: Vec<usize> = date.into_iter().chain(time).chain(covariate).collect();
        let mut asides = Vec::new();
        // Where the rows are counted, whatever is in them: a line of the wrong length ends it, and is told where rows are read.
        let columns = body_schema_table::Columns { labels: wanted, ..Default::default() };
        for row in table.rows(columns).map_while(Result::ok) {
            let mut labels = row.labels.into_iter();
            let date = date.and_then(|_| labels.next());
            let time = time.and_then(|_| labels.next());
            asides.push(Aside { line: row.line, date, time, covariate: covariate.and_then(|_| labels.next()) });
        }
        Ok(asides)
    }

    /// The mean of the covariate over the rows that were learned from, where they have it.
    pub fn reference(&self, learned: &[usize]) -> Option<f64> {
        self.covariate.as_ref()?;
        let asides = self.asides(self.learned()?).ok()?;
        let is_learned = |(row, aside): (usize, &Aside)| aside.number().filter(|_| learned.contains(&row));
        let values: Vec<f64> = asides.iter().enumerate().filter_map(is_learned).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }

    /// The rows that the calibration file holds out, with what stands beside them in their file.
    ///
    /// # Errors
    ///
    /// [`SightingsError`] if their times cannot be read.
    pub fn held_out(&self, case: &Case<'_>, held_out: &[usize]) -> Result<Vec<Row>, SightingsError> {
        let mut asides: BTreeMap<&str, BTreeMap<usize, Aside>> = BTreeMap::new();
        let mut found = Vec::new();
        for index in held_out {
            let row = &case.rows[*index];
            let of = row.line.file.as_deref();
            let of = of.and_then(|file| self.scenario.data.iter().find(|(name, _)| name == file));
            let text = of.map(|(_, text)| text.as_str()).or_else(|| self.learned()).unwrap_or_default();
            if !asides.contains_key(text) {
                let lines = self.asides(text)?.into_iter().map(|aside| (aside.line, aside)).collect();
                asides.insert(text, lines);
            }
            let aside = asides.get(text).and_then(|of| of.get(&row.line.number));
            let time_s = aside.and_then(Aside::seconds).transpose().map_err(SightingsError::Refused)?;
            found.push(Row {
                line: row.line.number,
                positions: row.positions.clone(),
                observation: row.observation.clone(),
                time_s,
                covariate: aside.and_then(Aside::number),
            });
        }
        Ok(found)
    }
}

/// What stands in a line beside the readings.
struct Aside {
    line: usize,
    /// The day, where `time` is one of the day.
    date: Option<String>,
    time: Option<String>,
    covariate: Option<String>,
}

impl Aside {
    /// The time, where there is a column of it.
    fn seconds(&self) -> Option<Result<f64, String>> {
        let time = self.time.as_deref()?;
        Some(self.date.as_deref().map_or_else(|| seconds(time), |date| joined(date, time)))
    }

    /// The covariate, where it is a number.
    fn number(&self) -> Option<f64> {
        self.covariate.as_deref()?.parse::<f64>().ok().filter(|value| value.is_finite())
    }
}

/// What the reader of the calibration file says of the later rows, without that file's name before it.
fn of_the_table(error: &ScenarioError) -> Option<String> {
    let told = error.to_string();
    let said = told.split_once(LATER)?.1.lines().map(str::trim).collect::<Vec<_>>().join("; ");
    Some(said.trim().to_owned())
}

/// The reason why the only line of a table cannot be read.
fn why(error: &SightingsError) -> String {
    let told = error.to_string();
    told.strip_prefix("line 2").unwrap_or(&told).trim_start_matches([',', ':', ' ']).to_owned()
}

/// A day and a time of the day, in UTC where it does not say.
fn joined(date: &str, time: &str) -> Result<f64, String> {
    let (date, time) = (date.trim(), time.trim());
    if date.is_empty() && time.is_empty() {
        return Err("the time is empty".to_owned());
    }
    let pad = if time.find(':') == Some(1) { "0" } else { "" };
    let is_day = date.len() == 10 && date.parse::<civil::Date>().is_ok();
    let found = (is_day && time.contains(':')).then(|| seconds(&format!("{date}T{pad}{time}")).ok()).flatten();
    found.ok_or_else(|| {
        format!(
            "the columns `date` and `time` hold `{date}` and `{time}`, which are no day and time of the day as 2026-06-01 and 08:30:00; \
             write them so, or name the column that holds the time"
        )
    })
}

/// A time: seconds, or a date as ISO 8601 has it, in UTC where it does not say.
fn seconds(cell: &str) -> Result<f64, String> {
    let cell = cell.trim();
    if cell.is_empty() {
        return Err("the time is empty".to_owned());
    }
    if let Some(number) = cell.parse::<f64>().ok().filter(|number| number.is_finite()) {
        if number.abs() > MOST_S {
            return Err(format!("the time `{cell}` is too large for seconds; write seconds, not milliseconds or less"));
        }
        if let Some((year, month, day)) = day_of(cell) {
            return Err(format!("the time `{cell}` may be seconds or a day; write the day as {year}-{month}-{day}"));
        }
        return Ok(number);
    }
    let of = |timestamp: Timestamp| timestamp.as_millisecond() as f64 / 1e3;
    let utc = |moment: civil::DateTime| moment.to_zoned(jiff::tz::TimeZone::UTC).map(|it| of(it.timestamp()));
    if let Ok(timestamp) = cell.parse::<Timestamp>() {
        return Ok(of(timestamp));
    }
    let moment =
        cell.parse::<civil::DateTime>().or_else(|_| cell.parse::<civil::Date>().map(|date| date.at(0, 0, 0, 0)));
    moment
        .ok()
        .and_then(|moment| utc(moment).ok())
        .ok_or_else(|| format!("`{cell}` is no time; write seconds, or as 2026-06-01T08:30:00Z"))
}

/// Year, month and day of a cell as 20260601.
fn day_of(cell: &str) -> Option<(&str, &str, &str)> {
    if cell.len() != 8 || !cell.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let (year, month, day) = (&cell[..4], &cell[4..6], &cell[6..]);
    let is_day = ("1900".."2100").contains(&year) && ("01"..="12").contains(&month) && ("01"..="31").contains(&day);
    is_day.then_some((year, month, day))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds_or_dates_and_nothing_else() {
        assert_eq!(seconds("1700000000"), Ok(1.7e9));
        assert_eq!(seconds("2026-06-01"), seconds("2026-06-01T00:00:00Z"));
        assert_eq!(joined("2026-06-01", "08:15:00"), seconds("2026-06-01T08:15:00Z"));
        assert_eq!(joined("2026-06-01", "8:15"), seconds("2026-06-01T08:15:00Z"));
        for (cell, word) in
            [("1700000000000", "milliseconds"), ("20260601", "2026-06-01"), (" ", "empty"), ("noon", "no time")]
        {
            assert!(seconds(cell).is_err_and(|why| why.contains(word)), "{cell}");
        }
        for (date, time) in
            [("2026-06-01", "12.5"), ("1 June", "08:15"), ("2026-06-01T07:00:00", "08:15"), ("2026-06-01", "")]
        {
            assert!(joined(date, time).is_err_and(|why| why.contains("name the column")), "{date} {time}");
        }
    }
}
