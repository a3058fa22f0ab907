// Writes the positions of vertices: where the field is zero by linear interpolation.

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> edges: array<vec2<u32>>;
@group(1) @binding(4) var<storage, read> first: array<vec2<u32>>;
/// In metres; three a vertex.
@group(1) @binding(5) var<storage, read_write> positions_m: array<f32>;

/// The field at a voxel from 0 to 8 along one axis. Code 0 counts as 1: a vertex on a voxel centre would coincide with those on the
/// other edges from there.
fn field_at(voxel: vec3<u32>) -> f32 {
    let next = voxel >> vec3<u32>(3u);
    let block = around[MIDDLE + next.x + 3u * next.y + 9u * next.z];
    let code = load_sample(bitcast<u32>(blocks[block].w), voxel_index(voxel & vec3<u32>(7u)));
    return f32(select(code, 1, code == 0));
}

@compute @workgroup_size(64)
fn place_vertices(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    let numbers = vertices_of(block);
    if numbers.x == numbers.y || numbers.y <= parameters.start || numbers.x >= parameters.start + parameters.count {
        return;
    }
    look_around(block, AHEAD, thread);
    gather_edges(block, thread);
    let lowest = 8 * blocks[block].xyz;
    for (var number = numbers.x + thread; number < numbers.y; number += 64u) {
        let at = number - parameters.start;
        if at >= parameters.count {
            continue;
        }
        let zero = edge_zero(number - numbers.x);
        let step = along(zero.axis);
        let a = field_at(zero.lower);
        let b = field_at(zero.lower + step);
        // Small numbers first: what lies within a voxel, then the voxel, which is exact.
        let within = vec3<f32>(0.5) + vec3<f32>(step) * (a / (a - b));
        let position_m = (vec3<f32>(lowest + vec3<i32>(zero.lower)) + within) * parameters.voxel_m;
        positions_m[3u * at] = position_m.x;
        positions_m[3u * at + 1u] = position_m.y;
        positions_m[3u * at + 2u] = position_m.z;
    }
}
