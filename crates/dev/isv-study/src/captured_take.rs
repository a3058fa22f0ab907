//! A capture as a study reads it: again and again, as meshes.

use crate::{StudyError, Take, TakeError, TakeFrames};
use isv::raw::format::FrameRate;
use isv::raw::io::FrameSequence;
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::encode::CaptureError;
use isv::raw::take::{FrameRange, Input};
use isv::raw::volume::TriangleMesh;
use std::fmt::Write;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Meshes that are there to be read.
pub struct CapturedTake {
    input: PathBuf,
    name: String,
    hints: Hints,
    range: Range<usize>,
    frame_rate: FrameRate,
}

impl CapturedTake {
    /// Counts the frames.
    ///
    /// # Errors
    /// An input that cannot be opened, or whose frames cannot be counted.
    pub fn open(input: &Path, hints: Hints, frames: Option<FrameRange>) -> Result<Self, CaptureError> {
        let capture = open(input, &hints)?;
        capture.counted()?;
        let range = capture.range(frames)?;
        let frame_rate = capture.frame_rate().unwrap_or(hints.frame_rate);
        Ok(Self { input: input.to_owned(), name: capture.name().to_owned(), hints, range, frame_rate })
    }

    /// Numbers in the capture of the frames.
    #[must_use]
    pub fn range(&self) -> &Range<usize> {
        &self.range
    }

    /// One frame, counted from the first of the take.
    ///
    /// # Errors
    /// [`StudyError::Take`].
    pub fn mesh(&self, frame: usize) -> Result<TriangleMesh, StudyError> {
        let at = self.range.start + frame;
        let read = || -> Result<TriangleMesh, TakeError> {
            let mut frames = open(&self.input, &self.hints)?.meshes(at..at + 1)?;
            Ok(frames.next().ok_or_else(|| format!("{}: frame {at} is gone", self.name))??)
        };
        read().map_err(StudyError::Take)
    }

    /// What changes when the files do: their names, sizes and times.
    pub(super) fn fingerprint(&self) -> String {
        let paths = match FrameSequence::open(&self.input) {
            Ok(sequence) => sequence.paths().to_vec(),
            Err(_) => vec![self.input.clone()],
        };
        let Hints { unit, origin_m, animation, .. } = &self.hints;
        let mut text = format!("{:?} {unit:?} {origin_m:?} {:?} {animation:?}", self.range, self.frame_rate);
        for path in paths {
            // Writing to a string does not fail.
            let _ = write!(text, "; {} {}", path.display(), file_state(&path));
        }
        text
    }
}

fn open(input: &Path, hints: &Hints) -> Result<Capture, CaptureError> {
    Capture::open(&Input::from_argument(input), hints)
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
        let frames = open(&self.input, &self.hints)?.meshes(self.range.clone())?;
        Ok(Box::new(frames.map(|mesh| mesh.map_err(Into::into))))
    }
}
