//! Writing PLY: binary little-endian, `float` coordinates, `uchar int` face lists; what every reader takes.

use crate::Placement;
use crate::own::COMMENT;
use glam::DVec3;
use isv_volume::{PointCloud, Rgb, TriangleMesh};
use std::io::{self, Write};

/// Writes a mesh. Coordinates are `float`, or `double` where the placement needs it; normals and vertex colours are written when the
/// mesh has them.
pub(crate) fn write(mut out: impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    let colours = mesh.appearance.as_ref().map_or(&[][..], |appearance| &appearance.vertex_colours);
    let vertices = Vertices::new(&mesh.vertices, &mesh.normals, colours, placement);
    vertices.write_header(&mut out)?;
    let faces = mesh.triangles.len();
    writeln!(out, "element face {faces}\nproperty list uchar int vertex_indices\nend_header")?;
    vertices.write(&mut out)?;
    write_records(&mut out, faces, |face| {
        let mut record = [0; 13];
        record[0] = 3;
        put_words(&mut record[1..], mesh.triangles[face].map(u32::to_le_bytes));
        record
    })
}

/// Writes points: vertices without a face element. Coordinates, normals and colours as with meshes.
pub(crate) fn write_points(
    mut out: impl Write,
    points: &PointCloud,
    placement: &Placement,
) -> io::Result<()> {
    let vertices = Vertices::new(&points.positions, &points.normals, &points.colours, placement);
    vertices.write_header(&mut out)?;
    writeln!(out, "end_header")?;
    vertices.write(&mut out)
}

/// The element `vertex`.
struct Vertices<'a> {
    positions: &'a [DVec3],
    /// Normals as `float`; none or one a position.
    normals: &'a [DVec3],
    /// Colours as `uchar`; none or one a position.
    colours: &'a [Rgb],
    placement: &'a Placement,
    /// Whether coordinates are `double`.
    double: bool,
}

impl<'a> Vertices<'a> {
    fn new(
        positions: &'a [DVec3],
        normals: &'a [DVec3],
        colours: &'a [Rgb],
        placement: &'a Placement,
    ) -> Self {
        Self { positions, normals, colours, placement, double: placement.needs_double(positions) }
    }

    fn write_header(&self, out: &mut impl Write) -> io::Result<()> {
        let count = self.positions.len();
        writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment {COMMENT}\nelement vertex {count}")?;
        let kind = if self.double { "double" } else { "float" };
        for name in ["x", "y", "z"] {
            writeln!(out, "property {kind} {name}")?;
        }
        if !self.normals.is_empty() {
            for name in ["nx", "ny", "nz"] {
                writeln!(out, "property float {name}")?;
            }
        }
        if !self.colours.is_empty() {
            for name in ["red", "green", "blue"] {
                writeln!(out, "property uchar {name}")?;
            }
        }
        Ok(())
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let count = self.positions.len();
        let vectors = 1 + usize::from(self.double) + usize::from(!self.normals.is_empty());
        match (vectors, self.colours.is_empty()) {
            (1, true) => write_records::<12>(out, count, |vertex| self.record(vertex)),
            (2, true) => write_records::<24>(out, count, |vertex| self.record(vertex)),
            (_, true) => write_records::<36>(out, count, |vertex| self.record(vertex)),
            (1, false) => write_records::<15>(out, count, |vertex| self.record(vertex)),
            (2, false) => write_records::<27>(out, count, |vertex| self.record(vertex)),
            (_, false) => write_records::<39>(out, count, |vertex| self.record(vertex)),
        }
    }

    /// A vertex: its position, and its normal and its colour in what room is left.
    fn record<const BYTES: usize>(&self, vertex: usize) -> [u8; BYTES] {
        let position = self.placement.place(self.positions[vertex]);
        let mut record = [0; BYTES];
        let (place, mut rest) = record.split_at_mut(if self.double { 24 } else { 12 });
        match self.double {
            true => put_words(place, position.to_array().map(f64::to_le_bytes)),
            false => put_words(place, words(position)),
        }
        if let Some(normal) = self.normals.get(vertex) {
            let (place, after) = rest.split_at_mut(12);
            put_words(place, words(*normal));
            rest = after;
        }
        if let Some(colour) = self.colours.get(vertex) {
            rest.copy_from_slice(colour);
        }
        record
    }
}

/// The components of a vector as they stand in the file.
fn words(vector: DVec3) -> [[u8; 4]; 3] {
    vector.as_vec3().to_array().map(f32::to_le_bytes)
}

fn put_words<const BYTES: usize>(place: &mut [u8], words: [[u8; BYTES]; 3]) {
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
