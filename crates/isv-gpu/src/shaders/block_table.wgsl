// A hash table of blocks by their coordinates (Sec. 3.6). Each entry is one more than a block's index, or 0; a block is at the
// first free entry from its hash on. Its size is a power of two, at least twice the number of blocks.

/// Stands for a block that is not there.
const NO_BLOCK = 0xffffffffu;

/// Where the search for a block begins.
fn table_hash(coord: vec3<i32>, entries: u32) -> u32 {
    let c = bitcast<vec3<u32>>(coord);
    var h = (c.x * 0x8da6b343u) ^ (c.y * 0xd8163841u) ^ (c.z * 0xcb1ab31fu);
    h ^= h >> 15u;
    h *= 0x2c1b3c6du;
    h ^= h >> 13u;
    return h & (entries - 1u);
}
