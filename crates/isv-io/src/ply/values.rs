//! The body as a run of numbers, text or binary alike.

use super::header::{Element, Header, Kind, Scalar};
use crate::error::{Malformation, Position, quote};

/// Why no value came.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    /// The file ends here.
    End,
    Malformed(Malformation),
}

impl From<Malformation> for Fault {
    fn from(why: Malformation) -> Self {
        Self::Malformed(why)
    }
}

/// A body that is read row by row, value by value. `f64` holds every value of every PLY type exactly.
pub(super) trait Values {
    fn begin_row(&mut self) -> Result<(), Fault>;
    fn value(&mut self, scalar: Scalar) -> Result<f64, Fault>;
    fn end_row(&mut self) -> Result<(), Fault>;
    /// Where reading stands, for messages.
    fn position(&self) -> Position;
    /// Bytes not read yet.
    fn remaining(&self) -> usize;
    /// Fewest bytes that a value takes.
    fn least_bytes(scalar: Scalar) -> usize;

    /// How many items a list has.
    fn list_length(&mut self, scalar: Scalar) -> Result<u64, Fault> {
        let length = self.value(scalar)? as i64;
        u64::try_from(length).map_err(|_| Malformation::ListLength { length }.into())
    }

    /// How many rows of an element to reserve memory for: what the header claims, but never more than the rest of
    /// the file could hold, lists taken as triangles.
    fn rows_to_reserve(&self, element: &Element) -> usize {
        let fit = self.remaining() / Self::row_bytes(element).max(1);
        usize::try_from(element.count).map_or(fit, |count| count.min(fit))
    }

    /// Fewest bytes that a row takes, lists taken as triangles.
    fn row_bytes(element: &Element) -> usize {
        let bytes = element.properties.iter().map(|property| match property.kind {
            Kind::Scalar(scalar) => Self::least_bytes(scalar),
            Kind::List { length, item } => Self::least_bytes(length) + 3 * Self::least_bytes(item),
        });
        bytes.sum()
    }
}

/// A binary body. Rows follow each other without padding.
pub(super) struct Binary<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Binary<'a> {
    /// Values from byte `at` of a file on.
    pub(super) fn new(bytes: &'a [u8], at: usize, big_endian: bool) -> Self {
        Self { bytes, at, big_endian }
    }

    /// Passes over a row, of which only the lengths of lists are looked at, and says where it ends.
    pub(super) fn skip_row(&mut self, element: &Element) -> Result<usize, Fault> {
        for property in &element.properties {
            let bytes = match property.kind {
                Kind::Scalar(scalar) => scalar.bytes() as u64,
                Kind::List { length, item } => self.list_length(length)? * item.bytes() as u64,
            };
            if bytes > self.remaining() as u64 {
                return Err(Fault::End);
            }
            self.at += bytes as usize;
        }
        Ok(self.at)
    }

    /// The next `N` bytes, lowest first.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let Some(&(mut raw)) = self.bytes[self.at..].first_chunk::<N>() else {
            self.at = self.bytes.len();
            return Err(Fault::End);
        };
        self.at += N;
        if self.big_endian {
            raw.reverse();
        }
        Ok(raw)
    }
}

impl Values for Binary<'_> {
    fn begin_row(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    fn value(&mut self, scalar: Scalar) -> Result<f64, Fault> {
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn end_row(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    fn position(&self) -> Position {
        Position::Byte(self.at as u64)
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn least_bytes(scalar: Scalar) -> usize {
        scalar.bytes()
    }
}

/// A text body: one row a line, values between white space; empty lines mean nothing.
pub(super) struct Ascii<'a> {
    /// What follows the current line.
    rest: &'a [u8],
    /// What is left of the current line.
    line: &'a [u8],
    /// Whether the current line is whole; the last one of a cut file is not.
    terminated: bool,
    /// Whether no more bytes will come, so that the last line needs no end.
    ended: bool,
    line_number: usize,
}

impl<'a> Ascii<'a> {
    pub(super) fn new(bytes: &'a [u8], header: &Header, ended: bool) -> Self {
        let rest = &bytes[header.body_offset..];
        Self { rest, line: &[], terminated: true, ended, line_number: header.lines }
    }
}

impl Values for Ascii<'_> {
    fn begin_row(&mut self) -> Result<(), Fault> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|b| *b == b'\n');
            let (line, rest) = self.rest.split_at(end.map_or(self.rest.len(), |end| end + 1));
            if end.is_none() && !self.ended {
                break;
            }
            (self.line, self.rest, self.terminated) = (line.trim_ascii(), rest, end.is_some());
            self.line_number += 1;
            if !self.line.is_empty() {
                return Ok(());
            }
        }
        Err(Fault::End)
    }

    fn value(&mut self, scalar: Scalar) -> Result<f64, Fault> {
        if self.line.is_empty() {
            return Err(if self.terminated {
                Malformation::LineLength { too_many: false }.into()
            } else {
                Fault::End
            });
        }
        let end = self.line.iter().position(u8::is_ascii_whitespace).unwrap_or(self.line.len());
        let (word, line) = self.line.split_at(end);
        self.line = line.trim_ascii_start();
        let number = str::from_utf8(word).ok().and_then(|text| match scalar.integer_range() {
            Some(range) => text.parse().ok().filter(|v| range.contains(v)).map(|v: i64| v as f64),
            None => text.parse().ok(),
        });
        number.ok_or_else(|| Malformation::Number { text: quote(word) }.into())
    }

    fn end_row(&mut self) -> Result<(), Fault> {
        if self.line.is_empty() { Ok(()) } else { Err(Malformation::LineLength { too_many: true }.into()) }
    }

    fn position(&self) -> Position {
        Position::Line(self.line_number as u64)
    }

    fn remaining(&self) -> usize {
        self.rest.len()
    }

    fn least_bytes(_: Scalar) -> usize {
        "0 ".len()
    }
}
