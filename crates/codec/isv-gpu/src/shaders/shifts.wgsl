// Where the frame before has the surface of blocks that move as one, a cube of 4^3 or 2^3 of them or one alone: damped Gauss-Newton
// on the voxels near the surface (profile `main`; isv-encode: main, motion_search). Lengths are voxels.

struct ShiftParameters {
    truncation: i32,
    /// Groups of this dispatch.
    first: u32,
    count: u32,
    /// Base-2 logarithm of the edge of their cubes in blocks.
    log2_edge: u32,
    /// Of their blocks, one row in so many is looked at; a power of two.
    every: u32,
    /// Steps at most.
    steps: u32,
    /// Weight of voxels near the surface that are not at the ends of crossed edges.
    near_weight: f32,
}

/// Blocks that move as one.
struct Group {
    /// The first of them, and how many there are.
    first: u32,
    count: u32,
    /// The larger cubes that they are in; NO_BLOCK where there is none.
    larger: vec2<u32>,
    /// Vectors of the frame before to start from, as `vectors.wgsl` has them.
    before: vec2<u32>,
}

@group(1) @binding(0) var<uniform> parameters: ShiftParameters;
/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinates and slots of the blocks that are looked for.
@group(1) @binding(3) var<storage, read> sources: array<vec4<i32>>;
/// For each of them a bit a voxel: those at the ends of crossed edges, then those that were not observed.
@group(1) @binding(4) var<storage, read> marks: array<u32>;
@group(1) @binding(5) var<storage, read> block_groups: array<Group>;
/// The best shift of each group, and its error.
@group(1) @binding(6) var<storage, read_write> shifts: array<vec4<f32>>;

const CODES_PER_VOXEL = 256.0;
/// Words of a block's marks of each kind.
const MARK_WORDS = 16u;
/// Weight of voxels at the ends of crossed edges, and how near to the surface others are that have a weight, in codes.
const CROSSED = 1.0;
const NEAR_CODES = 384;
/// Largest step, largest shift, and the shortest step that is taken.
const LONGEST_STEP = 2.0;
const LIMIT = 31.0;
const SHORTEST_STEP = 0.02;
/// Added to the diagonal of the normal equations, absolutely and as a share.
const DAMPING = 0.5;
const RELATIVE_DAMPING = 0.01;
/// Stop when a step leaves more than this share of the error.
const LEAST_IMPROVEMENT = 0.99;
/// Starting points nearer than this along all axes are the same.
const CLOSE = 0.3;
const STARTS = 5u;

/// What is summed for a step: xx, xy, xz, yy, yz and zz of `J^T W J`, x, y and z of `J^T W r`, and `r^T W r`.
const TERMS = 10u;
/// Words of a thread's terms: one more, so that threads that add up terms read from different banks.
const TERMS_STRIDE = 11u;
/// Blocks along the edge of a displaced cube, at most.
const SIDE = 5;

var<workgroup> terms: array<f32, 704>;
var<workgroup> totals: array<f32, 10>;
var<workgroup> starts: array<vec3<f32>, 5>;
var<workgroup> start_count: u32;
/// Where the group is looked for.
var<workgroup> shift: vec3<f32>;
var<workgroup> goes_on: u32;
/// Slots of the blocks that the displaced cube touches, from `lowest` on, or NO_BLOCK.
var<workgroup> touched: array<u32, 125>;
var<workgroup> lowest: vec3<i32>;

/// Eight voxels of a block that is looked for.
struct Row {
    /// y and z within the block.
    y: i32,
    z: i32,
    samples: array<i32, 8>,
    /// Observed voxels at the ends of crossed edges, and others near the surface.
    crossed: u32,
    near: u32,
}

/// The `n`th row of a block that is looked at.
fn sought_row(block: u32, n: u32) -> Row {
    let along = 8u / parameters.every;
    let z = n / along;
    // Those with y + 2 z a multiple of `every`.
    let y = parameters.every * (n % along) + ((2u * z) & (parameters.every - 1u));
    let row = 8u * z + y;
    let mark = 2u * MARK_WORDS * block + (row >> 2u);
    let bit = 8u * (row & 3u);
    let observed = (~marks[mark + MARK_WORDS] >> bit) & 255u;
    let crossed = (marks[mark] >> bit) & observed;
    let samples = load_row(bitcast<u32>(sources[block].w), row);
    var near = 0u;
    for (var x = 0u; x < 8u; x++) {
        near |= select(0u, 1u << x, abs(samples[x]) < NEAR_CODES);
    }
    return Row(i32(y), i32(z), samples, crossed, near & observed & ~crossed);
}

