//! DIRECT and DIRECT-l against published figures, against NLopt, and against the laws they should obey.

use std::collections::HashSet;

use body_schema::optimize::{Direct, DirectError, MAX_LEVEL, Minimum, Rectangle, Settings, Variant, minimize};

mod problems;

use problems::{PROBLEMS, branin, goldstein_price, shubert};

const VARIANTS: [Variant; 2] = [Variant::Original, Variant::LocallyBiased];

fn search(dimension: usize, variant: Variant, max_evaluations: usize) -> Direct {
    Direct::new(dimension, Settings { variant, max_evaluations, ..Settings::default() }).expect("valid settings")
}

/// One round of ask and tell: the points asked, or `None` at the end.
fn step(direct: &mut Direct, objective: impl Fn(&[f64]) -> f64) -> Option<Vec<Vec<f64>>> {
    let batch = direct.ask()?;
    let values: Vec<f64> = batch.iter().map(objective).collect();
    let points = batch.iter().map(<[f64]>::to_vec).collect();
    direct.tell(&values).expect("as many values as points");
    Some(points)
}

fn sampled_points(mut direct: Direct, objective: impl Fn(&[f64]) -> f64) -> Vec<Vec<f64>> {
    std::iter::from_fn(|| step(&mut direct, &objective)).flatten().collect()
}

#[test]
fn needs_the_published_number_of_evaluations_in_every_order_of_the_coordinates() {
    for problem in &PROBLEMS {
        let target = problem.minimum + 1e-4 * problem.minimum.abs();
        for order in problem.orders {
            let counts = VARIANTS.map(|variant| {
                let mut direct = search(order.len(), variant, 10_000);
                while direct.best().is_none_or(|(_, value)| value >= target) {
                    step(&mut direct, problem.over_the_cube(order)).expect("found within the budget");
                }
                direct.evaluations()
            });
            assert_eq!(counts, problem.published, "{} {order:?}", problem.name);
        }
    }
}

#[test]
fn follows_the_known_trace_of_shekel_5() {
    const TRACE: [(usize, f64); 12] = [
        (9, -0.575_351_409_4),
        (43, -0.698_927_235_0),
        (51, -1.051_985_421_3),
        (57, -6.840_467_619_2),
        (81, -7.438_312_001_1),
        (91, -8.152_490_200_9),
        (99, -9.018_087_108_0),
        (103, -10.093_448_596_6),
        (129, -10.108_236_875_5),
        (143, -10.123_071_806_7),
        (151, -10.137_686_594_0),
        (155, -10.152_349_837_3),
    ];
    let problem = &PROBLEMS[1];
    let mut direct = search(4, Variant::Original, 155);
    let mut trace: Vec<(usize, f64)> = Vec::new();
    while step(&mut direct, problem.over_the_cube(&[0, 1, 2, 3])).is_some() {
        let (_, best) = direct.best().expect("finite everywhere");
        if direct.iterations() > 0 && trace.last().is_none_or(|&(_, last)| best < last) {
            trace.push((direct.evaluations(), best));
        }
    }
    assert_eq!(trace.len(), TRACE.len(), "{trace:?}");
    for ((evaluations, best), (expected_evaluations, expected_best)) in trace.into_iter().zip(TRACE) {
        assert_eq!(evaluations, expected_evaluations);
        assert!((best - expected_best).abs() < 1e-9, "{best} after {evaluations}");
    }
}

#[test]
fn never_exceeds_the_budget_and_a_smaller_budget_gives_a_prefix() {
    let problem = &PROBLEMS[5];
    for variant in VARIANTS {
        let all = sampled_points(search(6, variant, 400), problem.over_the_cube(&[0, 1, 2, 3, 4, 5]));
        for budget in 1..=120 {
            let some = sampled_points(search(6, variant, budget), problem.over_the_cube(&[0, 1, 2, 3, 4, 5]));
            assert!(some.len() <= budget && budget - some.len() < 12, "{} of {budget}", some.len());
            assert_eq!(some, all[..some.len()]);
        }
    }
}

#[test]
fn a_budget_too_small_for_the_first_division_evaluates_the_centre_only() {
    for (budget, expected) in [(1, 1), (6, 1), (7, 7), (8, 7)] {
        let mut direct = search(3, Variant::Original, budget);
        while step(&mut direct, |x| x[0] + x[1]).is_some() {}
        assert_eq!((direct.evaluations(), direct.iterations()), (expected, usize::from(expected > 1)));
        assert!(direct.is_finished() && direct.ask().is_none());
    }
}

