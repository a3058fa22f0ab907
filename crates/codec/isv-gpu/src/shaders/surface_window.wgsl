// The signs that the cells of a block need: its own and those at the near sides of its neighbours towards plus. Whoever includes
// this binds `surface`, and has looked around.

/// The voxels inside: bit x of row 9 z + y, each of x, y and z up to 8.
var<workgroup> inside: array<u32, 81>;

/// The voxels inside of a row of a block that may be missing.
fn inside_row(block: u32, row: u32) -> u32 {
    if block == NO_BLOCK {
        return 0u;
    }
    return (surface[block].inside[row >> 2u] >> (8u * (row & 3u))) & 0xffu;
}

/// Fills the window; a barrier has to follow.
fn gather_inside(thread: u32) {
    for (var i = thread; i < 81u; i += 64u) {
        let y = i % 9u;
        let z = i / 9u;
        let place = MIDDLE + 3u * (y >> 3u) + 9u * (z >> 3u);
        let row = 8u * (z & 7u) + (y & 7u);
        inside[i] = inside_row(around[place], row) | ((inside_row(around[place + 1u], row) & 1u) << 8u);
    }
}

/// The signs of the cell above voxel x of a row, a bit a corner, corner c lying at (c & 1, c >> 1 & 1, c >> 2 & 1).
fn cell_pattern(x: u32, row: u32) -> u32 {
    let i = row + (row >> 3u);
    return ((inside[i] >> x) & 3u) | (((inside[i + 1u] >> x) & 3u) << 2u)
        | (((inside[i + 9u] >> x) & 3u) << 4u) | (((inside[i + 10u] >> x) & 3u) << 6u);
}
