// The crossing edges that start in a block, in rows of eight voxels along x: bit 3 x + axis of a row for the edge that starts in
// voxel x and runs along `axis`. Two rows are kept in two words, and above the 24 bits of each half of the number, within the
// block, of the first row's first vertex.

struct EdgeRow {
    edges: u32,
    /// Number of the first vertex within the block.
    first: u32,
}

const EDGE_BITS = 0xffffffu;

/// A row of a pair, the first or the second of it.
fn edge_row(pair: vec2<u32>, second: bool) -> EdgeRow {
    let first = (pair.x >> 24u) | ((pair.y >> 24u) << 8u);
    let edges = pair & vec2<u32>(EDGE_BITS);
    if second {
        return EdgeRow(edges.y, first + countOneBits(edges.x));
    }
    return EdgeRow(edges.x, first);
}

fn edge_pair(edges: vec2<u32>, first: u32) -> vec2<u32> {
    return edges | vec2<u32>((first & 0xffu) << 24u, (first >> 8u) << 24u);
}

/// Moves bit i of a byte to bit 3 i.
fn spread_by_three(byte: u32) -> u32 {
    var v = byte;
    v = (v | (v << 8u)) & 0x0000f00fu;
    v = (v | (v << 4u)) & 0x000c30c3u;
    return (v | (v << 2u)) & 0x00249249u;
}
