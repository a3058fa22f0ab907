// Prediction of a block from the frame before by rigid motion, and its residual (profile `paper`, Sec. 3.5; isv-kernels: warp).

struct WarpParameters {
    scale: Scale,
    truncation: i32,
    count: u32,
}

/// A block and where it comes from.
struct MovedBlock {
    slot: u32,
    /// Whether it is predicted.
    is_predicted: u32,
    levels: u32,
    level_count: u32,
    /// The rotation, entries times 2^14, row by row, and the translation in quarter voxels.
    motion: array<i32, 12>,
}

@group(1) @binding(0) var<uniform> parameters: WarpParameters;
/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinates of this frame's blocks.
@group(1) @binding(3) var<storage, read> coords: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read> moved: array<MovedBlock>;
@group(1) @binding(5) var<storage, read> levels: array<u32>;

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

@compute @workgroup_size(64)
fn warp(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.count {
        return;
    }
    var row = array<i32, 8>(0, 0, 0, 0, 0, 0, 0, 0);
    if moved[block].is_predicted != 0u {
        if thread < 27u {
            let offset = slot_offset(thread);
            let found = find_block(coords[block].xyz + offset);
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
            fills[thread] = select(parameters.truncation, -parameters.truncation, sample < 0);
        }
        workgroupBarrier();
        let motion = moved[block].motion;
        let translation = vec3<i32>(motion[9], motion[10], motion[11]);
        let centre = vec3<i32>(8 * 64 + 7 * 32) + 16 * translation;
        let limit = vec3<i32>(23 * 64 - 1);
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
    }
    row = add_residual(thread, row, moved[block].levels, moved[block].level_count, parameters.scale, parameters.truncation);
    store_row(moved[block].slot, thread, row);
}
