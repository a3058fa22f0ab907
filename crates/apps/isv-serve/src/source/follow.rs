//! Files that are being written.

use super::{Opened, POLL};
use isv_format::{MAGIC, PacketReader, StreamHeader, StreamIndex};
use isv_mp4::{GeometryPipe, Mp4File, is_mp4, is_stream_name};
use std::fs::{self, File, Metadata};
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

/// How long a file must have been still before a newer one in its folder takes its place.
const STILLNESS: Duration = Duration::from_secs(1);
/// How long a file that is there may be unreadable before that is told.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often a folder is read.
const FOLDER_POLL: Duration = Duration::from_millis(200);

/// A file, or whichever in a folder was written last.
#[derive(Debug)]
pub(super) struct Followed {
    place: Place,
    /// The file that is read.
    reading: PathBuf,
    /// The file whose end was read last, as it was then.
    done: Option<Candidate>,
}

#[derive(Clone, Debug)]
enum Place {
    File(PathBuf),
    Folder(PathBuf),
}

/// A file as it is at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Candidate {
    path: PathBuf,
    /// Differs between files that had the same path.
    identity: u128,
    length: u64,
    written: SystemTime,
}

impl Followed {
    pub(super) fn file(path: &Path) -> Self {
        Self { place: Place::File(path.to_owned()), reading: PathBuf::new(), done: None }
    }

    pub(super) fn folder(path: &Path) -> Self {
        Self { place: Place::Folder(path.to_owned()), reading: PathBuf::new(), done: None }
    }

    /// What is waited for, if nothing is there to read yet.
    pub(super) fn lacks(&self) -> Option<&'static str> {
        // What cannot be looked at is told when it is opened.
        if !matches!(self.place.newest(), Ok(None)) {
            return None;
        }
        Some(match self.place {
            Place::File(_) => "not there yet: waiting for it",
            Place::Folder(_) => "no .isv file is in it yet: waiting for one",
        })
    }

    /// Waits for a file other than the one whose end was read, and begins at its last entry; `None` when told to stop.
    ///
    /// # Errors
    /// A folder that cannot be read, and a file that cannot for some time.
    pub(super) fn open(&mut self, stop: &Arc<AtomicBool>) -> io::Result<Option<Opened>> {
        let mut refused_since = None;
        while !stop.load(Ordering::Relaxed) {
            let found = self.place.newest()?.filter(|found| self.done.as_ref() != Some(found));
            if let Some(found) = found {
                let path = found.path.clone();
                match self.begin(found, stop) {
                    Ok(opened) => {
                        self.reading = path;
                        return Ok(Some(opened));
                    }
                    // It has gone in this very moment.
                    Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                    // It may not be readable yet.
                    Err(error) if refused_since.get_or_insert_with(Instant::now).elapsed() > PATIENCE => {
                        let name = path.file_name().unwrap_or_default().display();
                        return Err(io::Error::new(error.kind(), format!("{name}: {error}")));
                    }
                    Err(_) => {}
                }
            }
            sleep(self.place.poll());
        }
        Ok(None)
    }

    /// The end of what is read has come: it is not opened again unless it changes.
    pub(super) fn note_end(&mut self) {
        self.done = Candidate::at(&self.reading);
    }

    /// The stream header, and then the file from its last entry on: what was before is no longer live. A file in which none
    /// can be found is read from its first byte.
    fn begin(&self, found: Candidate, stop: &Arc<AtomicBool>) -> io::Result<Opened> {
        let mut file = File::open(&found.path)?;
        let container = container(&file)?;
        let (header_bytes, at) = match container {
            Container::Isv => last_entry(&file).map(|at| (StreamHeader::BYTES as u64, at)),
            Container::Mp4 => Mp4File::open(BufReader::new(&file)).ok().and_then(|mp4| mp4.last_entry()),
        }
        .unwrap_or((0, 0));
        let mut header = Vec::new();
        file.seek(SeekFrom::Start(0))?;
        (&file).take(header_bytes).read_to_end(&mut header)?;
        file.seek(SeekFrom::Start(at))?;
        let (place, stop) = (self.place.clone(), Arc::clone(stop));
        let rest = Growing { file, at, opened: found, place, folder_read: Instant::now(), stop };
        let bytes = Cursor::new(header).chain(rest);
        Ok(match container {
            Container::Isv => Opened { bytes: Box::new(bytes), skipped: at.saturating_sub(header_bytes) },
            // Places in its stream are not those in the file.
            Container::Mp4 => Opened { bytes: Box::new(GeometryPipe::new(bytes)), skipped: 0 },
        })
    }
}

/// The kind of file that holds a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Container {
    Isv,
    Mp4,
}

