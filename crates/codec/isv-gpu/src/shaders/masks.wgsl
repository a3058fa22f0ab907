// Which voxels were observed. Whoever includes this binds `mask_numbers`, for each block one more than the number of its mask or 0,
// and the `masks` of unobserved voxels, 16 words each, voxel 0 in the lowest bit of the first.

/// Number of the mask of a block that was observed in full.
const NO_MASK = 0u;

/// One more than the number of a block's mask. Blocks after the last one that is listed have none.
fn mask_number(block: u32) -> u32 {
    if block >= arrayLength(&mask_numbers) {
        return NO_MASK;
    }
    return mask_numbers[block];
}

/// The voxels that were observed of a row of a block with this mask number, `row` being 8 z + y: bit x.
fn observed_row(mask: u32, row: u32) -> u32 {
    if mask == NO_MASK {
        return 0xffu;
    }
    return ~(masks[16u * (mask - 1u) + (row >> 2u)] >> (8u * (row & 3u))) & 0xffu;
}
