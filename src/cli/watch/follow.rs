//! A table that grows, and sightings that are sent: taken as they come.

use std::{
    fs::{File, OpenOptions},
    io::{Read, Seek, SeekFrom, Write},
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::mpsc,
    time::Duration,
};

use anyhow::{Context, Result};
use axum::http::StatusCode;
use body_schema_table::{MOST_BYTES, Table};
use serde_json::{Map, Value, json};

use body_schema_sightings::{LeftOut, Outcome, Reader, Row, Settled, SightingsError, Standing};

use super::{
    BadInput,
    listen::{self, Posted, Published},
    shown, take,
    tell::Teller,
};
use crate::cli::{input::read_text, output, signals::Interruption};

/// The interval at which the table is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// A table that is read on from where it ended.
pub struct Tail {
    path: PathBuf,
    titles: Option<String>,
    /// The bytes and the lines that were read.
    bytes: u64,
    lines: usize,
    file: same_file::Handle,
    /// The lines of the table before it was begun anew: as many may have been heard.
    anew: usize,
    /// Whether rows under these titles were read.
    were_read: bool,
    /// Whether it is missed, as was told.
    is_missed: bool,
}

impl Tail {
    pub fn open(path: &Path, grows: bool) -> Result<Self> {
        let cannot = |why: &dyn std::fmt::Display| BadInput(format!("--table {} {why}", shown(path)));
        // What is no text is told as everywhere; in one that grows a bad line does not take the others with it.
        if !(grows && path.is_file()) {
            read_text(path, MOST_BYTES).map_err(|why| cannot(&why))?;
        }
        let file = same_file::Handle::from_path(path).map_err(|error| cannot(&error))?;
        Ok(Self {
            path: path.to_owned(),
            titles: None,
            bytes: 0,
            lines: 0,
            file,
            anew: 0,
            were_read: false,
            is_missed: false,
        })
    }

    /// The rows that were added since; of one that grows only whole lines.
    pub fn read(&mut self, reader: &Reader<'_>, grows: bool) -> Result<(Vec<Row>, Vec<LeftOut>)> {
        let Some((text, mut bad)) = self.added(grows)? else { return Ok((Vec::new(), Vec::new())) };
        let (lines, mut rest) = (self.lines, text.as_str());
        self.lines += text.lines().count();
        let offset = match &self.titles {
            Some(_) => lines - 1,
            None => {
                let (titles, after) = text.split_once('\n').unwrap_or((&text, ""));
                self.titles = Some(titles.trim_end_matches('\r').to_owned());
                rest = after;
                0
            }
        };
        let titles = self.titles.as_deref().unwrap_or_default();
        let found = reader.read(&format!("{titles}\n{rest}"), offset, self.were_read);
        let (rows, left_out) = found.with_context(|| format!("the table {}", shown(&self.path)))?;
        self.were_read |= !rows.is_empty();
        bad.extend(left_out);
        Ok((rows, bad))
    }

    /// The lines that were added, with an empty one for each that is no text.
    fn added(&mut self, grows: bool) -> Result<Option<(String, Vec<LeftOut>)>> {
        let name = shown(&self.path);
        let Ok(handle) = same_file::Handle::from_path(&self.path) else {
            if !self.is_missed {
                output::tell(format_args!("warning: {name} is not there; it is waited for"));
                self.is_missed = true;
            }
            return Ok(None);
        };
        self.is_missed = false;
        let long = std::fs::metadata(&self.path).map_or(0, |it| it.len());
        if handle != self.file || long < self.bytes {
            let what = if handle == self.file { "has become shorter" } else { "was replaced by another file" };
            output::tell(format_args!(
                "warning: {name} {what}; it is read from its beginning, and what is known stays"
            ));
            self.anew = self.anew.max(self.lines);
            (self.titles, self.bytes, self.lines, self.were_read) = (None, 0, 0, false);
        }
        self.file = handle;
        if long == self.bytes {
            return Ok(None);
        }
        let cannot = || format!("cannot read {name}");
        let mut file = File::open(&self.path).with_context(cannot)?;
        file.seek(SeekFrom::Start(self.bytes)).with_context(cannot)?;
        let mut bytes = Vec::new();
        file.take(MOST_BYTES).read_to_end(&mut bytes).with_context(cannot)?;
        if grows {
            // A line that is being written is not yet there.
            bytes.truncate(bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1));
        }
        if bytes.is_empty() {
            return Ok(None);
        }
        self.bytes += bytes.len() as u64;
        let (mut text, mut bad) = (String::new(), Vec::new());
        for (index, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
            match std::str::from_utf8(line) {
                Ok(line) => text += line,
                // Titles that are not read may hold anything.
                Err(_) if self.titles.is_none() && index == 0 => text += &String::from_utf8_lossy(line),
                Err(_) => {
                    text.push('\n');
                    bad.push(LeftOut { line: self.lines + index + 1, why: "it is not text in UTF-8".to_owned() });
                }
            }
        }
        Ok(Some((text, bad)))
    }

    /// Adds rows to the table, by its own titles.
    fn append(&self, sent: &[Vec<(String, String)>]) -> Result<(), Refused> {
        let Some(titles) = &self.titles else {
            return Err(format!("{} has no titles yet; write its first line", shown(&self.path)).into());
        };
        let line = format!("{titles}\n");
        let table = Table::open(line.as_bytes()).map_err(|error| error.to_string())?;
        let titles = table.titles().all();
        let mut text = String::new();
        for row in sent {
            if let Some((unknown, _)) = row.iter().find(|(title, _)| !titles.contains(title)) {
                return Err(format!("the table has no column `{unknown}`; it has `{}`", titles.join("`, `")).into());
            }
            let cell = |title: &String| row.iter().find(|(of, _)| of == title).map_or("", |(_, cell)| cell.as_str());
            text += &(titles.iter().map(|title| quoted(cell(title))).collect::<Vec<_>>().join(",") + "\n");
        }
        let cannot = |error: std::io::Error| format!("{} cannot be added to: {error}", shown(&self.path));
        let mut file = OpenOptions::new().read(true).append(true).open(&self.path).map_err(cannot)?;
        let mut last = [0];
        file.seek(SeekFrom::End(-1)).and_then(|_| file.read_exact(&mut last)).map_err(cannot)?;
        if last != *b"\n" {
            let hint = "the last line of the table is not ended, and may be being written; end it, or send the sighting again in a moment";
            return Err(Refused(StatusCode::CONFLICT, hint.to_owned()));
        }
        Ok(file.write_all(text.as_bytes()).map_err(cannot)?)
    }
}

