// The residual of a block from its levels, and what a prediction and it make together. Whoever includes this binds `levels`: a
// position in the lowest nine bits and a value above.

/// A row of a predicted block, 8 z + y being the thread, with the residual of `count` levels from `start` on added, within the
/// truncation.
fn add_residual(thread: u32, prediction: array<i32, 8>, start: u32, count: u32, scale: Scale, truncation: i32) -> array<i32, 8> {
    if count == 0u {
        return prediction;
    }
    for (var i = thread; i < 512u; i += 64u) {
        residual[i] = 0;
    }
    workgroupBarrier();
    for (var i = thread; i < count; i += 64u) {
        let level = levels[start + i];
        let position = level & 511u;
        residual[position] = dequantize(bitcast<i32>(level) >> 9u, position == 0u, scale);
    }
    workgroupBarrier();
    let along_z = inverse_pass(residual_line(thread, 64u), scale.shifts.x);
    return add_transformed(thread, prediction, along_z, scale, truncation);
}
