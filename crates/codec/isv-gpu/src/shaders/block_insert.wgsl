// Enters blocks into their table.

struct Parameters { blocks: u32 }

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
/// Of zeros, but for its key.
@group(1) @binding(2) var<storage, read_write> table: array<atomic<u32>>;

@compute @workgroup_size(64)
fn insert(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = (group.y * groups.x + group.x) * 64u + thread;
    if block >= parameters.blocks {
        return;
    }
    let entries = arrayLength(&table) - 1u;
    var at = table_hash(blocks[block].xyz, atomicLoad(&table[0]), entries);
    // There are more entries than blocks.
    for (var tries = 0u; tries < entries; tries++) {
        let exchange = atomicCompareExchangeWeak(&table[at + 1u], 0u, block + 1u);
        if exchange.exchanged {
            return;
        }
        if exchange.old_value != 0u {
            at = (at + 1u) & (entries - 1u);
        }
    }
}
