//! What is asked of later sightings, and all that is answered.

use body_schema_calibration::Case;
use body_schema_scenario::Scenario;
use body_schema_watch::{Body, Covariate, Drift, Explanation, Settings, Watch};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{
    SightingsError,
    rows::{LeftOut, Reader, Row, YEAR_S},
    standing::{Clock, HeardRow, Shown, Standing, Told},
};

/// What is asked.
#[derive(Clone, Debug)]
pub struct Question {
    /// How many false alarms a year are allowed, at most, on average; above 0.
    pub false_alarms_per_year: f64,
    /// Sightings a year, where rows have no time; their usual gap, or a week, without it.
    pub per_year: Option<f64>,
    /// The share of the noise's variance that sightings at one posture have in common, where it is known.
    pub shared: Option<f64>,
    /// The change of the covariate over which a zero may well drift by 0.2 degrees.
    pub covariate_span: f64,
    /// Whether more rows are to come, so that times which are all equal are not yet known to say nothing.
    pub goes_on: bool,
}

impl Default for Question {
    fn default() -> Self {
        Self { false_alarms_per_year: 0.5, per_year: None, shared: None, covariate_span: 10.0, goes_on: false }
    }
}

impl Question {
    /// The robot calibrated by the `learned` rows, and nothing heard yet; `rows` are those that will come, as far as they are known.
    ///
    /// # Errors
    ///
    /// [`SightingsError`] if the robot cannot be calibrated or watched.
    pub fn begin(
        &self,
        case: &Case<'_>,
        reader: &Reader<'_>,
        learned: &[usize],
        rows: &[Row],
    ) -> Result<Standing, SightingsError> {
        let scenario = case.scenario;
        let (fit, widened) = case.standing(learned)?;
        let body = Body::new(&fit.belief, case.names.clone(), widened)?;
        let shares = self.shared.map_or_else(|| Settings::default().shares, |share| vec![share]);
        let covariate = reader
            .covariate
            .as_ref()
            .map(|_| Covariate { reference: reader.reference(learned), span: self.covariate_span });
        let settings = Settings { false_alarms_per_year: self.false_alarms_per_year, shares, covariate };
        let watch = Watch::new(body, settings)?;
        let known = learned.iter().map(|row| {
            let row = &case.rows[*row];
            Row {
                line: row.line.number,
                positions: row.positions.clone(),
                observation: row.observation.clone(),
                time_s: None,
                covariate: None,
            }
        });
        // Where targets meet sockets nothing is seen elsewhere.
        let others = if case.meets_itself() { Vec::new() } else { allowed(scenario) };
        let step = self.per_year.map_or_else(|| usual_gap(rows), |per_year| 1.0 / per_year);
        let clock = if !self.goes_on && are_at_once(rows) { Clock::blind(step) } else { Clock::new(step) };
        let mut state = Standing::new(scenario.name.clone(), watch, clock, known.collect(), others);
        state.assumes_a_week = self.per_year.is_none();
        Ok(state)
    }
}

/// Random postures within the limits of the joints, as far as the constraints allow them.
fn allowed(scenario: &Scenario) -> Vec<Vec<f64>> {
    /// How many there are, and how many are drawn for each at most.
    const POSTURES: usize = 400;
    const DRAWS: usize = 25;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let constraints = scenario.bounds();
    let drawn = std::iter::repeat_with(|| match &constraints {
        Some(constraints) => constraints.tightened.draw(&mut rng),
        None => scenario.robot.limits.draw(&mut rng),
    });
    let is_allowed = |posture: &Vec<f64>| constraints.as_ref().is_none_or(|it| it.allow(None, posture));
    drawn.take(POSTURES * DRAWS).filter(is_allowed).take(POSTURES).collect()
}

