//! What active selection promises.

use std::sync::Arc;

use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{Case, JOINTS, PARAMETERS, apart, needs_a_covariance, search, takes_the_best_of_a_pool, watch};
use crate::{
    estimation::Belief,
    optimize::{Settings, Variant},
    selection::{Active, Criterion, Minimiser, Selection, SelectionError},
    sensing::MeasurementModel,
};

fn active(case: &Case, minimiser: Minimiser) -> Active {
    Active::new(case.weights.clone(), minimiser)
}

fn by_direct(case: &Case) -> Active {
    active(case, Minimiser::Direct(search(100)))
}

/// The criterion at configurations drawn from the box, in increasing order.
fn drawn_values(case: &Case, count: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let criterion = Criterion::new(&case.belief, &case.weights).expect("a covariance");
    let drawn: Vec<Vec<f64>> = (0..count).map(|_| case.limits().draw(&mut rng)).collect();
    let mut values = criterion.evaluate(&drawn);
    values.sort_by(f64::total_cmp);
    values
}

#[test]
fn direct_chooses_the_best_of_all_that_it_evaluated() {
    let case = Case::new(0.3);
    for variant in [Variant::Original, Variant::LocallyBiased] {
        let settings = Settings { variant, ..search(100) };
        let policy = active(&case, Minimiser::Direct(settings));
        let selection = case.select(&policy).expect("a selection");
        case.check_values(&policy, &selection);
        let search = selection.search.as_ref().expect("searched by DIRECT");
        let partition = search.partition();
        let leaves = &partition.leaves;
        assert_eq!((search.settings(), selection.evaluations), (settings, leaves.len()));
        assert!((50..=100).contains(&leaves.len()), "{}", leaves.len());
        let least = leaves.iter().filter_map(|leaf| leaf.value).fold(f64::INFINITY, f64::min);
        assert_eq!(selection.criterion, Some(least), "{variant:?}");
        let centre = &leaves[partition.chosen].centre;
        assert_eq!(selection.movement.configuration, case.limits().from_unit(centre), "{variant:?}");
        assert_eq!(selection.plan, None);
    }
}

#[test]
fn other_minimisers_choose_the_best_of_what_they_evaluated() {
    let case = Case::new(0.3);
    let values = drawn_values(&case, 400);
    for minimiser in [Minimiser::Random { evaluations: 60 }, Minimiser::Bayesian { evaluations: 25 }] {
        let policy = active(&case, minimiser);
        let selection = case.select(&policy).expect("a selection");
        case.check_values(&policy, &selection);
        assert!(case.limits().contains(&selection.movement.configuration));
        assert!(selection.search.is_none());
        let (Minimiser::Random { evaluations } | Minimiser::Bayesian { evaluations }) = minimiser else {
            unreachable!("neither is DIRECT")
        };
        assert_eq!(selection.evaluations, evaluations);
        // The best of 25 independent draws is among the best half but once in 3·10⁷.
        assert!(selection.criterion.expect("chosen by it") < values[200], "{minimiser:?}");
        assert_eq!(case.select(&policy), Ok(selection), "the same numbers, the same choice");
    }
    let none = active(&case, Minimiser::Random { evaluations: 0 });
    assert_eq!(case.select(&none), Err(SelectionError::NoFiniteCriterion));
}

/// What a selection says of the criterion before and of the gain.
fn before_and_gain(selection: &Selection) -> (f64, f64) {
    let (value, gain) = selection.criterion.zip(selection.gain).expect("chosen by it");
    (value + gain, gain)
}

/// A belief with another deviation of every parameter, so that it matters which of them a movement shows.
fn uneven(first: f64) -> Case {
    Case::of(DVector::from_fn(PARAMETERS, |k, _| first / (1 + k) as f64))
}

#[test]
fn monte_carlo_equals_the_plain_form_of_a_narrow_posterior() {
    let case = uneven(3e-6);
    let [plain, sampled] = [by_direct(&case), by_direct(&case).sampled(16)]
        .map(|policy| before_and_gain(&case.select(&policy).expect("a selection")));
    assert!((sampled.0 / plain.0 - 1.0).abs() < 1e-9, "before any movement they are one");
    assert!((sampled.1 / plain.1 - 1.0).abs() < 1e-4, "{sampled:?} {plain:?}");
}

