// Finds the crossing edges and crossed cells that start in each block, and counts their vertices and triangles: a workgroup a
// block, a thread a row. It is what `isv-surface` does in `window` and `chunk`.

struct Parameters { blocks: u32 }

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read_write> surface: array<SurfaceBlock>;
@group(1) @binding(4) var<storage, read> mask_numbers: array<u32>;
@group(1) @binding(5) var<storage, read> masks: array<u32>;
@group(1) @binding(6) var<storage, read> cases: array<vec2<u32>>;
/// 32 pairs of rows a block; only of blocks that can be crossed.
@group(1) @binding(7) var<storage, read_write> edges: array<vec2<u32>>;
/// Vertices and triangles of each block, and zeros after the last.
@group(1) @binding(8) var<storage, read_write> counts: array<vec2<u32>>;

/// Mask numbers of the blocks around.
var<workgroup> masks_around: array<u32, 27>;
/// The voxels that were observed: bit x + 1 of row 10 (z + 1) + y + 1, each of x, y and z from -1 to 8.
var<workgroup> observed: array<u32, 100>;
/// The crossing edges and crossed cells of each row.
var<workgroup> edges_of_rows: array<u32, 64>;
var<workgroup> cells_of_rows: array<u32, 64>;
/// Whether the surface can cross the block.
var<workgroup> crossing: bool;

/// Whether the corners of the cells that start in the block have both signs: the surface crosses no edge or cell of the others.
fn can_be_crossed() -> bool {
    var both = 0u;
    for (var part = 0u; part < 8u; part++) {
        let block = around[MIDDLE + (part & 1u) + 3u * ((part >> 1u) & 1u) + 9u * (part >> 2u)];
        if block != NO_BLOCK {
            both |= surface[block].parts >> part;
        }
    }
    return (both & 0x101u) == 0x101u;
}

/// The observed voxels of a row of a block around.
fn observed_around(place: u32, row: u32) -> u32 {
    if around[place] == NO_BLOCK {
        return 0u;
    }
    return observed_row(masks_around[place], row);
}

/// The block before, this one or the next, by a voxel's coordinate plus one.
fn step_to(padded: u32) -> u32 {
    return (padded + 7u) >> 3u;
}

fn gather_observed(thread: u32) {
    for (var i = thread; i < 100u; i += 64u) {
        let y = i % 10u;
        let z = i / 10u;
        let place = 3u * step_to(y) + 9u * step_to(z);
        let row = 8u * ((z + 7u) & 7u) + ((y + 7u) & 7u);
        observed[i] = (observed_around(place, row) >> 7u) | (observed_around(place + 1u, row) << 1u)
            | ((observed_around(place + 2u, row) & 1u) << 9u);
    }
}

/// The cells that were observed at all corners, by their lowest corners: bit x + 1 of a row that is named as in `observed`.
fn whole_cells(i: u32) -> u32 {
    let column = observed[i] & observed[i + 1u] & observed[i + 10u] & observed[i + 11u];
    return column & (column >> 1u);
}

@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    if block == 0u && thread == 0u {
        counts[parameters.blocks] = vec2<u32>(0u);
    }
    look_around(block, ALL_AROUND, thread);
    workgroupBarrier();
    if thread == 0u {
        crossing = can_be_crossed();
    }
    if !workgroupUniformLoad(&crossing) {
        if thread == 0u {
            counts[block] = vec2<u32>(0u);
        }
        return;
    }
    if thread < 27u && around[thread] != NO_BLOCK {
        masks_around[thread] = mask_number(around[thread]);
    }
    gather_inside(thread);
    workgroupBarrier();
    gather_observed(thread);
    workgroupBarrier();

    let y = thread & 7u;
    let z = thread >> 3u;
    // Whole cells of this row, and of those before it along y, z and both.
    let at = 10u * z + y;
    let c00 = whole_cells(at + 11u);
    let c10 = whole_cells(at + 10u);
    let c01 = whole_cells(at + 1u);
    let c11 = whole_cells(at);
    // Signs of this row, and of those after it.
    let i = 9u * z + y;
    let row = inside[i];
    let row_y = inside[i + 1u];
    let row_z = inside[i + 9u];
    let row_yz = inside[i + 10u];

    let beside_x = (c00 | c10 | c01 | c11) >> 1u;
    let beside_y = c00 | c01;
    let beside_z = c00 | c10;
    let along_x = (row ^ (row >> 1u)) & beside_x;
    let along_y = (row ^ row_y) & (beside_y | (beside_y >> 1u));
    let along_z = (row ^ row_z) & (beside_z | (beside_z >> 1u));
    let edges_here = spread_by_three(along_x & 0xffu) | (spread_by_three(along_y & 0xffu) << 1u)
        | (spread_by_three(along_z & 0xffu) << 2u);
    let some = row | row_y | row_z | row_yz;
    let every = row & row_y & row_z & row_yz;
    let cells = (some | (some >> 1u)) & ~(every & (every >> 1u)) & (c00 >> 1u) & 0xffu;
    edges_of_rows[thread] = edges_here;
    cells_of_rows[thread] = cells;

    // Vertices in the lower half, triangles in the upper: at most 1536 and 2560.
    let before = sum_before(countOneBits(edges_here) | (count_triangles(cells, thread) << 16u), thread);
    if (thread & 1u) == 0u {
        edges[32u * block + (thread >> 1u)] = edge_pair(vec2<u32>(edges_here, edges_of_rows[thread + 1u]), before & 0xffffu);
    }
    if thread < 16u {
        let first = 4u * thread;
        surface[block].cells[thread] = cells_of_rows[first] | (cells_of_rows[first + 1u] << 8u)
            | (cells_of_rows[first + 2u] << 16u) | (cells_of_rows[first + 3u] << 24u);
    }
    if thread == 63u {
        counts[block] = vec2<u32>(row_sums[63] & 0xffffu, row_sums[63] >> 16u);
    }
}
