//! The size of a description's errors, learned from the evidence of measurements.
//!
//! The prior [along a chain](ChainPrior) has scales: of its origins, and of every zero; where σ is unknown it has a scale, too. While there
//! are few measurements more than parameters, small errors with large noise explain them as well as large errors with hardly any, and
//! choosing either alone would be wrong by as much. So both are judged together, by the evidence of the measurements where they were
//! linearised (Laplace's approximation, with G = Σ w HᵀH and g = Σ w Hᵀ(y − h) at δ = 0 in the chart at the guess, c = Σ w ‖y − h‖² there,
//! N = Σ w d, all in the noise as it was, and β = 1/τ² its precision from now on):
//!
//! ```text
//! 2 ln p(y | s, τ) = N ln β − ln det P₀(s) − ln det Λ − β c + β² gᵀΛ⁻¹g,      Λ = β G + P₀(s)⁻¹
//! ```
//!
//! and a weak prior of each: a spike and a slab of the scales, and of σ a normal distribution of ln σ around half of what is nominal. The
//! scale of origins and σ are looked at on a lattice, from some of its places on as far as there is evidence (MacKay, "Bayesian
//! interpolation", 1992, maximises it; with so few equations that lets σ collapse). Then the zeros are looked at one by one, the one that
//! is likeliest to be off first (Tipping and Faul, "Fast marginal likelihood maximisation for sparse Bayesian models", 2003): with k how a
//! zero moves the parameters, and M = βG − βG Λ⁻¹ βG, u = βg − βG Λ⁻¹ βg of all else,
//!
//! ```text
//! 2 ln p(y | v) = − ln(1 + v kᵀMk) + v (kᵀu)² / (1 + v kᵀMk) + constant
//! ```
//!
//! A zero is off where that is likelier than not, with a lattice of its own, since what it explains no origin needs to explain. What is
//! taken is the posterior mean of every scale and of ln τ. So a description that is right stays right, and one that is wrong by more than
//! stated is learned as if the larger error had been stated.

use std::{collections::HashMap, sync::Arc};

use nalgebra::{DMatrix, DVector};

use super::{Smoother, factor::Factor, mode::Mode, noise::LEAST_SCALE, posterior::Posterior};
use crate::{
    elementary::{exp, ln, ln_1p},
    model::{ChainPrior, Inverted, Layout, Scales},
};

/// A prior along a chain, and the scales that it has now.
#[derive(Clone, Debug)]
pub(super) struct Scaled {
    chain: Arc<ChainPrior>,
    pub(super) scales: Scales,
}

/// The most rounds in which scales are found at the mode that the last ones led to.
const ROUNDS: usize = 3;
/// The change of a scale below which it has converged.
const FOUND: f64 = 0.02;
/// The likely σ of unknown noise: half of what its maker promises, give or take a factor of e.
const LIKELY_SIGMA: f64 = 0.5;
const SIGMA_SPREAD: f64 = 1.0;
/// Places on the lattice whose log evidence is this far below the best do not count.
const NEGLIGIBLE: f64 = 5.0;
/// The step of ln τ on the lattice, and how far it reaches to each side.
const STEPS: (f64, f64) = (0.04, 0.4);
const REACH: f64 = 8.0;
/// A scale below this makes no difference.
const SMALL: f64 = 0.05;
/// The logarithm of the odds from which on a zero is tried for being off.
const WORTH_TRYING: f64 = -5.0;

impl Smoother {
    /// This smoother with a prior along a chain, whose scales are learned. Its covariance at scales of 1 is that of the
    /// prior.
    pub fn with_chain(mut self, chain: Arc<ChainPrior>) -> Self {
        // No zero is off before anything says so.
        let zeros = vec![ChainPrior::GRID[0]; chain.stated().zeros.len()];
        self.scaled = Some(Scaled { scales: Scales { origins: 1.0, zeros }, chain });
        self
    }

    /// The scales of errors along the chain, where they are learned.
    pub fn scales(&self) -> Option<&Scales> {
        self.scaled.as_ref().map(|scaled| &scaled.scales)
    }

