//! Outputs of a stream: a file of its own, or an MP4 file with sound and picture beside it.

use super::StreamError;
use isv_format::MAGIC;
use isv_io::{Output, OutputError, check_not_input, check_overwriting, check_stream_name};
use isv_mp4::{GeometrySink, Mp4Error, OtherEnd, SampleSource, is_mp4};
use std::io::{self, Write};
use std::path::Path;

/// Tracks that lie beside a stream in an MP4 file.
pub type Tracks = Vec<Box<dyn SampleSource>>;

/// The kind of file that holds a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Container {
    /// A file of its own.
    #[default]
    Isv,
    /// An MP4 file.
    Mp4,
}

impl Container {
    /// The kind that the end of a name asks for: MP4 for `.mp4`, in any case.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let is_mp4 = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("mp4"));
        if is_mp4 { Self::Mp4 } else { Self::Isv }
    }
}

/// Tracks to keep in an output: those that `open` gives for an MP4 file, and none for a stream in a file of its own.
///
/// # Errors
/// Errors of `open`.
pub fn tracks_kept_in(
    output: &Path,
    open: impl FnOnce() -> Result<Tracks, StreamError>,
) -> Result<Tracks, StreamError> {
    match Container::of(output) {
        Container::Isv => Ok(Tracks::new()),
        Container::Mp4 => open(),
    }
}

/// Refuses an output that is read, that is there and holds no stream, or that is named like another kind of file.
///
/// # Errors
/// [`OutputError`]: a slip must not cost a capture.
pub fn check_output(inputs: &[&Path], output: &Path) -> Result<(), OutputError> {
    check_not_input(inputs, output)?;
    check_overwriting(output, "is no .isv stream and no MP4 file", |start| match Container::of(output) {
        Container::Isv => start.starts_with(&MAGIC),
        Container::Mp4 => is_mp4(start),
    })?;
    check_stream_name(output)
}

/// A sink for the bytes of a stream.
pub struct StreamOutput<W: Write>(Form<W>);

enum Form<W: Write> {
    Isv(W),
    Mp4(Box<GeometrySink<W>>),
}

impl StreamOutput<Output> {
    /// Opens a file that has its name once it is whole, or standard output. Its name says its kind.
    ///
    /// # Errors
    /// Errors of the file, and what [`Self::new`] refuses.
    pub fn create(path: &Path, tracks: Tracks) -> io::Result<Self> {
        Self::new(Output::create(path)?, Container::of(path), tracks).map_err(io::Error::other)
    }
}

impl<W: Write> StreamOutput<W> {
    /// Writes a stream into a file of a kind.
    ///
    /// # Errors
    /// Tracks beside a stream in a file of its own, or more of them than an MP4 file may have.
    pub fn new(sink: W, container: Container, tracks: Tracks) -> Result<Self, Mp4Error> {
        Ok(Self(match container {
            Container::Isv if tracks.is_empty() => Form::Isv(sink),
            Container::Isv => {
                let what = "an .isv file has no sound and no picture: name the output .mp4";
                return Err(Mp4Error::Unsupported(what.to_owned()));
            }
            Container::Mp4 => Form::Mp4(Box::new(GeometrySink::new(sink, tracks)?)),
        }))
    }

    /// Completes the file, and gives the sink back. The stream was written to its end.
    ///
    /// # Errors
    /// Errors of the tracks and of the sink.
    pub fn finish(self) -> Result<W, Mp4Error> {
        self.finish_with_ends().map(|(sink, _)| sink)
    }

    /// Does as [`Self::finish`], and tells which tracks of an MP4 file are longer or shorter than geometry.
    ///
    /// # Errors
    /// Errors of [`Self::finish`].
    pub fn finish_with_ends(self) -> Result<(W, Vec<OtherEnd>), Mp4Error> {
        match self.0 {
            Form::Isv(sink) => Ok((sink, Vec::new())),
            Form::Mp4(sink) => sink.finish_with_ends(),
        }
    }

    /// Number of packets that an MP4 file has no place for, and that readers may skip.
    #[must_use]
    pub fn left_out(&self) -> usize {
        match &self.0 {
            Form::Isv(_) => 0,
            Form::Mp4(sink) => sink.left_out(),
        }
    }

    /// The sink; `None` after an error in an MP4 file.
    pub fn sink_mut(&mut self) -> Option<&mut W> {
        match &mut self.0 {
            Form::Isv(sink) => Some(sink),
            Form::Mp4(sink) => sink.sink_mut(),
        }
    }
}

impl<W: Write> Write for StreamOutput<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.0 {
            Form::Isv(sink) => sink.write(bytes),
            Form::Mp4(sink) => sink.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.0 {
            Form::Isv(sink) => sink.flush(),
            Form::Mp4(sink) => sink.flush(),
        }
    }
}
