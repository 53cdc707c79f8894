//! What links look like: boxes, cylinders, balls and meshes.
//!
//! Nothing is computed from them, so that what cannot be read is left out without a word.

use nalgebra::Isometry3;
use roxmltree::Node;

use super::{
    element::origin,
    values::{number, numbers},
};

/// A shape of a link, in the link's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Where it is.
    pub origin: Isometry3<f64>,
    /// What it is.
    pub solid: Solid,
}

/// What a shape is.
#[derive(Clone, Debug, PartialEq)]
pub enum Solid {
    /// A box about the origin, metres along x, y and z.
    Box([f64; 3]),
    /// A cylinder about the origin, along z.
    Cylinder {
        /// Metres.
        radius_m: f64,
        /// Metres.
        length_m: f64,
    },
    /// A ball about the origin, whose radius is in metres.
    Ball(f64),
    /// A mesh in a file.
    Mesh {
        /// The file as the description names it.
        file: String,
        /// The factors of its x, y and z.
        scale: [f64; 3],
    },
}

/// The shapes of one link.
#[derive(Clone, Debug, Default)]
pub(super) struct LinkShapes {
    pub(super) visual: Vec<Shape>,
    pub(super) collision: Vec<Shape>,
}

/// The shapes of a `<link>`.
pub(super) fn read(link: Node) -> LinkShapes {
    let of_kind = |kind: &str| {
        let nodes = link.children().filter(|node| node.tag_name().name() == kind);
        nodes.filter_map(shape).collect()
    };
    LinkShapes { visual: of_kind("visual"), collision: of_kind("collision") }
}

/// The shape of a `<visual>` or `<collision>`; `None` where it has none that can be drawn.
fn shape(node: Node) -> Option<Shape> {
    let geometry = node.children().find(|child| child.tag_name().name() == "geometry")?;
    let element = geometry.children().find(Node::is_element)?;
    let length = |name: &str| number(element, name, f64::NAN).ok().filter(|length| *length > 0.0);
    let triple = |name: &str| element.attribute_node(name).and_then(|triple| numbers::<3>(element, &triple).ok());
    let solid = match element.tag_name().name() {
        "box" => Solid::Box(triple("size").filter(|size| size.iter().all(|side| *side > 0.0))?),
        "cylinder" => Solid::Cylinder { radius_m: length("radius")?, length_m: length("length")? },
        "sphere" => Solid::Ball(length("radius")?),
        "mesh" => {
            let scale = if element.has_attribute("scale") { triple("scale")? } else { [1.0; 3] };
            Solid::Mesh { file: element.attribute("filename")?.to_owned(), scale }
        }
        _ => return None,
    };
    Some(Shape { origin: origin(node).ok()?.0, solid })
}
