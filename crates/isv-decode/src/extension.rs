//! Extension of a decoded frame into the blocks around the coded ones (profile `main`).
//!
//! The coded blocks hold the surface and little more. Motion compensation and whoever resamples the field need some of what
//! lies around it: every block of the 26-neighbourhood that was not coded is extrapolated. Such a block has one sign, for what
//! was not coded holds no surface. Where two of them meet with different signs, neither side is observed.

mod dilation;

use isv_kernels::extrapolation::{Block, CodedNeighbours, extrapolate};
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, Grid, NeighbourFinder, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

pub use dilation::Dilation;

/// Samples of a block: the extension is defined for an edge of 8.
const BLOCK_VOXELS: usize = 512;

/// A decoded frame with the blocks around its coded ones.
#[derive(Clone, Debug)]
pub struct Extended {
    /// Coded and extrapolated blocks.
    pub volume: SparseVolume,
    /// Whether each block of the volume was coded.
    pub coded: Vec<bool>,
    /// Look-up of the volume's blocks.
    pub index: BlockIndex,
}

impl Extended {
    /// Extends a volume of coded blocks, whose samples are copied: a frame by itself, for measurements and tests.
    ///
    /// # Panics
    /// If the block edge is not 8.
    #[must_use]
    pub fn of(coded: &SparseVolume) -> Self {
        let plan = ExtensionPlan::new(coded.coords(), &Dilation::of(coded.coords()));
        // What is in the room before is overwritten.
        let mut samples = plan.room(Vec::new());
        for (block, place) in plan.places().iter().enumerate() {
            samples[*place as usize * BLOCK_VOXELS..][..BLOCK_VOXELS].copy_from_slice(coded.block(block));
        }
        let masks = coded.unobserved_masks().iter();
        let masks = masks.map(|(block, mask)| (plan.places()[*block as usize], mask.clone())).collect();
        let extended = plan.extend(*coded.grid(), samples);
        Self { volume: extended.volume.with_unobserved(masks), ..extended }
    }
}

/// Which blocks a frame has once it is extended: all that can be said before its samples are known.
#[derive(Clone, Debug)]
pub struct ExtensionPlan {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    places: Vec<u32>,
}

impl ExtensionPlan {
    /// Plans the extension of coded blocks, in Morton order, to their dilation: up to 27 times as many.
    #[must_use]
    pub fn new(coded: &[BlockCoord], dilation: &Dilation) -> Self {
        let coords = dilation.coords();
        let index = BlockIndex::new(&coords);
        let mut next = coded.iter().peekable();
        let is_coded = |(place, coord): (u32, &BlockCoord)| next.next_if_eq(&coord).map(|_| place);
        let places = (0..).zip(&coords).filter_map(is_coded).collect();
        Self { coords, index, places }
    }

    /// For each coded block, its index among all.
    #[must_use]
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// How many blocks there are.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.coords.len()
    }

    /// Room for the samples of all blocks, whatever they are now. `spare`: memory that was in use and can be again.
    #[must_use]
    pub fn room(&self, mut spare: Vec<i16>) -> Vec<i16> {
        let wanted = self.coords.len() * BLOCK_VOXELS;
        if spare.capacity() < wanted || spare.capacity() / 2 > wanted {
            drop(spare);
            // A little more, so that it serves the next frames too; the system gives no memory before it is written to.
            spare = vec![0; wanted + wanted / 8];
        }
        spare.resize(wanted, 0);
        spare
    }

    /// Extends coded blocks to all that are planned. `samples`: of all blocks, as [`Self::room`] has them, those of the coded
    /// ones at their [`Self::places`].
    ///
    /// # Panics
    /// If the block edge is not 8, or there are not as many samples as planned.
    #[must_use]
    pub fn extend(self, grid: Grid, mut samples: Vec<i16>) -> Extended {
        assert_eq!(grid.edge, BlockEdge::E8, "the extension is defined for blocks of 8 voxels");
        let sides = self.fill(grid.truncation.codes(), &mut samples);
        let masks = self.masks(&sides);
        let coded = sides.iter().map(|side| *side == Side::Coded).collect();
        let volume = SparseVolume::from_parts(grid, self.coords, samples, masks);
        Extended { volume, coded, index: self.index }
    }

    /// Extrapolates the blocks that were not coded.
    fn fill(&self, limit: i16, samples: &mut [i16]) -> Vec<Side> {
        let mut sides = vec![Side::Coded; self.coords.len()];
        let mut coded: Vec<Option<&Block>> = vec![None; self.coords.len()];
        let mut others = Vec::with_capacity(self.coords.len() - self.places.len());
        let mut places = self.places.iter().map(|place| *place as usize).peekable();
        let blocks = samples.as_chunks_mut::<BLOCK_VOXELS>().0.iter_mut().zip(&mut sides).enumerate();
        for (block, (samples, side)) in blocks {
            match places.next_if_eq(&block) {
                Some(_) => coded[block] = Some(samples),
                None => others.push((self.coords[block], samples, side)),
            }
        }
        others.par_iter_mut().for_each_init(
            || NeighbourFinder::new(&self.index),
            |finder, (coord, samples, side)| {
                finder.turn_to(*coord);
                let neighbours: CodedNeighbours = finder.neighbourhood().map(|block| coded[block? as usize]);
                let inside = extrapolate(&neighbours, limit, samples);
                **side = if inside { Side::Inside } else { Side::Outside };
            },
        );
        sides
    }

    /// Both sides of the faces on which extrapolated blocks of different signs meet.
    fn masks(&self, sides: &[Side]) -> BTreeMap<u32, VoxelMask> {
        let conflicts = |finder: &mut NeighbourFinder, block: usize| {
            let opposite = sides[block].opposite()?;
            finder.turn_to(self.coords[block]);
            let opposed = |slot| finder.get(slot).is_some_and(|other| sides[other as usize] == opposite);
            conflicts(FACES.map(|(slot, _)| opposed(slot))).map(|mask| (block as u32, mask))
        };
        let blocks = (0..sides.len()).into_par_iter();
        let masks = blocks.map_init(|| NeighbourFinder::new(&self.index), conflicts);
        masks.flatten_iter().collect::<Vec<_>>().into_iter().collect()
    }
}

/// What masks need to know of a block: whether it was coded, and else, on which side of the surface it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Coded,
    Inside,
    Outside,
}

impl Side {
    /// The other side of an extrapolated block.
    fn opposite(self) -> Option<Self> {
        match self {
            Self::Coded => None,
            Self::Inside => Some(Self::Outside),
            Self::Outside => Some(Self::Inside),
        }
    }
}

/// The faces of a block: slot of the neighbour, then axis and layer of the voxels that touch it.
const FACES: [(usize, (usize, usize)); 6] =
    [(12, (0, 0)), (14, (0, 7)), (10, (1, 0)), (16, (1, 7)), (4, (2, 0)), (22, (2, 7))];

/// The voxels of a block at those of its [`FACES`] that are opposed, if any are.
fn conflicts(opposed: [bool; 6]) -> Option<VoxelMask> {
    if opposed == [false; 6] {
        return None;
    }
    let mut mask = VoxelMask::empty(BlockEdge::E8);
    for (_, (_, (axis, layer))) in opposed.iter().zip(FACES).filter(|(opposed, _)| **opposed) {
        let touching = |voxel: &usize| voxel >> (3 * axis) & 7 == layer;
        (0..BLOCK_VOXELS).filter(touching).for_each(|voxel| mask.insert(voxel));
    }
    Some(mask)
}

#[cfg(test)]
mod tests;
