//! The watch: sightings in, alarms and recoveries out.

use body_schema_engine::{elementary::exp, model::State, sensing::Observation};
use nalgebra::{DVector, Isometry3};
use serde::{Deserialize, Serialize};

use super::{
    Body, Skipped, Suspect, WatchError,
    evidence::{Alternative, Evidence, Turn},
    filter::Part,
    posterior::{Explanation, grouped, standing},
    suspect::rigid,
};

/// The difference in every joint, rad or m, below which two postures share what no parameter explains.
const SAME_POSTURE: f64 = 5e-3;
/// The most postures that are told apart.
const MOST_POSTURES: usize = 4096;
/// The share of the threshold by which one gap between sightings counts at most.
const MOST_HAZARD: f64 = 0.05;
/// The least probability of explanations that are told.
const TOLD: f64 = 0.01;
/// The deviations from which on a drift is told.
const DRIFTS: f64 = 3.0;

/// A robot with what has moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Mended {
    /// The calibrated robot with zeros, places and the base as they are now.
    pub state: State,
    /// Links that have moved: the joint that carries each, and the motion of all that is behind it, in the robot's frame at θ = 0.
    pub links: Vec<(usize, Isometry3<f64>)>,
}

/// The settings of a watch.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// α: the false alarms per year that are allowed, above 0.
    pub false_alarms_per_year: f64,
    /// φ: the shares of the noise's variance that sightings at one posture may have in common, each from 0 to below 1. An alarm needs
    /// the evidence under all of them.
    pub shares: Vec<f64>,
    /// The covariate that zeros may drift with.
    pub covariate: Option<Covariate>,
}

/// A covariate, such as a temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariate {
    /// Its value during the calibration; the first sighting's where that is not known.
    pub reference: Option<f64>,
    /// The change of it over which zeros may drift by 0.2 degrees (one deviation), above 0.
    pub span: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { false_alarms_per_year: 0.5, shares: vec![0.0, 0.8], covariate: None }
    }
}

/// A sighting.
#[derive(Clone, Copy, Debug)]
pub struct Sighting<'a> {
    /// ρ: the time since the sighting before, years, 0 or more. With 0 no change can begin here: give sightings at one time a share of a gap.
    pub elapsed_years: f64,
    /// The joints' positions, rad or m.
    pub positions: &'a [f64],
    /// What was seen.
    pub observation: &'a Observation,
    /// The covariate.
    pub covariate: Option<f64>,
}

/// What a sighting has led to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Heard {
    /// The number of the sighting, from 1.
    pub sighting: u64,
    /// R α, the evidence as a share of the threshold: 1 or more is an alarm.
    pub evidence: f64,
    /// The root mean square of the residual in deviations of what is predicted.
    pub residual_sds: f64,
    /// The probability that this sighting alone is wild.
    pub wild: f64,
    /// What has happened, if anything has.
    pub event: Option<Event>,
}

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The robot has changed.
    Alarm,
    /// Later sightings name another change.
    Renamed,
    /// What had changed is as it was calibrated.
    Recovered,
}

/// An alarm, or a recovery.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Which.
    pub kind: Kind,
    /// The sighting after which it was known.
    pub sighting: u64,
    /// What explains it, the likeliest first.
    pub explanations: Vec<Explanation>,
}

/// A drift with the covariate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// The joint whose zero drifts; null of what the whole robot grows by along x, y or z.
    pub joint: Option<String>,
    /// What drifts.
    pub name: String,
    /// By how much per unit of the covariate.
    pub per_unit: f64,
    /// The standard deviation.
    pub sd: f64,
    /// `deg` or `mm`.
    pub unit: String,
}

/// Sequential evidence that a calibrated robot has changed.
///
/// See the [crate] for the statistic and what it promises.
#[derive(Clone, Debug)]
pub struct Watch {
    body: Body,
    settings: Settings,
    evidence: Vec<Evidence>,
    sightings: u64,
    /// Postures by number.
    postures: Vec<Vec<f64>>,
    /// The change named last, while one stands.
    named: Option<usize>,
    reference: Option<f64>,
}

