// The blocks of a part with their triangles.

/// Coordinate and slot, of all blocks.
@group(1) @binding(3) var<storage, read> blocks: array<vec4<i32>>;
/// For each block of the part where its triangles begin, and where the last one's end.
@group(1) @binding(4) var<storage, read> starts: array<u32>;
@group(1) @binding(5) var<storage, read> lists: array<u32>;

/// The lowest corner of a block on the lattice.
fn lowest_corner(block: u32) -> vec3<i32> {
    return (blocks[block].xyz - parameters.origin) << vec3<u32>(parameters.fraction_bits + 3u);
}
