//! Files use one another in one direction: of those of a crate none forms a circle. Of crates Cargo sees to it.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use syn::{
    Attribute, Item, UseTree, Visibility,
    visit::{Visit, visit_item, visit_path},
};

/// A path of names, such as that of a module within its crate.
type Names = Vec<String>;

/// A file as far as it matters here.
#[derive(Default)]
struct Source {
    /// The items that it defines.
    defined: BTreeSet<String>,
    /// What it brings in by `use`.
    used: Vec<Names>,
    /// What of that it passes on.
    passed_on: BTreeSet<Names>,
    /// What it names by longer paths elsewhere.
    named: Vec<Names>,
}

/// The files of a crate, by their modules.
struct Crate(BTreeMap<Names, Source>);

fn is_for_tests(attributes: &[Attribute]) -> bool {
    let is_test = |one: &Attribute| matches!(&one.meta, syn::Meta::List(list) if list.tokens.to_string() == "test");
    attributes.iter().any(|attribute| attribute.path().is_ident("cfg") && is_test(attribute))
}

impl<'a> Visit<'a> for Source {
    fn visit_item(&mut self, item: &'a Item) {
        let (attributes, name) = match item {
            Item::Const(it) => (&it.attrs, Some(&it.ident)),
            Item::Enum(it) => (&it.attrs, Some(&it.ident)),
            Item::Fn(it) => (&it.attrs, Some(&it.sig.ident)),
            Item::Impl(it) => (&it.attrs, None),
            Item::Mod(it) => (&it.attrs, None),
            Item::Static(it) => (&it.attrs, Some(&it.ident)),
            Item::Struct(it) => (&it.attrs, Some(&it.ident)),
            Item::Trait(it) => (&it.attrs, Some(&it.ident)),
            Item::Type(it) => (&it.attrs, Some(&it.ident)),
            Item::Use(it) => (&it.attrs, None),
            _ => return visit_item(self, item),
        };
        if is_for_tests(attributes) {
            return;
        }
        self.defined.extend(name.map(ToString::to_string));
        match item {
            Item::Use(it) => {
                let first = self.used.len();
                leaves(&it.tree, &Names::new(), &mut self.used);
                if !matches!(it.vis, Visibility::Inherited) {
                    self.passed_on.extend(self.used[first..].iter().cloned());
                }
            }
            _ => visit_item(self, item),
        }
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        if path.segments.len() > 1 {
            self.named.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        visit_path(self, path);
    }
}

/// The paths that a `use` brings in.
fn leaves(tree: &UseTree, before: &Names, found: &mut Vec<Names>) {
    let with = |name: String| [before.as_slice(), &[name]].concat();
    match tree {
        UseTree::Path(it) => leaves(&it.tree, &with(it.ident.to_string()), found),
        UseTree::Group(it) => it.items.iter().for_each(|item| leaves(item, before, found)),
        UseTree::Name(it) if it.ident == "self" => found.push(before.clone()),
        UseTree::Name(it) => found.push(with(it.ident.to_string())),
        UseTree::Rename(it) => found.push(with(it.ident.to_string())),
        UseTree::Glob(_) => found.push(with("*".to_owned())),
    }
}

impl Crate {
    fn read(folder: &Path) -> Self {
        let mut sources = BTreeMap::new();
        for file in files(folder) {
            let text = fs::read_to_string(&file).expect("a readable file");
            let mut source = Source::default();
            source.visit_file(&syn::parse_file(&text).expect("Rust"));
            let within = file.strip_prefix(folder).expect("a file of the folder").with_extension("");
            let mut module: Names = within.iter().map(|name| name.to_str().expect("plain names").to_owned()).collect();
            module.pop_if(|name| ["lib", "main", "mod"].contains(&name.as_str()));
            sources.insert(module, source);
        }
        Self(sources)
    }

    /// A path that `module` writes, from the root of the crate; `None` for one of another crate.
    fn absolute(&self, module: &Names, path: &[String]) -> Option<Names> {
        let above = path.iter().take_while(|name| *name == "super").count();
        let beside = || self.0.contains_key(&[module.as_slice(), &path[..1]].concat());
        Some(match path.first()?.as_str() {
            "crate" => path[1..].to_vec(),
            "self" => [module, &path[1..]].concat(),
            "super" => [&module[..module.len().checked_sub(above)?], &path[above..]].concat(),
            _ if beside() => [module, path].concat(),
            _ => return None,
        })
    }

