//! Volumes of analytic distance fields.

use isv_volume::{BlockCoord, Grid, SparseVolume, VolumeBuilder, VoxelMask};

/// Volume of a signed distance in voxels, over the blocks of a cube of `reach` blocks either way; voxels for which
/// `hidden` holds are unobserved.
#[must_use]
pub fn volume_of(
    grid: Grid,
    reach: i32,
    distance: impl Fn([f64; 3]) -> f64,
    hidden: impl Fn([f64; 3]) -> bool,
) -> SparseVolume {
    let (n, limit) = (grid.edge.voxels(), f64::from(grid.truncation.voxels()));
    let mut builder = VolumeBuilder::new(grid);
    for block in 0..(2 * reach).pow(3) {
        let coord = [0, 1, 2].map(|axis| block / (2 * reach).pow(axis) % (2 * reach) - reach);
        let position = |voxel: usize| {
            let local = [voxel % n, voxel / n % n, voxel / n / n];
            std::array::from_fn::<_, 3, _>(|a| f64::from(coord[a] * n as i32) + local[a] as f64 + 0.5)
        };
        let distances: Vec<f64> = (0..n * n * n).map(|v| distance(position(v))).collect();
        let mut mask = VoxelMask::empty(grid.edge);
        (0..n * n * n).filter(|v| hidden(position(*v))).for_each(|v| mask.insert(v));
        if distances.iter().any(|d| d.abs() <= limit) {
            let samples = distances.iter().map(|d| (d.clamp(-limit, limit) * 256.0).round() as i16).collect();
            builder.push(BlockCoord::from(coord), samples, Some(mask));
        }
    }
    builder.finish()
}

/// Frame `t` of a lumpy ball that moves and breathes, with a hole below.
#[must_use]
pub fn ball(grid: Grid, t: f64) -> SparseVolume {
    let centre = [1.3 * t, -0.7 * t, 0.4 * t];
    let from_centre = move |p: [f64; 3]| [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
    volume_of(
        grid,
        (40 / grid.edge.voxels()) as i32,
        move |p| {
            let [x, y, z] = from_centre(p);
            (x * x + y * y + z * z).sqrt() - 14.0 - (0.4 * x + 0.1 * t).sin() - 0.8 * (0.3 * y).cos()
        },
        move |p| from_centre(p)[1] < -12.0,
    )
}

/// Two such balls: frame 0 of one, that stays, and frame `t` of another a little more than its own size away.
#[must_use]
pub fn still_and_moving_ball(grid: Grid, t: f64) -> SparseVolume {
    let mut builder = VolumeBuilder::new(grid);
    for (volume, place) in [(ball(grid, 0.0), [0; 3]), (ball(grid, t), [-88, 16, 8])] {
        let place = place.map(|voxels| voxels / grid.edge.voxels() as i32);
        for (block, coord) in volume.coords().iter().enumerate() {
            builder.push(
                coord.offset(place),
                volume.block(block).to_vec(),
                volume.unobserved(block).cloned(),
            );
        }
    }
    builder.finish()
}

/// Frame `t` of a ball of some 5 voxels that moves along x.
#[must_use]
pub fn small_ball(grid: Grid, t: f64) -> SparseVolume {
    volume_of(grid, 2, |[x, y, z]| ((x - t).powi(2) + 1.3 * y * y + z * z).sqrt() - 5.2, |_| false)
}
