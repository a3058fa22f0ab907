//! Output that appears whole or not at all.

use crate::WriteError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A buffered file that takes its name only when [committed](Self::commit).
///
/// Bytes go to a file beside the final name. Its name has `.part` after it, or `.2.part` and so on if such a
/// file is there already. It is renamed at the end and removed if the value is dropped before. A file that
/// had the final name stays untouched until then. Of a job that is killed, what it had flushed stays under
/// the name with `.part`. This guards against jobs that fail, not against power cuts: nothing is forced to
/// the disk.
///
/// What is no regular file (a pipe, `/dev/null`) is written straight through, as a rename would replace it. A link to a
/// file stays a link.
#[derive(Debug)]
pub struct AtomicFile {
    /// Path as given, for messages.
    path: PathBuf,
    writer: BufWriter<File>,
    pending: Option<Rename>,
}

/// The rename that is still to be done.
#[derive(Debug)]
struct Rename {
    from: PathBuf,
    to: PathBuf,
}

impl AtomicFile {
    /// Opens a file to be known as `path`, whose folder must exist.
    ///
    /// # Errors
    /// [`WriteError`] if the folder is missing or not writable, or `path` is a folder or ends like one.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let (file, pending) = open(path).map_err(|cause| WriteError::new(path, cause))?;
        Ok(Self { path: path.to_owned(), writer: BufWriter::new(file), pending })
    }

    /// Writes out what is buffered and gives the file its name, replacing a file that had it.
    ///
    /// # Errors
    /// [`WriteError`]; the file that had the name is then still there and untouched.
    pub fn commit(mut self) -> Result<(), WriteError> {
        self.flush().map_err(|cause| WriteError::new(&self.path, cause))?;
        if let Some(rename) = &self.pending {
            fs::rename(&rename.from, &rename.to).map_err(|cause| WriteError::new(&self.path, cause))?;
            self.pending = None;
        }
        Ok(())
    }

    /// Gives up the final name: what is written, before and after this call, stays beside it, under the name that is returned.
    /// Nothing for what is no regular file.
    pub fn keep(&mut self) -> Option<PathBuf> {
        self.pending.take().map(|rename| rename.from)
    }

    /// Names the file in an error.
    fn named<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|cause| WriteError::new(&self.path, cause).into())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(rename) = &self.pending {
            // Nobody is left to tell; the worst that can happen is a file that stays.
            let _ = fs::remove_file(&rename.from);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(bytes);
        self.named(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.writer.flush();
        self.named(flushed)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = self.writer.seek(to);
        self.named(at)
    }
}

fn open(path: &Path) -> io::Result<(File, Option<Rename>)> {
    let to = match fs::metadata(path) {
        Ok(existing) if existing.is_file() => fs::canonicalize(path)?,
        Ok(existing) if existing.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(_) => return Ok((OpenOptions::new().write(true).open(path)?, None)),
        Err(_) => path.to_owned(),
    };
    let name = to.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    // `out/` would be found to be no name of a file when the file is to get it.
    if !to.as_os_str().as_encoded_bytes().ends_with(name.as_encoded_bytes()) {
        return Err(io::ErrorKind::NotADirectory.into());
    }
    // Another process, or a job that was killed, may hold the first name tried: nothing of theirs is overwritten.
    for attempt in 1..=1000 {
        let mut part = name.to_owned();
        part.push(if attempt == 1 { ".part".to_owned() } else { format!(".{attempt}.part") });
        let from = to.with_file_name(part);
        match OpenOptions::new().write(true).create_new(true).open(&from) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            opened => return Ok((opened?, Some(Rename { from, to }))),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::OsString;

    fn names(folder: &Path) -> Vec<OsString> {
        let mut names: Vec<_> = folder.read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_dropped_file_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.isv");
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(&[7; 100_000]).unwrap();
        assert_eq!(names(folder.path()), ["out.isv.part"]);
        drop(file);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn the_old_file_stays_until_the_new_one_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.isv");
        fs::write(&path, "old").unwrap();
        let mut abandoned = AtomicFile::create(&path).unwrap();
        abandoned.write_all(b"half").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"nEW").unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        file.write_all(b"n").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["out.isv", "out.isv.2.part", "out.isv.part"]);
        file.commit().unwrap();
        drop(abandoned);
        assert_eq!(fs::read(&path).unwrap(), b"nEW");
        assert_eq!(names(folder.path()), ["out.isv"]);
    }

    #[test]
    fn what_is_kept_stays_beside_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.isv");
        fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"ha").unwrap();
        let part = file.keep().unwrap();
        file.write_all(b"lf").unwrap();
        file.commit().unwrap();
        assert_eq!((fs::read(&part).unwrap(), fs::read(&path).unwrap()), (b"half".to_vec(), b"old".to_vec()));
        assert_eq!(names(folder.path()), ["out.isv", "out.isv.part"]);
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing").join("out.isv");
        let message = AtomicFile::create(&path).unwrap_err().to_string();
        assert!(message.starts_with(&format!("{}: cannot write: ", path.display())), "{message}");
        for folder in [folder.path().to_owned(), folder.path().join("none/"), folder.path().join("none/.")] {
            let message = AtomicFile::create(&folder).unwrap_err().to_string();
            assert!(message.contains("directory"), "{message}");
        }
        assert!(names(folder.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_a_device_a_device() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let mut file = AtomicFile::create(&link).unwrap();
        file.write_all(b"new").unwrap();
        file.commit().unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");

        let mut null = AtomicFile::create(Path::new("/dev/null")).unwrap();
        null.write_all(b"gone").unwrap();
        null.commit().unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
