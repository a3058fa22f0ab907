//! Writing OBJ, and MTL and PNG beside it for materials.

use super::mtl;
use crate::geometry::assert_appearance_fits;
use crate::image::write_png;
use crate::own::COMMENT;
use crate::placement::Placement;
use crate::{AtomicFile, WriteError, check_frame_output};
use isv_volume::{Appearance, Image, TriangleMesh, Wrap};
use std::collections::HashMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Writes a mesh, with its vertex colours but without its materials, which need files of their own. Numbers have as many digits as
/// identify them, as `f32` unless the placement needs `f64`.
pub(crate) fn write(out: impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    write_mesh(out, mesh, placement, None)
}

/// Writes a mesh as an OBJ file, its materials as an MTL file and their images as PNG files beside it, named after it. Each file
/// appears whole or not at all, the OBJ file last.
///
/// Files beside it are overwritten only if isv has written them. MTL cannot say that a texture is mirrored where it repeats.
///
/// # Errors
/// [`WriteError`], naming the file.
///
/// # Panics
/// If the mesh has an appearance that does not fit it.
pub fn write_obj_files(path: &Path, mesh: &TriangleMesh, placement: &Placement) -> Result<(), WriteError> {
    assert_appearance_fits(mesh);
    let materials = mesh.appearance.as_deref().filter(|appearance| !appearance.materials.is_empty());
    let mut file = AtomicFile::create(path)?;
    let Some(appearance) = materials else {
        write(&mut file, mesh, placement).map_err(|cause| WriteError::new(path, cause))?;
        return file.commit();
    };
    let stem = stem_of(path).map_err(|cause| WriteError::new(path, cause))?;
    let library = format!("{stem}.mtl");
    let images = Images::of(appearance, &stem);
    let mut beside = Vec::new();
    for (image, name) in &images.list {
        beside.push(write_beside(path, name, |out| write_png(out, image))?);
    }
    beside.push(write_beside(path, &library, |out| write_library(out, appearance, &images))?);
    write_mesh(&mut file, mesh, placement, Some((appearance, &library)))
        .map_err(|cause| WriteError::new(path, cause))?;
    beside.into_iter().try_for_each(AtomicFile::commit)?;
    file.commit()
}

/// The name of a file without its ending, as it can stand in another file.
fn stem_of(path: &Path) -> io::Result<String> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let stem = stem.filter(|stem| !stem.chars().any(char::is_control) && stem.trim() == *stem);
    let refused =
        "materials need a name that can stand in a text: no control characters, no blanks at its ends";
    stem.map(str::to_owned).ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, refused))
}

/// A file beside another one, written but without its name yet.
fn write_beside(
    path: &Path,
    name: &str,
    write: impl FnOnce(&mut AtomicFile) -> io::Result<()>,
) -> Result<AtomicFile, WriteError> {
    let path: PathBuf = path.with_file_name(name);
    let refused = |error: crate::OutputError| io::Error::new(io::ErrorKind::AlreadyExists, error.to_string());
    check_frame_output(&path).map_err(|error| WriteError::new(&path, refused(error)))?;
    let mut file = AtomicFile::create(&path)?;
    write(&mut file).map_err(|cause| WriteError::new(&path, cause))?;
    Ok(file)
}

/// The images of materials, each once, and the names of their files.
struct Images<'a> {
    list: Vec<(&'a Arc<Image>, String)>,
}

impl<'a> Images<'a> {
    fn of(appearance: &'a Appearance, stem: &str) -> Self {
        let mut images = Self { list: Vec::new() };
        for image in appearance.materials.iter().filter_map(|material| material.texture.as_ref()) {
            if images.name(image).is_none() {
                let name = match images.list.len() {
                    0 => format!("{stem}.png"),
                    number => format!("{stem}_{number}.png"),
                };
                images.list.push((image, name));
            }
        }
        images
    }

    fn name(&self, image: &Arc<Image>) -> Option<&str> {
        self.list.iter().find(|(other, _)| Arc::ptr_eq(other, image)).map(|(_, name)| name.as_str())
    }
}

