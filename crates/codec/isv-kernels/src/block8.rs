//! Blocks with an edge of 8 voxels: those of profile `main`, whose kernels know their size.

/// Voxels along the edge.
pub const EDGE: usize = 8;

/// Voxels, and samples, of a block.
pub const SAMPLES: usize = EDGE * EDGE * EDGE;

/// The samples of a block, x fastest, then y, then z.
pub type Block = [i16; SAMPLES];
