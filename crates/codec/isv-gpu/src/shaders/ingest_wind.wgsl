// How winding numbers change along the rows of voxels of each block (isv-ingest: crossings): a workgroup a block. They are written
// where samples will be: of each voxel what it has more than there is before the block.

/// Base-2 logarithm of the steps that triangles are drawn with: edge functions fit 32 bits.
const DRAWN_BITS = 10u;
const DRAWN_HALF = 1 << (DRAWN_BITS - 1u);

var<workgroup> changes: array<atomic<i32>, 512>;

@compute @workgroup_size(64)
fn wind(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = group.y * groups.x + group.x;
    if place >= parameters.part.y {
        return;
    }
    for (var voxel = thread; voxel < 512u; voxel += 64u) {
        atomicStore(&changes[voxel], 0);
    }
    workgroupBarrier();
    let block = parameters.part.x + place;
    let lowest = lowest_corner(block);
    for (var i = starts[place] + thread; i < starts[place + 1u]; i += 64u) {
        if lists[i] < parameters.ends.y {
            draw(lists[i], lowest);
        }
    }
    workgroupBarrier();
    var numbers: array<i32, 8>;
    var number = 0;
    for (var x = 0u; x < 8u; x++) {
        number += atomicLoad(&changes[8u * thread + x]);
        numbers[x] = number;
    }
    store_row(bitcast<u32>(blocks[block].w), thread, numbers);
}

/// A place in the plane of y and z with fewer bits, halves up.
fn drawn_at(corner: vec3<i32>) -> vec2<i32> {
    let dropped = parameters.fraction_bits - DRAWN_BITS;
    return (corner.yz + ((1 << dropped) >> 1u)) >> vec2<u32>(dropped);
}

/// Positive where a point is on the left of the way from one corner to another, in the plane of y and z.
fn edge_function(start: vec2<i32>, end: vec2<i32>, point: vec2<i32>) -> i32 {
    return ((end.x - start.x) * (point.y - start.y)) - ((end.y - start.y) * (point.x - start.x));
}

/// A row on a side belongs to the triangle that it gets into when moved a little along y, and even less along z.
fn is_inside(weight: i32, start: vec2<i32>, end: vec2<i32>) -> bool {
    return weight > 0 || (weight == 0 && (end.y < start.y || (end.y == start.y && end.x > start.x)));
}

/// Draws a triangle onto the rows of the block.
fn draw(triangle: u32, lowest: vec3<i32>) {
    let a = corner_of(triangle, 0u) - lowest;
    var b = corner_of(triangle, 1u) - lowest;
    var c = corner_of(triangle, 2u) - lowest;
    let at_a = drawn_at(a);
    var at_b = drawn_at(b);
    var at_c = drawn_at(c);
    var area = edge_function(at_a, at_b, at_c);
    if area == 0 {
        return;
    }
    // Its normal points along x where the area is positive: a row leaves the inside there.
    var change = -1;
    if area < 0 {
        change = 1;
        area = -area;
        let corner = b;
        b = c;
        c = corner;
        let place = at_b;
        at_b = at_c;
        at_c = place;
    }
    let low = min(min(at_a, at_b), at_c);
    let high = max(max(at_a, at_b), at_c);
    let first = max((low + (DRAWN_HALF - 1)) >> vec2<u32>(DRAWN_BITS), vec2<i32>(0));
    let last = min((high - DRAWN_HALF) >> vec2<u32>(DRAWN_BITS), vec2<i32>(7));
    let step = 1 << parameters.fraction_bits;
    for (var z = first.y; z <= last.y; z++) {
        for (var y = first.x; y <= last.x; y++) {
            let point = (vec2<i32>(y, z) << vec2<u32>(DRAWN_BITS)) + DRAWN_HALF;
            let to_a = edge_function(at_b, at_c, point);
            let to_b = edge_function(at_c, at_a, point);
            let to_c = edge_function(at_a, at_b, point);
            if is_inside(to_a, at_b, at_c) && is_inside(to_b, at_c, at_a) && is_inside(to_c, at_a, at_b) {
                // Of differences alone: what comes out in one block comes out in the next.
                let along = (f32(to_b) * f32(b.x - a.x) + f32(to_c) * f32(c.x - a.x)) / f32(area);
                let beyond = (a.x + i32(round(along)) + step / 2 - 1) >> parameters.fraction_bits;
                if beyond >= 0 && beyond < 8 {
                    atomicAdd(&changes[u32((8 * z + y) * 8 + beyond)], change);
                }
            }
        }
    }
}
