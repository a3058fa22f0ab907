//! Distances anew, of a volume whose samples hold near its surface alone.

use crate::{IngestError, MeshIngest, SignDecision, ingest_mesh};
use isv_volume::{CODES_PER_VOXEL, SparseVolume, TriangleMesh, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A volume with the distances of its surface, which was extracted from it, in all voxels that are a voxel or more from that. Samples
/// nearer to it say where it is, and stay; so do signs and unobserved voxels. In blocks of one sign, voxels that are two voxels or more from
/// the surface become unobserved: a cell with surface has no such corner. Blocks of nothing else are left out.
///
/// Decoded frames of profile `main` need this before they are taken for what was captured. Far from the
/// surface their encoder looked at signs alone. The blocks around the coded ones were extrapolated, each with
/// the sign that most of its neighbours made likely. `max_blocks`: as [`MeshIngest::max_blocks`].
///
/// # Errors
/// As [`ingest_mesh`].
pub fn redistance(
    volume: &SparseVolume,
    surface: &TriangleMesh,
    max_blocks: usize,
) -> Result<SparseVolume, IngestError> {
    if surface.triangles.is_empty() {
        return Ok(volume.clone());
    }
    let grid = *volume.grid();
    // An offset of one code, which is taken off again, leaves distances without a sign.
    let offset_voxels = 1.0 / f64::from(CODES_PER_VOXEL);
    let settings = MeshIngest { offset_voxels, max_blocks, ..MeshIngest::new(grid) };
    let unsigned = ingest_mesh(surface, &settings, SignDecision::Offset)?;
    let (index, limit) = (unsigned.index(), grid.truncation.codes());
    let near = CODES_PER_VOXEL as i16;
    let mut samples: Vec<i16> = volume.samples().collect();
    let blocks = samples.par_chunks_exact_mut(grid.edge.block_voxels()).zip(volume.coords());
    let far = blocks.map(|(block, coord)| {
        let distances = index.get(*coord).map(|block| unsigned.block(block as usize));
        let has_one_sign = block.iter().all(|sample| (*sample < 0) == (block[0] < 0));
        let mut far = VoxelMask::empty(grid.edge);
        for (voxel, sample) in block.iter_mut().enumerate() {
            let distance = distances.map_or(limit, |distances| (distances[voxel] + 1).min(limit));
            if distance >= near {
                *sample = if *sample < 0 { -distance } else { distance };
            }
            if has_one_sign && distance >= 2 * near {
                far.insert(voxel);
            }
        }
        far
    });
    let mut masks: BTreeMap<u32, VoxelMask> = (0..).zip(far.collect::<Vec<_>>()).collect();
    masks.retain(|_, mask| !mask.is_empty());
    let mut whole = SparseVolume::from_parts(grid, volume.coords().to_vec(), samples, masks);
    whole.add_unobserved(volume.unobserved_masks().clone());
    let all = grid.edge.block_voxels();
    Ok(whole.select(|block| whole.unobserved(block).is_none_or(|mask| mask.count() < all)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_surface::{SurfaceOptions, extract_surface};
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    #[test]
    fn distances_come_back_and_the_surface_stays() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.01).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        let mesh = isv_testkit::sphere(0.2, 40);
        let closed = SignDecision::Closed { flipped: false };
        let captured = ingest_mesh(&mesh, &MeshIngest::new(grid), closed).unwrap();
        // As far as a decoder of profile `main` knows: signs, and a hundredth of a voxel.
        let samples = captured.samples().map(|d| if d.abs() < 300 { d } else { 5 * d.signum() });
        let coords = captured.coords().to_vec();
        let decoded =
            SparseVolume::from_parts(grid, coords, samples.collect(), captured.unobserved_masks().clone());
        let surface = |volume: &SparseVolume| extract_surface(volume, &SurfaceOptions::default());
        let again = redistance(&decoded, &surface(&decoded), 10_000).unwrap();
        assert!(again.block_count() > 0);
        let index = captured.index();
        for (block, coord) in again.coords().iter().enumerate() {
            let captured = captured.block(index.get(*coord).unwrap() as usize);
            for (voxel, (again, captured)) in again.block(block).iter().zip(captured).enumerate() {
                assert!((again - captured).abs() <= 16, "voxel {voxel}: {again} for {captured}");
            }
        }
        assert_eq!(surface(&again).triangles, surface(&decoded).triangles);
        assert_eq!(surface(&again).vertices, surface(&decoded).vertices);
        let nothing = TriangleMesh::default();
        assert!(redistance(&decoded, &nothing, 1).unwrap() == decoded);
    }
}
