//! An arm in one configuration: the places of its joints, and the motions of its links.

use nalgebra::{Isometry3, Point3, Vector3};

use super::solid::Capsule;
use body_schema_engine::model::State;

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

/// An arm at a posture.
#[derive(Clone, Debug)]
pub(super) struct Posture {
    /// The motion of each link i by the joints before it; link 0 is the base.
    pub(super) links: Vec<Isometry3<f64>>,
    /// A point on the axis of every joint, and its direction. A prismatic joint has no point: it stands at the next
    /// joint's, or at the marker.
    joints: Vec<(Point3<f64>, Vector3<f64>)>,
    pub(super) marker: Point3<f64>,
}

impl Posture {
    pub(super) fn of(arm: &State, configuration: &[f64]) -> Self {
        let links = arm.links(configuration);
        let marker = arm.marker_at(configuration);
        let mut next = marker;
        let mut joints: Vec<_> = (arm.joints.iter().zip(&links).rev())
            .map(|(joint, link)| {
                next = joint.line().map_or(next, |line| link * line.point);
                (next, link * joint.direction().into_inner())
            })
            .collect();
        joints.reverse();
        Self { links, joints, marker }
    }

    /// The points on the axes in order, then the marker.
    pub(super) fn points(&self) -> Vec<Point3<f64>> {
        self.joints.iter().map(|(point, _)| *point).chain([self.marker]).collect()
    }

    /// Links from joint to joint and on to the marker, and a pin through each joint along its axis.
    pub(super) fn capsules(&self, reach_m: f64, look: ArmLook) -> Vec<Capsule> {
        let count = self.joints.len();
        let radius = |index: usize| GIRTH * reach_m * look.girth * (1.0 - TAPER * index as f64 / count as f64);
        let ends = self.joints.iter().skip(1).map(|(point, _)| *point).chain([self.marker]);
        let links = self.joints.iter().zip(ends).enumerate().map(|(index, ((from, _), to))| Capsule {
            from: *from,
            to,
            radius_m: radius(index),
            colour: look.links,
        });
        let pins = self.joints.iter().enumerate().map(|(index, (point, axis))| {
            let half = axis * (PIN[0] * radius(index));
            Capsule { from: point - half, to: point + half, radius_m: PIN[1] * radius(index), colour: look.pins }
        });
        links.chain(pins).collect()
    }
}

/// An arm of which only the points are known.
pub(super) fn bare(points_m: &[[f64; 3]], reach_m: f64, colour: [u8; 4]) -> Vec<Capsule> {
    let radius_m = GIRTH * reach_m * (1.0 - 0.5 * TAPER);
    let link = |ends: &[[f64; 3]]| Capsule { from: ends[0].into(), to: ends[1].into(), radius_m, colour };
    points_m.windows(2).map(link).collect()
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
