// Coefficients of a block to its residual (isv-kernels: quant, dct). All 64 threads of a workgroup work on one block.

/// A residual in the making: coefficients `[w][v][u]`, then samples `[z][y][x]`.
var<workgroup> residual: array<i32, 512>;

/// How coefficients are scaled.
struct Scale {
    /// Bits to drop after the inverse passes along z, y and x.
    shifts: vec3<u32>,
    /// Base-2 logarithm of the sixteenths of a code in a coefficient's unit.
    unit_shift: u32,
    /// Steps of the lowest coefficient and of all others, in sixteenths of a code.
    steps: vec2<i32>,
    /// Largest levels: they have codes, and their products with the steps stay inside 30 bits.
    level_limits: vec2<i32>,
}

/// Rounds half up, drops bits and saturates to 16 bits.
fn round_shift(sum: i32, shift: u32) -> i32 {
    return clamp((sum + (1 << (shift - 1u))) >> shift, -32768, 32767);
}

/// The coefficient of a level, the lowest one or another.
fn dequantize(level: i32, is_lowest: bool, scale: Scale) -> i32 {
    let step = select(scale.steps.y, scale.steps.x, is_lowest);
    let limit = select(scale.level_limits.y, scale.level_limits.x, is_lowest);
    return round_shift(clamp(level, -limit, limit) * step, scale.unit_shift);
}

/// One inverse pass over eight values: `out[n] = sum_k M[k][n] v[k]`, by even and odd rows of the matrix.
fn inverse_pass(v: array<i32, 8>, shift: u32) -> array<i32, 8> {
    let a = 2896 * (v[0] + v[4]);
    let b = 2896 * (v[0] - v[4]);
    let c = 3784 * v[2] + 1567 * v[6];
    let d = 1567 * v[2] - 3784 * v[6];
    let even = vec4<i32>(a + c, b + d, b - d, a - c);
    let odd = vec4<i32>(
        4017 * v[1] + 3406 * v[3] + 2276 * v[5] + 799 * v[7],
        3406 * v[1] - 799 * v[3] - 4017 * v[5] - 2276 * v[7],
        2276 * v[1] - 4017 * v[3] + 799 * v[5] + 3406 * v[7],
        799 * v[1] - 2276 * v[3] + 3406 * v[5] - 4017 * v[7],
    );
    let first = even + odd;
    let last = even - odd;
    return array<i32, 8>(
        round_shift(first.x, shift), round_shift(first.y, shift),
        round_shift(first.z, shift), round_shift(first.w, shift),
        round_shift(last.w, shift), round_shift(last.z, shift),
        round_shift(last.y, shift), round_shift(last.x, shift),
    );
}

fn residual_line(start: u32, stride: u32) -> array<i32, 8> {
    return array<i32, 8>(
        residual[start], residual[start + stride], residual[start + 2u * stride], residual[start + 3u * stride],
        residual[start + 4u * stride], residual[start + 5u * stride], residual[start + 6u * stride],
        residual[start + 7u * stride],
    );
}

fn set_residual_line(start: u32, stride: u32, line: array<i32, 8>) {
    residual[start] = line[0];
    residual[start + stride] = line[1];
    residual[start + 2u * stride] = line[2];
    residual[start + 3u * stride] = line[3];
    residual[start + 4u * stride] = line[4];
    residual[start + 5u * stride] = line[5];
    residual[start + 6u * stride] = line[6];
    residual[start + 7u * stride] = line[7];
}

/// Where the line of eight values along y that a thread works on begins; along z it begins at the thread, along x at eight times that.
fn line_along_y(thread: u32) -> u32 {
    return (thread >> 3u) * 64u + (thread & 7u);
}

/// A row of a predicted block, 8 z + y being the thread, with the residual added, within the truncation. Each thread brings its
/// line along z, whose pass is done.
fn add_transformed(thread: u32, prediction: array<i32, 8>, along_z: array<i32, 8>, scale: Scale, truncation: i32) -> array<i32, 8> {
    set_residual_line(thread, 64u, along_z);
    workgroupBarrier();
    let column = line_along_y(thread);
    set_residual_line(column, 8u, inverse_pass(residual_line(column, 8u), scale.shifts.y));
    workgroupBarrier();
    let row = inverse_pass(residual_line(8u * thread, 1u), scale.shifts.z);
    var sum = prediction;
    for (var x = 0u; x < 8u; x++) {
        sum[x] = clamp(sum[x] + row[x], -truncation, truncation);
    }
    return sum;
}
