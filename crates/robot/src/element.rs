//! One `<joint>` of a description.

use std::ops::Range;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use roxmltree::Node;

use super::{
    UrdfError,
    values::{EXPAND, error, is_expression, number, numbers, only_child, required},
};
use body_schema_engine::kinematics::JointKind;

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

/// The content of a joint's element besides its name and its links.
#[derive(Clone, Debug)]
pub struct Body {
    pub kind: SegmentKind,
    pub origin: Isometry3<f64>,
    pub text: OriginText,
    /// The axis in the joint's frame; x for a fixed joint.
    pub axis: UnitVector3<f64>,
    /// Limits, rad or m; `None` for a fixed joint and for one that turns without end. A missing limit on one side is
    /// ±∞.
    pub limits: Option<(f64, f64)>,
    pub mimic: Option<Mimic>,
}

/// A joint that follows others: `θ = Σ multiplier · q + offset`.
#[derive(Clone, Debug)]
pub struct Mimic {
    pub terms: Vec<Term>,
    pub offset: f64,
    /// Where it is said, as a byte.
    pub at: usize,
}

/// A joint that another follows.
#[derive(Clone, Debug)]
pub struct Term {
    pub joint: String,
    pub multiplier: f64,
}

/// The places in the text where a joint's origin is written.
#[derive(Clone, Debug)]
pub struct OriginText {
    /// The bytes of the value of `xyz`.
    pub xyz: Option<Range<usize>>,
    /// The bytes of the value of `rpy` or `quat_xyzw`.
    pub rotation: Option<Range<usize>>,
    /// Roll, pitch and yaw as written; `None` where a quaternion is.
    pub rpy: Option<[f64; 3]>,
    /// The place for what is missing.
    pub insert: Insert,
}

/// A place for text that is not there yet.
#[derive(Clone, Debug)]
pub enum Insert {
    /// Attributes, behind the name of the element.
    Attribute(usize),
    /// An element, followed by the white space that stands before the next.
    Element { at: usize, space: String },
}

impl Body {
    pub fn read(node: Node) -> Result<Self, UrdfError> {
        let (kind, at) = required(node, "type")?;
        if is_expression(kind) {
            return Err(error(node, at.start, format!("`{kind}` is an expression of xacro"), EXPAND));
        }
        let kind = match kind {
            "revolute" => SegmentKind::Revolute,
            "continuous" => SegmentKind::Continuous,
            "prismatic" => SegmentKind::Prismatic,
            "fixed" => SegmentKind::Fixed,
            other => {
                let child = node.children().find(|child| child.tag_name().name() == "child");
                let child = child.and_then(|child| child.attribute("link")).unwrap_or_default();
                let what = format!("joint `{}` is of type `{other}`, which is not part of a chain", name_of(node));
                let hint = format!(
                    "a chain has revolute, continuous, prismatic and fixed joints; name links between which there are no others, as \
                     `{child}`, which it carries, for the base"
                );
                return Err(error(node, at.start, what, hint));
            }
        };
        let (origin, text) = origin(node)?;
        let mimic = match only_child(node, "mimic")? {
            Some(mimic) if kind != SegmentKind::Fixed => {
                let (joint, at) = required(mimic, "joint")?;
                let multiplier = number(mimic, "multiplier", 1.0)?;
                let offset = number(mimic, "offset", 0.0)?;
                Some(Mimic { terms: vec![Term { joint: joint.to_owned(), multiplier }], offset, at: at.start })
            }
            _ => None,
        };
        Ok(Self { kind, origin, text, axis: axis(node, kind)?, limits: limits(node, kind, mimic.is_some())?, mimic })
    }
}

pub fn origin(joint: Node) -> Result<(Isometry3<f64>, OriginText), UrdfError> {
    let Some(node) = only_child(joint, "origin")? else {
        return Ok((
            Isometry3::identity(),
            OriginText { xyz: None, rotation: None, rpy: Some([0.0; 3]), insert: before_first_child(joint) },
        ));
    };
    let (xyz, rpy, quaternion) =
        (node.attribute_node("xyz"), node.attribute_node("rpy"), node.attribute_node("quat_xyzw"));
    let at = match &xyz {
        Some(xyz) => numbers::<3>(node, xyz)?,
        None => [0.0; 3],
    };
    let (rotation, written) = match (&rpy, &quaternion) {
        (Some(_), Some(quaternion)) => {
            let hint = "leave one of them";
            return Err(error(node, quaternion.range().start, "<origin> has `rpy` and `quat_xyzw`", hint));
        }
        (_, Some(quaternion)) => {
            let [x, y, z, w] = numbers(node, quaternion)?;
            let norm = Quaternion::new(w, x, y, z).norm();
            if !(1e-6..1e6).contains(&norm) {
                let what = format!("the quaternion `{}` has the length {norm}", quaternion.value());
                return Err(error(node, quaternion.range_value().start, what, "write one of length 1: 0 0 0 1, say"));
            }
            (UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)), None)
        }
        (Some(rpy), None) => {
            let angles @ [roll, pitch, yaw] = numbers(node, rpy)?;
            (UnitQuaternion::from_euler_angles(roll, pitch, yaw), Some(angles))
        }
        (None, None) => (UnitQuaternion::identity(), Some([0.0; 3])),
    };
    let text = OriginText {
        xyz: xyz.map(|attribute| attribute.range_value()),
        rotation: rpy.or(quaternion).map(|attribute| attribute.range_value()),
        rpy: written,
        insert: Insert::Attribute(behind_name(node)),
    };
    Ok((Isometry3::from_parts(Translation3::from(Vector3::from(at)), rotation), text))
}