    /// The module of the file that defines what is at an absolute path, also where others pass it on.
    fn home(&self, path: &Names, depth: usize) -> Option<Names> {
        let module = (0..=path.len()).rev().map(|end| path[..end].to_vec()).find(|it| self.0.contains_key(it))?;
        let (source, Some(name)) = (&self.0[&module], path.get(module.len())) else { return Some(module) };
        if source.defined.contains(name) || depth == 0 {
            return Some(module);
        }
        let brought = source.used.iter().filter(|used| used.last() == Some(name));
        let brought = brought.filter_map(|used| self.absolute(&module, used)).find(|used| used != path);
        brought.map_or(Some(module), |used| self.home(&used, depth - 1))
    }

    /// By file the others that it uses. The file of a module gathers what its parts share: for these it is none to use it, and for
    /// that one to pass them on.
    fn arrows(&self) -> BTreeMap<&Names, BTreeSet<Names>> {
        let of = |(module, source): (_, &Source)| {
            let used = source.used.iter().filter(|path| !source.passed_on.contains(*path));
            let mut paths: Vec<Names> =
                used.chain(&source.named).filter_map(|path| self.absolute(module, path)).collect();
            // Of `use super::part`, what `part::name` names.
            paths.extend(source.named.iter().filter_map(|path| {
                let brought = source.used.iter().find(|used| used.last() == path.first())?;
                Some([self.absolute(module, brought)?, path[1..].to_vec()].concat())
            }));
            let homes = paths.iter().filter_map(|path| self.home(path, 8));
            (module, homes.filter(|home| !module.starts_with(home)).collect())
        };
        self.0.iter().map(of).collect()
    }

    /// The arrows of circles, and of what leads from one to another.
    fn circles(&self) -> BTreeMap<&Names, BTreeSet<Names>> {
        let mut left = self.arrows();
        loop {
            let before = left.len();
            let used: BTreeSet<Names> = left.values().flatten().cloned().collect();
            left.retain(|module, uses| !uses.is_empty() && used.contains(*module));
            let modules: BTreeSet<Names> = left.keys().map(|module| (*module).clone()).collect();
            left.values_mut().for_each(|uses| uses.retain(|module| modules.contains(module)));
            if left.len() == before {
                return left;
            }
        }
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let found = entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] });
    found.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect()
}

#[test]
fn no_files_of_a_crate_use_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("crates")).expect("crates").map(|entry| entry.expect("a crate").path());
    let folders = crates.chain([root.to_owned(), root.join("web"), root.join("python")]).map(|path| path.join("src"));
    let mut arrows = 0;
    for folder in folders.filter(|folder| folder.is_dir()) {
        let found = Crate::read(&folder);
        arrows += found.arrows().values().map(BTreeSet::len).sum::<usize>();
        let circles = found.circles();
        assert!(circles.is_empty(), "{} has files that use each other: {circles:#?}", folder.display());
    }
    assert!(arrows > 1000, "{arrows} arrows are not all");
}

/// What the law finds, it finds through a module that passes a name on, and by paths as by `use`.
#[test]
fn a_circle_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |file: &str, text: &str| {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, text).expect("written");
    };
    write("lib.rs", "mod one; mod more; pub use more::Two;");
    write("one.rs", "use crate::Two; pub struct One(Two); pub fn of() {}");
    write("more/mod.rs", "mod two; pub use two::Two;");
    write("more/two.rs", "use crate::one; pub struct Two; #[cfg(test)] mod tests { use crate::one::One; }");
    assert!(!Crate::read(folder.path()).circles().is_empty());
    write("more/two.rs", "pub struct Two; #[cfg(test)] mod tests { use crate::one::One; }");
    assert!(Crate::read(folder.path()).circles().is_empty());
    write("more/two.rs", "pub struct Two; pub fn two() { crate::one::of(); }");
    let found = Crate::read(folder.path()).circles().into_keys().cloned().collect::<Vec<_>>();
    assert_eq!(found, [vec!["more".to_owned(), "two".to_owned()], vec!["one".to_owned()]]);
}
