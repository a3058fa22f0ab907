//! A folder that appears whole or not at all.

use anyhow::{Context, Result, anyhow, bail};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The file by which an earlier export is known. It lists all files, so that none that a user put beside them is deleted.
const LIST: &str = ".isv-player";

/// Files that are collected in a hidden folder beside the final one, until all are there.
#[derive(Debug)]
pub(super) struct ExportFolder {
    /// As given, for messages.
    path: PathBuf,
    /// Where files are until then; removed when this is dropped.
    partial: PathBuf,
    files: BTreeSet<String>,
}

impl ExportFolder {
    /// Begins an export to `path`.
    pub(super) fn create(path: &Path) -> Result<Self> {
        check(path)?;
        // A link stays a link.
        let path = &if path.is_symlink() { fs::canonicalize(path)? } else { path.to_owned() };
        let partial = beside(path, "partial")?;
        fs::create_dir(&partial).with_context(|| path.display().to_string())?;
        Ok(Self { path: path.to_owned(), partial, files: BTreeSet::new() })
    }

    /// Writes a file; `inside` is its place, with slashes.
    pub(super) fn write(&mut self, inside: &str, bytes: &[u8]) -> Result<()> {
        let place = self.place(inside)?;
        fs::write(place, bytes).with_context(|| self.path.join(inside).display().to_string())
    }

    /// Copies a file into a folder inside, under its own name.
    pub(super) fn copy(&mut self, from: &Path, folder: &str) -> Result<()> {
        let name = from.file_name().unwrap_or_default().to_string_lossy();
        let place = self.place(&format!("{folder}/{name}"))?;
        fs::copy(from, place).with_context(|| format!("{}: cannot copy it", from.display())).map(drop)
    }

    /// Gives the folder its name; returns how many files are in it.
    pub(super) fn commit(mut self) -> Result<usize> {
        let count = self.files.len();
        let list: String = self.files.iter().map(|file| format!("{file}\n")).collect();
        self.write(LIST, list.as_bytes())?;
        let name = || self.path.display().to_string();
        // What was there since the export began is not to be lost either.
        check(&self.path)?;
        let old = beside(&self.path, "old")?;
        let has_old = self.path.exists();
        if has_old {
            fs::rename(&self.path, &old).with_context(name)?;
        }
        if let Err(error) = fs::rename(&self.partial, &self.path) {
            if has_old {
                // If this fails too, both folders are still there beside the name.
                let _ = fs::rename(&old, &self.path);
            }
            return Err(error).with_context(name);
        }
        if has_old {
            fs::remove_dir_all(&old).with_context(|| old.display().to_string())?;
        }
        Ok(count)
    }

    /// Where a file is to be written.
    fn place(&mut self, inside: &str) -> Result<PathBuf> {
        let place = self.partial.join(inside);
        let folder = place.parent().expect("a file is in a folder");
        fs::create_dir_all(folder).with_context(|| self.path.join(inside).display().to_string())?;
        self.files.insert(inside.to_owned());
        Ok(place)
    }
}

impl Drop for ExportFolder {
    fn drop(&mut self) {
        // After a commit it is not there. Nobody is left to tell; the worst that can happen is a hidden folder that stays.
        let _ = fs::remove_dir_all(&self.partial);
    }
}

/// A hidden name beside a folder.
fn beside(path: &Path, what: &str) -> Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| anyhow!("{}: name a folder to be made", path.display()))?;
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.{what}", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// Refuses a folder with anything in it that is not from an earlier export.
fn check(path: &Path) -> Result<()> {
    let name = path.display();
    let found = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error).context(name.to_string()),
        Ok(metadata) if !metadata.is_dir() => bail!("{name}: not a folder: name another"),
        Ok(_) => files_in(path).with_context(|| name.to_string())?,
    };
    if found.is_empty() {
        return Ok(());
    }
    let Ok(list) = fs::read_to_string(path.join(LIST)) else {
        bail!("{name}: not empty, and no earlier export: name another folder");
    };
    let known: BTreeSet<PathBuf> = list.lines().chain([LIST]).map(PathBuf::from).collect();
    match found.iter().find(|file| !known.contains(*file)) {
        Some(foreign) => {
            bail!("{name}: {} is from no export: move it, or name another folder", foreign.display())
        }
        None => Ok(()),
    }
}

/// All that is in a folder and its folders but for folders, relative to it. Links are not followed.
fn files_in(root: &Path) -> io::Result<Vec<PathBuf>> {
    let (mut files, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                folders.push(entry.path());
            } else {
                files.push(entry.path().strip_prefix(root).expect("found inside").to_owned());
            }
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn export(path: &Path, files: &[&str]) -> Result<usize> {
        let mut folder = ExportFolder::create(path)?;
        for file in files {
            folder.write(file, file.as_bytes())?;
        }
        folder.commit()
    }

    fn names(path: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            files_in(path).unwrap().iter().map(|file| file.display().to_string()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_export_replaces_an_earlier_one_whole() {
        let work = tempfile::tempdir().unwrap();
        let path = work.path().join("site");
        assert_eq!(export(&path, &["index.html", "src/old.js"]).unwrap(), 2);
        assert_eq!(export(&path, &["index.html", "src/new.js"]).unwrap(), 2);
        assert_eq!(names(&path), [LIST, "index.html", "src/new.js"]);
        assert_eq!(names(work.path()).len(), 3, "nothing is left beside it");
        let empty = work.path().join("empty");
        fs::create_dir(&empty).unwrap();
        export(&empty, &["index.html"]).unwrap();
    }

    #[test]
    fn nothing_of_the_users_is_deleted() {
        let work = tempfile::tempdir().unwrap();
        let path = work.path().join("site");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("thesis.txt"), "years").unwrap();
        let sentence = export(&path, &["index.html"]).unwrap_err().to_string();
        assert!(sentence.ends_with("not empty, and no earlier export: name another folder"), "{sentence}");
        fs::remove_file(path.join("thesis.txt")).unwrap();
        export(&path, &["index.html"]).unwrap();
        fs::write(path.join("thesis.txt"), "years").unwrap();
        let sentence = export(&path, &["index.html"]).unwrap_err().to_string();
        assert!(sentence.contains("thesis.txt is from no export"), "{sentence}");
        assert_eq!(names(&path), [LIST, "index.html", "thesis.txt"]);
        assert!(export(&work.path().join("site/thesis.txt"), &[]).is_err());
    }

    #[test]
    fn an_abandoned_export_leaves_nothing() {
        let work = tempfile::tempdir().unwrap();
        let mut folder = ExportFolder::create(&work.path().join("site")).unwrap();
        folder.write("src/a.js", b"1").unwrap();
        drop(folder);
        assert!(fs::read_dir(work.path()).unwrap().next().is_none());
    }
}