#[test]
fn the_rectangles_fill_the_cube_without_overlap() {
    for variant in VARIANTS {
        let mut direct = search(3, variant, 400);
        while step(&mut direct, |x| goldstein_price(x) + (x[2] - 0.2).powi(2)).is_some() {
            let partition = direct.partition();
            assert_eq!(partition.len(), direct.evaluations());
            let volume: f64 = partition.iter().map(|rectangle| rectangle.volume()).sum();
            assert!((volume - 1.0).abs() < 1e-12, "{volume}");
        }
        let rectangles: Vec<_> = direct.partition().iter().collect();
        for (index, a) in rectangles.iter().enumerate() {
            assert!(rectangles[..index].iter().all(|b| disjoint(a, b)));
            let (low, high) = (a.levels.iter().min(), a.levels.iter().max());
            assert!(low.zip(high).is_some_and(|(low, high)| high - low <= 1));
            assert!(a.centre.iter().zip(a.half_sides()).all(|(c, half)| c - half > -1e-12 && c + half < 1.0 + 1e-12));
        }
    }
}

/// Whether two rectangles share no more than a face, up to rounding.
fn disjoint(a: &Rectangle, b: &Rectangle) -> bool {
    let gap = |k: usize| {
        let halves = a.half_sides().nth(k).zip(b.half_sides().nth(k)).map_or(0.0, |(a, b)| a + b);
        (a.centre[k] - b.centre[k]).abs() - halves
    };
    (0..a.centre.len()).any(|k| gap(k) > -1e-12)
}

#[test]
fn generations_tell_when_a_rectangle_took_its_shape() {
    let mut direct = search(2, Variant::LocallyBiased, 200);
    let mut before: Vec<(Vec<u8>, usize)> = Vec::new();
    while step(&mut direct, PROBLEMS[0].over_the_cube(&[0, 1])).is_some() {
        let partition = direct.partition();
        for (index, rectangle) in partition.iter().enumerate() {
            match before.get(index) {
                Some((levels, generation)) if levels == rectangle.levels => {
                    assert_eq!(rectangle.generation, *generation);
                }
                _ => assert_eq!(rectangle.generation, direct.iterations()),
            }
        }
        before = partition.iter().map(|rectangle| (rectangle.levels.to_vec(), rectangle.generation)).collect();
    }
}

/// Whether a rate of change exists for which a rectangle could hold the minimum: the definition, taken literally.
fn potentially_optimal(j: &Rectangle, all: &[Rectangle], epsilon: f64) -> bool {
    let value = |rectangle: &Rectangle| rectangle.score.expect("feasible points are known");
    let best = all.iter().filter_map(|rectangle| rectangle.value).fold(f64::INFINITY, f64::min);
    let (mut low, mut high) = (0.0, f64::INFINITY);
    for i in all {
        let rate = (value(i) - value(j)) / (i.size - j.size);
        if i.size < j.size {
            low = f64::max(low, rate);
        } else if i.size > j.size {
            high = f64::min(high, rate);
        } else if value(i) < value(j) {
            return false;
        }
    }
    low <= high && high > 0.0 && value(j) - high * j.size <= best - epsilon * best.abs()
}

#[test]
fn chooses_by_the_definition_of_potential_optimality() {
    for problem in [&PROBLEMS[0], &PROBLEMS[4]] {
        for variant in VARIANTS {
            let order: Vec<usize> = (0..problem.domain.len()).collect();
            let mut direct = search(order.len(), variant, 600);
            while step(&mut direct, problem.over_the_cube(&order)).is_some() {
                let all: Vec<_> = direct.partition().iter().collect();
                let expected: HashSet<usize> =
                    (0..all.len()).filter(|&index| potentially_optimal(&all[index], &all, 1e-4)).collect();
                let chosen: HashSet<usize> = direct.potentially_optimal().iter().copied().collect();
                let flagged: HashSet<usize> = (0..all.len()).filter(|&index| all[index].potentially_optimal).collect();
                assert_eq!(chosen, flagged);
                match variant {
                    Variant::Original => assert_eq!(chosen, expected),
                    Variant::LocallyBiased => {
                        assert!(chosen.is_subset(&expected));
                        let sizes = |set: &HashSet<usize>| {
                            set.iter().map(|&index| all[index].size.to_bits()).collect::<HashSet<_>>()
                        };
                        assert_eq!(sizes(&chosen), sizes(&expected));
                        assert_eq!(sizes(&chosen).len(), chosen.len());
                    }
                }
            }
        }
    }
}

