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
    /// Reads the masks of a frame's coded blocks, by their index among the coded.
    ///
    /// `volume`: the frame's samples, extended.
    ///
    /// # Errors
    /// A block whose mask is announced but empty, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        coords: &[BlockCoord],
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
        let index = BlockIndex::new(coords);
        for (block, coord) in coords.iter().enumerate() {
            let context = MaskContext::new(*coord, &index, &masks, reference);
            if !decoder.decode(&mut models.block[context.block()]) {
                continue;
            }
            let mut mask = VoxelMask::empty(BlockEdge::E8);
            let corners = cells.corners(*coord);
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

/// The cells of a volume whose corners differ in sign.
#[derive(Debug)]
pub struct CrossedCells<'a> {
    volume: &'a SparseVolume,
    index: BlockIndex,
}

impl<'a> CrossedCells<'a> {
    /// Of a volume with blocks of edge 8.
    #[must_use]
    pub fn new(volume: &'a SparseVolume) -> Self {
        Self { volume, index: volume.index() }
    }

    /// The voxels of a block that are corners of crossed cells. Cells with a corner in a block that is not there do not count.
    #[must_use]
    pub fn corners(&self, coord: BlockCoord) -> VoxelMask {
        let inside = self.signs_around(coord);
        let mut corners = VoxelMask::empty(BlockEdge::E8);
        // Cells by their lowest corner, which can be in the layer before the block.
        for z in 0..SIDE - 1 {
            for y in 0..SIDE - 1 {
                for x in 0..SIDE - 1 {
                    let corner = |c: usize| [x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)];
                    let signs = (0..8).map(corner).map(|[x, y, z]| inside[(z * SIDE + y) * SIDE + x]);
                    let seen = signs.fold(0, |seen, sign| seen | sign);
                    if seen != OUTSIDE | INSIDE {
                        continue;
                    }
                    for corner in (0..8).map(corner).filter(|c| c.iter().all(|v| (1..=8).contains(v))) {
                        let [x, y, z] = corner.map(|v| v - 1);
                        corners.insert((z * 8 + y) * 8 + x);
                    }
                }
            }
        }
        corners
    }

    /// Signs of a block's voxels and the layer around them, x fastest.
    fn signs_around(&self, coord: BlockCoord) -> [u8; SIDE * SIDE * SIDE] {
        let mut signs = [MISSING; SIDE * SIDE * SIDE];
        for (slot, block) in self.index.neighbourhood(coord).into_iter().enumerate() {
            let Some(block) = block else { continue };
            let samples = self.volume.block(block as usize);
            // Where the neighbour's voxels are in the array, and which of them.
            let span = |step: usize| [(0..1, 7), (1..9, 0), (9..10, 0)][step].clone();
            let [(xs, x0), (ys, y0), (zs, z0)] = [slot % 3, slot / 3 % 3, slot / 9].map(span);
            for z in zs.clone() {
                for y in ys.clone() {
                    for x in xs.clone() {
                        let sample =
                            samples[((z - zs.start + z0) * 8 + y - ys.start + y0) * 8 + x - xs.start + x0];
                        signs[(z * SIDE + y) * SIDE + x] = if sample < 0 { INSIDE } else { OUTSIDE };
                    }
                }
            }
        }
        signs
    }
}

const OUTSIDE: u8 = 1;
const INSIDE: u8 = 2;
const MISSING: u8 = 4;
