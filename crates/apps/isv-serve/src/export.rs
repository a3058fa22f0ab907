//! The player in a folder that appears whole or not at all.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The file by which an earlier export is known. It lists all files, so that none that a user put beside them is deleted.
const LIST: &str = ".isv-player";

/// An export that cannot be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A path without a last part.
    #[error("{}: name a folder to be made", .0.display())]
    NoName(PathBuf),
    /// A file in place of the folder.
    #[error("{}: not a folder: name another", .0.display())]
    NoFolder(PathBuf),
    /// A folder with files of somebody else.
    #[error("{}: not empty, and no earlier export: name another folder", .0.display())]
    NotEmpty(PathBuf),
    /// A folder of an earlier export, to which somebody added a file.
    #[error("{}: {} is from no export: move it, or name another folder", .folder.display(), .file.display())]
    Foreign {
        /// The folder.
        folder: PathBuf,
        /// The file, relative to it.
        file: PathBuf,
    },
    /// A file that cannot be written, or copied.
    #[error("{}: {cause}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Cause of the failure.
        cause: io::Error,
    },
}

/// Names a file in an error.
fn at(path: &Path) -> impl FnOnce(io::Error) -> ExportError + use<> {
    let path = path.to_owned();
    |cause| ExportError::Io { path, cause }
}

/// Files that are collected in a hidden folder beside the final one, until all are there.
#[derive(Debug)]
pub struct ExportFolder {
    /// Path as given, for messages.
    path: PathBuf,
    /// Folder of the files until then; removed when this is dropped.
    partial: PathBuf,
    files: BTreeSet<String>,
}

impl ExportFolder {
    /// Begins an export to `path`, which is new, empty, or that of an earlier export.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn create(path: &Path) -> Result<Self, ExportError> {
        check(path)?;
        // A link stays a link.
        let path =
            &if path.is_symlink() { fs::canonicalize(path).map_err(at(path))? } else { path.to_owned() };
        let partial = beside(path, "partial")?;
        fs::create_dir(&partial).map_err(at(path))?;
        Ok(Self { path: path.to_owned(), partial, files: BTreeSet::new() })
    }

    /// Writes a file; `inside` is its place, with slashes.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn write(&mut self, inside: &str, bytes: &[u8]) -> Result<(), ExportError> {
        let place = self.place(inside)?;
        fs::write(place, bytes).map_err(at(&self.path.join(inside)))
    }

    /// Copies a file into a folder inside, under its own name.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn copy(&mut self, from: &Path, folder: &str) -> Result<(), ExportError> {
        let name = from.file_name().unwrap_or_default().to_string_lossy();
        let place = self.place(&format!("{folder}/{name}"))?;
        fs::copy(from, place).map_err(at(from)).map(drop)
    }

    /// Gives the folder its name; returns how many files are in it.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn commit(mut self) -> Result<usize, ExportError> {
        let count = self.files.len();
        let list: String = self.files.iter().map(|file| format!("{file}\n")).collect();
        self.write(LIST, list.as_bytes())?;
        // What was there since the export began is not to be lost either.
        check(&self.path)?;
        let old = beside(&self.path, "old")?;
        let has_old = self.path.exists();
        if has_old {
            fs::rename(&self.path, &old).map_err(at(&self.path))?;
        }
        if let Err(error) = fs::rename(&self.partial, &self.path) {
            if has_old {
                // If this fails too, both folders are still there beside the name.
                let _ = fs::rename(&old, &self.path);
            }
            return Err(at(&self.path)(error));
        }
        if has_old {
            fs::remove_dir_all(&old).map_err(at(&old))?;
        }
        Ok(count)
    }

    /// Path to which a file is to be written.
    fn place(&mut self, inside: &str) -> Result<PathBuf, ExportError> {
        let place = self.partial.join(inside);
        let folder = place.parent().expect("a file is in a folder");
        fs::create_dir_all(folder).map_err(at(&self.path.join(inside)))?;
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
fn beside(path: &Path, what: &str) -> Result<PathBuf, ExportError> {
    let name = path.file_name().ok_or_else(|| ExportError::NoName(path.to_owned()))?;
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.{what}", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// Refuses a folder with anything in it that is not from an earlier export.
fn check(path: &Path) -> Result<(), ExportError> {
    let found = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(at(path)(error)),
        Ok(metadata) if !metadata.is_dir() => return Err(ExportError::NoFolder(path.to_owned())),
        Ok(_) => files_in(path).map_err(at(path))?,
    };
    if found.is_empty() {
        return Ok(());
    }
    let Ok(list) = fs::read_to_string(path.join(LIST)) else {
        return Err(ExportError::NotEmpty(path.to_owned()));
    };
    let known: BTreeSet<PathBuf> = list.lines().chain([LIST]).map(PathBuf::from).collect();
    match found.into_iter().find(|file| !known.contains(file)) {
        Some(file) => Err(ExportError::Foreign { folder: path.to_owned(), file }),
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

    fn export(path: &Path, files: &[&str]) -> Result<usize, ExportError> {
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
