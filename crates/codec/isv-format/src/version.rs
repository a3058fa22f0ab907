//! Versions of the format (`docs/spec/format.md`, sections 1 and 9).

/// A version of the format that this build reads and writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FormatVersion {
    /// Geometry alone; every type of packet is known.
    V1,
    /// Adds colour parts to frames, and packets that a reader may skip without knowing their type.
    V2,
}

impl FormatVersion {
    /// All versions, the oldest first.
    pub const ALL: [Self; 2] = [Self::V1, Self::V2];
    /// The newest version.
    pub const NEWEST: Self = Self::V2;

    /// The number that a stream header states.
    #[must_use]
    pub fn number(self) -> u16 {
        match self {
            Self::V1 => 1,
            Self::V2 => 2,
        }
    }

    /// The version with a number; `None` if this build does not know it.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|version| version.number() == number)
    }
}
