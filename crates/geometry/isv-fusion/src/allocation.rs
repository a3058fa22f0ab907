//! Which blocks the band around the seen surface reaches.

use crate::view::{LEAST_COSINE, Surfel, View};
use glam::{DMat3, DVec3};
use isv_volume::{BlockCoord, COORD_LIMIT, Grid};
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows of an image that one thread looks at in a go.
const ROWS: usize = 16;

/// Blocks that a strip finds before it tells the other strips.
const REPORT: usize = 1024;

/// Rays of an image for each of its pixels and for each block that is allowed. A pixel more than half a block
/// wide is cut into at most nine times the square of what it covers in halves of blocks. This is enough for a
/// surface that fills all blocks and is seen at 6 degrees. Only pixels that are far wider than high, or far
/// higher than wide, need more.
const RAYS_PER_PIXEL: u64 = 16;
const RAYS_PER_BLOCK: u64 = 64;

/// More blocks than allowed, or so many rays that they would cost as much.
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
        let rays = Rays::new(view, grid, scale, limit);
        if rays.least_blocks() > limit as f64 || rays.count() > rays.most() {
            return Err(OverLimit);
        }
        let width = view.intrinsics.width as usize;
        let strips: Vec<_> = view.surfels[..view.intrinsics.pixels()]
            .par_chunks(width * ROWS)
            .enumerate()
            .map(|(strip, surfels)| rays.blocks_of_strip(strip * ROWS, surfels))
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
    /// Centre of the camera, in blocks.
    centre: DVec3,
    /// Voxels of the grid to a block, and voxels of the view.
    edge: f64,
    block_edge: f64,
    limit: usize,
    /// Blocks of all strips; those that several strips found count several times.
    found: AtomicUsize,
}

impl<'a> Rays<'a> {
    fn new(view: &'a View, grid: &Grid, scale: f64, limit: usize) -> Self {
        let block_edge = grid.edge.voxels() as f64 * scale;
        Self {
            view,
            edge: grid.edge.voxels() as f64,
            rotation: view.rotation.transpose(),
            centre: view.centre / block_edge,
            block_edge,
            limit,
            found: AtomicUsize::new(0),
        }
    }

    /// Least number of blocks that the surface needs: its area across the rays over the largest area that a
    /// plane cuts out of a block. It saves looking for what is far too much.
    fn least_blocks(&self) -> f64 {
        let lens = &self.view.intrinsics;
        let (width, pixel) = (lens.width as usize, 1.0 / (lens.focal.x * lens.focal.y));
        let area = |(pixel_number, surfel): (usize, &Surfel)| {
            let (column, row) = ((pixel_number % width) as f32, (pixel_number / width) as f32);
            let depth = f64::from(self.view.point(surfel, column, row).z) / self.block_edge;
            depth * depth * pixel
        };
        let seen = self.view.surfels.iter().enumerate().filter(|(_, surfel)| surfel.weight > 0.0);
        seen.map(area).sum::<f64>() / 2.0
    }

    /// How many rays there are.
    fn count(&self) -> u64 {
        let width = self.view.intrinsics.width as usize;
        let of_pixel = |(pixel, surfel): (usize, &Surfel)| {
            let (column, row) = ((pixel % width) as f32, (pixel / width) as f32);
            if surfel.weight > 0.0 { u64::from(self.parts(surfel, column, row)).pow(2) } else { 0 }
        };
        self.view.surfels.par_iter().enumerate().map(of_pixel).sum()
    }

    /// How many rays there may be.
    fn most(&self) -> u64 {
        let of_pixels = self.view.intrinsics.pixels() as u64 * RAYS_PER_PIXEL;
        (self.limit as u64).saturating_mul(RAYS_PER_BLOCK).saturating_add(of_pixels)
    }

    /// What the strips may find together. A block that lies in many strips is a large one, of which there are few.
    fn most_found(&self) -> usize {
        self.limit.saturating_mul(4).saturating_add(100_000)
    }

    fn blocks_of_strip(
        &self,
        first_row: usize,
        surfels: &[Surfel],
    ) -> Result<FxHashSet<BlockCoord>, OverLimit> {
        let width = self.view.intrinsics.width as usize;
        let (mut blocks, mut reported) = (FxHashSet::default(), 0);
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
                        if is_addressed(block) {
                            blocks.insert(block);
                        }
                    }
                });
                if blocks.len() >= reported + REPORT {
                    let all = self.found.fetch_add(blocks.len() - reported, Ordering::Relaxed);
                    reported = blocks.len();
                    if all > self.most_found() {
                        return Err(OverLimit);
                    }
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
        let seen = self.view.point(surfel, column, row);
        let cosine = surfel.cosine(seen);
        // Towards the edge of a pixel of some ten degrees, a slanted plane and its band go on without end.
        if cosine.is_nan() || cosine < 0.5 * LEAST_COSINE {
            return;
        }
        let point = self.rotation * seen.as_dvec3() / self.block_edge;
        let depth = point.length();
        let band = f64::from(surfel.band / cosine) / self.edge;
        let at = |depth_along: f64| self.centre + point * (depth_along / depth);
        let (start, end) = (at((depth - band).max(0.0)), at(depth + band));
        let steps = (2.0 * (end - start).length()).ceil().max(1.0);
        for step in 0..=steps as usize {
            let block = start.lerp(end, step as f64 / steps).floor();
            visit(step, BlockCoord::from(block.to_array().map(|c| c as i32)));
        }
    }
}

/// Whether a block and its neighbours have coordinates. All that pixels show at their middles does; at the edge of a wide one, its plane may
/// be farther away.
fn is_addressed(block: BlockCoord) -> bool {
    block.to_array().iter().all(|c| (1 - COORD_LIMIT..COORD_LIMIT - 1).contains(c))
}
