// The signs of each block: a workgroup a block, a thread a row.

struct Parameters { blocks: u32 }

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read_write> surface: array<SurfaceBlock>;

var<workgroup> rows: array<u32, 64>;
var<workgroup> parts: atomic<u32>;

@compute @workgroup_size(64)
fn find_signs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    if thread == 0u {
        atomicStore(&parts, 0u);
    }
    workgroupBarrier();
    var samples = load_row(bitcast<u32>(blocks[block].w), thread);
    var row = 0u;
    for (var x = 0u; x < 8u; x++) {
        row |= select(0u, 1u << x, samples[x] < 0);
    }
    rows[thread] = row;
    // Pairs of bits by the axes y and z of a part: those that the row belongs to.
    let first_y = (thread & 7u) == 0u;
    let first_z = thread < 8u;
    let fields = 1u | select(0u, 4u, first_y) | select(0u, 16u, first_z) | select(0u, 64u, first_y && first_z);
    let inside = select(0u, 1u, row != 0u) | ((row & 1u) << 1u);
    let outside = select(0u, 1u, row != 0xffu) | ((~row & 1u) << 1u);
    atomicOr(&parts, (inside * fields) | ((outside * fields) << 8u));
    workgroupBarrier();
    if thread < 16u {
        let first = 4u * thread;
        surface[block].inside[thread] = rows[first] | (rows[first + 1u] << 8u) | (rows[first + 2u] << 16u) | (rows[first + 3u] << 24u);
    }
    if thread == 16u {
        surface[block].parts = atomicLoad(&parts);
    }
}
