//! The sum over changes and their times of likelihood ratios: the mixture Shiryaev–Roberts statistic.

use body_schema_engine::elementary::{exp, ln};

use super::{
    body::{Body, Linear},
    filter::{Filter, Heard, Part, Predicted, UNLIKE, WILD, log_sum, robust},
    suspect::Suspect,
};

/// The latest sightings whose alternatives are all kept.
const LATEST: u64 = 3;
/// The most alternatives from before, the likeliest.
const MOST_OLDER: usize = 64;
/// The most explanations of an alarm that are kept, and the share of the probability that they hold.
const MOST_NULLS: usize = 16;
const HELD: f64 = 0.9999;
/// The most postures whose shared errors are kept.
const MOST_SHARED: usize = 24;
/// The prior probability that what comes after a change is the way back.
const RETURN: f64 = 0.3;
/// The most changes that stand at a time.
const MOST_STANDING: usize = 4;

/// What an alternative says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Turn {
    /// A change, by its number among the body's, has happened.
    Change(usize),
    /// A change has been undone.
    Return(usize),
}

/// A change at a time, with what follows from it.
#[derive(Clone, Debug)]
pub(crate) struct Alternative {
    pub turn: Turn,
    /// The first sighting after it, counted from 1.
    pub since: u64,
    /// The changes that stand, each with the first sighting after it.
    pub standing: Vec<(usize, u64)>,
    /// ε: the share of sightings that are wild.
    pub wild: f64,
    pub filter: Filter,
    /// ln of its term of R; of its probability once it explains an alarm.
    pub log: f64,
}

/// The evidence by one model of what sightings at one posture share.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    /// φ: the share of the variance that sightings at one posture have in common.
    share: f64,
    /// What is believed without any further change: one filter, or the explanations of the last alarm.
    nulls: Vec<Alternative>,
    alternatives: Vec<Alternative>,
    /// ln R.
    pub log: f64,
    /// The postures whose errors are kept: number, equations, the last sighting, how many there were.
    shared: Vec<(usize, usize, u64, u32)>,
}

/// What one sighting did.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// eᵀ S⁻¹ e without any further change.
    pub nis: f64,
    /// The probability that the sighting is wild, without any further change.
    pub wild: f64,
}

impl Evidence {
    pub fn new(body: &Body, share: f64, drifts: bool) -> Self {
        let mut filter = Filter::new(&body.covariance);
        if drifts {
            let deviations = body.drift_deviations();
            filter.add(Part::Drift, &deviations.component_mul(&deviations));
        }
        // Which change stands first does not matter where none does.
        let first = Alternative {
            turn: Turn::Return(usize::MAX),
            since: 0,
            standing: Vec::new(),
            wild: WILD,
            filter,
            log: 0.0,
        };
        Self { share, nulls: vec![first], alternatives: Vec::new(), log: f64::NEG_INFINITY, shared: Vec::new() }
    }

    /// The explanations of what stands, the likeliest first.
    pub fn nulls(&self) -> &[Alternative] {
        &self.nulls
    }

    pub fn alternatives(&self) -> &[Alternative] {
        &self.alternatives
    }

    #[cfg(test)]
    pub fn forget(&mut self, mut is_forgotten: impl FnMut(&Alternative) -> bool) {
        self.alternatives.retain(|it| !is_forgotten(it));
    }

    /// The changes that stand by the likeliest explanation, by their numbers.
    pub fn standing(&self) -> Vec<usize> {
        self.nulls.first().map(Alternative::changed).unwrap_or_default()
    }

    /// Adds sighting number `now`; `hazard` is the weight of a change just before it (see [`Watch`](super::Watch)).
    pub fn hear(&mut self, body: &Body, linear: &Linear, posture: usize, now: u64, hazard: f64) -> Option<Found> {
        let d = linear.residual.len();
        let kept = (self.share > 0.0 && self.share_posture(posture, d, now)).then_some(posture);
        // Without room for what is shared, it is noise like the rest.
        let noise = if kept.is_some() { 1.0 - self.share } else { 1.0 };
        let heard = Heard { linear, posture: kept, noise };
        let predicted: Vec<Predicted> =
            self.nulls.iter().map(|null| null.filter.predict(&heard)).collect::<Option<_>>()?;
        let first = predicted.first()?;
        let log_wild = first.log_wild();
        let found = Found { nis: first.nis, wild: 1.0 - robust(first.log_normal(), log_wild, self.nulls[0].wild).1 };
        self.spawn(body, now, hazard);

        let log_null = log_sum(
            self.nulls
                .iter()
                .zip(&predicted)
                .map(|(null, it)| null.log + robust(it.log_normal(), log_wild, null.wild).0),
        );
        for (null, it) in self.nulls.iter_mut().zip(&predicted) {
            let (log, weight) = robust(it.log_normal(), log_wild, null.wild);
            null.log += log - log_null;
            null.filter.update(&heard, it, weight);
        }
        self.nulls.sort_by(|a, b| b.log.total_cmp(&a.log));
        self.alternatives.retain_mut(|alternative| {
            let Some(it) = alternative.filter.predict(&heard) else { return false };
            let (log, weight) = robust(it.log_normal(), log_wild, alternative.wild);
            alternative.log += log - log_null;
            alternative.filter.update(&heard, &it, weight);
            alternative.log.is_finite()
        });
        self.thin(now);
        self.log = log_sum(self.alternatives.iter().map(|alternative| alternative.log));
        Some(found)
    }

