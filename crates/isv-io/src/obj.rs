//! Wavefront OBJ, after the "Advanced Visualizer" appendix B1: the `v` and `f` records; all others are ignored.
//!
//! `vn` records are ignored on reading too: OBJ gives normals to the corners of faces, a mesh here to its vertices.

use crate::error::{Flaw, Malformation, quote};
use crate::own::COMMENT;
use crate::placement::Placement;
use crate::polygon::Polygons;
use crate::words::{coordinates, parse_word, words};
use glam::DVec3;
use isv_volume::TriangleMesh;
use std::io::{self, Write};

/// Parses an OBJ file in memory.
pub(crate) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Flaw> {
    let mut mesh = TriangleMesh::default();
    let mut polygons = Polygons::default();
    let mut polygon = Vec::new();
    let mut lines = bytes.split(|b| *b == b'\n').enumerate();
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
        parse_record(&joined, &mut mesh.vertices, &mut polygons, &mut polygon)
            .map_err(|why| Flaw::at_line(index + 1, why))?;
    }
    mesh.triangles = polygons.into_triangles(&mesh.vertices)?;
    Ok(mesh)
}

/// Parses a line; `polygon` is scratch space.
fn parse_record(
    line: &[u8],
    vertices: &mut Vec<DVec3>,
    polygons: &mut Polygons,
    polygon: &mut Vec<u32>,
) -> Result<(), Malformation> {
    let line = line.split(|b| *b == b'#').next().unwrap_or_default();
    let mut words = words(line);
    match words.next() {
        // A weight or a colour may follow.
        Some(b"v") => vertices.push(coordinates(&mut words)?),
        Some(b"f") => {
            polygon.clear();
            for corner in words {
                polygon.push(vertex_of_corner(corner, vertices.len())?);
            }
            polygons.push(polygon);
        }
        _ => {}
    }
    Ok(())
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

    #[test]
    fn corners_may_be_negative_and_carry_texture_and_normal() {
        let text = "# head\nmtllib x.mtl\nv 0 0 0 1\nv 1 0 0 .5 .5 .5\r\nv 1 1 0\nvn 0 0 1\n\
                    f 1/9/9 2//9 3/9\nv 0 1 0 # fourth\nf -4 -3 -2 -1\n";
        let mesh = parse(text.as_bytes()).unwrap();
        assert_eq!(mesh.vertices[3], DVec3::new(0.0, 1.0, 0.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn a_backslash_continues_a_line() {
        let mesh = parse(b"v 0 0 0\nv 1 0 \\\r\n 0\nv 1 1 0\nf 1 2\\\n3\n\\").unwrap();
        assert_eq!((mesh.vertices[1], mesh.triangles[0]), (DVec3::X, [0, 1, 2]));
    }

    #[test]
    fn a_face_may_be_no_convex_polygon_and_come_before_its_vertices() {
        let mesh = parse(b"f 1 2 3 4\nv 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\n").unwrap();
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
