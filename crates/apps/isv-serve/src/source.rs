//! Source of live packets: a pipe, a FIFO, a file that grows, or the newest file of a folder.

mod follow;
mod packets;

use crate::ServeError;
use crate::hub::Hub;
use follow::Followed;
use isv_format::PacketHeader;
use packets::{Packets, Piece};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// How often a source that waits looks again.
const POLL: Duration = Duration::from_millis(10);

/// How long to wait after what cannot be read.
const RECOVERY: Duration = Duration::from_secs(1);

/// A source of packets.
pub struct Source {
    /// For notices.
    name: String,
    kind: Kind,
}

enum Kind {
    /// Bytes that end once.
    Pipe(Option<Box<dyn Read + Send>>),
    /// A FIFO: opened again when its writer has gone.
    Fifo { path: PathBuf, open: Option<File> },
    /// A file that is being written, or a folder where such files appear.
    Followed(Followed),
}

/// Bytes of one writer.
struct Opened {
    bytes: Box<dyn Read + Send>,
    /// Bytes that were passed over behind the stream header.
    skipped: u64,
}

impl Source {
    /// Bytes that come as they are made, such as standard input; `name` is for notices.
    pub fn pipe(name: impl Into<String>, bytes: impl Read + Send + 'static) -> Self {
        Self { name: name.into(), kind: Kind::Pipe(Some(Box::new(bytes))) }
    }

    /// A FIFO, a file or a folder. A file need not be there yet if its folder is.
    ///
    /// # Errors
    /// [`ServeError::File`] for what is not there and cannot come.
    pub fn open(path: &Path) -> Result<Self, ServeError> {
        let fail = |cause| ServeError::File { path: path.to_owned(), cause };
        let kind = match fs::metadata(path) {
            // As standard input under a name, or a process substitution of a shell: its writer cannot come again.
            Ok(metadata) if is_fifo(&metadata) && !has_name(path) => {
                Kind::Pipe(Some(Box::new(File::open(path).map_err(fail)?)))
            }
            Ok(metadata) if is_fifo(&metadata) => Kind::Fifo { path: path.to_owned(), open: None },
            Ok(metadata) if metadata.is_dir() => Kind::Followed(Followed::folder(path)),
            Ok(metadata) if metadata.is_file() => Kind::Followed(Followed::file(path)),
            // A device, such as a serial line.
            Ok(_) => Kind::Pipe(Some(Box::new(File::open(path).map_err(fail)?))),
            Err(error) if error.kind() == io::ErrorKind::NotFound && folder_exists(path) => {
                Kind::Followed(Followed::file(path))
            }
            Err(cause) => return Err(fail(cause)),
        };
        Ok(Self { name: path.display().to_string(), kind })
    }

    /// Feeds a hub from a thread of its own, until the source has ended for good or the feed is dropped. What goes wrong is
    /// told in one sentence each, and so is that a file is not there yet.
    pub fn feed(self, hub: Arc<Hub>, notice: impl FnMut(&str) + Send + 'static) -> Feed {
        let stop = Arc::new(AtomicBool::new(false));
        let mut feeder = Feeder { hub, name: self.name, notice, stop: Arc::clone(&stop) };
        if let Kind::Followed(followed) = &self.kind
            && let Some(what) = followed.lacks()
        {
            feeder.tell(&what);
        }
        thread::spawn(move || feeder.run(self.kind));
        Feed { stop }
    }
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Source").field("name", &self.name).finish_non_exhaustive()
    }
}

/// A source at work. When this is dropped it stops, as soon as it is done with waiting for bytes that a pipe may never give.
#[derive(Debug)]
pub struct Feed {
    stop: Arc<AtomicBool>,
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Kind {
    /// The bytes of the next writer, for which it waits; `None` if there will be none.
    fn open(&mut self, stop: &Arc<AtomicBool>) -> io::Result<Option<Opened>> {
        match self {
            Self::Pipe(bytes) => Ok(bytes.take().map(|bytes| Opened { bytes, skipped: 0 })),
            Self::Fifo { path, open } => {
                // The one before stays open meanwhile, or what is written between the two would be lost.
                let file = File::open(path)?;
                let bytes = Box::new(file.try_clone()?);
                *open = Some(file);
                Ok(Some(Opened { bytes, skipped: 0 }))
            }
            Self::Followed(followed) => followed.open(stop),
        }
    }

    /// A stream has come to its end. Whether more may come from the same writer; after a file it is another file.
    fn goes_on_after_an_end(&mut self) -> bool {
        match self {
            Self::Pipe(_) | Self::Fifo { .. } => true,
            Self::Followed(followed) => {
                followed.note_end();
                false
            }
        }
    }
}

/// What runs on the thread.
struct Feeder<N> {
    hub: Arc<Hub>,
    name: String,
    notice: N,
    stop: Arc<AtomicBool>,
}

impl<N: FnMut(&str)> Feeder<N> {
    fn run(mut self, mut kind: Kind) {
        // What was last in the way, which may be for a moment or for hours, and is told once.
        let mut obstacle = None;
        while !self.stop.load(Ordering::Relaxed) {
            match kind.open(&self.stop) {
                Ok(Some(opened)) => {
                    obstacle = None;
                    if let Err(error) = self.read(opened, &mut kind) {
                        self.tell(&error);
                        // It may fail again at once, and for ever.
                        thread::sleep(RECOVERY);
                    }
                    self.hub.end();
                    // What is at its end again at once must not keep a processor busy.
                    thread::sleep(POLL);
                }
                Ok(None) => {
                    self.hub.finish();
                    return;
                }
                Err(error) => {
                    let what = error.to_string();
                    if obstacle.as_ref() != Some(&what) {
                        self.tell(&format!("{what}: tried again until it can be read"));
                    }
                    obstacle = Some(what);
                    thread::sleep(RECOVERY);
                }
            }
        }
    }

    /// Reads what one writer gives.
    fn read(&mut self, opened: Opened, kind: &mut Kind) -> io::Result<()> {
        let largest = u32::try_from(self.hub.largest_packet().saturating_sub(PacketHeader::BYTES));
        let mut packets = Packets::new(opened.bytes, opened.skipped, largest.unwrap_or(u32::MAX));
        while let Some(piece) = packets.next()? {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            match piece {
                Piece::Header(header) => self.hub.start(&header.to_bytes()),
                Piece::Metadata(packet) => self.hub.describe(&packet),
                Piece::Frame { packet, entry } => self.hub.publish(&packet, entry),
                Piece::Damage(what) => {
                    self.hub.gap();
                    self.tell(&format!("{what}: passed over, up to the next keyframe"));
                }
                Piece::End => {
                    // Before anybody hears of the end and writes the next stream.
                    let goes_on = kind.goes_on_after_an_end();
                    self.hub.end();
                    if !goes_on {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }

    fn tell(&mut self, what: &dyn std::fmt::Display) {
        (self.notice)(&format!("{}: {what}", self.name));
    }
}

fn folder_exists(path: &Path) -> bool {
    std::path::absolute(path).is_ok_and(|path| path.parent().is_some_and(Path::is_dir))
}

/// Whether a FIFO is a file that a writer can open: pipes of a process have paths under which nobody else finds them.
fn has_name(path: &Path) -> bool {
    fs::canonicalize(path).is_ok_and(|real| !real.starts_with("/dev/fd") && !real.starts_with("/proc"))
}

#[cfg(unix)]
fn is_fifo(metadata: &fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    metadata.file_type().is_fifo()
}

#[cfg(not(unix))]
fn is_fifo(_: &fs::Metadata) -> bool {
    false
}
