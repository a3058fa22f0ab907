//! How far a decoded volume's surface is from the source's, without extracting either.

use isv_volume::{CODES_PER_VOXEL, SparseVolume};

/// Voxels nearer to the surface than this, in voxels, count.
const NEAR_SURFACE: f64 = 0.9;

/// Root mean square, in voxels, of the change in signed distance at the observed voxels within 0.9 voxel of the source's surface.
/// It is 0 if there are none. Blocks that the decoded volume does not have are left out. Unlike
/// [`surface_distance_voxels`](crate::surface_distance_voxels), this tells neither what was lost nor what was never there.
#[must_use]
pub fn surface_rms_voxels(source: &SparseVolume, decoded: &SparseVolume) -> f64 {
    let index = decoded.index();
    let near = (NEAR_SURFACE * f64::from(CODES_PER_VOXEL)) as i16;
    let (mut squares, mut count) = (0.0, 0u64);
    for block in 0..source.block_count() {
        let Some(there) = index.get(source.coords()[block]) else { continue };
        let mask = source.unobserved(block);
        for (voxel, (a, b)) in source.block(block).iter().zip(decoded.block(there as usize)).enumerate() {
            if a.abs() <= near && !mask.is_some_and(|m| m.contains(voxel)) {
                squares += f64::from(i32::from(*a) - i32::from(*b)).powi(2);
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { (squares / count as f64).sqrt() / f64::from(CODES_PER_VOXEL) }
}
