//! Which blocks the band around the seen surface reaches.

use crate::view::{Surfel, View};
use glam::{DMat3, DVec3};
use isv_volume::{BlockCoord, Grid};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

/// Rows of an image that one thread looks at in a go.
const ROWS: usize = 16;

/// More blocks than allowed.
pub(crate) struct OverLimit;

/// The blocks that rays pass through within the band, in Morton order. The grid's voxels are `scale` times as large as
/// those of the views.
///
/// Memory is bounded by a small multiple of the limit.
pub(crate) fn touched_blocks(
    views: &[View],
    grid: &Grid,
    scale: f64,
    limit: usize,
) -> Result<Vec<BlockCoord>, OverLimit> {
    let mut blocks = FxHashSet::default();
    for view in views {
        let rays = Rays::new(view, grid, scale);
        let width = view.intrinsics.width as usize;
        let strips: Vec<_> = view.surfels[..view.intrinsics.pixels()]
            .par_chunks(width * ROWS)
            .enumerate()
            .map(|(strip, surfels)| rays.blocks_of_strip(strip * ROWS, surfels, limit))
            .collect::<Result<_, _>>()?;
        for strip in strips {
            blocks.extend(strip);
            if blocks.len() > limit {
                return Err(OverLimit);
            }
        }
    }
    let mut blocks: Vec<_> = blocks.into_iter().collect();
    blocks.par_sort_unstable_by_key(|block| block.morton());
    Ok(blocks)
}

/// The rays of a view among the blocks of a grid.
struct Rays<'a> {
    view: &'a View,
    /// Camera to world.
    rotation: DMat3,
    /// Of the camera, in blocks.
    centre: DVec3,
    /// Voxels of the grid to a block, and voxels of the view.
    edge: f64,
    block_edge: f64,
}

impl<'a> Rays<'a> {
    fn new(view: &'a View, grid: &Grid, scale: f64) -> Self {
        let block_edge = grid.edge.voxels() as f64 * scale;
        Self {
            view,
            edge: grid.edge.voxels() as f64,
            rotation: view.rotation.transpose(),
            centre: view.centre / block_edge,
            block_edge,
        }
    }

    fn blocks_of_strip(
        &self,
        first_row: usize,
        surfels: &[Surfel],
        limit: usize,
    ) -> Result<FxHashSet<BlockCoord>, OverLimit> {
        let width = self.view.intrinsics.width as usize;
        let mut blocks = FxHashSet::default();
        // What the ray before met at the same step: most rays meet it again.
        let mut before = [BlockCoord::from([i32::MAX; 3]); 8];
        for (pixel, surfel) in surfels.iter().enumerate().filter(|(_, surfel)| surfel.weight > 0.0) {
            let (column, row) = ((pixel % width) as f32, (first_row + pixel / width) as f32);
            let parts = self.parts(surfel, column, row);
            for part in 0..u64::from(parts) * u64::from(parts) {
                let offset = |i: u64| (i as f32 + 0.5) / parts as f32 - 0.5;
                let (right, down) = (offset(part % u64::from(parts)), offset(part / u64::from(parts)));
                self.walk(surfel, column + right, row + down, |step, block| {
                    let before = &mut before[step % 8];
                    if block != *before {
                        *before = block;
                        blocks.insert(block);
                    }
                });
                if blocks.len() > limit {
                    return Err(OverLimit);
                }
            }
        }
        Ok(blocks)
    }

    /// Into how many parts along each side a pixel is cut so that no part covers more than half a block's edge.
    fn parts(&self, surfel: &Surfel, column: f32, row: f32) -> u32 {
        let point = self.view.point(surfel, column, row);
        let across = f64::from(point.z) / (self.view.intrinsics.focal.min_element() * self.block_edge);
        (2.0 * across / f64::from(surfel.cosine(point))).ceil().clamp(1.0, 65_536.0) as u32
    }

    /// Visits the blocks on a ray, from the band's front to its back in steps of half a block.
    fn walk(&self, surfel: &Surfel, column: f32, row: f32, mut visit: impl FnMut(usize, BlockCoord)) {
        let point = self.rotation * self.view.point(surfel, column, row).as_dvec3() / self.block_edge;
        let depth = point.length();
        let band = f64::from(surfel.band / surfel.cosine(self.view.point(surfel, column, row))) / self.edge;
        let at = |depth_along: f64| self.centre + point * (depth_along / depth);
        let (start, end) = (at((depth - band).max(0.0)), at(depth + band));
        let steps = (2.0 * (end - start).length()).ceil().max(1.0);
        for step in 0..=steps as usize {
            let block = start.lerp(end, step as f64 / steps).floor();
            visit(step, BlockCoord::from(block.to_array().map(|c| c as i32)));
        }
    }
}
