// The linear system of a Gauss-Newton step and the step (Eq. 12 to 14; isv-encode: normal_equations). Lengths are voxels, both of
// positions and of signed distances. The sums over a block are taken in the same order on every GPU, but not in the CPU's.

/// Largest translation in one step, in voxels, and largest rotation, in radians (5 degrees).
const TRANSLATION_STEP = 1.0;
const ROTATION_STEP = 0.08726646;
/// Damping of Eq. 14: absolute, in squared voxels of gradient summed over the block, and relative to the diagonal.
const DAMPING = 0.5;
const RELATIVE_DAMPING = 0.01;
const CODES_PER_VOXEL = 256.0;

/// What is summed over a block for a step: the lower triangle of `J^T J` row by row, `J^T e`, and `e^2`.
const GRADIENT = 21u;
const SQUARED_ERROR = 27u;
const TERMS = 28u;
/// Words of a thread's terms: one more, so that threads that add up terms read from different banks.
const TERMS_STRIDE = 29u;

/// The middle 16^3 samples of the neighbourhood, two to a word.
var<workgroup> middle: array<u32, 2048>;
var<workgroup> terms: array<f32, 1856>;
var<workgroup> totals: array<f32, 28>;
/// Translation x, y, z in voxels, then Euler angles in radians; and their rotation.
var<workgroup> motion: array<f32, 6>;
var<workgroup> turn: mat3x3<f32>;

/// Loads the middle of the neighbourhood that was found.
fn load_middle(thread: u32) {
    for (var i = thread; i < 2048u; i += 64u) {
        let at = vec3<u32>(2u * (i & 7u), (i >> 3u) & 15u, i >> 7u) + vec3<u32>(4u);
        let block = at >> vec3<u32>(3u);
        let voxel = at & vec3<u32>(7u);
        let place = block.x + 3u * block.y + 9u * block.z;
        let slot = around[place];
        if slot == NO_BLOCK {
            middle[i] = pack(vec2<i32>(fills[place]));
        } else {
            middle[i] = load_pair(slot, (voxel.x + 8u * voxel.y + 64u * voxel.z) >> 1u);
        }
    }
}

/// A sample of the neighbourhood, in codes.
fn field(at: vec3<i32>) -> f32 {
    let inner = bitcast<vec3<u32>>(at - vec3<i32>(4));
    if any(inner > vec3<u32>(15u)) {
        return f32(neighbourhood_sample(at));
    }
    let pair = unpack(middle[(inner.x >> 1u) + 8u * inner.y + 128u * inner.z]);
    return f32(select(pair.x, pair.y, (inner.x & 1u) != 0u));
}

/// The samples at a place and beside it: at (y, z) = 00, 10, 01 and 11.
fn face(at: vec3<i32>) -> vec4<f32> {
    return vec4<f32>(
        field(at), field(at + vec3<i32>(0, 1, 0)), field(at + vec3<i32>(0, 0, 1)), field(at + vec3<i32>(0, 1, 1)),
    );
}

/// Value and gradient (x, y, z, then the value) inside a cell with these faces, in codes.
fn trilinear(near: vec4<f32>, far: vec4<f32>, fraction: vec3<f32>) -> vec4<f32> {
    let s = far - near;
    let v = near + fraction.x * s;
    let along_y = vec2<f32>(v.y - v.x, v.w - v.z);
    let slope = s.xz + fraction.y * (s.yw - s.xz);
    let value = v.xz + fraction.y * along_y;
    return vec4<f32>(
        slope.x + fraction.z * (slope.y - slope.x),
        along_y.x + fraction.z * (along_y.y - along_y.x),
        value.y - value.x,
        value.x + fraction.z * (value.y - value.x),
    );
}

