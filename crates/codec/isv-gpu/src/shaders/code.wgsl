// A block of profile `paper` coded: prediction, residual, levels, and the block that they give (Sec. 3.3, 3.4, Eq. 10, 11;
// isv-kernels: dct, quant).

struct CodeParameters {
    scale: Scale,
    /// Bits to drop after the forward passes along x, y and z.
    forward_shifts: vec3<u32>,
    /// Levels of a block.
    coefficients: u32,
    truncation: i32,
    /// Where among the blocks those of this dispatch begin, and how many there are.
    first: u32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: CodeParameters;
/// The frame before.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
/// Coordinates and slots of the frame to be coded.
@group(1) @binding(3) var<storage, read> sources: array<vec4<i32>>;
@group(1) @binding(4) var<storage, read> moved: array<MovedBlock>;
/// For each position in a block its place in the scan; not coded if that is `coefficients` or more.
@group(1) @binding(5) var<storage, read> places: array<u32>;
/// Levels in scan order, of this dispatch's blocks alone.
@group(1) @binding(6) var<storage, read_write> levels: array<i32>;

/// One forward pass over eight values: `out[k] = sum_n M[k][n] v[n]`, by even and odd rows of the matrix.
fn forward_pass(v: array<i32, 8>, shift: u32) -> array<i32, 8> {
    let first = vec4<i32>(v[0], v[1], v[2], v[3]);
    let last = vec4<i32>(v[7], v[6], v[5], v[4]);
    let s = first + last;
    let d = first - last;
    return array<i32, 8>(
        round_shift(2896 * (s.x + s.y + s.z + s.w), shift),
        round_shift(4017 * d.x + 3406 * d.y + 2276 * d.z + 799 * d.w, shift),
        round_shift(3784 * (s.x - s.w) + 1567 * (s.y - s.z), shift),
        round_shift(3406 * d.x - 799 * d.y - 4017 * d.z - 2276 * d.w, shift),
        round_shift(2896 * (s.x - s.y - s.z + s.w), shift),
        round_shift(2276 * d.x - 4017 * d.y + 799 * d.z + 3406 * d.w, shift),
        round_shift(1567 * (s.x - s.w) - 3784 * (s.y - s.z), shift),
        round_shift(799 * d.x - 2276 * d.y + 3406 * d.z - 4017 * d.w, shift),
    );
}

/// The nearest level of a coefficient, halves away from zero, that has a code.
fn quantize(coefficient: i32, is_lowest: bool, scale: Scale) -> i32 {
    let step = select(scale.steps.y, scale.steps.x, is_lowest);
    let limit = select(scale.level_limits.y, scale.level_limits.x, is_lowest);
    let level = min(((abs(coefficient) << scale.unit_shift) + step / 2) / step, limit);
    return select(level, -level, coefficient < 0);
}

@compute @workgroup_size(64)
fn code(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.count {
        return;
    }
    let scale = parameters.scale;
    let shifts = parameters.forward_shifts;
    let to = moved[parameters.first + number];
    let source = sources[parameters.first + number];
    let prediction = predicted_row(thread, source.xyz, to, parameters.truncation);
    var row = load_row(bitcast<u32>(source.w), thread);
    for (var x = 0u; x < 8u; x++) {
        row[x] -= prediction[x];
    }
    set_residual_line(8u * thread, 1u, forward_pass(row, shifts.x));
    workgroupBarrier();
    let column = line_along_y(thread);
    set_residual_line(column, 8u, forward_pass(residual_line(column, 8u), shifts.y));
    workgroupBarrier();
    // Along z each thread has its coefficients to itself: there, and back.
    var line = forward_pass(residual_line(thread, 64u), shifts.z);
    for (var w = 0u; w < 8u; w++) {
        let position = 64u * w + thread;
        let place = places[position];
        if place < parameters.coefficients {
            let level = quantize(line[w], position == 0u, scale);
            levels[number * parameters.coefficients + place] = level;
            line[w] = dequantize(level, position == 0u, scale);
        } else {
            line[w] = 0;
        }
    }
    let sum = add_transformed(thread, prediction, inverse_pass(line, scale.shifts.x), scale, parameters.truncation);
    store_row(to.slot, thread, sum);
}
