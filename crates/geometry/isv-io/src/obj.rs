//! Wavefront OBJ, after the "Advanced Visualizer" appendix B1: the `v`, `f` and `p` records; all others are ignored.
//!
//! `vn` records of meshes are ignored on reading too: OBJ gives normals to the corners of faces, a mesh here to its vertices. Points
//! have the normals of a file that has one a vertex.

use crate::error::{Flaw, Malformation, quote};
use crate::geometry::Geometry;
use crate::own::COMMENT;
use crate::placement::Placement;
use crate::polygon::Polygons;
use crate::text::{self, coordinates, parse_word, words};
use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};
use std::io::{self, Write};

/// Parses an OBJ file in memory: points if it has vertices but neither faces nor lines, else a mesh. A file that has no vertices
/// either is an empty mesh if it has nothing but comments and records of OBJ.
pub(crate) fn parse(bytes: &[u8]) -> Result<Geometry, Flaw> {
    let bytes = &text::decode(bytes);
    let mut file = File::default();
    let mut lines = text::lines(bytes).enumerate();
    let mut joined = Vec::new();
    while let Some((index, line)) = lines.next() {
        joined.clear();
        joined.extend_from_slice(line.trim_ascii_end());
        // A backslash at its end continues a line on the next.
        while joined.last() == Some(&b'\\') {
            joined.pop();
            joined.push(b' ');
            joined.extend_from_slice(lines.next().map_or(&[][..], |(_, next)| next).trim_ascii_end());
        }
        file.record(&joined, index + 1).map_err(|why| Flaw::at_line(index + 1, why))?;
    }
    file.finish()
}

/// What the records so far say.
#[derive(Default)]
struct File {
    vertices: Vec<DVec3>,
    /// `vn` records: normals of points, where there is one a vertex.
    normals: Vec<DVec3>,
    polygons: Polygons,
    /// Vertices that `p` records name.
    points: Vec<u32>,
    /// Whether there are faces, lines or other elements that are no points.
    has_elements: bool,
    /// The first word that is no keyword of OBJ, and its line.
    unknown: Option<(usize, String)>,
    /// Scratch space.
    polygon: Vec<u32>,
}

/// Keywords of OBJ that are neither vertices nor elements, and those that programs have added.
const PASSED_OVER: [&str; 19] = [
    "vt",
    "vp",
    "o",
    "g",
    "s",
    "mg",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "deg",
    "cstype",
    "end",
];

