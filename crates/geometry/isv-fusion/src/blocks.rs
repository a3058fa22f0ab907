//! From sums to the blocks of a volume.

use crate::backend::{SampledBlocks, UNKNOWN};
use crate::integrate::{BlockSums, LEAST_WEIGHT};
use isv_volume::{BlockCoord, CODES_PER_VOXEL, Grid, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// All blocks that were touched, in Morton order, on their way to a volume.
pub(crate) struct Blocks {
    pub(crate) grid: Grid,
    pub(crate) coords: Vec<BlockCoord>,
    /// Codes, block after block.
    pub(crate) samples: Vec<i16>,
    /// One a block.
    pub(crate) unobserved: Vec<VoxelMask>,
}

impl SampledBlocks {
    /// Takes the sums of all blocks, which `sums_of` puts in place of older ones of the same thread.
    pub(crate) fn resolve_all(
        grid: &Grid,
        coords: &[BlockCoord],
        fresh: impl Fn() -> BlockSums + Sync + Send,
        sums_of: impl Fn(&mut BlockSums, BlockCoord) + Sync + Send,
    ) -> Self {
        let size = grid.edge.block_voxels();
        let mut samples = vec![UNKNOWN; coords.len() * size];
        let unobserved = samples
            .par_chunks_exact_mut(size)
            .zip(coords)
            .map_init(fresh, |sums, (block, coord)| {
                sums_of(sums, *coord);
                resolve(sums, grid, block)
            })
            .collect();
        Self { samples, unobserved }
    }
}

impl Blocks {
    /// Blocks of which this is known.
    pub(crate) fn new(grid: Grid, coords: Vec<BlockCoord>, sampled: SampledBlocks) -> Self {
        Self { grid, coords, samples: sampled.samples, unobserved: sampled.unobserved }
    }

    /// Makes unobserved what would show a surface that nobody saw, and lets the field run on through
    /// unobserved voxels. Drops the blocks without an observed voxel inside the band.
    pub(crate) fn finish(mut self) -> SparseVolume {
        self.open_contradictions();
        let surface = self.trim_rims();
        self.continue_field(&surface);
        self.active()
    }

    /// The volume of the blocks that have an observed voxel inside the band.
    fn active(self) -> SparseVolume {
        let (size, band) = (self.grid.edge.block_voxels(), self.grid.truncation.codes());
        let (mut coords, mut samples, mut masks) = (Vec::new(), Vec::new(), BTreeMap::new());
        let blocks = self.coords.into_iter().zip(self.samples.chunks_exact(size)).zip(self.unobserved);
        for ((coord, block), mask) in blocks {
            if block.iter().enumerate().any(|(voxel, s)| s.abs() < band && !mask.contains(voxel)) {
                if !mask.is_empty() {
                    masks.insert(coords.len() as u32, mask);
                }
                coords.push(coord);
                samples.extend_from_slice(block);
            }
        }
        SparseVolume::from_parts(self.grid, coords, samples, masks)
    }
}

/// The codes of a block and its unobserved voxels.
///
/// - The mean of the readings that have the voxel in their band.
/// - The largest code where it is free: none does, or they find it behind a surface but more weight saw past it.
/// - The lowest code where it is only hidden behind surfaces; such voxels are unobserved.
/// - [`UNKNOWN`] where no reading says anything.
fn resolve(sums: &BlockSums, grid: &Grid, block: &mut [i16]) -> VoxelMask {
    let band = grid.truncation.codes();
    let mut unobserved = VoxelMask::empty(grid.edge);
    for (voxel, sample) in block.iter_mut().enumerate() {
        let (weight, sum, free) = (sums.weight[voxel], sums.sum[voxel], sums.free[voxel]);
        let measured = weight >= LEAST_WEIGHT;
        *sample = if free > 0.0 && (!measured || (sum < 0.0 && free > weight)) {
            band
        } else if measured {
            ((sum / weight * CODES_PER_VOXEL as f32).round() as i16).clamp(-band, band)
        } else {
            unobserved.insert(voxel);
            if weight > 0.0 { -band } else { UNKNOWN }
        };
    }
    unobserved
}