/// How much a voxel tells of motion.
fn weight_of(row: Row, x: u32) -> f32 {
    let near = select(0.0, parameters.near_weight, ((row.near >> x) & 1u) != 0u);
    return select(near, CROSSED, ((row.crossed >> x) & 1u) != 0u);
}

/// A sample of the frame before, in codes, by its place from the first voxel of `lowest` on. `centre`: the block from which it is
/// looked at.
fn field(at: vec3<i32>, from_block: vec3<i32>, centre: vec3<i32>) -> f32 {
    let block = at >> vec3<u32>(3u);
    let slot = touched[block.x + SIDE * (block.y + SIDE * block.z)];
    if slot == NO_BLOCK {
        return f32(select(parameters.truncation, -parameters.truncation, is_inside_towards(centre, from_block + block)));
    }
    let voxel = at & vec3<i32>(7);
    return f32(load_sample(slot, u32(voxel.x + 8 * voxel.y + 64 * voxel.z)));
}

/// The samples at a place and beside it: at (y, z) = 00, 10, 01 and 11.
fn face(at: vec3<i32>, from_block: vec3<i32>, centre: vec3<i32>) -> vec4<f32> {
    return vec4<f32>(
        field(at, from_block, centre), field(at + vec3<i32>(0, 1, 0), from_block, centre),
        field(at + vec3<i32>(0, 0, 1), from_block, centre), field(at + vec3<i32>(0, 1, 1), from_block, centre),
    );
}

/// Finds the blocks that the group touches at a shift, unless they are those that it touched last.
fn find_touched(thread: u32, from_block: vec3<i32>) {
    if all(workgroupUniformLoad(&lowest) == from_block) {
        return;
    }
    let side = (1u << parameters.log2_edge) + 1u;
    for (var i = thread; i < side * side * side; i += 64u) {
        let offset = bitcast<vec3<i32>>(vec3<u32>(i % side, i / side % side, i / (side * side)));
        let found = find_block(from_block + offset);
        var slot = NO_BLOCK;
        if found != NO_BLOCK {
            slot = bitcast<u32>(blocks[found].w);
        }
        touched[offset.x + SIDE * (offset.y + SIDE * offset.z)] = slot;
    }
    if thread == 0u {
        lowest = from_block;
    }
    workgroupBarrier();
}

/// Sums the normal equations of a group at its shift. Large residuals are not believed as much: they may be another surface.
fn sum_equations(thread: u32, group: Group, first_block: vec3<i32>) {
    let place = workgroupUniformLoad(&shift);
    let whole = vec3<i32>(floor(place));
    let fraction = place - floor(place);
    let from_block = first_block + (whole >> vec3<u32>(3u));
    let within = whole & vec3<i32>(7);
    // The vector that leads there, and from it the block that is at most four voxels away.
    let quarters = vec3<i32>(floor(4.0 * place + 0.5));
    let way = (quarters + vec3<i32>(16)) >> vec3<u32>(5u);
    find_touched(thread, from_block);
    var xx = vec3<f32>(0.0);
    var yz = vec3<f32>(0.0);
    var gradient = vec3<f32>(0.0);
    var error = 0.0;
    let rows = 64u / parameters.every;
    for (var i = thread; i < group.count * rows; i += 64u) {
        let block = group.first + i / rows;
        let coord = sources[block].xyz;
        let row = sought_row(block, i % rows);
        if (row.crossed | row.near) == 0u {
            continue;
        }
        let start = 8 * (coord - first_block) + within + vec3<i32>(0, row.y, row.z);
        let centre = coord + way;
        // The far face of one voxel is the near face of the next.
        var near = face(start, from_block, centre);
        for (var x = 0u; x < 8u; x++) {
            let far = face(start + vec3<i32>(i32(x) + 1, 0, 0), from_block, centre);
            let sample = f32(row.samples[x]) / CODES_PER_VOXEL;
            let weight = weight_of(row, x);
            let s = far - near;
            let v = near + fraction.x * s;
            let along_y = vec2<f32>(v.y - v.x, v.w - v.z);
            let slope_x = s.xz + fraction.y * (s.yw - s.xz);
            let value = v.xz + fraction.y * along_y;
            let slope = vec3<f32>(
                mix(slope_x.x, slope_x.y, fraction.z), mix(along_y.x, along_y.y, fraction.z), value.y - value.x,
            ) / CODES_PER_VOXEL;
            let residual = mix(value.x, value.y, fraction.z) / CODES_PER_VOXEL - sample;
            let squared = residual * residual;
            error += weight * squared;
            let weighted = (weight / (squared + 1.0)) * slope;
            gradient += residual * weighted;
            xx += weighted.x * slope;
            yz += weighted.yyz * slope.yzz;
            near = far;
        }
    }
    let all_terms = array<f32, 10>(
        xx.x, xx.y, xx.z, yz.x, yz.y, yz.z, gradient.x, gradient.y, gradient.z, error,
    );
    for (var term = 0u; term < TERMS; term++) {
        terms[TERMS_STRIDE * thread + term] = all_terms[term];
    }
    workgroupBarrier();
    if thread < TERMS {
        var total = 0.0;
        for (var row = 0u; row < 64u; row++) {
            total += terms[TERMS_STRIDE * row + thread];
        }
        totals[thread] = total;
    }
    workgroupBarrier();
}