    /// Alternatives of a change just before sighting `now`.
    fn spawn(&mut self, body: &Body, now: u64, hazard: f64) {
        let Some(null) = self.nulls.first().filter(|_| hazard > 0.0) else { return };
        let is_unlike = |index: usize| body.changes[index].suspect == Suspect::Unlike;
        let wild = |standing: &[(usize, u64)]| match standing.iter().any(|(index, _)| is_unlike(*index)) {
            true => UNLIKE,
            false => WILD,
        };
        let standing = null.changed();
        let returns = if standing.is_empty() { 0.0 } else { RETURN };
        let mut spawned = Vec::with_capacity(body.changes.len() + standing.len());
        for (index, change) in body.changes.iter().enumerate() {
            let is_again = standing.contains(&index);
            // What explains nothing explains no more the second time.
            let is_idle = if is_again { is_unlike(index) } else { standing.len() >= MOST_STANDING };
            if is_idle {
                continue;
            }
            let mut filter = null.filter.clone();
            let variances = change.deviations.component_mul(&change.deviations);
            // What has moved may move further.
            if is_again {
                filter.widen(Part::Change(index), &variances);
            } else {
                filter.add(Part::Change(index), &variances);
            }
            let log = ln(hazard * (1.0 - returns)) + change.log_prior;
            // What explains something takes the place of what does not.
            let others = null.standing.iter().filter(|(other, _)| *other != index && !is_unlike(*other)).copied();
            let standing: Vec<(usize, u64)> = others.chain([(index, now)]).collect();
            let wild = wild(&standing);
            spawned.push(Alternative { turn: Turn::Change(index), since: now, standing, wild, filter, log });
        }
        for index in &standing {
            let mut filter = null.filter.clone();
            filter.drop(Part::Change(*index));
            let log = ln(hazard * returns / standing.len() as f64);
            let standing: Vec<(usize, u64)> =
                null.standing.iter().filter(|(other, _)| other != index).copied().collect();
            let wild = wild(&standing);
            spawned.push(Alternative { turn: Turn::Return(*index), since: now, standing, wild, filter, log });
        }
        self.alternatives.extend(spawned);
    }

    /// Leaves out alternatives from before that are the least likely: R only becomes less.
    fn thin(&mut self, now: u64) {
        let (mut older, latest): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.alternatives).into_iter().partition(|it| it.since + LATEST <= now);
        older.sort_by(|a, b| b.log.total_cmp(&a.log));
        older.truncate(MOST_OLDER);
        older.extend(latest);
        self.alternatives = older;
    }

    /// Whether the error at a posture is kept; makes room for it if there is some.
    fn share_posture(&mut self, posture: usize, d: usize, now: u64) -> bool {
        if let Some(known) = self.shared.iter_mut().find(|known| known.0 == posture && known.1 == d) {
            (known.2, known.3) = (now, known.3 + 1);
            return true;
        }
        if self.shared.iter().any(|known| known.0 == posture) {
            return false;
        }
        if self.shared.len() >= MOST_SHARED {
            // Of the postures that were seen once the one longest ago.
            let once = self.shared.iter().enumerate().filter(|(_, known)| known.3 == 1);
            let Some(oldest) = once.min_by_key(|(_, known)| known.2).map(|(index, _)| index) else { return false };
            let (old, ..) = self.shared.remove(oldest);
            self.filters().for_each(|filter| filter.drop(Part::Shared(old)));
        }
        self.shared.push((posture, d, now, 1));
        let variances = nalgebra::DVector::from_element(d, self.share);
        self.filters().for_each(|filter| filter.add(Part::Shared(posture), &variances));
        true
    }

    fn filters(&mut self) -> impl Iterator<Item = &mut Filter> {
        self.nulls.iter_mut().chain(&mut self.alternatives).map(|it| &mut it.filter)
    }

    /// Takes the alternatives for what is: they are the explanations from now on, and the evidence of a further change begins anew.
    pub fn settle(&mut self) {
        let mut found = std::mem::take(&mut self.alternatives);
        found.sort_by(|a, b| b.log.total_cmp(&a.log));
        found.truncate(MOST_NULLS);
        let total = log_sum(found.iter().map(|it| it.log));
        let mut held = 0.0;
        found.retain_mut(|it| {
            it.log -= total;
            let is_needed = held < HELD;
            held += exp(it.log);
            is_needed
        });
        let total = log_sum(found.iter().map(|it| it.log));
        found.iter_mut().for_each(|it| it.log -= total);
        if !found.is_empty() {
            self.nulls = found;
        }
        self.log = f64::NEG_INFINITY;
    }
}

impl Alternative {
    /// The changes that stand, by their numbers.
    fn changed(&self) -> Vec<usize> {
        self.standing.iter().map(|(index, _)| *index).collect()
    }
}
