//! Text as programs write it: any byte order mark, UTF-8 or UTF-16, and lines that end in LF, CR or CR LF.
//!
//! Every reader of text opens it here, so that all of them accept the same.

use crate::error::{Malformation, quote};
use glam::DVec3;
use std::borrow::Cow;
use std::str::FromStr;

/// The byte order mark of UTF-8.
pub(crate) const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";
const UTF16_LE_MARK: &[u8] = b"\xff\xfe";
const UTF16_BE_MARK: &[u8] = b"\xfe\xff";

/// Drops a byte order mark and turns UTF-16 into UTF-8.
///
/// UTF-16 without a mark is known by its first two characters, if they are ASCII. Borrows wherever nothing but the mark changes;
/// a copy takes at most 3/2 of the bytes given.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, [u8]> {
    if let Some(rest) = bytes.strip_prefix(UTF8_MARK) {
        return Cow::Borrowed(rest);
    }
    if let Some(rest) = bytes.strip_prefix(UTF16_LE_MARK) {
        return Cow::Owned(from_utf16(rest, u16::from_le_bytes));
    }
    if let Some(rest) = bytes.strip_prefix(UTF16_BE_MARK) {
        return Cow::Owned(from_utf16(rest, u16::from_be_bytes));
    }
    let is_text = |b: u8| b.is_ascii_graphic() || b.is_ascii_whitespace();
    match *bytes {
        [a, 0, b, 0, ..] if is_text(a) && is_text(b) => Cow::Owned(from_utf16(bytes, u16::from_le_bytes)),
        [0, a, 0, b, ..] if is_text(a) && is_text(b) => Cow::Owned(from_utf16(bytes, u16::from_be_bytes)),
        _ => Cow::Borrowed(bytes),
    }
}

/// UTF-8 of UTF-16 units; what is no character becomes U+FFFD, an odd last byte is dropped.
fn from_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Vec<u8> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let mut text = String::with_capacity(bytes.len() / 2);
    text.extend(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
    text.into_bytes()
}

/// Bytes of the line end that a text starts with: LF, CR, or CR LF; `None` if it starts with none.
pub(crate) fn line_end(text: &[u8]) -> Option<usize> {
    match text {
        [b'\r', b'\n', ..] => Some(2),
        [b'\r' | b'\n', ..] => Some(1),
        _ => None,
    }
}

/// The lines of a text without their ends, which may differ from line to line. As of `split`, the last is empty if the text ends with
/// a line end.
#[derive(Clone)]
pub(crate) struct Lines<'a> {
    rest: Option<&'a [u8]>,
}

/// Splits a text into its lines.
pub(crate) fn lines(text: &[u8]) -> Lines<'_> {
    Lines { rest: Some(text) }
}

impl<'a> Lines<'a> {
    /// What follows the lines given so far.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest.unwrap_or_default()
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let text = self.rest?;
        let Some(end) = text.iter().position(|b| matches!(b, b'\n' | b'\r')) else {
            self.rest = None;
            return Some(text);
        };
        let (line, rest) = text.split_at(end);
        self.rest = Some(&rest[line_end(rest).unwrap_or_default()..]);
        Some(line)
    }
}

/// A line without its comment, which starts with `#`. In a number such as `1.#IND` it starts none.
pub(crate) fn without_comment(line: &[u8]) -> &[u8] {
    let starts = |at: &usize| line[*at] == b'#' && !line[..*at].ends_with(b"1.");
    &line[..(0..line.len()).find(starts).unwrap_or(line.len())]
}

/// The words of a line, between white space.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// The first word of a line and what follows it, without the blanks around; `None` for an empty line.
pub(crate) fn first_word(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let line = line.trim_ascii();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    let (word, rest) = line.split_at(end);
    (!word.is_empty()).then_some((word, rest.trim_ascii()))
}

/// The words of a text and the lines that they are on, where line ends are white space like any other.
#[derive(Clone)]
pub(crate) struct Words<'a> {
    rest: &'a [u8],
    line: usize,
    /// Whether `#` starts a comment, up to the end of its line.
    comments: bool,
}

