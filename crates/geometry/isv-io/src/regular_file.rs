//! Files whose size is known before they are read. Pipes and devices might never end.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Opens a file, and says how many bytes it has; refuses what is no regular file.
pub(crate) fn open(path: &Path) -> io::Result<(File, u64)> {
    // Asked before it is opened: opening a named pipe waits for somebody to write to it.
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    Ok((file, length))
}

/// Reads a file whole, which must not be empty.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    if length == 0 {
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the file is empty"));
    }
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_empty_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(folder.path()).unwrap_err().to_string(), "not a regular file");
        let file = folder.path().join("empty");
        std::fs::write(&file, "").unwrap();
        assert_eq!(read(&file).unwrap_err().to_string(), "the file is empty");
        std::fs::write(&file, "12").unwrap();
        assert_eq!(read(&file).unwrap(), b"12");
    }
}
