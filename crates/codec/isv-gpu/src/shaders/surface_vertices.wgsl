// The vertices on the edges that start in a block: a workgroup a block, the vertices dealt out to its 64 threads. Whoever includes
// this binds `blocks`, the `edges`, and for each block and the end of the last the number of its `first` vertex and triangle.

struct Parameters {
    blocks: u32,
    /// The vertices that are written: of this number and on, and so many.
    start: u32,
    count: u32,
    /// Edge of a voxel in metres.
    voxel_m: f32,
}

/// A vertex between a voxel and the next one along an axis.
struct EdgeZero {
    /// The voxel where the edge starts.
    lower: vec3<u32>,
    axis: u32,
}

/// The edges of each row.
var<workgroup> edges_of_rows: array<u32, 64>;

/// How far to go from a voxel to the next one along an axis.
fn along(axis: u32) -> vec3<u32> {
    return vec3<u32>(vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u));
}

/// Numbers of a block's first vertex and that of the next block.
fn vertices_of(block: u32) -> vec2<u32> {
    return vec2<u32>(first[block].x, first[block + 1u].x);
}

/// Takes in the edges of a block. Ends with a barrier.
fn gather_edges(block: u32, thread: u32) {
    let row = edge_row(edges[32u * block + (thread >> 1u)], (thread & 1u) != 0u);
    edges_of_rows[thread] = row.edges;
    row_sums[thread] = row.first + countOneBits(row.edges);
    workgroupBarrier();
}

/// Vertex i of the block.
fn edge_zero(i: u32) -> EdgeZero {
    let row = row_with(i);
    var rest = edges_of_rows[row];
    for (var after = row_sums[row] - countOneBits(rest); after < i; after++) {
        rest &= rest - 1u;
    }
    let edge = firstTrailingBit(rest);
    return EdgeZero(vec3<u32>(edge / 3u, row & 7u, row >> 3u), edge % 3u);
}

/// The number of a voxel within its block.
fn voxel_index(voxel: vec3<u32>) -> u32 {
    return voxel.x + 8u * voxel.y + 64u * voxel.z;
}