impl<'a> Words<'a> {
    /// Words from a text that starts on a line, counted from 1; `comments`: whether `#` starts one.
    pub(crate) fn new(text: &'a [u8], line: usize, comments: bool) -> Self {
        Self { rest: text, line, comments }
    }

    /// Line of the last word given, from 1.
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// What follows the last word given.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Whether another word follows on the same line.
    pub(crate) fn line_goes_on(&self) -> bool {
        let blank = |b: &&u8| matches!(b, b' ' | b'\t' | 0x0b | b'\x0c');
        match self.rest.iter().find(|b| !blank(b)) {
            None | Some(b'\n' | b'\r') => false,
            Some(b'#') => !self.comments,
            Some(_) => true,
        }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            match *self.rest {
                [] => return None,
                [b'\n' | b'\r', ..] => {
                    self.rest = &self.rest[line_end(self.rest).unwrap_or(1)..];
                    self.line += 1;
                }
                [b'#', ..] if self.comments => {
                    let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
                    self.rest = &self.rest[end.unwrap_or(self.rest.len())..];
                }
                [b, ref rest @ ..] if is_space(b) => self.rest = rest,
                _ => break,
            }
        }
        let end = self.rest.iter().position(|b| is_space(*b)).unwrap_or(self.rest.len());
        let end = if self.comments { without_comment(&self.rest[..end]).len() } else { end };
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        Some(word)
    }
}

/// White space, vertical tabs included.
pub(crate) fn is_space(b: u8) -> bool {
    b.is_ascii_whitespace() || b == 0x0b
}

/// The number that a word says, if it is one that fits.
pub(crate) fn parse_word<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// The number that a word says. "Not a number" and infinity may be written as C libraries print them:
/// `-nan(ind)`, `nan(snan)`, `1.#QNAN`, `-1.#IND`, `1.#INF`.
pub(crate) fn parse_float(word: &[u8]) -> Option<f64> {
    parse_word(word).or_else(|| {
        let word = word.to_ascii_lowercase();
        let (sign, digits) = match word.as_slice() {
            [b'-', digits @ ..] => (-1.0, digits),
            [b'+', digits @ ..] => (1.0, digits),
            digits => (1.0, digits),
        };
        let starts = |prefix: &[u8]| digits.starts_with(prefix);
        if starts(b"nan(") || digits == b"nanq" || digits == b"nans" {
            return Some(f64::NAN);
        }
        if starts(b"1.#qnan") || starts(b"1.#snan") || starts(b"1.#nan") || starts(b"1.#ind") {
            return Some(f64::NAN);
        }
        starts(b"1.#inf").then_some(sign * f64::INFINITY)
    })
}

/// A decimal number in billionths, rounded to the nearest: `1305031102.175304`, `-0.5`, `1e-1`; `None` if it is no number or beyond
/// 1e20.
pub(crate) fn parse_billionths(text: &str) -> Option<i128> {
    // More digits would leave the range of `i128`.
    const MOST_DIGITS: usize = 27;
    const MOST: i128 = 10i128.pow(29);
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, exponent.parse::<i32>().ok()?.clamp(-1_000, 1_000)),
        None => (text, 0),
    };
    let (sign, digits) = match digits.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, digits.strip_prefix('+').unwrap_or(digits)),
    };
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && decimals.is_empty() {
        return None;
    }
    let (mut mantissa, mut counted, mut scale) = (0i128, 0, exponent + 9);
    for (is_decimal, digit) in whole.bytes().map(|b| (false, b)).chain(decimals.bytes().map(|b| (true, b))) {
        let digit = digit.is_ascii_digit().then(|| i128::from(digit - b'0'))?;
        if counted < MOST_DIGITS {
            mantissa = mantissa * 10 + digit;
            counted += usize::from(mantissa > 0);
            scale -= i32::from(is_decimal);
        } else {
            scale = scale.saturating_add(i32::from(!is_decimal));
        }
    }
    let stamp = match (scale, 10i128.checked_pow(scale.unsigned_abs())) {
        _ if mantissa == 0 => 0,
        (0.., power) => mantissa.checked_mul(power?)?,
        (_, Some(power)) => (mantissa + power / 2) / power,
        (_, None) => 0,
    };
    (stamp <= MOST).then_some(sign * stamp)
}

