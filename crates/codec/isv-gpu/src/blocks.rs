//! The blocks of a volume on a GPU: where each is, and a table to find them by.

use crate::commands::Commands;
use crate::kernel::{Kernel, Shader};
use crate::storage::{Usage, write};
use crate::{Gpu, GpuError, Storage};
use isv_volume::BlockCoord;
use std::hash::{BuildHasher, Hasher, RandomState};

/// Enters blocks into their table.
pub(crate) const INSERT: Shader = Shader {
    name: "block insert",
    parts: &[include_str!("shaders/block_table.wgsl"), include_str!("shaders/block_insert.wgsl")],
};

/// Blocks by index, in Morton order.
#[derive(Debug)]
pub(crate) struct BlockTable {
    /// Coordinate and slot of each.
    pub(crate) blocks: Storage,
    /// A key, then one more than a block's index, or 0.
    pub(crate) table: Storage,
}

impl BlockTable {
    /// Uploads blocks, whose samples are in these slots, and has the GPU enter them.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(crate) fn new(
        gpu: &Gpu,
        insert: &Kernel,
        coords: &[BlockCoord],
        slots: &[u32],
        commands: &mut Commands,
    ) -> Result<Self, GpuError> {
        let entries = (2 * coords.len()).next_power_of_two().max(64) as u64;
        let rows =
            coords.iter().zip(slots).map(|(coord, slot)| [coord.x, coord.y, coord.z, slot.cast_signed()]);
        let rows: Vec<[i32; 4]> = rows.collect();
        // New memory is zeros.
        let blocks = gpu.storage("blocks", 16 * rows.len().max(1) as u64, Usage::Kernels)?;
        let table = gpu.storage("block table", 4 * (1 + entries), Usage::Kernels)?;
        write(gpu, &blocks, 0, bytemuck::cast_slice(&rows));
        // What is found does not depend on it.
        let key = RandomState::new().build_hasher().finish() as u32;
        write(gpu, &table, 0, &key.to_le_bytes());
        let groups = (rows.len() as u32).div_ceil(64);
        commands.run(insert, None, &[rows.len() as u32, 0, 0, 0], &[&blocks, &table], groups)?;
        Ok(Self { blocks, table })
    }
}
