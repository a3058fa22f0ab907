// The crossed cells of a block by their lowest corners: cells whose corners differ in sign and are all there and observed
// (isv-decode: crossed_cells).

struct CellParameters {
    first: u32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: CellParameters;
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Of each block, what it is, and from bit 8 on one more than the number of its mask, or 0.
@group(1) @binding(3) var<storage, read> kinds: array<u32>;
@group(1) @binding(4) var<storage, read> opposed: array<u32>;
/// Masks of settled blocks, 16 words each.
@group(1) @binding(5) var<storage, read> masks: array<u32>;
/// Blocks where cells begin that have a corner in an unsettled block.
@group(1) @binding(6) var<storage, read> list: array<u32>;
/// Of each of this dispatch, its cells as bits: 16 words, voxel 0 in the lowest bit of the first.
@group(1) @binding(7) var<storage, read_write> cells: array<u32>;

/// Voxels of a block and one layer after it along an axis.
const SIDE = 9u;

/// The block and those after it, x fastest, or NO_BLOCK.
var<workgroup> octet: array<u32, 8>;
/// Rows of the block and one layer after it: observed voxels inside and outside, x from the lowest bit on.
var<workgroup> inside: array<u32, 81>;
var<workgroup> outside: array<u32, 81>;

/// The unobserved voxels of a row of a block.
fn unobserved(block: u32, row: u32) -> u32 {
    let kind = kinds[block];
    if (kind & UNSETTLED) == 0u {
        let number = kind >> 8u;
        if number == 0u {
            return 0u;
        }
        return (masks[(number - 1u) * 16u + (row >> 2u)] >> (8u * (row & 3u))) & 255u;
    }
    let faces = opposed[block];
    let y = row & 7u;
    let z = row >> 3u;
    var bits = (faces & 1u) | ((faces & 2u) << 6u);
    if ((faces & 4u) != 0u && y == 0u) || ((faces & 8u) != 0u && y == 7u)
        || ((faces & 16u) != 0u && z == 0u) || ((faces & 32u) != 0u && z == 7u) {
        bits = 255u;
    }
    return bits;
}

/// The signs of the first `count` voxels in a row of a block: those inside, and from bit 16 on those outside.
fn signs(block: u32, row: u32, count: u32) -> u32 {
    if block == NO_BLOCK {
        return 0u;
    }
    let slot = bitcast<u32>(blocks[block].w);
    let hidden = unobserved(block, row);
    var bits = 0u;
    for (var i = 0u; i < count; i++) {
        if ((hidden >> i) & 1u) == 0u {
            let sample = load_sample(slot, 8u * row + i);
            bits |= select(0x10000u, 1u, sample < 0) << i;
        }
    }
    return bits;
}

@compute @workgroup_size(64)
fn crossed_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.count {
        return;
    }
    let block = list[parameters.first + number];
    if thread < 8u {
        octet[thread] = find_block(blocks[block].xyz + vec3<i32>(vec3<u32>(thread & 1u, (thread >> 1u) & 1u, thread >> 2u)));
    }
    workgroupBarrier();
    for (var i = thread; i < SIDE * SIDE; i += 64u) {
        let y = i % SIDE;
        let z = i / SIDE;
        let slot = 4u * (z >> 3u) + 2u * (y >> 3u);
        let row = (z & 7u) * 8u + (y & 7u);
        let level = signs(octet[slot], row, 8u);
        let after = signs(octet[slot + 1u], row, 1u);
        let bits = level | (after << 8u);
        inside[i] = bits & 0xffffu;
        outside[i] = bits >> 16u;
    }
    workgroupBarrier();
    // A word of four rows a thread.
    if thread < 16u {
        var word = 0u;
        for (var i = 0u; i < 4u; i++) {
            let row = 4u * thread + i;
            let at = (row >> 3u) * SIDE + (row & 7u);
            let a = vec4<u32>(inside[at], inside[at + 1u], inside[at + SIDE], inside[at + SIDE + 1u]);
            let b = vec4<u32>(outside[at], outside[at + 1u], outside[at + SIDE], outside[at + SIDE + 1u]);
            let all_in = a.x & a.y & a.z & a.w;
            let all_out = b.x & b.y & b.z & b.w;
            let there = (a.x | b.x) & (a.y | b.y) & (a.z | b.z) & (a.w | b.w);
            let crossed = (there & (there >> 1u)) & ~(all_in & (all_in >> 1u)) & ~(all_out & (all_out >> 1u));
            word |= (crossed & 255u) << (8u * i);
        }
        cells[16u * number + thread] = word;
    }
}
