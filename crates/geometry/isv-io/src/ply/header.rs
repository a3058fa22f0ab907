//! The header: what the body holds, and in which encoding.

use crate::error::{Flaw, Malformation, quote};
use crate::obj::mtl;
use crate::text::first_word;
use std::ops::RangeInclusive;

/// Most elements of a header and most properties of an element. Real files stay below a hundred; the search for
/// duplicates is quadratic in this.
const MAX_DECLARED: usize = 1024;

/// Words of the longest declaration, `property list uchar int vertex_indices`. Comments may have more.
const MOST_WORDS: usize = 5;

/// Properties that are read.
const READ: [&str; 8] = ["x", "y", "z", "nx", "ny", "nz", "vertex_indices", "vertex_index"];

/// How the body's values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittleEndian,
    BinaryBigEndian,
}

/// Type of a number in the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// The type of a name, in either case. The integers of 64 bits are not PLY's, but written by some programs.
    fn parse(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"int64" | b"long" => Self::I64,
            b"uint64" | b"ulong" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        self.integer_range().is_some()
    }

    /// Smallest and largest value of an integer type.
    pub(super) fn integer_range(self) -> Option<RangeInclusive<i128>> {
        Some(match self {
            Self::I8 => i8::MIN.into()..=i8::MAX.into(),
            Self::U8 => 0..=u8::MAX.into(),
            Self::I16 => i16::MIN.into()..=i16::MAX.into(),
            Self::U16 => 0..=u16::MAX.into(),
            Self::I32 => i32::MIN.into()..=i32::MAX.into(),
            Self::U32 => 0..=u32::MAX.into(),
            Self::I64 => i64::MIN.into()..=i64::MAX.into(),
            Self::U64 => 0..=u64::MAX.into(),
            Self::F32 | Self::F64 => return None,
        })
    }
}

/// What one property of a row holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    /// A length, then as many items. The length is an integer type.
    List {
        length: Scalar,
        item: Scalar,
    },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: Vec<u8>,
    pub(super) kind: Kind,
}

/// A table of the body: `count` rows of the same properties.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: Vec<u8>,
    /// Number of rows as claimed; nothing is allocated by it.
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Index of a property; one of this very name before one in other case.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        let name = name.as_bytes();
        let exact = self.properties.iter().position(|p| p.name == name);
        exact.or_else(|| self.properties.iter().position(|p| p.name.eq_ignore_ascii_case(name)))
    }

    /// Whether the element has a name, in either case.
    pub(super) fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name.as_bytes())
    }

    /// What a row is called in messages: `vertices`, `faces` or, say, `camera rows`.
    pub(super) fn rows(&self) -> String {
        match &self.name {
            _ if self.is("vertex") => "vertices".to_owned(),
            _ if self.is("face") => "faces".to_owned(),
            other => format!("{} rows", quote(other)),
        }
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Names of textures, as `comment TextureFile` has them.
    pub(super) textures: Vec<String>,
    /// Start of the body, in bytes from the start of the file.
    pub(super) body_offset: usize,
    /// Lines of the header.
    pub(super) lines: usize,
}

impl Header {
    /// Parses the header at the start of a file.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Flaw> {
        let mut reader = HeaderReader { ended: true, ..HeaderReader::default() };
        if let Some(header) = reader.read(bytes)? {
            return Ok(header);
        }
        if reader.lines == 0 && !bytes.is_empty() && !is_keyword(&words(bytes), b"ply") {
            return Err(Flaw::at_line(1, Malformation::NotPly));
        }
        Err(Flaw::at_byte(bytes.len(), Malformation::HeaderEnd))
    }

    /// The element of a name.
    pub(super) fn find(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.is(name))
    }
}

/// Reads a header whose bytes may still arrive, and each of its lines once. A line ends in LF, CR, or CR LF.
#[derive(Default)]
pub(super) struct HeaderReader {
    parser: Parser,
    lines: usize,
    /// Start of the next line.
    offset: usize,
    /// Place from which to look for the line's end.
    searched: usize,
    /// Whether the last line ended in CR alone.
    carriage_return: bool,
    /// Whether no more bytes will come.
    ended: bool,
}

