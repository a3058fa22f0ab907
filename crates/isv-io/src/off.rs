//! OFF, the Object File Format of Geomview (its manual, "OFF: Object File Format"), as text: `OFF` and the variants that
//! add texture coordinates, colours or normals to vertices, which are read past.

use crate::error::{Flaw, Malformation, quote};
use crate::polygon::Polygons;
use crate::words::{coordinates, parse_word, words};
use isv_volume::TriangleMesh;

/// Fewest bytes of a vertex and of a triangle, `0 0 0` and `3 0 1 2` and the ends of their lines.
const LEAST_BYTES: [usize; 2] = [6, 8];

/// Parses an OFF file in memory. Lines after the last face are ignored.
pub(crate) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Flaw> {
    let mut lines = Lines { rest: bytes, number: 0 };
    let [vertices, faces] = counts(&mut lines).map_err(|why| Flaw::at_line(lines.number, why))?;
    let mut mesh = TriangleMesh::default();
    mesh.vertices.reserve(lines.rows_to_reserve(vertices, LEAST_BYTES[0]));
    for found in 0..vertices {
        let line = lines.row("vertices", vertices, found)?;
        let vertex = coordinates(&mut words(line)).map_err(|why| Flaw::at_line(lines.number, why))?;
        mesh.vertices.push(vertex);
    }
    let mut polygons = Polygons::default();
    polygons.reserve(lines.rows_to_reserve(faces, LEAST_BYTES[1]));
    let mut polygon = Vec::new();
    for found in 0..faces {
        let line = lines.row("faces", faces, found)?;
        parse_face(line, &mut polygon).map_err(|why| Flaw::at_line(lines.number, why))?;
        polygons.push(&polygon);
    }
    mesh.triangles = polygons.into_triangles(&mesh.vertices)?;
    Ok(mesh)
}

/// The keyword, and the counts of vertices and faces after it, on its line or the next. A count of edges may follow.
fn counts(lines: &mut Lines) -> Result<[u64; 2], Malformation> {
    let first = lines.next().ok_or(Malformation::NotOff)?;
    let mut rest = words(first);
    let keyword = rest.next().and_then(|word| word.strip_suffix(b"OFF")).ok_or(Malformation::NotOff)?;
    let keyword = keyword.strip_prefix(b"ST").unwrap_or(keyword);
    if !matches!(keyword, b"" | b"C" | b"N" | b"CN") {
        return Err(Malformation::OffVariant { text: quote(words(first).next().unwrap_or_default()) });
    }
    let mut rest = rest.peekable();
    match rest.peek() {
        Some(&b"BINARY") => Err(Malformation::OffVariant { text: "OFF BINARY".to_owned() }),
        Some(_) => parse_counts(rest),
        None => parse_counts(words(lines.next().ok_or(Malformation::EndsBefore { what: "counts" })?)),
    }
}

fn parse_counts<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Result<[u64; 2], Malformation> {
    let mut count = || {
        let word = words.next().ok_or(Malformation::LineLength { too_many: false })?;
        parse_word(word).ok_or_else(|| Malformation::Number { text: quote(word) })
    };
    Ok([count()?, count()?])
}

/// The corners of a face, `n v1 .. vn`; a colour may follow.
fn parse_face(line: &[u8], polygon: &mut Vec<u32>) -> Result<(), Malformation> {
    polygon.clear();
    let mut words = words(line);
    let length = words.next().unwrap_or_default();
    let corners: u64 = parse_word(length).ok_or_else(|| Malformation::Number { text: quote(length) })?;
    for _ in 0..corners {
        let word = words.next().ok_or(Malformation::LineLength { too_many: false })?;
        polygon.push(parse_word(word).ok_or_else(|| Malformation::Index { text: quote(word) })?);
    }
    Ok(())
}

