//! Unobserved voxels (W = 0 in Eq. 2): a flag a block, and a bit a voxel in the blocks that have some.

use super::{SyntaxError, check_overrun};
use crate::ReferenceBlocks;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, VoxelMask};
use std::collections::BTreeMap;

/// Models of the masks of a frame.
#[derive(Clone, Debug)]
pub struct MaskModels {
    /// Whether a frame has any mask.
    pub any: BitModel,
    /// Whether a block has a mask, by [`MaskContext::block`].
    pub block: [BitModel; 8],
    /// Whether a voxel is unobserved, by [`MaskContext::voxel`].
    pub voxel: [BitModel; 81],
}

impl Default for MaskModels {
    fn default() -> Self {
        Self { any: BitModel::default(), block: [BitModel::default(); 8], voxel: [BitModel::default(); 81] }
    }
}

impl MaskModels {
    /// Reads the masks of a frame's blocks, by block index.
    ///
    /// # Errors
    /// A block whose mask is announced but empty, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        edge: BlockEdge,
        coords: &[BlockCoord],
        reference: Option<ReferenceBlocks>,
    ) -> Result<BTreeMap<u32, VoxelMask>, SyntaxError> {
        let mut masks = BTreeMap::new();
        let mut decoder = RangeDecoder::new(bytes);
        if !decoder.decode(&mut self.any) {
            return Ok(masks);
        }
        let index = BlockIndex::new(coords);
        for (block, coord) in coords.iter().enumerate() {
            let context = MaskContext::new(*coord, blocks_before(*coord, &index), &masks, reference);
            if !decoder.decode(&mut self.block[context.block()]) {
                continue;
            }
            let mut mask = VoxelMask::empty(edge);
            for voxel in 0..edge.block_voxels() {
                if decoder.decode(&mut self.voxel[context.voxel(edge, voxel, &mask)]) {
                    mask.insert(voxel);
                }
            }
            if mask.is_empty() {
                return Err(SyntaxError("a mask of unobserved voxels is empty"));
            }
            check_overrun(&decoder, "the masks end too early")?;
            masks.insert(block as u32, mask);
        }
        check_overrun(&decoder, "the masks end too early")?;
        Ok(masks)
    }
}

/// The blocks before a block along x, y and z.
#[must_use]
pub fn blocks_before(coord: BlockCoord, index: &BlockIndex) -> [Option<u32>; 3] {
    [[-1, 0, 0], [0, -1, 0], [0, 0, -1]].map(|offset| index.get(coord.offset(offset)))
}

/// Known masks around a block when its own is coded. They are those of the three blocks before it along the axes, and of the
/// block at its place in the reference.
#[derive(Debug)]
pub struct MaskContext<'a> {
    before: [Neighbour<'a>; 3],
    reference: Neighbour<'a>,
}

/// Another block's mask.
#[derive(Clone, Copy, Debug)]
enum Neighbour<'a> {
    Absent,
    Observed,
    Masked(&'a VoxelMask),
}

impl Neighbour<'_> {
    /// 0 observed, 1 unobserved, 2 not known.
    fn state(self, voxel: usize) -> usize {
        match self {
            Self::Absent => 2,
            Self::Observed => 0,
            Self::Masked(mask) => usize::from(mask.contains(voxel)),
        }
    }

    fn is_masked(self) -> bool {
        matches!(self, Self::Masked(_))
    }
}

impl<'a> MaskContext<'a> {
    /// Context of the block at `coord`. `before`: the blocks before it along x, y and z; `masks` holds theirs.
    #[must_use]
    pub fn new(
        coord: BlockCoord,
        before: [Option<u32>; 3],
        masks: &'a BTreeMap<u32, VoxelMask>,
        reference: Option<ReferenceBlocks<'a>>,
    ) -> Self {
        let before = before.map(|block| match block {
            None => Neighbour::Absent,
            Some(block) => masks.get(&block).map_or(Neighbour::Observed, Neighbour::Masked),
        });
        let reference = match reference.and_then(|r| Some((r, r.index.get(coord)?))) {
            None => Neighbour::Absent,
            Some((r, block)) => r.unobserved.get(&block).map_or(Neighbour::Observed, Neighbour::Masked),
        };
        Self { before, reference }
    }

    /// Context of the block's flag: how many of the blocks before it have a mask, and whether the reference has.
    #[must_use]
    pub fn block(&self) -> usize {
        self.before.iter().filter(|b| b.is_masked()).count() + 4 * usize::from(self.reference.is_masked())
    }

    /// Context of a voxel: the states of the voxels before it along x, y and z, in this block or the one before. The state of the
    /// voxel at its place in the reference belongs to it too.
    #[must_use]
    pub fn voxel(&self, edge: BlockEdge, voxel: usize, mask: &VoxelMask) -> usize {
        let n = edge.voxels();
        let mut context = self.reference.state(voxel);
        for (axis, stride) in [1, n, n * n].into_iter().enumerate() {
            let inside = !(voxel / stride).is_multiple_of(n);
            context = context * 3
                + if inside {
                    usize::from(mask.contains(voxel - stride))
                } else {
                    self.before[axis].state(voxel + (n - 1) * stride)
                };
        }
        context
    }
}
