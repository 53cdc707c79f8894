//! The joints between a base link and one or several tip links.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3};

use super::{
    Urdf, UrdfError,
    element::{Body, Mimic, SegmentKind, Term},
    read::JointElement,
};
use body_schema_engine::{
    kinematics::{Joint, JointBox, JointBoxError, JointKind, Line, Tree},
    model::{Place, State},
    suggest::did_you_mean,
};

/// One joint of a chain, moving or fixed, with the link behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The joint's name.
    pub name: String,
    /// The link that it carries.
    pub link: String,
    /// Its kind.
    pub kind: SegmentKind,
    /// The joint's frame in that of the link before it.
    pub origin: Isometry3<f64>,
    /// The axis in the joint's frame.
    pub axis: UnitVector3<f64>,
    /// Limits, rad or m; `None` for a fixed joint, a continuous one, and a revolute one whose limits are 1e4 or more to both sides,
    /// which stand for no limits. Without a limit on one side that one is ±∞.
    pub limits: Option<(f64, f64)>,
    /// The readings that move it, if it moves.
    pub follows: Option<Follows>,
    /// The index of the segment whose link carries the joint; `None` if the base link does.
    pub(super) parent: Option<usize>,
    /// The index of its joint in the description.
    pub(super) element: usize,
}

/// How a joint's position follows from readings: `θ = Σ multiplier · q + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Follows {
    /// The index of each [`Reading`] q, in `Chain::readings`, with its multiplier. The joint's own, with 1, unless it mimics another or is
    /// [coupled](Urdf::couple) to several; each reading once.
    pub terms: Vec<(usize, f64)>,
    /// Rad or m; 0 unless the joint mimics another.
    pub offset: f64,
}

impl Follows {
    /// The joint's position at these readings, rad or m.
    pub fn position(&self, readings: &[f64]) -> f64 {
        // One term is a product and a sum, as it always was, to the last bit.
        let mut terms = self.terms.iter().map(|(reading, multiplier)| multiplier * readings[*reading]);
        let first = terms.next().unwrap_or(0.0);
        terms.fold(first, |sum, term| sum + term) + self.offset
    }

    /// The indices of the readings.
    pub fn readings(&self) -> impl Iterator<Item = usize> {
        self.terms.iter().map(|(reading, _)| *reading)
    }
}

impl Segment {
    /// The index of the segment whose link carries the joint, which comes before it; `None` if the base link does.
    pub fn parent(&self) -> Option<usize> {
        self.parent
    }

    /// The joint's motion at a position (rad or m), in its own frame.
    pub fn motion(&self, position: f64) -> Isometry3<f64> {
        match self.kind.moves() {
            Some(JointKind::Revolute) => {
                let rotation = UnitQuaternion::from_axis_angle(&self.axis, position);
                Isometry3::from_parts(Translation3::identity(), rotation)
            }
            Some(JointKind::Prismatic) => Translation3::from(self.axis.into_inner() * position).into(),
            None => Isometry3::identity(),
        }
    }

    /// The range of positions that it is asked to take, rad or m: its limits, for a joint that turns at most a turn to either
    /// side; half a turn to each side for a joint that turns without end.
    fn range(&self) -> (f64, f64) {
        // As limits are rounded.
        const ABOUT_A_TURN: f64 = TAU + 0.01;
        let Some((lower, upper)) = self.limits else { return (-PI, PI) };
        let is_within = lower >= -ABOUT_A_TURN && upper <= ABOUT_A_TURN;
        if is_within || self.kind == SegmentKind::Prismatic {
            return (lower, upper);
        }
        let (from, to) = (lower.max(-TAU), upper.min(TAU));
        if to - from >= (upper - lower).min(PI) {
            (from, to)
        } else if lower > -upper {
            (lower, upper.min(lower + TAU))
        } else {
            (lower.max(upper - TAU), upper)
        }
    }
}

