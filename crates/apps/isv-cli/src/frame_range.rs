//! Frame ranges on the command line: `A..B`, from A up to but not including B, counted from 0. Without A from the first, without B to
//! the last.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// A range of at least one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    /// First frame.
    pub(crate) start: usize,
    /// One past the last frame; above `start`. [`Self::OPEN`] if that is the end of what there is.
    pub(crate) end: usize,
}

impl FrameRange {
    /// The end of a range that has none.
    const OPEN: usize = usize::MAX;

    /// How many frames, if it has an end.
    pub(crate) fn count(self) -> Option<usize> {
        (self.end != Self::OPEN).then(|| self.end - self.start)
    }

    /// The frames of the range among those that there are; `name` is the input.
    pub(crate) fn within(self, frames: usize, name: &str) -> anyhow::Result<Range<usize>> {
        let end = if self.end == Self::OPEN { frames } else { self.end };
        if end > frames || self.start >= end {
            anyhow::bail!("{name}: frames {self} asked for, but there are {frames} (0..{frames})");
        }
        Ok(self.start..end)
    }
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
    fn ranges_past_the_end_are_refused_by_name() {
        let range = FrameRange { start: 2, end: 5 };
        assert_eq!(range.within(5, "a.isv").unwrap(), 2..5);
        let sentence = range.within(4, "a.isv").unwrap_err().to_string();
        assert_eq!(sentence, "a.isv: frames 2..5 asked for, but there are 4 (0..4)");
        let open: FrameRange = "2..".parse().unwrap();
        assert_eq!(open.within(5, "a.isv").unwrap(), 2..5);
        let sentence = open.within(2, "a.isv").unwrap_err().to_string();
        assert_eq!(sentence, "a.isv: frames 2.. asked for, but there are 2 (0..2)");
    }
}