    /// Learns the scales at the heaviest mode, and follows the modes to where they are with these.
    pub(super) fn learn_scales(&mut self) {
        let layout = self.belief.layout.clone();
        for _ in 0..ROUNDS {
            let (Some(scaled), Some(mode)) = (&self.scaled, self.hypotheses.modes.first()) else { return };
            let chain = scaled.chain.clone();
            let Some(data) = Data::of(&self.posterior, &self.unknown, mode, &layout) else { return };
            let Some(found) = found(&chain, &data, &scaled.scales) else { return };
            let prior = self.posterior.prior.with_covariance(&layout, chain.covariance(&found.scales));
            let Ok(prior) = prior else { return };
            let change = changed(&scaled.scales, &found.scales).max(found.log_noise.abs());
            let before = (self.posterior.clone(), self.hypotheses.clone(), self.scaled.clone());
            self.posterior.prior = prior;
            self.scaled = Some(Scaled { chain, scales: found.scales });
            for (scale, _) in self.posterior.scales.iter_mut().zip(&self.unknown).filter(|(_, unknown)| **unknown) {
                *scale = (*scale * exp(found.log_noise)).max(LEAST_SCALE);
            }
            self.hypotheses.follow(&self.posterior, &layout);
            self.hypotheses.condense(self.settings.kept, &layout);
            if self.hypotheses.modes.is_empty() {
                // With scales so small that the equations are singular there is no mode: those before stay.
                (self.posterior, self.hypotheses, self.scaled) = before;
                return;
            }
            if change < FOUND {
                return;
            }
        }
    }
}

/// The measurements as a quadratic around the guess, in the noise as it was.
struct Data {
    level: fearless_simd::Level,
    /// G.
    information: DMatrix<f64>,
    /// g.
    vector: DVector<f64>,
    /// c.
    squares: f64,
    /// N, of unknown noise; 0 where all noise is known.
    equations: f64,
    /// ln of each unknown noise's scale relative to the likely one.
    sigmas: Vec<f64>,
    /// The least ln τ: no noise is smaller than the least that is learned, at which equations still are regular.
    least_log_noise: f64,
}

impl Data {
    /// The quadratic at a mode; `None` outside the charts.
    fn of(posterior: &Posterior, unknown: &[bool], mode: &Mode, layout: &Layout) -> Option<Self> {
        let state = &mode.state;
        let m = layout.dimension();
        let (mut of_prior, mut pull) = (DMatrix::zeros(m, m), DVector::zeros(m));
        posterior.prior.cost(state, Some((&mut of_prior, &mut pull)));
        let (information, vector) = (&mode.information - of_prior, &mode.negative_gradient - pull);
        let fits = posterior.fit(state, layout);
        let squares: f64 = fits.iter().zip(&posterior.scales).map(|(fit, scale)| fit.squared / (scale * scale)).sum();
        let seen: Vec<usize> =
            (0..fits.len()).filter(|noise| unknown[*noise] && fits[*noise].equations > 0.0).collect();
        // From the chart at the mode to that at the guess.
        let guess = posterior.prior.guess();
        let delta = guess.local(layout, state)?;
        let back = guess.change_of_chart(layout, state)?.try_inverse()?;
        let information = back.transpose() * information * &back;
        let vector = back.transpose() * vector;
        let carried = &information * &delta;
        let data = Self {
            level: posterior.level,
            squares: squares + 2.0 * delta.dot(&vector) + delta.dot(&carried),
            vector: vector + carried,
            information,
            equations: seen.iter().map(|noise| fits[*noise].equations).sum(),
            sigmas: seen.iter().map(|noise| ln(posterior.scales[*noise] / LIKELY_SIGMA)).collect(),
            least_log_noise: (seen.iter().map(|noise| ln(LEAST_SCALE / posterior.scales[*noise])))
                .fold(f64::NEG_INFINITY, f64::max)
                .min(0.0),
        };
        (data.squares.is_finite() && data.information.iter().all(|x| x.is_finite())).then_some(data)
    }
}

/// A place: the scale of origins on the chain's grid, and steps of ln τ.
type GridPoint = (usize, i32);

/// The scales that the evidence favours.
struct Found {
    scales: Scales,
    /// ln τ.
    log_noise: f64,
}

/// The change between scales: of small ones by what they stand for, of large ones by their logarithm.
fn changed(before: &Scales, after: &Scales) -> f64 {
    let all =
        |scales: &Scales| std::iter::once(scales.origins).chain(scales.zeros.iter().copied()).collect::<Vec<f64>>();
    all(before).into_iter().zip(all(after)).map(|(a, b)| ln((a + SMALL) / (b + SMALL)).abs()).fold(0.0, f64::max)
}

