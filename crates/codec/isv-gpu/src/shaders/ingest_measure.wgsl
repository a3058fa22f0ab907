// The samples of each block (Eq. 1, 7 to 9): a workgroup a block, a thread two voxels beside each other along x. Distances are those to
// the closest of the block's triangles.

/// Of each block 1 if it has an observed voxel near the surface, and 2 if it has an unobserved one.
@group(1) @binding(6) var<storage, read_write> found: array<u32>;
/// Unobserved voxels of each block in 16 words, voxel 0 in the lowest bit of the first; nothing where there are no rims.
@group(1) @binding(7) var<storage, read_write> masks: array<u32>;

/// Triangles that are looked at together.
const TOGETHER = 64u;
/// Codes of a voxel (isv-volume: CODES_PER_VOXEL).
const CODES = 256.0;
/// The square of a distance that nothing has.
const FAR_AWAY = 1e12;
/// By how much, in voxels, the distance to a rim may come out larger than that to the faces there, by rounding alone.
const SLACK = 1e-5;

/// Corners in voxels from the block's lowest corner.
var<workgroup> corners: array<array<vec3<f32>, 3>, TOGETHER>;
/// Balls around them, with radii below zero for what only closes the mesh, and whether they are rims.
var<workgroup> balls: array<vec4<f32>, TOGETHER>;
var<workgroup> are_rims: array<u32, TOGETHER>;
var<workgroup> mask: array<atomic<u32>, 16>;
var<workgroup> is_near: atomic<u32>;

@compute @workgroup_size(256)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = group.y * groups.x + group.x;
    if place >= parameters.part.y {
        return;
    }
    if thread < 16u {
        atomicStore(&mask[thread], 0u);
    }
    if thread == 16u {
        atomicStore(&is_near, 0u);
    }
    let block = parameters.part.x + place;
    let lowest = lowest_corner(block);
    let point = vec3<f32>(vec3<u32>((2u * thread) & 7u, (thread >> 2u) & 7u, thread >> 5u)) + 0.5;
    var to_face = vec2<f32>(FAR_AWAY);
    var to_rim = vec2<f32>(parameters.band * parameters.band);
    let start = starts[place];
    let count = starts[place + 1u] - start;
    for (var first = 0u; first < count; first += TOGETHER) {
        workgroupBarrier();
        if thread < TOGETHER && first + thread < count {
            fetch(thread, lists[start + first + thread], lowest);
        }
        workgroupBarrier();
        for (var i = 0u; i < min(TOGETHER, count - first); i++) {
            let ball = balls[i];
            // From the middle between the two voxels.
            let apart = distance(point + vec3<f32>(0.5, 0.0, 0.0), ball.xyz) - ball.w - 0.5;
            let is_rim = are_rims[i] != 0u;
            let known = select(max(to_face.x, to_face.y), max(to_rim.x, to_rim.y), is_rim);
            if ball.w < 0.0 || (apart > 0.0 && apart * apart >= known) {
                continue;
            }
            let squares = vec2<f32>(
                square_distance(point, corners[i]),
                square_distance(point + vec3<f32>(1.0, 0.0, 0.0), corners[i]),
            );
            if is_rim {
                to_rim = min(to_rim, squares);
            } else {
                to_face = min(to_face, squares);
            }
        }
    }
    let distances = sqrt(to_face);
    let slot = bitcast<u32>(blocks[block].w);
    let winding = unpack(load_pair(slot, thread));
    var samples = vec2<i32>(round(clamp((distances - parameters.offset) * CODES, vec2<f32>(-32768.0), vec2<f32>(32767.0))));
    samples = clamp(samples, vec2<i32>(-parameters.truncation), vec2<i32>(parameters.truncation));
    if parameters.is_signed != 0u {
        // Code 0 is outside.
        samples = select(samples, min(-samples, vec2<i32>(-1)), winding != vec2<i32>(0));
    }
    store_pair(slot, thread, pack(samples));

    let on_rim = (to_rim < vec2<f32>(parameters.band * parameters.band)) & (sqrt(to_rim) <= (distances + SLACK));
    let bits = select(0u, 1u, on_rim.x) | select(0u, 2u, on_rim.y);
    if bits != 0u {
        atomicOr(&mask[thread >> 4u], bits << ((2u * thread) & 31u));
    }
    if any(!on_rim & (distances <= vec2<f32>(parameters.near))) {
        atomicOr(&is_near, 1u);
    }
    workgroupBarrier();
    if parameters.ends.z > parameters.ends.y && thread < 16u {
        masks[16u * place + thread] = atomicLoad(&mask[thread]);
    }
    if thread == 0u {
        var has_mask = 0u;
        for (var word = 0u; word < 16u; word++) {
            has_mask |= atomicLoad(&mask[word]);
        }
        found[place] = atomicLoad(&is_near) | select(0u, 2u, has_mask != 0u);
    }
}

/// Makes a triangle ready for all threads.
fn fetch(at: u32, triangle: u32, lowest: vec3<i32>) {
    let voxels = 1.0 / f32(1u << parameters.fraction_bits);
    let a = vec3<f32>(corner_of(triangle, 0u) - lowest) * voxels;
    let b = vec3<f32>(corner_of(triangle, 1u) - lowest) * voxels;
    let c = vec3<f32>(corner_of(triangle, 2u) - lowest) * voxels;
    corners[at] = array<vec3<f32>, 3>(a, b, c);
    let centre = (a + b + c) * (1.0 / 3.0);
    // A little more, for rounding.
    let radius = max(max(distance(a, centre), distance(b, centre)), distance(c, centre)) + 1e-3;
    let only_closes = triangle >= parameters.ends.x && triangle < parameters.ends.y;
    balls[at] = vec4<f32>(centre, select(radius, -1.0, only_closes));
    are_rims[at] = select(0u, 1u, triangle >= parameters.ends.y);
}

/// The square of the distance from a point to a triangle, or to a line if that is all it is.
fn square_distance(point: vec3<f32>, triangle: array<vec3<f32>, 3>) -> f32 {
    let ab = triangle[1] - triangle[0];
    let bc = triangle[2] - triangle[1];
    let ca = triangle[0] - triangle[2];
    let from_a = point - triangle[0];
    let from_b = point - triangle[1];
    let from_c = point - triangle[2];
    let normal = cross(ab, bc);
    let square = dot(normal, normal);
    let longest = max(max(dot(ab, ab), dot(bc, bc)), dot(ca, ca));
    // One lower than a ten-thousandth of a voxel is no more than its sides.
    let has_area = square > 1e-8 * longest;
    if has_area && dot(cross(normal, ab), from_a) >= 0.0 && dot(cross(normal, bc), from_b) >= 0.0 && dot(cross(normal, ca), from_c) >= 0.0 {
        let height = dot(normal, from_a);
        return height * height / square;
    }
    return min(min(to_segment(from_a, ab), to_segment(from_b, bc)), to_segment(from_c, ca));
}

/// The square of the distance from a point to a segment, given from the segment's start.
fn to_segment(point: vec3<f32>, along: vec3<f32>) -> f32 {
    let apart = point - along * clamp(dot(point, along) / max(dot(along, along), 1e-20), 0.0, 1.0);
    return dot(apart, apart);
}
