//! Which frames of two inputs belong together.

use anyhow::{Result, bail};
use isv::raw::take::FrameRange;
use isv::raw::take::capture::Capture;
use std::ops::Range;

/// Which frames of the two are compared with each other; `frames` are those of the reference, or all.
pub(crate) fn matching_ranges(
    reference: &Capture,
    test: &Capture,
    frames: Option<FrameRange>,
) -> Result<[Range<usize>; 2]> {
    let [in_reference, in_test] = [reference.counted()?, test.counted()?];
    let reference_range = reference.range(frames)?;
    // A test made from the range alone has only its frames; it could not hold the range, unless that begins at 0.
    let test_range = if in_test == reference_range.len() { 0..in_test } else { test.range(frames)? };
    if test_range.len() != reference_range.len() {
        bail!(
            "{} has {in_test} frames but {} has {in_reference}: name the ones to compare with --frames, or the --fps of an animated file",
            test.name(),
            reference.name(),
        );
    }
    Ok([reference_range, test_range])
}
