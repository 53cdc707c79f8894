//! What is said before the first sighting, of lines that are left out, and after the last.

use anyhow::Result;

use body_schema_sightings::{LeftOut, Row, Settled, Shown, Standing, are_at_once, drifting};

use super::Arguments;
use crate::cli::output;

/// Says that a line is left out, as long as few are for that reason.
pub fn warn(all: &[LeftOut], it: &LeftOut) {
    /// The lines that are named for one reason.
    const NAMED: usize = 5;
    match all.iter().filter(|other| other.why == it.why).count() {
        0..=NAMED => output::tell(format_args!("warning: line {} is left out: {}", it.line, it.why)),
        more if more == NAMED + 1 => {
            output::tell(format_args!(
                "warning: line {} and others are left out for this reason too: {}",
                it.line, it.why
            ));
        }
        _ => {}
    }
}

pub fn introduce(arguments: &Arguments, state: &Standing, told: &Settled, rows: &[Row]) -> Result<()> {
    output::say(format!(
        "{}: calibrated by {} rows; residuals on rows that were not learned from are {:.2} times as large as is stated, and are taken \
         to be",
        state.scenario,
        told.learned_rows,
        state.watch.body().widened()
    ))?;
    if !arguments.follow && are_at_once(rows) {
        let rate = arguments.per_year.unwrap_or(52.0);
        output::tell(format_args!(
            "warning: all rows have the same time: {rate} sightings a year are taken instead; say how many with --per-year, or name another \
             column with --time"
        ));
    }
    Ok(())
}

pub fn conclude(state: &Standing) -> Result<()> {
    let shows = state.shows();
    if !shows.is_empty() {
        output::say(output::table(
            ["the latest six sightings show a zero to", "± one deviation", "found soon from"],
            shows.iter().map(Shown::cells),
        ))?;
    }
    for drift in state.watch.drifts() {
        output::say(drifting(&drift))?;
    }
    if !state.left_out.is_empty() {
        let count = state.left_out.len();
        output::say(if count == 1 {
            "1 line was left out".to_owned()
        } else {
            format!("{count} lines were left out")
        })?;
    }
    if let Some(strays) = state.strays() {
        output::tell(format_args!("warning: {strays}"));
    }
    let (sightings, evidence) = (state.watch.sightings(), state.watch.evidence());
    match state.said() {
        Some(said) => output::say(format!("after {sightings} sightings a change stands: {said}")),
        None => output::say(format!(
            "after {sightings} sightings the robot is as it was calibrated: the evidence of a change is {:.1} % of what an alarm needs",
            100.0 * evidence
        )),
    }
}
