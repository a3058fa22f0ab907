//! Names of outputs: a name that ends like a file of another program is refused before any work.

use super::{OutputError, is_pipe};
use std::path::{Path, is_separator};

/// Endings that name a kind of file although they are longer than most, begin with a digit or look like a version.
const KNOWN_ENDINGS: [&str; 10] =
    ["3dm", "3ds", "3mf", "3gp", "7z", "h5", "alembic", "geojson", "geotiff", "parquet"];

/// Longest ending that is taken for that of a file without being known.
const LONGEST_ENDING: usize = 5;

/// Endings of streams that wait for their final name.
const UNFINISHED: [&str; 6] = ["part", "tmp", "temp", "new", "old", "bak"];

/// The ending of a name, without the dot, if it is that of a file and not a part of a folder's name.
///
/// An ending is up to five letters and digits, the first a letter. `v2` or `r10` is a version, `05` a number.
fn file_ending(path: &Path) -> Option<&str> {
    let ending = path.extension()?.to_str()?;
    if KNOWN_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        return Some(ending);
    }
    let is_short = (1..=LONGEST_ENDING).contains(&ending.len());
    let begins_with_letter = ending.starts_with(|c: char| c.is_ascii_alphabetic());
    let is_version = ending.len() > 1 && ending[1..].bytes().all(|byte| byte.is_ascii_digit());
    let is_plain = ending.bytes().all(|byte| byte.is_ascii_alphanumeric());
    (is_short && begins_with_letter && is_plain && !is_version).then_some(ending)
}

/// Whether a name ends in a slash, so that it can only be a folder's.
fn ends_in_slash(path: &Path) -> bool {
    path.to_string_lossy().ends_with(is_separator)
}

/// Whether a name stands for a folder, whatever its ending: one that is there, or one with a slash at its end.
#[must_use]
pub fn is_folder(path: &Path) -> bool {
    ends_in_slash(path) || path.is_dir()
}

/// Refuses a folder whose name ends like that of a file. `contents`: what is written into it.
///
/// # Errors
/// [`OutputError::FolderLikeFile`].
pub fn check_folder_name(path: &Path, contents: &str) -> Result<(), OutputError> {
    if is_pipe(path) || is_folder(path) {
        return Ok(());
    }
    let Some(ending) = file_ending(path) else { return Ok(()) };
    let (name, ending) = (path.display().to_string(), ending.to_owned());
    Err(OutputError::FolderLikeFile { name, ending, contents: contents.to_owned() })
}

/// Refuses a stream whose name ends like that of another kind of file.
///
/// # Errors
/// [`OutputError::StreamLikeFile`].
pub fn check_stream_name(path: &Path) -> Result<(), OutputError> {
    let written_through = path.metadata().is_ok_and(|found| !found.is_file());
    if is_pipe(path) || written_through || ends_in_slash(path) {
        return Ok(());
    }
    let is_stream = |ending: &str| {
        ["isv", "mp4"].iter().any(|own| ending.eq_ignore_ascii_case(own))
            || UNFINISHED.iter().any(|own| ending.eq_ignore_ascii_case(own))
    };
    let Some(ending) = file_ending(path).filter(|ending| !is_stream(ending)) else { return Ok(()) };
    let [name, proposal] = [path, &path.with_extension("isv")].map(|path| path.display().to_string());
    Err(OutputError::StreamLikeFile { name, ending: ending.to_owned(), proposal })
}

/// Refuses a file whose name has the ending of a file; those that isv writes were told before. `written`: names that do.
///
/// # Errors
/// [`OutputError::OtherFile`].
pub fn check_file_name(path: &Path, written: &str) -> Result<(), OutputError> {
    if is_pipe(path) || is_folder(path) {
        return Ok(());
    }
    let Some(ending) = file_ending(path) else { return Ok(()) };
    let (name, ending) = (path.display().to_string(), ending.to_owned());
    Err(OutputError::OtherFile { name, ending, written: written.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_of_files_are_told_from_parts_of_folder_names() {
        for name in [
            "a.usd",
            "a.usda",
            "a.USDC",
            "a.usdz",
            "a.abc",
            "a.fbx",
            "a.mp4",
            "a.drc",
            "a.npz",
            "a.gltf",
            "a.las",
            "a.dae",
            "a.blend",
            "a.jpg",
            "a.webp",
            "a.3mf",
            "a.3ds",
            "a.7z",
            "a.c4d",
            "a.x3d",
            "a.h5",
            "a.mov",
            "a.ply.gz",
            "take.v2.zip",
            "dir.v1/a.bin",
            "a.tar",
            "a.txt",
            "a.alembic",
        ] {
            assert!(file_ending(Path::new(name)).is_some(), "{name}");
        }
        for name in [
            "take",
            "take.v2",
            "take.r10",
            "2024.01.05",
            "take.",
            ".hidden",
            "take.10",
            "a b.take two",
            "..",
            ".",
            "take.final-version",
            "dir.usd/take",
            "take.1a",
        ] {
            assert_eq!(file_ending(Path::new(name)), None, "{name}");
        }
    }

    #[test]
    fn a_folder_that_is_there_or_has_a_slash_may_have_any_name() {
        let work = tempfile::tempdir().unwrap();
        let there = work.path().join("there.usd");
        std::fs::create_dir(&there).unwrap();
        let not_there = work.path().join("new.usd");
        assert!(check_folder_name(&there, "frames").is_ok());
        let error = check_folder_name(&not_there, "frames").unwrap_err().to_string();
        assert!(error.contains("new.usd: isv does not write .usd files"), "{error}");
        let with_slash = format!("{}/", not_there.display());
        assert!(check_folder_name(Path::new(&with_slash), "frames").is_ok());
        assert!(check_folder_name(Path::new("-"), "frames").is_ok());
    }

    #[test]
    fn streams_are_isv_files_or_have_no_ending() {
        for name in [
            "take.isv",
            "take.ISV",
            "take.mp4",
            "take",
            "take.v2",
            "-",
            "take.isv.part",
            "take.isv.tmp",
            "2024.01.05",
        ] {
            assert!(check_stream_name(Path::new(name)).is_ok(), "{name}");
        }
        for name in ["take.ply", "take.mov", "take.GLB", "take.isv.gz", "take.npz", "take.3mf", "take.bin"] {
            let error = check_stream_name(Path::new(name)).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{name}: what is written is an .isv stream")), "{error}");
        }
        #[cfg(unix)]
        assert!(check_stream_name(Path::new("/dev/null")).is_ok());
    }
}
