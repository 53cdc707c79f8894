//! The chain between two links.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3};

use super::{
    Urdf, UrdfError,
    element::{Body, Mimic},
};
use body_schema_engine::{
    kinematics::{Joint, JointBox, JointBoxError, JointKind, Line},
    model::{Place, State},
    similar::similar,
};

/// What a joint of a description can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentKind {
    /// Turns between limits.
    Revolute,
    /// Turns without end.
    Continuous,
    /// Slides.
    Prismatic,
    /// Does not move.
    Fixed,
}

impl SegmentKind {
    /// Whether the joint turns or slides; `None` for a fixed joint.
    pub fn moves(self) -> Option<JointKind> {
        match self {
            Self::Revolute | Self::Continuous => Some(JointKind::Revolute),
            Self::Prismatic => Some(JointKind::Prismatic),
            Self::Fixed => None,
        }
    }
}

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
    /// The reading that moves it, if it moves: `θ = multiplier · q + offset`, q a [`Reading`] by index.
    pub follows: Option<Follows>,
    /// The index of its joint in the description.
    pub(super) element: usize,
}

/// How a joint's position follows from a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follows {
    /// Index of the reading.
    pub reading: usize,
    /// 1 unless the joint mimics another.
    pub multiplier: f64,
    /// Rad or m; 0 unless the joint mimics another.
    pub offset: f64,
}

impl Segment {
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

/// The joints from a base link to a tip link.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// The base link, in whose frame axes are expressed.
    pub base: String,
    /// All joints, fixed ones too, the one nearest the base first; the last carries the tip link.
    pub segments: Vec<Segment>,
    /// The readings that move them, in the order in which the chain needs them.
    pub readings: Vec<Reading>,
}

impl Chain {
    /// The tip link.
    pub fn tip(&self) -> &str {
        self.segments.last().map_or(&self.base, |segment| &segment.link)
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
        self.moving()
            .filter_map(|segment| segment.follows)
            .map(|follows| follows.multiplier * readings[follows.reading] + follows.offset)
            .collect()
    }

    /// The pose of every link in the base link's frame, from the base to the tip, at positions (rad or m) of the joints
    /// that move.
    pub fn links(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut positions = positions.iter();
        let mut links = vec![Isometry3::identity()];
        for segment in &self.segments {
            let position = segment.kind.moves().and_then(|_| positions.next()).copied().unwrap_or(0.0);
            links.push(links[links.len() - 1] * segment.origin * segment.motion(position));
        }
        links
    }

    /// For every link, from the base to the tip: how many joints before it move, and its frame at θ = 0 in the base
    /// link's.
    pub fn frames(&self) -> Vec<(usize, Isometry3<f64>)> {
        let mut moving = 0;
        let counted = std::iter::once(0).chain(self.segments.iter().map(|segment| {
            moving += usize::from(segment.kind.moves().is_some());
            moving
        }));
        let frames = self.links(&vec![0.0; self.moving().count()]);
        counted.zip(frames).collect()
    }

    /// The pose of the tip link in the base link's frame.
    pub fn tip_at(&self, positions: &[f64]) -> Isometry3<f64> {
        self.links(positions).pop().unwrap_or_default()
    }

    /// The kinematic model of this description: its axes at θ = 0 in the base link's frame, its pivots at the joints'
    /// origins, its only target the tip link's frame.
    pub fn state(&self) -> State {
        let frames = self.links(&vec![0.0; self.moving().count()]);
        let joints = self.segments.iter().zip(&frames[1..]).filter_map(|(segment, frame)| {
            let direction = UnitVector3::new_normalize(frame * segment.axis.into_inner());
            segment.kind.moves().map(|kind| match kind {
                JointKind::Revolute => Joint::Revolute(Line { point: frame.translation.vector.into(), direction }),
                JointKind::Prismatic => Joint::Prismatic(direction),
            })
        });
        let tip = frames[frames.len() - 1];
        let mut state = State::arm(joints.collect(), tip.translation.vector.into());
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
        let (from, to) = (self.link(base)?, self.link(tip)?);
        let mut elements = Vec::new();
        let mut link = to;
        while link != from {
            match self.carried_by[link] {
                Some(joint) if elements.len() < self.joints.len() => {
                    elements.push(joint);
                    link = self.joints[joint].parent;
                }
                Some(joint) => {
                    let what = format!("links go round in a circle behind joint `{}`", self.joints[joint].name);
                    return Err(self.error(self.joints[joint].at, what, "let one link hang on nothing: the root"));
                }
                None => return Err(self.apart(base, tip, &elements)),
            }
        }
        elements.reverse();
        let mut chain = Chain { base: base.to_owned(), segments: Vec::new(), readings: Vec::new() };
        for element in elements {
            let joint = &self.joints[element];
            let body = joint.body.clone()?;
            let follows = body.kind.moves().map(|_| self.follows(element, &body, &mut chain.readings)).transpose()?;
            let Body { kind, origin, axis, limits, .. } = body;
            let (name, link) = (joint.name.clone(), self.links[joint.child].clone());
            chain.segments.push(Segment { name, link, kind, origin, axis, limits, follows, element });
        }
        if chain.readings.is_empty() {
            let hint = "name links with a revolute, continuous or prismatic joint between them";
            return Err(self.error(self.start, format!("no joint moves between `{base}` and `{tip}`"), hint));
        }
        Ok(chain)
    }

