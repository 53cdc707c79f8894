//! Joints of a description of which a table has no column.

use toml::Spanned;

use super::{Check, measured::JointColumn, raw};
use crate::Robot;
use body_schema_engine::{
    model::{Block, Layout},
    sensing::Keys,
};
use body_schema_robot::Follows;
use body_schema_table::Table;

impl Check<'_> {
    /// Finds the joints without a column with which nothing moves that is measured: they are held at 0, and nothing is learned of them.
    /// A joint that is needed keeps its column, and is refused where that is read. `None` has left a problem behind.
    pub(super) fn without_column(
        &mut self,
        raw: &raw::Scenario,
        text: &str,
        columns: &mut [JointColumn],
        robot: &mut Robot,
    ) -> Option<()> {
        // What is wrong with the table is told where its rows are read.
        let (Some(described), Ok(table)) = (&robot.described, Table::open(text.as_bytes())) else { return Some(()) };
        let follows: Vec<&Follows> = described.chain.moving().filter_map(|segment| segment.follows.as_ref()).collect();
        let is_needed = needed(raw, robot);
        let mut is_held = vec![false; robot.names.len()];
        for (reading, column) in columns.iter_mut().enumerate() {
            let JointColumn::Named(name, _) = column else { continue };
            let moves = |joint: &usize| follows[*joint].readings().any(|one| one == reading);
            let joints: Vec<usize> = (0..follows.len()).filter(moves).collect();
            if !table.titles().names(name) && !joints.iter().any(|joint| is_needed[*joint]) {
                *column = JointColumn::Absent;
                joints.iter().for_each(|joint| is_held[*joint] = true);
            }
        }
        if !is_held.contains(&true) {
            return Some(());
        }
        let is_kept = |block: &Block| joint_of(*block).is_none_or(|joint| !is_held[joint]);
        robot.known.retain(|(block, _)| is_kept(block));
        let blocks: Vec<Block> = robot.layout.blocks().map(|(block, _)| block).filter(is_kept).collect();
        robot.layout = Layout::new(&robot.state, blocks);
        if robot.layout.dimension() > 0 {
            return Some(());
        }
        let span = raw.measurements.as_ref().map_or(0..0, Spanned::span);
        let hint = "title columns with the names of the joints that move what is measured, or add sensors of what these joints move";
        self.problem(span, "measurements.file", "nothing that is to be learned moves what is measured", hint);
        None
    }
}

/// The joint of which a block is a parameter.
fn joint_of(block: Block) -> Option<usize> {
    match block {
        Block::Axis(joint)
        | Block::Offset(joint)
        | Block::Ratio(joint)
        | Block::Eccentricity(joint)
        | Block::Compliance(joint, _) => Some(joint),
        Block::Base
        | Block::Target(_)
        | Block::Device(_)
        | Block::Intrinsics(_)
        | Block::Distortion(..)
        | Block::Socket(_) => None,
    }
}

/// Whether something that is measured moves with each joint: a target in the frame of the measurements or in the picture of a camera
/// beside the robot, or a target and the camera or other target that it is measured from, one of which moves and not the other.
fn needed(raw: &raw::Scenario, robot: &Robot) -> Vec<bool> {
    let (state, equipment) = (&robot.state, &robot.equipment);
    let target = |name: Option<&String>| {
        let index = name.map_or(Some(0), |name| equipment.targets.iter().position(|kind| kind.name == *name));
        state.targets.get(index?).map(|target| target.link)
    };
    // The links that are seen, with those from which they are seen.
    let of_sensor = |keys: &Keys| {
        let from = keys.observer(equipment).and_then(|observer| state.link_of(observer.frame()));
        (target(keys.target.as_ref()), from)
    };
    let sensors = raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0);
    let mut seen: Vec<_> = sensors.map(|keys| of_sensor(keys.get_ref())).collect();
    let marker = raw.measurements.as_ref().and_then(|given| given.get_ref().marker_columns_m.as_ref());
    seen.extend(marker.map(|_| (target(None), None)));
    seen.extend(raw.held.iter().map(|held| (target(held.get_ref().target.as_ref().map(Spanned::get_ref)), None)));
    let moves = |joint: usize, link: Option<usize>| link.is_some_and(|link| state.tree.moves(joint, link));
    let is_seen = |joint: usize| seen.iter().any(|(link, from)| moves(joint, *link) != moves(joint, *from));
    (0..state.joints.len()).map(is_seen).collect()
}
