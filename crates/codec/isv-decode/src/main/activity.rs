//! Expectation of where the surface is: the frame before, moved on as it was moving.

use super::displaced_block::{BlockSigns, DisplacedBlock};
use super::{MainBlocks, MainReference, Vector};
use isv_kernels::block8::{self, Block};
use isv_kernels::warp::STEPS_PER_VOXEL;
use isv_volume::{BlockSet, NeighbourFinder, SparseVolume};
use rayon::prelude::*;
use std::borrow::Cow;

/// Voxels along the edge of a block.
const EDGE: i32 = block8::EDGE as i32;

/// How much surface is expected in a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Activity {
    /// Edges between voxels of different sign.
    crossings: u16,
    /// Smallest distance from the surface in codes, at most [`Self::FAR`]; 0 where the surface crosses edges.
    nearest: u16,
}

impl Activity {
    /// Classes of [`Self::class`].
    pub const CLASSES: usize = 9;
    /// Classes of [`Self::fine_class`].
    pub const FINE_CLASSES: usize = 37;
    /// Distances from here on are one, in codes.
    pub const FAR: u16 = 960;

    /// Activity of a block of the frame moved on.
    ///
    /// - `crossings`: edges between voxels of different sign, of those that start in the block and end at a voxel that is there.
    /// - `nearest`: 0 if there are crossings, otherwise the smallest distance from the surface in codes, at most [`Self::FAR`].
    ///   [`Self::FAR`] also stands for a block of which no voxel is there.
    ///
    /// # Panics
    /// In debug builds, if these do not go together.
    #[must_use]
    pub fn new(crossings: u16, nearest: u16) -> Self {
        debug_assert!(nearest <= Self::FAR && (crossings == 0 || nearest == 0));
        Self { crossings, nearest }
    }

    /// Activity of a block that stays as it is: surface is expected if it was coded.
    #[must_use]
    pub fn of_still(coded: bool) -> Self {
        Self { crossings: u16::from(coded), nearest: 0 }
    }

    /// Whether surface is expected at all.
    #[must_use]
    pub fn is_expected(self) -> bool {
        self.crossings > 0
    }

    /// 0 to 3 by the distance, 4 to 8 by the crossings.
    #[must_use]
    pub fn class(self) -> usize {
        match (self.crossings, self.nearest) {
            (0, 513..) => 0,
            (0, 257..) => 1,
            (0, 129..) => 2,
            (0, _) => 3,
            (..5, _) => 4,
            (..12, _) => 5,
            (..30, _) => 6,
            (..70, _) => 7,
            _ => 8,
        }
    }

    /// 0 to 15 by the distance in quarter voxels, 16 to 36 by the crossings in fours.
    #[must_use]
    pub fn fine_class(self) -> usize {
        match self.crossings {
            0 => usize::from(self.nearest / 64).min(15),
            crossings => 16 + usize::from(crossings / 4).min(20),
        }
    }
}

/// The activity of every block of the reference's volume, in its order. Of blocks that stay as they are, surface is expected in
/// those that were coded.
#[must_use]
pub fn expected_activity(reference: &MainReference, skipped: &BlockSet) -> Vec<Activity> {
    let (signs, frame) = (SignTable::new(reference, skipped), reference.blocks());
    let activity = |finder: &mut NeighbourFinder, (block, skipped): (usize, bool)| {
        if skipped {
            return Activity::of_still(frame.coded_at(block).is_some());
        }
        finder.turn_to(frame.blocks.coords[block]);
        let displaced = block_ahead(&signs, block, finder);
        match displaced.crossings() {
            0 => Activity::new(0, displaced.nearest(Activity::FAR).min(Activity::FAR)),
            crossings => Activity::new(crossings as u16, 0),
        }
    };
    let marks = skipped.marks_in(&frame.sets.all).into_par_iter().enumerate();
    marks.map_init(|| reference.finder(), activity).collect()
}

