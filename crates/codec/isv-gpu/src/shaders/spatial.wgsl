// Prediction of a block from the blocks around it that come before it, by a quadric through their surface, and its residual
// (isv-kernels: surface_fit, where the bounds of all numbers are).

/// The blocks coded in this frame.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> modes: array<CodedBlock>;
@group(1) @binding(4) var<storage, read> levels: array<u32>;
/// Blocks none of which is predicted from another one.
@group(1) @binding(5) var<storage, read> list: array<u32>;

const TERMS = 10u;
/// Length of a row of the equations: the matrix and the right side.
const ROW = 11u;
/// The distance, in codes, beyond which voxels do not count.
const FARTHEST = 1001;
const COEFFICIENT_LIMIT = (1 << 21u) - 1;
/// Rows of the voxels that are looked at: the block's eight and four on either side, along y and z.
const ROWS = 256u;
/// Sums of a row: of weights times x^0 to x^4, and of weights times samples times x^0 to x^2.
const SUMS = 8u;

/// Exponents of `1, x, y, z, x^2, y^2, z^2, xy, xz, yz`.
const EXPONENTS = array<vec3<u32>, 10>(
    vec3<u32>(0u, 0u, 0u), vec3<u32>(1u, 0u, 0u), vec3<u32>(0u, 1u, 0u), vec3<u32>(0u, 0u, 1u), vec3<u32>(2u, 0u, 0u),
    vec3<u32>(0u, 2u, 0u), vec3<u32>(0u, 0u, 2u), vec3<u32>(1u, 1u, 0u), vec3<u32>(1u, 0u, 1u), vec3<u32>(0u, 1u, 1u),
);
/// Added to the diagonal; no pivot is less.
const RIDGE = array<i32, 10>(2097, 655, 655, 655, 15360, 15360, 15360, 15360, 15360, 15360);

/// Slots of the blocks around, or NO_BLOCK.
var<workgroup> around: array<u32, 27>;
var<workgroup> row_sums: array<i32, 2048>;
var<workgroup> counted: atomic<i32>;
/// The equations, `[row][column]`.
var<workgroup> equations: array<i32, 110>;
/// Elimination factors, `[pivot][row]`.
var<workgroup> factors: array<i32, 100>;
/// Of each pivot, a number of 2^30 to 2^31 and a shift: the first over 2 to the power of the second is one over the pivot.
var<workgroup> inverses: array<vec2<u32>, 10>;
var<workgroup> quadric: array<i32, 10>;

/// `2048 exp(-distance / 256)`, 0 beyond FARTHEST.
fn weight(distance: i32) -> i32 {
    let octaves = (min(distance, FARTHEST) * 369 + 128) >> 8u;
    let fraction = octaves & 255;
    let mantissa = 4096 - 8 * fraction - ((fraction * (256 - fraction) * 11) >> 10u);
    return select((((mantissa >> u32(octaves >> 8u)) + 1) >> 1u), 0, distance > FARTHEST);
}

/// Which of three blocks along an axis one of 16 positions is in.
fn along(position: u32) -> u32 {
    return (position + 4u) >> 3u;
}

/// Sums over a row of voxels at positions `y` and `z` of 16.
fn sum_row(row: u32) {
    let y = row & 15u;
    let z = row >> 4u;
    let slots = 9u * along(z) + 3u * along(y);
    let py = 2 * i32(y) - 15;
    let pz = 2 * i32(z) - 15;
    let reach = max(abs(py), abs(pz));
    let voxels = (((z + 4u) & 7u) * 8u + ((y + 4u) & 7u)) * 8u;
    var sums = array<i32, 8>(0, 0, 0, 0, 0, 0, 0, 0);
    var count = 0;
    for (var x = 0u; x < 16u; x++) {
        let slot = around[slots + along(x)];
        if slot == NO_BLOCK {
            continue;
        }
        let sample = load_sample(slot, voxels + ((x + 4u) & 7u));
        let px = 2 * i32(x) - 15;
        let w = weight(abs(sample) + 64 * (max(reach, abs(px)) - 7));
        count += min(w, 1);
        let p = w * sample;
        sums[0] += w;
        sums[1] += w * px;
        sums[2] += w * px * px;
        sums[3] += w * px * px * px;
        sums[4] += w * px * px * px * px;
        sums[5] += p;
        sums[6] += p * px;
        sums[7] += p * px * px;
    }
    for (var i = 0u; i < SUMS; i++) {
        row_sums[row * SUMS + i] = sums[i];
    }
    atomicAdd(&counted, count);
}

fn power(base: i32, exponent: u32) -> i32 {
    var product = 1;
    for (var i = 0u; i < exponent; i++) {
        product *= base;
    }
    return product;
}

/// A moment over all rows, scaled to block edges with `bits` fraction bits. `first`: of the sums with x^0.
fn moment(exponents: vec3<u32>, first: u32, bits: u32) -> i32 {
    // Each term fits a word; the upper and lower halves of 256 of them do too.
    var upper = 0;
    var lower = 0;
    for (var row = 0u; row < ROWS; row++) {
        let py = 2 * i32(row & 15u) - 15;
        let pz = 2 * i32(row >> 4u) - 15;
        let term = row_sums[row * SUMS + first + exponents.x] * power(py, exponents.y) * power(pz, exponents.z);
        upper += term >> 16u;
        lower += term & 0xffff;
    }
    let degree = exponents.x + exponents.y + exponents.z;
    if bits >= 4u * degree {
        return bitcast<i32>((bitcast<u32>(upper << 16u) + bitcast<u32>(lower)) << (bits - 4u * degree));
    }
    let sum = wide_add(vec2<u32>(bitcast<u32>(upper << 16u), bitcast<u32>(upper >> 16u)), wide_of(lower));
    return bitcast<i32>(wide_round_shift(sum, 4u * degree - bits).x);
}

