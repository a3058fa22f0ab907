//! Sign changes that no surface explains.
//!
//! Near a wide hole the winding number passes one half somewhere in free space. Mostly that happens among voxels whose
//! closest surface point lies on the hole's edge, which are unobserved; but where the rim bends inwards it happens
//! between voxels closest to a face, and would leave a piece of invented surface there. Two neighbours whose distances
//! add up to more than a voxel are on one side of the surface ([`crate::regions`] holds to that inside a block); where two
//! blocks disagree, the voxels on both sides of their common face are unobserved as well.

use crate::sampler::{Sign, Source, blend_across_hole};
use isv_volume::{BlockCoord, BlockIndex, CODES_PER_VOXEL, VoxelMask};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Distances that add up to this many codes leave no surface between two neighbours: a voxel, and slack for rounding.
const APART: u32 = CODES_PER_VOXEL as u32 + 4;

/// The blocks of a frame while they are put together.
#[derive(Default)]
pub(crate) struct Blocks {
    pub(crate) coords: Vec<BlockCoord>,
    pub(crate) samples: Vec<i16>,
    pub(crate) masks: BTreeMap<u32, VoxelMask>,
}

impl Blocks {
    /// Makes the voxels beside unexplained sign changes at the faces of masked blocks unobserved.
    pub(crate) fn open_caps(&mut self, source: &Source) {
        let Sign::Closed(winding) = source.sign else { return };
        if !source.has_wide_holes() {
            return;
        }
        let size = source.grid.edge.block_voxels();
        let found = self.unexplained(source);
        let samples = &self.samples;
        let blend = |&(block, voxel): &(u32, u32)| {
            let distance =
                f32::from(samples[block as usize * size + voxel as usize].abs()) / CODES_PER_VOXEL as f32;
            let (coord, voxels) = (self.coords[block as usize], [voxel as usize]);
            blend_across_hole(&source.grid, winding, coord, &voxels, |_| distance)
        };
        let blended: Vec<_> = found.par_iter().map(blend).collect();
        for (&(block, _), blended) in found.iter().zip(blended) {
            let mask = self.masks.entry(block).or_insert_with(|| VoxelMask::empty(source.grid.edge));
            for (voxel, sample) in blended {
                mask.insert(voxel);
                self.samples[block as usize * size + voxel] = sample;
            }
        }
        self.drop_unobserved(&found, source);
    }

    /// Block and voxel of all observed voxels with an unexplained sign change to a neighbour in another block.
    fn unexplained(&self, source: &Source) -> BTreeSet<(u32, u32)> {
        let index = BlockIndex::new(&self.coords);
        let beside = |block: &u32| {
            let mut found = Vec::new();
            for axis in 0..3 {
                for side in [-1, 1] {
                    let mut step = [0; 3];
                    step[axis] = side;
                    if let Some(other) = index.get(self.coords[*block as usize].offset(step)) {
                        let (lower, upper) = if side > 0 { (*block, other) } else { (other, *block) };
                        self.compare_faces(source, lower, upper, axis, &mut found);
                    }
                }
            }
            found
        };
        self.masks.par_iter().flat_map_iter(|(block, _)| beside(block)).collect()
    }

    /// Looks at the voxel pairs across the face between two blocks, `upper` following `lower` along `axis`.
    fn compare_faces(
        &self,
        source: &Source,
        lower: u32,
        upper: u32,
        axis: usize,
        found: &mut Vec<(u32, u32)>,
    ) {
        let (n, size) = (source.grid.edge.voxels(), source.grid.edge.block_voxels());
        let observed = |block: u32, voxel: usize| !self.masks.get(&block).is_some_and(|m| m.contains(voxel));
        for a in 0..n {
            for b in 0..n {
                let voxel_at = |layer: usize| {
                    let mut v = [a, b, layer];
                    v.rotate_left(2 - axis);
                    source.grid.edge.voxel_index(v[0], v[1], v[2])
                };
                let (below, above) = (voxel_at(n - 1), voxel_at(0));
                let s = self.samples[lower as usize * size + below];
                let t = self.samples[upper as usize * size + above];
                let apart = u32::from(s.unsigned_abs()) + u32::from(t.unsigned_abs()) > APART;
                if (s < 0) != (t < 0) && apart && observed(lower, below) && observed(upper, above) {
                    found.extend([(lower, below as u32), (upper, above as u32)]);
                }
            }
        }
    }

    /// Drops those of the changed blocks that have no observed voxel in the band any more.
    fn drop_unobserved(&mut self, changed: &BTreeSet<(u32, u32)>, source: &Source) {
        let size = source.grid.edge.block_voxels();
        let limit = source.grid.truncation.codes();
        let empty = |block: u32| {
            let samples = &self.samples[block as usize * size..][..size];
            samples.iter().enumerate().all(|(v, s)| s.abs() >= limit || self.masks[&block].contains(v))
        };
        let dropped: BTreeSet<u32> = changed.iter().map(|c| c.0).filter(|block| empty(*block)).collect();
        if dropped.is_empty() {
            return;
        }
        let old = std::mem::take(self);
        for (block, coord) in old.coords.iter().enumerate() {
            if !dropped.contains(&(block as u32)) {
                if let Some(mask) = old.masks.get(&(block as u32)) {
                    self.masks.insert(self.coords.len() as u32, mask.clone());
                }
                self.coords.push(*coord);
                self.samples.extend_from_slice(&old.samples[block * size..][..size]);
            }
        }
    }
}
