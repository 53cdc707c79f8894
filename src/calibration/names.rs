//! What blocks and coordinates are called.

use crate::{
    kinematics::JointKind,
    model::{Block, Layout, State},
    scenario::{Robot, SocketSpec},
};

/// The names of everything that can be learned.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of joints.
    pub joints: Vec<String>,
    /// Of targets.
    pub targets: Vec<String>,
    /// Of cameras.
    pub cameras: Vec<String>,
    /// Of sockets.
    pub sockets: Vec<String>,
}

impl Names {
    /// Those of a scenario's robot.
    pub fn new(robot: &Robot) -> Self {
        Self {
            joints: robot.names.clone(),
            targets: robot.equipment.targets.iter().map(|target| target.name.clone()).collect(),
            cameras: robot.equipment.cameras.iter().map(|camera| camera.name.clone()).collect(),
            sockets: robot.sockets.iter().chain(&robot.held_out_sockets).map(label).collect(),
        }
    }

    /// A block, as the object of a sentence.
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
            Block::Target(target) => format!("target {}", of(&self.targets, target)),
            Block::Device(device) => format!("camera {}", of(&self.cameras, device)),
            Block::Intrinsics(device) => format!("the lens of camera {}", of(&self.cameras, device)),
            Block::Socket(socket) => format!("socket {}", of(&self.sockets, socket)),
        }
    }

    /// By tangent coordinate of a layout: what it is.
    pub fn coordinates(&self, layout: &Layout, state: &State) -> Vec<String> {
        let ends = |block: Block| -> &'static [&'static str] {
            match block {
                Block::Axis(joint) if state.joints[joint].kind() == JointKind::Revolute => {
                    &["shift along b₁", "shift along b₂", "tilt towards b₁", "tilt towards b₂"]
                }
                Block::Axis(_) => &["tilt towards b₁", "tilt towards b₂"],
                Block::Eccentricity(_) => &["sine", "cosine"],
                Block::Offset(_) | Block::Ratio(_) | Block::Compliance(..) => &[""],
                Block::Intrinsics(_) => &["fx", "fy", "cx", "cy"],
                _ => &["x", "y", "z", "turn about x", "turn about y", "turn about z"],
            }
        };
        let named = |(block, range): (Block, std::ops::Range<usize>)| {
            let name = self.block(block);
            let ends = ends(block).iter().take(range.len());
            ends.map(move |end| if end.is_empty() { name.clone() } else { format!("{name}, {end}") })
                .collect::<Vec<_>>()
        };
        layout.blocks().flat_map(named).collect()
    }
}

/// A socket by its place and its name.
fn label(socket: &SocketSpec) -> String {
    socket.place.as_ref().map_or_else(|| socket.name.clone(), |place| format!("{place}/{}", socket.name))
}
