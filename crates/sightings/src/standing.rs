//! What is known while watching: the watch, the clock, and what was told.

use body_schema_engine::kinematics::Joint;
use body_schema_watch::{Drift, Event, Expected, Explanation, Kind, Known, Movements, Sighting, Suspect, Watch};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::rows::{LeftOut, Row, YEAR_S};

/// The sightings by which it is judged what sightings can show.
pub const LATEST: usize = 6;
/// What is less likely is not listed as a suspect.
pub const UNLIKELY: f64 = 0.05;
/// The most sightings whose postures are kept for movements.
const MOST_KNOWN: usize = 200;

/// The gaps by which a time may lie ahead, where it is in the future too, s.
const MOST_GAPS: f64 = 100.0;
const MOST_AHEAD_S: f64 = 86_400.0;

/// Sightings and the time between them.
///
/// Rows that are not later than the one before share out `credit`: the k-th takes 1/(k (k + 1)) of what there was, so that none has nothing.
/// Later gaps fill it again. All that rows are given is at most the time that they span and two steps.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Years between sightings that have no time.
    pub step: f64,
    last_s: Option<f64>,
    /// Whether times say nothing, since all are equal.
    is_blind: bool,
    credit: f64,
    /// Rows at the latest time, after the first.
    tied: u32,
    /// Rows that were not later than one before.
    pub repeated: usize,
}

impl Clock {
    /// By the times of rows; `step` are the years between sightings that have none.
    pub fn new(step: f64) -> Self {
        Self { step, last_s: None, is_blind: false, credit: step, tied: 0, repeated: 0 }
    }

    /// A clock for which every row is a step after the one before, whatever its time.
    pub fn blind(step: f64) -> Self {
        Self { is_blind: true, ..Self::new(step) }
    }

    /// The years since the latest row before; a share of the credit of one that is not later. Above 0.
    fn elapsed(&mut self, row: &Row) -> f64 {
        let Some(time) = row.time_s.filter(|_| !self.is_blind) else { return self.step };
        let Some(last) = self.last_s.replace(self.last_s.map_or(time, |last| last.max(time))) else {
            return self.step;
        };
        let gap = (time - last) / YEAR_S;
        if gap > 0.0 {
            let taken = (gap + self.credit - self.step).clamp(gap / 2.0, gap);
            self.credit += gap - taken;
            self.tied = 0;
            return taken;
        }
        self.repeated += 1;
        self.tied = self.tied.saturating_add(1);
        let taken = self.credit / (f64::from(self.tied) + 1.0);
        self.credit -= taken;
        taken
    }

    /// Whether a time is in the future by more than a day, and far ahead of all others.
    fn is_far_ahead(&self, row: &Row, now_s: f64) -> bool {
        let ahead = row.time_s.zip(self.last_s).filter(|_| !self.is_blind);
        ahead.is_some_and(|(time, last)| time > now_s + MOST_AHEAD_S && time - last > MOST_GAPS * self.step * YEAR_S)
    }

    /// Whether a row is not later than one that was heard.
    pub fn is_past(&self, row: &Row) -> bool {
        row.time_s.zip(self.last_s).is_some_and(|(time, last)| time <= last)
    }
}

/// A sighting as it was heard.
#[derive(Clone, Debug, Serialize)]
pub struct HeardRow {
    /// Its number, from 1.
    pub sighting: u64,
    /// Its line in the table.
    pub line: usize,
    /// Its time in words, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// R α.
    pub evidence: f64,
    /// The whitened residual, in deviations of its prediction.
    pub residual_sds: f64,
    /// The probability that it alone is wild.
    pub wild: f64,
}

/// An event with what is to be done about it.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    /// What happened.
    pub kind: Kind,
    /// The robot.
    pub scenario: String,
    /// The sighting with which it happened, from 1.
    pub sighting: u64,
    /// Its line in the table.
    pub line: usize,
    /// Its time in words, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// In words.
    pub said: String,
    /// A digest of what was measured in the line.
    pub row: String,
    /// What may have changed, the likeliest first.
    pub explanations: Vec<Explanation>,
    /// Since when, as the table has it: a time, or a line.
    pub since: String,
    /// What would tell best and mend it, while a change stands.
    pub movements: Option<NamedMovements>,
}

/// Movements with the names of the joints.
#[derive(Clone, Debug, Serialize)]
pub struct NamedMovements {
    /// In the order of positions.
    pub joints: Vec<String>,
    /// The movements, and what to expect of them.
    #[serde(flatten)]
    pub movements: Movements,
}

