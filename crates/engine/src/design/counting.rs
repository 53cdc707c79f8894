//! Counting equations and unknowns.

use std::sync::Arc;

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{
    kinematics::JointBox,
    model::{Layout, Manifold, State, rank},
    sensing::{InView, MeasurementModel, Occasion, Sensor},
};

/// A movement in general position.
#[derive(Clone, Debug)]
pub struct General {
    /// The channels that read there.
    pub measurement_model: MeasurementModel,
    /// The joint positions, rad or m.
    pub posture: Vec<f64>,
}

/// General movements: twice as many as can be needed, to postures anywhere in the joint box; where targets are held in sockets,
/// anywhere on their manifolds in turn. Where not everything is in `view`, the postures are such that something is seen, and every
/// camera sees as many. What is known before any movement comes first, as if it were one.
pub fn general_movements(
    state: &State,
    layout: &Layout,
    measurement_model: &MeasurementModel,
    view: InView<'_>,
    limits: &JointBox,
) -> Vec<General> {
    // A fixed stream of its own: what is general needs no seed.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    // The measurement model of each socket that a channel reads, and the manifold on which the target is in it.
    let held: Vec<(MeasurementModel, Option<Manifold<'_>>)> = match state.sockets.len() {
        0 => vec![(measurement_model.held_in(None), None)],
        count => {
            let manifold = |socket: usize| {
                let (_, target) = measurement_model.holds(socket)?;
                let manifold = Manifold::new(state, target, state.sockets[socket], limits);
                Some((measurement_model.held_in(Some(socket)), Some(manifold)))
            };
            (0..count).filter_map(manifold).collect()
        }
    };
    let equations = held.iter().map(|(measurement_model, _)| measurement_model.equations()).min().unwrap_or_default();
    if layout.dimension() == 0 || equations == 0 {
        return Vec::new();
    }
    let count = (2 * layout.dimension().div_ceil(equations) + 8) * held.len();
    let known = measurement_model
        .known_beforehand()
        .map(|measurement_model| General { measurement_model, posture: vec![0.0; state.joints.len()] });
    let mut draw = |index: usize, is_wanted: &dyn Fn(&[bool]) -> bool| {
        let (measurement_model, manifold) = &held[index % held.len()];
        let posture = match manifold {
            None => Some(limits.draw(&mut rng)),
            Some(manifold) => manifold.draw(&mut rng),
        };
        let posture = posture?;
        if !view.is_limited(measurement_model) {
            return Some(General { measurement_model: measurement_model.clone(), posture });
        }
        let visible = view.visible(measurement_model, state, &posture);
        is_wanted(&visible).then(|| General { measurement_model: measurement_model.limited_to(&visible), posture })
    };
    let mut movements: Vec<General> = known.into_iter().collect();
    let mut patience = PATIENCE;
    for index in 0..count {
        let mut found = draw(index, &|visible| visible.contains(&true));
        while found.is_none() && patience > 0 && view.is_limited(measurement_model) {
            found = draw(index, &|visible| visible.contains(&true));
            patience -= 1;
        }
        movements.extend(found);
    }
    // Those so far may be in view of one camera alone, though others see something elsewhere.
    for (socket, (measurement_model, _)) in held.iter().enumerate() {
        let with_view = measurement_model
            .sensors()
            .iter()
            .enumerate()
            .filter(|(_, sensor)| sensor.subject().has_view && view.is_limited(measurement_model));
        for (channel, sensor) in with_view {
            let wanted = 2 * layout.dimension().div_ceil(sensor.equations().max(1)) + 8;
            let is_it = |other: &Sensor| Arc::ptr_eq(other.channel(), sensor.channel());
            let sees = |general: &&General| general.measurement_model.sensors().iter().any(is_it);
            let missing = wanted.saturating_sub(movements.iter().filter(sees).count());
            let further = std::iter::repeat_with(|| draw(socket, &|visible| visible[channel]));
            movements.extend(further.take(FURTHER).flatten().take(missing));
        }
    }
    movements
}

/// Draws before it is given up to find postures in view of anything; and of one more camera.
const PATIENCE: usize = 20_000;
const FURTHER: usize = 2_000;

/// Movements in general position after which there are as many independent equations as there can be: the least N for
/// which the Jacobian of N of them has the rank that it has for many. It is the rank that counts, not the number of
/// parameters: what cannot be determined needs no equation.
///
/// A yardstick to draw beside curves, not a bound: a prior or loose thresholds can beat it.
pub fn movements_by_counting(
    state: &State,
    layout: &Layout,
    measurement_model: &MeasurementModel,
    view: InView<'_>,
    limits: &JointBox,
) -> usize {
    let movements = general_movements(state, layout, measurement_model, view, limits);
    let is_made = |movement: &&General| {
        movement.measurement_model.sensors().iter().all(|it| it.subject().occasion != Occasion::Beforehand)
    };
    let Some(most) = movements.iter().filter(is_made).map(|movement| movement.measurement_model.equations()).max()
    else {
        return 0;
    };
    let equations: usize = movements.iter().map(|movement| movement.measurement_model.equations()).sum();
    let mut stacked = DMatrix::zeros(equations, layout.dimension());
    // By number of movements: how many equations there are.
    let (mut ends, mut end) = (Vec::new(), 0);
    for General { measurement_model, posture } in &movements {
        let rows = measurement_model.jacobian(state, layout, posture);
        stacked.rows_mut(end, rows.ncols()).copy_from(&rows.transpose());
        end += rows.ncols();
        ends.push(end);
    }
    // What is known before any movement is none.
    if measurement_model.known_beforehand().is_none() {
        ends.insert(0, 0);
    }
    let greatest = rank(&stacked);
    let least = greatest.div_ceil(most.max(1)).saturating_sub(1).max(1);
    let reaches =
        |count: &usize| ends[*count] >= greatest && rank(&stacked.rows(0, ends[*count]).into_owned()) >= greatest;
    (least..ends.len()).find(reaches).unwrap_or(ends.len() - 1)
}
