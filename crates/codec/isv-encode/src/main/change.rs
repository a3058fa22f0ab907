//! What of a frame has changed since the one before.

use isv_decode::main::MainReference;
use isv_volume::{BlockCoord, BlockSet, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::cmp::Ordering;

/// Blocks that a thread compares at a time.
const BLOCKS_AT_ONCE: usize = 4096;

/// Blocks of a reference in cells of 4x4x4 blocks that may stay as they are (skip cells). Nothing of the source changed in such a
/// cell or beside it since the frame before, which the reference is of.
pub(crate) fn skippable_blocks(
    before: &SparseVolume,
    source: &SparseVolume,
    reference: &MainReference,
) -> BlockSet {
    let changed = changed_blocks(before, source).dilated();
    reference.decoded().sets().all.outside_cells_of(&changed)
}

/// The blocks that only one of two volumes has, or that differ in samples or masks.
fn changed_blocks(before: &SparseVolume, after: &SparseVolume) -> BlockSet {
    let starts: Vec<usize> = (0..after.block_count()).step_by(BLOCKS_AT_ONCE).collect();
    let at = |start: Option<&usize>| start.map(|start| after.coords()[*start].morton());
    let mut changed: Vec<BlockCoord> = (0..starts.len())
        .into_par_iter()
        .flat_map_iter(|part| {
            // The blocks of both from the first one of this part up to the first one of the next; the first part begins and the
            // last one ends with all that there is.
            let (from, to) = (at(starts.get(part).filter(|_| part > 0)), at(starts.get(part + 1)));
            let range = |volume: &SparseVolume| {
                let place = |code| volume.coords().partition_point(|coord| coord.morton() < code);
                from.map_or(0, place)..to.map_or(volume.block_count(), place)
            };
            changed_in((before, range(before)), (after, range(after)))
        })
        .collect();
    if after.block_count() == 0 {
        changed.extend(before.coords());
    }
    BlockSet::from_coords(&changed)
}

type Part<'a> = (&'a SparseVolume, std::ops::Range<usize>);

/// [`changed_blocks`] of parts of volumes, in order.
fn changed_in((before, range): Part, (after, own_range): Part) -> Vec<BlockCoord> {
    let (mut blocks, mut own_blocks) = (range.peekable(), own_range.peekable());
    let mut masks = MaskWalk::new(before, blocks.peek().copied());
    let mut own_masks = MaskWalk::new(after, own_blocks.peek().copied());
    let mut changed = Vec::new();
    loop {
        let coord = |volume: &SparseVolume, block: Option<&usize>| block.map(|block| volume.coords()[*block]);
        let (theirs, ours) = (coord(before, blocks.peek()), coord(after, own_blocks.peek()));
        let order = match (theirs, ours) {
            (Some(theirs), Some(ours)) if theirs == ours => Ordering::Equal,
            (Some(theirs), Some(ours)) => theirs.morton().cmp(&ours.morton()),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (None, None) => return changed,
        };
        let block = if order.is_le() { blocks.next() } else { None };
        let own = if order.is_ge() { own_blocks.next() } else { None };
        let same = match (block, own) {
            (Some(block), Some(own)) => {
                let shared = before.shares_block(block, after, own);
                (shared || before.block(block) == after.block(own)) && masks.of(block) == own_masks.of(own)
            }
            _ => false,
        };
        if !same {
            changed.extend(if order.is_le() { theirs } else { ours });
        }
    }
}

/// The masks of a volume's blocks, asked for in order.
struct MaskWalk<'a, I: Iterator<Item = (&'a u32, &'a VoxelMask)>> {
    masks: std::iter::Peekable<I>,
}

impl<'a> MaskWalk<'a, std::collections::btree_map::Range<'a, u32, VoxelMask>> {
    /// From a block on.
    fn new(volume: &'a SparseVolume, first: Option<usize>) -> Self {
        let first = first.map_or(u32::MAX, |first| first as u32);
        Self { masks: volume.unobserved_masks().range(first..).peekable() }
    }

    fn of(&mut self, block: usize) -> Option<&'a VoxelMask> {
        while self.masks.next_if(|(masked, _)| (**masked as usize) < block).is_some() {}
        self.masks.next_if(|(masked, _)| **masked as usize == block).map(|(_, mask)| mask)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::{BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};

    /// Blocks of a row along x, each filled with its number, but for those that are left out, differ or are masked.
    fn row(without: &[i32], different: &[i32], masked: &[i32]) -> SparseVolume {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        let mut builder = VolumeBuilder::new(grid);
        for x in (0..2 * BLOCKS_AT_ONCE as i32).filter(|x| !without.contains(x)) {
            let mut samples = vec![(x % 1000) as i16; 512];
            samples[77] += i16::from(different.contains(&x));
            builder.push(
                [x, 0, 0].into(),
                samples,
                masked.contains(&x).then(|| VoxelMask::full(BlockEdge::E8)),
            );
        }
        builder.finish()
    }

    fn changed(before: &SparseVolume, after: &SparseVolume) -> Vec<i32> {
        changed_blocks(before, after).coords().iter().map(|coord| coord.x).collect()
    }

    #[test]
    fn blocks_that_come_go_or_differ_have_changed() {
        let before = row(&[5, 4096], &[], &[7, 8, 8000]);
        assert!(changed(&before, &before.clone()).is_empty(), "shared");
        assert!(changed(&before, &row(&[5, 4096], &[], &[7, 8, 8000])).is_empty(), "equal");
        let after = row(&[0, 4095, 8191], &[9, 5000], &[8, 11, 8000]);
        assert_eq!(changed(&before, &after), [0, 5, 7, 9, 11, 4095, 4096, 5000, 8191]);
        let nothing = SparseVolume::empty(*before.grid());
        assert_eq!(changed(&before, &nothing).len(), before.block_count());
        assert_eq!(changed(&nothing, &before).len(), before.block_count());
    }
}
