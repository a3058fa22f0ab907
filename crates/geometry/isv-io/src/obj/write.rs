//! Writing OBJ, and MTL and PNG beside it for a texture.

use crate::own::COMMENT;
use crate::placement::Placement;
use isv_volume::TriangleMesh;
use std::io::{self, Write};

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

