//! Signs that neighbours agree on.
//!
//! Beside sharp creases the closest point can tell the wrong side. Two neighbouring voxels whose distances
//! add up to more than a surface between them could explain are on one side of it. If their signs differ all
//! the same, the regions that hang together with either in this way are followed side by side. The smaller
//! one, which ends first, was wrong, unless it is one side of a small patch, which has more surface than
//! errors have. Where neither was wrong, there is surface with two sides and an end that nobody saw: both
//! voxels are unobserved.

use crate::caps::Blocks;
use crate::points::bricks::step;
use isv_volume::{BlockEdge, BlockIndex, CODES_PER_VOXEL, VoxelMask};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

/// Neighbours whose distances add up to more codes than this have no surface between them.
const APART: u32 = CODES_PER_VOXEL as u32 * 3 / 2;

/// A region of this many voxels is not wrong.
const LARGE: usize = 8192;

/// Surface, in edges between voxels near it, from which on a region is one side of a patch and not an error. Most errors are islands
/// without any.
const PATCH: usize = 16;

/// A voxel: its block, and its index there.
type VoxelAt = (u32, u16);

/// The samples of all blocks with their neighbours.
struct Sides<'a> {
    blocks: &'a mut Blocks,
    index: BlockIndex,
    edge: BlockEdge,
    /// Voxels of regions that are right: large ones, and sides of patches.
    right: FxHashSet<VoxelAt>,
}

/// Voxels on one side, as far as they have been followed.
struct Region {
    voxels: Vec<VoxelAt>,
    found: FxHashSet<VoxelAt>,
    followed: usize,
}

impl Blocks {
    /// Settles signs that contradict each other.
    pub(crate) fn settle_sides(&mut self, edge: BlockEdge) {
        let index = BlockIndex::new(&self.coords);
        let mut sides = Sides { blocks: self, index, edge, right: FxHashSet::default() };
        let conflicts: Vec<[VoxelAt; 2]> = (0..sides.blocks.coords.len() as u32)
            .into_par_iter()
            .flat_map_iter(|block| sides.conflicts(block))
            .collect();
        for pair in conflicts {
            sides.settle(pair);
        }
    }
}

impl Sides<'_> {
    /// The pairs of a voxel of a block and its upper neighbour that contradict each other.
    fn conflicts(&self, block: u32) -> Vec<[VoxelAt; 2]> {
        let mut found = Vec::new();
        for side in [1, 3, 5] {
            let (_, up) = step(self.edge, self.edge.block_voxels() - 1, side);
            let above = up.and_then(|up| self.index.get(self.blocks.coords[block as usize].offset(up)));
            for voxel in 0..self.edge.block_voxels() {
                let (to, leaves) = step(self.edge, voxel, side);
                let Some(next) = (if leaves.is_some() { above } else { Some(block) }) else { continue };
                let pair = [(block, voxel as u16), (next, to as u16)];
                if self.is_conflict(pair) {
                    found.push(pair);
                }
            }
        }
        found
    }

    fn sample(&self, (block, voxel): VoxelAt) -> i16 {
        self.blocks.samples[block as usize * self.edge.block_voxels() + usize::from(voxel)]
    }

    fn is_observed(&self, (block, voxel): VoxelAt) -> bool {
        !self.blocks.masks.get(&block).is_some_and(|mask| mask.contains(usize::from(voxel)))
    }

    fn is_conflict(&self, [a, b]: [VoxelAt; 2]) -> bool {
        conflict(self.sample(a), self.sample(b)) && self.is_observed(a) && self.is_observed(b)
    }

    fn neighbour(&self, (block, voxel): VoxelAt, side: usize) -> Option<VoxelAt> {
        let (to, leaves) = step(self.edge, usize::from(voxel), side);
        let block = match leaves {
            None => block,
            Some(by) => self.index.get(self.blocks.coords[block as usize].offset(by))?,
        };
        Some((block, to as u16))
    }

    /// Finds out which of two voxels is on the wrong side.
    fn settle(&mut self, pair: [VoxelAt; 2]) {
        if !self.is_conflict(pair) {
            return;
        }
        let mut regions =
            pair.map(|at| Region { voxels: vec![at], found: FxHashSet::from_iter([at]), followed: 0 });
        while regions.iter().any(|region| !self.is_right(region)) {
            for region in &mut regions {
                if self.is_right(region) {
                    continue;
                }
                if region.followed < region.voxels.len() {
                    self.follow(region);
                } else if self.is_side_of_patch(region) {
                    self.right.extend(&region.voxels);
                } else {
                    self.reverse(&region.voxels);
                    return;
                }
            }
        }
        for region in regions {
            self.right.extend(region.voxels);
        }
        for (block, voxel) in pair {
            let mask = self.blocks.masks.entry(block).or_insert_with(|| VoxelMask::empty(self.edge));
            mask.insert(usize::from(voxel));
        }
    }

    /// Whether a region is known to be right.
    fn is_right(&self, region: &Region) -> bool {
        region.voxels.len() >= LARGE || region.voxels.last().is_some_and(|at| self.right.contains(at))
    }

    /// Whether a region that has been followed lies along at least [`PATCH`] of surface, which it would lose or double if it were
    /// reversed.
    fn is_side_of_patch(&self, region: &Region) -> bool {
        let along_surface = |at: &VoxelAt| {
            let next = (0..6).filter_map(|side| self.neighbour(*at, side));
            next.filter(|next| sum(self.sample(*at), self.sample(*next)) <= APART && self.is_observed(*next))
                .count()
        };
        region.voxels.iter().map(along_surface).sum::<usize>() >= PATCH
    }

    /// Adds the neighbours of the next voxel of a region that are on its side.
    fn follow(&self, region: &mut Region) {
        let at = region.voxels[region.followed];
        region.followed += 1;
        let s = self.sample(at);
        for next in (0..6).filter_map(|side| self.neighbour(at, side)) {
            let t = self.sample(next);
            let same = (s < 0) == (t < 0) && sum(s, t) > APART && self.is_observed(next);
            if same && region.found.insert(next) {
                region.voxels.push(next);
                if self.right.contains(&next) {
                    return;
                }
            }
        }
    }

    fn reverse(&mut self, voxels: &[VoxelAt]) {
        let size = self.edge.block_voxels();
        for (block, voxel) in voxels {
            let sample = &mut self.blocks.samples[*block as usize * size + usize::from(*voxel)];
            *sample = -*sample;
        }
    }
}

/// Whether two neighbouring samples are on different sides of a surface that cannot be there.
fn conflict(s: i16, t: i16) -> bool {
    (s < 0) != (t < 0) && sum(s, t) > APART
}

fn sum(s: i16, t: i16) -> u32 {
    u32::from(s.unsigned_abs()) + u32::from(t.unsigned_abs())
}
