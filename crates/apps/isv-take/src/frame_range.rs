//! Frame ranges: `A..B`, from A up to but not including B, counted from 0. Without A from the first, without B to
//! the last.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use thiserror::Error;

/// A range of at least one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// First frame.
    pub start: usize,
    /// One past the last frame; above `start`. [`Self::OPEN`] if that is the end of what there is.
    pub end: usize,
}

impl FrameRange {
    /// The end of a range up to the last frame.
    pub const OPEN: usize = usize::MAX;

    /// How many frames, if it has an end.
    #[must_use]
    pub fn count(self) -> Option<usize> {
        (self.end != Self::OPEN).then(|| self.end - self.start)
    }

    /// The frames of the range among those that there are.
    ///
    /// # Errors
    /// [`FrameRangeError`] if some of them are not there.
    pub fn within(self, frames: usize) -> Result<Range<usize>, FrameRangeError> {
        let end = if self.end == Self::OPEN { frames } else { self.end };
        if end > frames || self.start >= end {
            return Err(FrameRangeError { range: self, frames });
        }
        Ok(self.start..end)
    }
}

/// A range of frames some of which are not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("frames {range} asked for, but there are {frames} (0..{frames})")]
pub struct FrameRangeError {
    /// The frames asked for.
    pub range: FrameRange,
    /// Number of frames that there are.
    pub frames: usize,
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.end {
            Self::OPEN => write!(f, "{}..", self.start),
            end => write!(f, "{}..{end}", self.start),
        }
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let bound = |text: &str, none| if text.is_empty() { Some(none) } else { text.parse().ok() };
        let range = text.split_once("..").filter(|bounds| *bounds != ("", ""));
        let range = range
            .and_then(|(start, end)| Some(Self { start: bound(start, 0)?, end: bound(end, Self::OPEN)? }));
        match range {
            None => Err("a frame range is A..B, as in 0..16, or A.. or ..B".to_owned()),
            Some(range) if range.start >= range.end => {
                Err("the range holds no frame: A..B ends before B".to_owned())
            }
            Some(range) => Ok(range),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_parse_and_print() {
        let range: FrameRange = "3..16".parse().unwrap();
        assert_eq!((range.start, range.end, range.count()), (3, 16, Some(13)));
        assert_eq!(range.to_string(), "3..16");
        assert_eq!("..16".parse(), Ok(FrameRange { start: 0, end: 16 }));
        let open: FrameRange = "3..".parse().unwrap();
        assert_eq!((open.count(), open.to_string().as_str()), (None, "3.."));
        for wrong in ["", "3", "..", "3...4", "-1..2", "3..=4", "4..4", "5..4", "..0"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_past_the_end_are_refused() {
        let range = FrameRange { start: 2, end: 5 };
        assert_eq!(range.within(5).unwrap(), 2..5);
        let sentence = range.within(4).unwrap_err().to_string();
        assert_eq!(sentence, "frames 2..5 asked for, but there are 4 (0..4)");
        let open: FrameRange = "2..".parse().unwrap();
        assert_eq!(open.within(5).unwrap(), 2..5);
        let sentence = open.within(2).unwrap_err().to_string();
        assert_eq!(sentence, "frames 2.. asked for, but there are 2 (0..2)");
    }
}
