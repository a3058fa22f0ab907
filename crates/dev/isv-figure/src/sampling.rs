//! Samples the field where it is near zero, coarse to fine.

use crate::BOUNDS_M;
use crate::clay::{Clay, Part, STEEPEST, distance};
use glam::{DVec3, Vec3};
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelSize,
};
use rayon::prelude::*;

const EDGE: BlockEdge = BlockEdge::E8;

/// Voxels of truncation: enough for a cell's corners and the gradient there.
const TRUNCATION_VOXELS: u32 = 3;

/// Blocks along the edge of the cubes that the search starts with; a power of two.
const ROOT_BLOCKS: i32 = 8;

/// Edge, in voxels, of the parts of a block that are left out if the surface is far.
const SUB: usize = 4;

/// The blocks that the surface passes through.
pub(crate) fn sample(clay: &Clay, voxel_size: VoxelSize) -> SparseVolume {
    let truncation = Truncation::from_voxels(TRUNCATION_VOXELS).expect("in range");
    let sampler = Sampler { grid: Grid { voxel_size, edge: EDGE, truncation } };
    let parts = clay.parts();
    let roots = sampler.roots();
    let blocks: Vec<_> =
        roots.par_iter().flat_map_iter(|root| sampler.search(*root, ROOT_BLOCKS, &parts)).collect();
    let mut builder = VolumeBuilder::new(sampler.grid);
    for (coord, samples) in blocks {
        builder.push(coord, samples, None);
    }
    builder.finish()
}

struct Sampler {
    grid: Grid,
}

/// A cube of voxels, judged by the field at its middle.
struct Cube<'a> {
    parts: Vec<&'a Part>,
    distance: f32,
    /// Whether no cell that touches the cube can meet the surface.
    far: bool,
}

impl Sampler {
    /// The cubes of [`ROOT_BLOCKS`] that cover the figure's bounds, by their lowest block.
    fn roots(&self) -> Vec<BlockCoord> {
        let root_m = self.voxel_m() * EDGE.voxels() as f64 * f64::from(ROOT_BLOCKS);
        // A cell that the soles pass through reaches below the ground.
        let low = ((BOUNDS_M.0 - self.voxel_m()) / root_m).floor().as_ivec3();
        let high = ((BOUNDS_M.1 + self.voxel_m()) / root_m).ceil().as_ivec3();
        let mut roots = Vec::new();
        for z in low.z..high.z {
            for y in low.y..high.y {
                roots.extend((low.x..high.x).map(|x| BlockCoord::from([x, y, z].map(|c| c * ROOT_BLOCKS))));
            }
        }
        roots
    }

    /// Samples the blocks near the surface in a cube of `blocks` a side, given the parts that matter there.
    fn search(&self, lowest: BlockCoord, blocks: i32, parts: &[&Part]) -> Vec<(BlockCoord, Vec<i16>)> {
        let cube = self.cube(lowest, [0; 3], EDGE.voxels() * blocks as usize, parts);
        if cube.far {
            return Vec::new();
        }
        if blocks == 1 {
            let samples = self.sample_block(lowest, &cube.parts);
            let limit = self.grid.truncation.codes();
            let near = samples.iter().any(|s| s.abs() < limit);
            return near.then_some((lowest, samples)).into_iter().collect();
        }
        let half = blocks / 2;
        let octants = (0..8).map(|i| lowest.offset([i & 1, i >> 1 & 1, i >> 2].map(|step| step * half)));
        octants.flat_map(|octant| self.search(octant, half, &cube.parts)).collect()
    }

    fn sample_block(&self, block: BlockCoord, parts: &[&Part]) -> Vec<i16> {
        let limit = f32::from(self.grid.truncation.codes());
        let codes_a_metre = CODES_PER_VOXEL as f32 / self.voxel_m() as f32;
        let mut samples = vec![0; EDGE.block_voxels()];
        for sub in steps(EDGE.voxels() / SUB) {
            let lowest = sub.map(|c| c * SUB);
            let cube = self.cube(block, lowest, SUB, parts);
            for voxel in steps(SUB) {
                let [x, y, z] = [0, 1, 2].map(|axis| lowest[axis] + voxel[axis]);
                let codes = if cube.far {
                    limit.copysign(cube.distance)
                } else {
                    let p = self.grid.voxel_centre_m(block, [x, y, z]).as_vec3();
                    (distance(&cube.parts, p) * codes_a_metre).round().clamp(-limit, limit)
                };
                samples[EDGE.voxel_index(x, y, z)] = codes as i16;
            }
        }
        samples
    }

    /// Looks at the middle of a cube of voxels; of `parts`, only those that matter in it are kept.
    fn cube<'a>(&self, block: BlockCoord, lowest: [usize; 3], voxels: usize, parts: &[&'a Part]) -> Cube<'a> {
        let centre = self.cube_centre(block, lowest, voxels);
        let radius_m = self.cube_radius_m(voxels);
        let band_m = (self.voxel_m() * f64::from(TRUNCATION_VOXELS)) as f32;
        let parts: Vec<_> = parts.iter().filter(|p| p.matters(centre, radius_m, band_m)).copied().collect();
        let distance = distance(&parts, centre);
        Cube { parts, distance, far: distance.abs() > STEEPEST * radius_m }
    }

    /// World position of the middle of a cube of voxels.
    fn cube_centre(&self, block: BlockCoord, lowest: [usize; 3], voxels: usize) -> Vec3 {
        let to_middle_m = (voxels as f64 - 1.0) / 2.0 * self.voxel_m();
        (self.grid.voxel_centre_m(block, lowest) + DVec3::splat(to_middle_m)).as_vec3()
    }

    /// Distance from the middle of a cube of voxels to the farthest corner of a cell that touches it.
    fn cube_radius_m(&self, voxels: usize) -> f32 {
        (3f64.sqrt() * (voxels as f64 / 2.0 + 1.0) * self.voxel_m()) as f32
    }

    fn voxel_m(&self) -> f64 {
        self.grid.voxel_size.metres()
    }
}

/// All `[x, y, z]` with components below `n`, x fastest.
fn steps(n: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..n * n * n).map(move |i| [i % n, i / n % n, i / (n * n)])
}