impl HeaderReader {
    /// The header, once all of it is there. `bytes` must be those of the calls before, with more behind them.
    pub(super) fn read(&mut self, bytes: &[u8]) -> Result<Option<Header>, Flaw> {
        while let Some(length) = bytes[self.searched..].iter().position(|b| matches!(b, b'\n' | b'\r')) {
            let at = self.searched + length;
            let raw = &bytes[self.offset..at];
            let said = words(raw);
            let is_last = is_keyword(&said, b"end_header");
            // Behind a header of lines that end in CR, an LF is the first byte of the body.
            let body_follows = is_last && self.carriage_return;
            let end = match (bytes[at], bytes.get(at + 1)) {
                (b'\r', Some(b'\n')) if !body_follows => at + 2,
                (b'\r', None) if !body_follows && !self.ended => {
                    self.searched = at;
                    return Ok(None);
                }
                _ => at + 1,
            };
            self.carriage_return = bytes[end - 1] == b'\r';
            (self.offset, self.searched) = (end, end);
            self.lines += 1;
            let lines = self.lines;
            let flaw = |why| Flaw::at_line(lines, why);
            if lines == 1 {
                if !is_keyword(&said, b"ply") {
                    return Err(flaw(Malformation::NotPly));
                }
            } else if is_last {
                let Parser { encoding, elements, textures } = std::mem::take(&mut self.parser);
                let encoding = encoding.ok_or(flaw(Malformation::NoFormat))?;
                return Ok(Some(Header { encoding, elements, textures, body_offset: end, lines }));
            } else {
                self.parser.line(raw, &said).map_err(flaw)?;
            }
        }
        self.searched = bytes.len();
        Ok(None)
    }
}

/// Whether a line is a keyword alone, in either case.
fn is_keyword(words: &[&[u8]], keyword: &[u8]) -> bool {
    matches!(words, [word] if word.eq_ignore_ascii_case(keyword))
}

/// The words of a line, no more of them than tell what it declares.
fn words(line: &[u8]) -> Vec<&[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take(MOST_WORDS + 1).collect()
}

#[derive(Default)]
struct Parser {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    textures: Vec<String>,
}

impl Parser {
    fn line(&mut self, raw: &[u8], words: &[&[u8]]) -> Result<(), Malformation> {
        let not_understood = || Malformation::HeaderLine { text: quote(raw.trim_ascii()) };
        let [keyword, rest @ ..] = words else { return Ok(()) };
        match (keyword.to_ascii_lowercase().as_slice(), rest) {
            (b"comment", [word, _, ..]) if word.eq_ignore_ascii_case(b"TextureFile") => {
                // All that is left of the line: names may have blanks.
                let name = first_word(raw).and_then(|(_, rest)| first_word(rest)).unwrap_or_default().1;
                self.textures.push(mtl::name(name));
                Ok(())
            }
            (b"comment" | b"obj_info", _) => Ok(()),
            (b"format", [encoding, b"1.0"]) => self.format(encoding),
            (b"format", _) => Err(Malformation::NoFormat),
            (b"element", [name, count]) => {
                let count =
                    str::from_utf8(count).ok().and_then(|c| c.parse().ok()).ok_or_else(not_understood)?;
                self.element(name, count)
            }
            (b"property", [list, length, item, name]) if list.eq_ignore_ascii_case(b"list") => {
                let length = integer_type(length)?;
                self.property(name, Kind::List { length, item: scalar_type(item)? })
            }
            (b"property", [scalar, name]) => self.property(name, Kind::Scalar(scalar_type(scalar)?)),
            _ => Err(not_understood()),
        }
    }

    fn format(&mut self, encoding: &[u8]) -> Result<(), Malformation> {
        let encoding = match encoding.to_ascii_lowercase().as_slice() {
            b"ascii" => Encoding::Ascii,
            b"binary_little_endian" => Encoding::BinaryLittleEndian,
            b"binary_big_endian" => Encoding::BinaryBigEndian,
            _ => return Err(Malformation::NoFormat),
        };
        match self.encoding.replace(encoding) {
            None => Ok(()),
            Some(_) => Err(Malformation::Duplicate { name: "format".to_owned() }),
        }
    }