/// The damped step, by Cramer's rule: the matrix is positive definite.
fn damped_step() -> vec3<f32> {
    let diagonal = vec3<f32>(totals[0], totals[3], totals[5]) * (1.0 + RELATIVE_DAMPING) + vec3<f32>(DAMPING);
    let xx = vec3<f32>(diagonal.x, totals[1], totals[2]);
    let yy = vec3<f32>(totals[1], diagonal.y, totals[4]);
    let zz = vec3<f32>(totals[2], totals[4], diagonal.z);
    let gradient = vec3<f32>(totals[6], totals[7], totals[8]);
    // The rows of the adjugate, which is symmetric as the matrix is.
    let x = cross(yy, zz);
    let y = cross(zz, xx);
    let z = cross(xx, yy);
    return vec3<f32>(dot(x, gradient), dot(y, gradient), dot(z, gradient)) / dot(xx, x);
}

/// Adds a point to start from, unless there is one close to it. For one thread.
fn add_start(start: vec3<f32>) {
    for (var known = 0u; known < start_count; known++) {
        if all(abs(starts[known] - start) < vec3<f32>(CLOSE)) {
            return;
        }
    }
    starts[start_count] = start;
    start_count++;
}

/// Where the search of a group starts: no motion, those of the larger cubes it is in, and those of the frame before.
fn find_starts(group: Group) {
    start_count = 0u;
    add_start(vec3<f32>(0.0));
    for (var i = 0u; i < 2u; i++) {
        if group.larger[i] != NO_BLOCK {
            add_start(shifts[group.larger[i]].xyz);
        }
    }
    for (var i = 0u; i < 2u; i++) {
        if has_vector(group.before[i]) {
            add_start(vec3<f32>(vector_of(group.before[i])) / 4.0);
        }
    }
}

@compute @workgroup_size(64)
fn find_shifts(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = workgroup.y * workgroups.x + workgroup.x;
    if number >= parameters.count {
        return;
    }
    let group = block_groups[parameters.first + number];
    let log2_edge = vec3<u32>(parameters.log2_edge);
    let first_block = (sources[group.first].xyz >> log2_edge) << log2_edge;
    if thread == 0u {
        find_starts(group);
        // Nowhere yet.
        lowest = vec3<i32>(2147483647);
    }
    // The first thread's: shifts and their errors, of all starts and of the one at hand.
    var best = vec4<f32>(0.0);
    var local = vec4<f32>(0.0);
    let count = workgroupUniformLoad(&start_count);
    for (var start = 0u; start < min(count, STARTS); start++) {
        if thread == 0u {
            shift = starts[start];
        }
        for (var step = 0u; step <= parameters.steps; step++) {
            sum_equations(thread, group, first_block);
            if thread == 0u {
                let error = totals[9];
                let improved = step == 0u || error < local.w * LEAST_IMPROVEMENT;
                if step == 0u || error < local.w {
                    local = vec4<f32>(shift, error);
                }
                let change = damped_step();
                let size = abs(change);
                let longest = max(max(LONGEST_STEP, size.x), max(size.y, size.z));
                shift = clamp(shift - change * (LONGEST_STEP / longest), vec3<f32>(-LIMIT), vec3<f32>(LIMIT));
                goes_on = select(0u, 1u, improved && any(size >= vec3<f32>(SHORTEST_STEP)));
            }
            if workgroupUniformLoad(&goes_on) == 0u {
                break;
            }
        }
        if thread == 0u && (start == 0u || local.w < best.w) {
            best = local;
        }
    }
    if thread == 0u {
        shifts[parameters.first + number] = best;
    }
}
