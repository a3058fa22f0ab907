//! A sparse volume on a GPU.

use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::pool::BLOCK_BYTES;
use crate::storage::{Usage, write};
use crate::store::Slots;
use crate::{GpuError, Storage, VolumeStore};
use isv_volume::{BlockCoord, BlockEdge, Grid, SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Bytes that are read from the GPU at a time.
const READ_AT_ONCE: u64 = 64 << 20;

/// A frame whose samples are on a GPU: the same as a [`SparseVolume`] of blocks of 8. Copies share them.
#[derive(Clone, Debug)]
pub struct GpuVolume {
    pub(crate) store: VolumeStore,
    pub(crate) grid: Grid,
    pub(crate) coords: Arc<Vec<BlockCoord>>,
    pub(crate) slots: Arc<Slots>,
    pub(crate) table: Arc<BlockTable>,
    pub(crate) unobserved: Arc<BTreeMap<u32, VoxelMask>>,
}

impl GpuVolume {
    /// Copies a volume to a GPU.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] if its blocks have another edge than 8 voxels; [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`]
    /// if it does not fit.
    pub fn upload(store: &VolumeStore, volume: &SparseVolume) -> Result<Self, GpuError> {
        if volume.grid().edge != BlockEdge::E8 {
            return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
        }
        let slots = Arc::new(Slots::new(store, store.pool().take(volume.block_count())?));
        store.pool().write(slots.get(), |block| volume.block(block));
        let (gpu, coords) = (store.gpu(), Arc::new(volume.coords().to_vec()));
        let mut commands = Commands::new(gpu);
        let table = BlockTable::new(gpu, store.insert(), &coords, slots.get(), &mut commands)?;
        commands.submit()?;
        let unobserved = Arc::new(volume.unobserved_masks().clone());
        let (store, grid) = (store.clone(), *volume.grid());
        Ok(Self { store, grid, coords, slots, table: Arc::new(table), unobserved })
    }

    /// The grid the samples live on.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of blocks.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.coords.len()
    }

    /// Copies the volume back.
    ///
    /// # Errors
    /// What went wrong on the GPU: [`GpuError::Lost`] and others.
    pub fn download(&self) -> Result<SparseVolume, GpuError> {
        let mut samples: Vec<i16> = Vec::with_capacity(self.grid.edge.block_voxels() * self.coords.len());
        let at_once = READ_AT_ONCE.min(self.store.gpu().binding_bytes()) / BLOCK_BYTES;
        for slots in self.slots.get().chunks(at_once as usize) {
            let bytes = self.read_blocks(slots)?;
            samples.extend(bytes.as_chunks::<2>().0.iter().map(|pair| i16::from_le_bytes(*pair)));
        }
        let (coords, unobserved) = (self.coords.to_vec(), BTreeMap::clone(&self.unobserved));
        Ok(SparseVolume::from_parts(self.grid, coords, samples, unobserved))
    }

    /// The samples in some slots, one block after the other.
    fn read_blocks(&self, slots: &[u32]) -> Result<Vec<u8>, GpuError> {
        let (gpu, pool) = (self.store.gpu(), self.store.pool());
        let reading = gpu.storage("samples to read", slots.len() as u64 * BLOCK_BYTES, Usage::Reading)?;
        let mut commands = Commands::new(gpu);
        let mut at = 0;
        for run in pool.runs(slots) {
            let (segment, from) = pool.place(run[0]);
            let bytes = run.len() as u64 * BLOCK_BYTES;
            commands.copy_between((segment.buffer(), from), (reading.buffer(), at), bytes);
            at += bytes;
        }
        drop(pool);
        commands.submit()?;
        Ok(gpu.read(&[(&reading, at)])?.remove(0))
    }

    /// The masks of unobserved voxels as kernels look at them. `numbers` has for each block one more than the number of its mask,
    /// or 0. `words` has the masks, 16 words each, voxel 0 in the lowest bit of the first. There is room for one mask at least.
    ///
    /// # Errors
    /// As [`Gpu::storage`](crate::Gpu).
    pub(crate) fn masks(&self) -> Result<MaskTable, GpuError> {
        let gpu = self.store.gpu();
        let mut numbers = vec![0u32; self.coords.len().max(1)];
        let mut words: Vec<u64> = Vec::with_capacity(8 * self.unobserved.len().max(1));
        for (number, (block, mask)) in (1..).zip(&*self.unobserved) {
            numbers[*block as usize] = number;
            words.extend(mask.words());
        }
        words.resize(words.len().max(8), 0);
        let table = MaskTable {
            numbers: gpu.storage("mask numbers", 4 * numbers.len() as u64, Usage::Kernels)?,
            words: gpu.storage("masks", 8 * words.len() as u64, Usage::Kernels)?,
        };
        write(gpu, &table.numbers, 0, bytemuck::cast_slice(&numbers));
        write(gpu, &table.words, 0, bytemuck::cast_slice(&words));
        Ok(table)
    }
}

/// Masks of unobserved voxels on a GPU.
#[derive(Debug)]
pub(crate) struct MaskTable {
    pub(crate) numbers: Storage,
    pub(crate) words: Storage,
}
