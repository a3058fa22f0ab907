//! Frames from standard input.

use super::kinds::Kind;
use super::{CapturedFrame, Content, Hints, stream_settings};
use crate::encode::{CaptureError, EncodeEvent, FrameError};
use crate::stream::{ByteSource, StreamFrames, piped};
use crate::{Event, FrameRange, Input, Observer};
use isv_format::MAGIC;
use isv_io::{FrameStream, natural_cmp};
use isv_mp4::is_mp4;
use std::io::{self, Read, stdin};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes that tell a stream from files of geometry.
const BEGIN_BYTES: u64 = 8;

/// Finds out what comes by its first bytes: a stream, as such or in an MP4 file, or files of geometry.
pub(super) fn open(hints: &Hints) -> Result<Kind, CaptureError> {
    let name = || Input::StandardInput.name();
    let mut begin = Vec::new();
    let read = stdin().lock().take(BEGIN_BYTES).read_to_end(&mut begin);
    read.map_err(|cause| CaptureError::Io { name: name(), cause })?;
    let is_stream = begin.starts_with(&MAGIC) || is_mp4(&begin);
    let all = io::Cursor::new(begin).chain(stdin());
    Ok(if is_stream {
        let settings = stream_settings(hints, None);
        Kind::PipedStream(Box::new(StreamFrames::from_source(&name(), piped(all), &settings)?))
    } else {
        let frames = FrameStream::new(Box::new(all) as ByteSource, hints.unit);
        let frames = frames.map_err(|cause| CaptureError::Pipe { name: name(), cause: cause.into() })?;
        let frames = frames.with_invalid_points(hints.invalid_points).with_colours(hints.colours);
        let observer = Arc::clone(&hints.observer);
        let (last, number, range) = (None, 0, 0..usize::MAX);
        Kind::PipedGeometry(Box::new(PipedGeometry { frames, last, number, range, observer }))
    })
}

/// Meshes or points as they come.
pub(super) struct PipedGeometry {
    frames: FrameStream<ByteSource>,
    /// The frame before, until one was met that should have come earlier.
    last: Option<PathBuf>,
    /// Number of the next frame.
    number: usize,
    range: Range<usize>,
    observer: Arc<dyn Observer>,
}

impl PipedGeometry {
    /// Passes over what is before a range, and ends behind it.
    pub(super) fn limited_to(mut self, range: Range<usize>) -> Self {
        self.range = range;
        self
    }

    fn advance(&mut self) -> Result<Option<CapturedFrame>, FrameError> {
        let pipe = Input::StandardInput.name();
        while self.number < self.range.end {
            let Some(frame) = self.frames.next() else {
                if self.range.end < usize::MAX {
                    let range = FrameRange { start: self.range.start, end: self.range.end };
                    let checked = range.within(self.number);
                    checked.map_err(|cause| FrameError::Range { name: pipe, cause })?;
                }
                return Ok(None);
            };
            let number = self.number;
            self.number += 1;
            if number >= self.range.start {
                let frame =
                    frame.map_err(|cause| FrameError::Pipe { name: pipe.clone(), cause: cause.into() });
                let (path, geometry) = frame?;
                self.check_order(&path);
                let name = format!("{pipe}: {}", path.display());
                return Ok(Some(CapturedFrame::new(number, name, Content::Geometry(geometry))));
            }
        }
        Ok(None)
    }
}

impl PipedGeometry {
    /// Archives have files as the folder has them, in no order, unless whoever makes them asks for one. Says so once.
    fn check_order(&mut self, path: &Path) {
        let is_first = self.number == self.range.start + 1;
        if is_first || self.last.is_some() {
            let last = self.last.replace(path.to_owned());
            let name = |path: &Path| path.as_os_str().as_encoded_bytes().to_vec();
            if let Some(last) = last
                && natural_cmp(&name(&last), &name(path)).is_gt()
            {
                self.last = None;
                let disorder = EncodeEvent::OutOfOrder { path: path.to_owned(), after: last };
                self.observer.event(&Event::Encode(disorder));
            }
        }
    }
}

impl Iterator for PipedGeometry {
    type Item = Result<CapturedFrame, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().transpose()
    }
}
