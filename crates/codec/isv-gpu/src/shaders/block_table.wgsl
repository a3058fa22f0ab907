// A hash table of blocks by their coordinates (Sec. 3.6). Its first word is a key that nobody can know beforehand, so that no stream
// can be made whose blocks all begin at one entry. Then come entries, each one more than a block's index, or 0: a block is at the
// first free one from its hash on. There are a power of two of them, at least twice as many as blocks.

/// Stands for a block that is not there.
const NO_BLOCK = 0xffffffffu;

/// One step of the hash.
fn table_mix(hash: u32, word: u32) -> u32 {
    let h = (hash ^ word) * 0x9e3779b1u;
    return h ^ (h >> 15u);
}

/// The entry at which the search for a block begins.
fn table_hash(coord: vec3<i32>, key: u32, entries: u32) -> u32 {
    let c = bitcast<vec3<u32>>(coord);
    let h = table_mix(table_mix(table_mix(key, c.x), c.y), c.z) * 0x85ebca6bu;
    return (h ^ (h >> 13u)) & (entries - 1u);
}
