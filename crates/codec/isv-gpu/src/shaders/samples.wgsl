// The sample pool: 512 samples of 16 bits a block, x fastest, two to a word, in slots of four segments.

@group(0) @binding(0) var<storage, read_write> segment_0: array<u32>;
@group(0) @binding(1) var<storage, read_write> segment_1: array<u32>;
@group(0) @binding(2) var<storage, read_write> segment_2: array<u32>;
@group(0) @binding(3) var<storage, read_write> segment_3: array<u32>;

/// Words of a block.
const BLOCK_WORDS = 256u;

/// The samples 2 `word` and 2 `word` + 1 of a block.
fn load_pair(slot: u32, word: u32) -> u32 {
    let at = (slot & ((1u << SEGMENT_BITS) - 1u)) * BLOCK_WORDS + word;
    switch slot >> SEGMENT_BITS {
        case 0u: { return segment_0[at]; }
        case 1u: { return segment_1[at]; }
        case 2u: { return segment_2[at]; }
        default: { return segment_3[at]; }
    }
}

fn store_pair(slot: u32, word: u32, pair: u32) {
    let at = (slot & ((1u << SEGMENT_BITS) - 1u)) * BLOCK_WORDS + word;
    switch slot >> SEGMENT_BITS {
        case 0u: { segment_0[at] = pair; }
        case 1u: { segment_1[at] = pair; }
        case 2u: { segment_2[at] = pair; }
        default: { segment_3[at] = pair; }
    }
}

/// The first and the second sample of a pair.
fn unpack(pair: u32) -> vec2<i32> {
    let word = bitcast<i32>(pair);
    return vec2<i32>((word << 16u) >> 16u, word >> 16u);
}

/// A pair of samples that fit 16 bits.
fn pack(samples: vec2<i32>) -> u32 {
    return (bitcast<u32>(samples.x) & 0xffffu) | (bitcast<u32>(samples.y) << 16u);
}

/// One sample of a block.
fn load_sample(slot: u32, voxel: u32) -> i32 {
    let pair = unpack(load_pair(slot, voxel >> 1u));
    return select(pair.x, pair.y, (voxel & 1u) != 0u);
}

/// A row of eight samples along x, `row` being 8 z + y.
fn load_row(slot: u32, row: u32) -> array<i32, 8> {
    let a = unpack(load_pair(slot, 4u * row));
    let b = unpack(load_pair(slot, 4u * row + 1u));
    let c = unpack(load_pair(slot, 4u * row + 2u));
    let d = unpack(load_pair(slot, 4u * row + 3u));
    return array<i32, 8>(a.x, a.y, b.x, b.y, c.x, c.y, d.x, d.y);
}

fn store_row(slot: u32, row: u32, samples: array<i32, 8>) {
    store_pair(slot, 4u * row, pack(vec2<i32>(samples[0], samples[1])));
    store_pair(slot, 4u * row + 1u, pack(vec2<i32>(samples[2], samples[3])));
    store_pair(slot, 4u * row + 2u, pack(vec2<i32>(samples[4], samples[5])));
    store_pair(slot, 4u * row + 3u, pack(vec2<i32>(samples[6], samples[7])));
}
