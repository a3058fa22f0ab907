// Winding numbers along lines of blocks one behind the other along x: a workgroup a line, a thread a row. To each block is added what
// there is before it.

struct Parameters { lines: u32 }

@group(1) @binding(0) var<uniform> parameters: Parameters;
/// Coordinate and slot.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
/// Blocks line after line, each along x.
@group(1) @binding(2) var<storage, read> order: array<u32>;
/// Where each line begins, and where the last one ends.
@group(1) @binding(3) var<storage, read> lines: array<u32>;

@compute @workgroup_size(64)
fn carry(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let line = group.y * groups.x + group.x;
    if line >= parameters.lines {
        return;
    }
    var before = 0;
    for (var i = lines[line]; i < lines[line + 1u]; i++) {
        let slot = bitcast<u32>(blocks[order[i]].w);
        var numbers = load_row(slot, thread);
        let change = numbers[7];
        if before != 0 {
            for (var x = 0u; x < 8u; x++) {
                numbers[x] += before;
            }
            store_row(slot, thread, numbers);
        }
        before += change;
    }
}
