//! The PLY file at the start of bytes that still arrive. It says how long it is only to who reads all of it,
//! and may be asked after every few bytes. What was seen once is not looked at again, so that all answers
//! together cost no more than one. The rows are parsed once, when the last of them is there.

use super::header::{Element, Encoding, Header, HeaderReader, Kind};
use super::read::parse_body;
use super::values::{Binary, Fault};
use crate::error::Flaw;
use crate::geometry::Geometry;
use crate::linked::Linked;
use crate::text::{is_space, parse_word};

/// What is known of the file so far.
#[derive(Default)]
pub(crate) struct Arriving {
    header: HeaderReader,
    body: Option<(Header, Rows)>,
}

impl Arriving {
    /// Parses the file that `bytes` start with, and says how many bytes it takes. `None` if it ends later than `bytes` do and
    /// more bytes will come: if not `ended`. They must be the bytes of the calls before, with more behind them. An ASCII
    /// file ends with the line of its last row. Colours are read if linked files are given.
    pub(crate) fn parse(
        &mut self,
        bytes: &[u8],
        ended: bool,
        linked: Option<&mut Linked>,
    ) -> Result<Option<(Geometry, usize)>, Flaw> {
        if ended {
            return parse_body(bytes, &Header::parse(bytes)?, true, linked).map(Some);
        }
        if self.body.is_none() {
            self.body = self.header.read(bytes)?.map(|header| {
                let rows = Rows::after(&header);
                (header, rows)
            });
        }
        let Some((header, rows)) = &mut self.body else { return Ok(None) };
        if !rows.find_all(bytes, header) {
            return Ok(None);
        }
        parse_body(bytes, header, false, linked).map(Some)
    }
}

/// The rows of a body that are there.
struct Rows {
    /// All elements before this one have all their rows.
    element: usize,
    /// How many this one has.
    row: u64,
    /// End of the last row, in bytes from the start of the file.
    end: usize,
    /// Offset in a text body at which to look for the end of the next word.
    searched: usize,
    /// Property of a text row that comes next.
    property: usize,
    /// Items of its list that are still to come.
    items: u64,
}

impl Rows {
    fn after(header: &Header) -> Self {
        let start = header.body_offset;
        Self { element: 0, row: 0, end: start, searched: start, property: 0, items: 0 }
    }

    /// Looks for the rows that came since; whether all are there, or there is a fault that parsing them finds.
    fn find_all(&mut self, bytes: &[u8], header: &Header) -> bool {
        match header.encoding {
            Encoding::Ascii => self.find_words(bytes, header),
            Encoding::BinaryLittleEndian => self.find_binary(bytes, header, false),
            Encoding::BinaryBigEndian => self.find_binary(bytes, header, true),
        }
    }

    /// Values between white space, and the end of the line that the last of them is on.
    fn find_words(&mut self, bytes: &[u8], header: &Header) -> bool {
        while let Some(element) = self.unfinished(header) {
            // The end of the last word seen, or the start of the next one.
            let blanks = bytes[self.end..].iter().take_while(|b| is_space(**b)).count();
            self.end += blanks;
            self.searched = self.searched.max(self.end);
            let Some(length) = bytes[self.searched..].iter().position(|b| is_space(*b)) else {
                self.searched = bytes.len();
                return false;
            };
            let word = &bytes[self.end..self.searched + length];
            self.end = self.searched + length;
            self.searched = self.end;
            if self.items > 0 {
                self.items -= 1;
            } else if let Kind::List { .. } = element.properties[self.property].kind {
                let Some(items) = parse_word(word) else { return true };
                self.items = items;
            }
            if self.items == 0 {
                self.property += 1;
                if self.property == element.properties.len() {
                    self.property = 0;
                    self.row += 1;
                }
            }
        }
        // Without rows the file ends with its header, whose last line is over.
        if self.end == header.body_offset {
            return true;
        }
        let Some(length) = bytes[self.searched..].iter().position(|b| matches!(b, b'\n' | b'\r')) else {
            self.searched = bytes.len();
            return false;
        };
        self.searched += length;
        true
    }

    fn find_binary(&mut self, bytes: &[u8], header: &Header, big_endian: bool) -> bool {
        while let Some(element) = self.unfinished(header) {
            if let Some(row_bytes) = bytes_of_each_row(element) {
                let missing = u128::from(element.count - self.row) * row_bytes as u128;
                if missing > (bytes.len() - self.end) as u128 {
                    return false;
                }
                self.end += missing as usize;
                self.row = element.count;
                continue;
            }
            let mut values = Binary::new(bytes, self.end, big_endian);
            match values.skip_row(element) {
                Ok(end) => self.end = end,
                Err(Fault::End) => return false,
                Err(Fault::Malformed(_)) => return true,
            }
            self.row += 1;
        }
        true
    }

    /// The first element with rows that are not there.
    fn unfinished<'a>(&mut self, header: &'a Header) -> Option<&'a Element> {
        loop {
            let element = header.elements.get(self.element)?;
            // Rows of nothing take no bytes.
            if !element.properties.is_empty() && self.row < element.count {
                return Some(element);
            }
            self.element += 1;
            self.row = 0;
        }
    }
}

