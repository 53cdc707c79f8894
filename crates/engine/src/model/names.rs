//! The names of blocks and their coordinates, and sentences about those that no measurement determines.

use std::ops::Range;

use nalgebra::DMatrix;

use super::{Block, Layout, State};
use crate::kinematics::JointKind;

/// The share of a block's coordinate that undetermined directions must hold for the block to be named.
const NAMED: f64 = 0.05;

/// The names of everything that can be learned.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// The joints' names.
    pub joints: Vec<String>,
    /// The targets' names.
    pub targets: Vec<String>,
    /// The cameras' names.
    pub cameras: Vec<String>,
    /// The sockets' names.
    pub sockets: Vec<String>,
}

impl Names {
    /// The block as the object of a sentence.
    pub fn block(&self, block: Block) -> String {
        let of = |names: &[String], index: usize| names.get(index).cloned().unwrap_or_else(|| format!("{}", index + 1));
        match block {
            Block::Base => "the base".to_owned(),
            Block::Axis(joint) => format!("the axis of {}", of(&self.joints, joint)),
            Block::Offset(joint) => format!("the offset of {}", of(&self.joints, joint)),
            Block::Ratio(joint) => format!("the ratio of {}", of(&self.joints, joint)),
            Block::Eccentricity(joint) => format!("the eccentricity of {}", of(&self.joints, joint)),
            Block::Compliance(joint, load) => {
                format!("how {} gives way to the load at the {}", of(&self.joints, joint), load.name())
            }
            Block::Target(target) => match of(&self.targets, target) {
                name if name == "marker" => "the marker".to_owned(),
                name => format!("target {name}"),
            },
            Block::Device(device) => format!("camera {}", of(&self.cameras, device)),
            Block::Intrinsics(device) => format!("the lens of camera {}", of(&self.cameras, device)),
            Block::Distortion(device, index) => {
                format!("distortion coefficient {} of camera {}", index + 1, of(&self.cameras, device))
            }
            Block::Socket(socket) => format!("socket {}", of(&self.sockets, socket)),
        }
    }

    /// The name of every tangent coordinate of a layout.
    pub fn coordinates(&self, layout: &Layout, state: &State) -> Vec<String> {
        let ends = |block: Block| -> &'static [&'static str] {
            match block {
                Block::Axis(joint) if state.joints[joint].kind() == JointKind::Revolute => {
                    &["shift along b₁", "shift along b₂", "tilt towards b₁", "tilt towards b₂"]
                }
                Block::Axis(_) => &["tilt towards b₁", "tilt towards b₂"],
                Block::Eccentricity(_) => &["sine", "cosine"],
                Block::Offset(_) | Block::Ratio(_) | Block::Compliance(..) | Block::Distortion(..) => &[""],
                Block::Intrinsics(_) => &["fx", "fy", "cx", "cy"],
                _ => &["x", "y", "z", "turn about x", "turn about y", "turn about z"],
            }
        };
        let named = |(block, range): (Block, Range<usize>)| {
            let coefficient = |device: usize, index: usize| {
                let distortion = state.devices.get(device)?.distortion.as_ref()?;
                Some(format!("{} of {}", distortion.model().names().get(index)?, self.block(Block::Device(device))))
            };
            let name = match block {
                Block::Distortion(device, index) => coefficient(device, index),
                _ => None,
            };
            let name = name.unwrap_or_else(|| self.block(block));
            let ends = ends(block).iter().take(range.len());
            ends.map(move |end| if end.is_empty() { name.clone() } else { format!("{name}, {end}") })
                .collect::<Vec<_>>()
        };
        layout.blocks().flat_map(named).collect()
    }

    /// A sentence that names the directions in the columns of `free` (m × k, orthonormal), which `by` does not determine;
    /// `None` without any.
    pub(super) fn untold(&self, layout: &Layout, free: &DMatrix<f64>, by: &str) -> Option<String> {
        let count = free.ncols();
        if count == 0 {
            return None;
        }
        let is_named = |range: &Range<usize>| range.clone().any(|at| free.row(at).norm_squared() > NAMED);
        let names = layout.blocks().filter(|(_, range)| is_named(range)).map(|(block, _)| self.block(block));
        let (directions, they) = if count == 1 { ("direction", "it moves") } else { ("directions", "they move") };
        Some(format!(
            "{count} {directions} among the {} parameters cannot be told by {by}, and stay as described: {they} {} so that nothing \
             that is measured changes",
            layout.dimension(),
            listed(names.collect())
        ))
    }
}

/// The names as a list in words: "a, b and c".
pub fn listed(mut names: Vec<String>) -> String {
    match names.pop() {
        Some(last) if !names.is_empty() => format!("{} and {last}", names.join(", ")),
        Some(last) => last,
        None => String::new(),
    }
}
