//! What a stream may ask of its decoder.

use super::sequence::Sequence;
use crate::DecodeError;
use isv_format::Packet;

/// Bounds on what a stream may ask of its decoder. They are checked before memory for samples is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most voxels in a frame, blocks times voxels a block. A voxel takes about four bytes at the peak of decoding.
    pub frame_voxels: usize,
    /// Most voxels in a frame beyond the first [`Self::FREE_VOXELS`] for each byte of its GOP so far. What is coded under models that
    /// have learned takes next to no bits, so without this bound a few hundred bytes fill the memory. [`usize::MAX`] for streams
    /// that are trusted.
    pub voxels_per_byte: usize,
}

impl Limits {
    /// Voxels that any stream may have in a frame, however short it is: 8192 blocks of 8.
    pub const FREE_VOXELS: usize = 1 << 22;
    /// The usual [`Self::voxels_per_byte`]: 128 blocks of 8. A box along the axes at the lowest quality, which is as flat as things
    /// get, has 2.6 coded blocks a byte (`docs/design/031-hostile-files.md`).
    pub const VOXELS_PER_BYTE: usize = 1 << 16;

    /// Most blocks of a frame, and whether it is the bytes that bound them.
    fn blocks(&self, block_voxels: usize, gop_bytes: u64) -> (usize, bool) {
        let bytes = usize::try_from(gop_bytes).unwrap_or(usize::MAX);
        let by_bytes = bytes.saturating_mul(self.voxels_per_byte).saturating_add(Self::FREE_VOXELS);
        (self.frame_voxels.min(by_bytes) / block_voxels, by_bytes < self.frame_voxels)
    }

    /// Whether a frame may have so many blocks.
    ///
    /// # Errors
    /// [`DecodeError::TooManyBlocks`] and [`DecodeError::TooFewBytes`].
    pub(crate) fn check(
        &self,
        packet: &Packet,
        sequence: Sequence,
        block_voxels: usize,
        blocks: usize,
    ) -> Result<(), DecodeError> {
        let bytes = sequence.gop_bytes(packet);
        let (limit, by_bytes) = self.blocks(block_voxels, bytes);
        let at = packet.at;
        match by_bytes {
            _ if blocks <= limit => Ok(()),
            true => Err(DecodeError::TooFewBytes { at, blocks, bytes, limit }),
            false => Err(DecodeError::TooManyBlocks { at, blocks, limit }),
        }
    }
}

impl Default for Limits {
    /// `3 * 2^30` voxels, six million blocks of 8: a building at 5 mm. Where addresses have 32 bits, `2^27`: all that a frame takes
    /// at the peak of decoding, with the frame before, then fits.
    fn default() -> Self {
        let frame_voxels = if usize::BITS < 64 { 1 << 27 } else { 3 << 30 };
        Self { frame_voxels, voxels_per_byte: Self::VOXELS_PER_BYTE }
    }
}
