//! The values of attributes.

use std::ops::Range;

use roxmltree::{Attribute, Node};

use super::UrdfError;
use body_schema_engine::{
    numeric_range::{is_usable, what_is_wrong},
    suggest::suggest,
};

/// The instruction for turning xacro files into URDF.
pub const EXPAND: &str = "expand it first: `xacro robot.urdf.xacro > robot.urdf` (part of ROS; without it, `pip install \
                          xacro`)";

/// An error at a byte of the document.
pub fn error(node: Node, byte: usize, what: impl Into<String>, hint: impl Into<String>) -> UrdfError {
    UrdfError::at(node.document().input_text(), byte, what, hint)
}

/// Whether a value is a placeholder that xacro should fill in.
pub fn is_expression(value: &str) -> bool {
    value.contains("${") || value.contains("$(")
}

/// A required attribute, and its place.
pub fn required<'a>(node: Node<'a, '_>, name: &str) -> Result<(&'a str, Range<usize>), UrdfError> {
    if let Some(attribute) = node.attribute_node(name) {
        return Ok((attribute.value(), attribute.range_value()));
    }
    let tag = node.tag_name().name();
    let hint = match suggest(name, node.attributes().map(|given| given.name())) {
        Some(given) => format!("write `{name}` instead of `{given}`"),
        None => format!("add {name}=\"…\""),
    };
    Err(error(node, node.range().start, format!("<{tag}> has no `{name}`"), hint))
}

/// The only child of that name, if there is one. Several are refused, because readers differ in which one they take.
pub fn only_child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Result<Option<Node<'a, 'i>>, UrdfError> {
    let mut found = node.children().filter(|child| child.is_element() && child.tag_name().name() == name);
    let first = found.next();
    match found.next() {
        None => Ok(first),
        Some(second) => {
            let joint = node.attribute("name").unwrap_or_default();
            let what = format!("joint `{joint}` has a second <{name}>");
            Err(error(node, second.range().start, what, "leave one of them"))
        }
    }
}

/// The number that an attribute holds; `default` where it is absent.
pub fn number(node: Node, name: &str, default: f64) -> Result<f64, UrdfError> {
    match node.attribute_node(name) {
        None => Ok(default),
        Some(attribute) => Ok(numbers::<1>(node, &attribute)?[0]),
    }
}

/// The numbers that an attribute holds, separated by white space.
pub fn numbers<const N: usize>(node: Node, attribute: &Attribute) -> Result<[f64; N], UrdfError> {
    let (value, name) = (attribute.value(), attribute.name());
    let wrong = |what: String, hint: String| error(node, attribute.range_value().start, what, hint);
    if is_expression(value) {
        return Err(wrong(format!("`{value}` is an expression of xacro"), EXPAND.to_owned()));
    }
    let mut numbers = Vec::with_capacity(N);
    for word in value.split_ascii_whitespace() {
        match word.parse::<f64>() {
            Ok(number) if is_usable(number) => numbers.push(number),
            _ => {
                let hint = "write numbers such as 0.03, with spaces between them".to_owned();
                return Err(wrong(format!("`{word}` in `{name}` {}", what_is_wrong(word)), hint));
            }
        }
    }
    let found = numbers.len();
    numbers.try_into().map_err(|_| {
        let hint = if N == 1 { "write one".to_owned() } else { format!("write {N}, with spaces between them") };
        wrong(format!("`{name}` holds {found} numbers"), hint)
    })
}
