//! Mesh files of any format, by extension.

use crate::error::Flaw;
use crate::{AtomicFile, Format, ReadError, Unit, WriteError, obj, ply};
use isv_volume::TriangleMesh;
use std::io::{self, Write};
use std::path::Path;

/// Largest magnitude of a coordinate, in metres: 78 times the diameter of the Earth, where `f64` still tells tenths of
/// a micrometre apart. Beyond it lie damaged files and wrong units.
pub const MAX_COORDINATE_M: f64 = 1e9;

/// Reads a mesh; the extension, `.ply` or `.obj` in either case, decides how. Coordinates in `unit` become metres.
///
/// Polygons are split into fans of triangles. The mesh passes [`TriangleMesh::validate`]; normals are kept only where
/// the file gives every vertex a usable one.
///
/// # Errors
/// See [`ReadError`]; each names the file.
pub fn read_mesh(path: &Path, unit: Unit) -> Result<TriangleMesh, ReadError> {
    // Asked before the file is opened, so that a wrong kind of file is refused by its name however large it is.
    Format::of_path(path).ok_or_else(|| ReadError::UnsupportedExtension { path: path.to_owned() })?;
    let bytes = std::fs::read(path).map_err(|cause| ReadError::Io { path: path.to_owned(), cause })?;
    parse_mesh(path, &bytes, unit)
}

/// As [`read_mesh`], from bytes; `path` picks the format and names the mesh in errors.
///
/// # Errors
/// As [`read_mesh`], without [`ReadError::Io`].
pub fn parse_mesh(path: &Path, bytes: &[u8], unit: Unit) -> Result<TriangleMesh, ReadError> {
    let parse: fn(&[u8]) -> Result<TriangleMesh, Flaw> = match Format::of_path(path) {
        Some(Format::Ply) => ply::parse,
        Some(Format::Obj) => obj::parse,
        None => return Err(ReadError::UnsupportedExtension { path: path.to_owned() }),
    };
    let mut mesh = parse(bytes).map_err(|flaw| flaw.in_file(path))?;
    mesh.vertices.iter_mut().for_each(|v| *v *= unit.metres());
    mesh.validate().map_err(|cause| ReadError::Mesh { path: path.to_owned(), cause })?;
    if let Some(vertex) = mesh.vertices.iter().position(|v| v.abs().max_element() > MAX_COORDINATE_M) {
        let metres = mesh.vertices[vertex].abs().max_element();
        return Err(ReadError::OutOfRange { path: path.to_owned(), vertex, metres });
    }
    Ok(mesh)
}

/// Writes a mesh to a file, in metres; the file appears whole or not at all. Same mesh, same bytes.
///
/// # Errors
/// [`WriteError`], naming the file.
///
/// # Panics
/// As [`write_mesh_to`].
pub fn write_mesh(path: &Path, mesh: &TriangleMesh, format: Format) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    write_mesh_to(&mut file, mesh, format).map_err(|cause| WriteError::new(path, cause))?;
    file.commit()
}

/// Writes a mesh to anything that takes bytes, in many small pieces: give it a buffer.
///
/// Coordinates are rounded to `f32`. Normals are written when the mesh has them.
///
/// # Errors
/// Whatever `out` says.
///
/// # Panics
/// If the mesh has normals but not one a vertex.
pub fn write_mesh_to(out: impl Write, mesh: &TriangleMesh, format: Format) -> io::Result<()> {
    assert!(
        mesh.normals.is_empty() || mesh.normals.len() == mesh.vertices.len(),
        "one normal a vertex or none"
    );
    match format {
        Format::Ply => ply::write(out, mesh),
        Format::Obj => obj::write(out, mesh),
    }
}