impl Watch {
    /// A watch of a robot that is as it was calibrated.
    ///
    /// # Errors
    ///
    /// [`WatchError::Setting`] if a setting is out of its range.
    pub fn new(body: Body, settings: Settings) -> Result<Self, WatchError> {
        let refuse =
            |what: &'static str, value: f64, wanted: &'static str| Err(WatchError::Setting { what, value, wanted });
        let rate = settings.false_alarms_per_year;
        if !(rate.is_finite() && rate > 0.0) {
            return refuse("the number of false alarms per year", rate, "a number above 0");
        }
        if let Some(share) = settings.shares.iter().find(|share| !(0.0..1.0).contains(*share)) {
            return refuse("a share of the variance", *share, "a number from 0 to below 1");
        }
        if let Some(covariate) = settings.covariate.filter(|it| !(it.span.is_finite() && it.span > 0.0)) {
            return refuse("the span of the covariate", covariate.span, "a number above 0");
        }
        let shares = if settings.shares.is_empty() { &[0.0][..] } else { &settings.shares };
        let evidence = shares.iter().map(|share| Evidence::new(&body, *share, settings.covariate.is_some())).collect();
        let reference = settings.covariate.and_then(|covariate| covariate.reference);
        Ok(Self { body, settings, evidence, sightings: 0, postures: Vec::new(), named: None, reference })
    }

    /// The robot.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The number of sightings so far.
    pub fn sightings(&self) -> u64 {
        self.sightings
    }

    /// R α: the evidence of a further change as a share of the threshold.
    pub fn evidence(&self) -> f64 {
        self.least().map_or(0.0, |log| exp(log) * self.settings.false_alarms_per_year)
    }

    fn least(&self) -> Option<f64> {
        self.evidence.iter().map(|it| it.log).min_by(f64::total_cmp)
    }

    /// The model by which things are told: that under which sightings say least.
    pub(crate) fn told_by(&self) -> &Evidence {
        // There is always one.
        &self.evidence[self.evidence.len() - 1]
    }

    /// Whether a change stands.
    pub fn is_changed(&self) -> bool {
        !self.told_by().standing().is_empty()
    }

    /// What stands, the likeliest first: with several changes there are as many that are certain. Empty while the robot is as it was
    /// calibrated.
    pub fn explanations(&self) -> Vec<Explanation> {
        let groups = standing(self.told_by().nulls());
        groups.iter().filter(|it| it.probability >= TOLD).filter_map(|it| it.told(&self.body)).collect()
    }

    /// The robot with what has moved by the likeliest explanation of what stands, with a the mean of each change: x̂ ⊞ Σ K a of what is no
    /// link, and the motions of links. What later sightings say of the calibration itself (δ) is not in it. `None` while the robot is as it
    /// was calibrated, and where what has changed has no numbers ([`Suspect::Unlike`]).
    pub fn mended(&self) -> Option<Mended> {
        let Alternative { standing, filter, .. } =
            self.told_by().nulls().first().filter(|it| !it.standing.is_empty())?;
        let mut moved = DVector::zeros(self.body.all.dimension());
        let mut links = Vec::new();
        for (index, _) in standing {
            let change = &self.body.changes[*index];
            let mean = filter.of(Part::Change(*index))?.0;
            match change.suspect {
                Suspect::Unlike => return None,
                Suspect::Link(joint) => links.push((joint, rigid(&self.body.state, joint, &mean))),
                _ => moved += &change.moves * mean,
            }
        }
        Some(Mended { state: self.body.state.retract(&self.body.all, &moved), links })
    }

