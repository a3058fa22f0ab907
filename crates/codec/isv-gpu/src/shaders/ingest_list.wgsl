// Lists the triangles of each block of a part: a thread a triangle. Their order is anybody's; nothing depends on it.

/// Coordinate and slot.
@group(1) @binding(3) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read> table: array<u32>;
/// For each block of the part where its next triangle goes.
@group(1) @binding(5) var<storage, read_write> next: array<atomic<u32>>;
@group(1) @binding(6) var<storage, read_write> lists: array<u32>;

@compute @workgroup_size(64)
fn list_triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let triangle = (group.y * groups.x + group.x) * 64u + thread;
    if triangle >= parameters.ends.z {
        return;
    }
    visit_reached(triangle);
}

/// Enters a triangle into the list of a block, if that is in the part.
fn visit(triangle: u32, place: vec3<i32>) {
    let block = find_block(parameters.origin + place);
    // Below the first it wraps around.
    let number = block - parameters.part.x;
    if block != NO_BLOCK && number < parameters.part.y {
        let at = atomicAdd(&next[number], 1u);
        if at < arrayLength(&lists) {
            lists[at] = triangle;
        }
    }
}