/// The signs of the blocks of a reference that are looked at more than once.
struct SignTable<'a> {
    volume: &'a SparseVolume,
    frame: MainBlocks<'a>,
    /// For each block, one more than its place among the signs; 0 if it is not there.
    places: Vec<u32>,
    signs: Vec<BlockSigns>,
}

impl<'a> SignTable<'a> {
    /// Finds the signs of the blocks that do not stay as they are, and of those around them.
    fn new(reference: &'a MainReference, skipped: &BlockSet) -> Self {
        let (volume, frame) = (reference.volume(), reference.blocks());
        let all = &frame.sets.all;
        let wanted = if skipped.is_empty() { all.clone() } else { all.difference(skipped).dilated() };
        let mut places = vec![0; all.count()];
        let wanted =
            (0..).zip(wanted.marks_in(all)).filter_map(|(block, is_wanted)| is_wanted.then_some(block));
        let wanted: Vec<u32> = wanted.collect();
        for (place, block) in (1..).zip(&wanted) {
            places[*block as usize] = place;
        }
        let signs = wanted.into_par_iter().map(|block| signs_of(volume, &frame, block)).collect();
        Self { volume, frame, places, signs }
    }

    /// The samples and signs of a block.
    fn get(&self, block: u32) -> (&Block, Cow<'_, BlockSigns>) {
        let signs = match self.places[block as usize].checked_sub(1) {
            Some(place) => Cow::Borrowed(&self.signs[place as usize]),
            None => Cow::Owned(signs_of(self.volume, &self.frame, block)),
        };
        (samples(self.volume, block), signs)
    }
}

fn signs_of(volume: &SparseVolume, frame: &MainBlocks, block: u32) -> BlockSigns {
    let samples = samples(volume, block);
    match frame.coded_at(block as usize) {
        Some(_) => BlockSigns::of_coded(samples),
        None => BlockSigns::of_extrapolated(samples),
    }
}

fn samples(volume: &SparseVolume, block: u32) -> &Block {
    volume.block(block as usize).try_into().expect("blocks of an edge of 8")
}

/// The reference where the surface at a block is expected to come from. `finder`: at the block.
fn block_ahead<'a>(signs: &'a SignTable, block: usize, finder: &NeighbourFinder) -> DisplacedBlock<'a> {
    let drift = drift(&signs.frame, block, finder);
    let mut blocks = [const { None }; 8];
    for (place, block) in blocks.iter_mut().zip(finder.octet_at(drift.map(|c| c.div_euclid(EDGE)))) {
        *place = block.map(|block| signs.get(block));
    }
    DisplacedBlock { blocks, within: drift.map(|c| c.rem_euclid(EDGE) as usize) }
}

/// The whole voxels by which the surface at a block is expected to go on moving: its vector, or the mean of those around it.
fn drift(frame: &MainBlocks, block: usize, finder: &NeighbourFinder) -> [i32; 3] {
    let own = frame.coded_at(block).and_then(|coded| coded.vector);
    let (sum, count) = match own {
        Some(vector) => (vector.0.map(i32::from), 1),
        None => sum_around(frame, finder),
    };
    // Rounded half up.
    sum.map(|s| {
        if count == 0 { 0 } else { (2 * s + STEPS_PER_VOXEL * count).div_euclid(2 * STEPS_PER_VOXEL * count) }
    })
}

/// Sum and number of the vectors in a block's neighbourhood.
fn sum_around(frame: &MainBlocks, finder: &NeighbourFinder) -> ([i32; 3], i32) {
    let (mut sum, mut count) = ([0; 3], 0);
    for block in finder.neighbourhood().into_iter().flatten() {
        if let Some(Vector(vector)) = frame.coded_at(block as usize).and_then(|coded| coded.vector) {
            for axis in 0..3 {
                sum[axis] += i32::from(vector[axis]);
            }
            count += 1;
        }
    }
    (sum, count)
}
