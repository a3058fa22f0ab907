//! Words of text formats: runs of bytes between white space.

use crate::error::{Malformation, quote};
use std::str::FromStr;

/// The words of a line.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// The number that a word says, if it is one that fits.
pub(crate) fn parse_word<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// The next three words as coordinates.
pub(crate) fn coordinates<'a>(
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<glam::DVec3, Malformation> {
    let mut coordinate = || {
        let word = words.next().ok_or(Malformation::LineLength { too_many: false })?;
        parse_word(word).ok_or_else(|| Malformation::Number { text: quote(word) })
    };
    Ok(glam::DVec3::new(coordinate()?, coordinate()?, coordinate()?))
}
