//! The joint that a scenario breaks, marked from the moment it breaks.

use super::{
    colours::labelled,
    movement::ERROR,
    posture::Posture,
    rerun::{Color, Points3D, Radius},
    solid::single,
};
use body_schema_engine::{kinematics::Joint, model::State};
use body_schema_wire::JointDescription;

/// The difference, metres and without a unit, below which two numbers count as equal.
const SAME: f64 = 1e-9;
/// The radius of the mark, as a part of the arm's reach.
const MARK: f64 = 0.07;

/// The first joint in which two robots differ: those behind it may have moved with it.
pub(super) fn broken(before: &State, after: &State) -> Option<usize> {
    let differs = |(one, other): (&Joint, &Joint)| {
        let moved = one.line().zip(other.line()).is_some_and(|(a, b)| (a.point - b.point).amax() > SAME);
        moved || (one.direction().into_inner() - other.direction().into_inner()).amax() > SAME
    };
    let corrections = before.corrections.iter().zip(&after.corrections);
    let mut joints = before.joints.iter().zip(&after.joints).zip(corrections);
    joints.position(|(joints, (one, other))| differs(joints) || one != other)
}

/// The mark at a joint of an arm in a posture.
pub(super) fn mark(posture: &Posture, joint: usize, reach_m: f64) -> Points3D {
    Points3D::new(at(posture, joint))
        .with_colors([Color::from(ERROR)])
        .with_radii([Radius::new_scene_units((MARK * reach_m) as f32)])
}

/// What the mark means, as a label of a colour.
pub(super) fn name(posture: &Posture, joint: usize, joints: &[JointDescription], colour: [u8; 3]) -> Points3D {
    let name = joints.get(joint).map_or("a joint", |joint| joint.name.as_str());
    labelled(at(posture, joint), colour).with_labels([format!("{name} has changed")])
}

fn at(posture: &Posture, joint: usize) -> Option<[f32; 3]> {
    posture.pivots().nth(joint).map(|point| single(point.coords.into()))
}
