//! Laws of the statistic.

use std::sync::Arc;

use body_schema_engine::{
    estimation::Belief,
    model::{Block, Layout, Names, random::random_arm},
    sensing::MeasurementModel,
};
use nalgebra::{Cholesky, DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::{
    Body, Settings, Sighting, Watch,
    body::Linear,
    evidence::{Evidence, Turn},
    filter::{Heard, WILD, log_sum, robust},
};

const SIGMA: f64 = 1e-3;
const HAZARD: f64 = 0.02;

/// An arm of three joints, known as well as a calibration knows it.
fn body(rng: &mut ChaCha8Rng) -> Body {
    let state = random_arm(rng, 3);
    let layout = Layout::new(&state, (0..3).map(Block::Axis).chain([Block::Target(0)]));
    let m = layout.dimension();
    let root = DMatrix::from_fn(m, m, |_, _| rng.random_range(-3e-4..3e-4));
    let belief = Belief::new(state, Arc::new(layout), Arc::new(MeasurementModel::tracker(SIGMA)));
    let covariance = &root * root.transpose() + DMatrix::identity(m, m) * 1e-8;
    Body::new(&belief.with_covariance(covariance), Names::default(), 1.0).expect("a covariance")
}

/// A sighting of a robot that is as calibrated but for `delta`.
fn sighting(body: &Body, delta: &DVector<f64>, rng: &mut ChaCha8Rng) -> Linear {
    let posture: Vec<f64> = (0..3).map(|_| rng.random_range(-1.5..1.5)).collect();
    let mut linear = body.prospect(&posture);
    let noise = DVector::from_fn(linear.residual.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
    linear.residual = linear.body.tr_mul(delta) + noise;
    linear
}

fn draw(body: &Body, rng: &mut ChaCha8Rng) -> DVector<f64> {
    let root = Cholesky::new(body.covariance.clone()).expect("positive").l();
    root * DVector::from_fn(body.covariance.nrows(), |_, _| rng.sample::<f64, _>(StandardNormal))
}

/// The sighting's first equation alone, with this residual.
fn first(linear: &Linear, residual: f64) -> Linear {
    Linear {
        residual: DVector::from_element(1, residual),
        body: linear.body.columns(0, 1).into_owned(),
        changes: linear.changes.iter().map(|change| change.columns(0, 1).into_owned()).collect(),
        drift: DMatrix::zeros(0, 1),
    }
}

fn r(evidence: &Evidence) -> f64 {
    evidence.log.exp()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// E₀(Rₙ | what was before) = Rₙ₋₁ + ρ by quadrature, and at most that where no sighting is wild.
    #[test]
    fn the_statistic_less_the_time_is_a_martingale(seed in 0_u64..1_000_000, before in 0_usize..4) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let body = body(&mut rng);
        let delta = draw(&body, &mut rng);
        let mut evidence = Evidence::new(&body, 0.0, false);
        for now in 0..before {
            let linear = sighting(&body, &delta, &mut rng);
            evidence.hear(&body, &first(&linear, linear.residual[0]), now, now as u64 + 1, HAZARD).expect("heard");
        }
        let next = sighting(&body, &delta, &mut rng);
        let now = before as u64 + 1;
        let null = first(&next, 0.0);
        let heard = Heard { linear: &null, posture: None, noise: 1.0 };
        let sd = evidence.nulls()[0].filter.spread(&heard)[(0, 0)].sqrt();
        // Far out in equal steps of a logarithm: wild sightings reach to thousands of deviations.
        let (mut by_null, mut by_normal) = (0.0, 0.0);
        const STEPS: i32 = 6000;
        let at = |k: i32| (f64::from(k) / f64::from(STEPS) * 11.5).sinh() * sd;
        for k in -STEPS..STEPS {
            let (residual, step) = (0.5 * (at(k) + at(k + 1)), at(k + 1) - at(k));
            let linear = first(&next, residual);
            let heard = Heard { linear: &linear, posture: None, noise: 1.0 };
            let predicted = evidence.nulls()[0].filter.predict(&heard).expect("positive");
            let (log, _) = robust(predicted.log_normal(), predicted.log_wild(), WILD);
            let mut after = evidence.clone();
            after.hear(&body, &linear, before, now, HAZARD).expect("heard");
            by_null += log.exp() * r(&after) * step;
            by_normal += predicted.log_normal().exp() * r(&after) * step;
        }
        let wanted = r(&evidence) + HAZARD;
        prop_assert!((by_null / wanted - 1.0).abs() < 2e-3, "{by_null} instead of {wanted}");
        prop_assert!(by_normal < wanted * 1.002, "{by_normal} above {wanted}");
    }

    /// Kalman's recursion gives the ratio of the marginals that whole covariances give, and the order of sightings after the change does
    /// not matter.
    #[test]
    fn a_likelihood_ratio_is_that_of_the_marginals(seed in 0_u64..1_000_000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let body = body(&mut rng);
        let delta = draw(&body, &mut rng);
        let mut all: Vec<Linear> = (0..5).map(|_| sighting(&body, &delta, &mut rng)).collect();
        // What hardly anybody takes for wild.
        all.iter_mut().for_each(|linear| linear.residual *= 0.5);
        const SINCE: usize = 2;
        let ratios = |order: &[usize]| {
            let mut evidence = Evidence::new(&body, 0.0, false);
            for (now, index) in order.iter().enumerate() {
                let hazard = if now == SINCE { 1.0 } else { 0.0 };
                evidence.hear(&body, &all[*index], *index, now as u64 + 1, hazard).expect("heard");
            }
            let of = |index: usize| {
                let found = evidence.alternatives().iter().find(|it| it.turn == Turn::Change(index));
                found.map(|it| it.log - body.changes[index].log_prior)
            };
            (0..body.changes.len()).map(|index| of(index).expect("kept")).collect::<Vec<f64>>()
        };
        let (found, turned) = (ratios(&[0, 1, 2, 3, 4]), ratios(&[0, 1, 4, 2, 3]));
        let (m, d) = (body.covariance.nrows(), 3);
        let mut h = DMatrix::zeros(5 * d, m);
        let mut r = DVector::zeros(5 * d);
        for (index, linear) in all.iter().enumerate() {
            h.view_mut((index * d, 0), (d, m)).copy_from(&linear.body.transpose());
            r.rows_mut(index * d, d).copy_from(&linear.residual);
        }
        let none = &h * &body.covariance * h.transpose() + DMatrix::identity(5 * d, 5 * d);
        let log = |spread: &DMatrix<f64>| {
            let factor = Cholesky::new(spread.clone()).expect("positive");
            -factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>() - 0.5 * r.dot(&factor.solve(&r))
        };
        // What has no numbers is more often wild instead.
        for (index, change) in body.changes.iter().enumerate().filter(|(_, change)| !change.units.is_empty()) {
            let mut g = DMatrix::zeros(5 * d, change.units.len());
            for (at, linear) in all.iter().enumerate().skip(SINCE) {
                g.view_mut((at * d, 0), (d, change.units.len())).copy_from(&linear.changes[index].transpose());
            }
            let prior = DMatrix::from_diagonal(&change.deviations.component_mul(&change.deviations));
            let wanted = log(&(&none + &g * prior * g.transpose())) - log(&none);
            // Every sighting may be wild, a little.
            let near = 0.05 + 0.02 * wanted.abs();
            prop_assert!((found[index] - wanted).abs() < near, "{}: {} instead of {wanted}", index, found[index]);
            prop_assert!((found[index] - turned[index]).abs() < near, "{index}: {} and {}", found[index], turned[index]);
        }
    }

    /// To drop alternatives only lowers the statistic, then and ever after.
    #[test]
    fn what_is_dropped_only_lowers(seed in 0_u64..1_000_000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let body = body(&mut rng);
        let delta = draw(&body, &mut rng);
        let mut whole = Evidence::new(&body, 0.0, false);
        let mut fewer = whole.clone();
        for now in 1..8_u64 {
            let linear = sighting(&body, &delta, &mut rng);
            whole.hear(&body, &linear, now as usize, now, HAZARD).expect("heard");
            fewer.hear(&body, &linear, now as usize, now, HAZARD).expect("heard");
            fewer.forget(|_| rng.random_bool(0.3));
            let sum = log_sum(fewer.alternatives().iter().map(|it| it.log));
            prop_assert!(sum <= whole.log + 1e-9);
        }
    }
}

/// Sightings at postures of which none is repeated are judged alike whatever they might share, but for the weight of what is a little
/// wild.
#[test]
fn without_repeats_shares_make_no_difference() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let body = body(&mut rng);
    let delta = draw(&body, &mut rng);
    let mut evidence = [0.0, 0.5, 0.8].map(|share| Evidence::new(&body, share, false));
    for now in 1..40_u64 {
        let linear = sighting(&body, &delta, &mut rng);
        evidence.iter_mut().for_each(|it| assert!(it.hear(&body, &linear, now as usize, now, HAZARD).is_some()));
        let logs = evidence.each_ref().map(|it| it.log);
        assert!(logs.iter().all(|log| (log - logs[0]).abs() < 1e-3), "{logs:?}");
    }
}

