//! The data kept of a step, written once for all readers.

use std::{mem::size_of, sync::Arc};

use serde_json::value::{RawValue, to_raw_value};

use body_schema_recording::{RecordingError, StepsCsv};
use body_schema_wire::{Description, StepReport};

use crate::{Kind, Problem};

/// A report as readers get it. Clones share the text.
#[derive(Clone, Debug)]
pub struct Kept {
    /// The step that it is of.
    pub step: u64,
    /// All of it but the minimiser's partition, which only recordings hold.
    pub json: Arc<RawValue>,
    /// Its rows of the table of all steps.
    pub rows: Arc<[u8]>,
}

impl Kept {
    /// Writes a report.
    ///
    /// # Errors
    ///
    /// [`Kind::Internal`] where it cannot be written.
    pub fn of(report: &StepReport, description: &Description) -> Result<Self, Problem> {
        let failed = |error: String| Problem::new(Kind::Internal, format!("the report cannot be written: {error}"));
        let rows = rows(report, description).map_err(|error| failed(error.to_string()))?;
        let json = to_raw_value(report).map_err(|error| failed(error.to_string()))?;
        Ok(Self { step: report.step, json: json.into(), rows: rows.into() })
    }

    /// As it was kept before, with the report that it is of; `None` for what is none.
    pub fn read(text: &str, description: &Description) -> Option<Self> {
        let report: StepReport = serde_json::from_str(text).ok()?;
        let json = RawValue::from_string(text.to_owned()).ok()?;
        Some(Self { step: report.step, json: json.into(), rows: rows(&report, description).ok()?.into() })
    }

    /// The report that it is of.
    pub fn report(&self) -> Option<StepReport> {
        serde_json::from_str(self.json.get()).ok()
    }

    /// How much memory it takes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.json.get().len() + self.rows.len()
    }
}

/// The head of the table of all steps, whose rows are those of every [`Kept`].
///
/// # Errors
///
/// [`Kind::Internal`] where it cannot be written.
pub fn table_head(description: &Description) -> Result<Vec<u8>, Problem> {
    let mut head = Vec::new();
    let written = StepsCsv::new(description, &mut head).and_then(|mut table| table.flush());
    written.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?;
    Ok(head)
}

fn rows(report: &StepReport, description: &Description) -> Result<Vec<u8>, RecordingError> {
    let mut rows = Vec::new();
    let mut table = StepsCsv::without_header(description, &mut rows);
    table.write(report)?;
    table.flush()?;
    drop(table);
    Ok(rows)
}
