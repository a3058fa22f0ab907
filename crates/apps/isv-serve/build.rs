//! Makes the table of the player's files that are embedded: what a page needs, and nothing of its tests and tools.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Folders of the player that a page loads from, all of them.
const FOLDERS: [&str; 2] = ["src", "vendor"];
/// Kinds of files beside them that a page loads.
const KINDS: [&str; 6] = ["html", "css", "js", "svg", "png", "ico"];

fn main() -> io::Result<()> {
    let root = player(Path::new(&env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")))?;
    let mut files = Vec::new();
    for path in entries(&root)? {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let kind = path.extension().and_then(|kind| kind.to_str()).unwrap_or_default();
        if path.is_dir() && FOLDERS.contains(&name) {
            collect(&path, &mut files)?;
        } else if path.is_file() && KINDS.contains(&kind) {
            files.push(path);
        }
    }
    files.sort();
    let mut table = String::from("&[\n");
    for file in &files {
        let inside = file.strip_prefix(&root).expect("found inside").to_str().expect("names are ASCII");
        let place = fs::canonicalize(file)?;
        writeln!(table, "    ({:?}, include_bytes!({place:?})),", inside.replace('\\', "/")).expect("memory");
    }
    table.push_str("]\n");
    fs::write(Path::new(&env::var("OUT_DIR").expect("cargo sets it")).join("player_files.rs"), table)
}

/// The player's folder. A package has it inside, by a link that is a text file where Git makes no links.
fn player(package: &Path) -> io::Result<PathBuf> {
    let inside = package.join("player");
    if inside.is_dir() { fs::canonicalize(inside) } else { Ok(package.join("../../../player")) }
}

/// All files under a folder.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for path in entries(folder)? {
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

/// What is in a folder but for hidden things; cargo runs this again when that changes.
fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if !entry.file_name().as_encoded_bytes().starts_with(b".") {
            paths.push(entry.path());
        }
    }
    Ok(paths)
}