/// A reading of the robot: the position of a joint that follows no other.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The joint's name, by which tables of measurements know it.
    pub name: String,
    /// Radians or metres.
    pub kind: JointKind,
    /// Limits, rad or m; `None` for a joint that turns without end, ±∞ where there is none to one side.
    pub limits: Option<(f64, f64)>,
}

/// The joints from a base link to its tip links: one chain, or several that branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// The base link, in whose frame axes are expressed.
    pub base: String,
    /// All joints, fixed ones too, each behind the one that carries it: from the base to the first tip, then what is not there yet of
    /// the way to the second, and so on.
    pub segments: Vec<Segment>,
    /// The readings that move them, in the order in which the joints need them.
    pub readings: Vec<Reading>,
    /// The tip links, as indices of [`links`](Self::links).
    pub(super) tips: Vec<usize>,
}

impl Chain {
    /// The first tip link.
    pub fn tip(&self) -> &str {
        self.tips.first().map_or(&self.base, |tip| self.link(*tip))
    }

    /// The tip links, in the order in which they were asked for.
    pub fn tips(&self) -> impl Iterator<Item = &str> {
        self.tips.iter().map(|tip| self.link(*tip))
    }

    /// The name of the link at an index of [`links`](Self::links).
    pub fn link(&self, index: usize) -> &str {
        index.checked_sub(1).and_then(|segment| self.segments.get(segment)).map_or(&self.base, |it| &it.link)
    }

    /// The joints that move, in order: those of [`state`](Self::state).
    pub fn moving(&self) -> impl Iterator<Item = &Segment> {
        self.segments.iter().filter(|segment| segment.kind.moves().is_some())
    }

    /// The names of the joints that move.
    pub fn names(&self) -> Vec<String> {
        self.moving().map(|segment| segment.name.clone()).collect()
    }

    /// The limits of the joints that move, rad or m; half a turn to each side where a joint turns without end. A joint that turns
    /// further is limited to a turn on either side, within which it reaches every orientation.
    ///
    /// # Errors
    ///
    /// [`JointBoxError`] if limits are so far apart that their difference is not finite.
    pub fn limits(&self) -> Result<JointBox, JointBoxError> {
        JointBox::new(self.moving().map(Segment::range).collect())
    }

    /// The positions of the joints that move (rad or m) at `readings`, in the order of [`readings`](Self::readings).
    pub fn positions(&self, readings: &[f64]) -> Vec<f64> {
        debug_assert_eq!(readings.len(), self.readings.len());
        self.moving().filter_map(|segment| segment.follows.as_ref()).map(|follows| follows.position(readings)).collect()
    }

    /// What `behind` computes for every link, the base first: from each segment, its index among the joints that move if it is one of
    /// them, and the value of the link that carries it.
    fn sweep<T>(&self, base: T, mut behind: impl FnMut(&Segment, Option<usize>, &T) -> T) -> Vec<T> {
        let mut links = Vec::with_capacity(self.segments.len() + 1);
        links.push(base);
        let mut joints = 0..;
        for segment in &self.segments {
            let joint = segment.kind.moves().and_then(|_| joints.next());
            let link = behind(segment, joint, &links[segment.parent.map_or(0, |parent| parent + 1)]);
            links.push(link);
        }
        links
    }

    /// The pose of every link in the base link's frame, the base first, then the link of each segment, at positions (rad or m) of the
    /// joints that move.
    pub fn links(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        self.sweep(Isometry3::identity(), |segment, joint, before| {
            let position = joint.and_then(|joint| positions.get(joint)).copied().unwrap_or(0.0);
            before * segment.origin * segment.motion(position)
        })
    }

    /// The link of [`state`](Self::state) on which every link of the robot is: 0 for what the base carries through fixed joints alone,
    /// else i + 1 behind the i-th joint that moves.
    fn carriers(&self) -> Vec<usize> {
        self.sweep(0, |_, joint, before| joint.map_or(*before, |joint| joint + 1))
    }