#[test]
fn the_hull_describes_the_partition_it_is_read_with() {
    let mut direct = search(2, Variant::Original, 300);
    while step(&mut direct, PROBLEMS[0].over_the_cube(&[0, 1])).is_some() {
        let partition = direct.partition();
        for point in direct.hull() {
            let rectangle = partition.get(point.rectangle).expect("a rectangle of the partition");
            assert_eq!((point.size, Some(point.value)), (rectangle.size, rectangle.score));
            assert_eq!(point.potentially_optimal, rectangle.potentially_optimal);
        }
        assert!(direct.hull().is_sorted_by(|a, b| a.size > b.size && a.value > b.value));
    }
}

/// A bowl around (0.8, 0.3), cut off where x + y > 0.9: the minimum, 0.02, lies on the border.
fn cut_bowl(x: &[f64]) -> f64 {
    if x[0] + x[1] > 0.9 { f64::NAN } else { (x[0] - 0.8).powi(2) + (x[1] - 0.3).powi(2) }
}

#[test]
fn converges_to_a_minimum_on_the_border_of_a_hidden_constraint() {
    for variant in VARIANTS {
        let settings = Settings { variant, max_evaluations: 2_000, ..Settings::default() };
        let Minimum { point, value, .. } = minimize(2, settings, cut_bowl).unwrap().expect("a feasible point");
        assert!(value - 0.02 < 1e-4, "{variant:?}: {value}");
        assert!((point[0] - 0.7).abs() < 0.01 && (point[1] - 0.2).abs() < 0.01, "{variant:?}: {point:?}");
    }
}

#[test]
fn finds_a_small_feasible_region_off_the_centre() {
    let objective = |x: &[f64]| {
        let distance = (x[0] - 0.15).hypot(x[1] - 0.23);
        if distance < 0.08 { distance } else { f64::INFINITY }
    };
    for variant in VARIANTS {
        let settings = Settings { variant, max_evaluations: 500, ..Settings::default() };
        let found = minimize(2, settings, objective).unwrap().expect("a feasible point");
        assert!(found.value < 1e-3, "{variant:?}: {found:?}");
    }
}

#[test]
fn surrogates_are_those_of_the_doubled_rectangle() {
    let feasible = |x: &[f64]| (x[0] - 0.5).powi(2) + (x[1] - 0.4).powi(2) < 0.12 && x[2] < 0.8;
    let objective = |x: &[f64]| if feasible(x) { shubert(x) + x[2] } else { f64::NAN };
    for variant in VARIANTS {
        let mut direct = search(3, variant, 600);
        while step(&mut direct, objective).is_some() {
            let all: Vec<_> = direct.partition().iter().collect();
            let values = || all.iter().filter_map(|rectangle| Some((rectangle, rectangle.value?)));
            let worst = values().map(|(_, value)| value).fold(f64::NEG_INFINITY, f64::max);
            for infeasible in all.iter().filter(|rectangle| rectangle.value.is_none()) {
                let near = |other: &Rectangle| {
                    let pairs = other.centre.iter().zip(infeasible.centre).zip(infeasible.half_sides());
                    pairs.into_iter().all(|((a, b), half)| (a - b).abs() < 2.0 * half + 1e-9)
                };
                let least = values().filter(|(other, _)| near(other)).map(|(_, value)| value).min_by(f64::total_cmp);
                let expected = least.map_or(worst + 1.0, |least| least + 1e-6 * least.abs());
                assert_eq!(infeasible.score, worst.is_finite().then_some(expected));
            }
        }
        assert!(direct.partition().iter().filter(|rectangle| rectangle.value.is_none()).count() > 20);
    }
}

#[test]
fn with_nothing_feasible_it_ends_at_the_budget_and_has_no_best() {
    for variant in VARIANTS {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut direct = search(3, variant, 201);
            while step(&mut direct, |_| value).is_some() {}
            assert!(direct.evaluations() > 195 && direct.evaluations() <= 201);
            assert_eq!(direct.best(), None);
            assert!(direct.hull().is_empty());
            assert!(direct.partition().iter().all(|rectangle| rectangle.score.is_none()));
        }
        assert_eq!(minimize(2, Settings { variant, ..Settings::default() }, |_| f64::NAN), Ok(None));
    }
}

#[test]
fn extreme_values_do_no_harm() {
    let objectives: [fn(&[f64]) -> f64; 4] = [
        |x| if x[0] < 0.3 { f64::MAX } else { f64::MIN * x[1] },
        |x| if x[0] < x[1] { -0.0 } else { 0.0 },
        |x| if x[0] > 0.6 { f64::NAN } else { f64::MAX },
        |x| 1e-320 * x[0],
    ];
    for variant in VARIANTS {
        for objective in objectives {
            let found = minimize(2, Settings { variant, ..Settings::default() }, objective).unwrap();
            assert!(found.is_some_and(|found| found.value.is_finite() && found.evaluations > 900));
        }
    }
}