/// No more false alarms than were asked for, over 300 years of four robots, and with any gaps between sightings.
#[test]
fn false_alarms_are_as_rare_as_was_asked() {
    const RATE: f64 = 1.0;
    let (mut alarms, mut years) = (0, 0.0);
    for seed in 0..4 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let body = body(&mut rng);
        let truth = body.state.retract(&body.learned, &draw(&body, &mut rng));
        let settings = Settings { false_alarms_per_year: RATE, shares: vec![0.0], covariate: None };
        let mut watch = Watch::new(body, settings).expect("settings");
        for _ in 0..750 {
            let posture: Vec<f64> = (0..3).map(|_| rng.random_range(-1.5..1.5)).collect();
            let noise: Vec<f64> = (0..3).map(|_| rng.sample(StandardNormal)).collect();
            let seen = watch.body().measurement_model.observe(&truth, &posture, &noise);
            let elapsed_years = 0.1 * -rng.random_range(0.0_f64..1.0).max(1e-9).ln();
            let sighting = Sighting { elapsed_years, positions: &posture, observation: &seen, covariate: None };
            let heard = watch.hear(&sighting).expect("seen");
            alarms += u32::from(heard.event.is_some_and(|event| event.kind == crate::Kind::Alarm));
            years += elapsed_years;
        }
    }
    // 300 are expected at most; the Poisson's upper 95 % limit.
    assert!(years > 250.0 && f64::from(alarms) < RATE * years + 1.645 * (RATE * years).sqrt(), "{alarms} in {years}");
}
