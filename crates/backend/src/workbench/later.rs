//! Rows of later days, held against a calibrated robot.

use body_schema_calibration::{Case, Progress};
use body_schema_scenario::Scenario;
use body_schema_sightings::{
    Outcome, Question, Reader, Settled, SightingsError, in_order, page, refuse_followers, split,
};
use serde_json::{Value, json};

use super::{Files, asked::Watch, invalid, now_s, of_text};
use crate::Problem;

/// What has changed since the calibration, if anything has.
pub(super) fn watched(files: &Files, asked: &Watch, progress: &dyn Progress) -> Result<Value, Problem> {
    let question = Question::default();
    let allowed = asked.false_alarms_per_year.unwrap_or(question.false_alarms_per_year);
    if !(allowed > 0.0 && allowed <= 1e9) {
        return Err(invalid("a number above 0 is needed").field("false_alarms_per_year"));
    }
    let question = Question { false_alarms_per_year: allowed, ..question };
    let scenario = files.scenario(&asked.file, &asked.text, Scenario::parse)?;
    let case = Case::new(&scenario).map_err(of_text)?;
    refuse_followers(&case).map_err(of_text)?;
    let (learned, held_out) = split(&case, asked.later.is_none()).map_err(of_text)?;
    let reader = Reader::new(&case, None, asked.covariate.clone()).map_err(of_text)?;
    let of_table = |error: SightingsError| invalid(error.to_string()).field("later");
    let (mut rows, left_out) = match &asked.later {
        Some(later) => reader.read(files.asked("later", later)?, 0, false).map_err(of_table)?,
        None => (reader.held_out(&case, &held_out).map_err(of_table)?, Vec::new()),
    };
    in_order(&mut rows);
    progress.stage("calibrating", 1);
    let mut state = question.begin(&case, &reader, &learned, &rows).map_err(of_text)?;
    progress.tick();
    progress.stage("sightings", rows.len() as u64);
    state.left_out = left_out;
    let now_s = now_s().unwrap_or(f64::INFINITY);
    for row in rows {
        if let Outcome::Heard(..) = state.take(row, now_s) {
            progress.tick();
        }
    }
    if state.watch.sightings() == 0 {
        let why = state.left_out.first().map_or_else(String::new, |it| format!(": line {}: {}", it.line, it.why));
        return Err(invalid(format!("no row says anything of this robot{why}")).field("later"));
    }
    let settled = Settled { learned_rows: learned.len(), false_alarms_per_year: allowed };
    let (told, page) = (settled.report(&state, true), page(&state, &settled));
    Ok(json!({ "changed": state.watch.is_changed(), "said": state.said(), "report": told, "page": page }))
}
