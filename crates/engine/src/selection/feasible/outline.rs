//! What of a robot must keep clear: the points and segments that stand for it.

use nalgebra::{Isometry3, Point3};

use super::Hull;
use crate::{
    model::{Correction, State},
    sensing::Equipment,
};

/// The points that stand for a robot, by its *nominal* description in the frame of its base, whatever a learner believes:
///
/// * the origin of every revolute joint, the point that the description gives on its axis (a line has no other; a sliding
///   joint has none);
/// * every target, with the known points of a rigid body, and every camera that a link carries;
/// * as segments, the links from each of these to the nearest origin before it on its branch.
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
        // The part of each joint's origin, if it has one, and that of the nearest joint before a link.
        let mut origins: Vec<Option<usize>> = Vec::new();
        let before =
            |origins: &[Option<usize>], link: usize| nominal.tree.path(link).find_map(|joint: usize| origins[joint]);
        for (index, (joint, name)) in nominal.joints.iter().zip(joints).enumerate() {
            let link = nominal.tree.link_before(index);
            origins.push(joint.line().map(|line| {
                links.extend(before(&origins, link).map(|last| [last, parts.len()]));
                parts.push(part(name, link, line.point));
                parts.len() - 1
            }));
        }
        let targets = nominal.targets.iter().zip(&equipment.targets).map(|(target, kind)| {
            let frame = target.place.frame();
            let points = kind.points.iter().map(|point| frame * point).collect::<Vec<_>>();
            (kind.name.as_str(), target.link, target.place.origin(), points)
        });
        let cameras = nominal.devices.iter().zip(&equipment.cameras).filter_map(|(device, kind)| {
            Some((kind.name.as_str(), device.link?, Point3::from(device.pose.translation.vector), Vec::new()))
        });
        for (name, link, at, points) in targets.chain(cameras) {
            links.extend(before(&origins, link).map(|last| [last, parts.len()]));
            parts.push(part(name, link, at));
            parts.extend(points.into_iter().filter(|point| *point != at).map(|point| part(name, link, point)));
        }
        links.retain(|link| link.iter().any(|part| parts[*part].moves));
        Self { nominal: Some(nominal), parts, links }
    }

    /// How every link has moved in a posture, rad or m per joint: the base first, which has not.
    pub fn frames(&self, posture: &[f64]) -> Vec<Isometry3<f64>> {
        self.nominal.as_ref().map_or_else(Vec::new, |nominal| nominal.links(posture))
    }

    /// Where every part is, with the links moved so; metres.
    pub fn on(&self, links: &[Isometry3<f64>]) -> Vec<Point3<f64>> {
        self.parts.iter().map(|part| links[part.link] * part.at).collect()
    }

    /// Where every part is in a posture, rad or m per joint; metres.
    pub fn at(&self, posture: &[f64]) -> Vec<Point3<f64>> {
        self.on(&self.frames(posture))
    }

    /// The parts that some joint moves, by their place in [`at`](Self::at), with their names.
    pub fn moving(&self) -> impl Iterator<Item = (usize, &str)> {
        self.parts.iter().enumerate().filter(|(_, part)| part.moves).map(|(index, part)| (index, part.name.as_str()))
    }

    /// The pairs of parts that links join, with the name of what each leads to.
    pub fn links(&self) -> impl Iterator<Item = ([usize; 2], &str)> {
        self.links.iter().map(|link| (*link, self.parts[link[1]].name.as_str()))
    }

    /// The links as capsules of a radius, metres, in the order of [`links`](Self::links): lines where it is 0.
    pub fn capsules(&self, radius: f64) -> Vec<Hull> {
        let capsule = |[from, to]: &[usize; 2]| {
            let (Part { name, link, at, .. }, start) = (&self.parts[*to], &self.parts[*from]);
            let hull = Hull::new(format!("the link to `{name}`"), *link, vec![*at], radius)?;
            Some(hull.drawn_from(start.link, start.at))
        };
        self.links.iter().filter_map(capsule).collect()
    }

    /// Whether two links are not one, and neither carries the other.
    pub fn are_distant(&self, links: [usize; 2]) -> bool {
        let [one, other] = links;
        let Some(nominal) = &self.nominal else { return false };
        let before = |link: usize| link.checked_sub(1).map(|joint| nominal.tree.link_before(joint));
        one != other && before(one) != Some(other) && before(other) != Some(one)
    }

    /// The way along the robot between two links that have moved so, metres: over the origins of the joints between them. It has no end
    /// over a joint that slides.
    pub fn way(&self, links: [usize; 2], frames: &[Isometry3<f64>]) -> f64 {
        let Some(State { tree, joints, .. }) = &self.nominal else { return f64::INFINITY };
        let [from, to] = links.map(|link| tree.path(link).collect::<Vec<usize>>());
        let up = from.iter().filter(|joint| !to.contains(joint));
        let down = to.iter().rev().filter(|joint| !from.contains(joint));
        let origin = |joint: &usize| Some(frames[tree.link_before(*joint)] * joints[*joint].line()?.point);
        let origins: Option<Vec<Point3<f64>>> = up.chain(down).map(origin).collect();
        origins.map_or(f64::INFINITY, |on| on.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum())
    }

    /// The length of the robot in a posture, metres: that of its longest branch, along the links.
    pub fn length(&self, posture: &[f64]) -> f64 {
        let points = self.at(posture);
        let mut lengths = vec![0.0; points.len()];
        // A link leads from a part to a later one.
        self.links.iter().for_each(|[from, to]| lengths[*to] = lengths[*from] + (points[*to] - points[*from]).norm());
        lengths.into_iter().fold(0.0, f64::max)
    }

    /// The pairs of links, by their places in [`links`](Self::links), between which the way along the robot is longer than
    /// `clearance` (m) in a posture: those that follow one another, or have only something short between them, never come
    /// apart by more than that.
    pub fn pairs_apart(&self, posture: &[f64], clearance: f64) -> Vec<[usize; 2]> {
        let (ways, count) = (self.ways(&self.at(posture)), self.parts.len());
        let way = |one: &[usize; 2], other: &[usize; 2]| {
            let ends = one.iter().flat_map(|a| other.iter().map(move |b| a * count + b));
            ends.map(|ends| ways[ends]).fold(f64::INFINITY, f64::min)
        };
        let pairs = (0..self.links.len()).flat_map(|one| (one + 1..self.links.len()).map(move |other| [one, other]));
        pairs.filter(|[one, other]| way(&self.links[*one], &self.links[*other]) > clearance).collect()
    }

    /// The ways along the robot between all parts, row by row, metres: along links, and straight between what one link carries.
    fn ways(&self, points: &[Point3<f64>]) -> Vec<f64> {
        let count = self.parts.len();
        let mut ways = vec![f64::INFINITY; count * count];
        let mut join = |a: usize, b: usize| {
            let way = (points[a] - points[b]).norm();
            (ways[a * count + b], ways[b * count + a]) = (way, way);
        };
        self.links.iter().for_each(|[a, b]| join(*a, *b));
        for a in 0..count {
            (a..count).filter(|b| self.parts[a].link == self.parts[*b].link).for_each(|b| join(a, b));
        }
        for over in 0..count {
            for a in 0..count {
                for b in 0..count {
                    let way = ways[a * count + over] + ways[over * count + b];
                    ways[a * count + b] = ways[a * count + b].min(way);
                }
            }
        }
        ways
    }
}