/// Why what was sent is not taken.
struct Refused(StatusCode, String);

impl From<String> for Refused {
    fn from(why: String) -> Self {
        Self(StatusCode::UNPROCESSABLE_ENTITY, why)
    }
}

/// A cell as CSV has it.
fn quoted(cell: &str) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"").replace(['\n', '\r'], " ")),
        false => cell.to_owned(),
    }
}

/// Goes on until a signal ends it.
#[expect(clippy::too_many_arguments, reason = "all that a watch has, each named where it is made")]
pub fn follow(
    listen: Option<SocketAddr>,
    reader: &Reader<'_>,
    mut tail: Option<Tail>,
    state: &mut Standing,
    teller: &mut Teller,
    settled: &Settled,
    interruption: &Interruption,
    is_shown: bool,
) -> Result<()> {
    let published = Published::default();
    // Without a listener nobody would see it.
    let publish = |state: &Standing| {
        if listen.is_some() {
            published.publish(state, settled);
        }
    };
    publish(state);
    let (send, posted) = mpsc::channel();
    if let Some(address) = listen {
        let bound = listen::begin(address, published.clone(), send.clone())?;
        if is_shown {
            output::say(format!("metrics are at http://{bound}/metrics"))?;
            output::say(format!("the page of this watch is at http://{bound}/watch"))?;
        }
        if !bound.ip().is_loopback() {
            output::tell(format_args!("warning: whoever reaches {bound} may send sightings; there is no token"));
        }
    }
    if is_shown {
        let of = tail.as_ref().map_or_else(|| "sightings that are sent".to_owned(), |tail| shown(&tail.path));
        output::say(format!("{} sightings so far; waiting for {of} (Ctrl-C ends it)", state.watch.sightings()))?;
    }
    while interruption.signal().is_none() {
        if let Ok(Posted { text, is_json, answer }) = posted.recv_timeout(LOOK_EVERY) {
            let found = sent(&text, is_json, reader, tail.as_mut(), state, teller);
            let found = found.unwrap_or_else(|Refused(status, detail)| {
                (status, json!({ "status": status.as_u16(), "detail": detail }))
            });
            publish(state);
            drop(answer.send(found));
        }
        if let Some(tail) = &mut tail
            && !grown(reader, tail, state, teller)?.is_empty()
        {
            publish(state);
        }
    }
    Ok(())
}

/// Takes what was added to the table.
fn grown(reader: &Reader<'_>, tail: &mut Tail, state: &mut Standing, teller: &mut Teller) -> Result<Vec<Outcome>> {
    let (rows, left_out) = match tail.read(reader, true) {
        Ok(found) => found,
        Err(error) => {
            output::tell(format_args!("warning: {}", crate::cli::told(&error)));
            return Ok(Vec::new());
        }
    };
    let mut outcomes = Vec::new();
    for it in left_out {
        super::leave_out(state, it.clone());
        outcomes.push(Outcome::LeftOut(it));
    }
    for row in rows {
        if row.line <= tail.anew && state.clock.is_past(&row) {
            let why = "the table was begun anew, and this row is not later than the last one that was heard".to_owned();
            let it = LeftOut { line: row.line, why };
            super::leave_out(state, it.clone());
            outcomes.push(Outcome::LeftOut(it));
            continue;
        }
        outcomes.push(take(state, row, teller)?);
    }
    Ok(outcomes)
}

