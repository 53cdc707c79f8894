//! The service worker of a folder, by which a browser keeps all of it.

use std::{collections::BTreeMap, fs, path::Path};

use super::{ExportError, SERVICE_WORKER, error::Doing};
use crate::page;

/// What the service worker has in place of its files as long as it belongs to no folder.
const NO_FILES: &str = "{ version: \"\", files: [] }";

/// Tells the service worker in a folder of all files there. Those that the page asks for by a version are known by that one.
pub(super) fn write(folder: &Path, asked: &BTreeMap<String, &str>) -> Result<(), ExportError> {
    let mut files = Vec::new();
    list(folder, "", &mut |path, bytes| {
        let version = asked.get(&path).map_or_else(|| page::version(bytes), |version| (*version).to_owned());
        files.push((path, version));
    })?;
    files.sort_unstable();
    let version = page::version(&serde_json::to_vec(&files)?);
    let holds = serde_json::json!({ "version": version, "files": files }).to_string();
    let script = folder.join(SERVICE_WORKER);
    let template = fs::read_to_string(&script).doing("read", &script)?;
    super::write(&script, template.replacen(NO_FILES, &holds, 1).as_bytes())
}

/// Every file below a folder that the page can ask for.
fn list(folder: &Path, below: &str, each: &mut dyn FnMut(String, &[u8])) -> Result<(), ExportError> {
    for entry in fs::read_dir(folder).doing("read the folder", folder)? {
        let entry = entry.doing("read the folder", folder)?;
        let (place, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        let path = format!("{below}{name}");
        if place.is_dir() {
            list(&place, &format!("{path}/"), each)?;
        } else if path != SERVICE_WORKER && !name.starts_with('.') {
            each(path, &fs::read(&place).doing("read", &place)?);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_service_worker_knows_every_file_and_another_version_by_any_of_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |path: &str| folder.path().join(path);
        let template = include_str!("../../assets/page/sw.js");
        let written = |files: &[(&str, &str)]| {
            super::super::write(&at(SERVICE_WORKER), template.as_bytes()).expect("written");
            for (path, text) in files {
                super::super::write(&at(path), text.as_bytes()).expect("written");
            }
            write(folder.path(), &BTreeMap::from([("page.js".to_owned(), "7")])).expect("written");
            fs::read_to_string(at(SERVICE_WORKER)).expect("a script")
        };
        let first = written(&[("page.js", "1"), ("scenarios/mine.toml", "a"), (".nojekyll", "")]);
        assert!(first.contains("[\"page.js\",\"7\"],[\"scenarios/mine.toml\",\""), "{first}");
        assert!(!first.contains(NO_FILES) && !first.contains("nojekyll") && !first.contains("[\"sw.js\""), "{first}");
        assert_eq!(written(&[]), first);
        assert_ne!(written(&[("scenarios/mine.toml", "b")]), first);
    }
}