/// The lines that say something, without their comments.
struct Lines<'a> {
    rest: &'a [u8],
    /// Of the line given last, from 1.
    number: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|b| *b == b'\n');
            let (line, rest) = self.rest.split_at(end.map_or(self.rest.len(), |end| end + 1));
            self.rest = rest;
            self.number += 1;
            let said = line.split(|b| *b == b'#').next().unwrap_or_default().trim_ascii();
            if !said.is_empty() {
                return Some(said);
            }
        }
        None
    }

    /// The next line where `promised` of a kind are expected and `found` were there.
    fn row(&mut self, rows: &str, promised: u64, found: u64) -> Result<&'a [u8], Flaw> {
        self.next().ok_or_else(|| {
            Flaw::at_line(self.number, Malformation::Truncated { rows: rows.to_owned(), promised, found })
        })
    }

    /// How many rows to reserve memory for: as many as claimed, but never more than the rest of the file could hold.
    fn rows_to_reserve(&self, claimed: u64, least_bytes: usize) -> usize {
        let fit = self.rest.len() / least_bytes;
        usize::try_from(claimed).map_or(fit, |claimed| claimed.min(fit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const PLAIN: &str =
        "OFF\n# a comment\n\n4 2 0\n0 0 0\n1 0 0 # first axis\n1 1 0\r\n0 1 0\n3 0 1 2\n3 0 2 3\n";

    #[test]
    fn all_text_variants_read_the_same() {
        let mesh = parse(PLAIN.as_bytes()).unwrap();
        assert_eq!(mesh.vertices[2], DVec3::new(1.0, 1.0, 0.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        for other in [
            "OFF 4 2\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3",
            "COFF\n4 1 0\n0 0 0 1 0 0 1\n1 0 0 255 0 0\n1 1 0 .5 .5 .5 1\n0 1 0 0 0 0 1\n4 0 1 2 3 0.1 0.2 0.3\n",
            "NOFF 4 1 4\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n4 0 1 2 3 7\nmore",
            "STCNOFF\n4 2 0\n0 0 0 9 9 9 9 9\n1 0 0 9 9\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3",
        ] {
            assert_eq!(parse(other.as_bytes()).unwrap(), mesh, "{other}");
        }
    }

    #[test]
    fn every_truncation_fails() {
        for length in 0..PLAIN.trim_end().len() {
            assert!(parse(&PLAIN.as_bytes()[..length]).is_err(), "cut at {length}");
        }
    }

    #[test]
    fn faults_say_where_and_what() {
        let fault =
            |text: &str, line, why| assert_eq!(parse(text.as_bytes()).unwrap_err(), Flaw::at_line(line, why));
        fault("", 0, Malformation::NotOff);
        fault("ply\n", 1, Malformation::NotOff);
        for variant in ["4OFF", "nOFF", "C4OFF"] {
            fault(&format!("{variant}\n"), 1, Malformation::OffVariant { text: variant.to_owned() });
        }
        fault("OFF BINARY\n\0\0", 1, Malformation::OffVariant { text: "OFF BINARY".into() });
        fault("OFF\n4", 2, Malformation::LineLength { too_many: false });
        fault("OFF\n-4 1 0", 2, Malformation::Number { text: "-4".into() });
        fault("OFF 1 1\n0 0 zero\n", 2, Malformation::Number { text: "zero".into() });
        fault("OFF 1 1\n0 0 0\n3 0 0\n", 3, Malformation::LineLength { too_many: false });
        fault("OFF 1 1\n0 0 0\n3 0 0 -1\n", 3, Malformation::Index { text: "-1".into() });
        fault("OFF 1 1\n0 0 0\n18446744073709551615 0 0\n", 3, Malformation::LineLength { too_many: false });
        for (vertices, faces) in [(u64::MAX, 1), (1, u64::MAX)] {
            let text = format!("OFF {vertices} {faces}\n0 0 0\n1 0\n");
            assert!(parse(text.as_bytes()).is_err());
        }
    }
}