/// A thread's terms of a step: of the voxels of a row, 8 z + y being the thread.
fn sum_row(thread: u32, rotates: bool, targets: array<i32, 8>) {
    let centre = vec3<f32>(11.5) + vec3<f32>(motion[0], motion[1], motion[2]);
    let first = vec3<f32>(-3.5, f32(thread & 7u) - 3.5, f32(thread >> 3u) - 3.5);
    // Without rotation all voxels have the same fractions, and the far face of one is the near face of the next.
    let start = clamp(vec3<i32>(centre + first), vec3<i32>(0), vec3<i32>(15, 22, 22));
    let shared_fraction = clamp(centre + first - vec3<f32>(start), vec3<f32>(0.0), vec3<f32>(1.0));
    var face_before = vec4<f32>(0.0);
    if !rotates {
        face_before = face(start);
    }
    var gg_x = vec3<f32>(0.0);
    var gg_yz = vec3<f32>(0.0);
    var gr_x = vec3<f32>(0.0);
    var gr_y = vec3<f32>(0.0);
    var gr_z = vec3<f32>(0.0);
    var rr_x = vec3<f32>(0.0);
    var rr_yz = vec3<f32>(0.0);
    var ge = vec3<f32>(0.0);
    var re = vec3<f32>(0.0);
    var ee = 0.0;
    for (var x = 0; x < 8; x++) {
        var near = face_before;
        var far = vec4<f32>(0.0);
        var fraction = shared_fraction;
        var offset = vec3<f32>(0.0);
        if rotates {
            offset = turn * (first + vec3<f32>(f32(x), 0.0, 0.0));
            let position = clamp(centre + offset, vec3<f32>(0.0), vec3<f32>(22.999));
            let cell = vec3<i32>(position);
            fraction = position - vec3<f32>(cell);
            near = face(cell);
            far = face(cell + vec3<i32>(1, 0, 0));
        } else {
            far = face(start + vec3<i32>(x + 1, 0, 0));
            face_before = far;
        }
        let there = trilinear(near, far, fraction) / CODES_PER_VOXEL;
        let e = there.w - f32(targets[x]) / CODES_PER_VOXEL;
        // Derivatives by translation, and by a further rotation about the block's centre.
        let g = there.xyz;
        let r = cross(offset, g);
        gg_x += g.x * g;
        gg_yz += vec3<f32>(g.y * g.y, g.y * g.z, g.z * g.z);
        gr_x += g.x * r;
        gr_y += g.y * r;
        gr_z += g.z * r;
        rr_x += r.x * r;
        rr_yz += vec3<f32>(r.y * r.y, r.y * r.z, r.z * r.z);
        ge += g * e;
        re += r * e;
        ee += e * e;
    }
    let at = TERMS_STRIDE * thread;
    let all_terms = array<f32, 28>(
        gg_x.x,
        gg_x.y, gg_yz.x,
        gg_x.z, gg_yz.y, gg_yz.z,
        gr_x.x, gr_y.x, gr_z.x, rr_x.x,
        gr_x.y, gr_y.y, gr_z.y, rr_x.y, rr_yz.x,
        gr_x.z, gr_y.z, gr_z.z, rr_x.z, rr_yz.y, rr_yz.z,
        ge.x, ge.y, ge.z, re.x, re.y, re.z,
        ee,
    );
    for (var term = 0u; term < TERMS; term++) {
        terms[at + term] = all_terms[term];
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

/// Moves on by the damped step `-(J^T J + lambda I)^-1 J^T e`, by Cholesky, within the clamps; false if the matrix is not positive.
fn take_step(unknowns: u32) -> bool {
    var factor: array<f32, 21>;
    var step: array<f32, 6>;
    for (var i = 0u; i < unknowns; i++) {
        let row = i * (i + 1u) / 2u;
        for (var j = 0u; j <= i; j++) {
            let other = j * (j + 1u) / 2u;
            var sum = totals[row + j];
            if i == j {
                sum += DAMPING + RELATIVE_DAMPING * sum;
            }
            for (var k = 0u; k < j; k++) {
                sum -= factor[row + k] * factor[other + k];
            }
            if i != j {
                factor[row + j] = sum / factor[other + j];
            } else if sum > 0.0 {
                factor[row + j] = sqrt(sum);
            } else {
                return false;
            }
        }
    }
    for (var i = 0u; i < unknowns; i++) {
        let row = i * (i + 1u) / 2u;
        var sum = -totals[GRADIENT + i];
        for (var k = 0u; k < i; k++) {
            sum -= factor[row + k] * step[k];
        }
        step[i] = sum / factor[row + i];
    }
    for (var back = 0u; back < unknowns; back++) {
        let i = unknowns - 1u - back;
        var sum = step[i];
        for (var k = i + 1u; k < unknowns; k++) {
            sum -= factor[k * (k + 1u) / 2u + i] * step[k];
        }
        step[i] = sum / factor[i * (i + 1u) / 2u + i];
    }
    var largest = 1.0;
    for (var i = 0u; i < unknowns; i++) {
        largest = max(largest, abs(step[i]) / select(ROTATION_STEP, TRANSLATION_STEP, i < 3u));
    }
    for (var i = 0u; i < unknowns; i++) {
        motion[i] += step[i] / largest;
    }
    return true;
}

/// `Rz Ry Rx` of the motion's angles, as the decoder composes it.
fn set_turn() {
    let s = sin(vec3<f32>(motion[3], motion[4], motion[5]));
    let c = cos(vec3<f32>(motion[3], motion[4], motion[5]));
    turn = mat3x3<f32>(
        vec3<f32>(c.z * c.y, s.z * c.y, -s.y),
        vec3<f32>(c.z * s.y * s.x - s.z * c.x, s.z * s.y * s.x + c.z * c.x, c.y * s.x),
        vec3<f32>(c.z * s.y * c.x + s.z * s.x, s.z * s.y * c.x - c.z * s.x, c.y * c.x),
    );
}