/// The next three words as coordinates.
pub(crate) fn coordinates<'a>(words: &mut impl Iterator<Item = &'a [u8]>) -> Result<DVec3, Malformation> {
    let mut coordinate = || {
        let word = words.next().ok_or(Malformation::LineLength { too_many: false })?;
        parse_float(word).ok_or_else(|| Malformation::Number { text: quote(word) })
    };
    Ok(DVec3::new(coordinate()?, coordinate()?, coordinate()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_dropped_and_utf_16_becomes_utf_8() {
        let text = "v 0 é 1\r\n𝄞";
        let wide = |unit: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(unit).collect::<Vec<u8>>();
        let (le, be) = (wide(u16::to_le_bytes), wide(u16::to_be_bytes));
        for bytes in [
            text.as_bytes().to_vec(),
            [UTF8_MARK, text.as_bytes()].concat(),
            [UTF16_LE_MARK, &le].concat(),
            [UTF16_BE_MARK, &be].concat(),
            [&be[..], &[0]].concat(),
            le,
            be,
        ] {
            assert_eq!(decode(&bytes), text.as_bytes());
        }
        assert_eq!(decode(b"\xff"), &b"\xff"[..]);
        assert_eq!(decode(UTF8_MARK), &b""[..]);
        assert_eq!(decode(b"ply\n\0\0"), &b"ply\n\0\0"[..]);
    }

    #[test]
    fn a_line_ends_in_any_way() {
        let split: Vec<_> = lines(b"a\nb\r\nc\rd\n\re\r").collect();
        assert_eq!(split, [&b"a"[..], b"b", b"c", b"d", b"", b"e", b""]);
        assert_eq!(lines(b"").count(), 1);
    }

    #[test]
    fn words_know_their_lines() {
        let mut words = Words::new(b" a b#c\r\n\rd\x0be # f\n", 1, true);
        let mut found = Vec::new();
        while let Some(word) = words.next() {
            found.push((word.to_vec(), words.line(), words.line_goes_on()));
        }
        let word = |text: &str, line, goes_on| (text.as_bytes().to_vec(), line, goes_on);
        assert_eq!(found, [word("a", 1, true), word("b", 1, false), word("d", 3, true), word("e", 3, false)]);
    }

    #[test]
    fn not_a_number_has_many_spellings() {
        for text in ["nan", "-NaN", "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND", "-1.#IND00", "NAN(0x8)"] {
            assert!(parse_float(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        for (text, value) in [
            ("1.#INF", f64::INFINITY),
            ("-1.#INF00", f64::NEG_INFINITY),
            ("-inf", f64::NEG_INFINITY),
            ("1e3", 1e3),
        ] {
            assert_eq!(parse_float(text.as_bytes()), Some(value), "{text}");
        }
        for text in ["", "nano", "1.#", "#", "-", "1,5", "x"] {
            assert_eq!(parse_float(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn decimals_are_exact_to_the_billionth() {
        const NANO: i128 = 1_000_000_000;
        for (text, expected) in [
            ("0", 0),
            ("-0.5", -500_000_000),
            ("+2.", 2 * NANO),
            (".25", 250_000_000),
            ("1305031102.175304", 1_305_031_102_175_304_000),
            ("1305031102175304123", 1_305_031_102_175_304_123 * NANO),
            ("1.305031102175304123e+09", 1_305_031_102_175_304_123),
            ("1.305031102175304123456789e9", 1_305_031_102_175_304_123),
            ("0.0000000005", 1),
            ("0.00000000049", 0),
            ("1e-400", 0),
            ("0e999", 0),
            ("00000000000000000000000000000000000000001.5", 1_500_000_000),
            ("1.00000000000000000000000000000000000000009", NANO),
            ("1e20", 100_000_000_000_000_000_000 * NANO),
        ] {
            assert_eq!(parse_billionths(text), Some(expected), "{text}");
        }
        for text in [
            "", ".", "-", "e5", "nan", "inf", "1,5", "1e", "1e2.5", "0x10", "1_0", "--1", "2e20", "1e999",
            "٣",
        ] {
            assert_eq!(parse_billionths(text), None, "{text}");
        }
    }
}
