//! Why bytes are refused, in one word.

use std::fmt;

/// The class of a refusal: what a decoder under test prints, and what `conformance/refused.txt` expects
/// (`conformance/README.md`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RefusalClass {
    /// The bytes do not begin with the magic.
    Foreign,
    /// A version, a profile or a type of packet that the document gives no meaning to.
    Unsupported,
    /// A checksum does not match, or the hash of a decoded volume does not.
    Damaged,
    /// The bytes of the stream end inside a structure.
    Cut,
    /// Anything else that breaks the format.
    Malformed,
    /// A frame whose reference is not there.
    Missing,
    /// More payload, slices or blocks than the document, or the decoder, allows.
    Limit,
}

impl RefusalClass {
    /// All classes.
    pub const ALL: [Self; 7] = [
        Self::Foreign,
        Self::Unsupported,
        Self::Damaged,
        Self::Cut,
        Self::Malformed,
        Self::Missing,
        Self::Limit,
    ];

    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Foreign => "foreign",
            Self::Unsupported => "unsupported",
            Self::Damaged => "damaged",
            Self::Cut => "cut",
            Self::Malformed => "malformed",
            Self::Missing => "missing",
            Self::Limit => "limit",
        }
    }
}

impl fmt::Display for RefusalClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
