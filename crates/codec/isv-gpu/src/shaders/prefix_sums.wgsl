// Sums over long lists of pairs: each value becomes the sum of those before it. A workgroup sums 1024 values, and their total goes
// to a list of totals, which is summed in the same way and then added. Sums stay at the largest number rather than wrap.

struct Parameters {
    /// Where the list is.
    start: u32,
    count: u32,
    /// Where the workgroups' totals are.
    totals: u32,
}

@group(1) @binding(0) var<uniform> parameters: Parameters;
@group(1) @binding(1) var<storage, read_write> values: array<vec2<u32>>;

/// Values of a thread.
const EACH = 4u;
const THREADS = 256u;

var<workgroup> sums: array<vec2<u32>, THREADS>;

fn plus(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let sum = a + b;
    return select(sum, vec2<u32>(0xffffffffu), sum < a);
}

@compute @workgroup_size(256)
fn sum(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    let first = (number * THREADS + thread) * EACH;
    let end = min(first + EACH, parameters.count);
    var total = vec2<u32>(0u);
    for (var i = first; i < end; i++) {
        total = plus(total, values[parameters.start + i]);
    }
    sums[thread] = total;
    workgroupBarrier();
    for (var step = 1u; step < THREADS; step <<= 1u) {
        var up_to = sums[thread];
        if thread >= step {
            up_to = plus(up_to, sums[thread - step]);
        }
        workgroupBarrier();
        sums[thread] = up_to;
        workgroupBarrier();
    }
    var before = vec2<u32>(0u);
    if thread > 0u {
        before = sums[thread - 1u];
    }
    for (var i = first; i < end; i++) {
        let value = values[parameters.start + i];
        values[parameters.start + i] = before;
        before = plus(before, value);
    }
    if thread == 0u && number * THREADS * EACH < parameters.count {
        values[parameters.totals + number] = sums[THREADS - 1u];
    }
}

@compute @workgroup_size(256)
fn add(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let number = group.y * groups.x + group.x;
    let first = (number * THREADS + thread) * EACH;
    for (var i = first; i < min(first + EACH, parameters.count); i++) {
        values[parameters.start + i] = plus(values[parameters.start + i], values[parameters.totals + number]);
    }
}
