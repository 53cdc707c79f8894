//! The meshes of robots that ship. A program has them in itself; a page brings them to its engine, whose WebAssembly they would weigh down.

use std::{
    collections::BTreeMap,
    sync::{Arc, OnceLock},
};

/// Meshes as GLB, by the ends of the names that descriptions have for them, without what follows the last dot.
type Meshes = BTreeMap<String, Arc<[u8]>>;

static SHIPPED: OnceLock<Meshes> = OnceLock::new();

/// The mesh for which a description that ships has this name.
pub(super) fn shipped(file: &str) -> Option<Arc<[u8]>> {
    #[cfg(not(target_arch = "wasm32"))]
    let meshes = Some(SHIPPED.get_or_init(own::meshes));
    #[cfg(target_arch = "wasm32")]
    let meshes = SHIPPED.get();
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let is_meant = |name: &str| stem.strip_suffix(name).is_some_and(|before| before.ends_with('/'));
    meshes?.iter().find(|(name, _)| is_meant(name)).map(|(_, content)| content.clone())
}

/// Takes the meshes of robots that ship from a [pack](mesh_pack), for a program that has none. The first pack counts.
pub fn bring_meshes(pack: &[u8]) {
    // What was brought before is the same.
    let _ = SHIPPED.set(unpacked(pack));
}

/// One file of all meshes of robots that ship: of each the length of its name, the name, the length of its content, and the content.
/// Lengths have four bytes, the lowest first.
#[cfg(not(target_arch = "wasm32"))]
pub fn mesh_pack() -> Vec<u8> {
    let mut pack = Vec::new();
    for (name, content) in own::FILES {
        for part in [name.as_bytes(), content] {
            pack.extend((part.len() as u32).to_le_bytes());
            pack.extend(part);
        }
    }
    pack
}

/// The meshes of a pack; of one that is cut those that are whole.
fn unpacked(mut pack: &[u8]) -> Meshes {
    let mut part = || {
        let (length, rest) = pack.split_first_chunk()?;
        let (part, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        pack = rest;
        Some(part)
    };
    let mut meshes = Meshes::new();
    while let Some((name, content)) = part().zip(part()) {
        meshes.insert(String::from_utf8_lossy(name).into_owned(), content.into());
    }
    meshes
}

#[cfg(not(target_arch = "wasm32"))]
mod own {
    macro_rules! files {
        ($($name:literal),* $(,)?) => {
            &[$(($name, include_bytes!(concat!("../../../scenarios/meshes/", $name, ".glb")))),*]
        };
    }

    pub const FILES: &[(&str, &[u8])] = files![
        "panda/link0",
        "panda/link1",
        "panda/link2",
        "panda/link3",
        "panda/link4",
        "panda/link5",
        "panda/link6",
        "panda/link7",
        "panda/hand",
        "panda/finger",
        "ur10/collision/base",
        "ur10/collision/shoulder",
        "ur10/collision/upperarm",
        "ur10/collision/forearm",
        "ur10/collision/wrist1",
        "ur10/collision/wrist2",
        "ur10/collision/wrist3",
    ];

    pub fn meshes() -> super::Meshes {
        FILES.iter().map(|(name, content)| ((*name).to_owned(), (*content).into())).collect()
    }
}

#[cfg(test)]
mod tests {
    use body_schema_scenario::builtin;

    use super::*;
    use crate::Appearance;

    #[test]
    fn what_is_packed_is_unpacked() {
        let pack = mesh_pack();
        assert!(pack.len() < 3 << 20, "{} bytes", pack.len());
        assert_eq!(unpacked(&pack), own::meshes());
        assert_eq!(unpacked(&pack[..pack.len() - 1]).len(), own::FILES.len() - 1);
        assert_eq!(unpacked(&[]), Meshes::new());
    }

    #[test]
    fn robots_that_ship_are_drawn_as_themselves_where_licences_allow_and_no_other_robot_is() {
        for (name, is_drawn) in [("panda-sockets", true), ("ur10-camera", true), ("kinova-sockets", false)] {
            let scenario = builtin(name).expect("built in");
            let undrawn = Appearance::of(&scenario).undrawn_meshes();
            assert_eq!(undrawn.is_empty(), is_drawn, "{name}: {undrawn:?}");
        }
        // Somebody else's arm that happens to name its meshes alike.
        let scenario = builtin("panda-sockets").expect("built in");
        let open = |file: &str| scenario.data_file(file).map(|text| text.replacen("0.333", "0.334", 1));
        let other = body_schema_scenario::Scenario::parse("other.toml", &scenario.source, &open).expect("a scenario");
        assert_eq!(Appearance::of(&other).undrawn_meshes().len(), Appearance::of(&other).mesh_files().len());
        assert_eq!(shipped("other_panda/link0.dae"), None);
    }
}
