//! The script that makes a folder ready for a host.

use std::{
    path::Path,
    process::{Command, Output},
};

use super::{exported, files};

fn prepare(host: &str, folder: &Path) -> Output {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/hosting/prepare");
    Command::new("sh").arg(script).arg(host).arg(folder).output().expect("sh")
}

#[test]
fn a_folder_is_made_ready_for_each_host() {
    let folder = exported(&["head-fov"]);
    let before = files(folder.path());
    let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).expect(file);
    for (host, written) in [
        ("github", &[".github/workflows/pages.yml"][..]),
        ("huggingface", &["README.md", ".gitattributes"]),
        ("nginx", &[]),
    ] {
        // Twice, as after another export.
        for _ in 0..2 {
            let output = prepare(host, folder.path());
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success() && !said.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
            assert!(written.iter().all(|file| said.contains(file)), "{said}");
            if host == "nginx" {
                let place = folder.path().canonicalize().expect("a place");
                assert!(said.contains(&format!("alias {}/;", place.display())), "{said}");
            }
        }
        assert!(written.iter().all(|file| !read(file).is_empty()));
    }
    let workflow = read(".github/workflows/pages.yml");
    for part in ["actions/upload-pages-artifact@", "actions/deploy-pages@", "pages: write", "id-token: write"] {
        assert!(workflow.contains(part), "{workflow}");
    }
    let readme = read("README.md");
    assert!(
        readme.starts_with("---\ntitle: '") && readme.contains("\nsdk: static\napp_file: index.html\n"),
        "{readme}"
    );
    assert!(readme.lines().nth(1).is_some_and(|title| title.ends_with("· body-schema'")), "{readme}");
    // Every file that is too large for Git alone is kept by LFS.
    let kept = read(".gitattributes");
    for (path, size) in &before {
        let end = format!("*.{} filter=lfs", path.rsplit('.').next().unwrap_or_default());
        assert!(*size < 10_000_000 || kept.contains(&end), "{path}: {size} bytes, {kept}");
    }
    // The page is as it was.
    let after = files(folder.path());
    assert!(before.iter().all(|file| after.contains(file)));
}

#[test]
fn what_cannot_be_made_ready_is_said() {
    let empty = tempfile::tempdir().expect("a folder");
    for (host, said) in [("github", "holds no export"), ("nowhere", "holds no export")] {
        let output = prepare(host, empty.path());
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).contains(said));
    }
    let folder = exported(&[]);
    let output = prepare("nowhere", folder.path());
    assert!(
        output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).contains("github|huggingface|nginx")
    );
    assert_eq!(std::fs::read_dir(empty.path()).expect("a folder").count(), 0);
}