fn write_library(out: &mut impl Write, appearance: &Appearance, images: &Images) -> io::Result<()> {
    writeln!(out, "# {COMMENT}")?;
    for (index, material) in appearance.materials.iter().enumerate() {
        let [red, green, blue] = material.base_colour;
        writeln!(out, "newmtl material_{index}\nKd {red} {green} {blue}")?;
        if let Some(name) = material.texture.as_ref().and_then(|image| images.name(image)) {
            let clamp = if material.wrap == [Wrap::Clamp; 2] { "-clamp on " } else { "" };
            // A name that begins with a minus would be an option.
            let here = if name.starts_with('-') { "./" } else { "" };
            writeln!(out, "map_Kd {clamp}{here}{name}")?;
        }
    }
    Ok(())
}

/// Writes the OBJ file, with its materials and texture coordinates if there is a library for them.
fn write_mesh(
    mut out: impl Write,
    mesh: &TriangleMesh,
    placement: &Placement,
    library: Option<(&Appearance, &str)>,
) -> io::Result<()> {
    writeln!(out, "# {COMMENT}")?;
    if let Some((_, library)) = library {
        writeln!(out, "mtllib {library}")?;
    }
    write_vertices(&mut out, mesh, placement)?;
    for normal in &mesh.normals {
        let [x, y, z] = normal.as_vec3().to_array();
        writeln!(out, "vn {x} {y} {z}")?;
    }
    let (mut numbers, mut material) = (HashMap::new(), None);
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let mut coordinates = None;
        if let Some((appearance, _)) = library {
            let wanted = appearance.face_materials.get(face).copied().unwrap_or(0);
            if material.replace(wanted) != Some(wanted) {
                writeln!(out, "usemtl material_{wanted}")?;
            }
            coordinates = number_coordinates(&mut out, &mut numbers, appearance, face)?;
        }
        write_face(&mut out, triangle, coordinates, !mesh.normals.is_empty())?;
    }
    Ok(())
}

fn write_vertices(out: &mut impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    let double = placement.needs_double(&mesh.vertices);
    let colours = mesh.appearance.as_ref().map_or(&[][..], |appearance| &appearance.vertex_colours);
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        let vertex = placement.place(*vertex);
        if double {
            write!(out, "v {} {} {}", vertex.x, vertex.y, vertex.z)?;
        } else {
            let [x, y, z] = vertex.as_vec3().to_array();
            write!(out, "v {x} {y} {z}")?;
        }
        if let Some(colour) = colours.get(index) {
            let [red, green, blue] = colour.map(|value| f32::from(value) / 255.0);
            write!(out, " {red} {green} {blue}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Numbers of the texture coordinates of a face's corners, from 1; those that were not written before are written. `None` without any.
fn number_coordinates(
    out: &mut impl Write,
    numbers: &mut HashMap<[u32; 2], u64>,
    appearance: &Appearance,
    face: usize,
) -> io::Result<Option<[u64; 3]>> {
    let corners = appearance.texture_coordinates.get(face);
    let Some(corners) = corners.filter(|corners| corners.as_flattened().iter().all(|c| c.is_finite())) else {
        return Ok(None);
    };
    let mut found = [0; 3];
    for (number, corner) in found.iter_mut().zip(corners) {
        let next = numbers.len() as u64 + 1;
        *number = *numbers.entry(corner.map(f32::to_bits)).or_insert(next);
        if *number == next {
            let [u, v] = mtl::upside_down(*corner);
            writeln!(out, "vt {u} {v}")?;
        }
    }
    Ok(Some(found))
}

fn write_face(
    out: &mut impl Write,
    triangle: &[u32; 3],
    coordinates: Option<[u64; 3]>,
    normals: bool,
) -> io::Result<()> {
    write!(out, "f")?;
    for (corner, vertex) in triangle.iter().enumerate() {
        let vertex = u64::from(*vertex) + 1;
        match (coordinates.map(|numbers| numbers[corner]), normals) {
            (None, false) => write!(out, " {vertex}")?,
            (None, true) => write!(out, " {vertex}//{vertex}")?,
            (Some(number), false) => write!(out, " {vertex}/{number}")?,
            (Some(number), true) => write!(out, " {vertex}/{number}/{vertex}")?,
        }
    }
    writeln!(out)
}
