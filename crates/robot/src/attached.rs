//! The links of a chain and those that hang on them, with what they look like.

use std::collections::VecDeque;

use nalgebra::Isometry3;

use super::{Chain, Shape, Urdf, shape::LinkShapes};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Solid;

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
