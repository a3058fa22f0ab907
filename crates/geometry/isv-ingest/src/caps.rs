//! Sign changes that no surface explains.
//!
//! Over a wide hole, the triangles that close the mesh ([`crate::closure`]) part inside and outside in free
//! space. Mostly that happens among voxels whose closest surface point lies on the hole's edge, which are
//! unobserved. Where the rim bends inwards it happens between voxels closest to a face, and would leave a
//! piece of invented surface there. No surface lies in the open balls around two voxels with their distances
//! as radii. Two neighbours whose distances add up to more than a voxel are on one side of it. If their signs
//! differ, both are unobserved as well. Away from masked blocks, where narrow holes are closed, only
//! distances that no narrow hole has count.

use crate::sampler::blend_across_hole;
use crate::sides::{Caps, Sides};
use crate::tiles::TILE_BLOCKS;
use glam::IVec3;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, CODES_PER_VOXEL, Grid, VoxelMask};
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use std::collections::{BTreeMap, BTreeSet};

/// Distances that add up to this many codes leave no surface between two neighbours: a voxel, and slack for rounding.
const APART: u32 = CODES_PER_VOXEL as u32 + 4;

/// Sum of distances from which on two neighbours are too far apart where there may be a narrow hole. Such a
/// hole is no wider than 3 voxels ([`crate::holes`]), and the voxels are those beside its middle.
const FAR_APART: u32 = 5 * CODES_PER_VOXEL as u32;

/// A voxel: its block, and its index there.
pub(crate) type VoxelAt = (u32, u32);

/// Two neighbours of different signs.
pub(crate) struct SignChange {
    pub(crate) pair: [VoxelAt; 2],
    /// In codes.
    pub(crate) distances: [u16; 2],
}

/// The blocks of a frame while they are put together.
#[derive(Default)]
pub(crate) struct Blocks {
    pub(crate) coords: Vec<BlockCoord>,
    pub(crate) samples: Vec<i16>,
    pub(crate) masks: BTreeMap<u32, VoxelMask>,
    /// Blocks with voxels closest to a sheet. Other sign changes are unexplained there ([`crate::false_crossings`]).
    pub(crate) of_sheets: BTreeSet<u32>,
}

/// Whether samples have different signs, and distances that add up to more than `apart` codes.
#[inline(always)]
fn is_change([a, b]: [i16; 2], apart: u32) -> bool {
    // Of different signs, the sum is the difference.
    ((a ^ b) < 0) & ((i32::from(a) - i32::from(b)).unsigned_abs() > apart)
}

impl Blocks {
    /// Makes the voxels beside unexplained sign changes unobserved. `blending`: what unobserved samples are blended by, if they are.
    pub(crate) fn open_caps(&mut self, grid: &Grid, caps: &Caps, blending: Option<&Sides>) {
        let found = self.unexplained(grid.edge, caps);
        for &(block, voxel) in &found {
            let mask = self.masks.entry(block).or_insert_with(|| VoxelMask::empty(grid.edge));
            mask.insert(voxel as usize);
        }
        if let Some(sides) = blending {
            self.blend(grid, sides, &found);
        }
        self.drop_unobserved(&found, grid);
    }

    /// Blends the samples of some voxels across holes.
    pub(crate) fn blend(&mut self, grid: &Grid, sides: &Sides, voxels: &BTreeSet<VoxelAt>) {
        let size = grid.edge.block_voxels();
        let samples = &self.samples;
        let blended = |&(block, voxel): &VoxelAt| {
            let sample = samples[block as usize * size + voxel as usize];
            let distance = f32::from(sample.unsigned_abs()) / CODES_PER_VOXEL as f32;
            let coord = self.coords[block as usize];
            blend_across_hole(grid, sides, coord, &[voxel as usize], |_| distance)
        };
        let blended: Vec<_> = voxels.par_iter().map(blended).collect();
        for ((block, _), blended) in voxels.iter().zip(blended) {
            for (voxel, sample) in blended {
                self.samples[*block as usize * size + voxel] = sample;
            }
        }
    }

    /// All observed voxels with an unexplained sign change to a neighbour.
    fn unexplained(&self, edge: BlockEdge, caps: &Caps) -> BTreeSet<VoxelAt> {
        let index = BlockIndex::new(&self.coords);
        let around = |&(block, apart): &(u32, u32)| {
            self.sign_changes(edge, &index, block, apart, |_| false)
                .into_iter()
                .flat_map(|change| change.pair)
        };
        self.candidates(caps).par_iter().flat_map_iter(around).collect()
    }

