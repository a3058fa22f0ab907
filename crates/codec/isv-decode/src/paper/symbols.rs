//! What a frame's bytes say, before any arithmetic on samples.

use crate::ReferenceBlocks;
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use isv_volume::{BlockCoord, VoxelMask};
use std::collections::BTreeMap;

/// The decoded symbols of one frame: the encoder makes them, the decoder reads them back, [`crate::paper::reconstruct`] turns
/// them into samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSymbols {
    /// How blocks that have a reference are predicted.
    pub prediction: Prediction,
    /// Blocks in Morton order.
    pub coords: Vec<BlockCoord>,
    /// Unobserved voxels by block index; no empty masks.
    pub unobserved: BTreeMap<u32, VoxelMask>,
    /// For each block, the index in the reference of the block at its place, if it is predicted from it. Not coded: it
    /// follows from the two block sets (Sec. 3.4: a block that is absent from the reference is predicted by zero).
    pub references: Vec<Option<u32>>,
    /// One vector a block; zero where none is coded.
    pub motion: Vec<MotionVector>,
    /// K quantized coefficients a block, block after block, in scan order.
    pub levels: Vec<i32>,
}

impl FrameSymbols {
    /// For each block the one it is predicted from.
    #[must_use]
    pub fn find_references(
        coords: &[BlockCoord],
        prediction: Prediction,
        reference: Option<ReferenceBlocks>,
    ) -> Vec<Option<u32>> {
        match reference {
            Some(reference) if prediction != Prediction::None => {
                coords.iter().map(|c| reference.index.get(*c)).collect()
            }
            _ => vec![None; coords.len()],
        }
    }
}
