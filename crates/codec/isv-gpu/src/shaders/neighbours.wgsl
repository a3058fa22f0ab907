// The blocks around a workgroup's block. Whoever includes this looks blocks up (block_find).

/// Indices of the block and those around it, or NO_BLOCK: x fastest, the block itself in the middle.
var<workgroup> around: array<u32, 27>;

/// The block itself, among those around it.
const MIDDLE = 13u;

/// Places in `around`, one bit each: all, the block and its neighbours towards plus, and those straight along an axis only.
const ALL_AROUND = 0x07ffffffu;
const OCTET = 0x06c36000u;
const AHEAD = 0x00416000u;

/// Looks up the wanted blocks around a block; a barrier has to follow.
fn look_around(block: u32, wanted: u32, thread: u32) {
    if thread < 27u && ((wanted >> thread) & 1u) != 0u {
        let offset = vec3<u32>(thread % 3u, thread / 3u % 3u, thread / 9u);
        around[thread] = find_block(blocks[block].xyz + vec3<i32>(offset) - 1);
    }
}
