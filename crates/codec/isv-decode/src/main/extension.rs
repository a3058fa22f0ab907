//! Extension of a decoded frame into the blocks around the coded ones (profile `main`).
//!
//! The coded blocks hold the surface and little more. Motion compensation and whoever resamples the field need some of what
//! lies around it: every block of the 26-neighbourhood that was not coded is extrapolated. Such a block has one sign, for what
//! was not coded holds no surface. Where two of them meet with different signs, neither side is observed.

mod frame_blocks;

use crate::ReferenceBlocks;
use isv_kernels::block8::{Block, SAMPLES};
use isv_kernels::extrapolation::{CodedNeighbours, extrapolate};
use isv_volume::{
    BlockCoord, BlockEdge, BlockIndex, BlockOrigin, Grid, NeighbourFinder, SparseVolume, VoxelMask,
};
use rayon::prelude::*;
use std::collections::BTreeMap;

pub use frame_blocks::{FrameBlocks, Kept};

/// A decoded frame with the blocks around its coded ones: its volume, their look-up, and what they are.
#[derive(Clone, Debug)]
pub struct DecodedBlocks {
    volume: SparseVolume,
    index: BlockIndex,
    sets: FrameBlocks,
}

impl DecodedBlocks {
    /// The blocks of a volume that these sets describe.
    #[must_use]
    pub fn new(volume: SparseVolume, sets: FrameBlocks) -> Self {
        Self { index: volume.index(), volume, sets }
    }

    /// Extends a volume of coded blocks, whose samples are copied: a frame by itself, for measurements and tests.
    ///
    /// # Panics
    /// If the block edge is not 8.
    #[must_use]
    pub fn from_coded(coded: &SparseVolume) -> Self {
        let plan = ExtensionPlan::new(FrameBlocks::new(coded.coords(), None), coded.coords(), None);
        // What is in the buffer before is overwritten.
        let mut samples = plan.samples(Vec::new());
        for (block, place) in plan.places().iter().enumerate() {
            samples[*place as usize * SAMPLES..][..SAMPLES].copy_from_slice(coded.block(block));
        }
        let masks = coded.unobserved_masks().iter();
        let masks = masks.map(|(block, mask)| (plan.places()[*block as usize], mask.clone())).collect();
        let mut extended = plan.extend(*coded.grid(), samples, None);
        extended.add_unobserved(masks);
        extended
    }

    /// The volume: coded and extrapolated blocks.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        &self.volume
    }

    /// The volume alone.
    #[must_use]
    pub fn into_volume(self) -> SparseVolume {
        self.volume
    }

    /// Look-up of the volume's blocks.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// What the blocks are.
    #[must_use]
    pub fn sets(&self) -> &FrameBlocks {
        &self.sets
    }

    /// The blocks without their samples.
    #[must_use]
    pub fn blocks(&self) -> ReferenceBlocks<'_> {
        ReferenceBlocks {
            coords: self.volume.coords(),
            index: &self.index,
            unobserved: self.volume.unobserved_masks(),
        }
    }

    /// Adds unobserved voxels, by block index.
    pub fn add_unobserved(&mut self, masks: BTreeMap<u32, VoxelMask>) {
        self.volume.add_unobserved(masks);
    }
}

/// Plan of where the blocks of a frame are once it is extended. It is all that can be said before the frame's samples are known,
/// and without those of the frame before.
#[derive(Clone, Debug)]
pub struct ExtensionPlan {
    blocks: FrameBlocks,
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    origins: Vec<BlockOrigin>,
    coded: Vec<bool>,
    places: Vec<u32>,
}

impl ExtensionPlan {
    /// Plans the extension of a frame. `coded`, `kept`: those that its blocks were found for.
    #[must_use]
    pub fn new(blocks: FrameBlocks, coded: &[BlockCoord], kept: Option<Kept>) -> Self {
        let (coords, index) = (blocks.all.coords(), BlockIndex::from_set(&blocks.all));
        let mut next = coded.iter().peekable();
        let is_coded = |(place, coord): (u32, BlockCoord)| next.next_if_eq(&&coord).map(|_| place);
        let fresh = (0..).zip(blocks.fresh.cells().iter().flat_map(|cell| cell.coords()));
        let places = fresh.filter_map(is_coded).collect();
        let (origins, coded) = (origins(&blocks, kept), blocks.coded.marks_in(&blocks.all));
        Self { blocks, coords, index, origins, coded, places }
    }

    /// The sets of the frame's blocks.
    #[must_use]
    pub fn blocks(&self) -> &FrameBlocks {
        &self.blocks
    }

