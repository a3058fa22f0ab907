//! The CPU as a backend.

use super::{FusionBackend, MOST_WEIGHT, SampledBlocks};
use crate::allocation::touched_blocks;
use crate::integrate::BlockSums;
use crate::view::View;
use crate::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, DepthImage, Grid, MortonCode};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The reference: all threads of the CPU. Never fails, and gives the same bits on all of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

/// A plane for each pixel of some images.
#[derive(Debug)]
pub struct CpuViews(Vec<View>);

/// Sums of blocks in memory: twelve bytes a voxel.
#[derive(Clone, Debug, Default)]
pub struct CpuSums(BTreeMap<MortonCode, BlockSums>);

impl CpuSums {
    /// What they say about their blocks, in Morton order.
    pub(crate) fn resolve(&self, grid: &Grid) -> SampledBlocks {
        let copy = |sums: &mut BlockSums, coord: BlockCoord| sums.clone_from(&self.0[&coord.morton()]);
        SampledBlocks::resolve_all(grid, &Cpu::coords(self), BlockSums::default, copy)
    }
}

impl FusionBackend for Cpu {
    type Views = CpuViews;
    type Sums = CpuSums;

    fn views(&mut self, images: &[DepthImage], settings: &FusionSettings) -> Result<CpuViews, FusionError> {
        Ok(CpuViews(images.iter().map(|image| View::new(image, settings)).collect()))
    }

    fn touched_blocks(
        &mut self,
        views: &CpuViews,
        grid: &Grid,
        scale: f64,
        limit: usize,
    ) -> Result<Option<Vec<BlockCoord>>, FusionError> {
        Ok(touched_blocks(&views.0, grid, scale, limit).ok())
    }

    fn sample(
        &mut self,
        views: &CpuViews,
        grid: &Grid,
        coords: &[BlockCoord],
    ) -> Result<SampledBlocks, FusionError> {
        let fresh = || BlockSums::new(grid.edge);
        let sampled = SampledBlocks::resolve_all(grid, coords, fresh, |sums, coord| {
            sums.clear();
            views.0.iter().for_each(|view| sums.integrate(view, grid, coord));
        });
        Ok(sampled)
    }

    fn accumulate(
        &mut self,
        sums: &mut CpuSums,
        views: &CpuViews,
        grid: &Grid,
        touched: &[BlockCoord],
    ) -> Result<(), FusionError> {
        for coord in touched {
            sums.0.entry(coord.morton()).or_insert_with(|| BlockSums::new(grid.edge));
        }
        sums.0.par_iter_mut().for_each(|(code, sums)| {
            views.0.iter().for_each(|view| sums.integrate(view, grid, code.coord()));
            sums.forget(MOST_WEIGHT);
        });
        Ok(())
    }

    fn coords(sums: &CpuSums) -> Vec<BlockCoord> {
        sums.0.keys().map(|code| code.coord()).collect()
    }

    fn resolve(&mut self, sums: &CpuSums, grid: &Grid) -> Result<SampledBlocks, FusionError> {
        Ok(sums.resolve(grid))
    }
}
