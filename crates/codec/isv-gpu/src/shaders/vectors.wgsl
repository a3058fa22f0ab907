// Vectors in 28 bits: nine bits a component, 128 more than it is, and whether there is one.

/// Whether a block is predicted from the frame before.
fn has_vector(mode: u32) -> bool {
    return ((mode >> 27u) & 1u) != 0u;
}

/// The vector of a mode, in quarter voxels.
fn vector_of(mode: u32) -> vec3<i32> {
    return bitcast<vec3<i32>>(vec3<u32>(mode, mode >> 9u, mode >> 18u) & vec3<u32>(511u)) - vec3<i32>(128);
}