    fn element(&mut self, name: &[u8], count: u64) -> Result<(), Malformation> {
        if self.elements.iter().any(|e| e.name == name) {
            return Err(Malformation::Duplicate { name: quote(name) });
        }
        if self.elements.len() == MAX_DECLARED {
            return Err(Malformation::HeaderSize { limit: MAX_DECLARED });
        }
        self.elements.push(Element { name: name.to_vec(), count, properties: Vec::new() });
        Ok(())
    }

    fn property(&mut self, name: &[u8], kind: Kind) -> Result<(), Malformation> {
        let element = self
            .elements
            .last_mut()
            .ok_or_else(|| Malformation::HeaderLine { text: format!("property {}", quote(name)) })?;
        // Two columns of a name stop nothing unless the name is one that is read.
        let is_read = READ.iter().any(|read| name.eq_ignore_ascii_case(read.as_bytes()));
        if is_read && element.properties.iter().any(|p| p.name == name) {
            return Err(Malformation::Duplicate { name: quote(name) });
        }
        if element.properties.len() == MAX_DECLARED {
            return Err(Malformation::HeaderSize { limit: MAX_DECLARED });
        }
        element.properties.push(Property { name: name.to_vec(), kind });
        Ok(())
    }
}

fn scalar_type(name: &[u8]) -> Result<Scalar, Malformation> {
    Scalar::parse(name).ok_or_else(|| Malformation::PropertyType { text: quote(name) })
}

fn integer_type(name: &[u8]) -> Result<Scalar, Malformation> {
    scalar_type(name).and_then(|s| {
        if s.is_integer() { Ok(s) } else { Err(Malformation::PropertyType { text: quote(name) }) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn why(header: &str) -> (u64, Malformation) {
        match Header::parse(header.as_bytes()).unwrap_err() {
            Flaw { at: crate::Position::Line(line), why } => (line, why),
            Flaw { at: crate::Position::Byte(at), why } => (at, why),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn declarations_are_kept_in_order_and_lines_may_end_in_cr_lf() {
        let text = "ply\r\nformat ascii 1.0\r\ncomment hi\r\nelement vertex 3\r\nproperty double x\r\n\
                    element face 1\r\nproperty list uint8 int32 vertex_index\r\nend_header\r\nBODY";
        let header = Header::parse(text.as_bytes()).unwrap();
        assert_eq!(header.encoding, Encoding::Ascii);
        assert_eq!((header.lines, &text[header.body_offset..]), (8, "BODY"));
        assert_eq!(header.find("vertex").unwrap().properties[0].kind, Kind::Scalar(Scalar::F64));
        let face = header.find("face").unwrap();
        assert_eq!((face.count, face.find("vertex_index")), (1, Some(0)));
        assert_eq!(face.properties[0].kind, Kind::List { length: Scalar::U8, item: Scalar::I32 });
    }

    #[test]
    fn comments_may_be_long_and_declarations_not_endless() {
        let comment = format!("ply\nformat ascii 1.0\ncomment{}\nend_header\n", " word".repeat(100_000));
        assert!(Header::parse(comment.as_bytes()).is_ok());
        let limit = MAX_DECLARED;
        for repeat in [|i| format!("element e{i} 1\n"), |i| format!("property int p{i}\n")] {
            let declarations: String = (0..=limit).map(repeat).collect();
            let (_, fault) = why(&format!("ply\nelement e 1\n{declarations}"));
            assert_eq!(fault, Malformation::HeaderSize { limit });
        }
    }

    #[test]
    fn faults_name_their_line() {
        assert_eq!(why("plyx\n"), (1, Malformation::NotPly));
        assert_eq!(why("ply\nformat ascii 2.0\n"), (2, Malformation::NoFormat));
        assert_eq!(why("ply\nend_header\n"), (2, Malformation::NoFormat));
        assert_eq!(why("ply\nformat ascii 1.0\n"), (21, Malformation::HeaderEnd));
        let text = "element vertex -3".to_owned();
        assert_eq!(why("ply\nelement vertex -3\n"), (2, Malformation::HeaderLine { text }));
        let text = "float".to_owned();
        assert_eq!(
            why("ply\nelement face 1\nproperty list float int i\n"),
            (3, Malformation::PropertyType { text })
        );
        let name = "x".to_owned();
        assert_eq!(
            why("ply\nelement v 1\nproperty int x\nproperty int x\n"),
            (4, Malformation::Duplicate { name })
        );
    }
}
