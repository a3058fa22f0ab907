// The field continued from coded blocks into a block beside them that was not coded (isv-kernels: extrapolation).

struct ExtrapolationParameters {
    truncation: i32,
    first: u32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: ExtrapolationParameters;
/// All blocks of the frame.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> kinds: array<u32>;
/// Blocks to be extrapolated.
@group(1) @binding(4) var<storage, read> list: array<u32>;
/// Of each extrapolated block, 1 if it lies inside.
@group(1) @binding(5) var<storage, read_write> insides: array<u32>;

/// A distance field grows by one voxel a voxel at most.
const STEEPEST = 256;
/// Least magnitude of an extrapolated sample.
const LEAST = 5;
const NOTHING_YET = 32767;

/// Slots of the coded blocks around, or NO_BLOCK.
var<workgroup> around: array<u32, 27>;
/// Votes of the blocks at faces, edges and corners: sums of clamped samples.
var<workgroup> votes: array<atomic<i32>, 4>;

/// How many coordinates of an offset are not 0.
fn rank(offset: vec3<i32>) -> u32 {
    return u32(dot(abs(offset), vec3<i32>(1)));
}

/// Adds the samples of a coded neighbour that touch the block.
fn vote(slot: u32, thread: u32) {
    let offset = slot_offset(slot);
    let place = around[slot];
    if place == NO_BLOCK || slot == 13u {
        return;
    }
    // As many samples touch as there are voxels along the axes on which both are level.
    let sides = select(vec3<u32>(1u), vec3<u32>(8u), offset == vec3<i32>(0));
    if thread >= sides.x * sides.y * sides.z {
        return;
    }
    let at = vec3<u32>(thread % sides.x, thread / sides.x % sides.y, thread / (sides.x * sides.y));
    let voxel = select(at, vec3<u32>(7u), offset < vec3<i32>(0));
    let sample = load_sample(place, voxel.x + 8u * voxel.y + 64u * voxel.z);
    atomicAdd(&votes[rank(offset)], clamp(sample, -STEEPEST, STEEPEST));
}

/// Whether a coded block is nearer than this one to every voxel: one whose offset agrees with this one's wherever it is not 0.
fn is_shadowed(slot: u32) -> bool {
    let offset = slot_offset(slot);
    for (var other = 0u; other < 27u; other++) {
        if other != slot && other != 13u && around[other] != NO_BLOCK {
            let near = slot_offset(other);
            if all((near == vec3<i32>(0)) | (near == offset)) {
                return true;
            }
        }
    }
    return false;
}

@compute @workgroup_size(64)
fn extrapolate(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.count {
        return;
    }
    let block = list[parameters.first + number];
    if thread < 27u {
        around[thread] = NO_BLOCK;
        let other = find_block(blocks[block].xyz + slot_offset(thread));
        if other != NO_BLOCK && thread != 13u {
            if (kinds[other] & CODED) != 0u {
                around[thread] = bitcast<u32>(blocks[other].w);
            }
        }
    }
    if thread < 4u {
        atomicStore(&votes[thread], 0);
    }
    workgroupBarrier();
    for (var slot = 0u; slot < 27u; slot++) {
        vote(slot, thread);
    }
    workgroupBarrier();
    // Faces decide; without any, edges count once and corners eight times.
    var has_faces = false;
    for (var axis = 0u; axis < 3u; axis++) {
        let step = array<u32, 3>(1u, 3u, 9u)[axis];
        has_faces |= around[13u - step] != NO_BLOCK || around[13u + step] != NO_BLOCK;
    }
    let beside = atomicLoad(&votes[2]) + 8 * atomicLoad(&votes[3]);
    let is_inside = select(beside, atomicLoad(&votes[1]), has_faces) < 0;
    let sign = select(1, -1, is_inside);

    let y = i32(thread & 7u);
    let z = i32(thread >> 3u);
    var distances = array<i32, 8>(NOTHING_YET, NOTHING_YET, NOTHING_YET, NOTHING_YET, NOTHING_YET, NOTHING_YET, NOTHING_YET, NOTHING_YET);
    var magnitudes = distances;
    for (var slot = 0u; slot < 27u; slot++) {
        let place = around[slot];
        if place == NO_BLOCK || is_shadowed(slot) {
            continue;
        }
        let offset = slot_offset(slot);
        for (var x = 0; x < 8; x++) {
            // The neighbour's nearest voxel, the one behind it, and how far away it is, along each axis.
            let voxel = vec3<i32>(x, y, z);
            let nearest = select(select(voxel, vec3<i32>(7), offset < vec3<i32>(0)), vec3<i32>(0), offset > vec3<i32>(0));
            let away = select(select(vec3<i32>(0), voxel + 1, offset < vec3<i32>(0)), 8 - voxel, offset > vec3<i32>(0));
            let strides = vec3<i32>(1, 8, 64);
            let at = dot(nearest, strides);
            let sample = load_sample(place, u32(at));
            var level = sample;
            for (var axis = 0u; axis < 3u; axis++) {
                if offset[axis] != 0 {
                    let behind = load_sample(place, u32(at + offset[axis] * strides[axis]));
                    level += clamp(sample - behind, -STEEPEST, STEEPEST) * away[axis];
                }
            }
            let magnitude = clamp(sign * level, LEAST, parameters.truncation);
            let distance = away.x + away.y + away.z;
            if distance < distances[x] {
                distances[x] = distance;
                magnitudes[x] = magnitude;
            } else if distance == distances[x] {
                magnitudes[x] = min(magnitudes[x], magnitude);
            }
        }
    }
    var row: array<i32, 8>;
    for (var x = 0u; x < 8u; x++) {
        row[x] = sign * magnitudes[x];
    }
    store_row(bitcast<u32>(blocks[block].w), thread, row);
    if thread == 0u {
        insides[block] = select(0u, 1u, is_inside);
    }
}
