//! Telling files that this library wrote from others.

/// A comment in what is written, where the format has comments.
pub(crate) const COMMENT: &str = "made by isv";

/// What glTF calls the generator.
pub(crate) const GENERATOR: &str = r#""generator":"isv""#;

/// Whether the first bytes of a file, of which a few hundred are enough, say that this library wrote it. XYZ has no place to say so, and
/// for the arrays of a volume `grid.json` does.
#[must_use]
pub fn was_made_by_isv(start: &[u8]) -> bool {
    [COMMENT, GENERATOR].iter().any(|name| start.windows(name.len()).any(|bytes| bytes == name.as_bytes()))
}
