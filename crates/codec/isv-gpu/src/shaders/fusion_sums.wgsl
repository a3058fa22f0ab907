// Running sums over the readings of voxels (isv-fusion: integrate): block after block, of each the weights of all its voxels, x
// fastest, then weight times distance, then the weight of readings that saw past.

/// Where the weight of a voxel is; the other sums are `size` and twice that behind it.
fn sums_at(block: u32, size: u32, voxel: u32) -> u32 {
    return (3u * block * size) + voxel;
}
