// Prediction of a block from the frame before by rigid motion (Sec. 3.5; isv-kernels: warp). Whoever includes this binds that
// frame's `blocks` and `table`. All 64 threads of a workgroup work on one block.

/// Slots of the 3x3x3 blocks around the block's place, or NO_BLOCK.
var<workgroup> around: array<u32, 27>;
/// What stands for those that are not there.
var<workgroup> fills: array<i32, 27>;

/// A sample of the neighbourhood, 0 to 23 along each axis.
fn neighbourhood_sample(at: vec3<i32>) -> i32 {
    let block = at >> vec3<u32>(3u);
    let voxel = at & vec3<i32>(7);
    let place = u32(block.x + 3 * block.y + 9 * block.z);
    let slot = around[place];
    if slot == NO_BLOCK {
        return fills[place];
    }
    return load_sample(slot, u32(voxel.x + 8 * voxel.y + 64 * voxel.z));
}

/// The trilinear sample at a position in 1/64 voxel.
fn sample_at(position: vec3<i32>) -> i32 {
    let at = position >> vec3<u32>(6u);
    let far = position & vec3<i32>(63);
    let near = vec3<i32>(64) - far;
    var sum = 1 << 17u;
    for (var corner = 0; corner < 8; corner++) {
        let step = vec3<i32>(corner & 1, (corner >> 1u) & 1, corner >> 2u);
        let weight = select(near, far, step == vec3<i32>(1));
        sum += neighbourhood_sample(at + step) * (weight.x * weight.y * weight.z);
    }
    return sum >> 18u;
}

/// Finds the blocks around a place that has one.
fn find_neighbourhood(thread: u32, coord: vec3<i32>, truncation: i32) {
    if thread < 27u {
        let found = find_block(coord + slot_offset(thread));
        around[thread] = NO_BLOCK;
        if found != NO_BLOCK {
            around[thread] = bitcast<u32>(blocks[found].w);
        }
    }
    workgroupBarrier();
    if thread < 27u && around[thread] == NO_BLOCK {
        // The sign of the block's voxel nearest to what is missing.
        let offset = slot_offset(thread);
        let nearest = select(select(vec3<u32>(4u), vec3<u32>(7u), offset > vec3<i32>(0)), vec3<u32>(0u), offset < vec3<i32>(0));
        let sample = load_sample(around[13], nearest.x + 8u * nearest.y + 64u * nearest.z);
        fills[thread] = select(truncation, -truncation, sample < 0);
    }
    workgroupBarrier();
}

/// A row of the block, 8 z + y being the thread, taken at the moved positions. `motion`: the rotation, entries times 2^14, row by
/// row, and the translation in quarter voxels.
fn moved_row(thread: u32, motion: array<i32, 12>) -> array<i32, 8> {
    let translation = vec3<i32>(motion[9], motion[10], motion[11]);
    let centre = vec3<i32>(8 * 64 + 7 * 32) + 16 * translation;
    let limit = vec3<i32>(23 * 64 - 1);
    var row: array<i32, 8>;
    for (var x = 0; x < 8; x++) {
        // Twice the offset from the centre, so that it is whole.
        let offset = 2 * vec3<i32>(x, i32(thread & 7u), i32(thread >> 3u)) - vec3<i32>(7);
        let turned = vec3<i32>(
            motion[0] * offset.x + motion[1] * offset.y + motion[2] * offset.z,
            motion[3] * offset.x + motion[4] * offset.y + motion[5] * offset.z,
            motion[6] * offset.x + motion[7] * offset.y + motion[8] * offset.z,
        );
        let rotated = (turned * 32 + vec3<i32>(1 << 13u)) >> vec3<u32>(14u);
        row[x] = sample_at(clamp(centre + rotated, vec3<i32>(0), limit));
    }
    return row;
}