    /// All blocks in Morton order: those of [`FrameBlocks::all`]. A block's index is its place here.
    #[must_use]
    pub fn coords(&self) -> &[BlockCoord] {
        &self.coords
    }

    /// Look-up of [`Self::coords`].
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// Origin of each block's samples. [`BlockOrigin::Fresh`] has its number among those of the frame itself, which are
    /// [`FrameBlocks::fresh`] in Morton order. [`BlockOrigin::Kept`] has its index in the frame before.
    #[must_use]
    pub fn origins(&self) -> &[BlockOrigin] {
        &self.origins
    }

    /// For each block, whether it was coded, in this frame or an earlier one that it is kept of. The others are extrapolated from
    /// those around them that were; they all have one sign.
    #[must_use]
    pub fn coded(&self) -> &[bool] {
        &self.coded
    }

    /// Whether any block's samples, or its masks, are those of the frame before.
    #[must_use]
    pub fn keeps(&self) -> bool {
        // Whatever has samples of its own is unsettled, so without kept samples there are no kept masks.
        self.blocks.fresh != self.blocks.all
    }

    /// The frame's blocks, their coordinates and the look-up of these, when all is done.
    #[must_use]
    pub fn into_blocks(self) -> (FrameBlocks, Vec<BlockCoord>, BlockIndex) {
        (self.blocks, self.coords, self.index)
    }

    /// For each block coded in this frame, its index among the blocks whose samples are of this frame.
    #[must_use]
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// A buffer for the samples of the blocks whose samples are of this frame, whatever they are now. `spare`: memory that was in
    /// use and can be again.
    #[must_use]
    pub fn samples(&self, mut spare: Vec<i16>) -> Vec<i16> {
        let wanted = self.blocks.fresh.count() * SAMPLES;
        if spare.capacity() < wanted || spare.capacity() / 2 > wanted {
            drop(spare);
            // A little more, so that it serves the next frames too; the system gives no memory before it is written to.
            spare = vec![0; wanted + wanted / 8];
        }
        spare.resize(wanted, 0);
        spare
    }

    /// Extends coded blocks to all that are planned. `samples`: as [`Self::samples`] has them, those of the coded blocks at their
    /// [`Self::places`]. `before`: the frame before, if anything is kept of it.
    ///
    /// # Panics
    /// If the block edge is not 8, there are not as many samples as planned, or `before` is not the frame that was planned with.
    #[must_use]
    pub fn extend(self, grid: Grid, mut samples: Vec<i16>, before: Option<&DecodedBlocks>) -> DecodedBlocks {
        assert_eq!(grid.edge, BlockEdge::E8, "the extension is defined for blocks of 8 voxels");
        let nothing = SparseVolume::empty(grid);
        let before = before.filter(|_| self.keeps());
        let kept = before.map_or(&nothing, DecodedBlocks::volume);
        let sides = self.fill(grid.truncation.codes(), &mut samples, kept);
        let side = |block: u32| match self.origins[block as usize] {
            BlockOrigin::Fresh(block) => sides[block as usize],
            BlockOrigin::Kept(_) if self.coded[block as usize] => Side::Coded,
            BlockOrigin::Kept(before) if kept_samples(kept, before)[0] < 0 => Side::Inside,
            BlockOrigin::Kept(_) => Side::Outside,
        };
        let masks = self.masks(side, before.map(DecodedBlocks::blocks));
        let Self { blocks: sets, coords, index, origins, .. } = self;
        let volume = kept.succeed(coords, &origins, samples, masks);
        DecodedBlocks { volume, index, sets }
    }

    /// Extrapolates the fresh blocks that were not coded. On which side each fresh block lies. `kept`: what the other blocks are of.
    fn fill(&self, limit: i16, samples: &mut [i16], kept: &SparseVolume) -> Vec<Side> {
        let fresh = samples.len() / SAMPLES;
        let mut sides = vec![Side::Coded; fresh];
        let mut coded: Vec<Option<&Block>> = vec![None; fresh];
        let mut others = Vec::with_capacity(fresh - self.places.len());
        let mut places = self.places.iter().map(|place| *place as usize).peekable();
        let coords = self.blocks.fresh.cells().iter().flat_map(|cell| cell.coords());
        let blocks = samples.as_chunks_mut::<SAMPLES>().0.iter_mut().zip(&mut sides).zip(coords);
        for (block, ((samples, side), coord)) in blocks.enumerate() {
            match places.next_if_eq(&block) {
                Some(_) => coded[block] = Some(samples),
                None => others.push((coord, samples, side)),
            }
        }
        let coded = |block: u32| match self.origins[block as usize] {
            BlockOrigin::Fresh(block) => coded[block as usize],
            BlockOrigin::Kept(before) => self.coded[block as usize].then(|| kept_samples(kept, before)),
        };
        others.par_iter_mut().for_each_init(
            || NeighbourFinder::new(&self.index),
            |finder, (coord, samples, side)| {
                finder.turn_to(*coord);
                let neighbours: CodedNeighbours = finder.neighbourhood().map(|block| coded(block?));
                let inside = extrapolate(&neighbours, limit, samples);
                **side = if inside { Side::Inside } else { Side::Outside };
            },
        );
        sides
    }

