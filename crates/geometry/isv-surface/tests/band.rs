//! What is left of a volume when only the blocks that its surface needs stay.

mod volumes;

use glam::DVec3;
use isv_surface::{SurfaceOptions, extract_surface, surface_band};
use isv_volume::{SparseVolume, VolumeBuilder, VoxelMask};
use proptest::prelude::*;
use volumes::{cube, grid, sample, voxels};

/// Checks that the mesh stays, bit for bit, and that no block is too many by the definition.
fn check_band(volume: &SparseVolume) -> SparseVolume {
    let band = surface_band(volume);
    let options = SurfaceOptions { normals: true };
    assert_eq!(extract_surface(&band, &options), extract_surface(volume, &options));
    assert_eq!(band.coords(), needed_blocks(volume), "the blocks within a voxel of the crossed cells");
    assert_eq!(surface_band(&band), band);
    band
}

/// The blocks within a voxel of the corners of crossed and observed cells, from the definition.
fn needed_blocks(volume: &SparseVolume) -> Vec<isv_volume::BlockCoord> {
    let edge = volume.grid().edge;
    let n = edge.voxels() as i32;
    let index = volume.index();
    let code = |v: [i32; 3]| {
        let block = index.get(v.map(|c| c.div_euclid(n)).into())? as usize;
        let [x, y, z] = v.map(|c| c.rem_euclid(n) as usize);
        let voxel = edge.voxel_index(x, y, z);
        volume.unobserved(block).is_none_or(|m| !m.contains(voxel)).then(|| volume.block(block)[voxel])
    };
    let offset = |v: [i32; 3], by: [i32; 3]| [v[0] + by[0], v[1] + by[1], v[2] + by[2]];
    let mut needed = vec![false; volume.block_count()];
    for coord in volume.coords() {
        for voxel in voxels(edge) {
            let lowest = offset(coord.to_array().map(|c| c * n), voxel.map(|v| v as i32));
            let corners = cube(0..2).map(|c| code(offset(lowest, c.to_array()))).collect::<Option<Vec<_>>>();
            if corners.is_some_and(|c| c.iter().any(|v| *v < 0) && c.iter().any(|v| *v >= 0)) {
                for near in cube(-1..3) {
                    let block = offset(lowest, near.to_array()).map(|c| c.div_euclid(n));
                    if let Some(block) = index.get(block.into()) {
                        needed[block as usize] = true;
                    }
                }
            }
        }
    }
    volume.coords().iter().zip(needed).filter(|(_, n)| *n).map(|(c, _)| *c).collect()
}

#[test]
fn a_sphere_keeps_the_blocks_at_its_surface() {
    for edge in [4, 8, 16] {
        for centre in [DVec3::ZERO, DVec3::new(0.043, -0.071, 0.018)] {
            let whole = sample(grid(edge), 0.4, |p| p.distance(centre) - 0.2);
            let band = check_band(&whole);
            assert!(band.block_count() < whole.block_count());
        }
    }
}

#[test]
fn a_volume_without_a_surface_keeps_nothing() {
    let mut builder = VolumeBuilder::new(grid(4));
    cube(-1..1).for_each(|coord| builder.push(coord, vec![300; 64], None));
    assert_eq!(check_band(&builder.finish()).block_count(), 0);
    check_band(&SparseVolume::empty(grid(8)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A few inside voxels in blocks of which some are missing, and voxels that were not observed.
    #[test]
    fn specks_keep_their_blocks(
        edge in prop::sample::select(&[4u32, 8, 16][..]),
        specks in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 0..12),
        missing in prop::collection::vec(any::<prop::sample::Index>(), 0..4),
    ) {
        let grid = grid(edge);
        let side = 2 * edge as usize;
        let mut builder = VolumeBuilder::new(grid);
        let gone: Vec<usize> = missing.iter().map(|block| block.index(8)).collect();
        for (block, coord) in cube(-1..1).enumerate().filter(|(block, _)| !gone.contains(block)) {
            let mut samples = vec![256; grid.edge.block_voxels()];
            let mut mask = VoxelMask::empty(grid.edge);
            for (place, hidden) in &specks {
                let place = place.index(side.pow(3));
                let at = [place % side, place / side % side, place / side / side];
                let of = at.map(|c| c / edge as usize);
                if of[0] + 2 * of[1] + 4 * of[2] == block {
                    let [x, y, z] = at.map(|c| c % edge as usize);
                    let voxel = grid.edge.voxel_index(x, y, z);
                    samples[voxel] = -100;
                    if *hidden {
                        mask.insert(voxel);
                    }
                }
            }
            builder.push(coord, samples, Some(mask));
        }
        check_band(&builder.finish());
    }
}
