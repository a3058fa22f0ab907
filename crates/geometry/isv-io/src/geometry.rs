//! Files of meshes or points, of any format, by extension.

use crate::error::Flaw;
use crate::linked::Linked;
use crate::regular_file;
use crate::{
    AtomicFile, Colours, Format, Placement, ReadError, ReadOptions, Unit, WriteError, e57, gltf, las, obj,
    off, pcd, ply, stl, xyz,
};
use glam::{DMat3, DVec3};
use isv_volume::{PointCloud, TriangleMesh};
use std::io::{self, Write};
use std::path::Path;

/// Largest magnitude of a coordinate, in metres: 78 times the diameter of the Earth, where `f64` still tells tenths of
/// a micrometre apart. Beyond it lie damaged files and wrong units.
pub const MAX_COORDINATE_M: f64 = 1e9;

/// Treatment of points that are nowhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InvalidPoints {
    /// A point that is not finite refuses its file.
    #[default]
    Refuse,
    /// Points that are not finite or lie exactly at (0, 0, 0) are dropped: many cameras write these for "no reading".
    Drop,
}

/// What a file of geometry holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Triangles.
    Mesh(TriangleMesh),
    /// Points alone.
    Points(PointCloud),
}

impl Geometry {
    /// Whether nothing is there: nobody was on the stage.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.triangles.is_empty(),
            Self::Points(points) => points.positions.is_empty(),
        }
    }

    /// Smallest and largest corner of the bounding box, in metres; `None` if nothing is there.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        match self {
            Self::Mesh(mesh) => mesh.bounds(),
            Self::Points(points) => points.bounds(),
        }
    }

    /// The geometry seen from another origin, in metres.
    #[must_use]
    pub fn relative_to(mut self, origin_m: [f64; 3]) -> Self {
        let origin = DVec3::from(origin_m);
        self.positions_mut().iter_mut().for_each(|v| *v -= origin);
        self.viewpoints_mut().for_each(|viewpoint| *viewpoint -= origin);
        self
    }

    /// The geometry turned about the origin by a rotation: positions, normals and viewpoints.
    #[must_use]
    pub fn turned(mut self, rotation: DMat3) -> Self {
        self.viewpoints_mut().for_each(|viewpoint| *viewpoint = rotation * *viewpoint);
        let (positions, normals) = match &mut self {
            Self::Mesh(mesh) => (&mut mesh.vertices, &mut mesh.normals),
            Self::Points(points) => (&mut points.positions, &mut points.normals),
        };
        positions.iter_mut().chain(normals).for_each(|v| *v = rotation * *v);
        self
    }

    /// Positions of vertices or points.
    fn positions_mut(&mut self) -> &mut [DVec3] {
        match self {
            Self::Mesh(mesh) => &mut mesh.vertices,
            Self::Points(points) => &mut points.positions,
        }
    }

    /// Places that points were seen from.
    fn viewpoints_mut(&mut self) -> impl Iterator<Item = &mut DVec3> {
        let cloud = match self {
            Self::Mesh(_) => None,
            Self::Points(points) => Some(points),
        };
        cloud.into_iter().flat_map(|cloud| {
            cloud.viewpoint.iter_mut().chain(cloud.scans.iter_mut().map(|scan| &mut scan.viewpoint))
        })
    }

    /// The geometry in metres, from coordinates in `unit`.
    pub(crate) fn in_metres(mut self, unit: Unit) -> Self {
        self.positions_mut().iter_mut().for_each(|v| *v *= unit.metres());
        self.viewpoints_mut().for_each(|viewpoint| *viewpoint *= unit.metres());
        self
    }

    /// The geometry in metres, as [`read_geometry`] promises it.
    pub(crate) fn checked(self, path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let mut geometry = self.in_metres(options.unit);
        match (&mut geometry, options.invalid_points) {
            (Self::Mesh(mesh), _) => drop_stray_vertices(mesh),
            (Self::Points(points), InvalidPoints::Drop) => {
                points.retain(|position| position.is_finite() && position != DVec3::ZERO);
            }
            (Self::Points(_), InvalidPoints::Refuse) => {}
        }
        geometry.validate(path)?;
        Ok(geometry)
    }

    /// Checks what every consumer relies on. A frame that is empty passes: it shows nobody.
    fn validate(&self, path: &Path) -> Result<(), ReadError> {
        let has_vertices = match self {
            Self::Mesh(mesh) => !mesh.vertices.is_empty(),
            Self::Points(points) => !points.positions.is_empty(),
        };
        if self.is_empty() && !has_vertices {
            return Ok(());
        }
        let path = || path.to_owned();
        let positions = match self {
            Self::Mesh(mesh) => {
                mesh.validate().map_err(|cause| ReadError::Mesh { path: path(), cause })?;
                &mesh.vertices
            }
            Self::Points(points) => {
                points.validate().map_err(|cause| ReadError::Points { path: path(), cause })?;
                &points.positions
            }
        };
        match positions.iter().position(|v| v.abs().max_element() > MAX_COORDINATE_M) {
            Some(vertex) => {
                let metres = positions[vertex].abs().max_element();
                Err(ReadError::OutOfRange { path: path(), vertex, metres })
            }
            None => Ok(()),
        }
    }
}

