//! Writing PLY: binary little-endian, `float` coordinates, `uchar int` face lists; what every reader takes.

use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};
use std::io::{self, Write};

/// Writes a mesh. Coordinates are rounded to `f32`; normals are written when the mesh has them.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    write_vertex_header(&mut out, mesh.vertices.len(), !mesh.normals.is_empty())?;
    let faces = mesh.triangles.len();
    writeln!(out, "element face {faces}\nproperty list uchar int vertex_indices\nend_header")?;
    write_vertices(&mut out, &mesh.vertices, &mesh.normals)?;
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        for vertex in triangle {
            out.write_all(&vertex.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Writes points: vertices without a face element. Coordinates and normals as with meshes.
pub(crate) fn write_points(mut out: impl Write, points: &PointCloud) -> io::Result<()> {
    write_vertex_header(&mut out, points.positions.len(), !points.normals.is_empty())?;
    writeln!(out, "end_header")?;
    write_vertices(&mut out, &points.positions, &points.normals)
}

fn write_vertex_header(out: &mut impl Write, vertices: usize, normals: bool) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}")?;
    let names: &[&str] = if normals { &["x", "y", "z", "nx", "ny", "nz"] } else { &["x", "y", "z"] };
    for name in names {
        writeln!(out, "property float {name}")?;
    }
    Ok(())
}

fn write_vertices(out: &mut impl Write, positions: &[DVec3], normals: &[DVec3]) -> io::Result<()> {
    for (index, position) in positions.iter().enumerate() {
        for vector in [Some(position), normals.get(index)].into_iter().flatten() {
            for component in vector.as_vec3().to_array() {
                out.write_all(&component.to_le_bytes())?;
            }
        }
    }
    Ok(())
}
