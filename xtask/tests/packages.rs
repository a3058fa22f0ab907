//! What a release takes for granted: packages that find each other, and one version everywhere.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The packages of the workspace, as their manifests have them.
fn packages() -> Vec<Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--no-deps"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// Whether a package may be published: an empty list of registries says that it may not.
fn is_published(package: &Value) -> bool {
    package["publish"].is_null()
}

#[test]
fn published_crates_need_published_crates_of_their_version() {
    let packages = packages();
    let find = |name: &Value| packages.iter().find(|package| package["name"] == *name);
    for package in packages.iter().filter(|package| is_published(package)) {
        let name = &package["name"];
        for field in ["description", "keywords", "categories", "license", "rust_version"] {
            assert!(
                !package[field].is_null() && package[field] != Value::Array(Vec::new()),
                "{name}: no {field}"
            );
        }
        for dependency in package["dependencies"].as_array().unwrap() {
            let Some(needed) = find(&dependency["name"]) else { continue };
            let said = format!("{name} on {}: {}", dependency["name"], dependency["req"]);
            if dependency["kind"] == "dev" {
                // Packages leave these out. With a version they would have to be published before.
                assert_eq!(dependency["req"], "*", "{said}");
            } else {
                assert!(is_published(needed), "{said}: it is not published");
                assert_eq!(dependency["req"], format!("^{}", needed["version"].as_str().unwrap()), "{said}");
            }
        }
    }
}

#[test]
fn all_that_is_released_has_one_version() {
    let packages = packages();
    let version = packages[0]["version"].as_str().unwrap();
    for package in &packages {
        assert_eq!(package["version"], version, "{}", package["name"]);
    }
    let files = [
        ("CHANGELOG.md", format!("\n## {version}, ")),
        ("CITATION.cff", format!("\nversion: {version}\n")),
        (
            "integrations/blender/isv_blender/__init__.py",
            format!("\"version\": ({})", version.replace('.', ", ")),
        ),
        ("integrations/ros2/isv_ros/package.xml", format!("<version>{version}</version>")),
        ("integrations/ros2/isv_ros/setup.py", format!("version=\"{version}\"")),
        ("integrations/unity/package.json", format!("\"version\": \"{version}\"")),
        ("player/package.json", format!("\"version\": \"{version}\"")),
    ];
    for (file, line) in files {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        assert!(text.contains(&line), "{file} does not say {}", line.trim());
    }
}