/// Moves vertices that no triangle uses and that are nowhere to the origin. Nothing is seen of them. No vertex loses its number, so the
/// appearance stays as it is.
fn drop_stray_vertices(mesh: &mut TriangleMesh) {
    let is_nowhere = |v: &DVec3| !v.is_finite() || v.abs().max_element() > MAX_COORDINATE_M;
    if !mesh.vertices.iter().any(is_nowhere) {
        return;
    }
    let mut used = vec![false; mesh.vertices.len()];
    for vertex in mesh.triangles.as_flattened() {
        if let Some(used) = used.get_mut(*vertex as usize) {
            *used = true;
        }
    }
    for (vertex, used) in mesh.vertices.iter_mut().zip(used) {
        if !used && is_nowhere(vertex) {
            *vertex = DVec3::ZERO;
        }
    }
}

/// Reads a mesh or points; the extension, in either case, decides how. Coordinates in `unit` become metres.
///
/// Polygons are split into triangles. An animated file gives its pose at time 0; see [`Animation`](crate::Animation) for
/// the others. What comes back passes [`TriangleMesh::validate`] or
/// [`PointCloud::validate`]; normals of meshes are kept only where the file gives every vertex a usable one.
///
/// # Errors
/// See [`ReadError`]; each names the file.
pub fn read_geometry(path: &Path, unit: Unit) -> Result<Geometry, ReadError> {
    read_geometry_with(path, unit, InvalidPoints::Refuse)
}

/// Reads a mesh or points as [`read_geometry`] does, and drops or refuses invalid points.
///
/// # Errors
/// Errors of [`read_geometry`].
pub fn read_geometry_with(path: &Path, unit: Unit, invalid: InvalidPoints) -> Result<Geometry, ReadError> {
    read_geometry_as(path, &ReadOptions::new(unit).with_invalid_points(invalid))
}

/// Reads a mesh or points as [`read_geometry`] does, with its colours if the options ask for them.
///
/// Material libraries and images lie in the folder of the file or below. A library that is not there gives white materials; an image
/// that is not there or cannot be decoded is an error.
///
/// # Errors
/// Errors of [`read_geometry`]; [`Malformation::Image`](crate::Malformation::Image) names the image.
pub fn read_geometry_as(path: &Path, options: &ReadOptions) -> Result<Geometry, ReadError> {
    // Asked before the file is opened, so that a wrong kind of file is refused by its name however large it is.
    Format::of_path(path).ok_or_else(|| ReadError::UnsupportedExtension { path: path.to_owned() })?;
    if let Some(Format::Glb | Format::Gltf) = Format::of_path(path) {
        return gltf::Animation::open_with(path, options)?.geometry_at(0.0);
    }
    let bytes = regular_file::read(path).map_err(|cause| ReadError::Io { path: path.to_owned(), cause })?;
    parse(path, &bytes, options, Linked::beside(path))
}

/// Reads a mesh or points from bytes; `path` picks the format and names the file in errors. Nothing is read from the disk: a `.gltf` that
/// names buffers in other files is refused.
///
/// # Errors
/// As [`read_geometry`], without [`ReadError::Io`].
pub fn parse_geometry(path: &Path, bytes: &[u8], unit: Unit) -> Result<Geometry, ReadError> {
    parse_geometry_with(path, bytes, unit, InvalidPoints::Refuse)
}

