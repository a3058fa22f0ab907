//! OFF, the Object File Format of Geomview (its manual, "OFF: Object File Format"), as text. It reads `OFF`
//! and the variants that add texture coordinates, colours or normals to vertices. Colours are read if they
//! are asked for, the others are read past.
//!
//! A row usually is a line, where a colour of any length may follow what is needed. Files whose rows are not lines are read value by
//! value, with as many values a vertex as the keyword says.

mod colours;

use crate::error::{Flaw, Malformation, quote};
use crate::polygon::Polygons;
use crate::text::{self, Words, coordinates, parse_word, words};
use colours::Colours;
use isv_volume::TriangleMesh;

/// Fewest bytes of a vertex and of a triangle, `0 0 0` and `3 0 1 2` and the ends of their lines.
const LEAST_BYTES: [usize; 2] = [6, 8];

/// Parses an OFF file in memory, with its colours if they are asked for. Lines after the last face are ignored.
pub(crate) fn parse(bytes: &[u8], keeps_colours: bool) -> Result<TriangleMesh, Flaw> {
    let bytes = &text::decode(bytes);
    let header = Header { keeps_colours, ..Header::parse(bytes)? };
    read_lines(&header).or_else(|flaw| {
        // Of three readings the first that fits; the flaw is that of rows as lines.
        let faces_have_colours = [true, false];
        faces_have_colours.iter().find_map(|have| read_values(&header, *have)).ok_or(flaw)
    })
}

/// Keyword and counts, and the body behind them.
struct Header<'a> {
    vertices: u64,
    faces: u64,
    /// Values a vertex.
    values: Variant,
    /// Whether colours are asked for.
    keeps_colours: bool,
    body: &'a [u8],
    /// Line that the body starts on, from 1.
    line: usize,
}

impl<'a> Header<'a> {
    /// The keyword, if there is one, and the counts of vertices and faces behind it, on its line or the next ones. A count of edges may
    /// follow.
    fn parse(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let mut lines = Lines::new(bytes, 1);
        let mut first = lines.next().ok_or(Flaw::at_line(0, Malformation::NotOff))?;
        let flaw = |lines: &Lines, why| Flaw::at_line(lines.number, why);
        let word = words(first).next().unwrap_or_default();
        let mut values = Variant::default();
        if parse_word::<u64>(word).is_none() {
            let (variant, glued) = keyword(word).map_err(|why| flaw(&lines, why))?;
            values = variant;
            // `OFF162 320 0`, as many files of ModelNet have it.
            let at = first.len() - first.trim_ascii_start().len() + word.len() - glued.len();
            first = first[at..].trim_ascii();
            if words(first).next() == Some(b"BINARY") {
                return Err(flaw(&lines, Malformation::OffVariant { text: "OFF BINARY".to_owned() }));
            }
            if first.is_empty() {
                let counts = lines.next();
                first = counts.ok_or_else(|| flaw(&lines, Malformation::EndsBefore { what: "counts" }))?;
            }
        }
        let counts: Vec<_> = words(first).take(3).collect();
        if let [vertices, faces, ..] = counts[..] {
            let count =
                |word: &[u8]| parse_word(word).ok_or_else(|| Malformation::Number { text: quote(word) });
            let both = count(vertices).and_then(|vertices| Ok((vertices, count(faces)?)));
            let (vertices, faces) = both.map_err(|why| flaw(&lines, why))?;
            let (body, line) = (lines.rest, lines.number + 1);
            return Ok(Self { vertices, faces, values, keeps_colours: false, body, line });
        }
        // A count a line, all three of them.
        let mut found = [0; 3];
        let mut words = Words::new(lines.rest, lines.number + 1, true);
        for (index, count) in found.iter_mut().enumerate() {
            let word = if index == 0 { counts.first().copied() } else { words.next() };
            let few = || Flaw::at_line(lines.number, Malformation::LineLength { too_many: false });
            let number = |word: &[u8]| {
                let why = Malformation::Number { text: quote(word) };
                parse_word(word).ok_or(Flaw::at_line(lines.number, why))
            };
            *count = number(word.ok_or_else(few)?)?;
        }
        let [vertices, faces, _] = found;
        Ok(Self { vertices, faces, values, keeps_colours: false, body: words.rest(), line: words.line() })
    }

    /// How many rows to reserve memory for: as many as claimed, but never more than the body could hold.
    fn rows_to_reserve(&self, claimed: u64, least_bytes: usize) -> usize {
        let fit = self.body.len() / least_bytes;
        usize::try_from(claimed).map_or(fit, |claimed| claimed.min(fit))
    }
}

/// Values of a vertex beside its position.
#[derive(Clone, Copy, Debug, Default)]
struct Variant {
    normals: bool,
    colours: bool,
    coordinates: bool,
}

impl Variant {
    /// Values behind the position.
    fn rest(self) -> usize {
        3 * usize::from(self.normals) + 4 * usize::from(self.colours) + 2 * usize::from(self.coordinates)
    }
}

/// Values a vertex, and what is glued to the keyword: `OFF` in either case, with `ST`, `C` and `N` before it.
fn keyword(word: &[u8]) -> Result<(Variant, &[u8]), Malformation> {
    let at =
        word.windows(3).position(|three| three.eq_ignore_ascii_case(b"OFF")).ok_or(Malformation::NotOff)?;
    let (prefix, rest) = word.split_at(at);
    let (keyword, glued) = rest.split_at(3);
    let variant = || Malformation::OffVariant { text: quote(word) };
    // `n` before capitals is the number of dimensions, `N` a normal.
    if prefix.contains(&b'4') || (prefix.contains(&b'n') && keyword == b"OFF") {
        return Err(variant());
    }
    if !glued.is_empty() && parse_word::<u64>(glued).is_none() {
        return Err(Malformation::NotOff);
    }
    let prefix = prefix.to_ascii_uppercase();
    let textured = prefix.strip_prefix(b"ST");
    let (normals, colours) = match textured.unwrap_or(&prefix) {
        b"" => (false, false),
        b"C" => (false, true),
        b"N" => (true, false),
        b"CN" | b"NC" => (true, true),
        _ => return Err(variant()),
    };
    Ok((Variant { normals, colours, coordinates: textured.is_some() }, glued))
}

