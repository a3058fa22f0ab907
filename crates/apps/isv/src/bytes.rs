//! Bytes that several readers share, each with a place of its own.

use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes in memory.
pub(crate) struct SharedBytes<B>(Arc<B>);

impl<B: AsRef<[u8]>> SharedBytes<B> {
    pub(crate) fn new(bytes: B) -> Self {
        Self(Arc::new(bytes))
    }

    /// A reader at the first byte.
    pub(crate) fn open(&self) -> Cursor<Self> {
        Cursor::new(Self(Arc::clone(&self.0)))
    }
}

impl<B: AsRef<[u8]>> AsRef<[u8]> for SharedBytes<B> {
    fn as_ref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

/// A source that can be sought in.
pub(crate) struct SharedSource<S>(Arc<Mutex<S>>);

/// A place in a [`SharedSource`].
pub(crate) struct SharedPlace<S> {
    source: Arc<Mutex<S>>,
    at: u64,
}

impl<S: Read + Seek> SharedSource<S> {
    pub(crate) fn new(source: S) -> Self {
        Self(Arc::new(Mutex::new(source)))
    }

    /// A reader at the first byte.
    pub(crate) fn open(&self) -> BufReader<SharedPlace<S>> {
        BufReader::with_capacity(1 << 16, SharedPlace { source: Arc::clone(&self.0), at: 0 })
    }
}

impl<S> SharedPlace<S> {
    /// The source, though another thread may have panicked with it: each use goes to its place first.
    fn source(source: &Mutex<S>) -> MutexGuard<'_, S> {
        source.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: Read + Seek> Read for SharedPlace<S> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut source = Self::source(&self.source);
        source.seek(SeekFrom::Start(self.at))?;
        let read = source.read(bytes)?;
        self.at += read as u64;
        Ok(read)
    }
}

impl<S: Read + Seek> Seek for SharedPlace<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let before_start = || io::Error::new(io::ErrorKind::InvalidInput, "a place before the first byte");
        self.at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) => self.at.checked_add_signed(by).ok_or_else(before_start)?,
            SeekFrom::End(_) => Self::source(&self.source).seek(to)?,
        };
        Ok(self.at)
    }
}
