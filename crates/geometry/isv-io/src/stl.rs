//! STL, after the "StereoLithography Interface Specification" (3D Systems, 1988): a soup of triangles, text or binary.
//!
//! Equal positions become one vertex, so that the mesh is indexed. The normals of facets are ignored on reading, as they
//! repeat what the corners say; facets without area are kept.

use crate::error::{Flaw, Malformation, quote};
use crate::own::COMMENT;
use crate::placement::Placement;
use crate::text::{self, coordinates, words};
use glam::{DVec3, Vec3};
use isv_volume::TriangleMesh;
use std::collections::HashMap;
use std::io::{self, Write};

/// Bytes before the first triangle of a binary file: a free text, then the number of triangles.
const HEADER_BYTES: usize = TEXT_BYTES + 4;
const TEXT_BYTES: usize = 80;
/// A normal, three corners, and two bytes for anything.
const TRIANGLE_BYTES: usize = 12 * 4 + 2;

/// Parses an STL file in memory.
pub(crate) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Flaw> {
    let text = text::decode(bytes);
    if is_text(&text) { parse_text(&text) } else { parse_binary(bytes) }
}

/// Whether a file is the text kind: its first line that is no comment starts with `solid`. A binary one may
/// start so too. But either it has the length that its count asks for, or it is cut or padded. A text below 7
/// GB cannot have that length, as its count would be four printable characters. A binary file that is cut or
/// padded has bytes in its first lines that no text has.
fn is_text(bytes: &[u8]) -> bool {
    const LOOKED_AT: usize = 1024;
    let start = &bytes[..bytes.len().min(LOOKED_AT)];
    let mut said =
        text::lines(bytes).map(<[u8]>::trim_ascii).filter(|line| !line.is_empty() && !is_comment(line));
    let solid =
        said.next().and_then(|line| line.get(..5)).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let printable = start.iter().all(|b| *b >= b' ' || b.is_ascii_whitespace());
    let exact = promised(bytes).is_some_and(|n| bytes.len() as u64 == binary_length(n));
    solid && printable && !exact
}

/// Whether a line is a comment, as some programs write them.
fn is_comment(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    [&b"#"[..], b"//", b";", b"%", b"!"].iter().any(|mark| line.starts_with(mark))
}

/// The number of triangles that a binary file says it has.
fn promised(bytes: &[u8]) -> Option<u32> {
    bytes.get(TEXT_BYTES..)?.first_chunk().map(|count| u32::from_le_bytes(*count))
}

fn binary_length(triangles: u32) -> u64 {
    HEADER_BYTES as u64 + u64::from(triangles) * TRIANGLE_BYTES as u64
}

/// Bytes after the last triangle are ignored, as other readers do.
fn parse_binary(bytes: &[u8]) -> Result<TriangleMesh, Flaw> {
    let promised = promised(bytes).ok_or(Flaw::at_byte(bytes.len(), Malformation::NotStl))?;
    let body = &bytes[HEADER_BYTES..];
    let whole = body.len() / TRIANGLE_BYTES;
    if (whole as u64) < u64::from(promised) {
        let rows = "triangles".to_owned();
        let why = Malformation::Truncated { rows, promised: promised.into(), found: whole as u64 };
        return Err(Flaw::at_byte(bytes.len(), why));
    }
    let mut soup = Soup::default();
    for triangle in body.chunks_exact(TRIANGLE_BYTES).take(promised as usize) {
        let float = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|byte| triangle[4 * i + byte]));
        let corners = [3, 6, 9].map(|i| Vec3::new(float(i), float(i + 1), float(i + 2)).as_dvec3());
        soup.push(corners);
    }
    Ok(soup.mesh)
}

fn parse_text(bytes: &[u8]) -> Result<TriangleMesh, Flaw> {
    let mut parser = Text { soup: Soup::default(), corners: Vec::new(), inside: false };
    let mut lines = 0;
    for line in text::lines(bytes) {
        lines += 1;
        parser.line(line).map_err(|why| Flaw::at_line(lines, why))?;
    }
    if parser.inside {
        return Err(Flaw::at_line(lines, Malformation::EndsBefore { what: "endsolid" }));
    }
    Ok(parser.soup.mesh)
}

struct Text {
    soup: Soup,
    /// Corners of the facet so far.
    corners: Vec<DVec3>,
    /// Whether a solid is open; a file may hold several.
    inside: bool,
}

impl Text {
    /// Takes a line. Keywords in either case, `end` apart or not; what else a line has (names, normals, colours) is not looked at.
    fn line(&mut self, line: &[u8]) -> Result<(), Malformation> {
        if is_comment(line) {
            return Ok(());
        }
        let mut words = words(line);
        let Some(word) = words.next() else { return Ok(()) };
        let mut keyword = word.to_ascii_lowercase();
        if keyword == b"end" {
            keyword.extend(words.next().unwrap_or_default().to_ascii_lowercase());
        }
        match (keyword.as_slice(), self.inside) {
            (b"solid", false) => self.inside = true,
            (b"endsolid", true) if self.corners.is_empty() => self.inside = false,
            (b"vertex", true) => self.corners.push(coordinates(&mut words)?),
            (b"endfacet", true) => {
                let [a, b, c] = self.corners[..] else {
                    return Err(Malformation::FacetCorners { corners: self.corners.len() });
                };
                self.soup.push([a, b, c]);
                self.corners.clear();
            }
            (b"facet" | b"outer" | b"outerloop" | b"endloop" | b"color" | b"colour", true) => {}
            (b"color" | b"colour", false) => {}
            _ => return Err(Malformation::Keyword { format: "STL", text: quote(word) }),
        }
        Ok(())
    }
}

