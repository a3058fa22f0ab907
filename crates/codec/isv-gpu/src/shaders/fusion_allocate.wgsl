// The blocks that rays pass through within the band, each once (isv-fusion: allocation; Sec. 3.6). Lengths are in blocks.

struct AllocateParameters {
    /// Its centre in blocks.
    view: View,
    /// A block's edge in voxels of the view, and in those that bands are measured in.
    block_edge: f32,
    edge: f32,
    /// The rays of this dispatch.
    first: u32,
    end: u32,
    /// Entries of the table, a power of two, and blocks that there is room for.
    entries: u32,
    capacity: u32,
    /// Of the hash.
    key: u32,
}

@group(1) @binding(0) var<uniform> parameters: AllocateParameters;
@group(1) @binding(1) var<storage, read> surfels: array<Surfel>;
/// The rays of all pixels before each pixel, and in the end all of them.
@group(1) @binding(2) var<storage, read> rays: array<vec2<u32>>;
/// Names of blocks, two words an entry; 0 where there is none. A name is entered a word after the other: the first word is given
/// once and for all to a half of a name, and the second to the first that asks for it among the names of this half.
@group(1) @binding(3) var<storage, read_write> table: array<atomic<u32>>;
/// How many blocks were found, and whether the table was too crowded to enter one.
@group(1) @binding(4) var<storage, read_write> state: array<atomic<u32>, 2>;
/// Their names.
@group(1) @binding(5) var<storage, read_write> found: array<vec2<u32>>;

/// Coordinates lie between this and its negative, so that no half of a name is 0.
const COORD_LIMIT = 1048576;
/// Entries that are looked at for a block. The table is never more than half full, give or take what threads find at the same time.
const MOST_TRIES = 256u;
/// Half blocks along a ray; the band of the finest blocks is 18 of them thick where a surface is seen at the least angle.
const MOST_STEPS = 64.0;

/// Enters a block that may be there already.
fn enter(block: vec3<i32>) {
    if any(block <= vec3<i32>(-COORD_LIMIT)) || any(block >= vec3<i32>(COORD_LIMIT)) {
        return;
    }
    let c = vec3<u32>(block + COORD_LIMIT);
    let name = vec2<u32>(c.x | (c.y << 21u), c.z | ((c.y >> 11u) << 21u));
    var at = table_hash(block, parameters.key, parameters.entries);
    for (var tries = 0u; tries < MOST_TRIES; tries++) {
        let first = claim(2u * at, name.x);
        if first == name.x {
            let second = atomicLoad(&table[(2u * at) + 1u]);
            if second == name.y {
                return;
            }
            if second == 0u {
                let exchange = atomicCompareExchangeWeak(&table[(2u * at) + 1u], 0u, name.y);
                if exchange.exchanged {
                    let number = atomicAdd(&state[0], 1u);
                    if number < parameters.capacity {
                        found[number] = name;
                    }
                    return;
                }
                if exchange.old_value == name.y {
                    return;
                }
                // Exchanges may fail for nothing; then this entry is looked at again.
                if exchange.old_value == 0u {
                    continue;
                }
            }
        } else if first == 0u {
            continue;
        }
        at = (at + 1u) & (parameters.entries - 1u);
    }
    atomicStore(&state[1], 1u);
}

/// What is in a word of the table after an attempt to put `half` into it if it was empty; 0 if the attempt failed for nothing.
fn claim(word: u32, half: u32) -> u32 {
    let before = atomicLoad(&table[word]);
    if before != 0u {
        return before;
    }
    let exchange = atomicCompareExchangeWeak(&table[word], 0u, half);
    return select(exchange.old_value, half, exchange.exchanged);
}

/// The pixel that a ray belongs to: the last one with no more rays before it.
fn pixel_of(ray: u32, pixels: u32) -> u32 {
    var low = 0u;
    var high = pixels;
    for (var step = 0u; (step < 32u) && (high - low > 1u); step++) {
        let middle = low + ((high - low) / 2u);
        if rays[middle].x <= ray {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

@compute @workgroup_size(64)
fn allocate(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let view = parameters.view;
    let number = parameters.first + (((group.y * groups.x) + group.x) * 64u) + thread;
    // What is found beyond the capacity is of no use.
    if number >= parameters.end || atomicLoad(&state[0]) > parameters.capacity {
        return;
    }
    let pixel = pixel_of(number, view.width * view.rows);
    let before = rays[pixel].x;
    let part = number - before;
    // Along each side; a square number's root, off by less than a half.
    let parts = max(u32(round(sqrt(f32(rays[pixel + 1u].x - before)))), 1u);
    let cut = (vec2<f32>(f32(part % parts), f32(part / parts)) + 0.5) / f32(parts);
    let surfel = surfels[view.surfels + pixel];
    let ray = ray_at(view, place_of(view, pixel) + (cut - 0.5));
    let point = to_world(view, point_along(surfel, ray)) / parameters.block_edge;
    let depth = length(point);
    let band = (surfel.band / cosine_along(surfel, ray)) / parameters.edge;
    let direction = point / depth;
    let start = direction * max(depth - band, 0.0);
    let end = direction * (depth + band);
    // From the band's front to its back in steps of half a block.
    let steps = clamp(ceil(2.0 * length(end - start)), 1.0, MOST_STEPS);
    for (var step = 0.0; step <= steps; step += 1.0) {
        enter(view.centre + vec3<i32>(floor(view.rest + mix(start, end, step / steps))));
    }
}
