//! The body as a run of numbers, text or binary alike.

use super::header::{Element, Header, Kind, Scalar};
use crate::error::{Malformation, Position, quote};
use crate::text::{Words, line_end, parse_float, parse_word};

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

/// A body that is read row by row, value by value. `f64` holds every value of up to 32 bits, and of `double`, exactly.
pub(super) trait Values {
    fn begin_row(&mut self) -> Result<(), Fault>;
    fn value(&mut self, scalar: Scalar) -> Result<f64, Fault>;
    /// Passes over a value, whatever it is.
    fn skip(&mut self, scalar: Scalar) -> Result<(), Fault>;
    fn end_row(&mut self) -> Result<(), Fault>;
    /// Ends the body after its last row.
    fn finish(&mut self) -> Result<(), Malformation>;
    /// Position of reading, for messages.
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

    /// Number of rows of an element to reserve memory for. It is what the header claims, but never more than
    /// the rest of the file could hold, lists taken as triangles.
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
            Scalar::I64 => i64::from_le_bytes(self.take()?) as f64,
            Scalar::U64 => u64::from_le_bytes(self.take()?) as f64,
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn skip(&mut self, scalar: Scalar) -> Result<(), Fault> {
        self.value(scalar).map(drop)
    }

    fn end_row(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Malformation> {
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

/// A text body: values between white space, where a row usually is a line but need not be.
///
/// Rows that disagree with the header are told from rows that are spread over lines at the end of the file.
pub(super) struct Ascii<'a> {
    words: Words<'a>,
    /// Whether no more bytes will come.
    ended: bool,
    /// Line that the current row starts on.
    row_start: usize,
    /// Whether the current row has had a value.
    row_begun: bool,
    /// First line on which a row ended and another began.
    shared_line: Option<usize>,
    /// First line of a row that takes several.
    spread_row: Option<usize>,
    /// Whether a row was a line.
    row_is_line: bool,
    /// Line of a fault that is not where reading stands.
    fault_line: Option<usize>,
}

impl<'a> Ascii<'a> {
    pub(super) fn new(bytes: &'a [u8], header: &Header, ended: bool) -> Self {
        Self {
            words: Words::new(&bytes[header.body_offset..], header.lines + 1, false),
            ended,
            row_start: 0,
            row_begun: false,
            shared_line: None,
            spread_row: None,
            row_is_line: false,
            fault_line: None,
        }
    }

    /// What is wrong with the first row that is not a line, where others are: it has too few values, or too many.
    fn misfit(&mut self) -> Option<Malformation> {
        let too_few = self.spread_row.filter(|_| self.row_is_line);
        let too_many = self.shared_line.is_some_and(|line| too_few.is_none_or(|other| line <= other));
        self.fault_line = if too_many { self.shared_line } else { too_few };
        self.fault_line.map(|_| Malformation::LineLength { too_many })
    }

    fn word(&mut self) -> Result<&'a [u8], Fault> {
        let Some(word) = self.words.next() else {
            return Err(self.misfit().map_or(Fault::End, Fault::Malformed));
        };
        if !self.row_begun {
            (self.row_begun, self.row_start) = (true, self.words.line());
        }
        Ok(word)
    }
}

impl Values for Ascii<'_> {
    fn begin_row(&mut self) -> Result<(), Fault> {
        self.row_begun = false;
        Ok(())
    }

    fn value(&mut self, scalar: Scalar) -> Result<f64, Fault> {
        let word = self.word()?;
        let number = match scalar.integer_range() {
            Some(range) => parse_word(word).filter(|v| range.contains(v)).map(|v: i128| v as f64),
            None => parse_float(word),
        };
        number.ok_or_else(|| Malformation::Number { text: quote(word) }.into())
    }

    fn skip(&mut self, _: Scalar) -> Result<(), Fault> {
        self.word().map(drop)
    }

    fn end_row(&mut self) -> Result<(), Fault> {
        let line = self.words.line();
        if self.words.line_goes_on() {
            self.shared_line.get_or_insert(line);
        }
        match line == self.row_start {
            true => self.row_is_line = true,
            false => _ = self.spread_row.get_or_insert(self.row_start),
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Malformation> {
        let goes_on = self.words.line_goes_on();
        let rest = self.words.rest().trim_ascii_start();
        // Values left over, where rows share lines: rows have more values than the header says. In a pipe nobody knows, so there each row
        // must end with its line.
        let left_over = !self.ended || !rest.is_empty();
        match self.misfit().filter(|_| self.shared_line.is_some() && (goes_on || left_over)) {
            Some(why) => Err(why),
            None => Ok(()),
        }
    }

    fn position(&self) -> Position {
        Position::Line(self.fault_line.unwrap_or(self.words.line()) as u64)
    }

    /// Bytes behind the line of the last value, once all were read.
    fn remaining(&self) -> usize {
        let rest = self.words.rest();
        let blanks = rest.iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
        line_end(&rest[blanks..]).map_or(rest.len(), |end| rest.len() - blanks - end)
    }

    fn least_bytes(_: Scalar) -> usize {
        "0 ".len()
    }
}