    fn error(&self, at: usize, what: impl Into<String>, hint: impl Into<String>) -> UrdfError {
        UrdfError::at(&self.text, at, what, hint)
    }

    fn link(&self, name: &str) -> Result<usize, UrdfError> {
        if let Some(index) = self.links.iter().position(|link| link == name) {
            return Ok(index);
        }
        let hint = if let Some(joint) = self.joints.iter().find(|joint| joint.name == name) {
            format!("`{name}` is a joint; the link that it carries is `{}`", self.links[joint.child])
        } else if let Some(known) = similar(name, self.links.iter().map(String::as_str)) {
            format!("did you mean `{known}`?")
        } else {
            format!("its links are {}", listed(self.links.iter().map(String::as_str)))
        };
        Err(self.error(self.start, format!("this robot has no link `{name}`"), hint))
    }

    /// The error that `tip` does not hang on `base`; `elements` are the joints that it hangs on.
    fn apart(&self, base: &str, tip: &str, elements: &[usize]) -> UrdfError {
        let above = elements.iter().map(|joint| self.links[self.joints[*joint].parent].as_str());
        let hint = match elements {
            [] => format!("`{tip}` hangs on nothing: name it as base, and a link that hangs on it as tip"),
            _ => format!("name as base one of {}", listed(above)),
        };
        let at = elements.first().map_or(self.start, |joint| self.joints[*joint].at);
        self.error(at, format!("link `{tip}` does not hang on `{base}`"), hint)
    }

    /// The reading that moves a joint, directly or through joints that it mimics.
    fn follows(&self, element: usize, body: &Body, readings: &mut Vec<Reading>) -> Result<Follows, UrdfError> {
        let (mut multiplier, mut offset) = (1.0, 0.0);
        let (mut element, mut body) = (element, body);
        let mut passed = 0;
        while let Some(Mimic { joint: name, multiplier: m, offset: b, at }) = &body.mimic {
            (offset, multiplier) = (multiplier * b + offset, multiplier * m);
            let Some(next) = self.joints.iter().position(|joint| &joint.name == name) else {
                let hint = match similar(name, self.joints.iter().map(|joint| joint.name.as_str())) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => "name a joint of this robot".to_owned(),
                };
                return Err(self.error(*at, format!("there is no joint `{name}` to mimic"), hint));
            };
            body = self.joints[next].body.as_ref().map_err(Clone::clone)?;
            passed += 1;
            if passed > self.joints.len() || body.kind.moves().is_none() {
                let what = format!("joint `{}` mimics `{name}`, which nothing moves", self.joints[element].name);
                return Err(self.error(*at, what, "let it mimic a joint that moves by itself"));
            }
            element = next;
        }
        let name = &self.joints[element].name;
        let known = readings.iter().position(|reading| &reading.name == name);
        let reading = known.unwrap_or_else(|| {
            let kind = body.kind.moves().unwrap_or(JointKind::Revolute);
            readings.push(Reading { name: name.clone(), kind, limits: body.limits });
            readings.len() - 1
        });
        Ok(Follows { reading, multiplier, offset })
    }
}

/// The names as a list, shortened so that it stays readable.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 20;
    let names: Vec<&str> = names.collect();
    let more = names.len().saturating_sub(SHOWN);
    let end = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{end}", names[..names.len() - more].join(", "))
}
