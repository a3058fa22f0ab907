// A plane through the inverse depths around each pixel that lie on the same surface, put into space (isv-fusion: planes, view).
// The inverse of depth is affine over the image where the surface is a plane.

struct PlaneParameters {
    view: View,
    /// Of the square of pixels that a plane is fitted to.
    radius: u32,
    /// Rows of inverse depths before the first of these, and all of them.
    above: u32,
    depth_rows: u32,
    /// By how much inverse depths on one surface may differ through noise, in 1/m.
    noise: f32,
    /// And through slant: for each pixel of distance, times the inverse depth; for the first fit and for the second.
    slants: vec2<f32>,
    /// In voxels.
    truncation: f32,
    /// In metres.
    voxel_size: f32,
}

@group(1) @binding(0) var<uniform> parameters: PlaneParameters;
/// Inverse depths in 1/m, 0 where there is no reading; with as many rows around as fits reach into.
@group(1) @binding(1) var<storage, read> inverse_depths: array<f32>;
@group(1) @binding(2) var<storage, read_write> surfels: array<Surfel>;

/// Shares of the surrounding pixels on the same surface at which a pixel begins to count, and counts in full.
const SUPPORT = vec2<f32>(0.35, 0.75);
/// Determinant of the pixels' positions below which they lie as good as in one line.
const LEAST_SPREAD = 0.05;
/// Least cosine of the angle between a ray and the normal of the surface it meets.
const LEAST_COSINE = 0.1;
/// Voxels from a surface, within which lie all corners of the cells that it passes through.
const CELL = 1.75;

/// The inverse depth around a pixel.
struct Fit {
    /// At the pixel.
    inverse_depth: f32,
    /// What a pixel to the right and a pixel down add.
    gradient: vec2<f32>,
    /// Pixels of the same surface.
    count: f32,
}

/// The inverse depth at a place, 0 outside the image.
fn inverse_depth(column: i32, row: i32) -> f32 {
    let width = i32(parameters.view.width);
    if column < 0 || column >= width || row < 0 || row >= i32(parameters.depth_rows) {
        return 0.0;
    }
    return inverse_depths[(row * width) + column];
}

/// The plane of least squares through the pixels that are as expected.
fn refit(column: i32, row: i32, centre: f32, expected: Fit, slant: f32) -> Fit {
    var count = 0.0;
    var at = vec2<f32>(0.0);
    // x^2, x y, y^2.
    var squares = vec3<f32>(0.0);
    var difference = 0.0;
    var moment = vec2<f32>(0.0);
    let radius = i32(parameters.radius);
    for (var dy = -radius; dy <= radius; dy++) {
        for (var dx = -radius; dx <= radius; dx++) {
            let beside = inverse_depth(column + dx, row + dy);
            let p = vec2<f32>(f32(dx), f32(dy));
            let r = beside - expected.inverse_depth;
            let off = r - dot(expected.gradient, p);
            if beside > 0.0 && abs(off) <= parameters.noise + (slant * length(p) * centre) {
                count += 1.0;
                at += p;
                squares += vec3<f32>(p.x * p.x, p.x * p.y, p.y * p.y);
                difference += r;
                moment += r * p;
            }
        }
    }
    let n = max(count, 1.0);
    let mean = at / n;
    let r = difference / n;
    let c = (squares / n) - vec3<f32>(mean.x * mean.x, mean.x * mean.y, mean.y * mean.y);
    let along = (moment / n) - (mean * r);
    let determinant = (c.x * c.z) - (c.y * c.y);
    // Pixels in one line say nothing about the slant across it.
    var gradient = vec2<f32>(0.0);
    if determinant > LEAST_SPREAD {
        gradient = vec2<f32>((c.z * along.x) - (c.y * along.y), (c.x * along.y) - (c.y * along.x)) / determinant;
    }
    return Fit(expected.inverse_depth + (r - dot(gradient, mean)), gradient, count);
}

/// A fit in space; of no weight where it is of no use.
fn surfel_of(fit: Fit, ray: vec3<f32>) -> Surfel {
    let side = f32((2u * parameters.radius) + 1u);
    let support = clamp(((fit.count / (side * side)) - SUPPORT.x) / (SUPPORT.y - SUPPORT.x), 0.0, 1.0);
    var surfel = Surfel(vec3<f32>(0.0), 0.0, 0.0, 0.0, 0.0);
    if fit.inverse_depth <= 0.0 || support <= 0.0 {
        return surfel;
    }
    // With Eq. 4 the inverse depth `i + gu (u - u0) + gv (v - v0)`, multiplied by z, is the plane `n . p = 1`.
    let along = vec3<f32>(fit.gradient * parameters.view.focal, 0.0);
    let normal = along + vec3<f32>(0.0, 0.0, fit.inverse_depth - dot(along, ray));
    let size = length(normal);
    let cosine = fit.inverse_depth / (size * length(ray));
    if cosine < LEAST_COSINE {
        return surfel;
    }
    surfel.normal = normal / size;
    surfel.distance = 1.0 / (size * parameters.voxel_size);
    surfel.band = max(parameters.truncation * cosine, CELL);
    // The noise of depth grows with its square, and so does the area that a pixel stands for.
    let seen = cosine * fit.inverse_depth;
    surfel.weight = support * (seen * seen);
    surfel.free = select(0.0, surfel.weight, support >= 1.0);
    return surfel;
}

@compute @workgroup_size(64)
fn fit_planes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let view = parameters.view;
    let pixel = (((group.y * groups.x) + group.x) * 64u) + thread;
    if pixel >= view.width * view.rows {
        return;
    }
    let column = i32(pixel % view.width);
    let row = i32((pixel / view.width) + parameters.above);
    let centre = inverse_depth(column, row);
    // Surfaces are expected to face the camera first, and then to follow the first fit.
    var fit = Fit(centre, vec2<f32>(0.0), 0.0);
    if centre > 0.0 {
        fit = refit(column, row, centre, fit, parameters.slants.x);
        fit = refit(column, row, centre, fit, parameters.slants.y);
    }
    surfels[view.surfels + pixel] = surfel_of(fit, ray_at(view, place_of(view, pixel)));
}