/// The byte behind the name in `<name …`.
fn behind_name(node: Node) -> usize {
    let start = node.range().start;
    let text = &node.document().input_text()[start..];
    start + text.find(|c: char| c.is_ascii_whitespace() || c == '/' || c == '>').unwrap_or(text.len())
}

fn before_first_child(joint: Node) -> Insert {
    let text = joint.document().input_text();
    // A joint has children: its parent and its child link.
    let at = joint.first_element_child().map_or(joint.range().end, |child| child.range().start);
    let before = text[..at].trim_end_matches(|c: char| c.is_ascii_whitespace()).len();
    Insert::Element { at, space: text[before..at].to_owned() }
}

fn axis(joint: Node, kind: SegmentKind) -> Result<UnitVector3<f64>, UrdfError> {
    let Some(node) = only_child(joint, "axis")?.filter(|_| kind != SegmentKind::Fixed) else {
        return Ok(Vector3::x_axis());
    };
    let (_, at) = required(node, "xyz")?;
    let Some(attribute) = node.attribute_node("xyz") else { return Ok(Vector3::x_axis()) };
    let axis = Vector3::from(numbers::<3>(node, &attribute)?);
    UnitVector3::try_new(axis, 1e-9).ok_or_else(|| {
        let what = format!("the axis `{}` has no direction", attribute.value());
        error(node, at.start, what, "write a direction, as 0 0 1, or make the joint `fixed`")
    })
}

/// The magnitude, radians or metres, from which on a limit stands for none.
const PLACEHOLDER: f64 = 1e4;

fn limits(joint: Node, kind: SegmentKind, follows: bool) -> Result<Option<(f64, f64)>, UrdfError> {
    if matches!(kind, SegmentKind::Fixed | SegmentKind::Continuous) {
        return Ok(None);
    }
    let name = name_of(joint);
    let Some(node) = only_child(joint, "limit")? else {
        let what = format!("joint `{name}` has no <limit>");
        let hint = "add <limit lower=\"…\" upper=\"…\" effort=\"0\" velocity=\"0\"/>, in radians or metres; a joint that \
                    turns without end is `continuous`";
        return Err(error(joint, joint.range().start, what, hint));
    };
    let (lower, upper) = (limit(node, "lower")?, limit(node, "upper")?);
    let wrong =
        |what: String, hint: &str| Err(error(node, node.range().start, format!("joint `{name}`: {what}"), hint));
    if lower > upper {
        let hint = format!("write lower=\"{upper}\" upper=\"{lower}\"");
        return wrong(format!("the lower limit {lower} is above the upper {upper}"), &hint);
    }
    let is_unlimited = lower.is_infinite() || upper.is_infinite();
    match kind {
        SegmentKind::Prismatic if is_unlimited => wrong(
            format!("a limit of {PLACEHOLDER} m or more stands for none, and it has to have one"),
            "write how far it slides, in metres",
        ),
        // Where another joint moves it, that one's limits count.
        _ if lower == upper && !follows => {
            let is_said = node.has_attribute("lower") || node.has_attribute("upper");
            let what = if is_said {
                format!("it cannot move, as its limits are both {lower}")
            } else {
                "it cannot move, as its <limit> has no `lower` and no `upper`, which are 0 then".to_owned()
            };
            let hint = match kind {
                SegmentKind::Prismatic => "write how far it slides, in metres, or make it `fixed`",
                _ => {
                    "write how far it turns, in radians, make it `continuous` if it turns without end, or `fixed` if it does not turn"
                }
            };
            wrong(what, hint)
        }
        _ if lower == f64::NEG_INFINITY && upper == f64::INFINITY => Ok(None),
        _ => Ok(Some((lower, upper))),
    }
}

/// A limit; infinite where it stands for none.
fn limit(node: Node, name: &str) -> Result<f64, UrdfError> {
    let written = node.attribute(name).and_then(|value| value.trim().parse::<f64>().ok());
    match written {
        Some(far) if far.abs() >= PLACEHOLDER => Ok(far.signum() * f64::INFINITY),
        _ => number(node, name, 0.0),
    }
}

/// The joint's name.
fn name_of<'a>(joint: Node<'a, '_>) -> &'a str {
    joint.attribute("name").unwrap_or_default()
}
