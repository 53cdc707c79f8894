//! How large errors of a description are, told by the evidence of measurements.
//!
//! The prior [along a chain](ChainPrior) has a scale s_o of its origins and one, s_z, of its zeros; where σ is unknown it has a scale,
//! too. While there are few measurements more than parameters, small errors with large noise explain them as well as large errors with
//! hardly any, and whoever settles for one of these is wrong by as much. So all three are taken together, with what all of them
//! make of the measurements where they were linearised (Laplace's approximation, with G = Σ w HᵀH and g = Σ w Hᵀ(y − h) at δ = 0 in
//! the chart at the guess, c = Σ w ‖y − h‖² there, N = Σ w d, all in the noise as it was, and β = 1/τ² its precision from now on):
//!
//! ```text
//! 2 ln p(y | s, τ) = N ln β − ln det P₀(s) − ln det Λ − β c + β² gᵀΛ⁻¹g,      Λ = β G + P₀(s)⁻¹
//! ```
//!
//! and a weak prior of each: a spike and a slab of the scales, and of σ a normal distribution of ln σ around half of what is nominal.
//! The three are looked at on a lattice, from some of its places on as far as there is evidence (MacKay, "Bayesian interpolation",
//! 1992, maximises it; with so few equations that lets σ collapse). What is taken is the posterior mean of s_o, of s_z and of ln τ.
//! So a description that is right stays right, and one that is wrong by more than was stated is learned as if that had been said.

use std::{collections::HashMap, sync::Arc};

use nalgebra::{DMatrix, DVector};

use super::{Smoother, factor::Factor, mode::Mode, posterior::Posterior};
use crate::model::{ChainPrior, Layout};

/// A prior along a chain, and the scales that it has now.
#[derive(Clone, Debug)]
pub(super) struct Scaled {
    chain: Arc<ChainPrior>,
    scales: [f64; 2],
}

/// How often scales are found where the mode is that the last ones led to, at most.
const ROUNDS: usize = 3;
/// Scales that change by less than this have been found.
const FOUND: f64 = 0.02;
/// What is known of noise that is not: σ is half of what its maker promises, give or take a factor of e.
const LIKELY_SIGMA: f64 = 0.5;
const SIGMA_SPREAD: f64 = 1.0;
/// Places on the lattice of less evidence than this (its logarithm, below the best) do not count.
const NEGLIGIBLE: f64 = 5.0;
/// Steps of ln τ on the lattice, and how far it reaches to each side.
const STEPS: (f64, f64) = (0.04, 0.4);
const REACH: f64 = 8.0;

impl Smoother {
    /// The same with a prior along a chain, whose scales are learned. Its covariance at scales of 1 is that of the prior.
    pub fn with_chain(mut self, chain: Arc<ChainPrior>) -> Self {
        self.scaled = Some(Scaled { chain, scales: [1.0; 2] });
        self
    }

    /// The scales of origins and zeros, where they are learned.
    pub fn scales(&self) -> Option<[f64; 2]> {
        self.scaled.as_ref().map(|scaled| scaled.scales)
    }

    /// Learns the scales at the heaviest mode, and follows the modes to where they are with these.
    pub(super) fn learn_scales(&mut self) {
        let layout = self.belief.layout.clone();
        for _ in 0..ROUNDS {
            let (Some(scaled), Some(mode)) = (&self.scaled, self.hypotheses.modes.first()) else { return };
            let chain = scaled.chain.clone();
            let Some(data) = Data::of(&self.posterior, &self.unknown, mode, &layout) else { return };
            let Some(found) = Lattice::new(&chain, &data, scaled.scales).mean() else { return };
            let prior = self.posterior.prior.with_covariance(&layout, chain.covariance(found.scales));
            let Ok(prior) = prior else { return };
            let change = found.scales.iter().zip(scaled.scales).map(|(a, b)| (a / b).ln().abs());
            let change = change.fold(found.log_noise.abs(), f64::max);
            self.posterior.prior = prior;
            self.scaled = Some(Scaled { chain, scales: found.scales });
            for (scale, _) in self.posterior.scales.iter_mut().zip(&self.unknown).filter(|(_, unknown)| **unknown) {
                *scale *= found.log_noise.exp();
            }
            self.hypotheses.follow(&self.posterior, &layout);
            self.hypotheses.condense(self.settings.kept, &layout);
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
    /// N, of noise that is not known; 0 where all is.
    equations: f64,
    /// By kind of unknown noise: ln of its scale in what is likely.
    sigmas: Vec<f64>,
}

impl Data {
    /// `None` outside the charts.
    fn of(posterior: &Posterior, unknown: &[bool], mode: &Mode, layout: &Layout) -> Option<Self> {
        let state = &mode.state;
        let m = layout.dimension();
        let (mut of_prior, mut pull) = (DMatrix::zeros(m, m), DVector::zeros(m));
        posterior.prior.cost(state, Some((&mut of_prior, &mut pull)));
        let (information, vector) = (&mode.information - of_prior, &mode.descent - pull);
        let fits = posterior.fit(state, layout);
        let squares: f64 = fits.iter().zip(&posterior.scales).map(|(fit, scale)| fit.squared / (scale * scale)).sum();
        let seen: Vec<usize> = (0..fits.len()).filter(|noise| unknown[*noise] && fits[*noise].equations > 0.0).collect();
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
            sigmas: seen.iter().map(|noise| (posterior.scales[*noise] / LIKELY_SIGMA).ln()).collect(),
        };
        (data.squares.is_finite() && data.information.iter().all(|x| x.is_finite())).then_some(data)
    }
}

/// A place: scales of origins and of zeros on the chain's grid, and steps of ln τ.
type Place = (usize, usize, i32);

/// What the evidence makes of the three scales.
struct Found {
    scales: [f64; 2],
    /// ln τ.
    log_noise: f64,
}

/// Evidence by place, as far as it has been looked at.
struct Lattice<'a> {
    chain: &'a ChainPrior,
    data: &'a Data,
    probabilities: [Vec<f64>; 2],
    /// Of ln τ.
    step: f64,
    known: HashMap<Place, f64>,
    starts: Vec<Place>,
}

