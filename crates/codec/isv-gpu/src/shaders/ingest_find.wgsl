// Which blocks are reached by triangles, and by how many: a thread a triangle. The table is made as it is filled (Sec. 3.6).

/// Keys, each one more than a block's coordinates from the origin, or 0.
@group(1) @binding(3) var<storage, read_write> keys: array<atomic<u32>>;
/// Triangles of each, then whether there was no room, then what hashes begin with.
@group(1) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

/// Entries that are looked at before the table counts as full.
const MOST_TRIES = 64u;

@compute @workgroup_size(64)
fn find_reached(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let triangle = (group.y * groups.x + group.x) * 64u + thread;
    if triangle >= parameters.ends.z {
        return;
    }
    visit_reached(triangle);
}

/// Counts a triangle of a block.
fn visit(_triangle: u32, block: vec3<i32>) {
    let c = bitcast<vec3<u32>>(block);
    let key = 1u + (c.x | (c.y << parameters.key_bits.x) | (c.z << (parameters.key_bits.x + parameters.key_bits.y)));
    var at = table_hash(block, atomicLoad(&counts[parameters.entries + 1u]), parameters.entries);
    for (var tries = 0u; tries < MOST_TRIES; tries++) {
        var known = atomicLoad(&keys[at]);
        if known == 0u {
            let exchange = atomicCompareExchangeWeak(&keys[at], 0u, key);
            known = select(exchange.old_value, key, exchange.exchanged);
        }
        if known == key {
            atomicAdd(&counts[at], 1u);
            return;
        }
        // Where an exchange failed for no reason, the same entry is tried again.
        at = (at + select(0u, 1u, known != 0u)) & (parameters.entries - 1u);
    }
    atomicStore(&counts[parameters.entries], 1u);
}
