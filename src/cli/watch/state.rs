//! What is known while watching: the watch, the clock, and what was told.

use body_schema_engine::kinematics::JointBox;
use body_schema_watch::{Event, Explanation, Kind, Known, Movements, Sighting, Watch};
use serde::Serialize;

use super::rows::{LeftOut, Row, YEAR_S};

/// The sightings by which it is judged what sightings can show.
pub const LATEST: usize = 6;
/// The most sightings whose postures are kept for movements.
const MOST_KNOWN: usize = 200;

/// Sightings and the time between them.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Years between sightings that have no time.
    pub step: f64,
    last_s: Option<f64>,
}

impl Clock {
    pub fn new(step: f64) -> Self {
        Self { step, last_s: None }
    }

    /// The years since the latest row before; 0 of one that is not later.
    fn elapsed(&mut self, row: &Row) -> f64 {
        let Some(time) = row.time_s else { return self.step };
        let elapsed = self.last_s.map_or(self.step, |last| (time - last) / YEAR_S);
        self.last_s = Some(self.last_s.map_or(time, |last| last.max(time)));
        elapsed.max(0.0)
    }

    /// Whether a row is not later than one that was heard.
    pub fn is_past(&self, row: &Row) -> bool {
        row.time_s.zip(self.last_s).is_some_and(|(time, last)| time <= last)
    }
}

/// A sighting as it was heard.
#[derive(Clone, Debug, Serialize)]
pub struct HeardRow {
    pub sighting: u64,
    pub line: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// R α.
    pub evidence: f64,
    pub residual_sds: f64,
    /// The probability that it alone is wild.
    pub wild: f64,
}

/// An event with what is to be done about it.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    pub kind: Kind,
    pub scenario: String,
    pub sighting: u64,
    pub line: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// In words.
    pub said: String,
    pub explanations: Vec<Explanation>,
    /// Since when, as the table has it: a time, or a line.
    pub since: String,
    pub movements: Option<NamedMovements>,
}

/// Movements with the names of the joints.
#[derive(Clone, Debug, Serialize)]
pub struct NamedMovements {
    pub joints: Vec<String>,
    #[serde(flatten)]
    pub movements: Movements,
}

pub struct State {
    pub scenario: String,
    pub watch: Watch,
    pub clock: Clock,
    pub heard: Vec<HeardRow>,
    pub left_out: Vec<LeftOut>,
    pub told: Vec<Told>,
    /// Rows that were learned from, and sightings: postures at which something is seen.
    known: Vec<Row>,
    latest: Vec<Row>,
    limits: Option<JointBox>,
}

/// What came of a row.
pub enum Outcome {
    Heard(HeardRow, Option<Box<Told>>),
    LeftOut(LeftOut),
}

impl State {
    pub fn new(scenario: String, watch: Watch, clock: Clock, known: Vec<Row>, limits: Option<JointBox>) -> Self {
        Self {
            scenario,
            watch,
            clock,
            heard: Vec::new(),
            left_out: Vec::new(),
            told: Vec::new(),
            known,
            latest: Vec::new(),
            limits,
        }
    }

    /// Takes a row.
    pub fn take(&mut self, row: Row) -> Outcome {
        let elapsed_years = self.clock.elapsed(&row);
        let sighting = Sighting {
            elapsed_years,
            positions: &row.positions,
            observation: &row.observation,
            covariate: row.covariate,
        };
        let heard = match self.watch.hear(&sighting) {
            Ok(heard) => heard,
            Err(skipped) => {
                let left_out = LeftOut { line: row.line, why: skipped.to_string() };
                self.left_out.push(left_out.clone());
                return Outcome::LeftOut(left_out);
            }
        };
        let of_row = HeardRow {
            sighting: heard.sighting,
            line: row.line,
            time: row.time_s.and_then(written),
            evidence: heard.evidence,
            residual_sds: heard.residual_sds,
            wild: heard.wild,
        };
        self.heard.push(of_row.clone());
        self.latest.push(row);
        if self.latest.len() > MOST_KNOWN {
            self.latest.remove(0);
        }
        let told = heard.event.map(|event| self.tell(event));
        self.told.extend(told.clone());
        Outcome::Heard(of_row, told.map(Box::new))
    }