    /// The masks of the frame, by index of its blocks, but for those that its bytes hold. They cover both sides of the faces on
    /// which extrapolated blocks of different signs meet. The masks of settled blocks are those of the frame before.
    ///
    /// `side`: of a block, by its index; asked only for unsettled blocks and those around them. `before`: the frame
    /// before, if anything is kept of it.
    #[must_use]
    pub fn masks(
        &self,
        side: impl Fn(u32) -> Side,
        before: Option<ReferenceBlocks>,
    ) -> BTreeMap<u32, VoxelMask> {
        let FrameBlocks { all, unsettled, .. } = &self.blocks;
        // Of what lies further from all that is unsettled, nothing is asked.
        let near = unsettled.dilated().marks_in(all);
        let sides: Vec<Side> =
            (0..).zip(near).map(|(block, near)| if near { side(block) } else { Side::Coded }).collect();
        let [inside, outside] =
            [Side::Inside, Side::Outside].map(|wanted| all.filtered(|block| sides[block] == wanted));
        // Few blocks are anywhere near the other side.
        let opposed = inside.intersection(&outside.dilated()).union(&outside.intersection(&inside.dilated()));
        let unsettled = unsettled.marks_in(all);
        let conflicts = |finder: &mut NeighbourFinder, block: usize| {
            let opposite = sides[block].opposite()?;
            finder.turn_to(self.coords[block]);
            let is_opposed = |slot| finder.get(slot).is_some_and(|other| sides[other as usize] == opposite);
            conflicts(FACES.map(|(slot, _)| is_opposed(slot))).map(|mask| (block as u32, mask))
        };
        let mut finder = NeighbourFinder::new(&self.index);
        let blocks = (0..)
            .zip(opposed.marks_in(all))
            .filter_map(|(block, is_opposed)| (is_opposed && unsettled[block]).then_some(block));
        let mut masks: Vec<_> = blocks.filter_map(|block| conflicts(&mut finder, block)).collect();
        if let Some(before) = before.filter(|_| self.keeps()) {
            masks.extend(self.settled_masks(before));
        }
        masks.into_iter().collect()
    }

    /// The masks of the frame before in blocks where nothing has changed, by index of this frame's blocks.
    #[must_use]
    pub fn settled_masks(&self, before: ReferenceBlocks) -> Vec<(u32, VoxelMask)> {
        let unsettled = self.blocks.unsettled.marks_in(&self.blocks.all);
        let settled = before.unobserved.iter().filter_map(|(block, mask)| {
            let block = self.index.get(before.coords[*block as usize])?;
            let block = (!unsettled[block as usize]).then_some(block)?;
            Some((block, mask.clone()))
        });
        settled.collect()
    }
}

/// The samples of a block of the frame before.
fn kept_samples(kept: &SparseVolume, block: u32) -> &Block {
    kept.block(block as usize).try_into().expect("blocks of an edge of 8")
}

/// Origin of each block's samples.
fn origins(blocks: &FrameBlocks, kept: Option<Kept>) -> Vec<BlockOrigin> {
    let mut fresh = 0..;
    let before = kept.map(|Kept { before, .. }| {
        // Blocks of the frame before that are in this one and not made anew.
        blocks.all.difference(&blocks.fresh).marks_in(&before.all)
    });
    let mut before = (0..).zip(before.unwrap_or_default()).filter(|(_, is_kept)| *is_kept);
    let is_fresh = blocks.fresh.marks_in(&blocks.all);
    let origin = |is_fresh| match is_fresh {
        true => BlockOrigin::Fresh(fresh.next().expect("no end")),
        false => BlockOrigin::Kept(before.next().expect("what is not fresh was there before").0),
    };
    is_fresh.into_iter().map(origin).collect()
}

/// What [`ExtensionPlan::masks`] need to know of a block: whether it was coded, and else, on which side of the surface it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// It was coded, in this frame or an earlier one.
    Coded,
    /// It was extrapolated, and its samples are negative.
    Inside,
    /// It was extrapolated, and its samples are positive.
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
        (0..SAMPLES).filter(touching).for_each(|voxel| mask.insert(voxel));
    }
    Some(mask)
}

#[cfg(test)]
mod tests;
