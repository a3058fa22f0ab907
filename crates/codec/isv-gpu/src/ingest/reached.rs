//! The blocks that triangles reach.

use super::OnGpu;
use super::kernels::Kernels;
use crate::commands::Commands;
use crate::storage::{Usage, write};
use crate::{Gpu, GpuError};
use isv_volume::BlockCoord;
use std::hash::{BuildHasher, Hasher, RandomState};

/// Entries of a table that begins small.
pub(super) const TABLE_ENTRIES: u32 = 1 << 14;
/// By how much a table that is full grows.
const GROWTH: u32 = 4;

/// Blocks in Morton order.
#[derive(Debug)]
pub(super) struct Reached {
    pub(super) coords: Vec<BlockCoord>,
    /// Triangles of each.
    pub(super) counts: Vec<u32>,
}

impl Reached {
    /// The blocks that the triangles of a mesh reach, unless they are more than `limit`. `entries`: of the table that was needed last.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn find(
        gpu: &Gpu,
        kernels: &Kernels,
        mesh: &OnGpu,
        entries: &mut u32,
        limit: usize,
    ) -> Result<Option<Self>, GpuError> {
        let mut wanted = *entries;
        loop {
            if let Some(reached) = Self::with_table(gpu, kernels, mesh, wanted)? {
                *entries = wanted;
                return Ok((reached.coords.len() <= limit).then_some(reached));
            }
            // With so many entries a table is not crowded by as many blocks as there may be.
            if wanted as usize / GROWTH as usize > limit || wanted >= 1 << 30 {
                return Ok(None);
            }
            wanted *= GROWTH;
        }
    }

    /// Finds the reached blocks with a table of so many entries; `None` if these are too few.
    fn with_table(
        gpu: &Gpu,
        kernels: &Kernels,
        mesh: &OnGpu,
        entries: u32,
    ) -> Result<Option<Self>, GpuError> {
        let words = u64::from(entries);
        // New memory is zeros.
        let keys = gpu.storage("reached blocks", 4 * words, Usage::Kernels)?;
        let counts = gpu.storage("triangles of reached blocks", 4 * (words + 2), Usage::Kernels)?;
        let keys_reading = gpu.storage("reached blocks to read", 4 * words, Usage::Reading)?;
        let counts_reading =
            gpu.storage("triangles of reached blocks to read", 4 * (words + 1), Usage::Reading)?;
        let secret = RandomState::new().build_hasher().finish() as u32;
        write(gpu, &counts, 4 * (words + 1), &secret.to_le_bytes());
        let parameters = super::Parameters { entries, ..mesh.parameters };
        let mut commands = Commands::new(gpu);
        let buffers = [mesh.vertices, mesh.triangles, &keys, &counts];
        commands.run(&kernels.find, None, parameters.words(), &buffers, mesh.groups())?;
        commands.copy(&keys, &keys_reading, 4 * words);
        commands.copy(&counts, &counts_reading, 4 * (words + 1));
        commands.submit()?;
        let read = gpu.read(&[(&keys_reading, 4 * words), (&counts_reading, 4 * (words + 1))])?;
        let [keys, counts] = [0, 1].map(|buffer| bytemuck::pod_collect_to_vec::<u8, u32>(&read[buffer]));
        if counts[entries as usize] != 0 {
            return Ok(None);
        }
        let entries = keys.iter().zip(counts).filter(|(key, _)| **key != 0);
        let mut blocks: Vec<_> = entries.map(|(key, count)| (parameters.block(key - 1), count)).collect();
        blocks.sort_unstable_by_key(|(coord, _)| coord.morton());
        let (coords, counts) = blocks.into_iter().unzip();
        Ok(Some(Self { coords, counts }))
    }
}

impl super::Parameters {
    /// The block of a key of the table, less one.
    fn block(&self, key: u32) -> BlockCoord {
        let [x, y] = self.key_bits;
        let [ox, oy, oz] = self.origin;
        let low = |key: u32, bits: u32| (key & ((1 << bits) - 1)) as i32;
        BlockCoord::from([ox + low(key, x), oy + low(key >> x, y), oz + (key >> (x + y)) as i32])
    }
}

/// Blocks in lines along x, by their indices, and where each line begins and the last one ends.
pub(super) fn lines(coords: &[BlockCoord]) -> (Vec<u32>, Vec<u32>) {
    let place = |block: &u32| {
        let [x, y, z] = coords[*block as usize].to_array();
        (z, y, x)
    };
    let mut order: Vec<u32> = (0..coords.len() as u32).collect();
    order.sort_unstable_by_key(place);
    let mut lines = vec![0];
    let along = order.chunk_by(|a, b| {
        let [(z, y, _), (w, v, _)] = [place(a), place(b)];
        (z, y) == (w, v)
    });
    for line in along {
        lines.push(lines[lines.len() - 1] + line.len() as u32);
    }
    (order, lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_run_along_x() {
        let coords = [[0, 0, 0], [5, 0, 0], [-3, 1, 0], [2, 0, 0], [2, 0, -1]].map(BlockCoord::from);
        assert_eq!(lines(&coords), (vec![4, 0, 3, 1, 2], vec![0, 1, 4, 5]));
        assert_eq!(lines(&[]), (vec![], vec![0]));
    }
}
