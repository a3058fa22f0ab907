//! Frame ranges on the command line: `A..B`, from A up to but not including B, counted from 0.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// A range of at least one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    /// First frame.
    pub(crate) start: usize,
    /// One past the last frame; above `start`.
    pub(crate) end: usize,
}

impl FrameRange {
    /// How many frames.
    pub(crate) fn count(self) -> usize {
        self.end - self.start
    }

    /// Checks the range against what there is; `name` is the input.
    pub(crate) fn within(self, frames: usize, name: &str) -> anyhow::Result<Range<usize>> {
        if self.end > frames {
            anyhow::bail!("{name}: frames {self} asked for, but there are {frames} (0..{frames})");
        }
        Ok(self.start..self.end)
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.start, self.end)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let range = text
            .split_once("..")
            .and_then(|(start, end)| Some(Self { start: start.parse().ok()?, end: end.parse().ok()? }));
        match range {
            None => Err("a frame range is A..B, as in 0..16".to_owned()),
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
        assert_eq!((range.start, range.end, range.count()), (3, 16, 13));
        assert_eq!(range.to_string(), "3..16");
        for wrong in ["", "3", "3..", "..3", "3...4", "-1..2", "3..=4", "4..4", "5..4"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_past_the_end_are_refused_by_name() {
        let range = FrameRange { start: 2, end: 5 };
        assert_eq!(range.within(5, "a.isv").unwrap(), 2..5);
        let sentence = range.within(4, "a.isv").unwrap_err().to_string();
        assert_eq!(sentence, "a.isv: frames 2..5 asked for, but there are 4 (0..4)");
    }
}
