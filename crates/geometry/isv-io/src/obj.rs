//! Wavefront OBJ, after the "Advanced Visualizer" appendix B1: the `v`, `f` and `p` records, and for colours `vt`, `usemtl` and
//! `mtllib`; all others are ignored.
//!
//! `vn` records of meshes are ignored on reading too: OBJ gives normals to the corners of faces, a mesh here to its vertices. Points
//! have the normals of a file that has one a vertex.

mod colours;
pub(crate) mod mtl;
mod write;

use crate::error::{Flaw, Malformation, quote};
use crate::geometry::Geometry;
use crate::linked::Linked;
use crate::materials::prefer_textures;
use crate::polygon::Polygons;
use crate::text::{self, coordinates, parse_word, words};
use colours::Colours;
use glam::DVec3;
use isv_volume::{PointCloud, Rgb, TriangleMesh};
use std::sync::Arc;
pub(crate) use write::write;
pub use write::write_obj_files;

/// Parses an OBJ file in memory: points if it has vertices but neither faces nor lines, else a mesh. A file that has no vertices
/// either is an empty mesh if it has nothing but comments and records of OBJ. Colours are read if linked files are given.
pub(crate) fn parse(bytes: &[u8], linked: Option<&mut Linked>) -> Result<Geometry, Flaw> {
    let bytes = &text::decode(bytes);
    let mut file = File { colours: linked.is_some().then(Colours::new), ..File::default() };
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
    file.finish(linked)
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
    /// Colours, if they are asked for.
    colours: Option<Colours>,
    /// Vertices of a face and the numbers of its texture coordinates; scratch space.
    polygon: Vec<u32>,
    coordinates: Vec<u32>,
}

/// Keywords of OBJ that are neither vertices nor elements, and those that programs have added.
const PASSED_OVER: [&str; 16] = [
    "vp",
    "o",
    "g",
    "s",
    "mg",
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
    fn record(&mut self, whole_line: &[u8], number: usize) -> Result<(), Malformation> {
        let line = text::without_comment(whole_line);
        let mut words = words(line);
        match words.next() {
            None => {}
            // A weight or a colour may follow.
            Some(b"v") => {
                self.vertices.push(coordinates(&mut words)?);
                if let Some(colours) = &mut self.colours {
                    colours.vertex(self.vertices.len() - 1, words);
                }
            }
            Some(b"vt") => {
                if let Some(colours) = &mut self.colours {
                    colours.coordinate(words);
                }
            }
            Some(b"usemtl" | b"mtllib") => {
                if let Some(colours) = &mut self.colours {
                    colours.names(whole_line);
                }
            }
            Some(b"vn") => self.normals.push(coordinates(&mut words).unwrap_or_default().normalize_or_zero()),
            Some(b"f" | b"fo") => {
                self.has_elements = true;
                self.face(words)?;
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

    fn face<'a>(&mut self, corners: impl Iterator<Item = &'a [u8]>) -> Result<(), Malformation> {
        self.polygon.clear();
        self.coordinates.clear();
        for corner in corners {
            self.polygon.push(vertex_of_corner(corner, self.vertices.len())?);
            self.coordinates
                .extend(self.colours.as_ref().map(|colours| colours.coordinate_of_corner(corner)));
        }
        match &mut self.colours {
            Some(colours) => {
                self.polygons.push_textured(&self.polygon, &self.coordinates);
                colours.paint(self.polygons.triangle_count());
            }
            None => self.polygons.push(&self.polygon),
        }
        Ok(())
    }

    fn finish(self, linked: Option<&mut Linked>) -> Result<Geometry, Flaw> {
        let Self { vertices, normals, polygons, points, has_elements, unknown, colours, .. } = self;
        if vertices.is_empty()
            && !has_elements
            && let Some((line, text)) = unknown
        {
            return Err(Flaw::at_line(line, Malformation::Keyword { format: "OBJ", text }));
        }
        if has_elements || vertices.is_empty() {
            let (triangles, corners) = polygons.into_textured(&vertices)?;
            let appearance = match (colours, linked) {
                (Some(colours), Some(linked)) => colours.finish(vertices.len(), &corners, linked)?,
                _ => None,
            };
            let appearance = appearance.map(|mut appearance| {
                prefer_textures(&mut appearance, &triangles);
                Arc::new(appearance)
            });
            return Ok(Geometry::Mesh(TriangleMesh { vertices, normals: Vec::new(), triangles, appearance }));
        }
        let colours = colours.map(|colours| colours.of_vertices(vertices.len())).unwrap_or_default();
        let known = normals.len() == vertices.len();
        let normals = if known { normals } else { Vec::new() };
        if points.is_empty() {
            return Ok(Geometry::Points(cloud(vertices, normals, colours)));
        }
        if let Some(index) = points.iter().find(|index| **index as usize >= vertices.len()) {
            let text = (u64::from(*index) + 1).to_string();
            return Err(Flaw::in_object("point", 0, Malformation::Index { text }));
        }
        Ok(Geometry::Points(cloud(
            named(&points, &vertices),
            named(&points, &normals),
            named(&points, &colours),
        )))
    }
}

/// The entries of a list that points name; none of an empty list.
fn named<T: Copy>(points: &[u32], list: &[T]) -> Vec<T> {
    points.iter().filter_map(|index| list.get(*index as usize).copied()).collect()
}

fn cloud(positions: Vec<DVec3>, normals: Vec<DVec3>, colours: Vec<Rgb>) -> PointCloud {
    PointCloud { positions, normals, colours, ..PointCloud::default() }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn flaw(text: &str) -> Flaw {
        parse(text.as_bytes(), None).unwrap_err()
    }

    fn mesh(text: &str) -> TriangleMesh {
        match parse(text.as_bytes(), None).unwrap() {
            Geometry::Mesh(mesh) => mesh,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn vertices_without_elements_are_points_and_p_names_some_of_them() {
        let points = |text: &str| match parse(text.as_bytes(), None).unwrap() {
            Geometry::Points(points) => points.positions,
            other => panic!("{other:?}"),
        };
        assert_eq!(points("v 1 0 0\nv 0 1 0\n"), [DVec3::X, DVec3::Y]);
        assert_eq!(points("v 1 0 0\nv 0 1 0\np -1 1\n"), [DVec3::Y, DVec3::X]);
        assert!(parse(b"v 1 0 0\np 2\n", None).is_err());
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
