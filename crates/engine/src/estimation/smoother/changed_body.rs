//! The belief after the body has changed.
//!
//! What was measured before is kept as far as it says something of the changed body: what does not change stays known as well as it
//! was,
//!
//! ```text
//! x' ~ N(x, P + B Q Bᵀ)
//! ```
//!
//! with x and P what the readings before the change say (see [`Jump`](super::jump::Jump) for B and Q). While these hardly determined
//! the body, x' is what it was before the first movement. Either way knowledge from beforehand is the original one, however often
//! the body has changed.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix};

use super::{
    Smoother, THOROUGH,
    change_point::{Change, RATE},
    jump::{Jump, jumps},
    mode::Mode,
    posterior::{Measurement, Posterior},
};
use crate::{
    elementary::ln,
    estimation::{Misfit, MisfitCause, ReadingReport, change::quantile},
    model::{Links, Prior, State},
};

/// The equations before a change, per parameter, from which on they count for the changed body.
const DETERMINED: f64 = 1.5;

/// How far below an alarm, in the logarithm of the odds, a belief stops calling itself settled.
const SUSPICION: f64 = 2.0;
/// The logarithm of the odds from which on a change is reported: to miss one costs more than to learn some parameters
/// anew.
const ALARM: f64 = 1.0;
/// The threshold of the odds soon after a change, while it is being learned, and where noise is larger than stated.
const ALARM_AGAIN: f64 = 3.0;
/// The threshold of the odds where noise that was not stated is larger than is usual for its sensor: the model has errors
/// then, and what it cannot explain differs from posture to posture as a change does from movement to movement.
const ALARM_OF_MODEL: f64 = 6.0;
/// The logarithm of the odds from which on it is clear how the body has changed, and the number of movements after which it is assumed
/// to be.
const PLAIN: f64 = 8.0;
const PATIENCE: u64 = 6;
/// The logarithm of the odds that a change must have without a reading that may be an outlier.
const SUPPORT: f64 = -4.0;
/// The scale beyond which noise is larger than stated, or than usual.
const UNUSUAL: f64 = 1.5;
/// Standard deviations (by Wilson and Hilferty) of a squared residual that may be an outlier's.
const OUTLYING: f64 = 5.0;
/// The number of movements after a change within which another one needs higher odds.
const SOON: u64 = 10;
/// Where readings may be outliers: the number of the latest readings that must have been rejected, the last among them, before a
/// change is looked for.
const REJECTED: usize = 3;
const LATEST: usize = 10;

/// The belief after a change: the prior of the changed body, and the mode of what was measured since.
struct After {
    posterior: Posterior,
    mode: Mode,
    log_odds: f64,
}

impl Smoother {
    /// Looks for a change since some measurement, and notes whether readings misfit.
    pub(super) fn notices_change(&mut self) -> Option<Change> {
        self.misfit = None;
        self.told_at = self.told_at.filter(|movement| self.movements < movement + SOON);
        let mode = self.hypotheses.modes.first()?;
        if self.posterior.loss.is_robust() {
            self.misfit = self.outliers(mode);
            // Before the belief is settled it may be wrong itself, and rejects what would tell.
            return if self.is_settled() { self.rejected_change(mode) } else { None };
        }
        let jumps = self.jumps(mode);
        let soon = self.is_revising() && self.told_at.is_none();
        let is_unusual = |untold: bool| {
            let mut scales = self.unknown.iter().zip(&self.posterior.scales);
            scales.any(|(unknown, scale)| *unknown == untold && *scale > UNUSUAL)
        };
        let alarm = match (is_unusual(true), soon || is_unusual(false)) {
            (true, _) => ALARM_OF_MODEL,
            (false, true) => ALARM_AGAIN,
            (false, false) => ALARM,
        };
        let has_past = self.posterior.marginalised.is_some();
        let evidence = self.evidence(&self.posterior, mode)?;
        let found = evidence.likeliest(&jumps, has_past)?;
        let since = self.posterior.measurements[found.since].movement;
        // Who drops nothing has been told of what came before.
        let is_new = self.forgets || self.changed_at.is_none_or(|movement| since > movement);
        let mut cause = if self.forgets { MisfitCause::ChangedBody } else { MisfitCause::Unexplained };
        if is_new && found.log_odds > alarm {
            let suspect = self.suspect(found.since);
            if suspect.is_none_or(|suspect| self.is_supported(suspect, mode, &jumps)) {
                self.misfit = Some(Misfit { since, cause });
                return Some(found);
            }
            cause = MisfitCause::Outliers;
        }
        self.misfit = (found.log_odds > alarm - SUSPICION).then_some(Misfit { since, cause });
        None
    }

