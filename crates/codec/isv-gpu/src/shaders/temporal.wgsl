// Prediction of a block from the frame before, displaced by quarter voxels, and its residual (isv-kernels: window).

/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinate and slot of the blocks coded in this frame.
@group(1) @binding(3) var<storage, read> coded: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read> modes: array<CodedBlock>;
@group(1) @binding(5) var<storage, read> levels: array<u32>;
/// Which of them are predicted so.
@group(1) @binding(6) var<storage, read> list: array<u32>;

/// Slots of the 2x2x2 blocks that the displaced block touches, x fastest, or NO_BLOCK.
var<workgroup> octet: array<u32, 8>;
/// What stands for those that are not there.
var<workgroup> fills: array<i32, 8>;
/// The block's voxels and the layer after them along each axis.
var<workgroup> window: array<i32, 729>;

@compute @workgroup_size(64)
fn temporal(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.count {
        return;
    }
    let block = list[parameters.first + number];
    let coord = coded[block].xyz;
    let mode = modes[block];
    let vector = vector_of(mode.mode);
    // Whole voxels and quarters; blocks, and voxels within the first of them.
    let voxels = vector >> vec3<u32>(2u);
    let quarters = vector & vec3<i32>(3);
    let lowest = coord + (voxels >> vec3<u32>(3u));
    let within = voxels & vec3<i32>(7);
    if thread < 8u {
        let other = lowest + bitcast<vec3<i32>>(vec3<u32>(thread, thread >> 1u, thread >> 2u) & vec3<u32>(1u));
        let found = find_block(other);
        if found == NO_BLOCK {
            // The block that the vector leads to, at most four voxels from there.
            let centre = coord + ((vector + vec3<i32>(16)) >> vec3<u32>(5u));
            octet[thread] = NO_BLOCK;
            fills[thread] = select(parameters.truncation, -parameters.truncation, is_inside_towards(centre, other));
        } else {
            octet[thread] = bitcast<u32>(blocks[found].w);
        }
    }
    workgroupBarrier();
    for (var i = thread; i < 729u; i += 64u) {
        let at = vec3<u32>(i % 9u, i / 9u % 9u, i / 81u) + bitcast<vec3<u32>>(within);
        let half = at >> vec3<u32>(3u);
        let voxel = at & vec3<u32>(7u);
        let slot = octet[half.x + 2u * half.y + 4u * half.z];
        if slot == NO_BLOCK {
            window[i] = fills[half.x + 2u * half.y + 4u * half.z];
        } else {
            window[i] = load_sample(slot, voxel.x + 8u * voxel.y + 64u * voxel.z);
        }
    }
    workgroupBarrier();
    let start = (thread >> 3u) * 81u + (thread & 7u) * 9u;
    let near = vec3<i32>(4) - quarters;
    var row: array<i32, 8>;
    // Along y and z first: the sums are exact, so their order does not matter.
    var before = across(start, near, quarters);
    for (var x = 0u; x < 8u; x++) {
        let after = across(start + x + 1u, near, quarters);
        row[x] = (before * near.x + after * quarters.x + 32) >> 6u;
        before = after;
    }
    row = add_residual(thread, row, mode.levels, mode.level_count, parameters.scale, parameters.truncation);
    store_row(bitcast<u32>(coded[block].w), thread, row);
}

/// The window's samples at `at` and those after it along y and z, weighted.
fn across(at: u32, near: vec3<i32>, far: vec3<i32>) -> i32 {
    return near.z * (near.y * window[at] + far.y * window[at + 9u])
        + far.z * (near.y * window[at + 81u] + far.y * window[at + 90u]);
}
