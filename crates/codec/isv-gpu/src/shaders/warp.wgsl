// Prediction of a block from the frame before by rigid motion, and its residual (profile `paper`, Sec. 3.5; isv-kernels: warp).

struct WarpParameters {
    scale: Scale,
    truncation: i32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: WarpParameters;
/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinates of this frame's blocks.
@group(1) @binding(3) var<storage, read> coords: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read> moved: array<MovedBlock>;
@group(1) @binding(5) var<storage, read> levels: array<u32>;

@compute @workgroup_size(64)
fn warp(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.count {
        return;
    }
    let to = moved[block];
    var row = predicted_row(thread, coords[block].xyz, to, parameters.truncation);
    row = add_residual(thread, row, to.levels, to.level_count, parameters.scale, parameters.truncation);
    store_row(to.slot, thread, row);
}
