//! Frames from standard input.

use super::kinds::Kind;
use super::{CapturedFrame, Content, Hints};
use crate::backend::BackendArgs;
use crate::frame_range::FrameRange;
use crate::output::say;
use crate::stream::StreamFrames;
use anyhow::{Context, Result};
use isv::decode::Lod;
use isv::format::MAGIC;
use isv::io::{FrameStream, natural_cmp};
use std::io::{BufRead, Stdin, stdin};
use std::ops::Range;
use std::path::{Path, PathBuf};

const NAME: &str = "standard input";

/// Finds out what comes by its first bytes: an `.isv` stream, or files of geometry.
pub(super) fn open(hints: &Hints) -> Result<Kind> {
    let is_stream = stdin().lock().fill_buf().context(NAME)?.starts_with(&MAGIC);
    Ok(if is_stream {
        Kind::PipedStream(Box::new(StreamFrames::open(Path::new("-"), None, Lod::Full, BackendArgs::CPU)?))
    } else {
        let frames = FrameStream::new(stdin(), hints.unit).context(NAME)?;
        let frames = frames.with_invalid_points(hints.invalid_points);
        Kind::PipedGeometry(Box::new(PipedGeometry { frames, last: None, number: 0, range: 0..usize::MAX }))
    })
}

/// Meshes or points as they come.
pub(super) struct PipedGeometry {
    frames: FrameStream<Stdin>,
    /// The frame before, until one was met that should have come earlier.
    last: Option<PathBuf>,
    /// Number of the next frame.
    number: usize,
    range: Range<usize>,
}

impl PipedGeometry {
    /// Passes over what is before a range, and ends behind it.
    pub(super) fn limited_to(mut self, range: Range<usize>) -> Self {
        self.range = range;
        self
    }

    fn advance(&mut self) -> Result<Option<CapturedFrame>> {
        while self.number < self.range.end {
            let Some(frame) = self.frames.next() else {
                if self.range.end < usize::MAX {
                    FrameRange { start: self.range.start, end: self.range.end }.within(self.number, NAME)?;
                }
                return Ok(None);
            };
            let number = self.number;
            self.number += 1;
            if number >= self.range.start {
                let (path, geometry) = frame.context(NAME)?;
                self.check_order(&path);
                let name = format!("{NAME}: {}", path.display());
                return Ok(Some(CapturedFrame {
                    number,
                    name,
                    timestamp_ns: None,
                    content: Content::Geometry(geometry),
                }));
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
                say(format_args!(
                    "{NAME}: {} comes after {}: frames are taken as they come, not by name (tar has --sort=name)",
                    path.display(),
                    last.display()
                ));
            }
        }
    }
}

impl Iterator for PipedGeometry {
    type Item = Result<CapturedFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().transpose()
    }
}