/// Whether a joint before `link` moves a point: it is not on all their axes.
fn is_moved(state: &State, link: usize, point: &Point3<f64>) -> bool {
    state.tree.path(link).any(|joint| (state.joints[joint].exp(1.0) * point - point).norm() > 1e-9)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{
        model::random::{branched, random_arm, random_state},
        sensing::TargetKind,
    };

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

    /// On a tree each part is on its own link, and each link on its own branch, whatever the order of the joints.
    #[test]
    fn links_follow_the_branches_of_a_tree() {
        let mut rng = ChaCha8Rng::seed_from_u64(1005);
        for _ in 0..20 {
            let state = random_state(&mut rng, 7);
            let mut state = branched(state, &mut rng);
            state.base = Isometry3::identity();
            state.corrections.fill(Correction::default());
            let names: Vec<String> = (0..7).map(|joint| joint.to_string()).collect();
            let outline = Outline::new(&state, &names, &Equipment::default());
            let posture: Vec<f64> = (0..7).map(|joint| 0.3 * f64::from(joint) - 0.8).collect();
            let (motions, found) = (state.links(&posture), outline.at(&posture));
            for (part, at) in outline.parts.iter().zip(&found) {
                let joint: usize = part.name.parse().expect("a joint");
                let line = state.joints[joint].line().expect("an origin");
                // It is on the axis of its joint: the links before and behind it agree on where it is.
                for link in [state.tree.link_before(joint), joint + 1] {
                    assert!((motions[link] * line.point - at).norm() < 1e-9, "joint {joint}");
                }
            }
            for ([from, to], _) in outline.links() {
                let [from, to] = [from, to].map(|part| outline.parts[part].name.parse::<usize>().expect("a joint"));
                assert!(state.tree.moves(from, to + 1), "{from} carries {to}");
                let between = state.tree.path(to + 1).skip(1).take_while(|joint| *joint != from);
                assert!(between.into_iter().all(|joint| state.joints[joint].line().is_none()));
            }
        }
    }
}
