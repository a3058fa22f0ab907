//! Writing PLY: binary little-endian, `float` coordinates, `uchar int` face lists; what every reader takes.

use crate::own::COMMENT;
use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};
use std::io::{self, Write};

/// Writes a mesh. Coordinates are rounded to `f32`; normals are written when the mesh has them.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    write_vertex_header(&mut out, mesh.vertices.len(), !mesh.normals.is_empty())?;
    let faces = mesh.triangles.len();
    writeln!(out, "element face {faces}\nproperty list uchar int vertex_indices\nend_header")?;
    write_vertices(&mut out, &mesh.vertices, &mesh.normals)?;
    write_records(&mut out, faces, |face| {
        let mut record = [0; 13];
        record[0] = 3;
        put_words(&mut record[1..], mesh.triangles[face].map(u32::to_le_bytes));
        record
    })
}

/// Writes points: vertices without a face element. Coordinates and normals as with meshes.
pub(crate) fn write_points(mut out: impl Write, points: &PointCloud) -> io::Result<()> {
    write_vertex_header(&mut out, points.positions.len(), !points.normals.is_empty())?;
    writeln!(out, "end_header")?;
    write_vertices(&mut out, &points.positions, &points.normals)
}

fn write_vertex_header(out: &mut impl Write, vertices: usize, normals: bool) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment {COMMENT}\nelement vertex {vertices}")?;
    let names: &[&str] = if normals { &["x", "y", "z", "nx", "ny", "nz"] } else { &["x", "y", "z"] };
    for name in names {
        writeln!(out, "property float {name}")?;
    }
    Ok(())
}

fn write_vertices(out: &mut impl Write, positions: &[DVec3], normals: &[DVec3]) -> io::Result<()> {
    if normals.is_empty() {
        return write_records(out, positions.len(), |vertex| {
            let mut record = [0; 12];
            put_words(&mut record, words(positions[vertex]));
            record
        });
    }
    write_records(out, positions.len(), |vertex| {
        let mut record = [0; 24];
        put_words(&mut record[..12], words(positions[vertex]));
        put_words(&mut record[12..], words(normals[vertex]));
        record
    })
}

/// The components of a vector as they stand in the file.
fn words(vector: DVec3) -> [[u8; 4]; 3] {
    vector.as_vec3().to_array().map(f32::to_le_bytes)
}

fn put_words(place: &mut [u8], words: [[u8; 4]; 3]) {
    place.copy_from_slice(words.as_flattened());
}

/// Writes so many records of `BYTES` bytes, in large pieces.
fn write_records<const BYTES: usize>(
    out: &mut impl Write,
    count: usize,
    record: impl Fn(usize) -> [u8; BYTES],
) -> io::Result<()> {
    const AT_A_TIME: usize = 1 << 14;
    let mut buffer = vec![[0; BYTES]; count.min(AT_A_TIME)];
    for start in (0..count).step_by(AT_A_TIME) {
        let piece = &mut buffer[..(count - start).min(AT_A_TIME)];
        for (number, place) in (start..).zip(piece.iter_mut()) {
            *place = record(number);
        }
        out.write_all(piece.as_flattened())?;
    }
    Ok(())
}
