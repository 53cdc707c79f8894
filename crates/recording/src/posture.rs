//! A robot in one configuration: the places of its joints, and the motions of its links.

use nalgebra::{Isometry3, Point3, Vector3};

use super::solid::Capsule;
use body_schema_engine::model::{Frame, State};

/// Radius of the first link, as a part of the arm's reach; links taper towards the hand.
const GIRTH: f64 = 0.042;
/// How much thinner the last link is than the first.
const TAPER: f64 = 0.4;
/// Half the length and the radius of the pin that shows a joint's axis, in radii of the link.
const PIN: [f64; 2] = [1.75, 0.5];

/// The look of an arm.
#[derive(Clone, Copy, Debug)]
pub(super) struct ArmLook {
    /// The colour of the links.
    pub(super) links: [u8; 4],
    /// The colour of the pins.
    pub(super) pins: [u8; 4],
    /// How thick it is, 1 for the true arm.
    pub(super) girth: f64,
}

/// A robot at a posture.
#[derive(Clone, Debug)]
pub(super) struct Posture {
    /// The motion of each link i by the joints before it; link 0 is the base.
    pub(super) links: Vec<Isometry3<f64>>,
    /// A point on the axis of every joint, and its direction. A prismatic joint has no point: it stands at the next
    /// joint's of its branch, or at its end.
    joints: Vec<(Point3<f64>, Vector3<f64>)>,
    /// For every joint the end of what it moves, up to the next joint of its branch, and how many joints are before it.
    ends: Vec<(Point3<f64>, usize)>,
    /// For every branch but those on the base, the joint that carries it and its first joint.
    forks: Vec<[usize; 2]>,
    /// The ends of all branches but the hand's.
    tips: Vec<Point3<f64>>,
    pub(super) marker: Point3<f64>,
}

impl Posture {
    pub(super) fn of(arm: &State, configuration: &[f64]) -> Self {
        let links = arm.links(configuration);
        let marker = arm.marker_at(configuration);
        let count = arm.joints.len();
        let mut joints = vec![(marker, Vector3::zeros()); count];
        let mut ends = vec![(marker, 0); count];
        let (mut forks, mut tips) = (Vec::new(), Vec::new());
        for (index, branch) in arm.branches().into_iter().enumerate() {
            let pivot =
                |joint: &usize| arm.joints[*joint].line().map(|line| links[arm.tree.link_before(*joint)] * line.point);
            let end = match branch.end {
                _ if index == 0 => marker,
                Some(frame) => carried(arm, &links, frame),
                // Where nothing is carried, the branch ends at its last pivot, or is nothing but where it begins.
                None => (branch.joints.iter().rev().find_map(pivot))
                    .unwrap_or_else(|| branch.carrier.map_or(marker, |carrier| joints[carrier].0)),
            };
            if index > 0 {
                tips.push(end);
            }
            let mut next = end;
            for joint in branch.joints.iter().rev() {
                let link = &links[arm.tree.link_before(*joint)];
                ends[*joint] = (next, arm.tree.path(*joint + 1).count() - 1);
                next = pivot(joint).unwrap_or(next);
                joints[*joint] = (next, link * arm.joints[*joint].direction().into_inner());
            }
            forks.extend(branch.carrier.zip(branch.joints.first().copied()).map(|(carrier, first)| [carrier, first]));
        }
        Self { links, joints, ends, forks, tips, marker }
    }

    /// A point on the axis of every joint in order.
    pub(super) fn pivots(&self) -> impl ExactSizeIterator<Item = Point3<f64>> + '_ {
        self.joints.iter().map(|(point, _)| *point)
    }

    /// The points on the axes in order, then the ends of branches, the marker last.
    pub(super) fn points(&self) -> Vec<Point3<f64>> {
        self.pivots().chain(self.tips.iter().copied()).chain([self.marker]).collect()
    }

    /// Links from joint to joint and on to the marker or another end of a branch, one for every joint; a pin through each joint along
    /// its axis; then what leads from one branch to another.
    pub(super) fn capsules(&self, reach_m: f64, look: ArmLook) -> Vec<Capsule> {
        let longest = self.ends.iter().map(|(_, before)| before + 1).max().unwrap_or(1);
        let radius =
            |index: usize| GIRTH * reach_m * look.girth * (1.0 - TAPER * self.ends[index].1 as f64 / longest as f64);
        let links = self.joints.iter().zip(&self.ends).enumerate().map(|(index, ((from, _), (to, _)))| Capsule {
            from: *from,
            to: *to,
            radius_m: radius(index),
            colour: look.links,
        });
        let pins = self.joints.iter().enumerate().map(|(index, (point, axis))| {
            let half = axis * (PIN[0] * radius(index));
            Capsule { from: point - half, to: point + half, radius_m: PIN[1] * radius(index), colour: look.pins }
        });
        let forks = self.forks.iter().map(|[carrier, first]| Capsule {
            from: self.joints[*carrier].0,
            to: self.joints[*first].0,
            radius_m: radius(*first),
            colour: look.links,
        });
        links.chain(pins).chain(forks).collect()
    }
}

/// Where the origin of a frame is, when the links have these motions.
fn carried(arm: &State, links: &[Isometry3<f64>], frame: Frame) -> Point3<f64> {
    match frame {
        Frame::Link(link) => links[link] * Point3::origin(),
        Frame::Target(target) => links[arm.targets[target].link] * arm.targets[target].place.origin(),
        Frame::Device(device) => {
            let device = &arm.devices[device];
            let place = Point3::from(device.pose.translation.vector);
            device.link.map_or(place, |link| links[link] * place)
        }
    }
}

/// A robot of which only the points are known, branch by branch.
pub(super) fn bare(bones_m: &[Vec<[f64; 3]>], reach_m: f64, colour: [u8; 4]) -> Vec<Capsule> {
    let radius_m = GIRTH * reach_m * (1.0 - 0.5 * TAPER);
    let link = |ends: &[[f64; 3]]| Capsule { from: ends[0].into(), to: ends[1].into(), radius_m, colour };
    bones_m.iter().flat_map(|bone| bone.windows(2)).map(link).collect()
}

/// The configuration between two others, at `time` in 0..=1 of the way, slow at both ends.
pub(super) fn between(from: &[f64], to: &[f64], time: f64) -> Vec<f64> {
    let way = time * time * (3.0 - 2.0 * time);
    from.iter().zip(to).map(|(from, to)| from + way * (to - from)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_movement_begins_and_ends_slowly() {
        assert_eq!(between(&[1.0, -2.0], &[3.0, 2.0], 0.0), [1.0, -2.0]);
        assert_eq!(between(&[1.0, -2.0], &[3.0, 2.0], 1.0), [3.0, 2.0]);
        assert_eq!(between(&[1.0, -2.0], &[3.0, 2.0], 0.5), [2.0, 0.0]);
        assert!(between(&[0.0], &[1.0], 0.1)[0] < 0.05);
    }
}
