//! How DIRECT divided the joint box.

use serde::{Deserialize, Serialize};

use super::cube::Cube;
use crate::{
    kinematics::JointBox,
    optimize::{Direct, contains},
};

/// The rectangles into which DIRECT had divided the box that it searched when its budget ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Partition {
    /// All rectangles; they fill the unit cube (each joint from its lower limit, 0, to its upper, 1; those of `limits`, where
    /// there are any).
    pub leaves: Vec<Leaf>,
    /// Which of them holds the chosen configuration: as its centre, if DIRECT chose it; a planner moves on from there.
    pub chosen: usize,
    /// The box that was searched, `[lower, upper]` per joint, rad or m, where constraints made it smaller than the joint box;
    /// else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<[f64; 2]>,
}

/// One rectangle of a partition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leaf {
    /// Its centre in the unit cube, where the criterion was evaluated.
    pub centre: Vec<f64>,
    /// How often each side was trisected: side i is 3^−levels\[i\] long.
    pub levels: Vec<u8>,
    /// The criterion at the centre, with the price of the travel to it if that has one; null if it is not finite, or the
    /// centre not feasible.
    pub value: Option<f64>,
    /// The iteration of DIRECT that gave the rectangle its present shape.
    pub generation: usize,
    /// Whether DIRECT would divide it next.
    pub potentially_optimal: bool,
}

impl Partition {
    /// Of a search of a cube that has ended, which chose its best centre.
    pub(super) fn of(direct: &Direct, cube: &Cube) -> Self {
        let leaves: Vec<Leaf> = direct
            .partition()
            .iter()
            .map(|rectangle| Leaf {
                centre: cube.spread(rectangle.centre, 0.5),
                levels: cube.spread(rectangle.levels, 0),
                value: rectangle.value,
                generation: rectangle.generation,
                potentially_optimal: rectangle.potentially_optimal,
            })
            .collect();
        Self { leaves, chosen: direct.best_rectangle().unwrap_or(0), limits: Vec::new() }
    }

    /// The same of a search of this box, which constraints made smaller than the joint box.
    pub(super) fn within(self, limits: &JointBox) -> Self {
        Self { limits: limits.joints().iter().map(|&(lower, upper)| [lower, upper]).collect(), ..self }
    }

    /// The box that was searched, in a robot of these joint limits.
    pub fn searched(&self, limits: &JointBox) -> JointBox {
        let searched = self.limits.iter().map(|&[lower, upper]| (lower, upper)).collect::<Vec<_>>();
        JointBox::new(searched).ok().filter(|searched| searched.dimension() > 0).unwrap_or_else(|| limits.clone())
    }

    /// The same where another point of the unit cube was chosen.
    pub fn choosing(self, point: &[f64]) -> Self {
        let holds = |leaf: &Leaf| contains(&leaf.centre, &leaf.levels, point);
        let chosen = self.leaves.iter().position(holds).unwrap_or(self.chosen);
        Self { chosen, ..self }
    }
}
