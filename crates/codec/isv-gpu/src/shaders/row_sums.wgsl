// Sums over a workgroup's 64 threads, a row of voxels each.

/// Up to each row, and itself.
var<workgroup> row_sums: array<u32, 64>;

/// The sum of the values of the threads before this one. Ends with a barrier.
fn sum_before(value: u32, thread: u32) -> u32 {
    var sum = value;
    for (var step = 1u; step < 64u; step <<= 1u) {
        row_sums[thread] = sum;
        workgroupBarrier();
        if thread >= step {
            sum += row_sums[thread - step];
        }
        workgroupBarrier();
    }
    row_sums[thread] = sum;
    workgroupBarrier();
    return sum - value;
}

/// The row that holds item `i` of those that were summed: the first one whose sum is larger.
fn row_with(i: u32) -> u32 {
    var row = 0u;
    for (var step = 32u; step > 0u; step >>= 1u) {
        row += select(0u, step, row_sums[row + step - 1u] <= i);
    }
    return row;
}
