//! Ends of tracks beside geometry: which of them end much earlier or later.

use crate::TrackKind;

/// Least difference (s) that is worth a word: packets of sound are longer than what they end with.
const TOLERANCE_S: f64 = 0.1;

/// Whether a track that ends so much earlier or later than geometry (s) differs from it, whose frames are shown for `frame_s`.
#[must_use]
pub fn is_other_end(difference_s: f64, frame_s: f64) -> bool {
    difference_s.abs() > frame_s.max(TOLERANCE_S)
}

/// A track that ends earlier or later than the geometry of its file.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OtherEnd {
    /// Number of the track in the file, from 1; geometry has 1.
    pub track: usize,
    /// What it holds.
    pub kind: TrackKind,
    /// Time (s) at which its last sample ends.
    pub end_s: f64,
    /// Time (s) at which the last frame of geometry ends.
    pub geometry_s: f64,
}

impl OtherEnd {
    /// Time (s) by which the track is longer than geometry; below 0 if it is shorter.
    #[must_use]
    pub fn longer_s(&self) -> f64 {
        self.end_s - self.geometry_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_another_beyond_a_frame_and_a_tenth_of_a_second() {
        for (difference_s, frame_s, expected) in [
            (0.0, 1.0 / 30.0, false),
            (0.09, 1.0 / 30.0, false),
            (0.11, 1.0 / 30.0, true),
            (-0.11, 1.0 / 30.0, true),
            (0.4, 0.5, false),
            (-0.6, 0.5, true),
        ] {
            assert_eq!(
                is_other_end(difference_s, frame_s),
                expected,
                "{difference_s} s, frames of {frame_s} s"
            );
        }
    }
}
