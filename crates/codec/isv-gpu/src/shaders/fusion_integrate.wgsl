// What views say about voxels (isv-fusion: integrate; Eq. 3 to 5). A thread adds up one voxel's readings, view after view, so that
// sums do not depend on which thread comes first.

struct IntegrateParameters {
    blocks: u32,
    /// Base-2 logarithm of a block's edge in voxels.
    edge: u32,
    views: u32,
    /// Whether there are no sums yet.
    fresh: u32,
    /// What sums are scaled down to afterwards; 0 to leave them.
    most_weight: f32,
}

@group(1) @binding(0) var<uniform> parameters: IntegrateParameters;
/// Their centres in voxels.
@group(1) @binding(1) var<storage, read> views: array<View>;
@group(1) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(1) @binding(3) var<storage, read> coords: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read_write> sums: array<f32>;

/// What a reading counts to a voxel behind its band: nothing beside any other reading.
const HIDDEN = 1e-30;
/// How far behind a surface, in voxels, a reading still counts in full.
const BEHIND = 0.75;

/// What a reading at a distance counts: behind a surface less with the fourth power.
fn share(s: f32) -> f32 {
    let beyond = max(-s - BEHIND, 0.0);
    return 1.0 / (1.0 + ((beyond * beyond) * (beyond * beyond)));
}

/// What a view adds to the sums of the voxel at whole coordinates.
fn reading(view: View, voxel: vec3<i32>) -> vec3<f32> {
    let p = to_camera(view, vec3<f32>(voxel - view.centre) + (0.5 - view.rest));
    if p.z <= 0.0 {
        return vec3<f32>(0.0);
    }
    let place = ((view.focal * p.xy) / p.z) + view.principal + 0.5;
    let low = vec2<f32>(0.0, f32(view.first_row));
    let high = vec2<f32>(f32(view.width), f32(view.first_row + view.rows));
    // Also what is no number is not inside.
    if !(all(place >= low) && all(place < high)) {
        return vec3<f32>(0.0);
    }
    let pixel = vec2<u32>(place);
    let surfel = surfels[view.surfels + ((pixel.y - view.first_row) * view.width) + pixel.x];
    let s = surfel.distance - dot(surfel.normal, p);
    if s > surfel.band {
        return vec3<f32>(0.0, 0.0, surfel.free);
    }
    if s < -surfel.band {
        return vec3<f32>(select(0.0, HIDDEN, surfel.weight > 0.0), 0.0, 0.0);
    }
    let within = surfel.weight * share(s);
    return vec3<f32>(within, within * s, 0.0);
}

@compute @workgroup_size(64)
fn integrate(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    // A block has a multiple of 64 voxels.
    let size = 1u << (3u * parameters.edge);
    let number = (((group.y * groups.x) + group.x) * 64u) + thread;
    let block = number / size;
    if block >= parameters.blocks {
        return;
    }
    let i = number % size;
    let mask = (1u << parameters.edge) - 1u;
    let within = vec3<u32>(i & mask, (i >> parameters.edge) & mask, i >> (2u * parameters.edge));
    let voxel = (coords[block].xyz << vec3<u32>(parameters.edge)) + vec3<i32>(within);
    let at = sums_at(block, size, i);
    var sum = vec3<f32>(0.0);
    if parameters.fresh == 0u {
        sum = vec3<f32>(sums[at], sums[at + size], sums[at + (2u * size)]);
    }
    for (var view = 0u; view < parameters.views; view++) {
        sum += reading(views[view], voxel);
    }
    let weight = sum.x + sum.z;
    if parameters.most_weight > 0.0 && weight > parameters.most_weight {
        sum *= parameters.most_weight / weight;
    }
    sums[at] = sum.x;
    sums[at + size] = sum.y;
    sums[at + (2u * size)] = sum.z;
}