    fn tell(&self, event: Event) -> Told {
        let last = self.heard.last();
        let first = event.explanations.first();
        let since = first.map_or_else(String::new, |it| self.since(it));
        let movements = if event.kind == Kind::Recovered && !self.watch.is_changed() {
            None
        } else {
            let rows = self.known.iter().chain(&self.latest);
            let known: Vec<Known<'_>> =
                rows.map(|row| Known { positions: &row.positions, observation: &row.observation }).collect();
            self.watch.movements(&known, self.limits.as_ref())
        };
        let joints = self.watch.body().names.joints.clone();
        Told {
            kind: event.kind,
            scenario: self.scenario.clone(),
            sighting: event.sighting,
            line: last.map_or(0, |it| it.line),
            time: last.and_then(|it| it.time.clone()),
            said: first.map_or_else(String::new, |it| said(event.kind, it, &since)),
            since,
            explanations: event.explanations,
            movements: movements.map(|movements| NamedMovements { joints, movements }),
        }
    }

    /// Since when, as a time or as a line, with the 90 % interval.
    fn since(&self, explanation: &Explanation) -> String {
        let of = |sighting: u64| {
            let heard = usize::try_from(sighting).ok().and_then(|it| self.heard.get(it.checked_sub(1)?));
            heard.map_or_else(
                || format!("sighting {sighting}"),
                |it| it.time.clone().unwrap_or_else(|| format!("sighting {sighting} (line {})", it.line)),
            )
        };
        let [from, to] = explanation.since_90;
        match from == to {
            true => of(explanation.since),
            false => format!("{} (90 %: {} to {})", of(explanation.since), of(from), of(to)),
        }
    }

    /// What stands, in words; `None` while the robot is as it was calibrated.
    pub fn standing(&self) -> Option<String> {
        let explanations = self.watch.explanations();
        let first = explanations.first()?;
        Some(said(Kind::Alarm, first, &self.since(first)))
    }

    /// The deviation of a zero that as many of the latest sightings as [`LATEST`] leave, by joint; empty with fewer.
    pub fn shows(&self) -> Vec<Shown> {
        let latest = &self.latest[self.latest.len().saturating_sub(LATEST)..];
        if latest.len() < LATEST {
            return Vec::new();
        }
        let known: Vec<Known<'_>> =
            latest.iter().map(|row| Known { positions: &row.positions, observation: &row.observation }).collect();
        let body = self.watch.body();
        let of = |(joint, name): (usize, &String)| {
            let sd = *self.watch.deviations(body_schema_watch::Suspect::Zero(joint), &known)?.first()?;
            let turns = body.state.joints[joint].line().is_some();
            let (factor, unit) = if turns { (1_f64.to_degrees(), "deg") } else { (1e3, "mm") };
            let sd = Some(sd * factor).filter(|sd| sd.is_finite());
            Some(Shown { joint: name.clone(), sd, unit: unit.to_owned() })
        };
        body.names.joints.iter().enumerate().filter_map(of).collect()
    }
}

/// How well a joint's zero is seen.
#[derive(Clone, Debug, Serialize)]
pub struct Shown {
    pub joint: String,
    /// The deviation of an error of its zero by the latest six sightings; null where they say nothing of it.
    pub sd: Option<f64>,
    pub unit: String,
}

/// A time, where it can be seconds since 1970, in UTC.
fn written(time_s: f64) -> Option<String> {
    /// What is less is counted from another moment.
    const LEAST: f64 = 1e8;
    match time_s >= LEAST {
        true => jiff::Timestamp::from_second(time_s.floor() as i64).ok().map(|it| it.to_string()),
        false => Some(format!("{time_s} s")),
    }
}

/// An event in words.
fn said(kind: Kind, explanation: &Explanation, since: &str) -> String {
    let percent = (100.0 * explanation.probability).clamp(1.0, 99.0);
    let name = &explanation.name;
    match kind {
        Kind::Recovered => format!("{name} is as it was calibrated again, since {since} ({percent:.0} %)"),
        Kind::Alarm | Kind::Renamed => {
            let begin = if kind == Kind::Renamed { "it is rather that " } else { "" };
            let amounts: Vec<String> = match &explanation.amounts[..] {
                [one] => vec![format!("by {:+.3} ± {:.3} {}", one.value, one.sd, one.unit)],
                all => {
                    all.iter().map(|it| format!("{} {:+.2} ± {:.2} {}", it.what, it.value, it.sd, it.unit)).collect()
                }
            };
            format!("{begin}{name} has moved {}, since {since} ({percent:.0} %)", amounts.join(", "))
        }
    }
}
