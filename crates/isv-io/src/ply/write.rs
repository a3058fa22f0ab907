//! Writing PLY: binary little-endian, `float` coordinates, `uchar int` face lists; what every reader takes.

use isv_volume::TriangleMesh;
use std::io::{self, Write};

/// Writes a mesh. Coordinates are rounded to `f32`; normals are written when the mesh has them.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    write_header(&mut out, mesh)?;
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        let normal = mesh.normals.get(index);
        for vector in [Some(vertex), normal].into_iter().flatten() {
            for component in vector.as_vec3().to_array() {
                out.write_all(&component.to_le_bytes())?;
            }
        }
    }
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        for vertex in triangle {
            out.write_all(&vertex.to_le_bytes())?;
        }
    }
    Ok(())
}

fn write_header(out: &mut impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertices.len())?;
    let names: &[&str] =
        if mesh.normals.is_empty() { &["x", "y", "z"] } else { &["x", "y", "z", "nx", "ny", "nz"] };
    for name in names {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", mesh.triangles.len())
}
