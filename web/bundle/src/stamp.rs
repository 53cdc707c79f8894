//! What a bundle was built from, as one number. The tests of the program compare it too.

use std::{collections::BTreeSet, fs, io, path::Path};

/// The files of this repository that modules were built from, one to a line: what cargo's own lists beside them (`.d`) say.
///
/// # Errors
///
/// Where such a list cannot be read.
#[allow(dead_code, reason = "whoever compares builds nothing")]
pub fn sources(workspace: &Path, lists: &[std::path::PathBuf]) -> io::Result<String> {
    let root = workspace.canonicalize()?;
    let mut files = BTreeSet::from(["Cargo.lock".to_owned(), "Cargo.toml".to_owned()]);
    for list in lists {
        let text = fs::read_to_string(list)?;
        // `module: file file`, a space within a name as `\ `.
        let names = text.split_once(": ").map_or("", |(_, names)| names).replace("\\ ", "\0");
        for name in names.split_whitespace() {
            let file = Path::new(&name.replace('\0', " ")).canonicalize()?;
            // What a build makes is no source.
            if let Ok(inside) = file.strip_prefix(&root)
                && !inside.starts_with("target")
            {
                files.insert(inside.to_string_lossy().replace('\\', "/"));
                files.extend(manifest(&root, inside));
            }
        }
    }
    Ok(files.into_iter().map(|file| file + "\n").collect())
}

/// The manifest of the package that a file is of.
fn manifest(root: &Path, file: &Path) -> Option<String> {
    let folder = file.ancestors().skip(1).find(|folder| root.join(folder).join("Cargo.toml").is_file())?;
    Some(folder.join("Cargo.toml").to_string_lossy().replace('\\', "/"))
}

/// The stamp of the sources that `sources.txt` in the bundle's folder lists.
///
/// # Errors
///
/// Where that list cannot be read.
pub fn of_sources(workspace: &Path, folder: &Path) -> io::Result<String> {
    let mut hash = Fnv::new();
    for name in fs::read_to_string(folder.join("sources.txt"))?.lines() {
        hash.add(name.as_bytes());
        // One that is gone is another source.
        let text = fs::read_to_string(workspace.join(name)).unwrap_or_default();
        hash.add(said(name, &text.replace('\r', "")).as_bytes());
    }
    Ok(format!("{:016x}\n", hash.0))
}

/// What of a file a compiler heeds: no comment that has lines to itself, and none of the tests at its end.
fn said(name: &str, text: &str) -> String {
    if !name.ends_with(".rs") {
        return text.to_owned();
    }
    let code = text.split("\n#[cfg(test)]\nmod ").next().unwrap_or_default();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//") && !line.trim().is_empty());
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// FNV-1a: short, and the same for ever, which the standard library's hashers do not promise.
struct Fnv(u64);

impl Fnv {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        // The length keeps two texts from running into each other.
        for byte in (bytes.len() as u64).to_le_bytes().iter().chain(bytes) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