/// How a watched robot stands, and what was told of it.
#[derive(Debug)]
pub struct Standing {
    /// The robot.
    pub scenario: String,
    /// The evidence.
    pub watch: Watch,
    /// The time between sightings.
    pub clock: Clock,
    /// Whether it is still to be told that rows without a time are taken to be a week apart.
    pub assumes_a_week: bool,
    /// The sightings so far.
    pub heard: Vec<HeardRow>,
    /// The lines that were left out.
    pub left_out: Vec<LeftOut>,
    /// What was told.
    pub told: Vec<Told>,
    /// Rows that were learned from, and sightings: postures at which something is seen.
    known: Vec<Row>,
    latest: Vec<Row>,
    others: Vec<Vec<f64>>,
}

/// What came of a row.
pub enum Outcome {
    /// It was heard, and told something if there is something to tell.
    Heard(HeardRow, Option<Box<Told>>),
    /// It says nothing, or cannot be.
    LeftOut(LeftOut),
}

impl Standing {
    /// Nothing heard yet. `known` rows have postures at which something is seen; movements are to these, to those of sightings, and to
    /// `others`.
    pub fn new(scenario: String, watch: Watch, clock: Clock, known: Vec<Row>, others: Vec<Vec<f64>>) -> Self {
        Self {
            scenario,
            watch,
            clock,
            assumes_a_week: false,
            heard: Vec::new(),
            left_out: Vec::new(),
            told: Vec::new(),
            known,
            latest: Vec::new(),
            others,
        }
    }

    /// Takes a row; `now_s` is the time, in seconds since 1970.
    pub fn take(&mut self, row: Row, now_s: f64) -> Outcome {
        if self.clock.is_far_ahead(&row, now_s) {
            let time = row.time_s.and_then(written).unwrap_or_default();
            let why = format!("its time, {time}, is far ahead of all others and in the future; mend it");
            let left_out = LeftOut { line: row.line, why };
            self.left_out.push(left_out.clone());
            return Outcome::LeftOut(left_out);
        }
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
        // What fits no suspect is not told apart by movements of theirs.
        let is_unlike = first.is_some_and(|it| it.suspect == Suspect::Unlike);
        let movements = if is_unlike || (event.kind == Kind::Recovered && !self.watch.is_changed()) {
            None
        } else {
            let rows = self.known.iter().chain(&self.latest);
            let known: Vec<Known<'_>> =
                rows.map(|row| Known { positions: &row.positions, observation: &row.observation }).collect();
            self.watch.movements(&known, &self.others)
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
            row: self.latest.last().map_or_else(String::new, digest),
            explanations: event.explanations,
            movements: movements.map(|movements| NamedMovements { joints, movements }),
        }
    }