/// Finds the scales that the evidence favours, starting from given ones.
fn found(chain: &ChainPrior, data: &Data, from: &Scales) -> Option<Found> {
    let none = vec![ChainPrior::GRID[0]; from.zeros.len()];
    let mut scales = Scales { origins: from.origins, zeros: none };
    let mut best = Lattice::new(chain, data, &scales).mean()?;
    let mut left: Vec<usize> = (0..scales.zeros.len()).collect();
    loop {
        scales.origins = best.origins;
        let candidate = suspect(chain, data, &scales, best.log_noise, &left)?;
        let Some(Suspect { zero, scale, odds, .. }) = candidate.filter(|it| it.promised > WORTH_TRYING) else { break };
        // What it would explain others may explain now: with it the origins may be smaller.
        let mut with = scales.clone();
        with.zeros[zero] = scale;
        let Some(other) = Lattice::new(chain, data, &with).mean() else { break };
        if other.log_evidence + odds <= best.log_evidence {
            break;
        }
        (scales, best) = (with, other);
        left.retain(|it| *it != zero);
    }
    scales.origins = best.origins;
    Some(Found { scales, log_noise: best.log_noise })
}

/// A zero that may be off.
struct Suspect {
    zero: usize,
    /// The mean of its scale if the zero is off.
    scale: f64,
    /// ln of the prior odds that it is off, less what is lost by not knowing its scale.
    odds: f64,
    /// ln of the odds that it is off at these scales of origins.
    promised: f64,
}

/// The zero of `left` that is likeliest to be off, at given scales of all else.
fn suspect(
    chain: &ChainPrior,
    data: &Data,
    scales: &Scales,
    log_noise: f64,
    left: &[usize],
) -> Option<Option<Suspect>> {
    let columns = chain.zeros(scales.origins);
    let [.., probabilities] = ChainPrior::log_probabilities();
    let beta = exp(-2.0 * log_noise);
    let (information, vector) = (&data.information * beta, &data.vector * beta);
    let prior = Factor::new(data.level, &chain.covariance(scales), 0.0)?.inverse();
    let factor = Factor::new(data.level, &(&information + prior), 0.0)?;
    let rest = factor.solve(&vector);
    let of = |zero: &usize| {
        let k = columns.column(*zero);
        let turned = &information * k;
        let s = (k.dot(&turned) - turned.dot(&factor.solve(&turned))).max(0.0);
        let q = k.dot(&vector) - turned.dot(&rest);
        let evidence = |(scale, log): (&f64, &f64)| {
            let v = scale * scale;
            let told = -0.5 * ln_1p(v * s) + 0.5 * q * q * v / (1.0 + v * s);
            (*scale, told, log + told)
        };
        let off: Vec<(f64, f64, f64)> = ChainPrior::GRID.iter().zip(&probabilities).skip(1).map(evidence).collect();
        let most = off.iter().map(|it| it.2).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = off.iter().map(|it| exp(it.2 - most)).sum();
        let scale = off.iter().map(|it| it.0 * exp(it.2 - most)).sum::<f64>() / total;
        let together = most + ln(total);
        let at_scale = evidence((&scale, &0.0)).1;
        let right = probabilities[0];
        Suspect { zero: *zero, scale, odds: together - at_scale - right, promised: together - right }
    };
    let all = left.iter().map(of).filter(|it| it.promised.is_finite());
    Some(all.max_by(|a, b| a.promised.total_cmp(&b.promised)))
}

/// The mean of the scales over a lattice.
struct Mean {
    origins: f64,
    log_noise: f64,
    /// The log evidence of all its places together.
    log_evidence: f64,
}

/// The evidence by place, as far as it has been computed.
struct Lattice<'a> {
    chain: &'a ChainPrior,
    data: &'a Data,
    probabilities: Vec<f64>,
    /// How zeros move the parameters, and their variances.
    zeros: (DMatrix<f64>, Vec<f64>),
    /// The step of ln τ.
    step: f64,
    known: HashMap<GridPoint, f64>,
    inverted: Vec<Option<Option<Inverted>>>,
    starts: Vec<GridPoint>,
}

