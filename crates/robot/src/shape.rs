//! What links look like: boxes, cylinders, balls and meshes.
//!
//! Nothing is computed from them, so that what cannot be read is left out without a word.

use std::collections::VecDeque;

use nalgebra::Isometry3;
use roxmltree::Node;

use super::{
    Chain, Urdf,
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

/// A link on a chain, or one that hangs on such a link.
#[derive(Clone, Debug)]
pub struct Attached<'a> {
    /// Its name.
    pub link: &'a str,
    /// The index of the chain's link that carries it, 0 being the base; itself for a link on the chain.
    pub carrier: usize,
    /// Its frame in that link's, with the joints between the two at 0.
    pub place: Isometry3<f64>,
    /// What it looks like, as its `<visual>`s say.
    pub visual: &'a [Shape],
    /// What it collides with, as its `<collision>`s say.
    pub collision: &'a [Shape],
}

impl Urdf {
    /// All links of the robot as parts of a chain of it: those on it from base to tip, then those that hang on them or on which
    /// the base hangs, with all other joints at 0. Links behind a floating or planar joint are left out.
    pub fn attached(&self, chain: &Chain) -> Vec<Attached<'_>> {
        let index = |name: &str| self.links.iter().position(|link| link == name);
        let names = std::iter::once(chain.base.as_str()).chain(chain.segments.iter().map(|it| it.link.as_str()));
        let on_chain: Vec<usize> = names.filter_map(index).collect();
        let mut neighbours = vec![Vec::new(); self.links.len()];
        for joint in &self.joints {
            let Ok(body) = &joint.body else { continue };
            neighbours[joint.parent].push((joint.child, body.origin));
            neighbours[joint.child].push((joint.parent, body.origin.inverse()));
        }
        let mut is_known = vec![false; self.links.len()];
        on_chain.iter().for_each(|link| is_known[*link] = true);
        let mut waiting: VecDeque<_> =
            on_chain.iter().enumerate().map(|(carrier, link)| (*link, carrier, Isometry3::identity())).collect();
        let mut found = Vec::new();
        while let Some((link, carrier, place)) = waiting.pop_front() {
            let LinkShapes { visual, collision } = &self.shapes[link];
            found.push(Attached { link: &self.links[link], carrier, place, visual, collision });
            for (next, motion) in &neighbours[link] {
                if !std::mem::replace(&mut is_known[*next], true) {
                    waiting.push_back((*next, carrier, place * motion));
                }
            }
        }
        found
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = r#"<robot name="r">
      <link name="floor"><visual><geometry><box size="1 1 0.1"/></geometry></visual></link>
      <link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
      <link name="rod">
        <visual><origin xyz="0 0 0.5"/><geometry><cylinder radius="0.02" length="1"/></geometry></visual>
        <visual><geometry><box size="1 1"/></geometry></visual>
        <visual><geometry><capsule radius="0.1" length="1"/></geometry></visual>
        <visual><geometry><sphere radius="-1"/></geometry></visual>
      </link>
      <link name="hand">
        <visual><geometry><mesh filename="package://r/hand.stl" scale="0.001 0.001 0.001"/></geometry></visual>
      </link>
      <link name="loose"><visual><geometry><sphere radius="1"/></geometry></visual></link>
      <joint name="stands" type="fixed"><parent link="floor"/><child link="base"/><origin xyz="0 0 0.3"/></joint>
      <joint name="swings" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="0 0 1"/>
        <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
      <joint name="holds" type="prismatic"><parent link="rod"/><child link="hand"/><origin xyz="0 0 2"/>
        <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
      <joint name="flies" type="floating"><parent link="rod"/><child link="loose"/></joint>
    </robot>"#;

    #[test]
    fn all_that_hangs_together_is_there_where_it_is() {
        let urdf = Urdf::parse(ROBOT).unwrap();
        let attached = urdf.attached(&urdf.chain("base", "rod").unwrap());
        let told: Vec<_> = attached
            .iter()
            .map(|it| (it.carrier, it.place.translation.z, it.visual.len(), it.collision.len()))
            .collect();
        assert_eq!(told, [(0, 0.0, 0, 1), (1, 0.0, 1, 0), (0, -0.3, 1, 0), (1, 2.0, 1, 0)]);
        let [Shape { origin, solid }] = attached[1].visual else { panic!("what cannot be drawn is left out") };
        assert_eq!((origin.translation.z, solid), (0.5, &Solid::Cylinder { radius_m: 0.02, length_m: 1.0 }));
        let mesh = Solid::Mesh { file: "package://r/hand.stl".to_owned(), scale: [1e-3; 3] };
        assert_eq!(attached[3].visual[0].solid, mesh);
        assert_eq!(attached[2].visual[0].solid, Solid::Box([1.0, 1.0, 0.1]));
        assert_eq!(attached[0].collision[0].solid, Solid::Ball(0.1));
    }
}
