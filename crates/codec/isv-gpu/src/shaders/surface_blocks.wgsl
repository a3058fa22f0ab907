// What the surface's kernels know of each block.

/// Rows of eight voxels along x are bytes, bit x for voxel x; row 8 z + y is byte y & 3 of word 2 z + (y >> 2).
struct SurfaceBlock {
    /// The voxels inside.
    inside: array<u32, 16>,
    /// The cells, by their lowest corner, that the surface crosses and whose corners were all observed. Only of blocks that can
    /// be crossed.
    cells: array<u32, 16>,
    /// Which of its parts have voxels inside (bits 0 to 7) and which outside (8 to 15): bit p for the voxels whose coordinate is 0
    /// along every axis of p, with x in bit 0. It is what cells reach that start in the block at -x where p has x, and so on.
    parts: u32,
}
