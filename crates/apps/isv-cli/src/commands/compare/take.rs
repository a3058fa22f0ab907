//! A capture as a study reads it: again and again, as meshes.

use crate::capture;
use anyhow::{Context, Result};
use isv::raw::format::FrameRate;
use isv::raw::io::FrameSequence;
use isv::raw::take::FrameRange;
use isv::raw::take::capture::Hints;
use isv::raw::volume::TriangleMesh;
use isv_study::{Take, TakeError, TakeFrames};
use std::fmt::Write;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Meshes that are there to be read.
pub(super) struct CapturedTake {
    input: PathBuf,
    name: String,
    hints: Hints,
    range: Range<usize>,
    frame_rate: FrameRate,
}

impl CapturedTake {
    /// Counts the frames.
    pub(super) fn open(input: &Path, hints: Hints, frames: Option<FrameRange>) -> Result<Self> {
        let capture = capture::open(input, &hints)?;
        capture.counted()?;
        let range = capture.range(frames)?;
        let frame_rate = capture.frame_rate().unwrap_or(hints.frame_rate);
        Ok(Self { input: input.to_owned(), name: capture.name().to_owned(), hints, range, frame_rate })
    }

    /// Numbers in the capture of the frames.
    pub(super) fn range(&self) -> &Range<usize> {
        &self.range
    }

    /// One frame, counted from the first of the take.
    pub(super) fn mesh(&self, frame: usize) -> Result<TriangleMesh> {
        let at = self.range.start + frame;
        let mut frames = capture::open(&self.input, &self.hints)?.meshes(at..at + 1)?;
        Ok(frames.next().with_context(|| format!("{}: frame {at} is gone", self.name))??)
    }

    /// What changes when the files do: their names, sizes and times.
    pub(super) fn fingerprint(&self) -> String {
        let paths = match FrameSequence::open(&self.input) {
            Ok(sequence) => sequence.paths().to_vec(),
            Err(_) => vec![self.input.clone()],
        };
        let mut text =
            format!("{:?} {:?} {:?} {:?}", self.range, self.hints.unit, self.hints.origin_m, self.frame_rate);
        for path in paths {
            // Writing to a string does not fail.
            let _ = write!(text, "; {} {}", path.display(), file_state(&path));
        }
        text
    }
}

/// Size and time of change of a file; empty if that cannot be told.
pub(super) fn file_state(path: &Path) -> String {
    let state = |path: &Path| {
        let data = fs::metadata(path).ok()?;
        let changed = data.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        Some(format!("{} {}", data.len(), changed.as_nanos()))
    };
    state(path).unwrap_or_default()
}

impl Take for CapturedTake {
    fn name(&self) -> &str {
        &self.name
    }

    fn frames(&self) -> usize {
        self.range.len()
    }

    fn frame_rate(&self) -> FrameRate {
        self.frame_rate
    }

    fn meshes(&self) -> Result<TakeFrames<'_>, TakeError> {
        let frames = capture::open(&self.input, &self.hints)?.meshes(self.range.clone())?;
        Ok(Box::new(frames.map(|mesh| mesh.map_err(Into::into))))
    }
}
