//! `ARCHITECTURE.md` says which crate imports which: as the manifests do.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Which crates each crate imports, by the names of `ARCHITECTURE.md`.
type Imports = BTreeMap<String, BTreeSet<String>>;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// `isv-volume` is `volume` there, and the facade `isv`.
fn short(name: &str) -> String {
    name.strip_prefix("isv-").unwrap_or(name).to_owned()
}

/// Imports of the programs and libraries, and those of their tests alone.
fn of_manifests() -> (Imports, Imports) {
    let folders = |path: PathBuf| std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path());
    let crates = folders(root().join("crates")).flat_map(folders).chain(folders(root().join("bindings")));
    let (mut all, mut only_tests) = (Imports::new(), Imports::new());
    for folder in crates.chain([root().join("xtask")]) {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let of_section = |section: &str| -> BTreeSet<String> {
            let lines = manifest.lines().skip_while(|line| *line != section).skip(1);
            let entries = lines.take_while(|line| !line.starts_with('['));
            entries.filter_map(dependency).filter(|name| name.starts_with("isv")).map(short).collect()
        };
        let name = short(folder.file_name().unwrap().to_str().unwrap());
        let imports = of_section("[dependencies]");
        let of_tests = &of_section("[dev-dependencies]") - &imports;
        only_tests.extend((!of_tests.is_empty()).then(|| (name.clone(), of_tests)));
        all.insert(name, imports);
    }
    (all, only_tests)
}

/// The name in a line of a section of dependencies.
fn dependency(line: &str) -> Option<&str> {
    line.split(['.', '=', ' ']).next().filter(|name| !name.is_empty())
}

/// The names in backquotes.
fn names(text: &str) -> impl Iterator<Item = String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned)
}

/// What the section on imports says, as [`of_manifests`].
fn of_document() -> (Imports, Imports) {
    let document = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let section = document.split("## Import direction").nth(1).unwrap();
    let list = section.split("\n\n").find(|paragraph| paragraph.starts_with("- ")).unwrap();
    let (mut all, mut only_tests) = (Imports::new(), Imports::new());
    for item in list.replace("\n  ", " ").lines() {
        let (into, rules) = match item.strip_prefix("- only for tests: ") {
            Some(rules) => (&mut only_tests, rules),
            None => (&mut all, item),
        };
        for rule in rules.split(';') {
            let (left, right) = rule.split_once("->").unwrap();
            for name in names(left) {
                into.entry(name).or_default().extend(names(right));
            }
        }
    }
    (all, only_tests)
}

#[test]
fn imports_are_those_of_the_manifests() {
    let (all, only_tests) = of_document();
    let (expected, expected_of_tests) = of_manifests();
    assert!(expected.len() > 20 && expected["encode"].contains("decode"));
    assert_eq!(all, expected);
    assert_eq!(only_tests, expected_of_tests);
}