/// Reads a row a line.
fn read_lines(header: &Header) -> Result<TriangleMesh, Flaw> {
    let mut lines = Lines::new(header.body, header.line);
    let mut mesh = TriangleMesh::default();
    let mut colours = Colours::new(header.keeps_colours);
    mesh.vertices.reserve(header.rows_to_reserve(header.vertices, LEAST_BYTES[0]));
    for found in 0..header.vertices {
        let line = lines.row("vertices", header.vertices, found)?;
        let mut words = words(line);
        let vertex = coordinates(&mut words).map_err(|why| Flaw::at_line(lines.number, why))?;
        mesh.vertices.push(vertex);
        colours.vertex(header.values, words);
    }
    let mut polygons = Polygons::default();
    polygons.reserve(header.rows_to_reserve(header.faces, LEAST_BYTES[1]));
    let mut polygon = Vec::new();
    for found in 0..header.faces {
        let line = lines.row("faces", header.faces, found)?;
        let mut words = words(line);
        parse_face(&mut words, &mut polygon).map_err(|why| Flaw::at_line(lines.number, why))?;
        polygons.push(&polygon);
        colours.face(words, polygons.triangle_count());
    }
    mesh.triangles = polygons.into_triangles(&mesh.vertices)?;
    mesh.appearance = colours.finish(mesh.triangles.len());
    Ok(mesh)
}

/// Reads value by value, if nothing but that fits; `faces_have_colours`: what follows a face on its line is its colour.
fn read_values(header: &Header, faces_have_colours: bool) -> Option<TriangleMesh> {
    let mut words = Words::new(header.body, header.line, true);
    let mut mesh = TriangleMesh::default();
    let mut colours = Colours::new(header.keeps_colours);
    mesh.vertices.reserve(header.rows_to_reserve(header.vertices, LEAST_BYTES[0]));
    for _ in 0..header.vertices {
        mesh.vertices.push(coordinates(&mut words).ok()?);
        let rest: Vec<_> = words.by_ref().take(header.values.rest()).collect();
        if rest.len() < header.values.rest() {
            return None;
        }
        colours.vertex(header.values, rest.into_iter());
    }
    let mut polygons = Polygons::default();
    let mut polygon = Vec::new();
    for _ in 0..header.faces {
        parse_face(&mut words, &mut polygon).ok()?;
        polygons.push(&polygon);
        let mut rest = Vec::new();
        while faces_have_colours && words.line_goes_on() {
            rest.extend(words.next());
        }
        colours.face(rest.into_iter(), polygons.triangle_count());
    }
    mesh.triangles = polygons.into_triangles(&mesh.vertices).ok()?;
    mesh.appearance = colours.finish(mesh.triangles.len());
    let in_range = |vertex: &u32| (*vertex as usize) < mesh.vertices.len();
    (words.next().is_none() && mesh.triangles.as_flattened().iter().all(in_range)).then_some(mesh)
}

/// The corners of a face, `n v1 .. vn`; a colour may follow.
fn parse_face<'a>(
    words: &mut impl Iterator<Item = &'a [u8]>,
    polygon: &mut Vec<u32>,
) -> Result<(), Malformation> {
    polygon.clear();
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
    /// Number of the line given last, from 1.
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of a text that starts on a line, counted from 1.
    fn new(text: &'a [u8], line: usize) -> Self {
        Self { rest: text, number: line - 1 }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let mut lines = text::lines(self.rest);
            let line = lines.next()?;
            self.rest = lines.rest();
            self.number += 1;
            let said = text::without_comment(line).trim_ascii();
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const PLAIN: &str =
        "OFF\n# a comment\n\n4 2 0\n0 0 0\n1 0 0 # first axis\n1 1 0\r\n0 1 0\n3 0 1 2\n3 0 2 3\n";

    #[test]
    fn all_text_variants_read_the_same() {
        let mesh = parse(PLAIN.as_bytes(), false).unwrap();
        assert_eq!(mesh.vertices[2], DVec3::new(1.0, 1.0, 0.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        for other in [
            "OFF 4 2\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3",
            "COFF\n4 1 0\n0 0 0 1 0 0 1\n1 0 0 255 0 0\n1 1 0 .5 .5 .5 1\n0 1 0 0 0 0 1\n4 0 1 2 3 0.1 0.2 0.3\n",
            "NOFF 4 1 4\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n4 0 1 2 3 7\nmore",
            "STCNOFF\n4 2 0\n0 0 0 9 9 9 9 9\n1 0 0 9 9\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3",
        ] {
            assert_eq!(parse(other.as_bytes(), false).unwrap(), mesh, "{other}");
        }
    }

    #[test]
    fn every_truncation_fails() {
        for length in 0..PLAIN.trim_end().len() {
            assert!(parse(&PLAIN.as_bytes()[..length], true).is_err(), "cut at {length}");
        }
    }

    #[test]
    fn faults_say_where_and_what() {
        let fault = |text: &str, line, why| {
            assert_eq!(parse(text.as_bytes(), false).unwrap_err(), Flaw::at_line(line, why));
        };
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
            assert!(parse(text.as_bytes(), false).is_err());
        }
    }
}
