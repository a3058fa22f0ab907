//! The hash by which a reconstruction can be checked on any machine.

use isv_volume::{SparseVolume, VoxelMask};
use xxhash_rust::xxh64::Xxh64;

/// XXH64, seed 0, of the blocks in Morton order. A block is its coordinate (3 `i32`), its samples (`i16`, x fastest) and the
/// number of its unobserved voxels (`u32`). If that number is not 0, its mask follows: one bit a voxel, lowest voxel in the
/// lowest bit of the first byte. All little-endian.
#[must_use]
pub fn volume_hash(volume: &SparseVolume) -> u64 {
    let mut hasher = Xxh64::new(0);
    let mut bytes = Vec::with_capacity(2 * volume.grid().edge.block_voxels());
    for (index, coord) in volume.coords().iter().enumerate() {
        bytes.clear();
        coord.to_array().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        let samples = volume.block(index);
        let start = bytes.len();
        bytes.resize(start + 2 * samples.len(), 0);
        // Room first, so that this is a copy: to append two bytes at a time takes four times as long.
        let room = bytes[start..].as_chunks_mut().0;
        room.iter_mut().zip(samples).for_each(|(bytes, sample)| *bytes = sample.to_le_bytes());
        let mask = volume.unobserved(index);
        bytes.extend((mask.map_or(0, VoxelMask::count) as u32).to_le_bytes());
        mask.iter().flat_map(|m| m.words()).for_each(|w| bytes.extend(w.to_le_bytes()));
        hasher.update(&bytes);
    }
    hasher.digest()
}
