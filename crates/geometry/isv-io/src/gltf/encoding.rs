//! How compactly meshes are written.

use glam::{DVec3, Vec3};
use isv_volume::{Rgb, linear_from_srgb};
use meshoptimizer_rs::codec::{
    IndexEncoding, VertexEncoding, encode_filter_oct, encode_index_buffer, encode_vertex_buffer,
};
use meshoptimizer_rs::{Error, Limits, Workspace, optimize_vertex_cache, optimize_vertex_fetch_remap};
use std::io;

/// How a GLB file holds its meshes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum GlbEncoding {
    /// Single-precision positions and normals, which every program reads.
    #[default]
    Plain,
    /// Positions of 16 bits and normals of 8 (`KHR_mesh_quantization`): two thirds of the size. A position is off by at most half a
    /// step, of which the longest side of a frame's bounding box has 65535.
    Quantized,
    /// Quantized, and compressed by meshoptimizer (`EXT_meshopt_compression`): about a quarter of the size. Vertices and triangles
    /// come in another order; vertices that no triangle uses are left out.
    Meshopt,
}

impl GlbEncoding {
    /// The extensions that a reader must know, as JSON.
    pub(super) fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Plain => &[],
            Self::Quantized => &["KHR_mesh_quantization"],
            Self::Meshopt => &["KHR_mesh_quantization", MESHOPT],
        }
    }
}

/// Name of the extension for compressed buffer views.
pub(super) const MESHOPT: &str = "EXT_meshopt_compression";

/// Steps of a position along the longest side of the bounding box.
const STEPS: f64 = u16::MAX as f64;

/// Bits of a component of a normal.
const NORMAL_BITS: u32 = 8;

/// Positions as integers.
#[derive(Debug)]
pub(super) struct Quantized {
    /// With a fourth number that pads them to a multiple of four bytes.
    pub(super) positions: Vec<[u16; 4]>,
}

/// Places of the integers of all pieces of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    /// The position of the integers 0, 0, 0.
    pub(super) origin: DVec3,
    /// Length of a step.
    pub(super) step: f64,
}

impl Lattice {
    /// A lattice as fine as positions allow.
    pub(super) fn around<'a>(positions: impl Iterator<Item = &'a DVec3>) -> Self {
        let bounds = positions.fold(None, |bounds, v| match bounds {
            None => Some((*v, *v)),
            Some((low, high)) => Some((v.min(low), v.max(high))),
        });
        let (origin, high) = bounds.unwrap_or_default();
        let extent = (high - origin).max_element();
        // A scale of 0 would hide the mesh.
        Self { origin, step: if extent > 0.0 { extent / STEPS } else { 1.0 } }
    }
}

impl Quantized {
    /// Rounds positions to the nearest steps.
    pub(super) fn new(vertices: &[DVec3], Lattice { origin, step }: Lattice) -> Self {
        let quantize = |v: &DVec3| {
            let [x, y, z] = ((*v - origin) / step).to_array().map(|steps| steps.round().min(STEPS) as u16);
            [x, y, z, 0]
        };
        Self { positions: vertices.iter().map(quantize).collect() }
    }

    /// Smallest and largest integers.
    pub(super) fn bounds(&self) -> [[u16; 3]; 2] {
        let mut bounds = [[u16::MAX; 3], [0; 3]];
        for position in &self.positions {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(position[axis]);
                bounds[1][axis] = bounds[1][axis].max(position[axis]);
            }
        }
        bounds
    }
}

/// A normal as normalised integers, with a fourth number that pads it.
pub(super) fn quantized_normal(normal: Vec3) -> [i8; 4] {
    let [x, y, z] = normal.to_array().map(|component| (component * 127.0).round() as i8);
    [x, y, z, 0]
}

/// A colour as linear light in normalised integers, with alpha. Every colour comes back.
pub(super) fn linear_colour(colour: Rgb) -> [u16; 4] {
    let light = |value: u8| (f32::from(u16::MAX) * linear_from_srgb(f32::from(value) / 255.0)).round() as u16;
    let [red, green, blue] = colour.map(light);
    [red, green, blue, u16::MAX]
}

/// Triangles in another order, and the vertices that they use: of each, its place among the old ones.
pub(super) struct Remapped {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) vertices: Vec<u32>,
}

/// Orders triangles for neighbours to follow each other, and vertices by their first use, which is what the codecs below are
/// made for.
pub(super) fn in_order(triangles: &[[u32; 3]], count: usize) -> io::Result<Remapped> {
    let mut workspace = workspace();
    let corners = optimize_vertex_cache(triangles.as_flattened(), count, &mut workspace);
    let corners = corners.map_err(failed)?;
    let remap = optimize_vertex_fetch_remap(&corners, count, &mut workspace).map_err(failed)?;
    let mut vertices = vec![0; remap.vertex_count];
    for (vertex, place) in (0..).zip(&remap.remap) {
        if let Some(moved) = vertices.get_mut(*place as usize) {
            *moved = vertex;
        }
    }
    let triangles = corners.as_chunks().0.iter();
    let triangles = triangles.map(|corners: &[u32; 3]| corners.map(|c| remap.remap[c as usize])).collect();
    Ok(Remapped { triangles, vertices })
}

/// Rows of four bytes or more, compressed. Version 0 is what the extension has.
pub(super) fn compress_rows(bytes: &[u8], count: usize, stride: usize) -> io::Result<Vec<u8>> {
    let encoding = VertexEncoding::new(0, 2).map_err(failed)?;
    encode_vertex_buffer(bytes, count, stride, encoding, &mut workspace()).map_err(failed)
}

/// The bytes of normals that the octahedral filter turns into normals again.
pub(super) fn octahedral(normals: &[Vec3]) -> io::Result<Vec<u8>> {
    let rows: Vec<f32> = normals.iter().flat_map(|n| [n.x, n.y, n.z, 0.0]).collect();
    encode_filter_oct(normals.len(), 4, NORMAL_BITS, &rows, &mut workspace()).map_err(failed)
}

/// The corners of triangles, compressed.
pub(super) fn compress_triangles(triangles: &[[u32; 3]]) -> io::Result<Vec<u8>> {
    encode_index_buffer(triangles.as_flattened(), IndexEncoding::DEFAULT, &mut workspace()).map_err(failed)
}

/// Without limits: a mesh of ours is not hostile.
fn workspace() -> Workspace {
    Workspace::new(Limits { max_bytes: usize::MAX, max_work: u64::MAX })
}

fn failed(error: Error) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, format!("meshoptimizer: {error}"))
}
