// From sums to samples (isv-fusion: blocks). A thread resolves 32 voxels in a row: a word of the mask.

struct ResolveParameters {
    blocks: u32,
    /// Voxels of a block.
    size: u32,
    /// The truncation in codes.
    band: i32,
}

@group(1) @binding(0) var<uniform> parameters: ResolveParameters;
@group(1) @binding(1) var<storage, read> sums: array<f32>;
/// 16 bits each.
@group(1) @binding(2) var<storage, read_write> samples: array<u32>;
/// Unobserved voxels, a bit each.
@group(1) @binding(3) var<storage, read_write> masks: array<u32>;

/// Weights below this are of hidden voxels.
const LEAST_WEIGHT = 1e-25;
/// The sample of a voxel of which nothing is known.
const UNKNOWN = -32768;
const CODES_PER_VOXEL = 256.0;

/// A voxel's code, and whether it is unobserved.
fn resolve_voxel(at: u32) -> vec2<i32> {
    let weight = sums[at];
    let sum = sums[at + parameters.size];
    let free = sums[at + (2u * parameters.size)];
    let band = parameters.band;
    let measured = weight >= LEAST_WEIGHT;
    if free > 0.0 && (!measured || (sum < 0.0 && free > weight)) {
        return vec2<i32>(band, 0);
    }
    if measured {
        let codes = (sum / weight) * CODES_PER_VOXEL;
        let rounded = i32(sign(codes) * floor(abs(codes) + 0.5));
        return vec2<i32>(clamp(rounded, -band, band), 0);
    }
    return vec2<i32>(select(UNKNOWN, -band, weight > 0.0), 1);
}

@compute @workgroup_size(64)
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let word = (((group.y * groups.x) + group.x) * 64u) + thread;
    let words = parameters.size / 32u;
    let block = word / words;
    if block >= parameters.blocks {
        return;
    }
    let first = sums_at(block, parameters.size, 32u * (word % words));
    var mask = 0u;
    for (var pair = 0u; pair < 16u; pair++) {
        let a = resolve_voxel(first + (2u * pair));
        let b = resolve_voxel(first + (2u * pair) + 1u);
        samples[(16u * word) + pair] = (bitcast<u32>(a.x) & 0xffffu) | (bitcast<u32>(b.x) << 16u);
        mask |= bitcast<u32>(a.y | (b.y << 1u)) << (2u * pair);
    }
    masks[word] = mask;
}