impl<'a> Lattice<'a> {
    fn new(chain: &'a ChainPrior, data: &'a Data, scales: &Scales) -> Self {
        let nearest = |scale: f64| {
            let apart = |index: &usize| ln(ChainPrior::GRID[*index] / scale).abs();
            (0..ChainPrior::GRID.len()).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
        };
        let [probabilities, _] = ChainPrior::log_probabilities();
        Self {
            chain,
            data,
            probabilities,
            zeros: (chain.zeros(scales.origins), scales.zeros.iter().map(|scale| scale * scale).collect()),
            step: (2.0 / data.equations.max(1.0).sqrt()).clamp(STEPS.0, STEPS.1),
            known: HashMap::new(),
            inverted: vec![None; ChainPrior::GRID.len()],
            starts: vec![(nearest(scales.origins), 0), (0, 0), (nearest(1.0), 0)],
        }
    }

    /// The logarithm of the evidence at a place, its prior included, up to a constant that all places share.
    fn at(&mut self, place: GridPoint) -> f64 {
        if let Some(known) = self.known.get(&place) {
            return *known;
        }
        let found = self.evidence(place).filter(|evidence| evidence.is_finite()).unwrap_or(f64::NEG_INFINITY);
        self.known.insert(place, found);
        found
    }

    fn evidence(&mut self, (origins, noise): GridPoint) -> Option<f64> {
        let log_noise = f64::from(noise) * self.step;
        let probability = self.probabilities[origins];
        if log_noise.abs() > REACH || log_noise < self.data.least_log_noise {
            return None;
        }
        let (chain, zeros) = (self.chain, &self.zeros);
        let invert = || chain.inverted(origins)?.with(&zeros.0, &zeros.1);
        let prior = self.inverted[origins].get_or_insert_with(invert).as_ref()?;
        let beta = exp(-2.0 * log_noise);
        let lambda = &self.data.information * beta + &prior.information;
        let factor = Factor::new(self.data.level, &lambda, 0.0)?;
        let explained = beta * self.data.vector.dot(&factor.solve(&self.data.vector));
        let fit = beta * (self.data.squares - explained);
        let log_likelihood =
            -self.data.equations * log_noise - 0.5 * (prior.log_determinant + factor.log_determinant() + fit);
        let sigma = |log: &f64| -0.5 * ((log + log_noise) / SIGMA_SPREAD).powi(2);
        Some(log_likelihood + probability + self.data.sigmas.iter().map(sigma).sum::<f64>())
    }

    /// The best place at this scale of origins, for any τ.
    fn climbed(&mut self, (origins, mut noise): GridPoint) -> GridPoint {
        if self.data.equations == 0.0 {
            return (origins, noise);
        }
        let mut stride = 8;
        while stride > 0 {
            let here = self.at((origins, noise));
            let next = [noise - stride, noise + stride].into_iter().find(|to| self.at((origins, *to)) > here);
            match next {
                Some(next) => noise = next,
                None => stride /= 2,
            }
        }
        (origins, noise)
    }

    /// The posterior mean of the scale of origins and of ln τ; `None` where nothing has any evidence.
    fn mean(mut self) -> Option<Mean> {
        let mut open: Vec<GridPoint> = self.starts.clone().into_iter().map(|start| self.climbed(start)).collect();
        let mut best = open.clone().into_iter().map(|place| self.at(place)).fold(f64::NEG_INFINITY, f64::max);
        let mut counted: HashMap<GridPoint, f64> = HashMap::new();
        // Depth first from the best on: what is found to be negligible later costs little.
        while let Some(place) = open.pop() {
            let evidence = self.at(place);
            best = best.max(evidence);
            if counted.contains_key(&place) || evidence.is_nan() || evidence < best - NEGLIGIBLE {
                continue;
            }
            counted.insert(place, evidence);
            let (origins, noise) = place;
            let mut beside =
                vec![(origins.saturating_sub(1), noise), ((origins + 1).min(ChainPrior::GRID.len() - 1), noise)];
            if self.data.equations > 0.0 {
                beside.extend([(origins, noise - 1), (origins, noise + 1)]);
            }
            open.extend(beside.into_iter().filter(|place| !counted.contains_key(place)));
        }
        if !best.is_finite() {
            return None;
        }
        // In one order, whatever that of a hash map is.
        let mut places: Vec<(GridPoint, f64)> = counted.into_iter().collect();
        places.sort_unstable_by_key(|(place, _)| *place);
        let (mut total, mut sums) = (0.0, [0.0; 2]);
        for ((origins, noise), evidence) in places {
            let weight = exp(evidence - best);
            total += weight;
            sums[0] += weight * ChainPrior::GRID[origins];
            sums[1] += weight * f64::from(noise) * self.step;
        }
        Some(Mean { origins: sums[0] / total, log_noise: sums[1] / total, log_evidence: best + ln(total) })
    }
}
