// Looks blocks up. Whoever includes this binds `blocks`, an array of coordinates and slots, and their `table`.

/// The index of the block at a coordinate, or NO_BLOCK.
fn find_block(coord: vec3<i32>) -> u32 {
    let entries = arrayLength(&table) - 1u;
    var at = table_hash(coord, table[0], entries);
    for (var tries = 0u; tries < entries; tries++) {
        let entry = table[at + 1u];
        if entry == 0u {
            return NO_BLOCK;
        }
        if all(blocks[entry - 1u].xyz == coord) {
            return entry - 1u;
        }
        at = (at + 1u) & (entries - 1u);
    }
    return NO_BLOCK;
}
