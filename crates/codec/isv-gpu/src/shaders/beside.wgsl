// What lies beside blocks of the frame before. Whoever includes this binds that frame's `blocks` and `table`.

/// Whether the voxel of a block of the frame before that is nearest to another block lies inside; not if there is no block.
fn is_inside_towards(coord: vec3<i32>, other: vec3<i32>) -> bool {
    let block = find_block(coord);
    if block == NO_BLOCK {
        return false;
    }
    let nearest = select(select(vec3<i32>(4), vec3<i32>(7), other > coord), vec3<i32>(0), other < coord);
    return load_sample(bitcast<u32>(blocks[block].w), u32((nearest.z * 8 + nearest.y) * 8 + nearest.x)) < 0;
}