    /// For every link, the base first: the link of [`state`](Self::state) on which it is, 0 for the base and i + 1 for what the i-th
    /// moving joint carries, and its frame at θ = 0 in the base link's.
    pub fn frames(&self) -> Vec<(usize, Isometry3<f64>)> {
        self.carriers().into_iter().zip(self.links(&[])).collect()
    }

    /// Which moving joint carries which.
    pub fn tree(&self) -> Tree {
        let carriers = self.carriers();
        let before = |segment: &Segment| carriers[segment.parent.map_or(0, |parent| parent + 1)];
        // Parents come before their children.
        Tree::new(self.moving().map(|segment| before(segment).checked_sub(1)).collect()).unwrap_or_default()
    }

    /// For every link of [`state`](Self::state), the base first, the link by whose name and frame it is known, as an index of
    /// [`links`](Self::links): the first tip on it, or else the link right behind its joint.
    pub fn bodies(&self) -> Vec<usize> {
        let carriers = self.carriers();
        let mut bodies: Vec<usize> = Vec::new();
        for (link, carrier) in carriers.iter().enumerate() {
            if *carrier == bodies.len() {
                bodies.push(link);
            }
        }
        for tip in self.tips.iter().rev().filter(|tip| carriers[**tip] > 0) {
            bodies[carriers[*tip]] = *tip;
        }
        bodies
    }

    /// The pose of the first tip link in the base link's frame.
    pub fn tip_at(&self, positions: &[f64]) -> Isometry3<f64> {
        self.links(positions)[self.first_tip()]
    }

    fn first_tip(&self) -> usize {
        self.tips.first().copied().unwrap_or_default()
    }

    /// The kinematic model of this description: its axes at θ = 0 in the base link's frame, its pivots at the joints'
    /// origins, its only target the first tip link's frame.
    pub fn state(&self) -> State {
        let frames = self.links(&[]);
        let joints = self.segments.iter().zip(&frames[1..]).filter_map(|(segment, frame)| {
            let direction = UnitVector3::new_normalize(frame * segment.axis.into_inner());
            segment.kind.moves().map(|kind| match kind {
                JointKind::Revolute => Joint::Revolute(Line { point: frame.translation.vector.into(), direction }),
                JointKind::Prismatic => Joint::Prismatic(direction),
            })
        });
        let tip = frames[self.first_tip()];
        let mut state = State::arm(joints.collect(), tip.translation.vector.into());
        state.tree = self.tree();
        state.targets[0].link = self.carriers()[self.first_tip()];
        state.targets[0].place = Place::Pose(tip);
        state
    }
}

impl Urdf {
    /// The chain from link `base` to link `tip`, which hangs on it.
    ///
    /// # Errors
    ///
    /// [`UrdfError`] if there is no such chain, nothing on it moves, or one of its joints is of a kind that a chain cannot
    /// have.
    pub fn chain(&self, base: &str, tip: &str) -> Result<Chain, UrdfError> {
        self.branches(base, &[tip])
    }