/// 2^61 over a number of 2^30 to 2^31 - 1, rounded down: long division, from the bit at which it begins to fit.
fn divide(divisor: u32) -> u32 {
    var rest = 1u << 30u;
    var quotient = 0u;
    if rest >= divisor {
        rest = 0u;
        quotient = 1u;
    }
    for (var bit = 0u; bit < 31u; bit++) {
        rest <<= 1u;
        quotient <<= 1u;
        if rest >= divisor {
            rest -= divisor;
            quotient |= 1u;
        }
    }
    return quotient;
}

/// Gaussian elimination without exchanges; coefficients with four fraction bits.
fn solve(thread: u32) {
    for (var k = 0u; k < TERMS; k++) {
        if thread == 0u {
            let pivot = max(equations[k * ROW + k], RIDGE[k]);
            let up = countLeadingZeros(bitcast<u32>(pivot)) - 1u;
            inverses[k] = vec2<u32>(divide(bitcast<u32>(pivot) << up), 61u - up);
        }
        workgroupBarrier();
        if thread > k && thread < TERMS {
            let product = wide_multiply_mixed(equations[k * ROW + thread], inverses[k].x);
            factors[k * TERMS + thread] = wide_saturate(wide_round_shift(product, inverses[k].y - 20u));
        }
        workgroupBarrier();
        for (var entry = thread; entry < TERMS * ROW; entry += 64u) {
            let i = entry / ROW;
            let j = entry % ROW;
            // What is below the diagonal is not looked at again.
            if i > k && j >= i {
                let change = wide_round_shift(wide_multiply(factors[k * TERMS + i], equations[k * ROW + j]), 20u);
                equations[entry] = wide_saturate(wide_add(wide_of(equations[entry]), wide_negate(change)));
            }
        }
        workgroupBarrier();
    }
    if thread == 0u {
        for (var above = 0u; above < TERMS; above++) {
            let k = TERMS - 1u - above;
            let product = wide_multiply_mixed(equations[k * ROW + TERMS], inverses[k].x);
            var value = wide_round_shift(product, inverses[k].y - 17u);
            for (var i = k + 1u; i < TERMS; i++) {
                let part = wide_round_shift(wide_multiply(factors[k * TERMS + i], quadric[i]), 20u);
                value = wide_add(value, wide_negate(part));
            }
            quadric[k] = wide_saturate(value);
        }
        for (var k = 0u; k < TERMS; k++) {
            let rounded = wide_saturate(wide_round_shift(wide_of(quadric[k]), 6u));
            quadric[k] = clamp(rounded, -COEFFICIENT_LIMIT, COEFFICIENT_LIMIT);
        }
    }
    workgroupBarrier();
}

/// The quadric at a row of the block.
fn evaluate(row: u32) -> array<i32, 8> {
    let y = 2 * i32(row & 7u) - 7;
    let z = 2 * i32(row >> 3u) - 7;
    let constant = 256 * quadric[0] + 16 * (quadric[2] * y + quadric[3] * z)
        + quadric[5] * y * y + quadric[6] * z * z + quadric[9] * y * z;
    let slope = 16 * quadric[1] + quadric[7] * y + quadric[8] * z;
    var samples: array<i32, 8>;
    for (var i = 0u; i < 8u; i++) {
        let x = 2 * i32(i) - 7;
        let sum = constant + slope * x + quadric[4] * x * x;
        samples[i] = clamp((sum + (1 << 11u)) >> 12u, -parameters.truncation, parameters.truncation);
    }
    return samples;
}

@compute @workgroup_size(64)
fn spatial(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.count {
        return;
    }
    let block = list[parameters.first + number];
    let mode = modes[block];
    if thread < 27u {
        let offset = bitcast<vec3<i32>>(vec3<u32>(thread % 3u, thread / 3u % 3u, thread / 9u)) - vec3<i32>(1);
        around[thread] = NO_BLOCK;
        if thread != 13u {
            let other = find_block(blocks[block].xyz + offset);
            if other >= mode.slice && other < block {
                around[thread] = bitcast<u32>(blocks[other].w);
            }
        }
    }
    if thread == 27u {
        atomicStore(&counted, 0);
    }
    workgroupBarrier();
    for (var row = thread; row < ROWS; row += 64u) {
        sum_row(row);
    }
    workgroupBarrier();
    for (var entry = thread; entry < TERMS * ROW; entry += 64u) {
        let i = entry / ROW;
        let j = entry % ROW;
        if j == TERMS {
            equations[entry] = moment(EXPONENTS[i], 5u, 3u);
        } else if j >= i {
            // The matrix is symmetric, and no more is looked at.
            equations[entry] = moment(EXPONENTS[i] + EXPONENTS[j], 0u, 10u) + select(0, RIDGE[i], i == j);
        } else {
            equations[entry] = 0;
        }
    }
    workgroupBarrier();
    solve(thread);
    var row = array<i32, 8>(0, 0, 0, 0, 0, 0, 0, 0);
    if atomicLoad(&counted) >= 8 && parameters.predicts_spatially != 0u {
        row = evaluate(thread);
    }
    row = add_residual(thread, row, mode.levels, mode.level_count, parameters.scale, parameters.truncation);
    store_row(bitcast<u32>(blocks[block].w), thread, row);
}
