// Motion of a block by damped Gauss-Newton on the trilinear frame before (Sec. 3.5, Eq. 12 to 14; isv-encode: motion_search).

struct SearchParameters {
    truncation: i32,
    count: u32,
    /// Whether rotation is looked for too.
    rotates: u32,
    /// Sine and cosine of `i` steps of a rotation times 2^14, 16 bits each, at `[i / 4]`.
    angles: array<vec4<u32>, 9>,
}

@group(1) @binding(0) var<uniform> parameters: SearchParameters;
/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinates and slots of the frame to be coded.
@group(1) @binding(3) var<storage, read> sources: array<vec4<i32>>;
/// Whether each of them has a reference.
@group(1) @binding(4) var<storage, read> has_reference: array<u32>;
/// Translation and rotation in their steps, a byte a component, x lowest.
@group(1) @binding(5) var<storage, read_write> vectors: array<vec2<u32>>;

const ITERATIONS = 10u;
/// Stop when a step leaves more than this share of the squared error.
const LEAST_IMPROVEMENT = 0.995;
/// Fewest voxels of a block inside the truncation band that say anything about motion.
const FEWEST_RELIABLE = 32u;
/// Components of a vector as they are coded.
const STEPS_PER_VOXEL = 4.0;
const TRANSLATION_LIMIT = 28.0;
const STEPS_PER_RADIAN = 32.0;
const ROTATION_LIMIT = 32.0;

var<workgroup> is_done: u32;
/// Voxels inside the truncation band.
var<workgroup> reliable: atomic<u32>;
/// Squared errors of a vector and of standing still: lower 16 bits and what is above, summed apart.
var<workgroup> errors: array<atomic<u32>, 4>;

/// Gauss-Newton from the motion so far, in three or six unknowns.
fn descend(thread: u32, rotates: bool, targets: array<i32, 8>) {
    // The first thread's.
    var best_error = 0.0;
    var best = motion;
    for (var iteration = 0u; iteration < ITERATIONS; iteration++) {
        sum_row(thread, rotates, targets);
        if thread == 0u {
            let error = totals[SQUARED_ERROR];
            let is_first = iteration == 0u;
            let has_improved = is_first || error < best_error * LEAST_IMPROVEMENT;
            if is_first || error < best_error {
                best_error = error;
                best = motion;
            }
            var goes_on = has_improved;
            if goes_on {
                goes_on = take_step(select(3u, 6u, rotates));
            }
            if goes_on && rotates {
                set_turn();
            }
            is_done = select(1u, 0u, goes_on);
        }
        if workgroupUniformLoad(&is_done) != 0u {
            break;
        }
    }
    if thread == 0u {
        motion = best;
        if rotates {
            set_turn();
        }
    }
    workgroupBarrier();
}

/// Components in steps, halves away from zero.
fn in_steps(values: vec3<f32>, steps: f32, limit: f32) -> vec3<i32> {
    let scaled = values * steps;
    return vec3<i32>(clamp(sign(scaled) * floor(abs(scaled) + 0.5), vec3<f32>(-limit), vec3<f32>(limit)));
}

/// Sine and cosine of steps of a rotation, times 2^14.
fn angle(steps: i32) -> vec2<i32> {
    let size = abs(steps);
    let pair = unpack(parameters.angles[size >> 2u][size & 3]);
    return vec2<i32>(sign(steps) * pair.x, pair.y);
}

fn angle_product(a: i32, b: i32) -> i32 {
    return (a * b + (1 << 13u)) >> 14u;
}

/// Rotation and translation as `moved_row` takes them.
fn exact_motion(translation: vec3<i32>, rotation: vec3<i32>) -> array<i32, 12> {
    let x = angle(rotation.x);
    let y = angle(rotation.y);
    let z = angle(rotation.z);
    let yx_sine = angle_product(y.x, x.x);
    let yx_cosine = angle_product(y.x, x.y);
    return array<i32, 12>(
        angle_product(z.y, y.y),
        angle_product(z.y, yx_sine) - angle_product(z.x, x.y),
        angle_product(z.y, yx_cosine) + angle_product(z.x, x.x),
        angle_product(z.x, y.y),
        angle_product(z.x, yx_sine) + angle_product(z.y, x.y),
        angle_product(z.x, yx_cosine) - angle_product(z.y, x.x),
        -y.x, angle_product(y.y, x.x), angle_product(y.y, x.y),
        translation.x, translation.y, translation.z,
    );
}

/// Adds a row's squared error to sums of its lower and upper parts.
fn add_error(sum: u32, row: array<i32, 8>, targets: array<i32, 8>) {
    var squares = 0u;
    for (var x = 0u; x < 8u; x++) {
        let difference = row[x] - targets[x];
        squares += u32(difference * difference);
    }
    atomicAdd(&errors[sum], squares & 0xffffu);
    atomicAdd(&errors[sum + 1u], squares >> 16u);
}

/// A sum from its lower and upper parts: 16 bits, and what is above.
fn whole_error(sum: u32) -> vec2<u32> {
    let low = atomicLoad(&errors[sum]);
    return vec2<u32>(low & 0xffffu, atomicLoad(&errors[sum + 1u]) + (low >> 16u));
}

fn pack_bytes(v: vec3<i32>) -> u32 {
    let bytes = bitcast<vec3<u32>>(v) & vec3<u32>(255u);
    return bytes.x | (bytes.y << 8u) | (bytes.z << 16u);
}

@compute @workgroup_size(64)
fn search(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = group.y * groups.x + group.x;
    if block >= parameters.count {
        return;
    }
    if has_reference[block] == 0u {
        if thread == 0u {
            vectors[block] = vec2<u32>(0u);
        }
        return;
    }
    let source = sources[block];
    let targets = load_row(bitcast<u32>(source.w), thread);
    if thread == 0u {
        atomicStore(&reliable, 0u);
        for (var i = 0u; i < 4u; i++) {
            atomicStore(&errors[i], 0u);
        }
        for (var i = 0u; i < 6u; i++) {
            motion[i] = 0.0;
        }
        turn = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    workgroupBarrier();
    var within = 0u;
    for (var x = 0u; x < 8u; x++) {
        within += select(0u, 1u, abs(targets[x]) < parameters.truncation);
    }
    atomicAdd(&reliable, within);
    find_neighbourhood(thread, source.xyz, parameters.truncation);
    load_middle(thread);
    if thread == 0u {
        is_done = select(0u, 1u, atomicLoad(&reliable) < FEWEST_RELIABLE);
    }
    if workgroupUniformLoad(&is_done) != 0u {
        if thread == 0u {
            vectors[block] = vec2<u32>(0u);
        }
        return;
    }
    descend(thread, false, targets);
    if parameters.rotates != 0u {
        descend(thread, true, targets);
    }
    let translation = in_steps(vec3<f32>(motion[0], motion[1], motion[2]), STEPS_PER_VOXEL, TRANSLATION_LIMIT);
    let rotation = in_steps(vec3<f32>(motion[3], motion[4], motion[5]), STEPS_PER_RADIAN, ROTATION_LIMIT);
    add_error(0u, moved_row(thread, exact_motion(translation, rotation)), targets);
    add_error(2u, load_row(around[13], thread), targets);
    workgroupBarrier();
    if thread == 0u {
        let moving = whole_error(0u);
        let still = whole_error(2u);
        let is_better = moving.y < still.y || (moving.y == still.y && moving.x < still.x);
        vectors[block] = select(vec2<u32>(0u), vec2<u32>(pack_bytes(translation), pack_bytes(rotation)), is_better);
    }
}