    /// The joints from link `base` to each of the links `tips`, which hang on it: the way to the first, then what is not on it of the
    /// way to the second, and so on.
    ///
    /// # Errors
    ///
    /// [`UrdfError`] if one of the tips does not hang on `base`, nothing between them moves, or one of the joints is of a kind that a
    /// chain cannot have.
    pub fn branches(&self, base: &str, tips: &[&str]) -> Result<Chain, UrdfError> {
        let from = self.link_index(base)?;
        let ends = tips.iter().map(|tip| self.link_index(tip)).collect::<Result<Vec<_>, _>>()?;
        let mut chain = Chain { base: base.to_owned(), segments: Vec::new(), readings: Vec::new(), tips: Vec::new() };
        // For each link of the description its place among those of the chain.
        let mut places = vec![None; self.links.len()];
        places[from] = Some(0);
        for (tip, end) in tips.iter().zip(ends) {
            let (mut link, mut elements) = (end, Vec::new());
            let mut place = loop {
                match (places[link], self.carried_by[link]) {
                    (Some(place), _) => break place,
                    (None, Some(joint)) if elements.len() < self.joints.len() => {
                        elements.push(joint);
                        link = self.joints[joint].parent;
                    }
                    (None, Some(joint)) => {
                        let what = format!("links go round in a circle behind joint `{}`", self.joints[joint].name);
                        return Err(self.error(self.joints[joint].at, what, "let one link hang on nothing: the root"));
                    }
                    (None, None) => return Err(self.apart(base, tip, tips)),
                }
            };
            for element in elements.into_iter().rev() {
                let joint = &self.joints[element];
                let body = joint.body.clone()?;
                let follows = body.kind.moves().map(|_| self.follows(element, &mut chain.readings)).transpose()?;
                let Body { kind, origin, axis, limits, .. } = body;
                let parent = usize::checked_sub(place, 1);
                let (name, link) = (joint.name.clone(), self.links[joint.child].clone());
                chain.segments.push(Segment { name, link, kind, origin, axis, limits, follows, parent, element });
                place = chain.segments.len();
                places[joint.child] = Some(place);
            }
            chain.tips.push(place);
        }
        if chain.readings.is_empty() {
            let hint = "name links with a revolute, continuous or prismatic joint between them";
            let what = format!("no joint moves between `{base}` and {}", quoted(tips));
            return Err(self.error(self.start, what, hint));
        }
        Ok(chain)
    }

    /// Where a link is that is among those of `chain`, or is carried by one of them through fixed joints alone: the link of the
    /// chain's [`state`](Chain::state), and its frame at θ = 0 in the base link's.
    pub fn fixed_on(&self, chain: &Chain, link: &str) -> Option<(usize, Isometry3<f64>)> {
        let mut index = self.links.iter().position(|known| known == link)?;
        let mut origins = Vec::new();
        loop {
            let name = &self.links[index];
            let names = std::iter::once(&chain.base).chain(chain.segments.iter().map(|segment| &segment.link));
            if let Some((_, (carrier, frame))) = names.zip(chain.frames()).find(|(known, _)| *known == name) {
                return Some((carrier, origins.iter().rev().fold(frame, |frame, origin| frame * origin)));
            }
            let joint = &self.joints[self.carried_by[index].filter(|_| origins.len() < self.joints.len())?];
            let body = joint.body.as_ref().ok().filter(|body| body.kind.moves().is_none())?;
            origins.push(body.origin);
            index = joint.parent;
        }
    }

