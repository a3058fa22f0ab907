//! Extension of a decoded frame into the blocks around the coded ones (profile `main`).
//!
//! The coded blocks hold the surface and little more. Motion compensation and whoever resamples the field need some of what
//! lies around it: every block of the 26-neighbourhood that was not coded is extrapolated. Such a block has one sign, for what
//! was not coded holds no surface. Where two of them meet with different signs, neither side is observed.

mod dilation;

use isv_kernels::extrapolation::{Block, CodedNeighbours, extrapolate};
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, Neighbourhood, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

pub use dilation::extended_count;

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
    /// The blocks around each block of the volume.
    pub around: Vec<Neighbourhood>,
}

/// Which blocks a frame has once it is extended: all that can be said before its samples are known.
#[derive(Clone, Debug)]
pub struct ExtensionPlan {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    around: Vec<Neighbourhood>,
    /// For each block, its index among the coded ones.
    sources: Vec<Option<u32>>,
}

impl ExtensionPlan {
    /// Plans the extension of coded blocks to their 26-neighbourhood, within the range of coordinates. [`extended_count`] tells
    /// the number of blocks beforehand: up to 27 times as many.
    #[must_use]
    pub fn new(coded: &[BlockCoord]) -> Self {
        let coords = dilation::dilate(coded);
        let index = BlockIndex::new(&coords);
        let sources = coded_blocks(coded, &coords);
        let around = coords.par_iter().map(|coord| index.neighbourhood(*coord)).collect();
        Self { coords, index, around, sources }
    }

    /// Extends the volume of the planned blocks. They keep their samples and masks.
    ///
    /// # Panics
    /// If the block edge is not 8, or the blocks are not those that were planned.
    #[must_use]
    pub fn extend(self, coded: &SparseVolume) -> Extended {
        assert_eq!(coded.grid().edge, BlockEdge::E8, "the extension is defined for blocks of 8 voxels");
        let Self { coords, index, around, sources } = self;
        let (samples, sides) = fill(coded, &around, &sources);
        let volume = SparseVolume::from_parts(*coded.grid(), coords, samples, masks(coded, &sides));
        Extended { volume, coded: sources.iter().map(Option::is_some).collect(), index, around }
    }
}

/// The samples of all blocks, and what masks need to know of them.
fn fill(coded: &SparseVolume, around: &[Neighbourhood], sources: &[Option<u32>]) -> (Vec<i16>, Vec<Side>) {
    let fill = |((around, source), out): ((&Neighbourhood, &Option<u32>), &mut [i16])| {
        let out: &mut Block = out.try_into().expect("blocks of an edge of 8");
        match source {
            Some(block) => {
                out.copy_from_slice(coded.block(*block as usize));
                Side::Coded
            }
            None => {
                let neighbours = coded_neighbours(coded, sources, around);
                let inside = extrapolate(&neighbours, coded.grid().truncation.codes(), out);
                Side::Extrapolated { inside, faces: FACES.map(|(slot, _)| around[slot]) }
            }
        }
    };
    let mut samples = vec![0; sources.len() * BLOCK_VOXELS];
    let blocks = around.par_iter().zip(sources).zip(samples.par_chunks_exact_mut(BLOCK_VOXELS));
    let sides = blocks.map(fill).collect();
    (samples, sides)
}

/// What the masks need to know of a block.
enum Side {
    /// It was coded.
    Coded,
    /// It was not: whether it lies inside, and its face neighbours in the order of [`FACES`].
    Extrapolated { inside: bool, faces: [Option<u32>; 6] },
}

/// The faces of a block: slot of the neighbour, then axis and layer of the voxels that touch it.
const FACES: [(usize, (usize, usize)); 6] =
    [(12, (0, 0)), (14, (0, 7)), (10, (1, 0)), (16, (1, 7)), (4, (2, 0)), (22, (2, 7))];

/// For each block of the extended volume, its index among the coded ones.
fn coded_blocks(coded: &[BlockCoord], coords: &[BlockCoord]) -> Vec<Option<u32>> {
    let mut next = 0;
    let find = |coord: &BlockCoord| {
        let found = coded.get(next as usize) == Some(coord);
        next += u32::from(found);
        found.then(|| next - 1)
    };
    coords.iter().map(find).collect()
}

fn coded_block(coded: &SparseVolume, block: u32) -> &Block {
    coded.block(block as usize).try_into().expect("blocks of an edge of 8")
}

fn coded_neighbours<'a>(
    coded: &'a SparseVolume,
    sources: &[Option<u32>],
    around: &Neighbourhood,
) -> CodedNeighbours<'a> {
    around.map(|block| Some(coded_block(coded, sources[block? as usize]?)))
}

/// Masks of the coded blocks, and both sides of the faces on which extrapolated blocks of different signs meet.
fn masks(coded: &SparseVolume, sides: &[Side]) -> BTreeMap<u32, VoxelMask> {
    let mut masks = BTreeMap::new();
    let mut kept = coded.unobserved_masks().iter().peekable();
    let mut source = 0;
    for (block, side) in sides.iter().enumerate() {
        let mask = match side {
            Side::Coded => {
                source += 1;
                kept.next_if(|(masked, _)| **masked == source - 1).map(|(_, mask)| mask.clone())
            }
            Side::Extrapolated { inside, faces } => conflicts(*inside, faces, sides),
        };
        masks.extend(mask.map(|mask| (block as u32, mask)));
    }
    masks
}

/// The voxels of an extrapolated block that touch an extrapolated block of the other sign, if there are any.
fn conflicts(inside: bool, faces: &[Option<u32>; 6], sides: &[Side]) -> Option<VoxelMask> {
    let opposed = |neighbour: &Option<u32>| {
        neighbour.is_some_and(|block| {
            matches!(sides[block as usize], Side::Extrapolated { inside: other, .. } if other != inside)
        })
    };
    if !faces.iter().any(opposed) {
        return None;
    }
    let mut mask = VoxelMask::empty(BlockEdge::E8);
    for (_, (_, (axis, layer))) in faces.iter().zip(FACES).filter(|(neighbour, _)| opposed(neighbour)) {
        let touching = |voxel: &usize| voxel >> (3 * axis) & 7 == layer;
        (0..BLOCK_VOXELS).filter(touching).for_each(|voxel| mask.insert(voxel));
    }
    Some(mask)
}

#[cfg(test)]
mod tests;
