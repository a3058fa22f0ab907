//! The header: which fields a point has, how many points there are, and where they were seen from.

use crate::error::{Flaw, Malformation, quote};
use crate::text;
use glam::DVec3;
use std::str::FromStr;

/// Most fields of a point. Real files stay below fifty; the search for a name is linear in this.
const MAX_FIELDS: usize = 1024;

/// Fields that are read.
pub(super) const READ: [&str; 6] = ["x", "y", "z", "normal_x", "normal_y", "normal_z"];

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    BinaryCompressed,
}

/// Type of a number in a binary body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Signed,
    Unsigned,
    Float,
}

/// A column, or several of one name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: Vec<u8>,
    pub(super) kind: Kind,
    /// Bytes of a value: 1, 2, 4 or 8.
    pub(super) size: usize,
    /// Values a point.
    pub(super) count: usize,
}

impl Field {
    /// Bytes a point.
    pub(super) fn bytes(&self) -> u64 {
        self.size as u64 * self.count as u64
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    /// Number of points as claimed; nothing is allocated by it.
    pub(super) points: u64,
    /// Whether the points are the pixels of an image: more than one row of them.
    pub(super) organised: bool,
    /// The sensor's position, if the file tells it.
    pub(super) viewpoint: Option<DVec3>,
    pub(super) encoding: Encoding,
    /// Start of the body, in bytes from the start of the file.
    pub(super) body_offset: usize,
    /// Lines of the header.
    pub(super) lines: usize,
}

impl Header {
    /// Parses the header at the start of a file. A line ends in LF, CR, or CR LF.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Flaw> {
        let mut entries = Entries::default();
        let (mut offset, mut number, mut carriage_return) = (0, 0, false);
        while let Some(length) = bytes[offset..].iter().position(|b| matches!(b, b'\n' | b'\r')) {
            let line = bytes[offset..offset + length].trim_ascii();
            let end = &bytes[offset + length..];
            number += 1;
            let flaw = |why| Flaw::at_line(number, why);
            let encoding = entries.line(line).map_err(flaw)?;
            // Behind a header of lines that end in CR, an LF is the first byte of the body.
            let end_bytes = match text::line_end(end) {
                Some(2) if encoding.is_some() && carriage_return => 1,
                end_bytes => end_bytes.unwrap_or(1),
            };
            carriage_return = end[end_bytes - 1] == b'\r';
            offset += length + end_bytes;
            if let Some(encoding) = encoding {
                return entries.finish(encoding, offset, number).map_err(flaw);
            }
        }
        Err(Flaw::at_byte(bytes.len(), Malformation::EndsBefore { what: "DATA line" }))
    }

    /// Index of a field of at least one value; one of this very name before one in other case.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        let name = name.as_bytes();
        let find = |same: fn(&[u8], &[u8]) -> bool| {
            self.fields.iter().position(|field| same(&field.name, name) && field.count > 0)
        };
        find(|a, b| a == b).or_else(|| find(<[u8]>::eq_ignore_ascii_case))
    }
}

/// What the lines say, until the last of them.
#[derive(Default)]
struct Entries {
    fields: Option<Vec<Field>>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<DVec3>,
}