/// Reads a mesh or points from bytes as [`parse_geometry`] does, and drops or refuses invalid points.
///
/// # Errors
/// See [`parse_geometry`].
pub fn parse_geometry_with(
    path: &Path,
    bytes: &[u8],
    unit: Unit,
    invalid: InvalidPoints,
) -> Result<Geometry, ReadError> {
    parse_geometry_as(path, bytes, &ReadOptions::new(unit).with_invalid_points(invalid))
}

/// Reads a mesh or points from bytes as [`parse_geometry`] does, with its colours if the options ask for them. An image in another
/// file is an error; a material library in another file counts as missing.
///
/// # Errors
/// Errors of [`parse_geometry`]; [`Malformation::Image`](crate::Malformation::Image) names the image.
pub fn parse_geometry_as(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Geometry, ReadError> {
    match Format::of_path(path) {
        Some(Format::Glb | Format::Gltf) => {
            gltf::Animation::parse_with(path, bytes, options)?.geometry_at(0.0)
        }
        _ => parse(path, bytes, options, Linked::new(None)),
    }
}

/// Geometry of a file that does not move.
fn parse(
    path: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    mut linked: Linked,
) -> Result<Geometry, ReadError> {
    let linked = (options.colours == Colours::Keep).then_some(&mut linked);
    parse_unchecked(path, bytes, linked)?.checked(path, options)
}

/// Geometry of a file that does not move, in the file's unit. Colours are read if linked files are given.
fn parse_unchecked(path: &Path, bytes: &[u8], linked: Option<&mut Linked>) -> Result<Geometry, ReadError> {
    let keeps = linked.is_some();
    let parsed: Result<Geometry, Flaw> = match Format::of_path(path) {
        Some(Format::Ply) => ply::parse(bytes, linked),
        Some(Format::Obj) => obj::parse(bytes, linked),
        Some(Format::Stl) => stl::parse(bytes).map(Geometry::Mesh),
        Some(Format::Off) => off::parse(bytes, keeps).map(Geometry::Mesh),
        Some(Format::Pcd) => pcd::parse(bytes, keeps).map(Geometry::Points),
        Some(Format::Xyz) => xyz::parse(bytes, keeps).map(Geometry::Points),
        Some(Format::Las | Format::Laz) => las::parse(bytes, keeps).map(Geometry::Points),
        Some(Format::E57) => e57::parse(bytes, keeps).map(Geometry::Points),
        Some(Format::Glb | Format::Gltf) | None => {
            return Err(ReadError::UnsupportedExtension { path: path.to_owned() });
        }
    };
    parsed.map_err(|flaw| flaw.in_file(path))
}

/// Reads a file as [`read_geometry`] does, where only a mesh will do.
///
/// # Errors
/// As [`read_geometry`], and [`ReadError::NotAMesh`].
pub fn read_mesh(path: &Path, unit: Unit) -> Result<TriangleMesh, ReadError> {
    mesh_of(path, read_geometry(path, unit)?)
}

/// Parses a file as [`parse_geometry`] does, where only a mesh will do.
///
/// # Errors
/// As [`parse_geometry`], and [`ReadError::NotAMesh`].
pub fn parse_mesh(path: &Path, bytes: &[u8], unit: Unit) -> Result<TriangleMesh, ReadError> {
    mesh_of(path, parse_geometry(path, bytes, unit)?)
}

fn mesh_of(path: &Path, geometry: Geometry) -> Result<TriangleMesh, ReadError> {
    match geometry {
        Geometry::Mesh(mesh) => Ok(mesh),
        // A PLY file without a vertex does not tell which of the two it is.
        Geometry::Points(points) if points.positions.is_empty() => Ok(TriangleMesh::default()),
        Geometry::Points(_) => Err(ReadError::NotAMesh { path: path.to_owned() }),
    }
}

/// Writes a mesh to a file, in metres; the file appears whole or not at all. Same mesh, same bytes.
///
/// Materials of an OBJ file get files of their own beside it: see [`write_obj_files`](crate::write_obj_files).
///
/// # Errors
/// [`WriteError`], naming the file.
///
/// # Panics
/// As [`write_mesh_to`].
pub fn write_mesh(path: &Path, mesh: &TriangleMesh, format: Format) -> Result<(), WriteError> {
    if format == Format::Obj {
        return obj::write_obj_files(path, mesh, &Placement::default());
    }
    let mut file = AtomicFile::create(path)?;
    write_mesh_to(&mut file, mesh, format).map_err(|cause| WriteError::new(path, cause))?;
    file.commit()
}

/// Writes a mesh to anything that takes bytes, in many small pieces: give it a buffer.
///
/// Coordinates are rounded to `f32`. Normals are written when the mesh has them; STL gives facets their own. PLY, OBJ and GLB keep
/// vertex colours. GLB keeps materials and their images, too.
///
/// # Errors
/// Whatever `out` says; [`io::ErrorKind::Unsupported`] for a format that is [not written](Format::writes_mesh), and others
/// for a mesh that the format cannot hold.
///
/// # Panics
/// If the mesh has normals but not one a vertex, or an appearance that does not fit it.
pub fn write_mesh_to(out: impl Write, mesh: &TriangleMesh, format: Format) -> io::Result<()> {
    write_mesh_placed(out, mesh, format, &Placement::default())
}

/// Writes a mesh as [`write_mesh_to`] does, moved and as exact as a [`Placement`] says.
///
/// # Errors
/// As [`write_mesh_to`].
///
/// # Panics
/// As [`write_mesh_to`].
pub fn write_mesh_placed(
    out: impl Write,
    mesh: &TriangleMesh,
    format: Format,
    placement: &Placement,
) -> io::Result<()> {
    assert!(
        mesh.normals.is_empty() || mesh.normals.len() == mesh.vertices.len(),
        "one normal a vertex or none"
    );
    assert_appearance_fits(mesh);
    match format {
        Format::Ply => ply::write(out, mesh, placement),
        Format::Obj => obj::write(out, mesh, placement),
        Format::Stl => stl::write(out, mesh, placement),
        Format::Glb => gltf::write(out, mesh, placement),
        Format::Off | Format::Gltf | Format::Pcd | Format::Xyz | Format::Las | Format::Laz | Format::E57 => {
            Err(not_written(format, "meshes"))
        }
    }
}

/// Writes points to a file, in metres; the file appears whole or not at all. Same points, same bytes.
///
/// # Errors
/// [`WriteError`], naming the file.
///
/// # Panics
/// As [`write_points_to`].
pub fn write_points(path: &Path, points: &PointCloud, format: Format) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    write_points_to(&mut file, points, format).map_err(|cause| WriteError::new(path, cause))?;
    file.commit()
}

