//! The meshes that a robot's description names, in the files beside it.

use std::{
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

/// The most bytes of a mesh.
const MOST_BYTES: u64 = 32 << 20;
/// How many folders above that of the description are searched.
const MOST_ABOVE: usize = 5;

/// The content of the first file that a description's name for a mesh may mean, by the path of the description.
///
/// # Errors
///
/// A sentence without a full stop: there is none, it cannot be read, or it has more than 32 MiB.
pub fn mesh(description: &Path, file: &str) -> Result<Vec<u8>, String> {
    let found = places(description, file).into_iter().find(|place| place.is_file());
    let Some(place) = found else {
        return Err(format!("there is no such file beside {} or in a folder above it", description.display()));
    };
    let mut content = Vec::new();
    let opened = File::open(&place).and_then(|opened| opened.take(MOST_BYTES + 1).read_to_end(&mut content));
    opened.map_err(|error| format!("{} cannot be read: {error}", place.display()))?;
    match content.len() as u64 > MOST_BYTES {
        true => Err(format!("{} has more than {} MiB", place.display(), MOST_BYTES >> 20)),
        false => Ok(content),
    }
}

/// The places where a mesh may be, the likeliest first. `package://robot/meshes/hand.stl` is searched for with and without `robot` beside the
/// description and in the folders above it.
fn places(description: &Path, file: &str) -> Vec<PathBuf> {
    let folder = description.parent().unwrap_or(Path::new(""));
    // A path without a folder has none above it.
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let (is_package, file) = match file.split_once("://") {
        Some(("file", path)) => (false, path),
        Some((_, path)) => (true, path),
        None => (false, file),
    };
    if !is_package {
        return vec![folder.join(file)];
    }
    let within = file.split_once('/').map(|(_, within)| within);
    let above = folder.ancestors().take(1 + MOST_ABOVE);
    above.flat_map(|folder| [Some(file), within].into_iter().flatten().map(|file| folder.join(file))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_are_found_as_their_names_say() {
        let root = tempfile::tempdir().expect("a folder");
        let at = |path: &str| root.path().join(path);
        for folder in ["robot/urdf", "robot/meshes"] {
            std::fs::create_dir_all(at(folder)).expect("a folder");
        }
        std::fs::write(at("robot/meshes/hand.stl"), "solid").expect("written");
        let description = at("robot/urdf/arm.urdf");
        for name in ["../meshes/hand.stl", "package://robot/meshes/hand.stl", "package://other/meshes/hand.stl"] {
            assert_eq!(mesh(&description, name).as_deref(), Ok(&b"solid"[..]), "{name}");
        }
        let absolute = format!("file://{}", at("robot/meshes/hand.stl").display());
        assert_eq!(mesh(&description, &absolute).as_deref(), Ok(&b"solid"[..]));
        for name in ["meshes/hand.stl", "package://robot/meshes/arm.stl"] {
            let why = mesh(&description, name).expect_err("nothing is there");
            assert!(why.contains("arm.urdf"), "{why}");
        }
    }
}