/// Tells the kind of a file. One that has begun, and not as a stream does, would be searched for one for ever.
fn container(file: &File) -> io::Result<Container> {
    let (mut file, mut start) = (file, Vec::new());
    file.take(MAGIC.len() as u64).read_to_end(&mut start)?;
    file.seek(SeekFrom::Start(0))?;
    if is_mp4(&start) {
        return Ok(Container::Mp4);
    }
    match MAGIC.starts_with(&start) {
        true => Ok(Container::Isv),
        false => Err(io::Error::new(io::ErrorKind::InvalidData, "not an .isv stream and no MP4 file")),
    }
}

/// Beginning of the last frame that decoding can begin at: a keyframe, or the last frame of all, if that is
/// resilient.
fn last_entry(file: &File) -> Option<u64> {
    let mut bytes = BufReader::new(file);
    let index = StreamIndex::load(&mut bytes).ok()?;
    bytes.seek(SeekFrom::Start(0)).ok()?;
    let header = *PacketReader::new(&mut bytes).ok()?.header();
    let last = index.frames.last()?.at;
    bytes.seek(SeekFrom::Start(last)).ok()?;
    let packet = PacketReader::at_packet(&mut bytes, last, &header).next_frame().ok()??;
    if packet.is_entry(&header.profile) {
        return Some(last);
    }
    index.frames.iter().rfind(|frame| frame.keyframe).map(|frame| frame.at)
}

impl Place {
    fn poll(&self) -> Duration {
        match self {
            Self::File(_) => POLL,
            Self::Folder(_) => FOLDER_POLL,
        }
    }

    /// The file, if it is there; of a folder the stream that was written last.
    fn newest(&self) -> io::Result<Option<Candidate>> {
        let folder = match self {
            Self::File(path) => return Ok(Candidate::at(path)),
            Self::Folder(folder) => folder,
        };
        let mut newest: Option<Candidate> = None;
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let found = if is_stream(&path) { Candidate::at(&path) } else { None };
            newest = newest
                .into_iter()
                .chain(found)
                .max_by(|a, b| (a.written, &a.path).cmp(&(b.written, &b.path)));
        }
        Ok(newest)
    }
}

/// Whether a path has the ending of a stream. Hidden files are not yet what they will be.
fn is_stream(path: &Path) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    !is_hidden && is_stream_name(path)
}

impl Candidate {
    fn at(path: &Path) -> Option<Self> {
        let metadata = fs::metadata(path).ok().filter(Metadata::is_file)?;
        let written = metadata.modified().ok()?;
        Some(Self { path: path.to_owned(), identity: identity(&metadata), length: metadata.len(), written })
    }
}

#[cfg(unix)]
fn identity(metadata: &Metadata) -> u128 {
    use std::os::unix::fs::MetadataExt;
    u128::from(metadata.dev()) << 64 | u128::from(metadata.ino())
}

#[cfg(not(unix))]
fn identity(metadata: &Metadata) -> u128 {
    let created = metadata.created().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
    created.unwrap_or_default().as_nanos()
}

/// A file whose end is waited for, until another is to be read.
struct Growing {
    file: File,
    /// Bytes of the file before the next one.
    at: u64,
    opened: Candidate,
    place: Place,
    folder_read: Instant,
    stop: Arc<AtomicBool>,
}

impl Growing {
    /// Whether the file was begun anew, or another has come in its place.
    fn is_over(&mut self) -> io::Result<bool> {
        let current = Candidate::at(&self.opened.path);
        if let Some(current) = &current
            && (current.identity != self.opened.identity || current.length < self.at)
        {
            return Ok(true);
        }
        if matches!(self.place, Place::File(_)) || self.folder_read.elapsed() < FOLDER_POLL {
            return Ok(false);
        }
        self.folder_read = Instant::now();
        let newest = self.place.newest()?.filter(|newest| newest.path != self.opened.path);
        Ok(newest
            .is_some_and(|newest| current.is_none_or(|current| newest.written > current.written + STILLNESS)))
    }
}

impl Read for Growing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while !self.stop.load(Ordering::Relaxed) {
            let count = self.file.read(buffer)?;
            self.at += count as u64;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            if self.is_over()? {
                return Ok(0);
            }
            sleep(POLL);
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_begins_otherwise_than_a_stream_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let verdict = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            let mut file = File::open(&path).unwrap();
            container(&file).map(|kind| (kind, file.stream_position().unwrap()))
        };
        // It may not have been written further yet.
        for begun in [&MAGIC[..0], &MAGIC[..3], &[&MAGIC[..], b"more"].concat()] {
            assert_eq!(verdict(begun).unwrap(), (Container::Isv, 0));
        }
        assert_eq!(verdict(b"\0\0\0\x18ftypiso6").unwrap(), (Container::Mp4, 0));
        for other in [&b"ply\nformat"[..], b"\x89PNG", b"i"] {
            assert!(verdict(other).unwrap_err().to_string().contains("not an .isv stream"));
        }
    }
}