    /// The link nearest to these links on which all of them hang, itself one of them if the others hang on it; `None` if there is
    /// no such link.
    pub fn ancestor<'a>(&'a self, links: &[&str]) -> Option<&'a str> {
        self.ancestors(links).into_iter().next()
    }

    /// The links on which all of `links` hang or which are among them, the nearest first.
    fn ancestors<'a>(&'a self, links: &[&str]) -> Vec<&'a str> {
        let above = |link: &str| -> Vec<&str> {
            let own = self.links.iter().find(|known| *known == link).map(String::as_str);
            own.into_iter().chain(self.carriers(link).into_iter().map(|joint| joint.parent)).collect()
        };
        let Some((first, others)) = links.split_first() else { return Vec::new() };
        let others: Vec<Vec<&str>> = others.iter().map(|link| above(link)).collect();
        above(first).into_iter().filter(|link| others.iter().all(|above| above.contains(link))).collect()
    }

    fn error(&self, at: usize, what: impl Into<String>, hint: impl Into<String>) -> UrdfError {
        UrdfError::at(&self.text, at, what, hint)
    }

    fn link_index(&self, name: &str) -> Result<usize, UrdfError> {
        if let Some(index) = self.links.iter().position(|link| link == name) {
            return Ok(index);
        }
        let hint = if let Some(joint) = self.joints.iter().find(|joint| joint.name == name) {
            format!("`{name}` is a joint; the link that it carries is `{}`", self.links[joint.child])
        } else {
            let links = || self.links.iter().map(String::as_str);
            did_you_mean(name, links(), || format!("its links are {}", listed(links())))
        };
        Err(self.error(self.start, format!("this robot has no link `{name}`"), hint))
    }

    /// The error that `tip`, one of `tips`, does not hang on `base`.
    fn apart(&self, base: &str, tip: &str, tips: &[&str]) -> UrdfError {
        let carriers = self.carriers(tip);
        let would_do: Vec<&str> = self.ancestors(tips).into_iter().filter(|link| tips != [*link]).collect();
        let hint = match (carriers.as_slice(), would_do.as_slice()) {
            ([], _) => format!("`{tip}` hangs on nothing: name it as base, and a link that hangs on it as tip"),
            (_, []) => format!("no link carries all of {}: name tips that hang on one link", quoted(tips)),
            _ => format!("name as base one of {}", listed(would_do.into_iter())),
        };
        let at = self.links.iter().position(|link| link == tip).and_then(|link| self.carried_by[link]);
        let at = at.map_or(self.start, |joint| self.joints[joint].at);
        self.error(at, format!("link `{tip}` does not hang on `{base}`"), hint)
    }

    /// The readings that move a joint, directly or through joints that it mimics.
    fn follows(&self, element: usize, readings: &mut Vec<Reading>) -> Result<Follows, UrdfError> {
        let follows = Follows { terms: Vec::new(), offset: 0.0 };
        let mut search = Search { readings, follows, way: vec![element], passed: 0 };
        self.follow(element, 1.0, &mut search)?;
        Ok(search.follows)
    }

    /// Adds `factor` times the position of a joint, the last of the way.
    fn follow(&self, element: usize, factor: f64, search: &mut Search<'_>) -> Result<(), UrdfError> {
        let JointElement { name, body, .. } = &self.joints[element];
        let body = body.as_ref().map_err(Clone::clone)?;
        let Some(Mimic { terms, offset, at }) = &body.mimic else {
            let Search { readings, follows, .. } = search;
            let known = readings.iter().position(|reading| &reading.name == name);
            let reading = known.unwrap_or_else(|| {
                let kind = body.kind.moves().unwrap_or(JointKind::Revolute);
                readings.push(Reading { name: name.clone(), kind, limits: body.limits });
                readings.len() - 1
            });
            match follows.terms.iter_mut().find(|(known, _)| *known == reading) {
                Some((_, multiplier)) => *multiplier += factor,
                None => follows.terms.push((reading, factor)),
            }
            return Ok(());
        };
        search.follows.offset += factor * offset;
        for Term { joint: other, multiplier } in terms {
            let Some(next) = self.joints.iter().position(|joint| &joint.name == other) else {
                let hint = did_you_mean(other, self.joints.iter().map(|joint| joint.name.as_str()), || {
                    "name a joint of this robot".to_owned()
                });
                return Err(self.error(*at, format!("there is no joint `{other}` to mimic"), hint));
            };
            let moves = self.joints[next].body.as_ref().map_err(Clone::clone)?.kind.moves().is_some();
            search.passed += 1;
            if !moves || search.way.contains(&next) || search.passed > Search::MOST {
                let what = format!("joint `{name}` mimics `{other}`, which nothing moves");
                return Err(self.error(*at, what, "let it mimic a joint that moves by itself"));
            }
            search.way.push(next);
            self.follow(next, factor * multiplier, search)?;
            search.way.pop();
        }
        Ok(())
    }
}

/// The search for the readings that move a joint.
struct Search<'a> {
    readings: &'a mut Vec<Reading>,
    follows: Follows,
    /// The joints that led to where it is.
    way: Vec<usize>,
    passed: usize,
}

impl Search<'_> {
    /// The most joints that are passed: no linkage has as many.
    const MOST: usize = 10_000;
}

/// The names in quotation marks, with commas between them.
fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// The names as a list, shortened so that it stays readable.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 20;
    let names: Vec<&str> = names.collect();
    let more = names.len().saturating_sub(SHOWN);
    let end = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{end}", names[..names.len() - more].join(", "))
}
