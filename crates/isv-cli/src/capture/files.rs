//! Frames from files.

use super::{CapturedFrame, Content};
use anyhow::Result;
use isv::io::{FrameSequence, ScaleCheck, Unit, read_geometry};
use std::path::{Path, PathBuf};
use std::vec::IntoIter;

/// Reads the files of a sequence in order.
pub(super) struct FileFrames {
    paths: IntoIter<PathBuf>,
    /// Number of the next frame.
    number: usize,
    unit: Unit,
    scale: ScaleCheck,
}

impl FileFrames {
    /// The files of `sequence`, the first of which is frame `first`.
    pub(super) fn new(sequence: &FrameSequence, first: usize, unit: Unit) -> Self {
        let paths = sequence.paths().to_vec().into_iter();
        Self { paths, number: first, unit, scale: ScaleCheck::new() }
    }

    fn read(&mut self, number: usize, path: &Path) -> Result<CapturedFrame> {
        let geometry = read_geometry(path, self.unit)?;
        let diagonal_m = geometry.bounds().map_or(0.0, |(low, high)| low.distance(high));
        self.scale.check(path, diagonal_m)?;
        Ok(CapturedFrame {
            number,
            name: path.display().to_string(),
            timestamp_ns: None,
            content: Content::Geometry(geometry),
        })
    }
}

impl Iterator for FileFrames {
    type Item = Result<CapturedFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        let number = self.number;
        self.number += 1;
        Some(self.read(number, &path))
    }
}