    /// Since when, as a time or as a line, with the 90 % interval.
    pub fn since(&self, explanation: &Explanation) -> String {
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
    pub fn said(&self) -> Option<String> {
        let explanations = self.watch.explanations();
        let (first, others) = explanations.split_first()?;
        let stand = std::iter::once(first).chain(others.iter().filter(|it| it.probability > 0.5));
        Some(stand.map(|it| said(Kind::Alarm, it, &self.since(it))).collect::<Vec<_>>().join("; and "))
    }

    /// What is said of sightings that fit nothing and raised no alarm: the latest, or many; `None` where there are few.
    pub fn strays(&self) -> Option<String> {
        /// The share of all from which on they are told.
        const MANY: f64 = 0.1;
        let is_wild = |it: &&HeardRow| it.wild > 0.5;
        let (all, wild) = (self.heard.len(), self.heard.iter().filter(is_wild).count());
        let last = self.heard.iter().rev().take_while(is_wild).count();
        if self.watch.is_changed() || (last == 0 && (wild as f64) < MANY * all as f64) || wild == 0 {
            return None;
        }
        let which = match last {
            0 => String::new(),
            1 => ", the last among them".to_owned(),
            _ => format!(", the last {last} among them"),
        };
        Some(format!(
            "{wild} of {all} sightings fit neither the robot as it was calibrated nor a change of it{which}: they were left aside"
        ))
    }

    /// The deviation of a zero that the latest six sightings leave, by joint; empty with fewer.
    pub fn shows(&self) -> Vec<Shown> {
        let latest = &self.latest[self.latest.len().saturating_sub(LATEST)..];
        if latest.len() < LATEST {
            return Vec::new();
        }
        let known: Vec<Known<'_>> =
            latest.iter().map(|row| Known { positions: &row.positions, observation: &row.observation }).collect();
        let body = self.watch.body();
        let of = |(joint, name): (usize, &String)| {
            let sd = *self.watch.deviations(Suspect::Zero(joint), &known)?.first()?;
            let (factor, unit) = shown_in(&body.state.joints[joint]);
            let sd = Some(sd * factor).filter(|sd| sd.is_finite());
            Some(Shown { joint: name.clone(), sd, unit: unit.to_owned() })
        };
        body.names.joints.iter().enumerate().filter_map(of).collect()
    }
}

impl Shown {
    /// The joint, one deviation, and the six from which on an error is found soon.
    pub fn cells(&self) -> [String; 3] {
        let size = |times: f64| self.sd.map_or_else(|| "–".to_owned(), |sd| format!("{:.2} {}", times * sd, self.unit));
        [self.joint.clone(), size(1.0), size(6.0)]
    }
}

/// A drift in words.
pub fn drifting(it: &Drift) -> String {
    format!(
        "{} drifts by {:+.4} ± {:.4} {} per unit of the covariate; that is no change",
        it.name, it.per_unit, it.sd, it.unit
    )
}

/// What is added to a suspect where its readings would lie apart from those of the likeliest.
pub fn apart(it: &Expected) -> String {
    it.apart_sds.map_or_else(String::new, |sds| {
        format!("; their readings would lie {sds:.1} deviations from those of the likeliest")
    })
}

/// What a joint's position is multiplied by where it is shown, and the unit that it has then.
pub fn shown_in(joint: &Joint) -> (f64, &'static str) {
    if joint.line().is_some() { (1_f64.to_degrees(), "deg") } else { (1e3, "mm") }
}

/// The name of a suspect where nothing follows it: "the base, or what it is measured from, has moved" has two commas.
pub fn alone(name: &str) -> &str {
    name.trim_end_matches(',')
}

/// What a row is known by: a digest of its positions and of what was seen.
fn digest(row: &Row) -> String {
    let hash = Sha256::digest(format!("{:?} {:?}", row.positions, row.observation));
    hash.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

/// How well a joint's zero is seen.
#[derive(Clone, Debug, Serialize)]
pub struct Shown {
    /// The joint.
    pub joint: String,
    /// The deviation of an error of its zero by the latest six sightings; null where they say nothing of it.
    pub sd: Option<f64>,
    /// Of the deviation: deg or mm.
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
        Kind::Recovered if explanation.suspect == Suspect::Unlike => {
            format!("sightings fit the robot as it was calibrated again, since {since} ({percent:.0} %)")
        }
        Kind::Alarm | Kind::Renamed if explanation.suspect == Suspect::Unlike => format!(
            "sightings fit neither the robot as it was calibrated nor a small change of it, since {since} ({percent:.0} %): look for what has \
             moved far (a tool, a tripod, a joint that lost its homing), for another target, and for units and frames of columns; calibrate \
             anew by these rows"
        ),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time_s: f64) -> Row {
        let observation = body_schema_engine::sensing::Observation { readings: Vec::new() };
        Row { line: 2, positions: Vec::new(), observation, time_s: Some(time_s), covariate: None }
    }

    /// Equal times and times that go back have a share each, and together no more than the span and two steps.
    #[test]
    fn every_row_has_a_share_and_the_sum_is_the_span() {
        let mut clock = Clock::new(0.01);
        let mut sum = 0.0;
        for day in 0..200 {
            for reading in 0..=(day % 7) {
                let late = if reading == 3 { 2.0 } else { 0.0 };
                let elapsed = clock.elapsed(&row((f64::from(day) - late) * 86_400.0));
                assert!(elapsed > 1e-6, "day {day}, reading {reading}: {elapsed}");
                sum += elapsed;
            }
            assert!(sum <= f64::from(day) * 86_400.0 / YEAR_S + 0.02 + 1e-9, "day {day}: {sum}");
        }
        assert!(sum >= 199.0 * 86_400.0 / YEAR_S && clock.repeated > 0, "{sum}");
    }

    #[test]
    fn later_rows_have_the_gap_before_them() {
        let mut clock = Clock::new(0.5);
        let found = [0.0, 1.0, 1.5, 4.0].map(|years| clock.elapsed(&row(years * YEAR_S)));
        assert_eq!((found, clock.repeated), ([0.5, 1.0, 0.5, 2.5], 0));
    }
}
