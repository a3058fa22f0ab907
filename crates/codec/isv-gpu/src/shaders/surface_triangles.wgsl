// Writes triangles: a workgroup a block, the triangles of the cells that start in it dealt out to its 64 threads.

struct Parameters {
    blocks: u32,
    /// The triangles that are written: of this number and on, and so many.
    start: u32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> surface: array<SurfaceBlock>;
@group(1) @binding(4) var<storage, read> cases: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read> edges: array<vec2<u32>>;
@group(1) @binding(6) var<storage, read> first: array<vec2<u32>>;
/// Three vertices' numbers a triangle.
@group(1) @binding(7) var<storage, read_write> triangles: array<u32>;

/// The crossed cells of each row.
var<workgroup> cells_of_rows: array<u32, 64>;
/// The edges that start in the block and at the near sides of its neighbours towards plus: of row 9 z + y up to voxel 7 along x, and
/// 81 further of voxel 8; and the numbers of their first vertices.
var<workgroup> edges_around: array<u32, 162>;
var<workgroup> first_around: array<u32, 162>;

/// Takes in the edges that the block's cells reach.
fn gather_vertices(thread: u32) {
    for (var i = thread; i < 162u; i += 64u) {
        let y = i % 9u;
        let z = i / 9u % 9u;
        let block = around[MIDDLE + i / 81u + 3u * (y >> 3u) + 9u * (z >> 3u)];
        if block != NO_BLOCK {
            let row = 8u * (z & 7u) + (y & 7u);
            let in_block = edge_row(edges[32u * block + (row >> 1u)], (row & 1u) != 0u);
            edges_around[i] = in_block.edges;
            first_around[i] = first[block].x + in_block.first;
        }
    }
}

/// The number of the vertex on an edge of the cell above a voxel. Edge e runs along axis e / 4, and e % 4 holds the two coordinates
/// of the other axes, lower axis in the lower bit.
fn vertex_on(edge: u32, x: u32, row: u32) -> u32 {
    let axis = edge >> 2u;
    let low = edge & 1u;
    let high = (edge >> 1u) & 1u;
    var at = vec3<u32>(x, row & 7u, row >> 3u);
    switch axis {
        case 0u: { at += vec3<u32>(0u, low, high); }
        case 1u: { at += vec3<u32>(low, 0u, high); }
        default: { at += vec3<u32>(low, high, 0u); }
    }
    let i = at.y + 9u * at.z + 81u * (at.x >> 3u);
    let before = (1u << (3u * (at.x & 7u) + axis)) - 1u;
    return first_around[i] + countOneBits(edges_around[i] & before);
}

@compute @workgroup_size(64)
fn make_triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    let numbers = vec2<u32>(first[block].y, first[block + 1u].y);
    if numbers.x == numbers.y || numbers.y <= parameters.start || numbers.x >= parameters.start + parameters.count {
        return;
    }
    look_around(block, OCTET, thread);
    workgroupBarrier();
    gather_inside(thread);
    gather_vertices(thread);
    let cells = (surface[block].cells[thread >> 2u] >> (8u * (thread & 3u))) & 0xffu;
    cells_of_rows[thread] = cells;
    workgroupBarrier();
    sum_before(count_triangles(cells, thread), thread);
    for (var number = numbers.x + thread; number < numbers.y; number += 64u) {
        let at = number - parameters.start;
        if at >= parameters.count {
            continue;
        }
        // From the end of the row back to the triangle's cell.
        let row = row_with(number - numbers.x);
        var after = row_sums[row];
        var rest = cells_of_rows[row];
        var x = 0u;
        var triangles_here = vec2<u32>(0u);
        loop {
            x = firstLeadingBit(rest);
            triangles_here = cases[cell_pattern(x, row)];
            after -= triangles_here.y >> 28u;
            rest ^= 1u << x;
            if after <= number - numbers.x || rest == 0u {
                break;
            }
        }
        let corner = 3u * (number - numbers.x - after);
        for (var i = 0u; i < 3u; i++) {
            let edge = (triangles_here[(corner + i) >> 3u] >> (4u * ((corner + i) & 7u))) & 15u;
            triangles[3u * at + i] = vertex_on(edge, x, row);
        }
    }
}
