//! What of a robot must keep clear: the points and segments that stand for it.

use nalgebra::{Isometry3, Point3};

use crate::{
    model::{Correction, State},
    sensing::Equipment,
};

/// The points that stand for a robot, by its *nominal* description in the frame of its base, whatever a learner believes:
///
/// * the origin of every revolute joint, the point that the description gives on its axis (a line has no other; a sliding
///   joint has none);
/// * every target, with the known points of a rigid body, and every camera that a link carries;
/// * as segments, the links between consecutive origins and from the last origin to what a link carries.
///
/// A point that no joint moves, as the origin of the first, is left out: nothing that is chosen changes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// The robot; none for an outline without parts.
    nominal: Option<State>,
    parts: Vec<Part>,
    /// Pairs of parts that a link joins, one of which moves at least.
    links: Vec<[usize; 2]>,
}

/// A point of an outline.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    name: String,
    /// The link that carries it.
    link: usize,
    /// Where it is at θ = 0.
    at: Point3<f64>,
    moves: bool,
}

impl Outline {
    /// Of a robot as it is described, whose joints have these names.
    pub fn new(described: &State, joints: &[String], equipment: &Equipment) -> Self {
        let mut nominal = described.clone();
        nominal.base = Isometry3::identity();
        nominal.corrections.fill(Correction::default());
        let (mut parts, mut links) = (Vec::<Part>::new(), Vec::new());
        let part = |name: &str, link: usize, at: Point3<f64>| Part {
            name: name.to_owned(),
            link,
            at,
            moves: is_moved(&nominal, link, &at),
        };
        let origins = nominal.joints.iter().zip(joints).enumerate();
        for (link, (joint, name)) in origins {
            let Some(line) = joint.line() else { continue };
            links.extend(parts.len().checked_sub(1).map(|last| [last, parts.len()]));
            parts.push(part(name, link, line.point));
        }
        let origins = parts.len();
        let targets = nominal.targets.iter().zip(&equipment.targets).map(|(target, kind)| {
            let frame = target.place.frame();
            let points = kind.points.iter().map(|point| frame * point).collect::<Vec<_>>();
            (kind.name.as_str(), target.link, target.place.origin(), points)
        });
        let cameras = nominal.devices.iter().zip(&equipment.cameras).filter_map(|(device, kind)| {
            Some((kind.name.as_str(), device.link?, Point3::from(device.pose.translation.vector), Vec::new()))
        });
        for (name, link, at, points) in targets.chain(cameras) {
            let last = parts[..origins].iter().rposition(|origin| origin.link < link);
            links.extend(last.map(|last| [last, parts.len()]));
            parts.push(part(name, link, at));
            parts.extend(points.into_iter().filter(|point| *point != at).map(|point| part(name, link, point)));
        }
        links.retain(|link| link.iter().any(|part| parts[*part].moves));
        Self { nominal: Some(nominal), parts, links }
    }

    /// Where every part is in a posture, rad or m per joint; metres.
    pub fn at(&self, posture: &[f64]) -> Vec<Point3<f64>> {
        let links = self.nominal.as_ref().map_or_else(Vec::new, |nominal| nominal.links(posture));
        self.parts.iter().map(|part| links[part.link] * part.at).collect()
    }

    /// The parts that some joint moves, by their place in [`at`](Self::at), with their names.
    pub fn moving(&self) -> impl Iterator<Item = (usize, &str)> {
        self.parts.iter().enumerate().filter(|(_, part)| part.moves).map(|(index, part)| (index, part.name.as_str()))
    }

    /// The pairs of parts that links join, with the name of what each leads to.
    pub fn links(&self) -> impl Iterator<Item = ([usize; 2], &str)> {
        self.links.iter().map(|link| (*link, self.parts[link[1]].name.as_str()))
    }
}

/// Whether a joint before `link` moves a point: it is not on all their axes.
fn is_moved(state: &State, link: usize, point: &Point3<f64>) -> bool {
    state.tree.path(link).any(|joint| (state.joints[joint].carry(1.0, point) - point).norm() > 1e-9)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{model::random::random_arm, sensing::TargetKind};

    #[test]
    fn joints_and_targets_are_where_the_nominal_robot_has_them() {
        let mut state = random_arm(&mut ChaCha8Rng::seed_from_u64(4), 5);
        state.base = Isometry3::translation(0.3, 0.2, 0.1);
        let names: Vec<String> = (0..5).map(|joint| format!("joint-{joint}")).collect();
        let mut equipment = Equipment::default();
        let corners = vec![Point3::new(0.1, 0.0, 0.0), Point3::new(-0.1, 0.0, 0.0)];
        equipment.targets.push(TargetKind { name: "tag".to_owned(), points: corners, facing: None, partly_seen: None });
        let outline = Outline::new(&state, &names, &equipment);
        let posture = [0.3, -0.4, 0.5, 0.2, -0.1];
        let found = outline.at(&posture);
        // The base's own frame: the skeleton without the base.
        let mut at_base = state.clone();
        at_base.base = Isometry3::identity();
        let skeleton = at_base.skeleton(&posture);
        let revolute = state.joints.iter().filter(|joint| joint.line().is_some()).count();
        assert_eq!(found.len(), revolute + 3);
        for (found, wanted) in found.iter().zip(&skeleton) {
            assert!((found - wanted).norm() < 1e-12);
        }
        let named: Vec<&str> = outline.moving().map(|(_, name)| name).collect();
        assert!(!named.contains(&"joint-0") && named.ends_with(&["tag", "tag", "tag"]), "{named:?}");
        assert_eq!(outline.links().count(), revolute);
    }
}
