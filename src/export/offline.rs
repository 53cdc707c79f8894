//! The service worker of a folder, by which a browser keeps all of it.

use std::{collections::BTreeMap, fs, path::Path};

use super::{ExportError, SERVICE_WORKER, error::Doing, walk};
use crate::page;

/// What the service worker has in place of its files as long as it belongs to no folder.
const NO_FILES: &str = "{ version: \"\", files: [] }";

/// Tells the service worker in a folder of all files there. Those that the page asks for by a version are known by that one.
pub(super) fn write(folder: &Path, asked: &BTreeMap<String, &str>) -> Result<(), ExportError> {
    let mut files = Vec::new();
    walk(folder, "", &mut |path, place, _| {
        let is_hidden = path.rsplit('/').next().is_some_and(|name| name.starts_with('.'));
        if path == SERVICE_WORKER || is_hidden {
            return Ok(());
        }
        let version = match asked.get(&path) {
            Some(version) => (*version).to_owned(),
            None => page::version(&fs::read(place).doing("read", place)?),
        };
        files.push((path, version));
        Ok(())
    })?;
    files.sort_unstable();
    let version = page::version(&serde_json::to_vec(&files)?);
    let holds = serde_json::json!({ "version": version, "files": files }).to_string();
    let script = folder.join(SERVICE_WORKER);
    let template = fs::read_to_string(&script).doing("read", &script)?;
    super::write(&script, template.replacen(NO_FILES, &holds, 1).as_bytes())
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
