//! Active selection: the movement that is expected to teach most.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{
    ACriterion, Actions, Movement, Policy, Selection, SelectionError, Sight, Visibility, Watch, Weights,
    criterion::scaled,
};
use crate::{
    estimation::Belief,
    optimize::{Direct, Settings},
    sensing::Observation,
};

/// Minimises the A-criterion: over a box of joint limits by DIRECT, normalised to the unit cube; over a pool of
/// recorded movements by trying every one.
///
/// Where a head watches ([`watched`](Self::watched)), the first movement goes to the pose that is known to be visible,
/// the gain is weighed by the chance of being seen, and misses are remembered.
#[derive(Clone, Debug)]
pub struct Active {
    weights: Weights,
    search: Settings,
    watch: Option<Watched>,
}

#[derive(Clone, Debug)]
struct Watched {
    visible_pose: Vec<f64>,
    visibility: Visibility,
    naive: bool,
    has_moved: bool,
}

/// The rectangles into which DIRECT had divided the joint box when its budget ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Partition {
    /// All rectangles; they fill the unit cube (each joint from its lower limit, 0, to its upper, 1).
    pub leaves: Vec<Leaf>,
    /// Which of them has the chosen configuration as its centre.
    pub chosen: usize,
}

/// One rectangle of a partition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Leaf {
    /// Its centre in the unit cube, where the criterion was evaluated.
    pub centre: Vec<f64>,
    /// How often each side was trisected: side i is 3^−levels\[i\] long.
    pub levels: Vec<u8>,
    /// The criterion at the centre; null if it is not finite.
    pub value: Option<f64>,
    /// The iteration of DIRECT that gave the rectangle its present shape.
    pub generation: usize,
    /// Whether DIRECT would divide it next.
    pub potentially_optimal: bool,
}

impl Leaf {
    /// Half the length of side `index`, in the unit cube.
    pub fn half_side(&self, index: usize) -> f64 {
        0.5 * 3_f64.powi(-i32::from(self.levels[index]))
    }

    /// Whether `point` lies in this rectangle along side `index`.
    pub fn spans(&self, index: usize, point: f64) -> bool {
        (self.centre[index] - point).abs() <= self.half_side(index) * (1.0 + 1e-9)
    }
}

impl Active {
    /// Selection by the A-criterion with `weights`; `search` says how DIRECT goes about it.
    pub fn new(weights: Weights, search: Settings) -> Self {
        Self { weights, search, watch: None }
    }

    /// The same where a head watches.
    pub fn watched(self, watch: Watch) -> Self {
        let Watch { head, visible_pose } = watch;
        let visibility = Visibility::new(head);
        Self { watch: Some(Watched { visible_pose, visibility, naive: false, has_moved: false }), ..self }
    }

    /// The naive form, for comparison: the plain criterion wherever the *predicted* marker is in view. It believes its
    /// own prediction, and a miss teaches it nothing.
    pub fn watched_naively(self, watch: Watch) -> Self {
        let mut active = self.watched(watch);
        active.watch.iter_mut().for_each(|watch| watch.naive = true);
        active
    }

    fn search_box(&self, criterion: &ACriterion<'_>, limits: &[(f64, f64)]) -> Result<Selection, SelectionError> {
        let scale = |centre: &[f64]| -> Vec<f64> {
            centre.iter().zip(limits).map(|(c, (lower, upper))| lower + c * (upper - lower)).collect()
        };
        let mut direct = Direct::new(limits.len(), self.search).map_err(SelectionError::Search)?;
        while let Some(batch) = direct.ask() {
            let candidates: Vec<Vec<f64>> = batch.iter().map(scale).collect();
            direct.tell(&criterion.evaluate(&candidates)).map_err(SelectionError::Search)?;
        }
        let Some((centre, value)) = direct.best() else {
            return match &self.watch {
                // Nothing in view was found: back to where the marker is known to be seen.
                Some(watch) if criterion.trace().is_finite() => Ok(Selection::plain(watch.visible_pose.clone())),
                _ => Err(SelectionError::NoFiniteCriterion),
            };
        };
        let leaves: Vec<Leaf> = direct
            .partition()
            .iter()
            .map(|rectangle| Leaf {
                centre: rectangle.centre.to_vec(),
                levels: rectangle.levels.to_vec(),
                value: rectangle.value,
                generation: rectangle.generation,
                potentially_optimal: rectangle.potentially_optimal,
            })
            .collect();
        let chosen = leaves.iter().position(|leaf| leaf.centre == centre).unwrap_or(0);
        Ok(Selection {
            movement: Movement { configuration: scale(centre), row: None },
            criterion: Some(value),
            gain: Some(criterion.trace() - value),
            evaluations: direct.evaluations(),
            partition: Some(Partition { leaves, chosen }),
        })
    }
}

impl Policy for Active {
    fn select(
        &mut self,
        belief: &Belief,
        actions: &Actions,
        _rng: &mut ChaCha8Rng,
    ) -> Result<Selection, SelectionError> {
        let criterion = ACriterion::new(belief, &self.weights)?;
        match actions {
            Actions::Box(limits) => match &self.watch {
                Some(watch) if !watch.has_moved => Ok(Selection::plain(watch.visible_pose.clone())),
                Some(watch) if watch.naive => {
                    self.search_box(&criterion.watched(Sight::Predicted(&watch.visibility)), limits)
                }
                Some(watch) => self.search_box(&criterion.watched(Sight::Chance(&watch.visibility, limits)), limits),
                None => self.search_box(&criterion, limits),
            },
            Actions::Pool(pool) => {
                let candidates: Vec<&[f64]> = pool.iter().map(|movement| movement.configuration.as_slice()).collect();
                let values = criterion.evaluate(&candidates);
                let (movement, value) =
                    pool.iter().zip(values).min_by(|a, b| a.1.total_cmp(&b.1)).ok_or(SelectionError::Exhausted)?;
                if !value.is_finite() {
                    return Err(SelectionError::NoFiniteCriterion);
                }
                Ok(Selection {
                    movement: movement.clone(),
                    criterion: Some(value),
                    gain: Some(criterion.trace() - value),
                    evaluations: pool.len(),
                    partition: None,
                })
            }
        }
    }
    fn observe(&mut self, movement: &Movement, actions: &Actions, observation: &Observation) {
        let Some(watch) = &mut self.watch else { return };
        watch.has_moved = true;
        if let (Actions::Box(limits), Observation::Missed) = (actions, observation) {
            watch.visibility.missed(scaled(&movement.configuration, limits));
        }
    }
}