/// Writes points to anything that takes bytes, in many small pieces: give it a buffer.
///
/// Coordinates are rounded to `f32`, except in XYZ, which keeps them as they are. Normals are written when the points
/// have them; an unknown one is zero there too. Colours are written when the points have them. Only PCD keeps the viewpoint.
///
/// # Errors
/// Whatever `out` says; [`io::ErrorKind::Unsupported`] for a format that is [not written](Format::writes_points).
///
/// # Panics
/// If the points have normals or colours but not one each.
pub fn write_points_to(out: impl Write, points: &PointCloud, format: Format) -> io::Result<()> {
    write_points_placed(out, points, format, &Placement::default())
}

/// Writes points as [`write_points_to`] does, moved and as exact as a [`Placement`] says.
///
/// # Errors
/// As [`write_points_to`].
///
/// # Panics
/// As [`write_points_to`].
pub fn write_points_placed(
    out: impl Write,
    points: &PointCloud,
    format: Format,
    placement: &Placement,
) -> io::Result<()> {
    assert!(
        points.normals.is_empty() || points.normals.len() == points.positions.len(),
        "one normal a point or none"
    );
    assert!(
        points.colours.is_empty() || points.colours.len() == points.positions.len(),
        "one colour a point or none"
    );
    match format {
        Format::Ply => ply::write_points(out, points, placement),
        Format::Pcd => pcd::write(out, points, placement),
        Format::Xyz => xyz::write(out, points, placement),
        Format::Obj
        | Format::Stl
        | Format::Off
        | Format::Glb
        | Format::Gltf
        | Format::Las
        | Format::Laz
        | Format::E57 => Err(not_written(format, "points")),
    }
}

/// Panics if a mesh that is to be written has an appearance that does not fit it.
pub(crate) fn assert_appearance_fits(mesh: &TriangleMesh) {
    if let Some(appearance) = &mesh.appearance {
        let fits = appearance.validate(mesh.vertices.len(), mesh.triangles.len());
        assert_eq!(fits, Ok(()), "an appearance fits its mesh");
    }
}

fn not_written(format: Format, what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, format!("{what} cannot be written as {format}"))
}
