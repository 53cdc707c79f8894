//! The meshes that a description names, among the files that were dropped with it.

use std::collections::BTreeMap;

use body_schema_recording::Appearance;
use body_schema_scenario::Scenario;

/// The contents of meshes, by their paths in the folder that was dropped.
pub type Meshes = BTreeMap<String, Vec<u8>>;

/// How a scenario looks with these meshes, and the names of those for which capsules stand: they are not there, or of no kind that can be
/// drawn.
pub fn appearance(scenario: &Scenario, meshes: &Meshes) -> (Appearance, Vec<String>) {
    let mut appearance = Appearance::of(scenario);
    for name in appearance.mesh_files() {
        if let Some(content) = found(meshes, &name) {
            appearance.add_mesh(&name, content.to_owned());
        }
    }
    let undrawn = appearance.undrawn_meshes().into_iter().collect();
    (appearance, undrawn)
}

/// The mesh that is meant by `package://robot/meshes/visual/hand.stl`: of those of its name the one whose folders are most alike.
pub(super) fn found<'a>(meshes: &'a Meshes, name: &str) -> Option<&'a [u8]> {
    let parts = |path: &'a str| path.rsplit(['/', '\\']);
    let alike = |path: &'a str| parts(path).zip(name.rsplit(['/', '\\'])).take_while(|(a, b)| a == b).count();
    let named = meshes.iter().map(|(path, content)| (alike(path), content)).filter(|(alike, _)| *alike > 0);
    named.rev().max_by_key(|(alike, _)| *alike).map(|(_, content)| &content[..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_found_by_its_name_and_then_by_its_folders() {
        let paths = ["/arm/meshes/collision/hand.stl", "/arm/meshes/visual/hand.stl", "base.stl"];
        let meshes: Meshes = paths.iter().map(|path| ((*path).to_owned(), path.as_bytes().to_vec())).collect();
        for (name, path) in [
            ("package://arm/meshes/visual/hand.stl", paths[1]),
            ("../meshes/collision/hand.stl", paths[0]),
            ("hand.stl", paths[0]),
            ("file:///home/me/arm/meshes/base.stl", paths[2]),
        ] {
            assert_eq!(found(&meshes, name), Some(path.as_bytes()), "{name}");
        }
        for name in ["package://arm/meshes/visual/arm.stl", "and.stl", ""] {
            assert_eq!(found(&meshes, name), None, "{name}");
        }
    }
}
