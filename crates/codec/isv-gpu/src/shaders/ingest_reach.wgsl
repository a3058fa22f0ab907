// The blocks that a triangle matters in: those with a voxel whose centre is in its bounds, grown by its reach. What is done in each is
// said by `visit` of whoever includes this, with the block's place from the lattice's origin.

struct Reached {
    first: vec3<i32>,
    last: vec3<i32>,
}

/// Blocks along an axis that a triangle reaches at most: one of 8 voxels, the largest band on both sides, and two cut ones.
const MOST_REACHED = 16;

/// From the lattice's origin. All in whole numbers: every kernel finds the same.
fn reached_blocks(triangle: u32) -> Reached {
    let a = corner_of(triangle, 0u);
    let b = corner_of(triangle, 1u);
    let c = corner_of(triangle, 2u);
    var reach = parameters.reach.x;
    if triangle >= parameters.ends.y {
        reach = parameters.reach.z;
    } else if triangle >= parameters.ends.x {
        reach = parameters.reach.y;
    }
    // Centres lie from half a voxel to seven and a half.
    let half = (1 << parameters.fraction_bits) / 2;
    let shift = vec3<u32>(parameters.fraction_bits + 3u);
    let first = (min(min(a, b), c) + (half - 1 - reach)) >> shift;
    let last = (max(max(a, b), c) + (reach - half)) >> shift;
    return Reached(first, min(last, first + (MOST_REACHED - 1)));
}

/// Visits them.
fn visit_reached(triangle: u32) {
    let reached = reached_blocks(triangle);
    for (var z = reached.first.z; z <= reached.last.z; z++) {
        for (var y = reached.first.y; y <= reached.last.y; y++) {
            for (var x = reached.first.x; x <= reached.last.x; x++) {
                visit(triangle, vec3<i32>(x, y, z));
            }
        }
    }
}