/// Against the mean over states that are drawn here, as many and others.
#[test]
fn monte_carlo_is_the_mean_over_the_posterior_where_that_is_wide() {
    const SAMPLES: usize = 2000;
    let mut case = uneven(0.6);
    // So noisy that what a movement teaches grows with the levers, squared: more in the mean than at the estimate.
    case.belief.measurement_model = Arc::new(MeasurementModel::tracker(1.0));
    let policy = active(&case, Minimiser::Direct(search(15))).sampled(SAMPLES);
    let selection = case.select(&policy).expect("a selection");
    let (before, gain) = before_and_gain(&selection);
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let deviations = case.belief.covariance.as_ref().expect("kept").diagonal().map(f64::sqrt);
    let gains: Vec<f64> = (0..SAMPLES)
        .map(|_| {
            let delta = deviations.map(|sd| sd * rng.sample::<f64, _>(StandardNormal));
            let state = case.belief.state.retract(&case.belief.layout, &delta);
            let drawn = Belief { state, ..case.belief.clone() };
            let criterion = Criterion::new(&drawn, &case.weights).expect("a covariance");
            before - criterion.evaluate(&[&selection.movement.configuration])[0]
        })
        .collect();
    let mean = gains.iter().sum::<f64>() / SAMPLES as f64;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / SAMPLES as f64;
    // Five standard errors of the difference of two means.
    let tolerance = 5.0 * (2.0 * variance / SAMPLES as f64).sqrt();
    assert!((gain - mean).abs() < tolerance, "{gain} {mean} ± {tolerance}");
    let plain = before - case.value(&policy, &selection.movement.configuration);
    assert!((plain - mean).abs() > tolerance, "{plain} {mean} ± {tolerance}: the estimate alone does not do");
}

#[test]
fn recorded_movements_are_all_tried() {
    let case = Case::new(0.3);
    let policy = by_direct(&case);
    needs_a_covariance(&policy);
    takes_the_best_of_a_pool(&policy, case);
}

#[test]
fn where_a_head_watches_it_begins_where_it_is_seen_and_avoids_what_was_missed() {
    let mut case = Case::new(0.2);
    let policy = by_direct(&case).watched(watch(1.0));
    let first = case.select(&policy).expect("a selection");
    assert_eq!((&first.movement.configuration, first.criterion), (&vec![0.0; JOINTS], None));
    case.moved(&first, true);
    let mut missed: Vec<Vec<f64>> = Vec::new();
    for _ in 0..5 {
        let selection = case.select(&policy).expect("a selection");
        case.check_values(&policy, &selection);
        let pose = &selection.movement.configuration;
        assert!(missed.iter().all(|before| apart(&case.limits(), before, pose) > 0.02));
        missed.push(pose.clone());
        case.moved(&selection, false);
    }
}

/// The naive form believes its prediction: within view it is the plain criterion, outside nothing counts, and a miss teaches
/// it nothing.
#[test]
fn the_naive_form_believes_its_own_prediction() {
    let mut case = Case::new(0.2);
    let watch = watch(1.0);
    let policy = by_direct(&case).watched_naively(watch.clone());
    let first = case.select(&policy).expect("a selection");
    case.moved(&first, true);
    let selection = case.select(&policy).expect("a selection");
    let pose = &selection.movement.configuration;
    assert!(watch.head.expect("a head").sees(&case.belief.state.marker_at(pose)));
    let plain = case.value(&by_direct(&case), pose);
    assert!((selection.criterion.expect("chosen by it") - plain).abs() < 1e-12 * plain);
    let leaves = selection.search.as_ref().expect("searched").partition().leaves;
    for leaf in leaves {
        let marker = case.belief.state.marker_at(&case.limits().from_unit(&leaf.centre));
        assert_eq!(leaf.value.is_some(), watch.head.expect("a head").sees(&marker));
    }
    case.moved(&selection, false);
    assert_eq!(case.select(&policy), Ok(selection));
}

#[test]
fn where_nothing_is_in_view_it_goes_back_to_where_it_is_seen() {
    for naive in [false, true] {
        let mut case = Case::new(0.001);
        let policy = by_direct(&case);
        let policy = if naive { policy.watched_naively(watch(-1.0)) } else { policy.watched(watch(-1.0)) };
        let first = case.select(&policy).expect("a selection");
        case.moved(&first, true);
        let selection = case.select(&policy).expect("a selection");
        assert_eq!((&selection.movement.configuration, selection.criterion), (&vec![0.0; JOINTS], None));
    }
    // A belief that has diverged is no view that is empty.
    let mut case = Case::new(0.3);
    let policy = by_direct(&case).watched(watch(1.0));
    let first = case.select(&policy).expect("a selection");
    case.moved(&first, true);
    case.belief.covariance.as_mut().expect("kept").fill(f64::NAN);
    assert_eq!(case.select(&policy), Err(SelectionError::NoFiniteCriterion));
}