/// A mesh that grows by triangles of positions.
#[derive(Default)]
struct Soup {
    mesh: TriangleMesh,
    /// The vertex at a position, by the bits of its coordinates. Never iterated. The standard hash, as files choose the keys.
    vertices: HashMap<[u64; 3], u32>,
}

impl Soup {
    fn push(&mut self, corners: [DVec3; 3]) {
        let triangle = corners.map(|corner| {
            // Adding zero makes the negative zero the positive one.
            let bits = corner.to_array().map(|c| (c + 0.0).to_bits());
            *self.vertices.entry(bits).or_insert_with(|| {
                self.mesh.vertices.push(corner);
                (self.mesh.vertices.len() - 1) as u32
            })
        });
        self.mesh.triangles.push(triangle);
    }
}

/// Writes a mesh as binary STL, with the normals of its facets. Coordinates are rounded to `f32`.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| io::Error::new(io::ErrorKind::FileTooLarge, "STL counts at most 2^32 - 1 triangles"))?;
    let mut text = [b' '; TEXT_BYTES];
    // Never "solid", by which readers know text.
    let said = format!("binary STL, {COMMENT}");
    text[..said.len()].copy_from_slice(said.as_bytes());
    out.write_all(&text)?;
    out.write_all(&count.to_le_bytes())?;
    for face in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(face);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let [a, b, c] = [a, b, c].map(|corner| placement.place(corner));
        for vector in [normal, a, b, c] {
            for component in vector.as_vec3().to_array() {
                out.write_all(&component.to_le_bytes())?;
            }
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid two words\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   VERTEX 1 0 -0\n   \
                        vertex 0 1e0 0\r\n  endloop\n endfacet\nfacet normal 0 0 0 outer loop\nvertex 0 1 0\nvertex 1 0 0\n\
                        vertex 1 0 0\nendloop\nendfacet\nendsolid two words\n\nsolid\nendsolid";

    fn expected() -> TriangleMesh {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        TriangleMesh {
            vertices,
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [2, 1, 1]],
            appearance: None,
        }
    }

    #[test]
    fn text_is_indexed_and_keeps_facets_without_area() {
        assert_eq!(parse(TEXT.as_bytes()).unwrap(), expected());
    }

    #[test]
    fn binary_may_call_itself_solid_and_carry_more_bytes() {
        let mut bytes = Vec::new();
        write(&mut bytes, &expected(), &Placement::default()).unwrap();
        assert_eq!(bytes.len(), 84 + 2 * 50);
        assert_eq!(parse(&bytes).unwrap(), expected());
        bytes[..13].copy_from_slice(b"solid forever");
        assert_eq!(parse(&bytes).unwrap(), expected());
        bytes.extend([7; 30]);
        assert_eq!(parse(&bytes).unwrap(), expected(), "the count has bytes that no text has");
    }

    #[test]
    fn written_normals_are_those_of_the_facets() {
        let mut bytes = Vec::new();
        write(&mut bytes, &expected(), &Placement::default()).unwrap();
        let normals = [84 + 8, 84 + 50 + 8].map(|at| f32::from_le_bytes(*bytes[at..].first_chunk().unwrap()));
        assert_eq!(normals, [1.0, 0.0], "z of a facet and of one without area");
    }

    #[test]
    fn every_truncation_fails() {
        let mut binary = Vec::new();
        write(&mut binary, &expected(), &Placement::default()).unwrap();
        for length in 0..binary.len() {
            assert!(parse(&binary[..length]).is_err(), "binary cut at {length}");
        }
        let first_solid = TEXT.find("endsolid").unwrap() + "endsolid".len();
        for length in 0..first_solid {
            assert!(parse(&TEXT.as_bytes()[..length]).is_err(), "text cut at {length}");
        }
    }

    #[test]
    fn faults_say_where_and_what() {
        let line =
            |text: &str, line, why| assert_eq!(parse(text.as_bytes()).unwrap_err(), Flaw::at_line(line, why));
        let text = || "hello".to_owned();
        line("solid\nhello", 2, Malformation::Keyword { format: "STL", text: text() });
        line("solid\nvertex 1 hello 2", 2, Malformation::Number { text: text() });
        line("solid\nvertex 1 2", 2, Malformation::LineLength { too_many: false });
        line("solid\nvertex 1 2 3\nendfacet\n", 3, Malformation::FacetCorners { corners: 1 });
        line("solid\n", 2, Malformation::EndsBefore { what: "endsolid" });
        assert_eq!(parse(b"hello").unwrap_err(), Flaw::at_byte(5, Malformation::NotStl));
        let huge = [&[b'x'; 80][..], &u32::MAX.to_le_bytes(), &[0; 60]].concat();
        let why = Malformation::Truncated { rows: "triangles".into(), promised: u32::MAX.into(), found: 1 };
        assert_eq!(parse(&huge).unwrap_err(), Flaw::at_byte(144, why));
    }
}
