//! The bytes of a stream: those of an `.isv` file, or what an MP4 file holds of one.

use super::StreamFault;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

#[cfg(feature = "io")]
use isv_mp4::{GeometryStream, is_mp4};

/// Bytes of a stream in which a reader can go to any place.
pub struct StreamBytes<S>(Form<S>);

enum Form<S> {
    Plain(S),
    #[cfg(feature = "io")]
    Mp4(Box<GeometryStream<S>>),
}

/// The file of a stream.
pub type StreamFile = StreamBytes<BufReader<File>>;

impl<S: Read + Seek> StreamBytes<S> {
    /// Tells by its first bytes what a source holds. The source is at its begin.
    ///
    /// # Errors
    /// An MP4 file without a track of geometry, or a damaged one.
    #[cfg(feature = "io")]
    pub fn new(mut source: S) -> Result<Self, StreamFault> {
        let mut begin = Vec::new();
        source.by_ref().take(8).read_to_end(&mut begin)?;
        source.seek(SeekFrom::Start(0))?;
        Ok(Self(match is_mp4(&begin) {
            true => Form::Mp4(Box::new(GeometryStream::open(source)?)),
            false => Form::Plain(source),
        }))
    }

    /// Takes a source as it is: without feature `io`, no MP4 file is read.
    ///
    /// # Errors
    /// None.
    #[cfg(not(feature = "io"))]
    pub fn new(source: S) -> Result<Self, StreamFault> {
        Ok(Self(Form::Plain(source)))
    }

    /// Takes the bytes of a stream as they are, though they cannot be sought in.
    pub(super) fn plain(source: S) -> Self {
        Self(Form::Plain(source))
    }

    /// The MP4 file around the stream, if there is one.
    #[cfg(feature = "io")]
    pub fn mp4(&self) -> Option<&isv_mp4::Mp4File<S>> {
        match &self.0 {
            Form::Plain(_) => None,
            Form::Mp4(stream) => Some(stream.file()),
        }
    }

    /// The MP4 file around the stream, by itself.
    #[cfg(feature = "io")]
    pub fn into_mp4(self) -> Option<isv_mp4::Mp4File<S>> {
        match self.0 {
            Form::Plain(_) => None,
            Form::Mp4(stream) => Some(stream.into_file()),
        }
    }

    /// Number of bytes up to the end of the source.
    ///
    /// # Errors
    /// A source that cannot be sought in.
    pub fn length(&mut self) -> io::Result<u64> {
        let here = self.stream_position()?;
        let end = self.seek(SeekFrom::End(0))?;
        self.seek(SeekFrom::Start(here))?;
        Ok(end)
    }
}

impl<S: Read + Seek> Read for StreamBytes<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.0 {
            Form::Plain(source) => source.read(buffer),
            #[cfg(feature = "io")]
            Form::Mp4(stream) => stream.read(buffer),
        }
    }
}

impl<S: Read + Seek> Seek for StreamBytes<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.0 {
            Form::Plain(source) => source.seek(to),
            #[cfg(feature = "io")]
            Form::Mp4(stream) => stream.seek(to),
        }
    }
}
