//! How DIRECT divided the joint box.

use serde::{Deserialize, Serialize};

use crate::optimize::{Direct, contains};

/// The rectangles into which DIRECT had divided the joint box when its budget ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "app", derive(utoipa::ToSchema))]
pub struct Partition {
    /// All rectangles; they fill the unit cube (each joint from its lower limit, 0, to its upper, 1).
    pub leaves: Vec<Leaf>,
    /// Which of them holds the chosen configuration: as its centre, if DIRECT chose it; a planner moves on from there.
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

impl Partition {
    /// Of a search that has ended, which chose its best centre.
    pub(super) fn of(direct: &Direct) -> Self {
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
        let best = direct.best().map(|(centre, _)| centre);
        let chosen = leaves.iter().position(|leaf| Some(leaf.centre.as_slice()) == best).unwrap_or(0);
        Self { leaves, chosen }
    }

    /// The same where another point of the unit cube was chosen.
    pub fn choosing(self, point: &[f64]) -> Self {
        let holds = |leaf: &Leaf| contains(&leaf.centre, &leaf.levels, point);
        let chosen = self.leaves.iter().position(holds).unwrap_or(self.chosen);
        Self { chosen, ..self }
    }
}
