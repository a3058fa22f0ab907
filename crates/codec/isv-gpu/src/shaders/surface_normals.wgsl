// Writes the normals of vertices: the field's gradient, interpolated along the edge.

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> edges: array<vec2<u32>>;
@group(1) @binding(4) var<storage, read> first: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read> mask_numbers: array<u32>;
@group(1) @binding(6) var<storage, read> masks: array<u32>;
/// Three a vertex.
@group(1) @binding(7) var<storage, read_write> normals: array<f32>;

/// Stands for a voxel that is missing or was not observed. No code is that low.
const UNKNOWN = -32768;

/// The code of a voxel of the block or around it.
fn code_at(voxel: vec3<i32>) -> i32 {
    let padded = vec3<u32>(voxel + 8);
    let next = padded >> vec3<u32>(3u);
    let block = around[next.x + 3u * next.y + 9u * next.z];
    if block == NO_BLOCK {
        return UNKNOWN;
    }
    let within = padded & vec3<u32>(7u);
    if ((observed_row(mask_number(block), 8u * within.z + within.y) >> within.x) & 1u) == 0u {
        return UNKNOWN;
    }
    return load_sample(bitcast<u32>(blocks[block].w), voxel_index(within));
}

/// Twice the difference a voxel along an axis: central where both neighbours were observed, else one-sided, else 0.
fn doubled_difference(before: i32, here: i32, after: i32) -> i32 {
    if before != UNKNOWN && after != UNKNOWN {
        return after - before;
    }
    if here == UNKNOWN || (before == UNKNOWN && after == UNKNOWN) {
        return 0;
    }
    return 2 * select(here - before, after - here, before == UNKNOWN);
}

/// Twice the gradient of the codes at a voxel, per voxel.
fn doubled_gradient(voxel: vec3<i32>, here: i32) -> vec3<i32> {
    let x = vec3<i32>(1, 0, 0);
    let y = vec3<i32>(0, 1, 0);
    let z = vec3<i32>(0, 0, 1);
    return vec3<i32>(
        doubled_difference(code_at(voxel - x), here, code_at(voxel + x)),
        doubled_difference(code_at(voxel - y), here, code_at(voxel + y)),
        doubled_difference(code_at(voxel - z), here, code_at(voxel + z)),
    );
}

@compute @workgroup_size(64)
fn find_normals(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    let numbers = vertices_of(block);
    if numbers.x == numbers.y || numbers.y <= parameters.start || numbers.x >= parameters.start + parameters.count {
        return;
    }
    look_around(block, ALL_AROUND, thread);
    gather_edges(block, thread);
    for (var number = numbers.x + thread; number < numbers.y; number += 64u) {
        let at = number - parameters.start;
        if at >= parameters.count {
            continue;
        }
        let zero = edge_zero(number - numbers.x);
        let step = vec3<i32>(along(zero.axis));
        let lower = vec3<i32>(zero.lower);
        let a = code_at(lower);
        let b = code_at(lower + step);
        // The zero lies at |a| / (|a| + |b|), where 0 counts as 1. Codes are at most 4096, so all of this is exact.
        let gradient = doubled_gradient(lower, a) * max(abs(b), 1) + doubled_gradient(lower + step, b) * max(abs(a), 1);
        var normal = vec3<f32>(step * select(-1, 1, a < 0));
        if any(gradient != vec3<i32>(0)) {
            normal = normalize(vec3<f32>(gradient));
        }
        normals[3u * at] = normal.x;
        normals[3u * at + 1u] = normal.y;
        normals[3u * at + 2u] = normal.z;
    }
}
