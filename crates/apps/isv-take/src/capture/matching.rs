//! Pairs of frames of two captures.

use super::Capture;
use crate::FrameRange;
use crate::encode::CaptureError;
use std::ops::Range;

/// Frames of two captures that are compared with each other, of the reference and of the test. `frames` are
/// those of the reference, or all. A test made of the range alone has just those frames.
///
/// # Errors
/// [`CaptureError::Unequal`] for different numbers of frames, and what a capture may fail by.
pub fn matching_ranges(
    reference: &Capture,
    test: &Capture,
    frames: Option<FrameRange>,
) -> Result<[Range<usize>; 2], CaptureError> {
    let [in_reference, in_test] = [reference.counted()?, test.counted()?];
    let reference_range = reference.range(frames)?;
    // A test made from the range alone has only its frames; it could not hold the range, unless that begins at 0.
    let test_range = if in_test == reference_range.len() { 0..in_test } else { test.range(frames)? };
    if test_range.len() != reference_range.len() {
        return Err(CaptureError::Unequal {
            name: test.name().to_owned(),
            frames: in_test,
            reference: reference.name().to_owned(),
            in_reference,
        });
    }
    Ok([reference_range, test_range])
}
