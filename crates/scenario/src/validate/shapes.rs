//! What the links of a described robot are made of.

use super::{Check, raw};
use crate::Described;
use body_schema_engine::selection::Hull;
use body_schema_robot::Hulls;

impl Check<'_> {
    /// The shapes of a described robot's links: those of `robot.shapes`, and of a link that is not among these those that its
    /// `<collision>`s say without a mesh.
    pub(super) fn shapes(&mut self, raw: &raw::Robot, described: Option<&Described>) -> Vec<Hull> {
        let hulls = raw.shapes.as_ref().and_then(|file| {
            let name = file.get_ref();
            let hulls = self
                .opened(name)
                .and_then(|text| Hulls::parse(&text).map_err(|error| format!("is no file of shapes: {error}")));
            let hint =
                "write JSON as `init` does: for each link a list of hulls, each a list of corners [x, y, z] in metres";
            hulls.map_err(|error| self.problem(file.span(), "robot.shapes", format!("{name} {error}"), hint)).ok()
        });
        let Some(Described { urdf, chain, .. }) = described else {
            if let Some(file) = &raw.shapes {
                let hint = "add `urdf = \"robot.urdf\"`, or remove it";
                self.problem(file.span(), "robot.shapes", "it is about the links of a URDF, and there is none", hint);
            }
            return Vec::new();
        };
        let Hulls(mut hulls) = hulls.unwrap_or_default();
        let (Hulls(without_meshes), _) = Hulls::of(urdf, &mut |_| None);
        if let (Some(file), Some(link)) = (&raw.shapes, hulls.keys().find(|link| !urdf.links().contains(link))) {
            let hint = "name links of the URDF";
            self.problem(
                file.span(),
                "robot.shapes",
                format!("{} has shapes of `{link}`, which is no link", file.get_ref()),
                hint,
            );
        }
        for (link, of_link) in without_meshes {
            hulls.entry(link).or_insert(of_link);
        }
        let frames = chain.frames();
        let mut found = Vec::new();
        for attached in urdf.attached(chain) {
            let (carrier, frame) = &frames[attached.carrier];
            let place = frame * attached.place;
            for hull in hulls.get(attached.link).into_iter().flatten() {
                let corners = hull.iter().map(|corner| place.transform_point(&(*corner).into())).collect();
                found.extend(Hull::new(format!("`{}`", attached.link), *carrier, corners, 0.0));
            }
        }
        found
    }
}
