//! The data kept of a step, written once for all readers.

use std::{mem::size_of, sync::Arc};

use serde_json::value::{RawValue, to_raw_value};

use crate::server::problem::{Kind, Problem};
use body_schema_experiment::{Description, StepReport};
use body_schema_recording::{RecordingError, StepsCsv};

/// A report as readers get it. Clones share the text.
#[derive(Clone, Debug)]
pub(in crate::server) struct Kept {
    /// The step of the report.
    pub(in crate::server) step: u64,
    /// The report as JSON, without the minimiser's partition, which only recordings hold.
    pub(in crate::server) json: Arc<RawValue>,
    /// The report's rows of the table of all steps.
    pub(in crate::server) rows: Arc<[u8]>,
}

impl Kept {
    pub(super) fn of(report: &StepReport, description: &Description) -> Result<Self, Problem> {
        let failed = |error: String| Problem::new(Kind::Internal, format!("the report cannot be written: {error}"));
        let rows = rows(report, description).map_err(|error| failed(error.to_string()))?;
        let json = to_raw_value(report).map_err(|error| failed(error.to_string()))?;
        Ok(Self { step: report.step, json: json.into(), rows: rows.into() })
    }

    /// Reads a report that was kept before; `None` for any other text.
    pub(super) fn read(text: &str, description: &Description) -> Option<Self> {
        let report: StepReport = serde_json::from_str(text).ok()?;
        let json = RawValue::from_string(text.to_owned()).ok()?;
        Some(Self { step: report.step, json: json.into(), rows: rows(&report, description).ok()?.into() })
    }

    /// The report itself.
    pub(super) fn report(&self) -> Option<StepReport> {
        serde_json::from_str(self.json.get()).ok()
    }

    /// The memory that it takes, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.json.get().len() + self.rows.len()
    }
}

fn rows(report: &StepReport, description: &Description) -> Result<Vec<u8>, RecordingError> {
    let mut rows = Vec::new();
    let mut table = StepsCsv::without_header(description, &mut rows);
    table.write(report)?;
    table.flush()?;
    drop(table);
    Ok(rows)
}
