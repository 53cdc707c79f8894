//! What holds of every robot.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::{
    model::{Block, Names, random::random_arm},
    sensing::{MeasurementModel, Position, Sensor},
};

/// An arm of which the axes and the marker are learned, and more where `blocks` says so.
fn prospect(seed: u64, blocks: &[Block]) -> Prospect {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let state = random_arm(&mut rng, 4);
    let learned = (0..4).map(Block::Axis).chain([Block::Target(0)]).chain(blocks.iter().copied());
    let layout = Layout::new(&state, learned);
    let limits = JointBox::new((0..4).map(|_| (-rng.random_range(0.8..2.0), 1.5)).collect()).expect("limits");
    Prospect {
        deviations: DVector::from_element(layout.dimension(), 0.05),
        known: DMatrix::identity(layout.dimension(), layout.dimension()),
        measurement_model: Arc::new(MeasurementModel::tracker(0.001)),
        actions: Actions::Box(limits.clone()),
        constraints: None,
        watch: None,
        units: CriterionUnits::Prior,
        search: Settings { max_evaluations: 60, ..Settings::default() },
        planning: Planning { optimality: crate::selection::Optimality::I, ..Planning::default() },
        up_to_motion: false,
        layout: Arc::new(layout),
        limits,
        state,
    }
}

fn found(prospect: &Prospect, postures: usize) -> Observability {
    prospect.observability(postures, 1e-3, &|| {}).expect("movements")
}

/// What no movement determines, in words.
fn undetermined(prospect: &Prospect, found: &Observability) -> Vec<String> {
    let names = Names { joints: ["a", "b", "c", "d"].map(str::to_owned).to_vec(), ..Names::default() };
    names.undetermined(&prospect.state, &prospect.layout, &found.undetermined, "any movement")
}

/// A base beside axes that are all free moves with them: six directions that nothing tells, and they are named.
#[test]
fn a_gauge_is_counted_and_named() {
    let (whole, with_base) = (prospect(1, &[]), prospect(1, &[Block::Base]));
    let (of_whole, of_both) = (found(&whole, 3), found(&with_base, 3));
    assert_eq!(with_base.layout.dimension(), whole.layout.dimension() + 6);
    assert_eq!(of_both.rank, of_whole.rank);
    assert_eq!(of_whole.undetermined.ncols(), whole.layout.dimension() - of_whole.rank);
    let said = &undetermined(&with_base, &of_both)[0];
    assert!(
        said.starts_with("where the base stands cannot be separated from where a and all that it carries"),
        "{said}"
    );
    assert!(said.contains("6 directions"), "{said}");
}

/// Of the last joint's offset and the marker behind it nothing but their sum is told.
#[test]
fn the_zero_of_the_last_joint_is_the_markers_turn() {
    let (whole, with_offset) = (prospect(2, &[]), prospect(2, &[Block::Offset(3)]));
    let of_both = found(&with_offset, 3);
    assert_eq!(with_offset.layout.dimension(), whole.layout.dimension() + 1);
    assert_eq!(of_both.rank, found(&whole, 3).rank);
    let said = &undetermined(&with_offset, &of_both)[0];
    assert!(said.starts_with("the zero of d cannot be separated from") && said.contains("targets behind it"), "{said}");
    assert!(!said.contains("axis of a"), "{said}");
}

/// More movements leave no parameter and no prediction less known; chosen ones predict better than random ones.
#[test]
fn more_movements_are_never_worse() {
    for seed in 0..3 {
        let prospect = prospect(seed, &[]);
        let (few, many) = (found(&prospect, 8), found(&prospect, 14));
        for (few, many) in few.deviations.iter().zip(&many.deviations) {
            assert!(
                many.best <= few.best * (1.0 + 1e-9) && few.best <= few.prior * (1.0 + 1e-9),
                "seed {seed}: {few:?}"
            );
            assert!(many.random_median <= few.random_median * (1.0 + 1e-9), "seed {seed}: {few:?}");
        }
        assert!(many.errors.is_sorted_by(|a, b| a.best_m >= b.best_m && a.random_median_m >= b.random_median_m));
        assert_eq!(few.errors, many.errors[..8], "one is the beginning of the other");
        let last = many.errors[13];
        assert!(last.best_m < last.random_median_m, "seed {seed}: {last:?}");
        assert!(many.indices.best.o1 > 0.0 && many.indices.best.o2 <= 1.0);
    }
}

/// Another sensor never lowers the rank, and never leaves a deviation greater where movements are the same.
#[test]
fn another_sensor_takes_nothing_away() {
    for seed in 0..4 {
        let one = prospect(seed, &[Block::Base, Block::Offset(1)]);
        let mut two = one.clone();
        two.measurement_model = Arc::new(MeasurementModel::new(
            [0.001, 0.002].map(|sigma| Sensor::even(Position { target: 0 }, sigma)).to_vec(),
        ));
        let (one, two) = (found(&one, 4), found(&two, 4));
        assert!(two.rank >= one.rank, "seed {seed}");
        for (one, two) in one.deviations.iter().zip(&two.deviations) {
            assert!(two.random_median <= one.random_median * (1.0 + 1e-9), "seed {seed}: {one:?} {two:?}");
        }
    }
}
