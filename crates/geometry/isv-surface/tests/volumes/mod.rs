//! Volumes sampled from functions.

use glam::DVec3;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelSize,
};

/// Voxels of 10 mm, truncated at 4 voxels.
pub(crate) fn grid(edge: u32) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.01).unwrap(),
        edge: BlockEdge::from_voxels(edge).unwrap(),
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// Samples a signed distance in metres over the cube of blocks that covers `-half_m..half_m` around the origin; blocks
/// beyond the truncation band are left out.
pub(crate) fn sample(grid: Grid, half_m: f64, distance_m: impl Fn(DVec3) -> f64) -> SparseVolume {
    let reach = (half_m / (grid.voxel_size.metres() * grid.edge.voxels() as f64)).ceil() as i32;
    let limit = f64::from(grid.truncation.codes());
    let mut builder = VolumeBuilder::new(grid);
    for coord in cube(-reach..reach) {
        let samples: Vec<i16> = voxels(grid.edge)
            .map(|voxel| {
                let codes = distance_m(grid.voxel_centre_m(coord, voxel)) / grid.voxel_size.metres()
                    * f64::from(CODES_PER_VOXEL);
                codes.round().clamp(-limit, limit) as i16
            })
            .collect();
        if samples.iter().any(|s| f64::from(s.abs()) < limit) {
            builder.push(coord, samples, None);
        }
    }
    builder.finish()
}

/// All block coordinates of a cube.
pub(crate) fn cube(range: std::ops::Range<i32>) -> impl Iterator<Item = BlockCoord> {
    let axis = move || range.clone();
    let (y_axis, x_axis) = (axis.clone(), axis.clone());
    axis().flat_map(move |z| {
        let x_axis = x_axis.clone();
        y_axis().flat_map(move |y| x_axis().map(move |x| BlockCoord { x, y, z }))
    })
}

/// Voxels of a block in storage order.
pub(crate) fn voxels(edge: BlockEdge) -> impl Iterator<Item = [usize; 3]> {
    let n = edge.voxels();
    (0..n * n * n).map(move |i| [i % n, i / n % n, i / (n * n)])
}