    /// Takes a sighting.
    ///
    /// # Errors
    ///
    /// [`Skipped`] if it says nothing; nothing has changed then.
    pub fn hear(&mut self, sighting: &Sighting<'_>) -> Result<Heard, Skipped> {
        let joints = self.body.state.joints.len();
        sighting.observation.check(&self.body.measurement_model, joints, sighting.positions)?;
        let spans = match (self.settings.covariate, sighting.covariate) {
            (None, _) => None,
            (Some(covariate), Some(value)) if value.is_finite() => {
                Some((value - *self.reference.get_or_insert(value)) / covariate.span)
            }
            (Some(_), _) => return Err(Skipped::NoCovariate),
        };
        let linear = self.body.linear(sighting.positions, sighting.observation, spans);
        let d = linear.residual.len();
        if d == 0 {
            return Err(Skipped::Nothing);
        }
        if !linear.residual.iter().chain(linear.body.iter()).all(|x| x.is_finite()) {
            return Err(Skipped::Absurd);
        }
        let posture = self.posture(sighting.positions);
        let threshold = 1.0 / self.settings.false_alarms_per_year;
        let hazard = sighting.elapsed_years.clamp(0.0, MOST_HAZARD * threshold);
        let hazard = if hazard.is_nan() { 0.0 } else { hazard };
        let now = self.sightings + 1;
        let mut found = None;
        for evidence in &mut self.evidence {
            found = evidence.hear(&self.body, &linear, posture, now, hazard);
            if found.is_none() {
                return Err(Skipped::Absurd);
            }
        }
        let Some(found) = found else { return Err(Skipped::Absurd) };
        self.sightings = now;
        let evidence = self.evidence();
        let event = if evidence >= 1.0 { self.turn() } else { self.renamed() };
        Ok(Heard { sighting: now, evidence, residual_sds: (found.nis / d as f64).sqrt(), wild: found.wild, event })
    }

    /// The evidence suffices: what it says becomes what is believed.
    fn turn(&mut self) -> Option<Event> {
        let groups = grouped(self.told_by().alternatives());
        let first = groups.first()?.turn;
        let explanations: Vec<Explanation> =
            groups.iter().filter(|it| it.probability >= TOLD).filter_map(|it| it.told(&self.body)).collect();
        self.evidence.iter_mut().for_each(Evidence::settle);
        self.named = match first {
            Turn::Change(index) => Some(index),
            Turn::Return(_) => self.told_by().standing().last().copied(),
        };
        let kind = if matches!(first, Turn::Return(_)) { Kind::Recovered } else { Kind::Alarm };
        Some(Event { kind, sighting: self.sightings, explanations })
    }

    /// Whether later sightings have made another explanation far likelier.
    fn renamed(&mut self) -> Option<Event> {
        let named = self.named?;
        let groups = grouped(self.told_by().nulls());
        let first = groups.first()?;
        let Turn::Change(index) = first.turn else { return None };
        if index == named || first.probability < 0.9 {
            return None;
        }
        let explanations =
            groups.iter().filter(|it| it.probability >= TOLD).filter_map(|it| it.told(&self.body)).collect();
        self.named = Some(index);
        Some(Event { kind: Kind::Renamed, sighting: self.sightings, explanations })
    }

    fn posture(&mut self, positions: &[f64]) -> usize {
        let is_same = |known: &Vec<f64>| known.iter().zip(positions).all(|(a, b)| (a - b).abs() <= SAME_POSTURE);
        if let Some(known) = self.postures.iter().rposition(is_same) {
            return known;
        }
        if self.postures.len() < MOST_POSTURES {
            self.postures.push(positions.to_vec());
            return self.postures.len() - 1;
        }
        // One that is not kept is like no other.
        MOST_POSTURES + self.sightings as usize
    }

    /// What drifts with the covariate beyond doubt.
    pub fn drifts(&self) -> Vec<Drift> {
        let (Some(covariate), Some(null)) = (self.settings.covariate, self.told_by().nulls().first()) else {
            return Vec::new();
        };
        let Some((mean, spread)) = null.filter.of(Part::Drift) else { return Vec::new() };
        let joints = self.body.state.joints.len();
        let drift = |k: usize| {
            let sd = spread[(k, k)].max(0.0).sqrt();
            let turns = k < joints && self.body.state.joints[k].line().is_some();
            let factor = if turns { 1_f64.to_degrees() } else { 1e3 } / covariate.span;
            let joint = self.body.names.joints.get(k).cloned();
            let name = match &joint {
                Some(joint) => format!("the zero of {joint}"),
                None => format!("the whole robot along {}", ["x", "y", "z"][(k - joints) % 3]),
            };
            let unit = if turns { "deg" } else { "mm" }.to_owned();
            (mean[k].abs() > DRIFTS * sd).then(|| Drift {
                joint,
                name,
                per_unit: mean[k] * factor,
                sd: sd * factor,
                unit,
            })
        };
        (0..mean.len()).filter_map(drift).collect()
    }
}
