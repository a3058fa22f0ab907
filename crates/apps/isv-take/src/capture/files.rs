//! Frames from files.

use super::{CapturedFrame, Content, Hints};
use crate::encode::FrameError;
use isv_format::FrameRate;
use isv_io::{FrameSequence, FrameTimes, ReadOptions, ScaleCheck, acquisition_time_s, read_geometry_as};
use std::path::{Path, PathBuf};
use std::vec::IntoIter;

/// Reads the files of a sequence in order.
pub(super) struct FileFrames {
    paths: IntoIter<PathBuf>,
    /// Number of the next frame.
    number: usize,
    options: ReadOptions,
    /// When the frames that are left were taken, in nanoseconds, where their names say.
    times_ns: Option<IntoIter<u64>>,
    /// None if frames may differ in scale.
    scale: Option<ScaleCheck>,
}

impl FileFrames {
    /// The files of `sequence`, whose first is frame `origin`, from frame `first` on.
    pub(super) fn new(sequence: &FrameSequence, origin: usize, first: usize, hints: &Hints) -> Self {
        let before = first - origin;
        let paths = sequence.paths()[before..].to_vec();
        let times_ns =
            named_ns(sequence, hints.frame_rate).map(|mut times| times.split_off(before).into_iter());
        let scale = (!hints.mixed_scales).then(ScaleCheck::new);
        Self { paths: paths.into_iter(), number: first, options: hints.read_options(), times_ns, scale }
    }

    fn read(&mut self, number: usize, path: &Path) -> Result<CapturedFrame, FrameError> {
        // Names say when each frame was taken, whether it can be read or not.
        let named_ns = self.times_ns.as_mut().and_then(Iterator::next);
        let geometry = read_geometry_as(path, &self.options)?;
        if let Some(scale) = &mut self.scale {
            scale.check(path, &geometry)?;
        }
        let (name, content) = (path.display().to_string(), Content::Geometry(geometry));
        let timestamp_ns = named_ns.or_else(|| scanned_ns(path));
        Ok(CapturedFrame { timestamp_ns, ..CapturedFrame::new(number, name, content) })
    }
}

/// When the files of a sequence were taken, counted from the first (ns), where their names say. `rate`: of frames that are numbered.
pub(super) fn named_ns(sequence: &FrameSequence, rate: FrameRate) -> Option<Vec<u64>> {
    match sequence.times() {
        FrameTimes::Even => None,
        FrameTimes::Numbered(places) => Some(places.iter().map(|place| rate.timestamp_ns(*place)).collect()),
        FrameTimes::Nanoseconds(times) => Some(times.clone()),
    }
}

/// When a file says that it was scanned (ns).
pub(super) fn scanned_ns(path: &Path) -> Option<u64> {
    acquisition_time_s(path).map(|seconds| (seconds.max(0.0) * 1e9).round() as u64)
}

impl Iterator for FileFrames {
    type Item = Result<CapturedFrame, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        let number = self.number;
        self.number += 1;
        Some(self.read(number, &path))
    }
}
