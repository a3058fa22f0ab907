// How many rays each pixel is cut into so that they pass by no block (isv-fusion: allocation). Lengths are in voxels.

struct CountParameters {
    view: View,
    /// Voxels.
    block_edge: f32,
}

@group(1) @binding(0) var<uniform> parameters: CountParameters;
@group(1) @binding(1) var<storage, read> surfels: array<Surfel>;
/// Of each pixel: its rays, and the area that it covers across them in whole block faces. Zeros after the last pixel, where the
/// sums will be.
@group(1) @binding(2) var<storage, read_write> counts: array<vec2<u32>>;

/// Rays of a pixel along each side, whose square is a `u32`.
const MOST_PARTS = 65535.0;
/// Block faces that a pixel covers at most, for the same reason.
const MOST_AREA = 4.0e9;

@compute @workgroup_size(64)
fn count_rays(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let view = parameters.view;
    let pixel = (((group.y * groups.x) + group.x) * 64u) + thread;
    let pixels = view.width * view.rows;
    if pixel > pixels {
        return;
    }
    var count = vec2<u32>(0u);
    if pixel < pixels {
        let surfel = surfels[view.surfels + pixel];
        if surfel.weight > 0.0 {
            let ray = ray_at(view, place_of(view, pixel));
            let depth = point_along(surfel, ray).z / parameters.block_edge;
            let across = depth / min(view.focal.x, view.focal.y);
            let parts = u32(clamp(ceil((2.0 * across) / cosine_along(surfel, ray)), 1.0, MOST_PARTS));
            let area = (depth / view.focal.x) * (depth / view.focal.y);
            count = vec2<u32>(parts * parts, u32(min(area, MOST_AREA)));
        }
    }
    counts[pixel] = count;
}