    /// The blocks that are to be looked at: those with masks, and those that what closes the mesh passes by. Each with the sum of
    /// distances that leaves no surface between two voxels.
    fn candidates(&self, caps: &Caps) -> Vec<(u32, u32)> {
        let capped: FxHashSet<IVec3> = caps.tiles.iter().copied().collect();
        let candidate = |block: u32| {
            let tile = self.coords[block as usize].to_array().map(|c| c.div_euclid(TILE_BLOCKS));
            if self.of_sheets.contains(&block) {
                None
            } else if self.masks.contains_key(&block) {
                Some((block, APART))
            } else {
                capped.contains(&IVec3::from_array(tile)).then_some((block, FAR_APART))
            }
        };
        (0..self.coords.len() as u32).into_par_iter().filter_map(candidate).collect()
    }

    /// Sign changes between observed voxels of a block or across its faces, if the two distances add up to more than `apart` codes. Blocks
    /// before it along an axis are left out if `is_done` says so.
    pub(crate) fn sign_changes(
        &self,
        edge: BlockEdge,
        index: &BlockIndex,
        block: u32,
        apart: u32,
        is_done: impl Fn(u32) -> bool,
    ) -> Vec<SignChange> {
        let beside = |axis: usize, way: i32| {
            let mut step = [0; 3];
            step[axis] = way;
            index.get(self.coords[block as usize].offset(step))
        };
        let mut found = Vec::new();
        for axis in 0..3 {
            self.compare_layers(edge, [block; 2], axis, apart, &mut found);
            if let Some(before) = beside(axis, -1).filter(|before| !is_done(*before)) {
                self.compare_layers(edge, [before, block], axis, apart, &mut found);
            }
            if let Some(after) = beside(axis, 1) {
                self.compare_layers(edge, [block, after], axis, apart, &mut found);
            }
        }
        found
    }

    /// Looks at the voxel pairs along an axis. Both layers are of one block, which is given twice, or of two
    /// blocks, of which the second follows the first.
    fn compare_layers(
        &self,
        edge: BlockEdge,
        [lower, upper]: [u32; 2],
        axis: usize,
        apart: u32,
        found: &mut Vec<SignChange>,
    ) {
        let (n, size) = (edge.voxels(), edge.block_voxels());
        let [below, above] = [lower, upper].map(|block| &self.samples[block as usize * size..][..size]);
        let mut compare = |voxel: usize, next: usize| {
            let samples = [below[voxel], above[next]];
            if is_change(samples, apart) {
                let pair = [(lower, voxel as u32), (upper, next as u32)];
                let distances = samples.map(i16::unsigned_abs);
                found.extend(
                    pair.iter().all(|at| self.is_observed(*at)).then_some(SignChange { pair, distances }),
                );
            }
        };
        let (shift, stride) = (axis as u32 * edge.log2(), n.pow(axis as u32));
        let is_last = |voxel: usize| voxel >> shift & (n - 1) == n - 1;
        if lower == upper {
            // From each layer to the next. Most blocks have none, which takes no branch to see.
            let changes = below.iter().zip(&below[stride..]).enumerate();
            let any = changes
                .fold(false, |any, (voxel, (a, b))| any | (is_change([*a, *b], apart) & !is_last(voxel)));
            if any {
                let inner = (0..size - stride).filter(|voxel| !is_last(*voxel));
                inner.for_each(|voxel| compare(voxel, voxel + stride));
            }
        } else {
            // From the last layer of one to the first of the other.
            for place in 0..n * n {
                let first = place % stride + place / stride * stride * n;
                compare(first + (n - 1) * stride, first);
            }
        }
    }

    fn is_observed(&self, (block, voxel): VoxelAt) -> bool {
        !self.masks.get(&block).is_some_and(|mask| mask.contains(voxel as usize))
    }

    /// Drops those of the changed blocks that have no observed voxel in the band any more.
    pub(crate) fn drop_unobserved(&mut self, changed: &BTreeSet<VoxelAt>, grid: &Grid) {
        let size = grid.edge.block_voxels();
        let limit = grid.truncation.codes();
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
                let number = self.coords.len() as u32;
                if let Some(mask) = old.masks.get(&(block as u32)) {
                    self.masks.insert(number, mask.clone());
                }
                if old.of_sheets.contains(&(block as u32)) {
                    self.of_sheets.insert(number);
                }
                self.coords.push(*coord);
                self.samples.extend_from_slice(&old.samples[block * size..][..size]);
            }
        }
    }
}