    /// All ways in which the body may have changed from the state of a mode.
    fn jumps(&self, mode: &Mode) -> Vec<Jump> {
        jumps(&mode.state, &self.belief.layout, &self.original_at(&mode.state))
    }

    /// The measurement, from one on, that the belief before the latest expected least, if it may be an outlier.
    fn suspect(&self, since: usize) -> Option<usize> {
        let Self { posterior, belief, .. } = self;
        let mut links = Links::new(&belief.state);
        let squared = |index: usize| {
            let seen = &posterior.measurements[index];
            let mut sum = 0.0;
            posterior.residuals(links.at(&seen.positions), seen, |channel, whitened| {
                sum += posterior.squared(channel, whitened);
            });
            (index, sum, seen.observation.equations())
        };
        let all = (since..posterior.measurements.len()).map(squared);
        let (index, sum, equations) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (sum > quantile(equations as f64, OUTLYING)).then_some(index)
    }

    /// Whether any change is supported without one of the measurements.
    fn is_supported(&self, without: usize, mode: &Mode, jumps: &[Jump]) -> bool {
        let mut others = self.posterior.clone();
        others.measurements.remove(without);
        let layout = &self.belief.layout;
        // It may have drawn the mode along.
        let starts = [&self.belief.state, &mode.state];
        let found = starts.iter().filter_map(|start| others.mode(start, layout, THOROUGH).ok());
        let Some(mode) = found.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence)) else { return false };
        let evidence = self.evidence(&others, &mode);
        evidence
            .and_then(|it| it.likeliest(jumps, others.marginalised.is_some()))
            .is_some_and(|it| it.log_odds > SUPPORT)
    }

    /// Whether more of the latest readings are outliers than expected.
    fn outliers(&self, mode: &Mode) -> Option<Misfit> {
        let seen = &self.posterior.measurements;
        let latest = &seen[seen.len().saturating_sub(LATEST)..];
        let rejected: Vec<u64> =
            latest.iter().filter(|seen| self.is_rejected(mode, seen)).map(|seen| seen.movement).collect();
        (2 * rejected.len() >= LATEST).then(|| Misfit { since: rejected[0], cause: MisfitCause::Outliers })
    }

    fn is_rejected(&self, mode: &Mode, seen: &Measurement) -> bool {
        let mut rejected = false;
        self.posterior.weights(&mode.state, seen, |weight| rejected |= weight < 0.5);
        rejected
    }

    /// Looks for a change where readings may be outliers: since one of the latest that were rejected.
    fn rejected_change(&self, mode: &Mode) -> Option<Change> {
        let seen = &self.posterior.measurements;
        let first = seen.len().saturating_sub(LATEST);
        let places: Vec<usize> = (first..seen.len()).filter(|place| self.is_rejected(mode, &seen[*place])).collect();
        if places.len() < REJECTED || places.last() != Some(&(seen.len() - 1)) {
            return None;
        }
        let candidates = places[..places.len() + 1 - REJECTED].iter().filter(|place| **place > 0);
        let jumps = self.jumps(mode);
        let mut best: Option<Change> = None;
        for &since in candidates {
            let Some(before) = self.before(since) else { continue };
            for jump in jumps.iter().filter(|jump| jump.has_room) {
                let change = Change { since, jump: jump.clone(), log_odds: f64::NEG_INFINITY };
                let Some(After { mode: after, log_odds, .. }) = self.after(&before.1, &change, mode) else { continue };
                let mut explained = 0;
                for seen in &seen[since..] {
                    self.posterior.weights(&after.state, seen, |weight| explained += usize::from(weight > 0.5));
                }
                let is_better = best.as_ref().is_none_or(|best| log_odds > best.log_odds);
                if log_odds > 0.0 && explained >= REJECTED && is_better {
                    best = Some(Change { log_odds, ..change });
                }
            }
        }
        best
    }

    /// The posterior of the readings before one of those kept, and its mode.
    fn before(&self, since: usize) -> Option<(Posterior, Mode)> {
        let mut before = self.posterior.clone();
        before.measurements.truncate(since);
        // What is known beforehand goes on to be known of the changed body, and is not told twice.
        before.known.clear();
        let mode = before.mode(&self.hypotheses.modes.first()?.state, &self.belief.layout, THOROUGH).ok()?;
        Some((before, mode))
    }

    /// The belief after a given change, compared with `mode`, one body for all.
    fn after(&self, known: &Mode, change: &Change, mode: &Mode) -> Option<After> {
        let layout = &self.belief.layout;
        let Jump { directions, covariance, log_share, .. } = &change.jump;
        let spread = known.covariance() + directions * covariance * directions.transpose();
        let spread = (&spread + spread.transpose()) * 0.5;
        let root = Cholesky::new(spread.clone())?;
        let prior = Prior::around(known.state.clone(), layout, spread).ok()?;
        let posterior = self.posterior.anew(prior, self.posterior.measurements[change.since..].to_vec());
        let starts = [&known.state, &mode.state];
        let found = starts.iter().filter_map(|start| posterior.mode_from_afar(start, layout, THOROUGH).ok());
        let found = found.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
        let occam = root.l_dirty().diagonal().map(ln).sum();
        let log_odds = known.log_evidence + found.log_evidence - occam - mode.log_evidence + log_share + ln(RATE);
        Some(After { posterior, mode: found, log_odds })
    }

    /// Notes a change that was reported: what was learned before is given up once it is clear how the body has changed. The first
    /// readings after a change often show that there was one, but not yet which joint it concerns.
    pub(super) fn noticed(&mut self, change: &Change) {
        let told = *self.told_at.get_or_insert(self.movements);
        let is_plain = self.posterior.loss.is_robust() || change.log_odds > PLAIN;
        if is_plain || self.movements >= told + PATIENCE {
            self.changed(change);
        }
    }

    /// Whether it is still being learned how the body has changed: a change found now is no other change, but a better account
    /// of the last.
    pub(super) fn is_revising(&self) -> bool {
        self.changed_at.is_some_and(|movement| self.movements < movement + SOON)
    }

    /// Replaces the belief after the body has changed.
    fn changed(&mut self, change: &Change) {
        let layout = self.belief.layout.clone();
        self.changed_at = Some(self.movements);
        self.told_at = None;
        self.misfit = None;
        let Some(mode) = self.hypotheses.modes.first().cloned().filter(|_| self.forgets) else { return };
        let since = self.posterior.measurements.get(change.since).map_or(u64::MAX, |seen| seen.movement);
        let dropped: Vec<ReadingReport> =
            self.posterior.readings(&mode.state).take_while(|reading| reading.movement < since).collect();
        Arc::make_mut(&mut self.past).extend(dropped);
        let before = self.before(change.since);
        if let Some((before, known)) = &before {
            self.remember_noise(before, known);
        }
        let is_determined = |(before, known): &(Posterior, Mode)| {
            before.equations(&known.state, &layout) >= DETERMINED * layout.dimension() as f64
        };
        let after = before.filter(is_determined).and_then(|before| self.after(&before.1, change, &mode));
        if let Some(After { posterior, mode, .. }) = after {
            self.posterior = posterior;
            // What is made of an estimate has no scales to learn.
            self.scaled = None;
            self.hypotheses.modes = vec![mode];
        } else {
            let latest = self.posterior.measurements.split_off(change.since.min(self.posterior.measurements.len()));
            self.posterior = self.posterior.anew(self.original.clone(), latest);
            self.widened = 1.0;
            self.begin();
            let found = self.posterior.mode_from_afar(&mode.state, &layout, THOROUGH);
            self.hypotheses.modes.extend(found);
        }
        self.hypotheses.stable_steps = 0;
        self.hypotheses.spawn(self.settings.spawned, &self.posterior, &layout, &mut self.rng);
        self.hypotheses.condense(self.settings.kept, &layout);
    }

    /// The original prior's covariance in the chart at a state; without correlations where the state is outside the guess's chart.
    fn original_at(&self, state: &State) -> DMatrix<f64> {
        let (prior, layout) = (&self.original, &self.belief.layout);
        let change = prior.guess().change_of_chart(layout, state).and_then(|change| change.try_inverse());
        match change.filter(|_| !prior.is_vague()) {
            Some(change) => {
                let carried = &change * prior.covariance() * change.transpose();
                (&carried + carried.transpose()) * 0.5
            }
            None => DMatrix::from_diagonal(&prior.covariance().diagonal()),
        }
    }
}
