// Triangles on a lattice (isv-ingest: lattice), of three kinds: faces; what closes the mesh, which only counts in winding numbers; and
// the rims of wide holes, whose last two corners are the same.

struct Parameters {
    /// The block at whose lowest corner the lattice begins.
    origin: vec3<i32>,
    /// Base-2 logarithm of the steps in a voxel.
    fraction_bits: u32,
    /// Where the triangles of each kind end.
    ends: vec3<u32>,
    /// Of the table of reached blocks, a power of two.
    entries: u32,
    /// How far a triangle of each kind matters, in steps.
    reach: vec3<i32>,
    /// Codes of the truncation.
    truncation: i32,
    /// Of the block along x and y in a key.
    key_bits: vec2<u32>,
    /// Blocks of this part: the first, and how many.
    part: vec2<u32>,
    /// In voxels: how far a voxel may be from the surface to be near, how far a rim matters, and by what distances are lowered; and 1
    /// if they have signs.
    near: f32,
    band: f32,
    offset: f32,
    is_signed: u32,
}

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// In steps, three numbers each.
@group(1) @binding(1) var<storage, read> vertices: array<i32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;

fn corner_of(triangle: u32, number: u32) -> vec3<i32> {
    let at = 3u * triangles[3u * triangle + number];
    return vec3<i32>(vertices[at], vertices[at + 1u], vertices[at + 2u]);
}