#[test]
fn rectangles_at_the_depth_limit_are_left_alone() {
    // With ε = 0 and a minimum of zero nothing else keeps the search from dividing the best rectangle for ever.
    for variant in VARIANTS {
        let settings = Settings { variant, epsilon: 0.0, max_evaluations: 3_000, ..Settings::default() };
        let mut direct = Direct::new(1, settings).unwrap();
        let mut seen = HashSet::new();
        while let Some(points) = step(&mut direct, |x| (x[0] - 0.3).abs()) {
            assert!(points.iter().all(|point| seen.insert(point[0].to_bits())), "a point asked twice");
        }
        let deepest = direct.partition().iter().map(|rectangle| rectangle.levels[0]).max();
        assert_eq!(deepest, Some(MAX_LEVEL));
        assert!(direct.partition().iter().all(|r| !(r.potentially_optimal && r.levels[0] == MAX_LEVEL)));
        assert_eq!(direct.evaluations(), 2_999);
    }
}

#[test]
fn misuse_is_an_error_and_leaves_the_search_as_it_was() {
    let settings = Settings::default();
    assert_eq!(Direct::new(0, settings).err(), Some(DirectError::NoDimension));
    let no_budget = Settings { max_evaluations: 0, ..settings };
    assert_eq!(Direct::new(2, no_budget).err(), Some(DirectError::NoEvaluations));
    for epsilon in [-1e-4, f64::INFINITY] {
        assert_eq!(Direct::new(2, Settings { epsilon, ..settings }).err(), Some(DirectError::Epsilon(epsilon)));
    }
    assert!(Direct::new(2, Settings { epsilon: f64::NAN, ..settings }).is_err());

    let mut direct = search(2, Variant::Original, 50);
    assert_eq!(direct.tell(&[1.0]), Err(DirectError::NotAsked));
    assert!(direct.partition().is_empty() && direct.partition().get(0).is_none() && direct.best().is_none());
    assert_eq!(direct.ask().map(|batch| batch.len()), Some(1));
    assert_eq!(direct.tell(&[]), Err(DirectError::ValueCount { asked: 1, told: 0 }));
    assert_eq!(direct.tell(&[1.0, 2.0]), Err(DirectError::ValueCount { asked: 1, told: 2 }));
    assert_eq!(direct.tell(&[1.0]), Ok(()));
    assert_eq!(direct.tell(&[1.0]), Err(DirectError::NotAsked));
    assert_eq!((direct.evaluations(), direct.iterations()), (1, 0));
    while step(&mut direct, branin).is_some() {}
    assert_eq!(direct.tell(&[]), Err(DirectError::NotAsked));
}

#[test]
fn asking_again_returns_the_same_points() {
    let mut direct = search(2, Variant::Original, 50);
    step(&mut direct, branin);
    let once: Vec<Vec<f64>> = direct.ask().into_iter().flatten().map(<[f64]>::to_vec).collect();
    let twice: Vec<Vec<f64>> = direct.ask().into_iter().flatten().map(<[f64]>::to_vec).collect();
    assert_eq!(once.len(), 4);
    assert_eq!(once, twice);
}

/// Where nothing ties, the order changes what the last iteration leaves undivided, and nothing else.
#[test]
fn the_smallest_may_come_first() {
    let objective = |x: &[f64]| {
        let apart = x.iter().enumerate().map(|(i, x)| (x - 0.31 - 0.083 * i as f64).powi(2) * (1.0 + 0.37 * i as f64));
        1.0 + apart.sum::<f64>() + 0.01 * (17.0 * x[0]).sin()
    };
    let settings = Settings { variant: Variant::LocallyBiased, max_evaluations: 400, ..Settings::default() };
    let mut largest = Direct::new(5, settings).unwrap();
    let mut smallest = Direct::new(5, Settings { smallest_first: true, ..settings }).unwrap();
    let sorted = |points: Vec<Vec<f64>>| {
        let mut points: Vec<Vec<u64>> = points.iter().map(|x| x.iter().map(|x| x.to_bits()).collect()).collect();
        points.sort();
        points
    };
    let mut iterations = 0;
    loop {
        assert_eq!(largest.potentially_optimal().len(), smallest.potentially_optimal().len());
        let [a, b] = [&mut largest, &mut smallest].map(|direct| step(direct, objective));
        let (Some(a), Some(b)) = (a, b) else { break };
        let is_cut_short = largest.is_finished() || smallest.is_finished();
        assert!(is_cut_short || sorted(a) == sorted(b));
        iterations += 1;
    }
    assert!(iterations > 10);
    let [a, b] = [&largest, &smallest].map(|direct| direct.best().expect("feasible").1);
    assert!(b <= a, "{b} {a}");
}