/// Takes sightings that were sent: where there is a table they are added to it first, so that they outlive this program.
fn sent(
    text: &str,
    is_json: bool,
    reader: &Reader<'_>,
    tail: Option<&mut Tail>,
    state: &mut Standing,
    teller: &mut Teller,
) -> Result<(StatusCode, Value), Refused> {
    let rows = if is_json { of_json(text)? } else { of_csv(text)? };
    if rows.is_empty() {
        return Err("there is no sighting in it; send titles and a line, or an object by titles".to_owned().into());
    }
    if rows.iter().any(|row| row.iter().all(|(_, cell)| cell.trim().is_empty())) {
        let why = "a sighting has no cell that says anything; send its cells by the titles of the table";
        return Err(Refused(StatusCode::BAD_REQUEST, why.to_owned()));
    }
    let told = |error: anyhow::Error| crate::cli::told(&error);
    let unread = |error: SightingsError| error.to_string();
    let outcomes = match tail {
        Some(tail) => {
            // What others have added comes first, and what cannot be read is not added.
            grown(reader, tail, state, teller).map_err(told)?;
            let (read, left_out) = reader.read(&as_csv(&rows), 0, false).map_err(unread)?;
            if read.is_empty() {
                let why = left_out.first().map_or_else(|| "no row can be read".to_owned(), |it| it.why.clone());
                return Err(why.into());
            }
            tail.append(&rows)?;
            grown(reader, tail, state, teller).map_err(told)?
        }
        None => {
            let (rows, left_out) = reader.read(&as_csv(&rows), 0, false).map_err(unread)?;
            let mut outcomes = Vec::new();
            for it in left_out {
                super::leave_out(state, it.clone());
                outcomes.push(Outcome::LeftOut(it));
            }
            for row in rows {
                outcomes.push(take(state, row, teller).map_err(told)?);
            }
            outcomes
        }
    };
    let (mut heard, mut events, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for outcome in outcomes {
        match outcome {
            Outcome::Heard(row, told) => {
                heard.push(row);
                events.extend(told);
            }
            Outcome::LeftOut(it) => left_out.push(it),
        }
    }
    let status = if heard.is_empty() { StatusCode::UNPROCESSABLE_ENTITY } else { StatusCode::OK };
    Ok((status, json!({ "heard": heard, "events": events, "left_out": left_out })))
}

/// Rows by the titles of the first.
fn as_csv(rows: &[Vec<(String, String)>]) -> String {
    let mut titles: Vec<&str> = Vec::new();
    for (title, _) in rows.iter().flatten() {
        if !titles.contains(&title.as_str()) {
            titles.push(title);
        }
    }
    let line = |cells: Vec<String>| cells.join(",") + "\n";
    let mut text = line(titles.iter().map(|title| quoted(title)).collect());
    for row in rows {
        let cell = |title: &&str| row.iter().find(|(of, _)| of == title).map_or("", |(_, cell)| cell.as_str());
        text += &line(titles.iter().map(|title| quoted(cell(title))).collect());
    }
    text
}

fn of_csv(text: &str) -> Result<Vec<Vec<(String, String)>>, String> {
    let table = Table::open(text.as_bytes()).map_err(|error| error.to_string())?;
    let titles = table.titles().all().to_vec();
    let labels: Vec<usize> = (0..titles.len()).collect();
    let columns = body_schema_table::Columns { labels, ..Default::default() };
    let rows = table.rows(columns).map(|row| {
        let row = row.map_err(|error| error.to_string())?;
        Ok(titles.iter().cloned().zip(row.labels).collect())
    });
    rows.collect()
}

fn of_json(text: &str) -> Result<Vec<Vec<(String, String)>>, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| format!("it is no JSON: {error}"))?;
    let object = |value: Value| match value {
        Value::Object(object) => cells(object),
        _ => Err("write an object by the titles of the columns, or a list of them".to_owned()),
    };
    match value {
        Value::Array(values) => values.into_iter().map(object).collect(),
        value => Ok(vec![object(value)?]),
    }
}

fn cells(object: Map<String, Value>) -> Result<Vec<(String, String)>, String> {
    let cell = |(title, value): (String, Value)| match value {
        Value::Null => Ok((title, String::new())),
        Value::Number(number) => Ok((title, number.to_string())),
        Value::String(text) => Ok((title, text)),
        _ => Err(format!("`{title}` is neither a number nor text")),
    };
    object.into_iter().map(cell).collect()
}
