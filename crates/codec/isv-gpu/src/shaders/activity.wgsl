// Where the surface is expected in the next frame: this one, moved on as it was moving (isv-decode: activity).

struct ActivityParameters { blocks: u32 }

@group(1) @binding(0) var<uniform> parameters: ActivityParameters;
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Of each block, as `mode` in `vector_of`, if it was coded with a vector, else 0.
@group(1) @binding(3) var<storage, read> vectors: array<u32>;
/// Of each block, edges that the surface crosses, and from bit 16 on the smallest distance from the surface where there are none.
@group(1) @binding(4) var<storage, read_write> activity: array<u32>;

/// Distances from here on are one.
const FAR = 960u;

/// Vectors of the blocks around, and how many there are.
var<workgroup> drift_sum: array<atomic<i32>, 4>;
/// Slots of the 2x2x2 blocks that the displaced block touches, or NO_BLOCK.
var<workgroup> octet: array<u32, 8>;
/// The displaced block and the layer after it: known voxels inside and outside, rows of nine bits.
var<workgroup> inside: array<u32, 81>;
var<workgroup> outside: array<u32, 81>;
var<workgroup> crossings: atomic<u32>;
var<workgroup> nearest: atomic<u32>;

/// `a / b` rounded down, for positive `b`.
fn divide_down(a: i32, b: i32) -> i32 {
    let quotient = a / b;
    return quotient - select(0, 1, quotient * b > a);
}

@compute @workgroup_size(64)
fn expected_activity(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.blocks {
        return;
    }
    if thread < 4u {
        atomicStore(&drift_sum[thread], 0);
    }
    if thread == 4u {
        atomicStore(&crossings, 0u);
        atomicStore(&nearest, FAR);
    }
    workgroupBarrier();
    let coord = blocks[block].xyz;
    let has_own = has_vector(vectors[block]);
    if thread < 27u && (thread == 13u || !has_own) {
        let other = find_block(coord + slot_offset(thread));
        if other != NO_BLOCK {
            let mode = vectors[other];
            if has_vector(mode) {
                let vector = vector_of(mode);
                atomicAdd(&drift_sum[0], vector.x);
                atomicAdd(&drift_sum[1], vector.y);
                atomicAdd(&drift_sum[2], vector.z);
                atomicAdd(&drift_sum[3], 1);
            }
        }
    }
    workgroupBarrier();
    // The mean in whole voxels, rounded half up.
    let count = atomicLoad(&drift_sum[3]);
    var drift = vec3<i32>(0);
    if count > 0 {
        for (var axis = 0u; axis < 3u; axis++) {
            drift[axis] = divide_down(2 * atomicLoad(&drift_sum[axis]) + 4 * count, 8 * count);
        }
    }
    let within = bitcast<vec3<u32>>(drift & vec3<i32>(7));
    if thread < 8u {
        let offset = bitcast<vec3<i32>>(vec3<u32>(thread, thread >> 1u, thread >> 2u) & vec3<u32>(1u));
        let found = find_block(coord + (drift >> vec3<u32>(3u)) + offset);
        octet[thread] = NO_BLOCK;
        if found != NO_BLOCK {
            octet[thread] = bitcast<u32>(blocks[found].w);
        }
    }
    workgroupBarrier();
    for (var i = thread; i < 81u; i += 64u) {
        let y = i % 9u + within.y;
        let z = i / 9u + within.z;
        let pair = 2u * (y >> 3u) + 4u * (z >> 3u);
        let row = ((z & 7u) * 8u + (y & 7u)) * 8u;
        var in_bits = 0u;
        var out_bits = 0u;
        var least = FAR;
        for (var step = 0u; step < 9u; step++) {
            let x = step + within.x;
            let slot = octet[pair + (x >> 3u)];
            if slot != NO_BLOCK {
                let sample = load_sample(slot, row + (x & 7u));
                in_bits |= select(0u, 1u << step, sample < 0);
                out_bits |= select(1u << step, 0u, sample < 0);
                if step < 8u {
                    least = min(least, u32(abs(sample)));
                }
            }
        }
        inside[i] = in_bits;
        outside[i] = out_bits;
        if i % 9u < 8u && i / 9u < 8u {
            atomicMin(&nearest, least);
        }
    }
    workgroupBarrier();
    // Edges that start in the block, along x, y and z.
    let at = (thread >> 3u) * 9u + (thread & 7u);
    let a = inside[at];
    let b = outside[at];
    let x = (a & (b >> 1u)) | (b & (a >> 1u));
    let y = (a & outside[at + 1u]) | (b & inside[at + 1u]);
    let z = (a & outside[at + 9u]) | (b & inside[at + 9u]);
    atomicAdd(&crossings, countOneBits(x & 255u) + countOneBits(y & 255u) + countOneBits(z & 255u));
    workgroupBarrier();
    if thread == 0u {
        let crossed = atomicLoad(&crossings);
        activity[block] = crossed | select(atomicLoad(&nearest) << 16u, 0u, crossed > 0u);
    }
}
