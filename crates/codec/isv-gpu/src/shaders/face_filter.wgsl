// The in-loop filter across the faces between blocks along one axis (isv-kernels: deblock).

struct FilterParameters {
    /// 0, 1, 2 for x, y, z.
    axis: u32,
    /// In 1/64.
    strength: i32,
    /// Most that a sample moves, in codes.
    limit: i32,
    truncation: i32,
    count: u32,
}

@group(1) @binding(0) var<uniform> parameters: FilterParameters;
/// The blocks coded in this frame.
@group(1) @binding(1) var<storage, read> blocks: array<vec4<i32>>;
@group(1) @binding(2) var<storage, read> table: array<u32>;
@group(1) @binding(3) var<storage, read> modes: array<CodedBlock>;

/// Lines whose samples at the face both lie farther from the surface than this many codes are left alone.
const REACH = 640;

/// The lower block's index, the upper block's; NO_BLOCK for a face that stays as it is.
var<workgroup> face: vec2<u32>;

/// Whether two blocks go on from the frame before as one.
fn is_continued(a: CodedBlock, b: CodedBlock) -> bool {
    return has_vector(a.mode) && a.mode == b.mode && a.level_count == 0u && b.level_count == 0u;
}

/// By how much the samples of two lines move: `p0`, `p1`, `p2` up and `q0`, `q1`, `q2` down.
fn moves(p1: vec2<i32>, p0: vec2<i32>, q0: vec2<i32>, q1: vec2<i32>) -> array<vec2<i32>, 3> {
    let step = 3 * (q0 - p0) + p1 - q1;
    let reached = min(abs(p0), abs(q0)) <= vec2<i32>(REACH);
    let most = select(vec2<i32>(0), vec2<i32>(parameters.limit), reached);
    let first = min((parameters.strength * abs(step)) >> vec2<u32>(7u), most);
    let direction = select(vec2<i32>(1), vec2<i32>(-1), step < vec2<i32>(0));
    return array<vec2<i32>, 3>(direction * first, direction * (first >> vec2<u32>(1u)), direction * ((13 * first) >> vec2<u32>(6u)));
}

fn within(samples: vec2<i32>) -> vec2<i32> {
    return clamp(samples, vec2<i32>(-parameters.truncation), vec2<i32>(parameters.truncation));
}

/// Along x: a row of both blocks.
fn smooth_row(lower: u32, upper: u32, row: u32) {
    // p2 is the second sample of its word, q2 the first.
    let p_far = unpack(load_pair(lower, 4u * row + 2u));
    let p_near = unpack(load_pair(lower, 4u * row + 3u));
    let q_near = unpack(load_pair(upper, 4u * row));
    let q_far = unpack(load_pair(upper, 4u * row + 1u));
    let by = moves(p_near.xx, p_near.yy, q_near.xx, q_near.yy);
    store_pair(lower, 4u * row + 2u, pack(vec2<i32>(p_far.x, within(p_far + by[2]).y)));
    store_pair(lower, 4u * row + 3u, pack(within(p_near + vec2<i32>(by[1].x, by[0].x))));
    store_pair(upper, 4u * row, pack(within(q_near - vec2<i32>(by[0].x, by[1].x))));
    store_pair(upper, 4u * row + 1u, pack(vec2<i32>(within(q_far - by[2]).x, q_far.y)));
}

/// Along y or z: two lines beside each other, from words `first` on, `stride` words apart.
fn smooth_lines(lower: u32, upper: u32, first: u32, stride: u32) {
    let p2 = unpack(load_pair(lower, first + 5u * stride));
    let p1 = unpack(load_pair(lower, first + 6u * stride));
    let p0 = unpack(load_pair(lower, first + 7u * stride));
    let q0 = unpack(load_pair(upper, first));
    let q1 = unpack(load_pair(upper, first + stride));
    let q2 = unpack(load_pair(upper, first + 2u * stride));
    let by = moves(p1, p0, q0, q1);
    store_pair(lower, first + 5u * stride, pack(within(p2 + by[2])));
    store_pair(lower, first + 6u * stride, pack(within(p1 + by[1])));
    store_pair(lower, first + 7u * stride, pack(within(p0 + by[0])));
    store_pair(upper, first, pack(within(q0 - by[0])));
    store_pair(upper, first + stride, pack(within(q1 - by[1])));
    store_pair(upper, first + 2u * stride, pack(within(q2 - by[2])));
}

@compute @workgroup_size(64)
fn face_filter(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let lower = group.y * groups.x + group.x;
    if lower >= parameters.count {
        return;
    }
    if thread == 0u {
        var step = vec3<i32>(0);
        step[parameters.axis] = 1;
        let upper = find_block(blocks[lower].xyz + step);
        face = vec2<u32>(NO_BLOCK);
        if upper != NO_BLOCK {
            if !is_continued(modes[lower], modes[upper]) {
                face = vec2<u32>(bitcast<u32>(blocks[lower].w), bitcast<u32>(blocks[upper].w));
            }
        }
    }
    workgroupBarrier();
    if face.x == NO_BLOCK {
        return;
    }
    switch parameters.axis {
        case 0u: { smooth_row(face.x, face.y, thread); }
        // Along y: words of a row 4 apart, layers of z 32 apart.
        case 1u: { if thread < 32u { smooth_lines(face.x, face.y, (thread >> 2u) * 32u + (thread & 3u), 4u); } }
        default: { if thread < 32u { smooth_lines(face.x, face.y, thread, 32u); } }
    }
}