/// Refuses a robot of which a joint follows others: a zero that is off moves all that follows its reading, and movements must be such that
/// followers can take.
///
/// # Errors
///
/// [`SightingsError`] that names the joint.
pub fn refuse_followers(case: &Case<'_>) -> Result<(), SightingsError> {
    let Some(chain) = case.described.map(|described| &described.chain) else { return Ok(()) };
    match chain.moving().find(|segment| chain.readings.iter().all(|it| it.name != segment.name)) {
        Some(follower) => Err(SightingsError::Refused(format!(
            "joint `{}` follows other joints, which a watch does not know yet: it would name the wrong part",
            follower.name
        ))),
        None => Ok(()),
    }
}

/// The rows that are learned from, and those that are held out.
///
/// # Errors
///
/// [`SightingsError`] if the calibration file holds nothing out and `needs_held_out`.
pub fn split(case: &Case<'_>, needs_held_out: bool) -> Result<(Vec<usize>, Vec<usize>), SightingsError> {
    let splits = case.splits(None)?;
    match &splits[..] {
        [one] if !one.held_out.is_empty() => Ok((one.training.clone(), one.held_out.clone())),
        _ if needs_held_out => Err(SightingsError::Refused(
            "every row of this file is learned from, and none is left to watch; name a table of later rows".to_owned(),
        )),
        [one] => Ok((one.training.clone(), Vec::new())),
        _ => Ok(((0..case.rows.len()).filter(|row| !case.rows[*row].observation.is_miss()).collect(), Vec::new())),
    }
}

/// Rows in the order of their times; those without one last, as they come.
pub fn in_order(rows: &mut [Row]) {
    let time = |row: &Row| row.time_s.unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| time(a).total_cmp(&time(b)));
}

/// Whether rows have times that are all equal, so that they say nothing.
pub fn are_at_once(rows: &[Row]) -> bool {
    rows.len() > 1 && rows[0].time_s.is_some() && rows.iter().all(|row| row.time_s == rows[0].time_s)
}

/// The years between rows: the median gap of those with times, or a week.
fn usual_gap(rows: &[Row]) -> f64 {
    const WEEK: f64 = 1.0 / 52.0;
    let times: Vec<f64> = rows.iter().filter_map(|row| row.time_s).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).map_or(WEEK, |gap| gap / YEAR_S)
}

/// All that is known at the end, or at the moment.
#[derive(Serialize)]
pub struct Report<'a> {
    scenario: &'a str,
    version: &'static str,
    /// The rows that were learned from.
    learned_rows: usize,
    /// The factor by which noise and covariance were widened, by folds of these rows.
    widened: f64,
    false_alarms_per_year: f64,
    sightings: u64,
    /// R α: 1 is the threshold.
    evidence: f64,
    changed: bool,
    /// What stands, in words.
    said: Option<String>,
    explanations: Vec<Explanation>,
    drifts: Vec<Drift>,
    /// How well the latest six sightings show every joint's zero.
    shows: Vec<Shown>,
    left_out: &'a [LeftOut],
    events: &'a [Told],
    #[serde(skip_serializing_if = "Option::is_none")]
    heard: Option<&'a [HeardRow]>,
}

/// What was asked for, and what it was calibrated by.
#[derive(Clone, Copy, Debug)]
pub struct Settled {
    /// The rows that were learned from.
    pub learned_rows: usize,
    /// How many false alarms a year are allowed.
    pub false_alarms_per_year: f64,
}

impl Settled {
    /// How it stands; with every sighting if it is to be the `whole`.
    pub fn report<'a>(&self, state: &'a Standing, whole: bool) -> Report<'a> {
        Report {
            scenario: &state.scenario,
            version: env!("CARGO_PKG_VERSION"),
            learned_rows: self.learned_rows,
            widened: state.watch.body().widened(),
            false_alarms_per_year: self.false_alarms_per_year,
            sightings: state.watch.sightings(),
            evidence: state.watch.evidence(),
            changed: state.watch.is_changed(),
            said: state.said(),
            explanations: state.watch.explanations(),
            drifts: state.watch.drifts(),
            shows: state.shows(),
            left_out: &state.left_out,
            events: &state.told,
            heard: whole.then_some(&state.heard[..]),
        }
    }
}
