//! Unobserved voxels (W = 0 in Eq. 2), after the samples: only voxels of cells that the surface crosses can matter, so all
//! others count as observed.

use crate::ReferenceBlocks;
use crate::syntax::SyntaxError;
use crate::syntax::masks::{MaskContext, MaskModels as VoxelModels};
use isv_entropy::RangeDecoder;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// Models of the masks of a frame.
#[derive(Clone, Debug, Default)]
pub struct MaskModels(pub VoxelModels);

impl MaskModels {
    /// Reads the masks of a frame's blocks, coded or made up, by their index in its extended volume.
    ///
    /// # Errors
    /// A block whose mask is announced but empty, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        volume: &SparseVolume,
        reference: Option<ReferenceBlocks>,
    ) -> Result<BTreeMap<u32, VoxelMask>, SyntaxError> {
        let models = &mut self.0;
        let mut masks = BTreeMap::new();
        let mut decoder = RangeDecoder::new(bytes);
        if !decoder.decode(&mut models.any) {
            return Ok(masks);
        }
        let cells = CrossedCells::new(volume);
        for (block, coord) in volume.coords().iter().enumerate() {
            let corners = cells.corners(*coord);
            if corners.is_empty() {
                continue;
            }
            let context = MaskContext::new(*coord, cells.index(), &masks, reference);
            if !decoder.decode(&mut models.block[context.block()]) {
                continue;
            }
            let mut mask = VoxelMask::empty(BlockEdge::E8);
            for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
                if decoder.decode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, &mask)]) {
                    mask.insert(voxel);
                }
            }
            if mask.is_empty() {
                return Err(SyntaxError("a mask of unobserved voxels is empty"));
            }
            if decoder.overran() {
                return Err(SyntaxError("the masks end too early"));
            }
            masks.insert(block as u32, mask);
        }
        if decoder.overran() {
            return Err(SyntaxError("the masks end too early"));
        }
        Ok(masks)
    }
}

/// Voxels of a block and one layer around it, along an axis.
const SIDE: usize = 10;

/// The cells of a volume whose corners differ in sign and are all there and observed.
///
/// Signs are bits, a row along x a number.
#[derive(Debug)]
pub struct CrossedCells {
    index: BlockIndex,
    /// For each block, its rows of voxels inside the surface, and of unobserved ones, x in the lowest bit.
    rows: Vec<[(u8, u8); 64]>,
}

impl CrossedCells {
    /// Of a volume with blocks of edge 8.
    #[must_use]
    pub fn new(volume: &SparseVolume) -> Self {
        let rows = (0..volume.block_count()).map(|block| {
            let mask = volume.unobserved(block);
            let samples = volume.block(block).as_chunks::<8>().0;
            std::array::from_fn(|row| {
                let inside = (0..8).fold(0, |bits, x| bits | u8::from(samples[row][x] < 0) << x);
                let unobserved = mask.map_or(0, |mask| (mask.words()[row / 8] >> (row % 8 * 8)) as u8);
                (inside, unobserved)
            })
        });
        Self { index: volume.index(), rows: rows.collect() }
    }

    /// Look-up of the volume's blocks.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// The voxels of a block that are corners of crossed cells.
    #[must_use]
    pub fn corners(&self, coord: BlockCoord) -> VoxelMask {
        let (inside, outside) = self.rows_around(coord);
        // Crossed cells by their lowest corner, which can be in the layer before the block.
        let mut crossed = [0u16; SIDE * SIDE];
        for z in 0..SIDE - 1 {
            for y in 0..SIDE - 1 {
                let rows = [0, 1, SIDE, SIDE + 1].map(|step| z * SIDE + y + step);
                let all = |bits: &dyn Fn(usize) -> u16| {
                    let four = rows.iter().fold(u16::MAX, |all, row| all & bits(*row));
                    four & four >> 1
                };
                let there = all(&|row| inside[row] | outside[row]);
                crossed[z * SIDE + y] = there & !all(&|row| inside[row]) & !all(&|row| outside[row]);
            }
        }
        let mut corners = VoxelMask::empty(BlockEdge::E8);
        for (z, y) in (0..64).map(|row| (row / 8, row % 8)) {
            let cells = [0, 1, SIDE, SIDE + 1].iter().fold(0, |any, step| any | crossed[z * SIDE + y + step]);
            let voxels = (cells | cells << 1) >> 1;
            (0..8).filter(|x| voxels >> x & 1 != 0).for_each(|x| corners.insert((z * 8 + y) * 8 + x));
        }
        corners
    }

    /// Rows of a block's voxels and the layer around them, those inside the surface and those outside.
    fn rows_around(&self, coord: BlockCoord) -> ([u16; SIDE * SIDE], [u16; SIDE * SIDE]) {
        let (mut inside, mut outside) = ([0; SIDE * SIDE], [0; SIDE * SIDE]);
        for (slot, block) in self.index.neighbourhood(coord).into_iter().enumerate() {
            let Some(block) = block else { continue };
            let rows = &self.rows[block as usize];
            // Where the neighbour's rows are around the block, and which of them: its last, all, or its first.
            let span = |step: usize| [(0, 7..8), (1, 0..8), (9, 0..1)][step].clone();
            let [(y0, ys), (z0, zs)] = [slot / 3 % 3, slot / 9].map(span);
            let along_x = |bits: u8| match slot % 3 {
                0 => u16::from(bits >> 7),
                1 => u16::from(bits) << 1,
                _ => u16::from(bits & 1) << 9,
            };
            for z in zs.clone() {
                for y in ys.clone() {
                    let (negative, unobserved) = rows[z * 8 + y];
                    let to = (z - zs.start + z0) * SIDE + y - ys.start + y0;
                    inside[to] |= along_x(negative & !unobserved);
                    outside[to] |= along_x(!negative & !unobserved);
                }
            }
        }
        (inside, outside)
    }
}
