//! How large noise is that nobody knows: one scale for each kind.

use super::Smoother;

/// ν: how many equations the scale of the noise so far counts for.
const NOISE_WEIGHT: f64 = 3.0;
/// How often scales and modes are found in turn, at most.
const NOISE_ROUNDS: usize = 4;
/// The least scale of a noise that is not known, in nominal σ.
const LEAST_SCALE: f64 = 1e-3;

impl Smoother {
    /// The scale that the residuals of the first readings have at the guess: what it leaves unexplained.
    pub(super) fn begin_noise(&mut self) {
        let first: Vec<usize> =
            (0..self.unknown.len()).filter(|noise| self.unknown[*noise] && self.noise_seen(*noise) == 1).collect();
        if first.is_empty() {
            return;
        }
        let guess = self.posterior.prior.guess().clone();
        let fits = self.posterior.fit(&guess, &self.belief.layout);
        for noise in first.into_iter().filter(|noise| fits[*noise].equations > 0.0) {
            let scale = (fits[noise].squared / fits[noise].equations).sqrt();
            self.posterior.scales[noise] = scale.max(LEAST_SCALE);
        }
    }

    /// Readings so far with a kind of noise.
    fn noise_seen(&self, noise: usize) -> usize {
        let channel = self.nominal.noises()[noise].channel;
        let seen = self.posterior.measurements.iter();
        let settled = self.posterior.settled.as_ref().map_or(0, |settled| settled.count);
        settled + seen.filter(|seen| seen.observation.readings.get(channel).is_some_and(Option::is_some)).count()
    }

    /// Learns the scales of noise that is not known, by restricted maximum likelihood at the heaviest mode: what residuals are,
    /// in their mean square over the equations that no parameter accounts for,
    ///
    /// ```text
    /// s² = (Σ w ‖r‖² + ν s₀²) / (Σ w d − tr(Λₙ P) + ν),    ν = 3
    /// ```
    ///
    /// with s₀ the scale so far, so that it does not jump while there are hardly more equations than parameters.
    pub(super) fn learn_noise(&mut self) {
        let layout = self.belief.layout.clone();
        let before = self.posterior.scales.clone();
        let joints_before = self.joint_factor();
        for _ in 0..NOISE_ROUNDS {
            let Some(mode) = self.hypotheses.modes.first() else { return };
            let Some(absorbed) = self.posterior.absorbed(mode, &layout) else { return };
            let fits = self.posterior.fit(&mode.state, &layout);
            let mut change = 0.0_f64;
            for noise in (0..fits.len()).filter(|noise| self.unknown[*noise] && fits[*noise].equations > 0.0) {
                let free = (fits[noise].equations - absorbed[noise]).max(0.0);
                self.spare[noise] = free;
                // With equations to spare it may change as often as the modes follow.
                let from = if free > NOISE_WEIGHT { self.posterior.scales[noise] } else { before[noise] };
                let square = (fits[noise].squared + NOISE_WEIGHT * from * from) / (free + NOISE_WEIGHT);
                let scale = square.sqrt().max(LEAST_SCALE);
                if scale.is_finite() {
                    change = change.max((scale / self.posterior.scales[noise]).ln().abs());
                    self.posterior.scales[noise] = scale;
                }
            }
            change = change.max(self.learn_joint_noise(joints_before));
            if change < 1e-3 {
                return;
            }
            self.hypotheses.follow(&self.posterior, &layout);
            self.hypotheses.condense(self.settings.kept, &layout);
        }
    }
}