/// The bytes of a row, where all rows have as many: where there are no lists.
fn bytes_of_each_row(element: &Element) -> Option<usize> {
    let bytes = element.properties.iter().map(|property| match property.kind {
        Kind::Scalar(scalar) => Some(scalar.bytes()),
        Kind::List { .. } => None,
    });
    bytes.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Malformation;

    const VERTICES: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";

    /// The lines of a text file: a list of many corners, an element that is not read, rows of nothing, an empty line.
    fn text() -> Vec<Vec<u8>> {
        let header = format!(
            "ply\nformat ascii 1.0\ncomment of some length\n{VERTICES}element face 3\nproperty list int int vertex_indices\n\
             element nothing 9\nelement other 2\nproperty list uchar double d\nproperty char c\nend_header\n"
        );
        let body = "0 0 0\n1 0 0\n1 1 0\n\n0 1 0\n4 0 1 2 3\n3 0 1 2\n0\n2 0.5 0.5 1\n0 1\n";
        [header.as_str(), body].concat().split_inclusive('\n').map(|line| line.as_bytes().to_vec()).collect()
    }

    /// The file in binary: the lines of the header, all vertices, then rows.
    fn binary(big_endian: bool) -> Vec<Vec<u8>> {
        let name = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
        let mut pieces = text();
        pieces.truncate(pieces.iter().position(|line| line == b"end_header\n").unwrap() + 1);
        pieces[1] = format!("format {name} 1.0\n").into_bytes();
        let int = |value: &i32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        let float = |value: &f32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        pieces.push(
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(float).collect(),
        );
        let faces: [&[i32]; 3] = [&[4, 0, 1, 2, 3], &[3, 0, 1, 2], &[0]];
        pieces.extend(faces.map(|face| face.iter().flat_map(int).collect()));
        pieces.push([&[2][..], &[0; 16], &[1]].concat());
        pieces.push(vec![0, 1]);
        pieces
    }

    #[test]
    fn a_file_comes_with_its_last_byte_and_not_before() {
        for pieces in [text(), binary(false), binary(true)] {
            let file = pieces.concat();
            let expected = Arriving::default().parse(&file, true, None).unwrap().unwrap();
            assert_eq!(expected.1, file.len());
            let following = [&file[..], b"ply\nformat"].concat();
            for step in 1..40 {
                let mut arriving = Arriving::default();
                for length in (0..file.len()).step_by(step) {
                    assert_eq!(arriving.parse(&file[..length], false, None).unwrap(), None, "{length} bytes");
                }
                assert_eq!(arriving.parse(&following, false, None).unwrap().unwrap(), expected);
            }
        }
    }

    /// Each byte is overwritten with what breaks every format as soon as the line or row that it is in was seen whole.
    #[test]
    fn what_was_seen_is_not_looked_at_again() {
        for pieces in [text(), binary(false), binary(true)] {
            let file = pieces.concat();
            let ruin =
                |length: usize, byte: &[u8]| byte.iter().copied().cycle().take(length).collect::<Vec<u8>>();
            for rubbish in [&b"?\n"[..], &[0xff]] {
                let mut arriving = Arriving::default();
                let mut seen = 0;
                for piece in &pieces[..pieces.len() - 1] {
                    for length in [piece.len() / 2, piece.len()] {
                        let bytes = [ruin(seen, rubbish), piece[..length].to_vec()].concat();
                        assert_eq!(arriving.parse(&bytes, false, None).unwrap(), None);
                    }
                    seen += piece.len();
                }
                assert!(arriving.parse(&file, false, None).unwrap().is_some());
            }
        }
    }

    #[test]
    fn the_end_of_a_long_line_is_looked_for_once() {
        let header = format!("ply\nformat ascii 1.0\n{VERTICES}end_header\n");
        for before in ["ply\ncomment ".to_owned(), "ply ".to_owned(), format!("{header}0 0 ")] {
            let mut arriving = Arriving::default();
            let line = " ".repeat(1000);
            assert_eq!(arriving.parse((before.clone() + &line).as_bytes(), false, None).unwrap(), None);
            // Line ends that come where none was.
            let more = before.clone() + &"?\n".repeat(500) + &line;
            assert_eq!(arriving.parse(more.as_bytes(), false, None).unwrap(), None);
        }
    }

    #[test]
    fn faults_are_told_when_they_are_there() {
        let fault = |text: &str| Arriving::default().parse(text.as_bytes(), false, None).unwrap_err();
        assert_eq!(fault("plywood\n"), Flaw::at_line(1, Malformation::NotPly));
        let text = "rubbish".to_owned();
        let expected = Flaw::at_line(3, Malformation::HeaderLine { text });
        assert_eq!(fault("ply\nformat ascii 1.0\nrubbish\n"), expected);
        let mut pieces = binary(false);
        let last = pieces.len() - 1;
        pieces[last - 2] = vec![0xff; 4];
        pieces.truncate(last - 1);
        assert!(Arriving::default().parse(&pieces.concat(), false, None).is_err(), "a list of -1 items");
    }
}