impl<'a> Lattice<'a> {
    fn new(chain: &'a ChainPrior, data: &'a Data, scales: [f64; 2]) -> Self {
        let nearest = |kind: usize| {
            let apart = |index: &usize| (ChainPrior::GRID[kind][*index] / scales[kind]).ln().abs();
            (0..ChainPrior::GRID[kind].len()).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
        };
        let probabilities = chain.log_probabilities();
        let of_zeros = if probabilities[1][1].is_finite() { nearest(1) } else { 0 };
        let middle = |kind: usize| ChainPrior::GRID[kind].iter().position(|scale| *scale >= 1.0).unwrap_or(0);
        let starts = vec![(nearest(0), of_zeros, 0), (0, 0, 0), (middle(0), 0, 0)];
        let step = (2.0 / data.equations.max(1.0).sqrt()).clamp(STEPS.0, STEPS.1);
        Self { chain, data, probabilities, step, known: HashMap::new(), starts }
    }

    /// The logarithm of the evidence at a place, with that of its prior; but for what all places have in common.
    fn at(&mut self, place: Place) -> f64 {
        if let Some(known) = self.known.get(&place) {
            return *known;
        }
        let found = self.evidence(place).filter(|evidence| evidence.is_finite()).unwrap_or(f64::NEG_INFINITY);
        self.known.insert(place, found);
        found
    }

    fn evidence(&self, (origins, zeros, noise): Place) -> Option<f64> {
        let log_noise = f64::from(noise) * self.step;
        let probability = self.probabilities[0][origins] + self.probabilities[1][zeros];
        if log_noise.abs() > REACH || probability == f64::NEG_INFINITY {
            return None;
        }
        let prior = self.chain.inverted([origins, zeros])?;
        let beta = (-2.0 * log_noise).exp();
        let lambda = &self.data.information * beta + &prior.information;
        let factor = Factor::new(self.data.level, &lambda, 0.0)?;
        let explained = beta * self.data.vector.dot(&factor.solve(&self.data.vector));
        let fit = beta * (self.data.squares - explained);
        let log_likelihood = -self.data.equations * log_noise
            - 0.5 * (prior.log_determinant + factor.log_determinant() + fit);
        let sigma = |log: &f64| -0.5 * ((log + log_noise) / SIGMA_SPREAD).powi(2);
        Some(log_likelihood + probability + self.data.sigmas.iter().map(sigma).sum::<f64>())
    }

    /// The best place at these scales, wherever τ is.
    fn climbed(&mut self, (origins, zeros, mut noise): Place) -> Place {
        if self.data.equations == 0.0 {
            return (origins, zeros, noise);
        }
        let mut stride = 8;
        while stride > 0 {
            let here = self.at((origins, zeros, noise));
            let next = [noise - stride, noise + stride].into_iter().find(|to| self.at((origins, zeros, *to)) > here);
            match next {
                Some(next) => noise = next,
                None => stride /= 2,
            }
        }
        (origins, zeros, noise)
    }

    /// The posterior mean of the scales and of ln τ; `None` where nothing has any evidence.
    fn mean(mut self) -> Option<Found> {
        let mut open: Vec<Place> = self.starts.clone().into_iter().map(|start| self.climbed(start)).collect();
        let mut best = open.clone().into_iter().map(|place| self.at(place)).fold(f64::NEG_INFINITY, f64::max);
        let mut counted: HashMap<Place, f64> = HashMap::new();
        // Depth first from the best on: what is found to be negligible later costs little.
        while let Some(place) = open.pop() {
            let evidence = self.at(place);
            best = best.max(evidence);
            if counted.contains_key(&place) || evidence.is_nan() || evidence < best - NEGLIGIBLE {
                continue;
            }
            counted.insert(place, evidence);
            let (origins, zeros, noise) = place;
            let last = [ChainPrior::GRID[0].len() - 1, ChainPrior::GRID[1].len() - 1];
            let mut beside = vec![(origins.saturating_sub(1), zeros, noise), (origins, zeros.saturating_sub(1), noise)];
            beside.push(((origins + 1).min(last[0]), zeros, noise));
            beside.push((origins, (zeros + 1).min(last[1]), noise));
            if self.data.equations > 0.0 {
                beside.extend([(origins, zeros, noise - 1), (origins, zeros, noise + 1)]);
            }
            open.extend(beside.into_iter().filter(|place| !counted.contains_key(place)));
        }
        if !best.is_finite() {
            return None;
        }
        // In one order, whatever that of a hash map is.
        let mut places: Vec<(Place, f64)> = counted.into_iter().collect();
        places.sort_unstable_by_key(|(place, _)| *place);
        let (mut total, mut sums) = (0.0, [0.0; 3]);
        for ((origins, zeros, noise), evidence) in places {
            let weight = (evidence - best).exp();
            total += weight;
            sums[0] += weight * ChainPrior::GRID[0][origins];
            sums[1] += weight * ChainPrior::GRID[1][zeros];
            sums[2] += weight * f64::from(noise) * self.step;
        }
        Some(Found { scales: [sums[0] / total, sums[1] / total], log_noise: sums[2] / total })
    }
}
