//! The page's files, as a folder holds them.

use std::{collections::BTreeMap, path::Path};

use super::{ExportError, Opening, write};
use crate::page::{self, CALIBRATE, CONTENT_SECURITY_POLICY, INDEX, PageFile};
use body_schema_scenario::Scenario;

/// All files of the page except the page itself.
pub(super) struct Files(Vec<PageFile>);

impl Files {
    pub(super) fn load(panel: Option<&Path>) -> Result<Self, ExportError> {
        Ok(Self(page::files(panel)?))
    }

    /// The sizes of compressed files when unpacked, bytes.
    pub(super) fn unpacked(&self) -> BTreeMap<String, usize> {
        self.0.iter().filter(|file| is_packed(file)).map(|file| (address(file), file.bytes.len())).collect()
    }

    /// The versions under which the page asks for its files, by address.
    pub(super) fn versions(&self) -> BTreeMap<String, &str> {
        self.0.iter().map(|file| (address(file), file.version.as_str())).collect()
    }

    pub(super) fn write(
        &self,
        out: &Path,
        opening: &Opening<'_>,
        base: Option<&str>,
        commit: Option<&str>,
    ) -> Result<(), ExportError> {
        for file in &self.0 {
            let packed = if is_packed(file) { file.compressed.of(&file.bytes) } else { None };
            write(&out.join(address(file)), packed.as_ref().unwrap_or(&file.bytes))?;
        }
        // Hosts that make pages of their own from what they are given leave these alone.
        write(&out.join(".nojekyll"), b"")?;
        write(&out.join("calibrate.html"), with_addresses(&page::generated(CALIBRATE, commit), &self.0).as_bytes())?;
        write(&out.join("index.html"), index(INDEX, &self.0, opening.scenario, base).as_bytes())
    }
}

/// Whether a file is large enough to be compressed: WebAssembly and meshes are.
fn is_packed(file: &PageFile) -> bool {
    [".wasm", ".bin"].iter().any(|end| file.path.ends_with(end))
}

/// The address relative to the page.
fn address(file: &PageFile) -> String {
    let path = file.path.trim_start_matches('/');
    if is_packed(file) { format!("{path}.gz") } else { path.to_owned() }
}

/// The page for an export: with relative addresses, its policy in itself, and the title of the scenario that it opens with. The
/// picture for previews of links is below `base`, if that is known.
fn index(template: &str, files: &[PageFile], scenario: Option<&Scenario>, base: Option<&str>) -> String {
    let mut page = with_addresses(template, files);
    if let Some(base) = base {
        page = page.replace("\"preview.png", &format!("\"{}preview.png", escaped(base)));
    }
    if let Some(scenario) = scenario {
        let (title, about) = titles(scenario);
        page = replace_between(&page, "<title>", "</title>", &title);
        for (property, content) in [("og:title", &title), ("og:description", &about)] {
            page = with_property(page, property, content);
        }
    }
    replace_between(&page, "<noscript>", "</noscript>", "This page needs JavaScript.")
}

/// A page that has no server, with relative addresses and versions of files, and its policy in itself.
fn with_addresses(page: &str, files: &[PageFile]) -> String {
    let page = page.replacen("<html ", "<html data-source=\"engine\" ", 1);
    let policy = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{CONTENT_SECURITY_POLICY}\" />");
    // First of all: a policy holds for what comes after it.
    let page = page.replacen("<head>", &format!("<head>\n    {policy}"), 1);
    page::versioned(&page, files, address)
}

/// The title, and a sentence for those who see a link to the page.
fn titles(scenario: &Scenario) -> (String, String) {
    let about = format!("{}: watch it learn, and compare learners. Your own browser computes.", scenario.title);
    (escaped(&format!("{} · body-schema", scenario.title)), escaped(&about))
}

/// Sets the content of a property for link previews, or adds the property.
fn with_property(page: String, property: &str, content: &str) -> String {
    let begin = format!("<meta property=\"{property}\" content=\"");
    if page.contains(&begin) {
        return replace_between(&page, &begin, "\"", content);
    }
    page.replacen("</head>", &format!("  {begin}{content}\" />\n  </head>"), 1)
}

/// The text with what stands between the first `begin` and the next `end` replaced.
fn replace_between(text: &str, begin: &str, end: &str, with: &str) -> String {
    let found = text.split_once(begin).and_then(|(before, rest)| Some((before, rest.split_once(end)?.1)));
    found.map_or_else(|| text.to_owned(), |(before, after)| [before, begin, with, end, after].concat())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use body_schema_scenario::builtin;

    #[test]
    fn the_page_names_only_what_lies_beside_it() {
        let mut scenario = builtin("arm-6dof").expect("built in");
        scenario.title = "Six joints & \"one\" <marker>".to_owned();
        let files = Files::load(None).expect("the page").0;
        let page = index(INDEX, &files, Some(&scenario), None);
        assert!(page.contains("<title>Six joints &amp; &quot;one&quot; &lt;marker> · body-schema</title>"), "{page}");
        assert!(page.contains("<html data-source=\"engine\"") && page.contains("Your own browser computes."), "{page}");
        let begin = page.find("Content-Security-Policy").expect("a policy");
        assert!(page.find("<script").expect("scripts") > begin && page.find("<link").expect("links") > begin);
        let addresses = page.split('"').skip(1).step_by(2);
        assert!(!addresses.clone().any(|text| text.starts_with('/')), "an address from the root of the host");
        assert!(addresses.clone().any(|text| text.starts_with("viewer/re_viewer_bg.wasm.gz?v=")));
        assert!(!page.contains("/v1/"), "no server, no interface");
    }

    #[test]
    fn without_a_scenario_the_page_has_its_own_title() {
        let page = index(INDEX, &Files::load(None).expect("the page").0, None, None);
        assert!(page.contains("\"engine/engine_bg.wasm.gz?v="), "{page}");
        assert!(page.contains("<title>body-schema: a robot learns"), "{page}");
    }

    #[test]
    fn previews_get_the_whole_address_of_the_picture() {
        let files = Files::load(None).expect("the page").0;
        let page = index(INDEX, &files, None, Some("https://example.org/demo/"));
        assert!(page.contains("content=\"https://example.org/demo/preview.png?v="), "{page}");
    }

    #[test]
    fn properties_are_set_or_added() {
        let page = "<head><meta property=\"og:title\" content=\"old\" /></head>".to_owned();
        assert_eq!(with_property(page.clone(), "og:title", "new"), page.replace("old", "new"));
        assert!(with_property(page, "og:description", "so").contains("content=\"so\" />\n  </head>"));
    }
}