impl Entries {
    /// Takes a line; the encoding if it is the last one.
    fn line(&mut self, line: &[u8]) -> Result<Option<Encoding>, Malformation> {
        let not_understood = || Malformation::HeaderLine { text: quote(line) };
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let Some(key) = words.next() else { return Ok(None) };
        let mut first = words.clone();
        match key.to_ascii_uppercase().as_slice() {
            _ if key.starts_with(b"#") => {}
            b"VERSION" => {}
            // The name that versions before 0.6 use.
            b"FIELDS" | b"COLUMNS" => self.name_fields(words)?,
            b"SIZE" => self.each_field(words, not_understood, |field, word| {
                field.size = parse(word).filter(|size| [1, 2, 4, 8].contains(size))?;
                Some(())
            })?,
            b"TYPE" => self.each_field(words, not_understood, |field, word| {
                field.kind = match word {
                    b"I" | b"i" => Kind::Signed,
                    b"U" | b"u" => Kind::Unsigned,
                    b"F" | b"f" => Kind::Float,
                    _ => return None,
                };
                Some(())
            })?,
            b"COUNT" => self.each_field(words, not_understood, |field, word| {
                field.count = parse::<u32>(word)? as usize;
                Some(())
            })?,
            b"WIDTH" => self.width = Some(first.next().and_then(parse).ok_or_else(not_understood)?),
            b"HEIGHT" => self.height = Some(first.next().and_then(parse).ok_or_else(not_understood)?),
            b"POINTS" => self.points = Some(first.next().and_then(parse).ok_or_else(not_understood)?),
            b"VIEWPOINT" => self.viewpoint = viewpoint(words).ok_or_else(not_understood)?,
            b"DATA" => {
                return match first.next().map(<[u8]>::to_ascii_lowercase).as_deref() {
                    Some(b"ascii") => Ok(Some(Encoding::Ascii)),
                    Some(b"binary") => Ok(Some(Encoding::Binary)),
                    Some(b"binary_compressed") => Ok(Some(Encoding::BinaryCompressed)),
                    _ => Err(not_understood()),
                };
            }
            _ => return Err(not_understood()),
        }
        Ok(None)
    }

    fn name_fields<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) -> Result<(), Malformation> {
        let mut fields: Vec<Field> = Vec::new();
        for name in words {
            // Other fields may share a name: `_` is padding.
            let is_read = READ.iter().any(|read| name.eq_ignore_ascii_case(read.as_bytes()));
            if is_read && fields.iter().any(|field| field.name == name) {
                return Err(Malformation::Duplicate { name: quote(name) });
            }
            if fields.len() == MAX_FIELDS {
                return Err(Malformation::HeaderSize { limit: MAX_FIELDS });
            }
            fields.push(Field { name: name.to_vec(), kind: Kind::Float, size: 4, count: 1 });
        }
        self.fields = Some(fields);
        Ok(())
    }

    /// Sets something of every field, one word each.
    fn each_field<'a>(
        &mut self,
        mut words: impl Iterator<Item = &'a [u8]>,
        not_understood: impl Fn() -> Malformation,
        set: impl Fn(&mut Field, &'a [u8]) -> Option<()>,
    ) -> Result<(), Malformation> {
        for field in self.fields.as_mut().ok_or_else(&not_understood)? {
            words.next().and_then(|word| set(field, word)).ok_or_else(&not_understood)?;
        }
        if words.next().is_some() { Err(not_understood()) } else { Ok(()) }
    }

    fn finish(self, encoding: Encoding, body_offset: usize, lines: usize) -> Result<Header, Malformation> {
        let fields = self.fields.ok_or(Malformation::Missing { what: "FIELDS" })?;
        if let Some(field) = fields.iter().find(|field| field.kind == Kind::Float && field.size < 4) {
            return Err(Malformation::PropertyType { text: format!("F{}", field.size) });
        }
        let grid = self.width.map(|width| width.saturating_mul(self.height.unwrap_or(1)));
        let points = self.points.or(grid).ok_or(Malformation::Missing { what: "POINTS" })?;
        if let Some(said) = grid.filter(|grid| *grid != points) {
            return Err(Malformation::PointCount { said, found: points });
        }
        let organised = self.height.is_some_and(|height| height > 1);
        Ok(Header { fields, points, organised, viewpoint: self.viewpoint, encoding, body_offset, lines })
    }
}

/// Place that the points were seen from, by a translation and a quaternion. The ones that change nothing are
/// what programs write that do not know.
fn viewpoint<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<Option<DVec3>> {
    let mut number = || words.next().and_then(parse).filter(|number: &f64| number.is_finite());
    let mut numbers = [0.0; 7];
    for slot in &mut numbers {
        *slot = number()?;
    }
    let [x, y, z, ..] = numbers;
    Some((numbers != [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).then_some(DVec3::new(x, y, z)))
}

pub(super) fn parse<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}
