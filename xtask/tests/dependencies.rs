//! Licences, sources and oldest Rust of all dependencies. `deny.toml` lists the licences;
//! cargo-deny checks more with it, where it is installed.

use serde_json::Value;
use spdx::{Expression, LicenseReq, ParseMode};
use std::path::Path;
use std::process::Command;

/// The packages of the workspace and all that it depends on.
fn packages() -> Vec<Value> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--all-features"])
        .current_dir(root)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// A field of a package, and its name with the version.
fn field<'a>(package: &'a Value, name: &str) -> (Option<&'a str>, String) {
    let text = |name: &str| package[name].as_str();
    (text(name), format!("{} {}", text("name").unwrap(), text("version").unwrap()))
}

/// The licences of `deny.toml`, and those of single crates: name and licence.
fn allowed() -> (Vec<String>, Vec<(String, String)>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deny.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let list = |start: &str, end: &str| text.split(start).nth(1).unwrap().split(end).next().unwrap();
    let quoted = |text: &str| text.split('"').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    let exceptions = list("exceptions = [", "\n]").lines().map(quoted).filter(|words| !words.is_empty());
    let exceptions = exceptions.map(|words| <[String; 2]>::try_from(words).unwrap());
    (quoted(list("allow = [", "]")), exceptions.map(|[licence, name]| (name, licence)).collect())
}

#[test]
fn licences_let_isv_be_used_under_its_own() {
    let (allowed, exceptions) = allowed();
    assert!(allowed.len() > 4, "{allowed:?}");
    assert!(exceptions.contains(&("cbindgen".to_owned(), "MPL-2.0".to_owned())), "{exceptions:?}");
    for package in packages() {
        let (licence, name) = field(&package, "license");
        let licence = licence.unwrap_or_else(|| panic!("{name} states no licence"));
        let expression = Expression::parse_mode(licence, ParseMode::LAX);
        let expression = expression.unwrap_or_else(|error| panic!("{name}: {licence}: {error}"));
        let own = package["name"].as_str().unwrap();
        let is_allowed = |requirement: &LicenseReq| {
            let licence = requirement.to_string();
            allowed.contains(&licence)
                || exceptions.iter().any(|exception| *exception == (own.to_owned(), licence.clone()))
        };
        assert!(expression.evaluate(is_allowed), "{name}: {licence} is not in deny.toml");
    }
}

#[test]
fn all_comes_from_the_registry() {
    for package in packages() {
        let (source, name) = field(&package, "source");
        assert!(source.is_none_or(|source| source.starts_with("registry+")), "{name}: {source:?}");
    }
}

/// The oldest Rust that isv compiles with is stated; a dependency must not need a newer one. What the standard library has since is told by
/// clippy.
#[test]
fn no_dependency_needs_a_newer_rust() {
    let version = |text: &str| {
        let mut numbers = text.split('.').map(|number| number.parse::<u32>().unwrap());
        (numbers.next().unwrap(), numbers.next().unwrap_or(0))
    };
    let packages = packages();
    let ours = packages.iter().find(|package| package["name"] == "isv").unwrap();
    let oldest = version(field(ours, "rust_version").0.unwrap());
    for package in &packages {
        let (needed, name) = field(package, "rust_version");
        assert!(needed.is_none_or(|needed| version(needed) <= oldest), "{name} needs Rust {needed:?}");
    }
}