impl File {
    /// Takes a line.
    fn record(&mut self, line: &[u8], number: usize) -> Result<(), Malformation> {
        let line = text::without_comment(line);
        let mut words = words(line);
        match words.next() {
            None => {}
            // A weight or a colour may follow.
            Some(b"v") => self.vertices.push(coordinates(&mut words)?),
            Some(b"vn") => self.normals.push(coordinates(&mut words).unwrap_or_default().normalize_or_zero()),
            Some(b"f" | b"fo") => {
                self.has_elements = true;
                self.polygon.clear();
                for corner in words {
                    self.polygon.push(vertex_of_corner(corner, self.vertices.len())?);
                }
                self.polygons.push(&self.polygon);
            }
            Some(b"p") => {
                for corner in words {
                    self.points.push(vertex_of_corner(corner, self.vertices.len())?);
                }
            }
            Some(b"l" | b"curv" | b"curv2" | b"surf") => self.has_elements = true,
            Some(word) if PASSED_OVER.iter().any(|keyword| word == keyword.as_bytes()) => {}
            Some(word) => {
                self.unknown.get_or_insert_with(|| (number, quote(word)));
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<Geometry, Flaw> {
        let Self { vertices, normals, polygons, points, has_elements, unknown, .. } = self;
        if vertices.is_empty()
            && !has_elements
            && let Some((line, text)) = unknown
        {
            return Err(Flaw::at_line(line, Malformation::Keyword { format: "OBJ", text }));
        }
        if has_elements || vertices.is_empty() {
            let triangles = polygons.into_triangles(&vertices)?;
            return Ok(Geometry::Mesh(TriangleMesh {
                vertices,
                normals: Vec::new(),
                triangles,
                appearance: None,
            }));
        }
        let known = normals.len() == vertices.len();
        let normals = if known { normals } else { Vec::new() };
        if points.is_empty() {
            return Ok(Geometry::Points(PointCloud {
                positions: vertices,
                normals,
                viewpoint: None,
                scans: Vec::new(),
                colours: Vec::new(),
            }));
        }
        if let Some(index) = points.iter().find(|index| **index as usize >= vertices.len()) {
            let text = (u64::from(*index) + 1).to_string();
            return Err(Flaw::in_object("point", 0, Malformation::Index { text }));
        }
        let named = |of: &[DVec3]| match of.is_empty() {
            true => Vec::new(),
            false => points.iter().map(|index| of[*index as usize]).collect(),
        };
        let (positions, normals) = (named(&vertices), named(&normals));
        Ok(Geometry::Points(PointCloud {
            positions,
            normals,
            viewpoint: None,
            scans: Vec::new(),
            colours: Vec::new(),
        }))
    }
}

/// The vertex that a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` names, from 0. In the file positive numbers count from
/// 1, negative ones back from the vertex read last.
fn vertex_of_corner(corner: &[u8], vertices_so_far: usize) -> Result<u32, Malformation> {
    let vertex = corner.split(|b| *b == b'/').next().unwrap_or_default();
    let number: Option<i64> = parse_word(vertex);
    let index = match number {
        Some(1..) => number.map(|n| n - 1),
        Some(..=-1) => number.and_then(|n| n.checked_add(vertices_so_far as i64)),
        _ => None,
    };
    index.and_then(|i| u32::try_from(i).ok()).ok_or_else(|| Malformation::Index { text: quote(corner) })
}

/// Writes a mesh. Numbers have as many digits as identify them, as `f32` unless the placement needs `f64`.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    writeln!(out, "# {COMMENT}")?;
    let double = placement.needs_double(&mesh.vertices);
    for vertex in &mesh.vertices {
        let vertex = placement.place(*vertex);
        if double {
            writeln!(out, "v {} {} {}", vertex.x, vertex.y, vertex.z)?;
        } else {
            let [x, y, z] = vertex.as_vec3().to_array();
            writeln!(out, "v {x} {y} {z}")?;
        }
    }
    for normal in &mesh.normals {
        let [x, y, z] = normal.as_vec3().to_array();
        writeln!(out, "vn {x} {y} {z}")?;
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| u64::from(v) + 1);
        if mesh.normals.is_empty() {
            writeln!(out, "f {a} {b} {c}")?;
        } else {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flaw(text: &str) -> Flaw {
        parse(text.as_bytes()).unwrap_err()
    }

    fn mesh(text: &str) -> TriangleMesh {
        match parse(text.as_bytes()).unwrap() {
            Geometry::Mesh(mesh) => mesh,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn vertices_without_elements_are_points_and_p_names_some_of_them() {
        let points = |text: &str| match parse(text.as_bytes()).unwrap() {
            Geometry::Points(points) => points.positions,
            other => panic!("{other:?}"),
        };
        assert_eq!(points("v 1 0 0\nv 0 1 0\n"), [DVec3::X, DVec3::Y]);
        assert_eq!(points("v 1 0 0\nv 0 1 0\np -1 1\n"), [DVec3::Y, DVec3::X]);
        assert!(parse(b"v 1 0 0\np 2\n").is_err());
        assert_eq!(mesh("v 0 0 0\nv 1 0 0\nl 1 2\n").triangles.len(), 0, "lines are no points");
    }

    #[test]
    fn a_file_without_vertices_is_empty_only_if_it_is_obj() {
        assert_eq!(mesh("# nobody\no body\nmtllib a.mtl\n"), TriangleMesh::default());
        let text = "hello".to_owned();
        assert_eq!(
            flaw("# a\nhello world\n"),
            Flaw::at_line(2, Malformation::Keyword { format: "OBJ", text })
        );
    }

    #[test]
    fn corners_may_be_negative_and_carry_texture_and_normal() {
        let text = "# head\nmtllib x.mtl\nv 0 0 0 1\nv 1 0 0 .5 .5 .5\r\nv 1 1 0\nvn 0 0 1\n\
                    f 1/9/9 2//9 3/9\nv 0 1 0 # fourth\nf -4 -3 -2 -1\n";
        let mesh = mesh(text);
        assert_eq!(mesh.vertices[3], DVec3::new(0.0, 1.0, 0.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn a_backslash_continues_a_line() {
        let mesh = mesh("v 0 0 0\nv 1 0 \\\r\n 0\nv 1 1 0\nf 1 2\\\n3\n\\");
        assert_eq!((mesh.vertices[1], mesh.triangles[0]), (DVec3::X, [0, 1, 2]));
    }

    #[test]
    fn a_face_may_be_no_convex_polygon_and_come_before_its_vertices() {
        let mesh = mesh("f 1 2 3 4\nv 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\n");
        assert!(mesh.triangles.iter().all(|t| t.contains(&1) && t.contains(&3)), "{:?}", mesh.triangles);
    }

    #[test]
    fn faults_name_their_line() {
        let text = "1e".to_owned();
        assert_eq!(flaw("v 0 0 0\n\nv 1e 0 0"), Flaw::at_line(3, Malformation::Number { text }));
        assert_eq!(flaw("v 0 0"), Flaw::at_line(1, Malformation::LineLength { too_many: false }));
        for index in ["0", "-2", "x", "4294967297", "-9223372036854775808", "/1/1"] {
            let text = index.to_owned();
            assert_eq!(
                flaw(&format!("v 0 0 0\nf 1 1 {index}")),
                Flaw::at_line(2, Malformation::Index { text })
            );
        }
    }
}
